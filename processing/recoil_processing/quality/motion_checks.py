"""Checks of the motion: velocity against the camera and at rest, direction of the pulse.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `recoil_processing.quality.limits`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE
from recoil_processing.quality.level_checks import NO_SAMPLE
from recoil_processing.quality.limits import LIMITS, Outcome

SPAN_S = 4e-3
"""Span over which the camera's velocity is taken: 0.05 mm of noise at 6000 frames/s then is 0.02 m/s."""
LEAST_SPANS = 8
"""Velocities that must be there to be compared."""
EXPLAINED = 1 / 3
"""Share of the difference that may be left for a shift of the zero to explain it."""
COVERAGE = 1.96
"""Standard uncertainties by which a share may be nearer to what is allowed, 95 %."""


@dataclass(frozen=True)
class VelocityError:
    """Difference of an accelerometer's velocity from a camera's.

    Attributes
    ----------
    largest_m_s
        Difference of the velocities where it is largest, signed: accelerometer less camera.
    peak_m_s
        Largest velocity by the camera.
    zero_m_s2
        Constant acceleration since the first instant that explains most of the differences.
    left_m_s
        Largest difference without that constant acceleration.
    """

    largest_m_s: float
    peak_m_s: float
    zero_m_s2: float
    left_m_s: float


def velocity_error(times_s: Array, positions_m: Array, travel_m: Array, start_s: float) -> VelocityError | None:
    """Compare two velocities, a camera's and an accelerometer's.

    Both are taken over the same spans of `SPAN_S`. The median over as many differences keeps a frame that
    jumps from deciding.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times of the frames within the motion.
    positions_m : ndarray, shape (n,)
        Positions of the mark; lost frames are NaN.
    travel_m : ndarray, shape (n,)
        Travel by the accelerometer, at the same instants.
    start_s
        Instant from which on a zero may have shifted.

    Returns
    -------
    VelocityError or None
        Error of the velocity; None if there are too few frames.
    """
    seen = np.isfinite(positions_m) & np.isfinite(travel_m)
    t, x, d = times_s[seen], positions_m[seen], travel_m[seen]
    if t.size < 2:
        return None
    span = max(2, round(SPAN_S / float(np.median(np.diff(t)))))
    if t.size < 3 * span + LEAST_SPANS:
        return None
    dt = t[span:] - t[:-span]
    by_camera, by_accelerometer = (x[span:] - x[:-span]) / dt, (d[span:] - d[:-span]) / dt
    width = 2 * span + 1
    difference = np.median(np.lib.stride_tricks.sliding_window_view(by_accelerometer - by_camera, width), axis=1)
    middle = 0.5 * (t[span:] + t[:-span])[span : span + difference.size]
    since = np.maximum(middle - start_s, 0.0)
    zero = float(np.sum(difference * since) / max(float(np.sum(since**2)), 1e-300))
    left = difference - zero * since
    return VelocityError(
        float(difference[np.argmax(np.abs(difference))]),
        float(np.max(np.abs(by_camera))),
        zero,
        float(np.max(np.abs(left))),
    )


def check_velocity(error: VelocityError) -> Outcome:
    """Compare the accelerometer's velocity with the camera's.

    Returns
    -------
    verdict, detail
        Verdict and its sentence. An error that a constant acceleration explains is no more than a warning: a zero that
        moved can be corrected.
    """
    if not (math.isfinite(error.largest_m_s) and error.peak_m_s > 0):
        off, at = (measured(size, "m/s", ".3g") for size in (error.largest_m_s, error.peak_m_s))
        return "warn", worded("velocity off by ", off, " at ", at, ": check both records")
    share, left = abs(error.largest_m_s) / error.peak_m_s, error.left_m_s / error.peak_m_s
    limit = LIMITS["velocity_share"]
    text = worded(
        "the accelerometer's velocity is at most ",
        measured(error.largest_m_s, "m/s", "+.3g"),
        f" off, {100 * share:.1f} % of ",
        measured(error.peak_m_s, "m/s", ".3g"),
    )
    if limit.verdict(share) != "ok" and left < EXPLAINED * share:
        return "fail" if limit.verdict(left) == "fail" else "warn", worded(
            text,
            f" (limit {100 * limit.warn:g} %); a zero that is off by ",
            measured(error.zero_m_s2, "m/s^2", "+.3g"),
            " since the shot explains it: check the accelerometer's mounting and charge amplifier before the next shot",
        )
    remedy = (
        ": wrong sensitivity, clipping or another scale of the picture; check range and gain, and the picture's scale, "
        "before the next shot"
    )
    return limit.outcome(share, text, remedy, share=True)


