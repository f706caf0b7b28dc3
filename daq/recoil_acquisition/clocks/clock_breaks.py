"""Places where a device's clock may have stepped, which stretches of its stamps belong together, and in which order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.normal_distribution import MAD_TO_SIGMA

Instants = NDArray[np.int64]
Seconds = NDArray[np.float64]

FEWEST = 5
"""Number of stamps between two breaks below which those are taken for wrong ones."""

_PARTS_BACK = 64
"""Parts of a side that are looked back at: enough for any stall, and a record of many breaks stays quick."""

_JUMP_SIGMAS = 8.0
_LEAST_U_PERIOD_S = 1e-6
"""Least uncertainty of a period: a clock's ticks are seldom finer, and a period within them is not known better."""

_NEAR_S = 10.0
"""Time on each side of a break that says whether the lower edge lies elsewhere: longer than stalls, short for drift."""


def find_breaks(x: Seconds, y: Seconds, counts: Instants | None, smallest_step_s: float) -> NDArray[np.intp]:
    """Return the frames before which the device's stamps jump as neither their own spacing nor the host's explains."""
    dx, dy = np.diff(x), np.diff(y)
    if counts is not None:
        unusual = np.abs(dx - np.diff(counts) * _period_s(x, counts)) > smallest_step_s / 2
    else:
        low, high = np.quantile(dx, [0.02, 0.98])
        unusual = (dx < low - smallest_step_s / 2) | (dx > high + smallest_step_s / 2)
    return np.flatnonzero(unusual & (np.abs(dy - dx) > smallest_step_s / 2)) + 1


def jumps_by_count(x: Seconds, counts: Instants, smallest_step_s: float) -> NDArray[np.intp]:
    """Return the frames before which the device's stamps jump as the packet counter does not explain.

    Without the host's stamps this does not distinguish a step of the clock from a pause of the device. What is
    within eight times the usual scatter is no jump.
    """
    if x.size < 2:
        return np.zeros(0, dtype=np.intp)
    beyond = np.diff(x) - np.diff(counts) * _period_s(x, counts)
    limit_s = max(smallest_step_s, _JUMP_SIGMAS * MAD_TO_SIGMA * float(np.median(np.abs(beyond))))
    return np.flatnonzero(np.abs(beyond) > limit_s) + 1


def step_by_count(x: Seconds, counts: Instants, last: int, at: int) -> tuple[float, float] | None:
    """Return by how much the stamps jump between two frames beyond what the packet counter explains.

    Parameters
    ----------
    x : ndarray of float64, shape (n_frames,)
        The device's stamps, s.
    counts : ndarray of int64, shape (n_frames,)
        The packet counter, unwrapped.
    last, at
        The frame before the jump and the one behind it.

    Returns
    -------
    tuple of float or None
        The jump and its standard uncertainty, s: that of as many periods as the counter went on. None if it
        did not go on.
    """
    ahead = int(counts[at] - counts[last])
    period_s = _period_s(x, counts)
    if ahead <= 0 or not period_s > 0:
        return None
    scatter_s = MAD_TO_SIGMA * float(np.median(np.abs(np.diff(x) - np.diff(counts) * period_s)))
    return float(x[at] - x[last]) - ahead * period_s, max(scatter_s, _LEAST_U_PERIOD_S) * ahead


def _period_s(x: Seconds, counts: Instants) -> float:
    """Return the median time of one count; 0 if the counter never goes on."""
    ahead = np.diff(counts)
    counted = ahead > 0
    return float(np.median(np.diff(x)[counted] / ahead[counted])) if counted.any() else 0.0


def keep_order(instants: Instants, placed: NDArray[np.intp]) -> Instants:
    """Spread evenly between their neighbours what was placed out of order.

    Parameters
    ----------
    instants : ndarray of int64, shape (n_frames,)
        Instants, changed in place, ns.
    placed : ndarray of int, shape (n_placed,)
        Frames whose instants are less sure than their neighbours', ascending.

    Returns
    -------
    ndarray of int64, shape (n_frames,)
        Instants in order; a frame at an end of the record is put as far out as its two neighbours are apart.
    """
    for run in np.split(placed, np.flatnonzero(np.diff(placed) > 1) + 1):
        if not run.size or run.size == instants.size:
            continue
        first, behind = int(run[0]), int(run[-1]) + 1
        if (np.diff(instants[max(first - 1, 0) : behind + 1]) > 0).all():
            continue
        if first == 0:
            apart = max(int(instants[behind + 1] - instants[behind]), 1) if behind + 1 < instants.size else 1
            instants[:behind] = instants[behind] - apart * np.arange(behind, 0, -1)
        elif behind == instants.size:
            apart = max(int(instants[first - 1] - instants[first - 2]), 1) if first > 1 else 1
            instants[first:] = instants[first - 1] + apart * np.arange(1, run.size + 1)
        else:
            wide = int(instants[behind] - instants[first - 1])
            instants[run] = instants[first - 1] + wide * np.arange(1, run.size + 1) // (run.size + 1)
    return instants


def join_parts(
    x: Seconds, r: Seconds, breaks: Sequence[int], smallest_step_s: float
) -> tuple[list[NDArray[np.intp]], NDArray[np.intp]]:
    """Join what lies between breaks to the sides of true steps; return them, and the frames with wrong stamps."""
    parts = np.split(np.arange(r.size), [b for b in breaks if 0 < b < r.size])
    long_enough = [part for part in parts if part.size >= FEWEST]
    if not long_enough:
        return [np.arange(r.size)], np.zeros(0, dtype=np.intp)
    sides = [[long_enough[0]]]
    for part in long_enough[1:]:
        before = np.concatenate(sides[-1][-_PARTS_BACK:])
        before = before[np.abs(x[before] - x[before[-1]]) <= _NEAR_S]
        after = part[np.abs(x[part] - x[part[0]]) <= _NEAR_S]
        if abs(_edge(r[after]) - _edge(r[before])) > smallest_step_s:
            sides.append([part])
        else:
            sides[-1].append(part)
    short = [part for part in parts if part.size < FEWEST]
    return [np.concatenate(side) for side in sides], np.concatenate([np.zeros(0, dtype=np.intp), *short])


def _edge(differences: Seconds) -> float:
    """Return the lower edge of some differences, of which one in fifty may be wrong."""
    return float(np.partition(differences, differences.size // 50)[differences.size // 50])
