"""Checks of a channel's levels: rest before the shot, rest after it.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `recoil_processing.quality.limits`.
"""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.noise import robust_sigma
from recoil_processing.quality.limits import LIMITS, Outcome

NO_SAMPLE = "no sample at all: check the sensor and its signal's name"

LEAST_BASELINE_SAMPLES = 50
"""Samples of pre-trigger baseline by which offset and noise are estimated."""
LEAST_PER_HALF = 64
"""Samples of a half of the pre-trigger baseline below which the noise of the two halves is not compared."""
BLOCKS_PER_HALF = 8
"""Means that show how far the level of a half scatters, whatever the colour of its noise."""
HALVES_SIGMA = 4.0
"""Standard errors between the halves of a pre-trigger baseline; by chance 1 in 800."""
LOUDER = 2.0
"""Noise of the louder half over that of the quieter one."""


def check_baseline(samples: Array, in_baseline: Flags, static: float | None, *, unit: str) -> Outcome:
    """Offset and noise before the shot, against the pulse.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    in_baseline : ndarray of bool, shape (n,)
        Samples before the shot.
    static
        Value that the sensor reads at rest if its zero is right, in the unit; None if that is not known.
    """
    present = np.isfinite(samples)
    baseline = samples[in_baseline & present]
    if baseline.size < LEAST_BASELINE_SAMPLES:
        return "warn", (
            f"{baseline.size} samples of pre-trigger baseline (limit {LEAST_BASELINE_SAMPLES}): offset and noise "
            "unknown; lengthen the pre-trigger"
        )
    peak = float(np.max(np.abs(samples[present] - np.mean(baseline))))
    noise = float(np.std(baseline))
    if peak == 0:
        found = measured(float(baseline[0]), unit, ".3g")
        return "fail", worded("the signal never leaves ", found, ": check gain and cable")
    ratio_db = 20 * math.log10(peak / noise) if noise > 0 else math.inf
    offset = 0.0 if static is None else float(np.mean(baseline)) - static
    above = f", peak {ratio_db:.0f} dB above it" if noise > 0 else " (below the resolution)"
    text = worded("offset ", measured(offset, unit, ".3g"), ", noise ", measured(noise, unit, ".3g"), above)
    limit_db, limit_offset = LIMITS["signal_to_noise_db"], LIMITS["offset_share"]
    share = abs(offset) / peak
    if ratio_db < limit_db.fail:
        return "fail", worded(text, f"; below {limit_db.fail:.0f} dB: check gain and cable")
    if share > limit_offset.fail:
        return "fail", worded(text, f"; the offset is {100 * share:.0f} % of the peak: zero the sensor")
    if ratio_db < limit_db.warn:
        return "warn", worded(text, f"; below {limit_db.warn:.0f} dB: a smaller range would help")
    if share > limit_offset.warn:
        remedy = f"; the offset is {100 * share:.1f} % of the peak: zero the sensor before the next shot"
        return "warn", worded(text, remedy)
    return "ok", text


def check_steady_baseline(samples: Array, in_baseline: Flags, *, unit: str) -> Outcome:
    """Compare level and noise of the two halves of the pre-trigger baseline.

    A difference counts if it is beyond chance, by the scatter of `BLOCKS_PER_HALF` means of either half, and
    beyond the limit for a zero: only then it is in the velocity.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    in_baseline : ndarray of bool, shape (n,)
        Samples before the shot.
    """
    present = np.isfinite(samples)
    baseline = samples[in_baseline & present]
    if baseline.size < max(LEAST_BASELINE_SAMPLES, 4 * BLOCKS_PER_HALF):
        return "ok", f"{baseline.size} samples of pre-trigger baseline: too few to compare its halves"
    peak = float(np.max(np.abs(samples[present] - np.median(baseline))))
    half = baseline.size // 2
    halves = baseline[:half], baseline[-half:]
    means = [np.array([np.mean(block) for block in np.array_split(h, BLOCKS_PER_HALF)]) for h in halves]
    moved = float(np.mean(means[1]) - np.mean(means[0]))
    error = math.sqrt(sum(float(np.var(m, ddof=1)) / BLOCKS_PER_HALF for m in means))
    limit = LIMITS["baseline_share"]
    bound = f"(limit {100 * limit.warn:g} % of the peak)"
    if abs(moved) > HALVES_SIGMA * error and limit.verdict(abs(moved) / max(peak, 1e-300)) != "ok":
        return "warn", worded(
            "the level before the shot moves by ",
            measured(moved, unit, "+.3g"),
            f", {100 * abs(moved) / peak:.2f} % of the peak {bound}; wait until the mechanism is at rest and the "
            "sensor has settled before the next shot",
        )
    first, second = (robust_sigma(h) for h in halves)
    louder, quieter = max(first, second), min(first, second)
    if half >= LEAST_PER_HALF and louder > LOUDER * quieter and limit.verdict(louder / max(peak, 1e-300)) != "ok":
        return "warn", worded(
            "the noise before the shot changes from ",
            measured(first, unit, ".3g", unit_follows=True),
            " to ",
            measured(second, unit, ".3g"),
            f" {bound}; look for a loose cable, or somebody at the mechanism, before the next shot",
        )
    steady = "level and noise of the pre-trigger baseline are steady within "
    return "ok", worded(steady, measured(abs(moved), unit, ".2g"))


