"""Checks of one channel's samples: each a small function with its limit, and a verdict.

Every check returns ``(verdict, detail)``; the detail gives the figure, the limit and what to do about
it, in words for the person at the range. Limits and their sources stand in `LIMITS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from daq.shot import Verdict
from processing.noise import robust_sigma

Array = NDArray[np.float64]
Outcome = tuple[Verdict, str]

LIMITS = MappingProxyType(
    {
        "clipped_share": (0.0, 0.02),  # mass bias 1.2 % at 1.8 % clipped samples: synthetic study of recoil pulses
        "lost_share": (0.0, 0.05),
        "offset_share": (0.02, 0.10),  # of the peak; an offset is corrected, a large one means a wrong zero
        "signal_to_noise_db": (30.0, 20.0),  # MIL-STD-810H, method 522.2: useful at least 20 dB above the noise
        "zero_shift_share": (0.0025, 0.05),  # 1 % of the peak costs 12 % of the velocity 85 ms later
        "lost_frames_share": (0.02, 0.20),
        "longest_gap_s": (2e-3, 1e-2),
    }
)
"""Check -> (warn beyond, fail beyond)."""


def check_clipping(samples: Array, low: float, high: float, *, unit: str) -> Outcome:
    """Count samples at or beyond 0.999 of the declared range, against those where the signal moves.

    Parameters
    ----------
    samples : ndarray, shape (n,)
    low, high : float
        Declared range, in the unit that is named.
    unit : str

    Returns
    -------
    verdict, detail
        The share is that of the samples above a tenth of the peak: the pulse, not the silence.
    """
    present = samples[np.isfinite(samples)]
    margin = 0.001 * (high - low)
    clipped = int(np.count_nonzero((present >= high - margin) | (present <= low + margin)))
    if clipped == 0:
        peak = float(np.max(np.abs(present))) if present.size else 0.0
        used = peak / max(abs(low), abs(high))
        return "ok", f"peak uses {100 * used:.0f} % of the range [{low:g}, {high:g}] {unit}"
    pulse = max(int(np.count_nonzero(np.abs(present) > 0.1 * np.max(np.abs(present)))), 1)
    share = clipped / pulse
    advice = f"raise the range beyond {1.5 * max(abs(low), abs(high)):.3g} {unit} before the next shot"
    verdict: Verdict = "fail" if share > LIMITS["clipped_share"][1] else "warn"
    return verdict, f"{clipped} samples, {100 * share:.1f} % of the pulse, at the end of the range; {advice}"


def check_flat_tops(samples: Array) -> Outcome:
    """Look for runs of identical extreme values: clipping where no range was declared."""
    present = samples[np.isfinite(samples)]
    if present.size < 2 or np.ptp(present) == 0:
        return "fail", "the signal is constant: sensor not connected, or the wrong signal"
    at_top = present == present.max()
    at_bottom = present == present.min()
    runs = max(_longest_run(at_top), _longest_run(at_bottom))
    if runs >= 4:
        return "warn", f"{runs} samples in a row at one extreme value look like clipping; declare the sensor's range"
    return "ok", "no flat tops"


def check_losses(samples: Array, rate_hz: float) -> Outcome:
    """Lost samples, their share and the longest gap."""
    lost = np.isnan(samples)
    share = float(lost.mean()) if samples.size else 1.0
    if share == 0:
        return "ok", "no sample lost"
    gap_s = _longest_run(lost) / rate_hz
    text = f"{int(lost.sum())} of {samples.size} samples lost ({100 * share:.2f} %), longest gap {1e3 * gap_s:.2f} ms"
    if share > LIMITS["lost_share"][1] or gap_s > LIMITS["longest_gap_s"][1]:
        return "fail", f"{text}; check the cable and the bus load"
    return "warn", text


def check_lost_frames(frame_times_s: Array, positions: Array) -> Outcome:
    """Frames without a position, and frames that are not in the file at all."""
    period = float(np.median(np.diff(frame_times_s)))
    expected = round((frame_times_s[-1] - frame_times_s[0]) / period) + 1
    seen = frame_times_s[np.isfinite(positions)]
    lost = expected - seen.size
    share = lost / expected
    gap_s = float(np.max(np.diff(seen))) - period if seen.size > 1 else np.inf
    text = f"{lost} of {expected} frames lost ({100 * share:.1f} %), longest gap {1e3 * max(gap_s, 0.0):.1f} ms"
    warn, fail = LIMITS["lost_frames_share"]
    if share > fail:
        return "fail", f"{text}; track the marker again or improve the light"
    return ("warn" if share > warn or gap_s > 2 * LIMITS["longest_gap_s"][1] else "ok"), text


def check_repeated_frames(positions: Array) -> Outcome:
    """Exact repeats while the marker moves: duplicated pictures or a stuck feature."""
    present = positions[np.isfinite(positions)]
    if present.size < 3:
        return "fail", "no positions"
    moving = np.abs(np.gradient(present)) > 5 * robust_sigma(np.diff(present[: max(16, present.size // 20)])) + 1e-12
    repeats = int(np.count_nonzero((np.diff(present) == 0) & moving[1:]))
    share = repeats / max(int(moving.sum()), 1)
    text = f"{repeats} repeated positions during the motion"
    if share > 0.1:
        return "fail", f"{text}, {100 * share:.0f} % of it: the feature is stuck or pictures are duplicated"
    return ("warn" if repeats else "ok"), text


def check_quiet(samples: Array, quiet: NDArray[np.bool_], static: float | None, *, unit: str) -> Outcome:
    """Offset and noise before the shot, against the pulse."""
    silence = samples[quiet]
    silence = silence[np.isfinite(silence)]
    if silence.size < 50:
        return "warn", "no silence before the shot: offset and noise unknown; lengthen the pre-trigger"
    peak = float(np.nanmax(np.abs(samples - np.mean(silence))))
    noise = float(np.std(silence))
    ratio_db = 20 * np.log10(max(peak, 1e-300) / max(noise, 1e-300))
    offset = 0.0 if static is None else float(np.mean(silence)) - static
    text = f"offset {offset:.3g} {unit}, noise {noise:.3g} {unit}, peak {ratio_db:.0f} dB above it"
    warn_db, fail_db = LIMITS["signal_to_noise_db"]
    if ratio_db < fail_db:
        return "fail", f"{text}; below {fail_db:.0f} dB: check gain and cable"
    share = abs(offset) / max(peak, 1e-300)
    warn_offset, fail_offset = LIMITS["offset_share"]
    if share > fail_offset:
        return "fail", f"{text}; the offset is {100 * share:.0f} % of the peak: zero the sensor"
    if ratio_db < warn_db or share > warn_offset:
        return "warn", text
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
    share = abs(bias) / max(peak, 1e-300)
    sure = max(abs(bias) - 3 * u_bias, 0.0) / max(peak, 1e-300)
    text = f"zero moved by {bias:+.3g} {unit} against the camera, {100 * share:.2f} % of the peak"
    warn, fail = LIMITS["zero_shift_share"]
    if sure > fail:
        return "fail", f"{text}; check its mounting and charge amplifier"
    return ("warn" if sure > warn else "ok"), text


def check_polarity(samples: Array, quiet: NDArray[np.bool_]) -> Outcome:
    """Whether the pulse points the declared way: the extreme of larger size must be positive."""
    silence = samples[quiet]
    silence = silence[np.isfinite(silence)]
    level = float(np.median(silence)) if silence.size else 0.0
    moved = samples[np.isfinite(samples)] - level
    # the running mean over a thousandth of the record keeps ringing from deciding
    width = max(1, moved.size // 200)
    smooth = np.convolve(moved, np.ones(width) / width, mode="same")
    if smooth.max() >= abs(smooth.min()):
        return "ok", "pulse points the declared way"
    return "fail", "the pulse points against the declared polarity: set `polarity = -1` or turn the sensor"


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """Return the worst of several verdicts; ``ok`` for none."""
    return "fail" if "fail" in verdicts else "warn" if "warn" in verdicts else "ok"


def _longest_run(flags: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.view(np.int8), [0]))))
    return int((edges[1::2] - edges[::2]).max()) if edges.size else 0
