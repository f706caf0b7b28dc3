"""Where a device's clock may have stepped, and which stretches of its stamps belong together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Instants = NDArray[np.int64]
Seconds = NDArray[np.float64]

FEWEST = 5
"""Fewer stamps than this between two breaks are taken for wrong ones."""

_PARTS_BACK = 64
"""So many parts of a side are looked back at: enough for any stall, and a record of many breaks stays quick."""

_NEAR_S = 10.0
"""Time on each side of a break that says whether the lower edge lies elsewhere: longer than stalls, short for drift."""


def find_breaks(x: Seconds, y: Seconds, counts: Instants | None, smallest_step_s: float) -> NDArray[np.intp]:
    """Return the frames before which the device's stamps jump as neither their own spacing nor the host's explains."""
    dx, dy = np.diff(x), np.diff(y)
    if counts is not None:
        ahead = np.diff(counts)
        counted = ahead > 0
        period_s = float(np.median(dx[counted] / ahead[counted])) if counted.any() else 0.0
        unusual = np.abs(dx - ahead * period_s) > smallest_step_s / 2
    else:
        low, high = np.quantile(dx, [0.02, 0.98])
        unusual = (dx < low - smallest_step_s / 2) | (dx > high + smallest_step_s / 2)
    return np.flatnonzero(unusual & (np.abs(dy - dx) > smallest_step_s / 2)) + 1


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
