"""Clipped samples: found from the declared range, repaired where that is honest, masked where it is not.

"In general there is no data recovery from a clipped signal" (MIL-STD-810H, 522.2). What can be recovered is the tip
of a wave whose course before and behind it shows how it goes on: a run shorter than a quarter of the local wave
that comes out at most a fifth beyond the range. The rest of a clipped record is masked. A repaired sample lies at
or beyond the level at which it was clipped, for that much was measured; no peak may be claimed from it.

What is masked must be left out together with its surroundings, as behind a filter's reach. To leave out the tips of
ringing alone keeps the troughs that belong to them, which is worse than to use them as they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.quantities.quantity import Unit
from recoil_processing.gaps import bridge, longest_run, runs_of
from recoil_processing.noise import noise_sigma
from recoil_processing.repairs.autoregressive import MOST_ORDER, Interpolation, interpolate_unknown
from recoil_processing.repairs.repair import Repair, RepairKind

LONGEST_SHARE = 0.25
"""Share of the local wave that a run may be to be repaired. A sine that is clipped so long goes 1.3 times as high."""
LARGEST_PEAK = 1.2
"""Multiple of the range's end that a repaired sample may reach. Two real pulses that were clipped at two thirds came
out wrong by 3 and 95 % of their impulse."""
WAVE_FOOT = 0.1
"""Share of a wave's height where its width is taken."""
NEXT_WAVE = 0.5
"""Share of a wave's height by which the signal must rise again behind it to be the next one."""
END_SHARE = 0.001
"""Share of the range: as near to one of its ends a sample counts as clipped."""
CONTEXT = 160
"""Samples that are looked at on either side of a clipped run."""
PER_WAVE = 4
"""Coefficients of the model per wave that it saw: amplitude, phase, frequency and damping. A lone pulse that is
given more is continued by a third too high."""
WAVE_HEIGHT = 0.2
"""Share of the largest magnitude from which on a wave counts."""
MOST_UNKNOWN = 250
"""Samples of one piece that may be unknown: a record with more is not clipped at its tips."""
RESTING_SIGMA = 8.0
"""Standard deviations of the noise by which a signal must rest within an end of the range to keep clear of it."""
LEAST_PILED = 4
"""Samples in a row at one value that are a pile, as `recoil_processing.quality.limits` has it of flat tops."""
PILED_UP = 5.0
"""Samples at the extreme over those one step below it; a smooth top has 2.4 times as many, ``1 / (sqrt(2) - 1)``."""


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
        Width of the wave whose tip the run is, samples.
    peak
        Largest value that the repair reaches, in the samples' unit; NaN where none was tried.
    refusal
        Sentence on why the run is masked; empty if it was repaired.
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


@dataclass(frozen=True, eq=False)
class Clipped(ReadOnlyArrays):
    """Samples at or beyond an end of the declared range.

    Attributes
    ----------
    above, below : ndarray of bool, shape (n_samples,)
    rests_above, rests_below
        Whether the signal rests at that end and its noise is about it, as far as `find_cut_off` looked.
    """

    above: Flags
    below: Flags
    rests_above: bool = False
    rests_below: bool = False

    @property
    def flags(self) -> Flags:
        """Either of them, shape (n_samples,)."""
        return self.above | self.below


@dataclass(frozen=True, eq=False)
class ClippingRepair(ReadOnlyArrays):
    """A channel whose clipped samples are repaired or masked.

    Attributes
    ----------
    samples : ndarray, shape (n_samples,)
        Samples; masked ones are NaN.
    u : ndarray, shape (n_samples,)
        Standard uncertainty of the repaired ones, a lower bound: as if the model of the wave were true. 0 elsewhere.
    repairs
        Repairs that were done: at most one of what was repaired and one of what was masked.
    """

    samples: Array
    u: Array
    runs: tuple[ClippedRun, ...]
    repairs: tuple[Repair, ...]


def find_clipped(samples: Array, low: float, high: float) -> Clipped:
    """Find samples at or beyond an end of the declared range.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples; lost ones are NaN and not clipped, infinite ones are.
    low, high
        Declared range. Within `END_SHARE` of it from an end counts as clipped; an end at zero is where a one-sided
        gauge rests, and only what lies as far beyond it counts.

    Raises
    ------
    ValueError
        If the range is empty or not finite.
    """
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ValueError(f"a range needs low < high, not [{low}, {high}]")
    margin = _margin(low, high)
    above = samples > high + margin if abs(high) <= margin else samples >= high - margin
    below = samples < low - margin if abs(low) <= margin else samples <= low + margin
    return Clipped(np.asarray(above), np.asarray(below))


