"""How long the memory of limited-memory least squares should be, from the record itself.

A long window averages more noise away, a short one follows a parameter that varies. Which of the two matters more is
told by prediction: each window's estimate is held against a later response that it has not seen. Its mean squared
error is the noise's own variance, which is common to all windows, plus the estimate's variance, plus the square of
what the parameter has moved on (predictive least squares: J. Rissanen, IMA J. Math. Control Inf. 3, 1986, 211-222).
Of windows that the record cannot tell apart the longest is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_identification.memory.limited_memory import limited_memory_least_squares

LEAST_BATCHES = 8
"""Batches of predictions, each as long as the longest window, from which their scatter is found."""


@dataclass(frozen=True)
class TriedWindow:
    """The prediction error of one window.

    Attributes
    ----------
    window
        Samples.
    excess
        Mean squared error above the best window's, over the best window's.
    u_excess
        Standard uncertainty of the excess, from the scatter of batches as long as the longest window, so that errors
        that are correlated in time are counted as such. Zero for the best window.
    """

    window: int
    excess: float
    u_excess: float


@dataclass(frozen=True)
class WindowChoice:
    """A window's length, and why.

    Attributes
    ----------
    window
        Samples.
    tried
        Shortest first.
    n_predictions
        Predictions of each window, of the same samples for all.
    reason
        A sentence.
    """

    window: int
    tried: tuple[TriedWindow, ...]
    n_predictions: int
    reason: str


def choose_window(
    regressors: ArrayLike,
    response: ArrayLike,
    windows: Sequence[int],
    *,
    ahead: int = 1,
) -> WindowChoice:
    """Choose a window by the error of what its estimates predict.

    Parameters
    ----------
    regressors : array_like, shape (n_samples, n_parameters)
        A row with a NaN is a missing sample.
    response : array_like, shape (n_samples,)
    windows
        Lengths to try, two or more.
    ahead
        Samples between the end of a window and the response that it predicts. Give more than the samples over which
        the errors are correlated, behind a low-pass filter for one: short windows would follow the errors.

    Raises
    ------
    ValueError
        For windows that are too short or given twice, or nothing ahead; otherwise as
        `limited_memory_least_squares`.
    IdentificationError
        If the record is too short, or too little of it identified, to compare windows.
    """
    columns, outputs = np.asarray(regressors, dtype=np.float64), np.asarray(response, dtype=np.float64)
    if columns.ndim != 2 or outputs.ndim != 1:
        raise ValueError(
            f"regressors must have two dimensions and response one, found shapes {columns.shape} and {outputs.shape}"
        )
    if ahead < 1:
        raise ValueError(f"ahead must be at least 1, found {ahead}")
    lengths = sorted(int(window) for window in windows)
    if len(lengths) < 2 or len(set(lengths)) < len(lengths):
        raise ValueError(f"windows must be two different lengths or more, found {list(lengths)}")
    squares = []
    for window in lengths:
        estimates = limited_memory_least_squares(columns, outputs, window)
        predicted = np.einsum("ij,ij->i", columns[ahead:], estimates.parameters[:-ahead])
        squares.append((outputs[ahead:] - predicted) ** 2)
    table = np.array(squares)
    common = np.isfinite(table).all(axis=0)
    n_predictions = int(common.sum())
    if n_predictions < LEAST_BATCHES:
        raise IdentificationError(
            "too few samples to compare windows",
            expected=f"{LEAST_BATCHES} predictions or more that every window makes",
            found=f"{n_predictions} by windows of {lengths[0]} to {lengths[-1]} samples",
            remedy="try shorter windows, or take a longer record",
        )
    table = table[:, common]
    mean = table.mean(axis=1)
    best = int(np.argmin(mean))
    scale = float(mean[best]) or 1.0
    tried = tuple(
        TriedWindow(
            window=window,
            excess=float((mean[i] - mean[best]) / scale),
            u_excess=_u_mean(table[i] - table[best], lengths[-1] + ahead) / scale,
        )
        for i, window in enumerate(lengths)
    )
    chosen = max(i for i, one in enumerate(tried) if one.excess <= one.u_excess or i == best)
    return WindowChoice(lengths[chosen], tried, n_predictions, _reason(tried, chosen, best, ahead))


def _u_mean(values: Array, batch: int) -> float:
    """Give the standard uncertainty of a mean, from means of batches: nearly independent where values are not."""
    count = max(values.size // batch, min(LEAST_BATCHES, values.size))
    means = np.array([part.mean() for part in np.array_split(values, count)])
    return float(means.std(ddof=1) / np.sqrt(count))


def _reason(tried: Sequence[TriedWindow], chosen: int, best: int, ahead: int) -> str:
    """Say in a sentence why a window was chosen."""
    window, of = tried[chosen].window, f"{tried[0].window} to {tried[-1].window} samples"
    step = "the next response" if ahead == 1 else f"the response {ahead} samples later"
    if chosen == best:
        text = f"of windows of {of} the one of {window} predicts {step} best"
    else:
        text = (
            f"of windows of {of} the one of {tried[best].window} predicts {step} best,"
            f" and {window} is the longest whose mean squared error is within one standard uncertainty of it"
        )
    if chosen == len(tried) - 1:
        return f"{text}: the record shows no variation that a shorter memory would follow"
    beyond = tried[chosen + 1]
    return f"{text}: with {beyond.window} samples it is {100 * beyond.excess:.2g} % larger, as the parameters vary"
