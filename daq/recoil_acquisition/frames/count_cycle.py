"""The cycle of a counter, as its counts show it: where it begins anew, and by how much it goes on.

Not every counter of n bits runs through all of its numbers. One of 4 bits that keeps 15 for a fault goes from 14 to 0
(AUTOSAR, Specification of SW-C End-to-End Communication Protection Library, profile 1), one that keeps 0 for "not yet"
from 15 to 1, and one that a node shares between two messages goes on by 2. Taken for the whole range, such a counter
tells of frames that were never sent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.frames.values import unwrap

_LEAST_WRAPS = 3
"""Times that a counter must begin anew at one place before that is taken for its cycle: losses are not so regular."""
_MOST_OF = 0.5
"""Share of the places at which a counter begins anew that must be alike."""
_DENSE = 0.9
"""Share of the numbers of a cycle that must have been seen, and of the steps from frame to frame that must be alike."""
_LEAST_STEPS = 32
"""Steps below which how they go on is that of what was lost."""
_FOUR_BITS = 15
"""Counts of a cycle of 4 bits of which the last number is kept."""


@dataclass(frozen=True)
class CountCycle:
    """Cycle of a counter.

    Attributes
    ----------
    modulo
        Counts from one beginning to the next; 0 if it never begins anew.
    step
        Number by which it goes on from frame to frame.
    first
        Number with which it begins anew; None where every number that the field can hold is a count.
    """

    modulo: int
    step: int = 1
    first: int | None = None

    def holds(self, counts: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which counts are of the cycle, shape (n,); others are marks such as that of a fault."""
        if self.first is None:
            return np.ones(counts.size, dtype=bool)
        return np.asarray((counts >= self.first) & (counts < self.first + self.modulo))

    def numbers(
        self, counts: NDArray[np.int64], held: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the numbers of frames by their counts, which do not begin anew, and which frames have one.

        A frame without a count, or with a mark, is numbered by those about it where nothing is missing there.

        Parameters
        ----------
        counts : ndarray of int64, shape (n_frames,)
            Counts as stored.
        held : ndarray of bool, shape (n_frames,)
            Whether a frame holds the counter.

        Returns
        -------
        numbers : ndarray of int64, shape (n_frames,)
            Numbers from 0; they go back where the counter does.
        known : ndarray of bool, shape (n_frames,)
        """
        known = held & self.holds(counts)
        places = np.flatnonzero(known)
        if not places.size:
            return np.zeros(counts.size, dtype=np.int64), known
        numbers = unwrap(counts[places], self.modulo)
        if places.size == counts.size:
            return numbers, known
        at = np.arange(counts.size)
        between = np.interp(at, places, numbers)
        inside = (at > places[0]) & (at < places[-1])
        # between two counts that are as far apart as their frames nothing is missing
        sound = np.diff(numbers) == self.step * np.diff(places)
        known |= inside & sound[np.clip(np.searchsorted(places, at, side="right") - 1, 0, sound.size - 1)]
        return np.round(between).astype(np.int64), known


def find_cycle(counts: NDArray[np.int64], width: int = 0, step: int = 1) -> CountCycle | None:
    """Find the cycle of a counter.

    Parameters
    ----------
    counts : ndarray of int64, shape (n,)
        Counts as stored, in the order of their frames; some may be missing.
    width
        Number of values that the field can hold; 0 where that is not known.
    step
        Number by which it goes on where the counts do not tell.

    Returns
    -------
    CountCycle or None
        That of the whole field where the counts show no other; None where its width is not known either, and the counts
        do not tell where it begins anew.
    """
    steps = np.diff(counts)
    step = _common_step(steps) or step
    falls = np.flatnonzero(steps < 0)
    ends = np.stack([counts[falls], counts[falls + 1]], axis=1)
    pairs, times = np.unique(ends, axis=0, return_counts=True)
    if times.size and times.max() >= max(_LEAST_WRAPS, _MOST_OF * falls.size):
        last, first = (int(number) for number in pairs[int(np.argmax(times))])
        modulo = last - first + step
        seen = np.unique(counts[(counts >= first) & (counts <= last)]).size
        if (not width or modulo < width) and seen >= _DENSE * (modulo // step):
            return CountCycle(modulo, step, first)
    if width:
        return CountCycle(width, step)
    if not falls.size:
        return CountCycle(0, step)
    most = int(counts.max()) + 1
    return CountCycle(most, step) if most == _FOUR_BITS or (most >= 4 and most & (most - 1) == 0) else None


def _common_step(steps: NDArray[np.int64]) -> int:
    """Return by how much a counter goes on from nearly every frame to the next; 0 where there is no such number."""
    found, times = np.unique(steps[steps > 0], return_counts=True)
    if steps.size < _LEAST_STEPS or not times.size or times.max() < _DENSE * np.count_nonzero(steps > 0):
        return 0
    return int(found[int(np.argmax(times))])
