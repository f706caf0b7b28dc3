"""Checks of a camera's track: lost frames, repeats, padded ends, return to battery.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `quality.limits`. What
is checked of a single mark's positions is in `recoil_processing.quality.marker_checks`.
"""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.clocks.timebase import usual_step_s
from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.readers.tracks.rest import rest_repeats
from recoil_processing.noise import hiding_resolution, noise_sigma, robust_sigma
from recoil_processing.quality.frame_checks import MOVING_SIGMA, finite_or_zero
from recoil_processing.quality.limits import LIMITS, Outcome

LEAST_REST = 16
"""Frames at either end from which the mark's place at rest is estimated."""
START_S = 0.02
"""Time at the begin of a camera track in which a mark should rest."""
REST_S = 0.1
"""Time at its end: at the turning point of recoil a mark stands still for some frames, but not for so long."""
REST_SIGMA = 4.0
"""Noise multiples that a mark at rest may be off its mean."""
AT_EDGE = 0.02
"""Share of the travel from its extreme, within which a held end is where the mark left the picture."""


def check_lost_frames(frame_times_s: Array, positions: Array) -> Outcome:
    """Count frames without a position and frames that are not in the file at all.

    Parameters
    ----------
    frame_times_s : ndarray, shape (n,)
        Times, strictly increasing.
    positions : ndarray, shape (n,)
        Positions; NaN where the frame was lost.
    """
    advice = "track the marker again or improve the light"
    seen = frame_times_s[np.isfinite(positions)]
    if seen.size < 2:
        return "fail", f"{seen.size} of {frame_times_s.size} frames have a position; {advice}"
    period = usual_step_s(frame_times_s)
    expected = round(float(frame_times_s[-1] - frame_times_s[0]) / period) + 1
    lost = max(expected - seen.size, 0)
    gap_s = max(float(np.max(np.diff(seen))) - period, 0.0)
    share = lost / expected
    limit, longest = LIMITS["lost_frames_share"], LIMITS["longest_frame_gap_s"].warn
    text = f"{lost} of {expected} frames lost ({100 * share:.1f} %), longest gap {1e3 * gap_s:.1f} ms"
    if share > limit.fail:
        return "fail", f"{text} (limit {100 * limit.fail:g} %); {advice}"
    if share > limit.warn or gap_s > longest:
        return "warn", f"{text} (limits {100 * limit.warn:g} % and {1e3 * longest:g} ms); {advice}"
    return "ok", text


def check_repeated_frames(positions: Array, duplicated: Flags | None = None) -> Outcome:
    """Count exact repeats while the mark moves: a feature that is stuck, or a duplicated picture.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        Positions; NaN where the frame was lost.
    duplicated : ndarray of bool, shape (n,), optional
        Frames that are known to repeat the whole picture, which are not counted again.
    """
    doubled = np.zeros(positions.shape, dtype=bool) if duplicated is None else duplicated
    # what rests or creeps and has no noise is seen at one place for some frames
    known = doubled | rest_repeats(positions[:, np.newaxis])
    seen = np.isfinite(positions)
    if np.count_nonzero(seen) < 3:
        return "fail", f"{np.count_nonzero(seen)} positions only: track the marker again"
    present = positions[seen & ~known & ~held_ends(positions)]
    if present.size < 3:
        return "ok", "no position changes but at its ends"
    repeats, frames = _repeats_in_motion(present)
    share = repeats / max(frames, 1)
    limit = LIMITS["repeated_share"]
    text = f"{repeats} repeated positions during the motion"
    cause = "the feature is stuck" if doubled.any() else "the feature is stuck or pictures are duplicated"
    if share > limit.fail:
        return "fail", f"{text}, {100 * share:.0f} % of it (limit {100 * limit.fail:g} %): {cause}; track it again"
    if repeats:
        return "warn", f"{text}, {100 * share:.1f} % of it: {cause}; look at those frames and track it again"
    return "ok", text


