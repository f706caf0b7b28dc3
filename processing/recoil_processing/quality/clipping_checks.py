"""Checks for clipping: at the recorder's range, and ahead of the recorder.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `recoil_processing.quality.limits`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from recoil_acquisition.measured import Worded, joined, measured, worded
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.gaps import longest_run
from recoil_processing.noise import noise_sigma
from recoil_processing.quality.level_checks import NO_SAMPLE
from recoil_processing.quality.limits import LIMITS, Outcome
from recoil_processing.repairs.clipping import PILED_UP, find_cut_off

LEAST_RATES = 64
"""Samples below which no rate is judged."""


PULSE_FOOT = 0.1
"""Share of the peak from which on a sample is one of the pulse."""
ZERO_SHARE = 0.01
"""Share of the range by which a sensor may rest beyond it: a zero that is off."""
FAR_SHARE = 0.1
"""Share of the range beyond which no reading is a zero, noise or ringing at rest."""
MOST_TOLERANCE = 0.1
"""Share of a rate that noise may be; with more, a constant rate is not recognised."""
RATE_TOLERANCE = 0.02
"""Share of the largest rate within which a rate is the same."""
NOISE_SIGMA = 3.0
"""Noise multiples that the largest of some hundred rates is off."""
LEAST_AT_RATE = 4
"""Samples of a flank at the largest rate."""
NEAR_PEAK = 0.9
"""Share of the pulse's peak from which on it counts as its top."""
LEAST_TOP = 16
"""Samples of it."""


BIASED_SHARE = 0.1
"""Share of its range by which a signal that rests beyond it has a bias, and is not cut off."""


def check_clipping(samples: Array, low: float, high: float, *, unit: str) -> Outcome:
    """Count samples that an end of the declared range cut off, against those where the signal moves.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    low, high
        Declared range, in the unit that is named; see `recoil_processing.repairs.clipping.find_cut_off`.

    Returns
    -------
    verdict, detail
        Verdict and its sentence. The share is that of the samples above a tenth of the peak: the pulse, not the
        pre-trigger baseline. What piles up where the signal rests is none of the pulse, and warns.

    Raises
    ------
    ValueError
        If the range is empty or not finite.
    """
    found = find_cut_off(samples, low, high)
    present = samples[~np.isnan(samples)]
    if present.size == 0:
        return "fail", NO_SAMPLE
    shown = f"[{low:g}, {high:g}] {unit}"
    rest = float(np.median(present))
    beyond = BIASED_SHARE * (high - low)
    if not low - beyond <= rest <= high + beyond:
        remedy = "state `zero` of a sensor with a bias, else correct `range` or `sensitivity`"
        return "fail", worded("it rests at ", measured(rest, unit, ".4g"), f", beyond its range {shown}: {remedy}")
    counts = {"high": int(np.count_nonzero(found.above)), "low": int(np.count_nonzero(found.below))}
    ends = [name for name, count in counts.items() if count]
    if not ends:
        return _within(samples, low, high, shown=shown, unit=unit)
    size = np.abs(samples - rest)
    peak = float(np.nanmax(size))
    # of what is infinite nothing tells how high it was: then all that is known of the pulse is clipped
    in_pulse = size > PULSE_FOOT * peak if math.isfinite(peak) else found.flags
    clipped = int(np.count_nonzero(found.flags & in_pulse))
    share = clipped / max(int(np.count_nonzero(in_pulse)), 1)
    limit = LIMITS["clipped_share"]
    named = "both ends" if len(ends) == 2 else f"the {ends[0]} end"
    verdict = "warn" if limit.verdict(share) == "ok" else limit.verdict(share)
    return verdict, worded(
        f"range too small: {sum(counts.values())} samples, {100 * share:.1f} % of the pulse (limit "
        f"{100 * limit.fail:g} %), at {named} of {shown}; ",
        _wider(ends, low, high, unit),
        " before the next shot",
    )