def to_turn(polarity: int) -> str:
    """Say what to do about a sensor that reads the wrong way round.

    Parameters
    ----------
    polarity
        Polarity that the rig declares, 1 or -1: what is declared already can only be taken out.
    """
    if polarity < 0:
        return "its `polarity` in the rig is -1: take it out, or turn the sensor"
    return "set `polarity = -1` or turn the sensor"


def check_carriage(excess: float, u: float, *, polarity: int = 1) -> Outcome:
    """Judge the part that a carriage's accelerometer has in the recoil travel against a camera's.

    Parameters
    ----------
    excess
        Share of that part which would have to be taken off to agree with the camera: 0 if the sensor is right,
        2 if it is turned, ``1 - 1/g`` if it reads g times too much.
    u
        Standard uncertainty of that share, the sensor's scale included.
    polarity
        Polarity that the rig declares.

    Returns
    -------
    verdict, detail
        Verdict and its sentence; a share that is not significant is never more than ok, and one whose 95 % interval
        reaches within a limit is not beyond it.
    """
    limit = LIMITS["carriage_excess"]
    text = f"{100 * (1.0 - excess):.0f} % of its part in the recoil travel is there (u {100 * u:.2g} %) by the camera"
    if not abs(excess) > CRITICAL_VALUE * u:
        return "ok", text
    verdict = limit.verdict(abs(excess) - COVERAGE * u)
    if verdict == "ok":
        return "ok", text
    turned = abs(excess - 2.0) < min(0.5, CRITICAL_VALUE * u + 0.25)
    advice = (
        f"the sensor is turned: {to_turn(polarity)}"
        if turned
        else "check that all files are of this shot, then its gain, its axis and its cable"
    )
    return verdict, f"{text}, within {100 * (limit.fail if verdict == 'fail' else limit.warn):g} % of all: {advice}"


def check_rest_to_rest(final_m_s: float, peak_m_s: float) -> Outcome:
    """Whether the accelerometer's velocity is zero where the mechanism has come to rest again.

    Parameters
    ----------
    final_m_s, peak_m_s
        Velocity by the accelerometer at rest after the shot, and its largest.
    """
    share = abs(final_m_s) / peak_m_s if peak_m_s > 0 else math.nan
    final = measured(final_m_s, "m/s", "+.3g")
    text = worded("its velocity is ", final, f" at rest after the shot, {100 * share:.1f} % of its peak")
    remedy = ": its zero moved; check mounting and charge amplifier before the next shot"
    return LIMITS["velocity_share"].outcome(share, text, remedy, share=True)


def check_polarity(samples: Array, in_baseline: Flags, *, polarity: int = 1) -> Outcome:
    """Whether the pulse points the declared way: its first swing must be positive.

    Judged by the integral, on which ringing leaves little: it must first reach half its largest size
    upwards. An acceleration is followed by braking of the same impulse, so that extremes do not decide.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    in_baseline : ndarray of bool, shape (n,)
        Samples before the shot; their level counts as zero.
    polarity
        Polarity that the rig declares.
    """
    present = np.isfinite(samples)
    baseline = samples[in_baseline & present]
    moved = samples[present] - (float(np.median(baseline)) if baseline.size else 0.0)
    if moved.size == 0:
        return "fail", NO_SAMPLE
    # outside the motion the integral would only gather what is wrong with the level
    motion = np.flatnonzero(np.abs(moved) >= 0.1 * np.max(np.abs(moved)))
    swing = np.cumsum(moved[motion[0] : motion[-1] + 1])
    first = int(np.argmax(np.abs(swing) >= 0.5 * np.max(np.abs(swing))))
    mean = float(swing[first]) / (first + 1)
    if mean >= 0:
        return "ok", f"pulse points the declared way: its first swing averages {mean:+.3g}"
    return "fail", (
        f"the pulse points against the declared polarity, its first swing averages {mean:+.3g}: {to_turn(polarity)}"
    )
