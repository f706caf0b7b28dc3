"""Overflow of a word: a value that leaves what its digits can hold comes back at their other end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.arrays import Array
from recoil_processing.quality.limits import Outcome

LEAST_JUMP = 0.8
"""Share of all that a signal takes between its extremes that a jump over its word makes at the least."""
LARGEST_STEP = 0.25
"""Share of the word that the largest step may be where the jumps are taken out."""
OTHER_SIDE = 0.3
"""Share of the word by which a pulse that came back at its other end lies beyond the rest: a drop-out falls on that."""
LEAST_LONG = 2
"""Samples in a row behind a jump: a single one is a spike, unless the jump is that of a whole word."""
WORDS = tuple(2.0**bits for bits in (8, 10, 12, 14, 16, 18, 20, 24))
"""Numbers of steps that words have from one end to the other."""
WHOLE = 0.97
"""Share of a word from which on a jump is over all of it."""


@dataclass(frozen=True)
class WordOverflow:
    """Jumps over a whole word.

    Attributes
    ----------
    word
        Span of the word in the unit of the samples, to a step of the signal.
    jumps
        Number of jumps.
    """

    word: float
    jumps: int

    def outcome(self, unit: str) -> Outcome:
        """Say it, and what to do: no wider range of the sensor mends it."""
        times = "once" if self.jumps == 1 else f"{self.jumps} times"
        return "fail", worded(
            f"overflow: {times} it jumps between two samples by the whole word, some ",
            measured(self.word, unit, ".3g"),
            ", and goes on from its other end: the value left what the word can hold; give the signal a wider word or "
            "a larger factor where it is sent (and in its database), or a smaller gain, before the next shot",
        )


def find_word_overflow(samples: Array) -> WordOverflow | None:
    """Look for a signal that goes on from the other end of its word; None where it does not.

    The jumps are nearly as large as all that the signal takes between its extremes, and with them taken out it is
    smooth. A signal that rings by as much between samples has no such steps only; one that drops out falls on its rest.
    A sample that is alone beyond a jump is a spike, unless the jump takes all steps that a word has.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    """
    present = samples[np.isfinite(samples)]
    if present.size < 2 * LEAST_LONG:
        return None
    span, steps = float(np.ptp(present)), np.diff(present)
    at = np.flatnonzero(np.abs(steps) > LEAST_JUMP * span)
    if not at.size:
        return None
    is_alone = at.size > 1 and int(np.diff(at).min()) < LEAST_LONG
    if is_alone and not _is_whole_word(present, float(np.min(np.abs(steps[at])))):
        return None
    # what lies between a sample and the next is its own step beyond the word
    word = float(np.max(np.abs(steps[at])))
    left = np.delete(np.abs(steps), at)
    usual = float(np.max(left, initial=0.0))
    if usual > LARGEST_STEP * word:
        return None
    rest = float(np.median(present))
    sides = rest - float(present.min()), float(present.max()) - rest
    return WordOverflow(word, int(at.size)) if min(sides) > OTHER_SIDE * span else None


def _is_whole_word(samples: Array, jump: float) -> bool:
    """Return whether a jump takes all steps of a word, by the steps in which all samples lie."""
    levels = np.unique(samples)
    step = float(np.diff(levels).min())
    count = (levels - levels[0]) / step
    if count[-1] > WORDS[-1] or np.any(np.abs(count - np.round(count)) > 0.01):
        return False
    return any(WHOLE * word <= jump / step < word and count[-1] < word for word in WORDS)
