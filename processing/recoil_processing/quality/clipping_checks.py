"""Checks for clipping: at the recorder's range, and ahead of the recorder.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `recoil_processing.quality.limits`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from recoil_processing.gaps import longest_run
from recoil_processing.noise import noise_sigma
from recoil_processing.quality.level_checks import NO_SAMPLE
from recoil_processing.quality.limits import LIMITS, Outcome
from recoil_processing.repairs.clipping import find_clipped

LEAST_RATES = 64
"""Samples below which no rate is judged."""

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

PILED_UP = 5.0
"""Samples at the extreme over those one step below it; a smooth top has 2.4 times as many, ``1 / (sqrt(2) - 1)``."""
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


def check_clipping(samples: Array, low: float, high: float, *, unit: str) -> Outcome:
    """Count samples at or beyond an end of the declared range, against those where the signal moves.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Lost samples NaN.
    low, high
        Declared range, in the unit that is named; see `recoil_processing.repairs.clipping.find_clipped`.

    Returns
    -------
    verdict, detail
        The share is that of the samples above a tenth of the peak: the pulse, not the pre-trigger baseline.

    Raises
    ------
    ValueError
        If the range is empty or not finite.
    """
    found = find_clipped(samples, low, high)
    present = samples[~np.isnan(samples)]
    if present.size == 0:
        return "fail", NO_SAMPLE
    clipped = int(np.count_nonzero(found.flags))
    largest = max(abs(low), abs(high))
    peak = float(np.max(np.abs(present)))
    if clipped == 0:
        return "ok", f"peak uses {100 * peak / largest:.0f} % of the range [{low:g}, {high:g}] {unit}"
    pulse = int(np.count_nonzero(np.abs(present) > 0.1 * peak)) if math.isfinite(peak) else clipped
    share = clipped / max(pulse, clipped)
    limit = LIMITS["clipped_share"]
    return limit.verdict(share), (
        f"range too small: {clipped} samples, {100 * share:.1f} % of the pulse (limit {100 * limit.fail:g} %), at the "
        f"end of [{low:g}, {high:g}] {unit}; raise the range beyond {1.5 * largest:.3g} {unit} before the next shot"
    )


def check_flat_tops(samples: Array, *, declared: bool = False) -> Outcome:
    """Look for runs of identical extreme values: clipping short of the declared range, or where none was declared.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Lost samples NaN. An extreme near the median is where the signal rests, and a signal of two
        values is a switch; neither is clipped. Nor is the rounded top of a slow signal, of which one step
        below holds nearly as many samples.
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
        Lost samples NaN.
    in_baseline : ndarray of bool, shape (n,)
        Before the shot.
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
        Lost samples NaN.
    in_baseline : ndarray of bool, shape (n,)
        Before the shot, in one piece.
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
        Lost samples NaN.
    in_baseline : ndarray of bool, shape (n,)
        Before the shot, in one piece.
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