def _wider(ends: Sequence[str], low: float, high: float, unit: str) -> Worded:
    """Say how to choose a range whose ends do not cut off, or that what goes beyond its shorter side is upside down."""
    span, parts = high - low, list[Worded]()
    if "high" in ends:
        above = high + max(abs(high), ZERO_SHARE * span) / 2
        parts.append(worded("raise the range beyond ", measured(above, unit, ".3g")))
    if "low" in ends:
        below = low - max(abs(low), ZERO_SHARE * span) / 2
        parts.append(worded("let the range begin below ", measured(below, unit, ".3g")))
    widened = joined(" and ", parts)
    if len(ends) == 1 and (-low < high if "low" in ends else high < -low):
        return worded("change the `polarity` of its channel in the rig if the pulse is upside down, else ", widened)
    return widened


def _within(samples: Array, low: float, high: float, *, shown: str, unit: str) -> Outcome:
    """Judge a signal that no end cut off: how much of the range it uses, and whether it is in it at all."""
    present = samples[np.isfinite(samples)]
    rest, top, bottom, span = (float(v) for v in (np.median(present), present.max(), present.min(), high - low))
    for name, outside, reading in (("high", rest - high, rest), ("low", low - rest, rest)):
        if outside > ZERO_SHARE * span:
            return "fail", worded(
                "rests at ",
                measured(reading, unit, ".3g"),
                f", beyond the {name} end of {shown}: zero the sensor, or correct its "
                "range, unit or polarity, before the next shot",
            )
    for name, outside, reading in (("high", top - high, top), ("low", low - bottom, bottom)):
        if outside > FAR_SHARE * span:
            return "fail", worded(
                "goes to ",
                measured(reading, unit, ".3g"),
                f", far beyond the {name} end of {shown}: correct the sensor's range, unit "
                "or polarity before the next shot",
            )
    used = max(top / high if high > 0 else 0.0, bottom / low if low < 0 else 0.0, 0.0)
    return "ok", f"peak uses {100 * used:.0f} % of the range {shown}"


def check_flat_tops(samples: Array, *, declared: bool = False) -> Outcome:
    """Look for runs of identical extreme values: clipping short of the declared range, or where none was declared.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN. An extreme near the median is where the signal rests, and a signal of two values is
        a switch; neither is clipped. Nor is the rounded top of a slow signal, of which one step below holds nearly as
        many samples.
    declared
        Whether the rig declares a range.
    """
    present = samples[np.isfinite(samples)]
    if present.size == 0:
        return "fail", NO_SAMPLE
    top, bottom, rest = float(present.max()), float(present.min()), float(np.median(present))
    if top == bottom:
        return "fail", f"the signal is always {top:.4g}: sensor not connected, or the wrong signal"
    if np.all((present == top) | (present == bottom)):
        return "ok", "a signal of two values"
    far = 0.5 * max(top - rest, rest - bottom)
    longest = int(LIMITS["flat_top"].warn)
    runs, flat = [0], 0
    for extreme in (top, bottom):
        if abs(extreme - rest) < far:
            continue
        first, behind = longest_run(present == extreme)
        runs.append(behind - first)
        if runs[-1] > longest and _piles_up(present, extreme, rest):
            flat = max(flat, runs[-1])
    if not flat:
        return "ok", f"no flat tops: at most {max(runs)} in a row at an extreme value"
    remedy = (
        "the recorder or the amplifier is set to less than the declared range; raise it there before the next shot"
        if declared
        else "raise the recorder's range before the next shot, and declare the sensor's range"
    )
    return "warn", f"{flat} samples in a row at one extreme value (limit {longest}) look like clipping; {remedy}"


def _piles_up(present: Array, extreme: float, rest: float) -> bool:
    """Return whether far more samples stand at an extreme than one step inside of it."""
    inside = np.abs(present - extreme)
    near = np.unique(inside[inside < 0.1 * abs(extreme - rest)])
    steps = near[near > 1e-9 * abs(extreme - rest)]
    if steps.size == 0:
        return True
    beside = np.count_nonzero((inside > 0) & (inside < 1.5 * steps[0]))
    return bool(np.count_nonzero(inside == 0) > PILED_UP * beside)


