"""Checks for what a recorder or bus lost: samples, updates of a value, instants.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `recoil_processing.quality.limits`.
"""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.clocks.timebase import usual_step_s
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.normal_distribution import MAD_TO_SIGMA
from recoil_processing.gaps import longest_run
from recoil_processing.quality.level_checks import NO_SAMPLE
from recoil_processing.quality.limits import LIMITS, Outcome
from recoil_processing.repairs.dropouts import BLOCKS, LEAST_RUN, LEAST_STEPS, judge_steps

BLOCK = 1000
"""Samples of each that are looked at."""
MANY_PAIRS = 0.05
"""Share of equal neighbours beyond which a value is updated more slowly than it is sent."""
GAP_STEPS = 2.5
"""Typical steps between two messages that are a gap and no late stamp."""
BURST = 0.5
"""Median step over the mean one, below which stamps come in bursts."""
SEEN_JITTER = 1e-4
"""Share of a step from which on jitter is more than the rounding of what wrote the stamps."""


def check_losses(samples: Array, rate_hz: float, overloads: int = 0) -> Outcome:
    """Count lost samples, and find the longest gap.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    rate_hz
        Samples per second.
    overloads
        Number of the lost samples that the instrument marked as beyond its range.
    """
    if samples.size == 0:
        return "fail", NO_SAMPLE
    lost = ~np.isfinite(samples)
    count = int(lost.sum())
    if count == 0:
        return "ok", "no sample lost"
    first, behind = longest_run(lost)
    share, gap_s = count / samples.size, (behind - first) / rate_hz
    most, longest = LIMITS["lost_share"].fail, LIMITS["longest_gap_s"].fail
    text = (
        f"{count} of {samples.size} samples lost ({100 * share:.2f} %, limit {100 * most:g} %), longest gap "
        f"{1e3 * gap_s:.2f} ms (limit {1e3 * longest:g} ms)"
    )
    if overloads:
        text += f"; overload: {overloads} of them the instrument itself marked as beyond its range"
        text += "; set it to a larger range before the next shot"
    if count > overloads:
        text += "; check the cable and the bus load"
    return ("warn" if share <= most and gap_s <= longest else "fail"), text


def check_held(samples: Array, rate_hz: float) -> Outcome:
    """Look for values that are held instead of measured: runs of one value that noise cannot make.

    Normal noise whose differences have the standard deviation s repeats a value of resolution q with the
    probability ``q / (s sqrt(2 pi))``; a run counts if it is longer than chance makes in the record's
    quietest part. At an extreme it is clipping, and at the record's begin a rest without noise, neither meant here.
    Where the resolution hides the noise nothing can be estimated.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    rate_hz
        Samples per second.
    """
    present = samples[np.isfinite(samples)]
    if present.size < LEAST_RUN * BLOCKS:
        return "ok", f"{present.size} samples: too few to distinguish held ones"
    changes = np.diff(present)
    steps = np.abs(changes[changes != 0])
    if steps.size == 0:
        return "ok", "the signal is constant"
    q = float(steps.min())
    # only what changes: where every other value is a repeat the median of all changes would be zero
    parts = [block[:BLOCK][block[:BLOCK] != 0] for block in np.array_split(changes, BLOCKS)]
    quietest = min(float(np.median(np.abs(part))) for part in (*parts, steps[:BLOCK]) if part.size)
    if quietest < LEAST_STEPS * q:
        return "ok", "noise below the resolution: held samples cannot be distinguished"
    chance = q / (MAD_TO_SIGMA * quietest * math.sqrt(2 * math.pi))
    first = np.flatnonzero(np.concatenate([[True], changes != 0]))
    lengths = np.diff(np.append(first, present.size))
    least = max(LEAST_RUN, 1 + math.ceil(math.log(LIMITS["held_chance"].warn / present.size) / math.log(chance)))
    # at an extreme it is clipping
    middle = (present[first] < present.max()) & (present[first] > present.min())
    # a record that begins at one value rests there without noise
    begins = int(lengths[0]) if lengths[0] >= least else 0
    middle[0] &= not begins
    pairs = float(np.sum(lengths[middle] - 1)) / present.size
    held = lengths[(lengths >= least) & middle]
    if held.size:
        longest = int(held.max())
        return "warn", (
            f"{held.size} times the value is held for {least} samples or more (longest {longest}, "
            f"{1e3 * longest / rate_hz:.2f} ms) as noise does not: updates were lost; check cable, bus load and the "
            "recorder's buffer before the next shot"
        )
    if pairs > MANY_PAIRS and pairs > 10 * chance:
        return "warn", (
            f"{100 * pairs:.0f} % of the samples repeat the one before: the value is updated more slowly than it is "
            "recorded; set the sensor's rate, or declare what it is"
        )
    longest = int(lengths[1:].max(initial=1)) if begins else int(lengths.max())
    silent = f"; the rest at its begin, {1e3 * begins / rate_hz:.4g} ms, has no noise" if begins else ""
    return "ok", f"no value held: at most {longest} in a row, chance makes {least - 1}{silent}"


