"""Unknown samples from the known ones around them, by an autoregressive model.

A. J. E. M. Janssen, R. N. J. Veldhuis and L. B. Vries, "Adaptive interpolation of discrete-time signals that can
be modeled as autoregressive processes", IEEE Trans. Acoust. Speech Signal Process. 34(2), 1986: the coefficients
that predict the signal best and the unknown samples that are predicted best are found in turn; either step is a
linear least-squares problem, and neither raises the sum of squared prediction errors. Bounds on the unknown
samples make the second one a problem with bounds.

A model of more coefficients than the known samples show waves goes on as it likes: choose the order accordingly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.arguments import require_alike
from recoil_processing.gaps import bridge

MOST_ORDER = 48
"""Order of the model: a dozen modes and the pulse."""
KNOWN_PER_COEFFICIENT = 3
"""Known samples per coefficient at the least."""
ITERATIONS = 30
SETTLED = 1e-4
"""Share of the signal's spread by which no unknown sample moves any more."""


@dataclass(frozen=True, eq=False)
class Interpolation(ReadOnlyArrays):
    """Unknown samples as the known ones predict them.

    Attributes
    ----------
    samples : ndarray, shape (n,)
        Samples, the known ones untouched.
    u : ndarray, shape (n,)
        Standard uncertainty of an unknown sample if the model were true and its coefficients known; 0 of a known one.
        It is a lower bound.
    settled
        Whether the last iteration moved nothing by more than `SETTLED`.
    at_bound
        Unknown samples that the bounds hold.
    """

    samples: Array
    u: Array
    order: int
    settled: bool
    at_bound: int


def interpolate_unknown(
    samples: Array,
    unknown: Flags,
    *,
    lowest: Array | None = None,
    highest: Array | None = None,
    most_order: int = MOST_ORDER,
) -> Interpolation | str:
    """Interpolate unknown samples of one piece of record.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples, evenly spaced. What stands at an unknown sample is not looked at.
    unknown : ndarray of bool, shape (n,)
    lowest, highest : ndarray, shape (n,), optional
        Bounds of the unknown samples, one to each at most; infinite where there is none.

    Returns
    -------
    Interpolation or str
        Interpolation, or the reason where there are too few known samples for a model, or no solution was found.

    Raises
    ------
    ValueError
        If a known sample is not finite, shapes do not fit, an unknown sample has two bounds, or the order is not
        positive.
    """
    require_alike(samples=samples, unknown=unknown)
    if most_order < 1:
        raise ValueError(f"most_order must be at least 1, not {most_order}")
    if not np.all(np.isfinite(samples[~unknown])):
        raise ValueError("known samples must be finite; flag lost ones as unknown")
    at = np.flatnonzero(unknown)
    known = samples.size - at.size
    order = min(most_order, known // (KNOWN_PER_COEFFICIENT + 1))
    if order < 2:
        return f"{known} known samples are too few to predict how the signal goes on"
    level = float(np.median(samples[~unknown]))
    scale = float(np.max(np.abs(samples[~unknown] - level)))
    if at.size == 0 or scale == 0:
        filled = np.where(unknown, level, samples)
        return Interpolation(filled, np.zeros(samples.size), order, True, 0)
    low = np.full(at.size, -np.inf) if lowest is None else (lowest[at] - level) / scale
    high = np.full(at.size, np.inf) if highest is None else (highest[at] - level) / scale
    if np.any(np.isfinite(low) & np.isfinite(high)):
        raise ValueError("an unknown sample may be bounded on one side only")
    values = bridge(np.where(unknown, np.nan, (samples - level) / scale))
    values[at] = np.clip(values[at], low, high)
    settled, held = False, 0
    for _ in range(ITERATIONS):
        filter_ = prediction_filter(values, order)
        design, target = _prediction_errors(values, filter_, at)
        solution = _bounded_least_squares(design, target, low, high)
        if solution is None:
            return "no way to go on within the bounds was found"
        moved, held = solution
        settled = float(np.max(np.abs(moved - values[at]))) < SETTLED
        values[at] = moved
        if settled:
            break
    error = np.convolve(values, filter_, mode="valid")
    variance = float(error @ error) / max(error.size - order - at.size, 1)
    u = np.zeros(samples.size)
    u[at] = scale * math.sqrt(variance) * np.linalg.norm(np.linalg.pinv(design), axis=1)
    filled = samples.copy()
    filled[at] = level + scale * values[at]
    return Interpolation(filled, u, order, settled, held)


def prediction_filter(samples: Array, order: int) -> Array:
    """Return the filter of least squared prediction error, ``1, a_1, ..., a_order``, shape (order + 1,).

    Covariance method: no zeros are assumed beyond the ends, so that waves which the piece cuts are kept as they are.
    """
    lagged = np.lib.stride_tricks.sliding_window_view(samples, order + 1)[:, ::-1]
    products = lagged.T @ lagged
    # white noise 90 dB below the signal: the products of a noise-free sine are singular
    ridge = 1e-9 * float(np.trace(products)) / (order + 1) * np.eye(order)
    return np.concatenate([[1.0], np.linalg.solve(products[1:, 1:] + ridge, -products[1:, 0])])


def _prediction_errors(values: Array, filter_: Array, at: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return the prediction errors as ``design @ unknown - target``, rows of unknown samples only."""
    order = filter_.size - 1
    rows = values.size - order
    without = values.copy()
    without[at] = 0.0
    target = -np.convolve(without, filter_, mode="valid")
    design = np.zeros((rows, at.size))
    for lag, weight in enumerate(filter_):
        row = at + lag - order
        inside = (row >= 0) & (row < rows)
        design[row[inside], np.flatnonzero(inside)] = weight
    touched = np.any(design != 0, axis=1)
    return design[touched], target[touched]


def _bounded_least_squares(design: Array, target: Array, low: Array, high: Array) -> tuple[Array, int] | None:
    """Return the solution within bounds and how many unknowns they hold; None where none was found.

    With the unknowns without a bound first, the triangle's lower right block is the problem of the others alone.
    """
    bounded = np.isfinite(low) | np.isfinite(high)
    order = np.argsort(bounded, kind="stable")
    q, r = np.linalg.qr(design[:, order])
    right = q.T @ target
    found = np.linalg.lstsq(r, right, rcond=None)[0]
    held, first = 0, int(np.count_nonzero(~bounded))
    side = np.where(np.isfinite(low), 1.0, -1.0)[order][first:]
    bound = np.where(np.isfinite(low), low, high)[order][first:]
    if np.any(side * (found[first:] - bound) < 0):
        from scipy.optimize import nnls

        block = r[first:, first:]
        try:
            beyond, _ = nnls(block * side, right[first:] - block @ bound)
        except RuntimeError:
            return None
        found[first:] = bound + side * beyond
        found[:first] = np.linalg.lstsq(
            r[:first, :first], right[:first] - r[:first, first:] @ found[first:], rcond=None
        )[0]
        held = int(np.count_nonzero(beyond == 0))
    values = np.empty_like(found)
    values[order] = found
    return values, held
