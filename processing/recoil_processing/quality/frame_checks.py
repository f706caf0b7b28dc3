"""Checks of a camera track as a whole: its frame rate, and pictures that repeat.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `recoil_processing.quality.limits`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.readers.tracks.rest import rest_repeats
from recoil_acquisition.shot.quality_check import Verdict
from recoil_processing.noise import hiding_resolution, noise_sigma
from recoil_processing.quality.limits import LIMITS, Outcome

LEAST_FRAMES = 3
"""Frames that have a rate."""


PLAYBACK = 1.5
"""Ratio of two frame rates beyond which one of them is that of the playback."""
SHOWN = 6
"""Frames that are named."""
AROUND = 3
"""Frames to either side that decide whether a feature moves."""
MOVING_SIGMA = 5.0
"""Multiple of the noise of a step by which a moving mark moves per frame."""


def duplicated_pictures(features: Sequence[Array]) -> Flags:
    """Find the frames whose picture repeats the one before: every feature that is seen stands still exactly.

    Parameters
    ----------
    features : sequence of ndarray, shape (n, n_axes) each
        Positions of all features; lost frames NaN.

    Returns
    -------
    ndarray of bool, shape (n,)
        Frames that repeat a picture. Frames held at either end are not among them, nor marks that rest without noise;
        none are with fewer than two features, where a picture that repeats could not be distinguished from a feature
        that is stuck.
    """
    if len(features) < 2:
        return np.zeros(features[0].shape[0] if features else 0, dtype=bool)
    again = [np.concatenate([[False], np.all(np.diff(f, axis=0) == 0, axis=1)]) for f in features]
    lost = [np.isnan(f).any(axis=1) for f in features]
    # one that is lost in the frame says nothing of the picture
    repeats = np.logical_and.reduce([a | gone for a, gone in zip(again, lost, strict=True)])
    repeats &= np.sum(again, axis=0) > 1
    repeats &= np.logical_or.reduce([a & ~rest_repeats(f) for a, f in zip(again, features, strict=True)])
    flags: Flags = repeats & ~_at_ends(np.concatenate(list(features), axis=1))
    return flags


def check_duplicated_pictures(frame_numbers: NDArray[np.int64], features: Sequence[Array]) -> Outcome:
    """Count duplicated pictures; see `duplicated_pictures`.

    Parameters
    ----------
    frame_numbers : ndarray, shape (n,)
    features : sequence of ndarray, shape (n, n_axes) each
        Positions of all features, at least two; lost frames NaN.

    Returns
    -------
    verdict, detail
        A few of them while nothing moves do not matter.
    """
    repeated = duplicated_pictures(features)
    if all(_hides_noise(axis) for feature in features for axis in feature.T):
        # at rest nothing tells a picture that repeats from one that was taken
        repeated &= np.logical_or.reduce([_moving(f) for f in features])
    pictures = np.flatnonzero(repeated)
    if pictures.size == 0:
        return "ok", f"no picture repeats in {frame_numbers.size} frames"
    moving = np.logical_or.reduce([_moving(f) for f in features])
    in_motion = int(np.count_nonzero(moving[pictures]))
    limit, few = LIMITS["repeated_share"], LIMITS["duplicated_share"].warn
    shown = ", ".join(str(n) for n in frame_numbers[pictures[:SHOWN]])
    text = (
        f"{pictures.size} of {frame_numbers.size} pictures repeat the one before (every feature does), {in_motion} of "
        f"them in the motion: frames {shown}{' ...' if pictures.size > SHOWN else ''}"
    )
    if not in_motion and pictures.size <= few * frame_numbers.size:
        return "ok", text
    verdict: Verdict = "fail" if limit.verdict(pictures.size / frame_numbers.size) == "fail" else "warn"
    return verdict, (
        f"{text}; export the recording at its record rate, without filling frames, and check the camera's memory "
        "before the next shot"
    )


def _hides_noise(axis: Array) -> bool:
    """Return whether a feature stands still where it rests: it never moves, or its resolution hides the noise."""
    present = axis[np.isfinite(axis)]
    return bool(present.size == 0 or np.ptp(present) == 0) or hiding_resolution(present) is not None


def _moving(positions: Array) -> Flags:
    """Return the frames in which a feature moves by more than noise per frame, shape (n,)."""
    moving = np.zeros(positions.shape[0], dtype=bool)
    for axis in positions.T:
        per_frame = np.abs(axis[2 * AROUND :] - axis[: -2 * AROUND]) / (2 * AROUND)
        noise = max(math.sqrt(2.0) * finite_or_zero(noise_sigma(axis)), hiding_resolution(axis) or 0.0)
        moving[AROUND:-AROUND] |= per_frame > MOVING_SIGMA * noise + 1e-12
    return moving


def _at_ends(positions: Array) -> Flags:
    """Return which frames belong to a run of equal positions at either end, shape (n,)."""
    same = np.all(np.diff(positions, axis=0) == 0, axis=1)
    moved = np.flatnonzero(~same)
    ends = np.zeros(positions.shape[0], dtype=bool)
    ends[: int(moved[0]) + 1 if moved.size else None] = True
    ends[int(moved[-1]) + 1 if moved.size else 0 :] = True
    return ends


def check_frame_rate(times_s: Array, numbers: NDArray[np.int64] | None, declared_hz: float | None) -> Outcome:
    """Compare the frames' times with their numbers and with the frame rate that the rig declares.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times, strictly increasing.
    numbers : ndarray, shape (n,), or None
        Frame numbers; None if the file has none.
    declared_hz
        Frame rate that the rig declares; None if it declares none.
    """
    if times_s.size < LEAST_FRAMES:
        return "ok", f"{times_s.size} frames: no rate to compare"
    # the median over an eighth of the recording: a few digits of a printed time are little of it, and a jump is in few
    span = max(times_s.size // 8, 1)
    counted = np.arange(times_s.size) if numbers is None else numbers
    slopes = (times_s[span:] - times_s[:-span]) / (counted[span:] - counted[:-span])
    rate_hz = 1.0 / float(np.median(slopes))
    limit = LIMITS["frame_rate_share"]
    if declared_hz is not None:
        off = abs(rate_hz / declared_hz - 1)
        text = f"the file's frame rate is {rate_hz:.6g} Hz, the rig declares {declared_hz:g} Hz"
        if limit.verdict(off) == "fail" or not 1 / PLAYBACK < rate_hz / declared_hz < PLAYBACK:
            return (
                "fail",
                f"{text}: one of them is the playback rate; export the times of the recording, or correct `frame_rate`",
            )
        if limit.verdict(off) == "warn":
            return (
                "warn",
                f"{text} (limit {100 * limit.warn:g} %); read the record rate at the camera and correct `frame_rate`",
            )
    line = times_s - (times_s[0] + (counted - counted[0]) / rate_hz)
    off_line = np.abs(line - np.median(line)) * rate_hz
    # a printed time is rounded, at most to half a frame where it distinguishes frames at all
    wrong = int(np.count_nonzero(np.abs(np.diff(line)) * rate_hz > 0.5))
    if numbers is None:
        steps = np.diff(times_s) * rate_hz
        wrong = int(np.count_nonzero(np.abs(steps - np.round(steps)) > max(limit.warn, 0.25)))
    if wrong or float(off_line.max()) > 1.0:
        return "warn", (
            f"times and frame numbers disagree at {max(wrong, 1)} places, by {off_line.max():.2g} frames at most: "
            "frames were dropped or the clip was joined; export one clip with its own frame numbers"
        )
    return "ok", f"{rate_hz:.6g} frames/s, times and numbers agree"


def finite_or_zero(value: float) -> float:
    """Return a number, 0 where it is none."""
    return value if math.isfinite(value) else 0.0