def find_cut_off(samples: Array, low: float, high: float) -> Clipped:
    """Find samples that an end of the declared range cut off: of what is clipped, not the noise of a signal at rest.

    At an end at zero, and at one that its noise reaches, a one-sided gauge rests, and what it reads beyond is right:
    only what is infinite or piles up at one value was cut off there.

    Parameters
    ----------
    samples, low, high
        Samples and range as in `find_clipped`.

    Raises
    ------
    ValueError
        As of `find_clipped`.
    """
    clipped, margin = find_clipped(samples, low, high), _margin(low, high)
    above, rests_above = _cut_off(samples, clipped.above, high, margin)
    below, rests_below = _cut_off(-samples, clipped.below, -low, margin)
    return Clipped(above, below, rests_above, rests_below)


def _cut_off(samples: Array, clipped: Flags, end: float, margin: float) -> tuple[Flags, bool]:
    """Return what the upper end of a range cut off, and whether the signal rests there."""
    present = samples[np.isfinite(samples)]
    near_zero = abs(end) <= margin
    if present.size == 0 or not (near_zero or clipped.any()):
        return clipped, near_zero
    noise = noise_sigma(samples)
    if not near_zero and not abs(end - float(np.median(present))) <= RESTING_SIGMA * noise:
        return clipped, False
    top = float(present.max())
    pile = np.asarray(samples == top)
    first, behind = longest_run(pile)
    # a rest without noise, or with no more than rounding, stands at one value and is cut off by nothing
    cut = top >= end - margin and behind - first >= LEAST_PILED and noise >= _resolution(present, top)
    return np.asarray((samples == np.inf) | (pile & (cut and is_pile(present, top)))), True


def _resolution(present: Array, extreme: float) -> float:
    """Return the smallest difference from an extreme; infinite where all samples stand at it."""
    inside = np.abs(present - extreme)
    return float(np.min(inside[inside > 1e-9 * float(inside.max())], initial=math.inf))


def is_pile(present: Array, extreme: float) -> bool:
    """Return whether far more samples stand at an extreme than one step inside of it.

    Parameters
    ----------
    present : ndarray, shape (n,)
        Samples, all finite.
    extreme
        Extreme of the samples, the largest or the smallest one.
    """
    inside = np.abs(present - extreme)
    beside = np.count_nonzero((inside > 0) & (inside < 1.5 * _resolution(present, extreme)))
    return bool(np.count_nonzero(inside == 0) > PILED_UP * beside)


def repair_clipping(
    samples: Array, low: float, high: float, *, unit: str = "", shown_in: Unit | None = None
) -> ClippingRepair:
    """Repair the clipped tips of waves, and mask what else is clipped.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples, evenly spaced, as recorded; lost ones are NaN.
    low, high
        Declared range, see `find_clipped`.
    unit
        Name of the unit of the sentences.
    shown_in
        Unit of that name, where the samples are in SI and it is another.

    Returns
    -------
    ClippingRepair
        Repaired samples; a copy and no repairs where no sample is clipped.

    Raises
    ------
    ValueError
        As of `find_clipped`.
    """
    clipped = _flat_ended(samples, find_cut_off(samples, low, high))
    runs = [
        judge_by_wave(samples, alike, start, stop, side, flat_within=2 * _margin(low, high))
        for side, alike in ((1, clipped.above), (-1, clipped.below))
        for start, stop in runs_of(alike)
    ]
    runs.sort(key=lambda run: run.start)
    result, u = np.array(samples, dtype=np.float64), np.zeros(samples.size)
    ends = {1: high, -1: low}
    for piece, numbers in _pieces(samples, runs):
        found = _interpolated(samples, clipped, piece)
        for i in numbers:
            run = runs[i]
            if isinstance(found, str):
                runs[i] = replace(run, refusal=found)
                continue
            inside = slice(run.start - piece.start, run.stop - piece.start)
            tip = found.samples[inside]
            peak = float(run.side * np.max(run.side * tip))
            runs[i] = judge_by_peak(replace(run, peak=peak), ends[run.side])
            result[run.start : run.stop] = tip
            u[run.start : run.stop] = found.u[inside]
    repaired, masked = np.zeros(samples.size, dtype=bool), np.zeros(samples.size, dtype=bool)
    for run in runs:
        (masked if run.refusal else repaired)[run.start : run.stop] = True
    result[masked], u[masked] = np.nan, 0.0
    shown = _Shown(low, high, unit, Unit(frozenset(), 1.0) if shown_in is None else shown_in)
    repairs = []
    if repaired.any():
        repairs.append(_repair_of(repaired, [r for r in runs if not r.refusal], u, shown))
    if masked.any():
        repairs.append(_mask_of(masked, [r for r in runs if r.refusal], shown))
    return ClippingRepair(result, u, tuple(runs), tuple(repairs))


def _margin(low: float, high: float) -> float:
    """Return how near to an end of the range a sample counts as clipped."""
    return END_SHARE * (high - low)


def _flat_ended(samples: Array, clipped: Clipped) -> Clipped:
    """Leave out what piles up where the signal rests: no wave is there whose tip was cut off."""
    infinite = np.isinf(samples)
    return Clipped(
        clipped.above & infinite if clipped.rests_above else clipped.above,
        clipped.below & infinite if clipped.rests_below else clipped.below,
    )


