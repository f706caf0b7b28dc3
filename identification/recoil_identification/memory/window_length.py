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
from recoil_identification.memory.limited_memory import limited_memory_least_squares
from recoil_identification.memory.window_factors import FloatArray

SHORTEST = 10
"""Samples of the shortest window that is tried unasked; four per parameter where that is more."""
STEPS_PER_OCTAVE = 2
"""Windows that are tried unasked for each doubling."""
LEAST_BATCHES = 8
"""Batches of predictions, each as long as the longest window, from which their scatter is told."""


@dataclass(frozen=True)
class TriedWindow:
    """What one window's predictions were worth.

    Attributes
    ----------
    window
        Samples.
    rms_error
        Root mean square of the prediction's error, in the response's unit.
    excess
        Mean squared error above the best window's, over the best window's.
    u_excess
        Its standard uncertainty, from the scatter of batches as long as the longest window, so that errors that are
        correlated in time are counted as such. Zero for the best window.
    relative_standard_error
        Median standard error of the first parameter over its magnitude, for errors that are independent.
    """

    window: int
    rms_error: float
    excess: float
    u_excess: float
    relative_standard_error: float


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
    *,
    windows: Sequence[int] | None = None,
    ahead: int = 1,
    weights: ArrayLike | None = None,
    tolerance: float = 1.0,
    workers: int = 1,
) -> WindowChoice:
    """Choose a window by the error of what its estimates predict.

    Parameters
    ----------
    regressors : array_like, shape (n_samples, n_parameters)
        A row with a NaN is a missing sample.
    response : array_like, shape (n_samples,)
    windows
        Lengths to try; if omitted, from `SHORTEST` samples to an eighth of the record, two for each doubling.
    ahead
        Samples between the end of a window and the response that it predicts. Give more than the samples over which
        the errors are correlated, behind a low-pass filter for one: short windows would follow the errors.
    weights : array_like, shape (n_samples,), optional
        As for `limited_memory_least_squares`; squared errors are weighted alike.
    tolerance
        Standard uncertainties of its excess by which a longer window may be worse than the best.
    workers
        As for `limited_memory_least_squares`.

    Raises
    ------
    ValueError
        For windows that are too short or given twice, or limits out of range; otherwise as
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
    if not tolerance >= 0.0:
        raise ValueError(f"tolerance must not be negative, found {tolerance}")
    n_samples, n_parameters = columns.shape
    lengths = _lengths(n_samples, n_parameters) if windows is None else sorted(int(w) for w in windows)
    if len(lengths) < 2 or len(set(lengths)) < len(lengths):
        raise ValueError(f"windows must be two different lengths or more, found {list(lengths)}")
    root = np.sqrt(np.ones(n_samples) if weights is None else np.asarray(weights, dtype=np.float64))[ahead:]
    squares, relative = [], []
    for window in lengths:
        estimates = limited_memory_least_squares(columns, outputs, window, weights=weights, workers=workers)
        predicted = np.einsum("ij,ij->i", columns[ahead:], estimates.parameters[:-ahead])
        squares.append((root * (outputs[ahead:] - predicted)) ** 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            relative.append(np.abs(estimates.standard_errors[:-ahead, 0] / estimates.parameters[:-ahead, 0]))
    table = np.array(squares)
    common = np.isfinite(table).all(axis=0) & (root > 0.0)
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
            rms_error=float(np.sqrt(mean[i])),
            excess=float((mean[i] - mean[best]) / scale),
            u_excess=_u_mean(table[i] - table[best], lengths[-1] + ahead) / scale,
            relative_standard_error=float(np.median(relative[i][common])),
        )
        for i, window in enumerate(lengths)
    )
    chosen = max(i for i, one in enumerate(tried) if one.excess <= tolerance * one.u_excess or i == best)
    return WindowChoice(lengths[chosen], tried, n_predictions, _reason(tried, chosen, best, ahead, tolerance))


def _lengths(n_samples: int, n_parameters: int) -> list[int]:
    """Lengths from a few samples to an eighth of the record, in equal ratios."""
    shortest, longest = max(SHORTEST, 4 * n_parameters), n_samples // 8
    if longest < 2 * shortest:
        raise IdentificationError(
            "the record is too short to choose a window from",
            expected=f"{16 * shortest} samples or more",
            found=str(n_samples),
            remedy="give the windows to try",
        )
    count = 1 + round(STEPS_PER_OCTAVE * np.log2(longest / shortest))
    return sorted({round(length) for length in np.geomspace(shortest, longest, count)})


def _u_mean(values: FloatArray, batch: int) -> float:
    """Give the standard uncertainty of a mean, from means of batches: nearly independent where values are not."""
    count = max(values.size // batch, min(LEAST_BATCHES, values.size))
    means = np.array([part.mean() for part in np.array_split(values, count)])
    return float(means.std(ddof=1) / np.sqrt(count))


def _reason(tried: Sequence[TriedWindow], chosen: int, best: int, ahead: int, tolerance: float) -> str:
    """Say in a sentence why a window was chosen."""
    window, of = tried[chosen].window, f"{tried[0].window} to {tried[-1].window} samples"
    step = "the next response" if ahead == 1 else f"the response {ahead} samples later"
    if chosen == best:
        text = f"of windows of {of} the one of {window} predicts {step} best"
    else:
        text = (
            f"of windows of {of} the one of {tried[best].window} predicts {step} best,"
            f" and {window} is the longest whose mean squared error is within {tolerance:g} standard uncertainties"
            " of it"
        )
    if chosen == len(tried) - 1:
        return f"{text}: the record shows no variation that a shorter memory would follow"
    beyond = tried[chosen + 1]
    return f"{text}: with {beyond.window} samples it is {100 * beyond.excess:.2g} % larger, as the parameters vary"
