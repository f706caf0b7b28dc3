"""Clipped runs that are tips of a wave, which shows how it goes on."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LONGEST_SHARE = 0.25
"""Share of the local wave that a run may be to be repaired. A sine that is clipped so long goes 1.3 times as high."""
LARGEST_PEAK = 1.2
"""Multiple of the range's end that a repaired sample may reach. Two real pulses that were clipped at two thirds came
out wrong by 3 and 95 % of their impulse."""
WAVE_FOOT = 0.1
"""Share of a wave's height where its width is taken."""
NEXT_WAVE = 0.5
"""Share of a wave's height by which the signal must rise again behind it to be the next one."""


@dataclass(frozen=True)
class ClippedRun:
    """One clipped run and what became of it.

    Attributes
    ----------
    start, stop
        First sample, one beyond the last.
    side
        +1 at the upper end of the range, -1 at the lower one.
    width
        Of the wave whose tip it is, samples.
    peak
        What the repair reaches, in the samples' unit; NaN where none was tried.
    refusal
        Why it is masked; empty if it was repaired.
    """

    start: int
    stop: int
    side: int
    width: float
    peak: float = math.nan
    refusal: str = ""

    @property
    def count(self) -> int:
        """Samples."""
        return self.stop - self.start


def judge_by_wave(samples: Array, alike: Flags, start: int, stop: int, side: int, *, flat_within: float) -> ClippedRun:
    """Measure the wave around a run, and refuse the run by what was recorded of it.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Lost ones NaN.
    alike : ndarray of bool, shape (n_samples,)
        All that is clipped at the same end.
    side
        +1 at the upper end, -1 at the lower one.
    flat_within
        By which clipped samples may differ.

    Returns
    -------
    ClippedRun
        Not refused if a repair may be tried.
    """
    flat = samples[start:stop][np.isfinite(samples[start:stop])]
    left, right = (_foot(side * samples, alike, start, stop, step) for step in (-1, 1))
    count = stop - start
    run = ClippedRun(start, stop, side, left + count + right)
    if math.isnan(run.width):
        return replace(run, refusal="the wave around it is not there: it begins or ends with the record, or in a gap")
    if flat.size and np.ptp(flat) > flat_within:
        return replace(run, refusal="it goes on beyond the declared range without being flat: that range is wrong")
    if count >= LONGEST_SHARE * run.width:
        reason = f"{count} samples are not less than a quarter of the wave's {run.width:.0f}"
        return replace(run, refusal=f"{reason}: how the signal goes on is not known")
    return run


def _foot(upward: Array, alike: Flags, start: int, stop: int, step: int) -> float:
    """Return how many samples beside a run the wave has until its foot; NaN where the record does not show it.

    The foot is where the wave has lost all but a tenth of its height above the trough beside it. The trough is
    looked for within twice the longest wave that would still be too short.
    """
    reach = math.ceil(2 * (stop - start) / LONGEST_SHARE)
    edge = stop - 1 if step > 0 else start
    level = float(upward[edge])
    beside = np.arange(edge + step, edge + step * (reach + 1), step)
    beside = beside[(beside >= 0) & (beside < upward.size)]
    values = upward[beside]
    ended = np.flatnonzero(np.isnan(values) | alike[beside])
    values = values[: ended[0]] if ended.size else values
    if values.size == 0 or not math.isfinite(level):
        return math.nan
    lowest = np.minimum.accumulate(values)
    again = np.flatnonzero(values - lowest > NEXT_WAVE * (level - lowest))
    trough = float(lowest[again[0]] if again.size else lowest[-1])
    down = np.flatnonzero(values <= trough + WAVE_FOOT * (level - trough))
    return float(down[0])


def judge_by_peak(run: ClippedRun, end: float) -> ClippedRun:
    """Refuse a run by what its repair reaches.

    Parameters
    ----------
    run
        With its peak.
    end
        Of the range, at which it was clipped.
    """
    over = run.peak / end if run.side * end > 0 else math.inf
    if over > LARGEST_PEAK:
        reason = f"the wave would reach {over:.2f} of the range, more than {LARGEST_PEAK:g}"
        return replace(run, refusal=f"{reason}: too far beyond what was seen")
    return run
