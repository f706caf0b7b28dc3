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


@dataclass(frozen=True)
class Marker:
    """A position that marks lost frames.

    Attributes
    ----------
    values
        One for each axis.
    frames
        How many there are.
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
        NaN where a frame is known to be lost.
    frames : ndarray of int64, shape (n_frames,)
        Their numbers, strictly increasing.
    """
    seen = np.isfinite(positions).all(axis=1)
    x, numbers = positions[seen], np.asarray(frames, dtype=np.float64)[seen]
    if len(x) < 4 * SUSTAINED:
        return None
    if len(np.unique(x[:, 0])) == len(x):
        return None
    values, which, counts = np.unique(x, axis=0, return_inverse=True, return_counts=True)
    which = which.reshape(-1)
    found: dict[float, Marker] = {}
    for i in np.argsort(-counts, kind="stable")[:CANDIDATES]:
        marked = which == i
        if counts[i] >= LEAST_FRAMES and counts[i] < len(x) / 2 and _is_off(x, numbers, marked):
            # a place at which the mark rests between markers is as far from them: without them the path is smooth
            left = float(np.abs(np.diff(x[~marked], axis=0)).max())
            found.setdefault(left, Marker(tuple(float(v) for v in values[i]), int(counts[i])))
    return found[min(found)] if found else None


def _is_off(x: Positions, numbers: NDArray[np.float64], marked: NDArray[np.bool_]) -> bool:
    """Return whether all frames at a position are far from where the frames around them are."""
    others = np.flatnonzero(~marked)
    per_frame = np.abs(np.diff(x[others], axis=0)) / np.diff(numbers[others])[:, np.newaxis]
    # a median over some steps, so that neither repeats nor single jumps are the motion's speed
    windows = np.lib.stride_tricks.sliding_window_view(per_frame, SUSTAINED, axis=0)
    speed = np.median(windows, axis=-1).max(axis=0)
    usual = np.median(per_frame, axis=0)
    at = np.flatnonzero(marked)
    place = np.searchsorted(others, at)
    far = np.zeros(at.size, dtype=bool)
    sides = np.zeros(at.size, dtype=np.int64)
    near = np.zeros(at.size, dtype=bool)
    for shift in (-1, 0):
        index = place + shift
        there = (index >= 0) & (index < others.size)
        beside = others[np.clip(index, 0, others.size - 1)]
        between = np.abs(numbers[at] - numbers[beside])[:, np.newaxis]
        off = np.abs(x[at] - x[beside])
        # it is enough that one axis could not have come there
        is_far = (off > FARTHER * (speed * between + usual)).any(axis=1)
        far |= there & is_far
        near |= there & ~is_far
        sides += there
    return bool((far & ~near & (sides > 0)).all())
