"""Single frames that cannot belong to the motion around them: a spike, a duplicated picture.

What is judged is the residual against a model of the motion, so that the motion's own quick changes are
no outliers. A step is not one either: it is a frame that is missing from the file, and must show.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.noise import noise_sigma

LIMIT_SIGMA = 6.0
"""Standard deviations of the difference to what the neighbours predict: one in 5e8 frames exceeds it by chance."""
NOISE_SIGMA = 4.0
"""Multiple of the noise that noise alone reaches among a dozen values."""
MOST_LEFT = 0.2
"""Share of the largest departure that may be left without a spike; beside a step much of it is."""


def isolated_outliers(times_s: Array, residual: Array, sigma: float) -> Flags:
    """Find values that lie off the cubic through two neighbours on either side.

    The furthest off is looked at first, and those beside it, for beside a gap a spike is distinguished from its
    neighbour only by trying. One counts if the others agree with one another without it.

    Parameters
    ----------
    times_s, residual : ndarray, shape (n,)
        Times, strictly increasing, and residuals; no value is missing.
    sigma
        White noise of the residual.

    Returns
    -------
    ndarray of bool, shape (n,)
        Flags of contradicting values; the first and the last two are never judged.
    """
    out = np.zeros(residual.size, dtype=bool)
    suspects = _off(times_s, residual, sigma)
    while suspects.size and np.max(suspects) > LIMIT_SIGMA:
        i = 2 + int(np.argmax(suspects))
        around = np.arange(max(i - 6, 0), min(i + 7, residual.size))
        around = around[~out[around]]
        candidates = [c for c in range(max(i - 2, 2), min(i + 3, residual.size - 2)) if not out[c]]
        left = [_worst(times_s, residual, sigma, around[around != c]) for c in candidates]
        best = int(np.argmin(left))
        out[candidates[best]] = left[best] <= max(NOISE_SIGMA, MOST_LEFT * float(suspects[i - 2]))
        # what this one, or the step that it stands beside, says of its neighbours is settled by it
        suspects[max(i - 6, 0) : i + 3] = 0.0
    return out


def stuck_repeats(positions: Array, residual: Array, sigma: float) -> Flags:
    """Find exact repeats of the position before, where the model says that it has moved on.

    Parameters
    ----------
    positions, residual : ndarray, shape (n,)
        Positions as recorded, and their difference to the model.
    sigma
        White noise of the positions.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    index = np.arange(positions.size)
    fresh = np.concatenate([[True], np.diff(positions) != 0])
    first = np.maximum.accumulate(np.where(fresh, index, 0))
    moved = np.abs(residual - residual[first]) > LIMIT_SIGMA * sigma
    return np.asarray(~fresh & moved)


def contradicting(times_s: Array, positions: Array, residual: Array, sigma: float) -> Flags:
    """Find the frames that contradict their neighbours: stuck repeats, and of what is left the isolated outliers.

    Parameters
    ----------
    times_s, positions, residual : ndarray, shape (n,)
        Instants of the frames, strictly increasing; what was recorded, and its difference to the model of the motion.
    sigma
        White noise of the positions.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    odd = stuck_repeats(positions, residual, sigma)
    fresh = np.flatnonzero(~odd)
    odd[fresh[isolated_outliers(times_s[fresh], residual[fresh], sigma)]] = True
    return odd


def agreeing(times_s: Array, positions: Array) -> Array:
    """Return positions, those that contradict their neighbours lost, shape (n,); the motion between frames is smooth.

    Parameters
    ----------
    times_s, positions : ndarray, shape (n,)
        Times, strictly increasing, and positions; lost ones NaN.
    """
    seen = np.flatnonzero(np.isfinite(positions))
    known, sound = positions[seen], np.array(positions, dtype=np.float64)
    sigma = noise_sigma(known)
    if sigma > 0:
        sound[seen[contradicting(times_s[seen], known, known, sigma)]] = np.nan
    return sound


def _worst(times_s: Array, values: Array, sigma: float, at: NDArray[np.int64]) -> float:
    off = _off(times_s[at], values[at], sigma)
    return float(off.max()) if off.size else 0.0


def _off(times_s: Array, values: Array, sigma: float) -> Array:
    """Return how far each value is off the cubic through its four neighbours, standard deviations, shape (n - 4,)."""
    n = values.size
    if n < 5:
        return np.empty(0)
    at = times_s[2 : n - 2]
    neighbours = [0, 1, 3, 4]
    predicted, variance = np.zeros(n - 4), np.ones(n - 4)
    for j in neighbours:
        weight = np.ones(n - 4)
        for k in neighbours:
            if k != j:
                others, own = times_s[k : n - 4 + k], times_s[j : n - 4 + j]
                weight *= (at - others) / (own - others)
        predicted += weight * values[j : n - 4 + j]
        variance += weight**2
    return np.asarray(np.abs(values[2 : n - 2] - predicted) / (sigma * np.sqrt(variance)))
