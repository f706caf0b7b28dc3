"""Checks for what a recorder or bus lost: samples, updates of a value, instants.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `recoil_processing.quality.limits`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.normal_distribution import MAD_TO_SIGMA
from recoil_acquisition.shot import Verdict
from recoil_processing.gaps import longest_run
from recoil_processing.quality.level_checks import NO_SAMPLE
from recoil_processing.quality.limits import LIMITS, Outcome
from recoil_processing.repairs.dropouts import BLOCKS, LEAST_RUN, LEAST_STEPS

Array = NDArray[np.float64]

BLOCK = 1000
"""Samples of each that are looked at."""
MANY_PAIRS = 0.05
"""Share of equal neighbours beyond which a value is updated more slowly than it is sent."""
GAP_STEPS = 2.5
"""Typical steps between two messages that are a gap and no late stamp."""


def check_losses(samples: Array, rate_hz: float, overloads: int = 0) -> Outcome:
    """Count lost samples, and find the longest gap.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Lost samples NaN.
    rate_hz
        Samples per second.
    overloads
        How many of the lost samples the instrument marked as beyond its range.
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
    quietest part. At an extreme it is clipping, and not meant here. Where the resolution hides the noise
    nothing can be estimated.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Lost samples NaN.
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
    return "ok", f"no value held: at most {int(lengths.max())} in a row, chance makes {least - 1}"


def check_time_steps(times_s: Array, *, even: bool) -> Outcome:
    """Compare the time steps with their median.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Strictly increasing.
    even
        Whether the instants should be even, as a recorder's; a message's stamp is late by what the bus
        makes it wait, and only gaps count.
    """
    if times_s.size < LEAST_RUN:
        return "ok", f"{times_s.size} instants: no steps to compare"
    steps = np.diff(times_s)
    period = float(np.median(steps))
    ratio = steps / period
    missing = int(np.sum(np.round(ratio[ratio > GAP_STEPS])) - np.count_nonzero(ratio > GAP_STEPS))
    longest_s = float(steps.max())
    limit = LIMITS["time_step_share"]
    remedy = "check the cable, the bus load and the recorder's buffer before the next shot"
    if even:
        off = int(np.count_nonzero(np.abs(ratio - 1) > limit.warn))
        if off:
            text = f"{off} of {steps.size} time steps are off {1e3 * period:.4g} ms by more than {100 * limit.warn:g} %"
            return "warn", f"{text}, longest {1e3 * longest_s:.3g} ms; {remedy}"
        return "ok", f"all time steps are {1e3 * period:.4g} ms within {100 * limit.warn:g} %"
    if missing:
        verdict: Verdict = "warn"
        text = f"about {missing} instants are missing between {times_s.size}, longest step {1e3 * longest_s:.2f} ms"
        return verdict, f"{text} of {1e3 * period:.2f} ms usually; {remedy}"
    return "ok", f"steps of {1e3 * period:.3g} ms, longest {1e3 * longest_s:.3g} ms"