def _repeats_in_motion(present: Array) -> tuple[int, int]:
    """Count repeats that lie in the motion, and the positions of runs that do.

    A run of equal positions lies in the motion if the position goes on by more than noise per frame
    of the run, once it goes on. A track that is held before or after the motion is not meant.
    """
    first = np.flatnonzero(np.concatenate([[True], np.diff(present) != 0]))
    lengths = np.diff(np.append(first, present.size))
    per_frame = np.abs(np.diff(present[first])) / lengths[:-1]
    start = present[: max(LEAST_REST, present.size // 20)]
    noise = max(robust_sigma(np.diff(start)), math.sqrt(2.0) * finite_or_zero(noise_sigma(present)))
    # an encoder repeats what it reads until it has gone on by a step
    noise = max(noise, hiding_resolution(present) or 0.0)
    moving = per_frame > MOVING_SIGMA * noise + 1e-12
    return int((lengths[:-1][moving] - 1).sum()), int(lengths[:-1][moving].sum())


def check_held_ends(positions: Array) -> Outcome:
    """Look for positions held at one value before or after the motion: padding, or a mark that left the picture.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        Positions; NaN where the frame was lost.
    """
    present = positions[np.isfinite(positions)]
    changed = np.flatnonzero(np.diff(present) != 0)
    if changed.size == 0:
        return "ok", "the position never changes"
    before, after, resting = _held(present)
    limit = LIMITS["held_frames"]
    if max(before, after) <= limit.warn:
        noise = ", it rests without noise" if resting else ""
        return "ok", f"no held end: {before} and {after} equal positions{noise}"
    travel = float(np.ptp(present))
    extreme = max(float(np.max(present)) - present[0], present[0] - float(np.min(present)))
    left = after > limit.warn and abs(present[-1] - present[0]) > (1 - AT_EDGE) * extreme and travel > 0
    bound = f"(limit {limit.warn:g})"
    if left:
        return "warn", (
            f"the last {after} positions are held at the far end of the travel {bound}: the mark left the picture or "
            "was lost; move the camera back, or mark the frames as lost, before the next shot"
        )
    which = [f"the {what} {n}" for what, n in (("first", before), ("last", after)) if n > limit.warn]
    return "warn", (
        f"{' and '.join(which)} positions are held at one value {bound}: filled by the tracking software, no rest that "
        "was seen; export the track without filling"
    )


def held_ends(positions: Array) -> Flags:
    """Return which positions are held at one value at either end, by more than `LIMITS` allows, shape (n,).

    What rests without any noise is not held.
    """
    flags = np.zeros(positions.size, dtype=bool)
    seen = np.flatnonzero(np.isfinite(positions))
    before, after, _ = _held(positions[seen])
    most = LIMITS["held_frames"].warn
    if before > most:
        flags[: seen[before - 1] + 1] = True
    if after > most:
        flags[seen[seen.size - after] :] = True
    return flags


def _held(present: Array) -> tuple[int, int, bool]:
    """Count the positions that are held before and after the motion; say whether an end rests without noise instead."""
    changed = np.flatnonzero(np.diff(present) != 0)
    if changed.size == 0:
        return 0, 0, False
    before, after = int(changed[0]) + 1, int(present.size - 1 - changed[-1])
    resting = rest_repeats(present[:, np.newaxis])
    at_rest = (before > 1 and bool(resting[1]), after > 0 and bool(resting[-1]))
    return (1 if at_rest[0] else before), (0 if at_rest[1] else after), any(at_rest)


def check_battery(times_s: Array, positions_m: Array, sigma_m: float) -> Outcome:
    """Whether the mark comes to rest where it started: in battery.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times of the frames, strictly increasing.
    positions_m : ndarray, shape (n,)
        Positions; NaN where the frame was lost.
    sigma_m
        Noise of a position.

    Returns
    -------
    verdict, detail
        Verdict and its sentence. Nothing is judged where the track ends before the mark rests, or does not begin at
        rest.
    """
    ends = _rests(times_s, positions_m, sigma_m)
    if isinstance(ends, str):
        return "ok", f"the track {ends}: the return to battery is not in it"
    apart = float(np.mean(ends[1]) - np.mean(ends[0]))
    limit = LIMITS["battery_m"]
    text = worded("comes to rest ", measured(1e3 * apart, "mm", "+.2f"), " from where it started")
    if abs(apart) <= max(limit.warn, 5 * sigma_m):
        return "ok", text
    return "warn", worded(
        text,
        " (limit ",
        measured(1e3 * limit.warn, "mm", "g"),
        "): not back in battery, or camera or mark moved; look at the mechanism "
        "and at the camera's stand before the next shot",
    )


def rest_begin(times_s: Array, positions_m: Array, sigma_m: float) -> int | None:
    """Return the first frame since which the mark rests where the track ends; None if it does not rest there.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times of the frames, strictly increasing.
    positions_m : ndarray, shape (n,)
        Positions; NaN where the frame was lost.
    sigma_m
        Noise of a position.
    """
    ends = _rests(times_s, positions_m, sigma_m)
    if isinstance(ends, str):
        return None
    off = np.abs(positions_m - np.mean(ends[1])) > REST_SIGMA * max(sigma_m, 1e-12)
    # noise alone leaves the band in one of 15000 frames, motion in several together
    together = np.convolve(off, np.ones(3), mode="same") > 1.5
    moving = np.flatnonzero(together & np.isfinite(positions_m))
    return int(moving[-1]) + 2 if moving.size and moving[-1] + 2 < positions_m.size else None


def _rests(times_s: Array, positions_m: Array, sigma_m: float) -> tuple[Array, Array] | str:
    """Positions at rest at both ends, or in words why there are none."""
    kept = np.isfinite(positions_m) & ~held_ends(positions_m)
    present, t = positions_m[kept], times_s[kept]
    if present.size < 4 * LEAST_REST or t[-1] - t[0] < 2 * REST_S:
        return "is too short"
    ends = present[t <= t[0] + START_S], present[t >= t[-1] - REST_S]
    for end, what in zip(ends, ("begins in motion", "ends in motion"), strict=True):
        half = end.size // 2
        if half < LEAST_REST // 2:
            return "has too few frames"
        step = abs(float(np.mean(end[-half:]) - np.mean(end[:half])))
        if step > 5 * max(sigma_m, 1e-12) * math.sqrt(2 / half):
            return what
    return ends
