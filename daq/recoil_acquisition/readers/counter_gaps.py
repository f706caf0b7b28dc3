"""Gaps of a packet or message counter: where, how many frames, for how long."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.frames.values import gaps, unwrap

_NEAR = 8
"""Places by which frames that a bus or a logger let pass one another are off their order."""


@dataclass(frozen=True)
class CounterGaps:
    """Losses of the frames that hold a counter.

    Attributes
    ----------
    counted
        Frames that hold it.
    places
        Places where it does not go on by one.
    missing
        Frames that are missing there, as far as the counter shows.
    unsized
        Places of which it does not show how many: it stands still or goes back.
    longest
        Most frames missing in a row, as far as it shows.
    longest_s
        Longest time between the two frames of any such place.
    """

    counted: int
    places: int
    missing: int
    unsized: int
    longest: int
    longest_s: float


def gaps_as_json(found: Sequence[CounterGaps]) -> dict[str, Any]:
    """Return sums and maxima over counters, or over the channels of one."""
    return {
        "counted_frames": sum(one.counted for one in found),
        "counter_gaps": sum(one.places for one in found),
        "missing_frames": sum(one.missing for one in found),
        "unsized_gaps": sum(one.unsized for one in found),
        "longest_gap_frames": max((one.longest for one in found), default=0),
        "longest_gap_s": max((one.longest_s for one in found), default=0.0),
    }


def find_gaps(counts: NDArray[np.int64], times_s: NDArray[np.float64], modulo: int, step: int = 1) -> CounterGaps:
    """Find the gaps of a counter.

    Parameters
    ----------
    counts : ndarray of int64, shape (n_frames,)
        Counts as stored, in the order of the frames.
    times_s : ndarray of float64, shape (n_frames,)
        Instants of the frames, NaN where unknown.
    modulo
        Value at which it wraps; 0 if it never does.
    step
        Number by which the counter goes on from one frame to the next.

    Notes
    -----
    Frames that changed places with near ones are counted in the order of their counts: none of them is missing.
    """
    numbers = unwrap(counts, modulo)
    order = np.argsort(numbers, kind="stable")
    if _changed_places(numbers, order):
        counts, times_s, modulo, numbers = numbers[order], times_s[order], 0, numbers[order]
    places, missing = gaps(counts, modulo, step)
    steps = np.diff(numbers)
    apart_s = np.diff(times_s)[steps != step]
    return CounterGaps(
        counted=int(counts.size),
        places=places,
        missing=missing,
        unsized=int((steps < step).sum()),
        longest=int((steps // step - 1).max(initial=0)),
        longest_s=float(apart_s[np.isfinite(apart_s)].max(initial=0.0)),
    )


def _changed_places(numbers: NDArray[np.int64], order: NDArray[np.intp]) -> bool:
    """Return whether all that is wrong with the order of frames is that some changed places with near ones."""
    off = np.abs(order - np.arange(order.size))
    return bool(0 < off.max(initial=0) <= _NEAR and (np.diff(numbers[order]) > 0).all())