def _pieces(samples: Array, runs: Sequence[ClippedRun]) -> list[tuple[slice, list[int]]]:
    """Cut the record into pieces, each with all that one model must look at together, and number the runs in each.

    Runs that are refused, and gaps, are unknown to the model too; where they are longer than its order it cannot
    look across them, and the piece ends.
    """
    unknown = [*((r.start, r.stop) for r in runs if r.refusal), *runs_of(np.isnan(samples))]
    walls = [(a, b) for a, b in unknown if b - a > MOST_ORDER]
    pieces: list[tuple[slice, list[int]]] = []
    for i, run in enumerate(runs):
        if run.refusal:
            continue
        first = max([0, run.start - CONTEXT, *(b for _, b in walls if b <= run.start)])
        last = min([samples.size, run.stop + CONTEXT, *(a for a, _ in walls if a >= run.stop)])
        if pieces and first < pieces[-1][0].stop:
            before, numbers = pieces.pop()
            pieces.append((slice(before.start, last), [*numbers, i]))
        else:
            pieces.append((slice(first, last), [i]))
    return pieces


def _interpolated(samples: Array, clipped: Clipped, piece: slice) -> Interpolation | str:
    part = samples[piece]
    above, below = clipped.above[piece], clipped.below[piece]
    unknown = above | below | ~np.isfinite(part)
    count = int(np.count_nonzero(unknown))
    if count > MOST_UNKNOWN:
        return (
            f"{count} samples of one piece are unknown, more than {MOST_UNKNOWN}: too much is clipped to be estimated"
        )
    # at least what was read there was there
    lowest, highest = np.where(above, part, -np.inf), np.where(below, part, np.inf)
    order = min(MOST_ORDER, PER_WAVE * _waves(part))
    return interpolate_unknown(part, unknown, lowest=lowest, highest=highest, most_order=order)


def _waves(part: Array) -> int:
    """Count the waves of a piece, upward or downward, whichever are more; the clipped one is one at the least."""
    from scipy.signal import find_peaks

    whole = bridge(np.where(np.isfinite(part), part, np.nan))
    height = WAVE_HEIGHT * float(np.max(np.abs(whole - np.median(whole))))
    return max(1, *(find_peaks(side * whole, prominence=height)[0].size for side in (1, -1)))


def judge_by_wave(samples: Array, alike: Flags, start: int, stop: int, side: int, *, flat_within: float) -> ClippedRun:
    """Measure the wave around a run, and refuse the run by what was recorded of it.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples; lost ones are NaN.
    alike : ndarray of bool, shape (n_samples,)
        All that is clipped at the same end.
    side
        +1 at the upper end, -1 at the lower one.
    flat_within
        Difference up to which clipped samples are one level.

    Returns
    -------
    ClippedRun
        Run, without a refusal if a repair may be tried.
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
        Run with its peak.
    end
        End of the range at which the run was clipped.
    """
    over = run.peak / end if run.side * end > 0 else math.inf
    if over > LARGEST_PEAK:
        reason = f"the wave would reach {over:.2f} of the range, more than {LARGEST_PEAK:g}"
        return replace(run, refusal=f"{reason}: too far beyond what was seen")
    return run


@dataclass(frozen=True)
class _Shown:
    """The range and its unit, as sentences show them; the ends themselves are SI."""

    low: float
    high: float
    name: str
    unit: Unit

    def __str__(self) -> str:
        low, high = (self.unit.from_si(end) for end in (self.low, self.high))
        return f"[{low:g}, {high:g}] {self.name}"


def _repair_of(flags: Flags, runs: Sequence[ClippedRun], u: Array, shown: _Shown) -> Repair:
    count, longest = int(np.count_nonzero(flags)), max(r.count for r in runs)
    highest = max(abs(r.peak) for r in runs)
    largest = float(np.max(u))
    return Repair(
        RepairKind.CLIPPED_REPAIRED,
        flags,
        f"{count} samples in {len(runs)} runs of at most {longest} are clipped at {shown} and were replaced by how the "
        f"wave goes on around them, up to {shown.unit.from_si(highest):.4g} {shown.name}: no peak may be claimed from "
        "them",
        {"runs": len(runs), "longest_run": longest, "largest_magnitude": highest, "largest_u": largest},
    )


def _mask_of(flags: Flags, runs: Sequence[ClippedRun], shown: _Shown) -> Repair:
    count, longest = int(np.count_nonzero(flags)), max(runs, key=lambda r: r.count)
    return Repair(
        RepairKind.CLIPPED_MASKED,
        flags,
        f"{count} samples in {len(runs)} runs are clipped at {shown} and left out; the longest: {longest.refusal}",
        {"runs": len(runs), "longest_run": longest.count},
    )
