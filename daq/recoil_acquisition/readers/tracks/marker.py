"""Markers of lost frames among positions: one exact position that returns, far off the path.

Trackers mark a frame that they lost by -1, 0 or another number, which a change of unit or of the origin makes into one
that nobody knows: -1 px is -0.995 mm at a scale. A mark that jumps comes to another place each time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Positions = NDArray[np.float64]

LEAST_FRAMES = 2
"""Frames at one position, at least, for it to be a marker."""
CANDIDATES = 4
"""Positions that are looked at, those that return most often first."""
FARTHER = 4.0
"""Times the motion meanwhile that a marker is off."""
SUSTAINED = 5
"""Steps whose median is the motion's own speed."""
PART_ROWS = 1 << 12
"""Windows of steps that are held at a time."""


@dataclass(frozen=True)
class Marker:
    """A position that marks lost frames.

    Attributes
    ----------
    values
        Coordinates of the position, one for each axis.
    frames
        Number of frames that bear it.
    """

    values: tuple[float, ...]
    frames: int

    def __str__(self) -> str:
        shown = ", ".join(f"{value:.9g}" for value in self.values)
        lost = ", ".join(f"{value:.9g}" for value in dict.fromkeys(self.values))
        where = f"the value {shown} stands" if len(self.values) == 1 else f"the values {shown} stand"
        return f"{where} in {self.frames} frames, far off the path: declare `lost = [{lost}]` in `[source.layout]`"


def find_marker(positions: Positions, frames: Sequence[int] | NDArray[np.int64]) -> Marker | None:
    """Find the position that marks lost frames; None if there is none.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_axes)
        Positions, NaN where a frame is known to be lost.
    frames : ndarray of int64, shape (n_frames,)
        Numbers of the frames, strictly increasing.
    """
    seen = np.flatnonzero(np.isfinite(positions).all(axis=1))
    if seen.size < 4 * SUSTAINED:
        return None
    found: dict[float, Marker] = {}
    for values in _returning(positions, seen):
        marked = (positions == values).all(axis=1)
        count = int(np.count_nonzero(marked))
        others = seen[~marked[seen]]
        if not LEAST_FRAMES <= count < seen.size / 2:
            continue
        left = _off_path(positions, frames, np.flatnonzero(marked), others)
        if left is not None:
            # a place at which the mark rests between markers is as far from them: without them the path is smooth
            found.setdefault(left, Marker(values, count))
    return found[min(found)] if found else None


def _returning(positions: Positions, seen: NDArray[np.intp]) -> list[tuple[float, ...]]:
    """Return the positions that return most often."""
    first, counts = np.unique(positions[seen, 0], return_counts=True)
    most = [i for i in np.argsort(-counts, kind="stable")[:CANDIDATES] if counts[i] >= LEAST_FRAMES]
    found = []
    for value in first[most]:
        rows, times = np.unique(positions[positions[:, 0] == value], axis=0, return_counts=True)
        times[np.isnan(rows).any(axis=1)] = 0
        if times.max(initial=0) >= LEAST_FRAMES:
            found.append(tuple(float(v) for v in rows[int(np.argmax(times))]))
    return found


def _off_path(
    positions: Positions, frames: Sequence[int] | NDArray[np.int64], at: NDArray[np.intp], others: NDArray[np.intp]
) -> float | None:
    """Return the largest step of a path without some frames, if these all are far from those around them; else None."""
    numbers = np.asarray(frames)
    place = np.searchsorted(others, at)
    far, near = np.zeros(at.size, dtype=bool), np.zeros(at.size, dtype=bool)
    is_far = {shift: np.zeros(at.size, dtype=bool) for shift in (-1, 0)}
    largest = 0.0
    for axis in positions.T:
        steps = np.diff(axis[others])
        np.abs(steps, out=steps)
        largest = max(largest, float(steps.max()))
        steps /= np.diff(numbers[others])
        speed, usual = own_speed(steps), float(np.median(steps))
        for shift in (-1, 0):
            beside = others[np.clip(place + shift, 0, others.size - 1)]
            meanwhile = speed * np.abs(numbers[at] - numbers[beside]) + usual
            # it is enough that one axis could not have come there
            is_far[shift] |= np.abs(axis[at] - axis[beside]) > FARTHER * meanwhile
    for shift, found in is_far.items():
        there = (place + shift >= 0) & (place + shift < others.size)
        far |= there & found
        near |= there & ~found
    return largest if bool((far & ~near).all()) else None


def own_speed(speed: NDArray[np.float64]) -> float:
    """Return the largest speed that lasts: the largest median of the sizes of `SUSTAINED` steps in a row."""
    windows = np.lib.stride_tricks.sliding_window_view(speed, SUSTAINED)
    parts = [windows[at : at + PART_ROWS] for at in range(0, len(windows), PART_ROWS)]
    return float(np.max([np.abs(np.median(part, axis=1)).max() for part in parts]))