def check_filtered_noise(filtered: Array, in_baseline: Flags, pulse: Flags, *, needed: bool) -> Outcome:
    """Ratio of signal to noise behind the low-pass: root mean square in the pulse over that before it.

    Parameters
    ----------
    filtered : ndarray, shape (n,)
        Samples behind the low-pass; what is not trusted is NaN.
    in_baseline, pulse : ndarray of bool, shape (n,)
        Samples before the shot, out of reach of the filter; and samples in the pulse.
    needed
        Whether the mass depends on this channel directly: only then the limit for 1 % of mass warns.
    """
    baseline, signal = filtered[in_baseline & np.isfinite(filtered)], filtered[pulse & np.isfinite(filtered)]
    if baseline.size < LEAST_BASELINE_SAMPLES or signal.size == 0:
        return (
            "ok",
            f"{baseline.size} samples of pre-trigger baseline out of the filter's reach: too few to estimate its noise",
        )
    level = float(np.mean(baseline))
    noise, rms = float(np.std(baseline)), float(np.sqrt(np.mean((signal - level) ** 2)))
    if noise == 0:
        return "ok", "noise below the resolution"
    ratio_db = 20 * math.log10(max(rms, 1e-300) / noise)
    text = f"pulse {ratio_db:.0f} dB above the noise behind the low-pass"
    remedy = "; choose a smaller range, or check gain and cable, before the next shot"
    outcome = LIMITS["filtered_signal_to_noise_db"].outcome(ratio_db, text, remedy, unit=" dB")
    return ("ok", text) if outcome[0] == "warn" and not needed else outcome


def check_level_after(samples: Array, in_baseline: Flags, after: Flags, *, unit: str, u_moving: float = 0.0) -> Outcome:
    """Compare the level after the shot, at rest again, with the one before.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    in_baseline, after : ndarray of bool, shape (n,)
        Samples before the shot; and after it, where the signal should be back.
    u_moving
        Standard uncertainty of a zero that moves in a shot, as it is stated: twice that much is no surprise.
    """
    present = np.isfinite(samples)
    before, behind = samples[in_baseline & present], samples[after & present]
    if min(before.size, behind.size) < LEAST_BASELINE_SAMPLES:
        return "ok", f"{behind.size} samples after the shot: too few to estimate the zero"
    blocks = [np.array([np.mean(b) for b in np.array_split(part, 2 * BLOCKS_PER_HALF)]) for part in (before, behind)]
    shift = float(np.mean(behind) - np.mean(before))
    error = math.sqrt(sum(float(np.var(b, ddof=1)) / b.size for b in blocks))
    peak = float(np.max(np.abs(samples[present] - np.mean(before))))
    sure = max(abs(shift) - 3 * error - 2 * u_moving, 0.0) / max(peak, 1e-300)
    text = worded(
        "zero after the shot ",
        measured(shift, unit, "+.3g"),
        " (u ",
        measured(error, unit, ".2g"),
        f") off the one before, {100 * abs(shift) / peak:.2f} % of the peak",
        *(("; stated to move by ", measured(u_moving, unit, ".2g"), " (u)") if u_moving else ()),
    )
    remedy = "; check its mounting, its temperature and its charge amplifier before the next shot"
    return LIMITS["zero_shift_share"].outcome(sure, text, remedy, share=True)


def check_zero_shift(bias: float, u_bias: float, peak: float, *, unit: str, against: str = "the camera") -> Outcome:
    """Whether an accelerometer's zero moved during the shot.

    Parameters
    ----------
    bias, u_bias
        Constant acceleration by which it disagrees with another sensor, after its offset before the shot
        was taken off, and the standard uncertainty of that.
    peak
        Peak of the acceleration.
    against
        Sensor that the zero is compared with, in words.
    """
    if not (math.isfinite(bias) and peak > 0):
        moved, at = measured(bias, unit, ".3g"), measured(peak, unit, ".3g")
        return "warn", worded("zero moved by ", moved, " at a peak of ", at, ": check both records")
    share = abs(bias) / peak
    sure = max(abs(bias) - 3 * u_bias, 0.0) / peak
    text = worded(
        "zero moved by ",
        measured(bias, unit, "+.3g"),
        " (u ",
        measured(u_bias, unit, ".2g"),
        f") against {against}, {100 * share:.2f} % of the peak",
    )
    remedy = "; check its mounting and charge amplifier before the next shot"
    return LIMITS["zero_shift_share"].outcome(sure, text, remedy, share=True)
