"""Checks of one channel's samples: each a small function with its limit, and a verdict.

Every check returns ``(verdict, detail)``; the detail gives the figure, the limit and what to do about
it, in words for the person at the range. Limits and their sources stand in `LIMITS`. The checks of a
camera's track are `processing.track_quality`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from daq.shot import Verdict
from processing.gaps import longest_run
from processing.track_quality import check_lost_frames, check_repeated_frames

__all__ = [
    "LIMITS",
    "Outcome",
    "check_clipping",
    "check_flat_tops",
    "check_losses",
    "check_lost_frames",
    "check_polarity",
    "check_quiet",
    "check_repeated_frames",
    "check_zero_shift",
    "worst",
]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Outcome = tuple[Verdict, str]

LIMITS = MappingProxyType(
    {
        "clipped_share": (0.0, 0.02),  # mass bias 1.2 % at 1.8 % clipped samples: synthetic study of recoil pulses
        "lost_share": (0.0, 0.05),
        "longest_gap_s": (0.0, 1e-2),
        "offset_share": (0.02, 0.10),  # of the peak; an offset is corrected, a large one means a wrong zero
        "signal_to_noise_db": (30.0, 20.0),  # MIL-STD-810H, method 522.2: useful at least 20 dB above the noise
        "zero_shift_share": (0.0025, 0.05),  # 1 % of the peak costs 12 % of the velocity 85 ms later
    }
)
"""Check -> (warn beyond, fail beyond); below, for the ratio of signal to noise."""
LEAST_SILENCE = 50
"""Samples of silence that tell offset and noise."""
LONGEST_TOP = 4
"""Samples in a row at one extreme value that chance does not make."""


def check_clipping(samples: Array, low: float, high: float, *, unit: str) -> Outcome:
    """Count samples at or beyond an end of the declared range, against those where the signal moves.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Lost samples NaN.
    low, high : float
        Declared range, in the unit that is named. Within 0.001 of it from an end counts as clipped; an
        end at zero is where a one-sided gauge rests, and only what lies beyond it counts.
    unit : str

    Returns
    -------
    verdict, detail
        The share is that of the samples above a tenth of the peak: the pulse, not the silence.

    Raises
    ------
    ValueError
        If the range is empty or not finite.
    """
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ValueError(f"a range needs low < high, not [{low}, {high}]")
    present = samples[~np.isnan(samples)]
    if present.size == 0:
        return "fail", "no sample at all: check the sensor and its signal's name"
    margin = 0.001 * (high - low)
    above = present > high + margin if abs(high) <= margin else present >= high - margin
    below = present < low - margin if abs(low) <= margin else present <= low + margin
    clipped = int(np.count_nonzero(above | below))
    largest = max(abs(low), abs(high))
    peak = float(np.max(np.abs(present)))
    if clipped == 0:
        return "ok", f"peak uses {100 * peak / largest:.0f} % of the range [{low:g}, {high:g}] {unit}"
    pulse = int(np.count_nonzero(np.abs(present) > 0.1 * peak)) if math.isfinite(peak) else clipped
    share = clipped / max(pulse, clipped)
    fail = LIMITS["clipped_share"][1]
    verdict: Verdict = "fail" if share > fail else "warn"
    return verdict, (
        f"{clipped} samples, {100 * share:.1f} % of the pulse (limit {100 * fail:g} %), at the end of the range "
        f"[{low:g}, {high:g}] {unit}; raise the range beyond {1.5 * largest:.3g} {unit} before the next shot"
    )


def check_flat_tops(samples: Array) -> Outcome:
    """Look for runs of identical extreme values: clipping where no range was declared.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Lost samples NaN. An extreme near the median is where the signal rests, and a signal of two
        values is a switch; neither is clipped.
    """
    present = samples[np.isfinite(samples)]
    if present.size == 0:
        return "fail", "no sample at all: check the sensor and its signal's name"
    top, bottom, rest = float(present.max()), float(present.min()), float(np.median(present))
    if top == bottom:
        return "fail", f"the signal is always {top:.4g}: sensor not connected, or the wrong signal"
    if np.all((present == top) | (present == bottom)):
        return "ok", "a signal of two values"
    far = 0.5 * max(top - rest, rest - bottom)
    run = max(longest_run(present == extreme) for extreme in (top, bottom) if abs(extreme - rest) >= far)
    if run >= LONGEST_TOP:
        return "warn", (
            f"{run} samples in a row at one extreme value (limit {LONGEST_TOP}) look like clipping; "
            "declare the sensor's range"
        )
    return "ok", f"no flat tops: at most {run} in a row at an extreme value"


def check_losses(samples: Array, rate_hz: float) -> Outcome:
    """Count lost samples, and find the longest gap.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Lost samples NaN.
    rate_hz : float
        Samples per second.
    """
    if samples.size == 0:
        return "fail", "no sample at all: check the sensor and its signal's name"
    lost = ~np.isfinite(samples)
    count = int(lost.sum())
    if count == 0:
        return "ok", "no sample lost"
    share, gap_s = count / samples.size, longest_run(lost) / rate_hz
    most, longest = LIMITS["lost_share"][1], LIMITS["longest_gap_s"][1]
    text = (
        f"{count} of {samples.size} samples lost ({100 * share:.2f} %, limit {100 * most:g} %), "
        f"longest gap {1e3 * gap_s:.2f} ms (limit {1e3 * longest:g} ms); check the cable and the bus load"
    )
    return ("warn" if share <= most and gap_s <= longest else "fail"), text


def check_quiet(samples: Array, quiet: Flags, static: float | None, *, unit: str) -> Outcome:
    """Offset and noise before the shot, against the pulse.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Lost samples NaN.
    quiet : ndarray of bool, shape (n,)
        Before the shot.
    static : float or None
        What the sensor reads at rest if its zero is right, in the unit; None if that is not known.
    unit : str
    """
    present = np.isfinite(samples)
    silence = samples[quiet & present]
    if silence.size < LEAST_SILENCE:
        return "warn", (
            f"{silence.size} samples of silence before the shot (limit {LEAST_SILENCE}): offset and noise unknown; "
            "lengthen the pre-trigger"
        )
    peak = float(np.max(np.abs(samples[present] - np.mean(silence))))
    noise = float(np.std(silence))
    if peak == 0:
        return "fail", f"the signal never leaves {silence[0]:.3g} {unit}: check gain and cable"
    ratio_db = 20 * math.log10(peak / noise) if noise > 0 else math.inf
    offset = 0.0 if static is None else float(np.mean(silence)) - static
    text = f"offset {offset:.3g} {unit}, noise {noise:.3g} {unit}"
    text += f", peak {ratio_db:.0f} dB above it" if noise > 0 else " (below the resolution)"
    warn_db, fail_db = LIMITS["signal_to_noise_db"]
    share = abs(offset) / peak
    warn_offset, fail_offset = LIMITS["offset_share"]
    if ratio_db < fail_db:
        return "fail", f"{text}; below {fail_db:.0f} dB: check gain and cable"
    if share > fail_offset:
        return "fail", f"{text}; the offset is {100 * share:.0f} % of the peak: zero the sensor"
    if ratio_db < warn_db:
        return "warn", f"{text}; below {warn_db:.0f} dB: a smaller range would help"
    if share > warn_offset:
        return "warn", f"{text}; the offset is {100 * share:.1f} % of the peak: zero the sensor before the next shot"
    return "ok", text


def check_zero_shift(bias: float, u_bias: float, peak: float, *, unit: str) -> Outcome:
    """Whether an accelerometer's zero moved during the shot.

    Parameters
    ----------
    bias, u_bias : float
        Constant acceleration by which it disagrees with the camera's displacement, after its offset
        before the shot was taken off, and the standard uncertainty of that.
    peak : float
        Of the acceleration.
    unit : str
    """
    if not (math.isfinite(bias) and peak > 0):
        return "warn", f"zero moved by {bias:.3g} {unit} at a peak of {peak:.3g} {unit}: check both records"
    share = abs(bias) / peak
    sure = max(abs(bias) - 3 * u_bias, 0.0) / peak
    warn, fail = LIMITS["zero_shift_share"]
    text = f"zero moved by {bias:+.3g} {unit} (u {u_bias:.2g}) against the camera, {100 * share:.2f} % of the peak"
    if sure > fail:
        return "fail", f"{text} (limit {100 * fail:g} %); check its mounting and charge amplifier"
    if sure > warn:
        return "warn", f"{text} (limit {100 * warn:g} %); check its mounting and charge amplifier"
    return "ok", text


def check_polarity(samples: Array, quiet: Flags) -> Outcome:
    """Whether the pulse points the declared way: its first swing must be positive.

    Judged by the integral, on which ringing leaves little: it must first reach half its largest size
    upwards. An acceleration is followed by braking of the same impulse, so that extremes do not tell.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Lost samples NaN.
    quiet : ndarray of bool, shape (n,)
        Before the shot; its level counts as zero.
    """
    present = np.isfinite(samples)
    silence = samples[quiet & present]
    moved = samples[present] - (float(np.median(silence)) if silence.size else 0.0)
    if moved.size == 0:
        return "fail", "no sample at all: check the sensor and its signal's name"
    # outside the motion the integral would only gather what is wrong with the level
    motion = np.flatnonzero(np.abs(moved) >= 0.1 * np.max(np.abs(moved)))
    swing = np.cumsum(moved[motion[0] : motion[-1] + 1])
    first = int(np.argmax(np.abs(swing) >= 0.5 * np.max(np.abs(swing))))
    mean = float(swing[first]) / (first + 1)
    if mean >= 0:
        return "ok", f"pulse points the declared way: its first swing averages {mean:+.3g}"
    return "fail", (
        f"the pulse points against the declared polarity, its first swing averages {mean:+.3g}: "
        "set `polarity = -1` or turn the sensor"
    )


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """Return the worst of several verdicts; ``ok`` for none."""
    return "fail" if "fail" in verdicts else "warn" if "warn" in verdicts else "ok"
