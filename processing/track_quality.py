"""Checks of a camera's track: frames that are lost, and pictures or positions that repeat.

Every check returns ``(verdict, detail)`` as those of `processing.quality` do.
"""

from __future__ import annotations

import math
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from daq.shot import Verdict
from processing.noise import noise_sigma, robust_sigma

Array = NDArray[np.float64]
Outcome = tuple[Verdict, str]

TRACK_LIMITS = MappingProxyType(
    {
        "lost_frames_share": (0.02, 0.20),
        "longest_gap_s": (2e-2, math.inf),  # the accelerometer carries the travel across; the camera alone cannot
        "repeated_share": (0.0, 0.10),  # published tracks repeat 1.4 % in the median, tracked badly 56 %
    }
)
"""Check -> (warn beyond, fail beyond)."""


def check_lost_frames(frame_times_s: Array, positions: Array) -> Outcome:
    """Count frames without a position and frames that are not in the file at all.

    Parameters
    ----------
    frame_times_s : ndarray, shape (n,)
        Strictly increasing.
    positions : ndarray, shape (n,)
        NaN where the frame was lost.
    """
    advice = "track the marker again or improve the light"
    seen = frame_times_s[np.isfinite(positions)]
    if seen.size < 2:
        return "fail", f"{seen.size} of {frame_times_s.size} frames have a position; {advice}"
    period = float(np.median(np.diff(frame_times_s)))
    expected = round(float(frame_times_s[-1] - frame_times_s[0]) / period) + 1
    lost = max(expected - seen.size, 0)
    gap_s = max(float(np.max(np.diff(seen))) - period, 0.0)
    share = lost / expected
    warn, fail = TRACK_LIMITS["lost_frames_share"]
    longest = TRACK_LIMITS["longest_gap_s"][0]
    text = f"{lost} of {expected} frames lost ({100 * share:.1f} %), longest gap {1e3 * gap_s:.1f} ms"
    limits = f"(limits {100 * warn:g} % and {1e3 * longest:g} ms)"
    if share > fail:
        return "fail", f"{text} (limit {100 * fail:g} %); {advice}"
    if share > warn or gap_s > longest:
        return "warn", f"{text} {limits}; {advice}"
    return "ok", text


def check_repeated_frames(positions: Array) -> Outcome:
    """Count exact repeats while the marker moves: duplicated pictures or a stuck feature.

    A run of equal positions lies in the motion if the position goes on by more than noise per frame
    of the run, once it goes on. A track that is held before or after the motion is not meant.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        NaN where the frame was lost.
    """
    present = positions[np.isfinite(positions)]
    if present.size < 3:
        return "fail", f"{present.size} positions only: track the marker again"
    first = np.flatnonzero(np.concatenate([[True], np.diff(present) != 0]))
    lengths = np.diff(np.append(first, present.size))
    per_frame = np.abs(np.diff(present[first])) / lengths[:-1]
    start = present[: max(16, present.size // 20)]
    noise = max(robust_sigma(np.diff(start)), math.sqrt(2.0) * _finite_or_zero(noise_sigma(present)))
    moving = per_frame > 5 * noise + 1e-12
    repeats = int((lengths[:-1][moving] - 1).sum())
    share = repeats / max(int(lengths[:-1][moving].sum()), 1)
    fail = TRACK_LIMITS["repeated_share"][1]
    text = f"{repeats} repeated positions during the motion"
    if share > fail:
        return "fail", (
            f"{text}, {100 * share:.0f} % of it (limit {100 * fail:g} %): the feature is stuck or pictures are "
            "duplicated; track it again"
        )
    if repeats:
        return "warn", f"{text}, {100 * share:.1f} % of it: look for duplicated pictures"
    return "ok", text


def _finite_or_zero(value: float) -> float:
    return value if math.isfinite(value) else 0.0