def check_time_steps(times_s: Array, *, even: bool) -> Outcome:
    """Compare the time steps with their usual one, and say how much the stamps jitter.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times, strictly increasing.
    even
        Whether the instants should be even, as a recorder's; a message's stamp is late by what the bus
        makes it wait, and only gaps count.
    """
    if times_s.size < LEAST_RUN:
        return "ok", f"{times_s.size} instants: no steps to compare"
    return _even_steps(times_s) if even else _late_steps(times_s)


def _even_steps(times_s: Array) -> Outcome:
    """Judge the steps of a recorder: what is no step, what is missing, and what the rest jitters by."""
    found, limit = judge_steps(times_s), LIMITS["time_step_share"]
    longest_s, off = float(np.diff(times_s).max()), int(np.count_nonzero(found.off))
    share = found.jitter_s / found.period_s
    step = f"{1e3 * found.period_s:.4g} ms"
    jitter = f"the stamps jitter by {1e6 * found.jitter_s:.2g} us, {100 * share:.2g} % of the step of {step}"
    remedy = "check the cable, the bus load and the recorder's buffer before the next shot"
    if off or found.absent:
        parts = [f"{off} of {found.off.size} time steps are off whole steps of {step}"] if off else []
        parts += [f"about {found.absent} instants are missing between {times_s.size}"] if found.absent else []
        parts += [jitter] if limit.verdict(share) != "ok" else []
        return "warn", f"{'; '.join(parts)}; longest step {1e3 * longest_s:.3g} ms; {remedy}"
    if limit.verdict(share) != "ok":
        return "warn", (
            f"{jitter} (limit {100 * limit.warn:g} %): nothing is left out for it, it is in the uncertainty of the "
            "instants; let the recorder's converter date its samples, or export time with more decimals"
        )
    return "ok", jitter if share > SEEN_JITTER else f"all time steps are {step}"


def _late_steps(times_s: Array) -> Outcome:
    """Judge the steps of messages, which a bus, an adapter or the host makes late."""
    steps = np.diff(times_s)
    period = usual_step_s(times_s)
    usual, longest_s = float(np.median(steps)), float(steps.max())
    if usual < BURST * period:
        return "warn", (
            f"the stamps come in bursts: half of the steps are below {1e3 * usual:.3g} ms, the mean is "
            f"{1e3 * period:.3g} ms, so that a host dated them when it read them; let the interface or the device "
            "stamp them, or declare the device's counter or `rate_hz`"
        )
    ratio = steps / period
    missing = int(np.sum(np.round(ratio[ratio > GAP_STEPS])) - np.count_nonzero(ratio > GAP_STEPS))
    if missing:
        text = f"about {missing} instants are missing between {times_s.size}, longest step {1e3 * longest_s:.2f} ms"
        remedy = "check the cable, the bus load and the recorder's buffer before the next shot"
        return "warn", f"{text} of {1e3 * period:.2f} ms usually; {remedy}"
    return "ok", f"steps of {1e3 * period:.3g} ms, longest {1e3 * longest_s:.3g} ms"