def check_out_of_band(samples: Array, in_baseline: Flags) -> Outcome:
    """Look for what clips ahead of the anti-alias filter: an amplifier at its slew rate, or one that is full.

    An amplifier at its slew rate makes flanks of one and the same rate, up and down, over most of their
    height. One that is full passes no noise: at the top of the pulse less of it is left than was there
    before the shot.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    in_baseline : ndarray of bool, shape (n,)
        Samples before the shot.
    """
    share = slew_limited_share(samples, in_baseline)
    slew, noise_left = LIMITS["slew_share"], LIMITS["noise_left_share"]
    if slew.verdict(share) != "ok":
        return "warn", (
            f"flanks up and down run at one and the same rate over {100 * share:.0f} % of their height (limit "
            f"{100 * slew.warn:g} %): the amplifier is at its slew rate; use a smaller gain, or a mechanical filter, "
            "before the next shot"
        )
    left = noise_left_at_peak(samples, in_baseline)
    if noise_left.verdict(left) != "ok" and not math.isnan(left):
        return "warn", (
            f"at its peak the signal has {100 * left:.0f} % of the noise that it has at rest (limit "
            f"{100 * noise_left.warn:g} %): the amplifier is full although the recorder is not; use a smaller gain "
            "before the next shot"
        )
    return "ok", f"no sign of clipping ahead of the recorder: {100 * share:.0f} % of a flank at one rate"


def slew_limited_share(samples: Array, in_baseline: Flags) -> float:
    """Return the part of a flank's height that runs at the largest rate, in the direction that has less of it.

    0 where noise hides it, or no flank is as long as `LEAST_AT_RATE` samples.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    in_baseline : ndarray of bool, shape (n,)
        Samples before the shot, in one piece.
    """
    rate = np.diff(samples)
    present = np.isfinite(rate)
    if np.count_nonzero(present) < LEAST_RATES:
        return 0.0
    rate = np.where(present, rate, 0.0)
    # where something rings third differences show the ringing
    noise = math.sqrt(2.0) * noise_sigma(samples[in_baseline])
    # the largest of many rates is by some three sigma of the noise too large
    fastest = float(min(rate.max(), -rate.min())) - NOISE_SIGMA * noise
    if not fastest > 0:
        return 0.0
    tolerance = RATE_TOLERANCE + (NOISE_SIGMA + 1) * noise / fastest
    if tolerance > MOST_TOLERANCE:
        return 0.0
    shares = []
    for sign in (1.0, -1.0):
        # the slew rate bounds all rates, and in both directions alike
        if float((sign * rate).max()) > (1 + tolerance) * fastest:
            return 0.0
        at_limit = sign * rate >= (1 - tolerance) * fastest
        shares.append(_share_of_flank(sign * rate, at_limit))
    return min(shares)


def _share_of_flank(rising: Array, at_limit: Flags) -> float:
    """Part of the flank around the longest run at the limit that the run makes up; `rising` positive on it."""
    start, end = longest_run(at_limit)
    if end - start < LEAST_AT_RATE:
        return 0.0
    turns_before = np.flatnonzero(rising[:start] <= 0)
    turns_after = np.flatnonzero(rising[end:] <= 0)
    first = int(turns_before[-1]) + 1 if turns_before.size else 0
    last = end + int(turns_after[0]) if turns_after.size else rising.size
    return float(np.sum(rising[start:end]) / np.sum(rising[first:last]))


def noise_left_at_peak(samples: Array, in_baseline: Flags) -> float:
    """Return the noise near the top of the pulse over that before the shot, both from third differences.

    NaN where the noise before the shot is below the resolution, or the top is too short.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    in_baseline : ndarray of bool, shape (n,)
        Samples before the shot, in one piece.
    """
    before = noise_sigma(samples[in_baseline])
    present = np.isfinite(samples)
    if not before > 0 or not present.any():
        return math.nan
    steps = np.abs(np.diff(samples[present]))
    steps = steps[steps > 0]
    if steps.size == 0 or before < 2 * float(steps.min()):
        return math.nan
    level = float(np.median(samples[in_baseline & present]))
    size = np.abs(samples - level)
    top = size >= NEAR_PEAK * float(np.nanmax(size))
    part = samples[slice(*longest_run(top))]
    if part.size < LEAST_TOP:
        return math.nan
    return noise_sigma(part) / before
