"""The lower edge of the differences between two clocks' stamps, side by side of the steps; see `clock_fit`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clock_breaks import FEWEST

Seconds = NDArray[np.float64]

RESOLUTION_S = 1e-9
"""Resolution of stamps in whole nanoseconds."""

_POINTS = 96
"""Lower points over the whole record."""
_AGREEING_WIDTHS = 4.0
"""A third of normal errors lies within 0.86 sigma: what is four times that away is no error of the same kind."""


@dataclass(frozen=True, eq=False)
class Side:
    """The frames between two steps, the lower points that agree, and where their lower edge lies."""

    frames: NDArray[np.intp]
    points: NDArray[np.intp]
    level_s: float


def side_of(frames: NDArray[np.intp], lowest: NDArray[np.intp], flat: Seconds) -> Side:
    """Return a side of which those lower points count that agree about its level.

    Parameters
    ----------
    frames, lowest
        Frames of the side, and its lower points.
    flat : ndarray of float64, shape (n_frames,)
        Differences ``host - device`` of all frames, the drift taken out.
    """
    points = lowest[_agreeing(flat[lowest])]
    return Side(frames, points, float(np.median(flat[points])))


def _share(size: int, whole: int) -> int:
    """Return how many lower points a side of a size gets."""
    return int(np.clip(round(_POINTS * size / whole), 1 if size < 2 * FEWEST else 2, max(size // FEWEST, 1)))


def lower_points(r: Seconds, frames: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the lowest frame of each of some runs of frames of one side.

    Parameters
    ----------
    r : ndarray of float64, shape (n_frames,)
        Differences ``host - device`` of all frames.
    frames
        Of the side.
    """
    runs = np.array_split(frames, _share(frames.size, r.size))
    return np.array([run[np.argmin(r[run])] for run in runs], dtype=np.intp)


def _agreeing(values: Seconds) -> NDArray[np.bool_]:
    """Return which values lie about the shortest interval that holds a third of them; the others were late."""
    ordered = np.sort(values)
    third = max(math.ceil(values.size / 3), 2)
    if ordered.size <= third:
        return np.ones(values.size, dtype=bool)
    widths = ordered[third - 1 :] - ordered[: ordered.size - third + 1]
    at = int(np.argmin(widths))
    width_s = max(float(widths[at]), RESOLUTION_S)
    middle = (ordered[at] + ordered[at + third - 1]) / 2
    return np.asarray(np.abs(values - middle) <= _AGREEING_WIDTHS * width_s)


def slope_between(
    x: Seconds, r: Seconds, points: Sequence[NDArray[np.intp]], largest_drift: float
) -> tuple[float, bool]:
    """Return the weighted median of the slopes between points of the same side, and whether there is any.

    Parameters
    ----------
    x, r : ndarray of float64, shape (n_frames,)
        The device's stamps, and the differences ``host - device``, s.
    points
        Of each side.
    largest_drift
        Slopes beyond it are no clock's.
    """
    slopes, weights = [], []
    for p in points:
        one, other = np.triu_indices(p.size, k=1)
        dx = x[p][other] - x[p][one]
        apart = dx > 0
        between = (r[p][other] - r[p][one])[apart] / dx[apart]
        possible = np.abs(between) <= largest_drift
        slopes.append(between[possible])
        weights.append(dx[apart][possible])
    slope, weight = np.concatenate(slopes), np.concatenate(weights)
    if not slope.size:
        return 0.0, False
    order = np.argsort(slope)
    reached = np.cumsum(weight[order])
    return float(slope[order][np.searchsorted(reached, reached[-1] / 2)]), True
