"""Checks of a mark's positions: noise, jumps, a rigid body's distance, peak locking, residual to the fused motion.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `quality.limits`. Sub-pixel
tracking practice and its faults: M. A. Sutton, J.-J. Orteu, H. W. Schreier, Image Correlation for Shape, Motion
and Deformation Measurements, 2009, chapter 5.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.noise import hiding_resolution, noise_sigma, robust_sigma
from recoil_processing.quality.frame_checks import SHOWN
from recoil_processing.quality.limits import LIMITS, Outcome
from recoil_processing.quality.track_quality import held_ends

BLOCK_S = 0.05
"""Time over which noise is compared."""
LEAST_BLOCK = 20
"""Frames of it."""
SUSTAINED = 5
"""Frames over which a velocity is the motion's own."""
FASTER = 1.5
"""Multiple of the motion's own largest velocity that no mass has for a single frame."""
LEAST_MOVING = 100
"""Frames in motion that show an error that repeats with the pixel."""
MOVING_PX = 0.3
"""Pixels per frame from which on a frame is in motion."""
RAYLEIGH = 15.0
"""Power of the periodic error over that of a bin of noise: by chance 3 in ten million."""
TOO_FEW = "too few to judge"


def marker_noise(positions: Array) -> float:
    """Noise of a mark by third differences; positions that were held at the ends contain none of it.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        Positions; NaN where the frame was lost.
    """
    return noise_sigma(np.where(held_ends(positions), np.nan, positions))


def check_marker_noise(times_s: Array, positions: Array, *, unit: str) -> Outcome:
    """Compare the noise of every 50 ms with that of the whole track, both by third differences.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times of the frames, strictly increasing.
    positions : ndarray, shape (n,)
        Positions; NaN where the frame was lost.
    """
    kept = np.where(held_ends(positions), np.nan, positions)
    whole = noise_sigma(kept)
    if not math.isfinite(whole):
        return "ok", f"{np.count_nonzero(np.isfinite(kept))} positions: {TOO_FEW}"
    text = worded("noise ", measured(whole, unit, ".2g"))
    resolution = hiding_resolution(kept)
    if resolution is not None:
        return "ok", worded(text, ": below the resolution of ", measured(resolution, unit, ".2g"))
    if whole == 0:
        return (
            "warn",
            worded(text, ": the track was smoothed or filled by the software; export the tracked positions themselves"),
        )
    edges = np.searchsorted(times_s, np.arange(times_s[0], times_s[-1] + BLOCK_S, BLOCK_S))
    noisiest, at_s = 0.0, times_s[0]
    for first, last in pairwise(edges):
        block = kept[first:last]
        if np.count_nonzero(np.isfinite(block)) < LEAST_BLOCK:
            continue
        sigma = noise_sigma(block)
        if sigma > noisiest:
            noisiest, at_s = sigma, times_s[first]
    ratio = noisiest / whole
    text = worded(text, f", at most {ratio:.1f} times that in {1e3 * BLOCK_S:g} ms")
    remedy = (
        f", from {at_s:.3f} s of the track: blur, smoke or poor light; shorten the exposure and light the mark better "
        "before the next shot"
    )
    return LIMITS["marker_noise"].outcome(ratio, text, remedy)


def find_jumps(times_s: Array, positions: Array) -> Flags:
    """Find frames to which the mark jumps: off its neighbours' line, and faster than the motion ever is.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times of the frames, strictly increasing.
    positions : ndarray, shape (n,)
        Positions; NaN where the frame was lost.

    Returns
    -------
    ndarray of bool, shape (n,)
        Flags of the frames after a jump.
    """
    jumps = np.zeros(positions.size, dtype=bool)
    seen = np.flatnonzero(np.isfinite(positions) & ~held_ends(positions))
    if seen.size < 4 * SUSTAINED:
        return jumps
    t, x = times_s[seen], positions[seen]
    dt, dx = np.diff(t), np.diff(x)
    v = dx / dt
    sigma = marker_noise(positions)
    sigma = sigma if math.isfinite(sigma) else noise_sigma(x)
    period = float(np.median(dt))
    windows = np.lib.stride_tricks.sliding_window_view(v, SUSTAINED)
    own = float(np.max(np.abs(np.median(windows, axis=1))))
    # what a straight line through the frame before would have left, for any spacing of the frames
    bend = np.zeros(v.size)
    bend[1:] = (v[1:] - v[:-1]) * np.minimum(dt[1:], dt[:-1])
    bend[0] = (v[0] - v[1]) * dt[0]
    limit = LIMITS["jump_sigma"].warn * math.sqrt(6.0) * sigma
    fastest = FASTER * own + LIMITS["jump_sigma"].warn * math.sqrt(2.0) * sigma / period
    found = (np.abs(bend) > limit) & (np.abs(v) > fastest)
    # a spike's way back is no second jump
    spike = np.zeros(v.size, dtype=bool)
    spike[1:] = found[1:] & found[:-1] & (np.abs(x[2:] - x[:-2]) < 0.5 * np.abs(dx[:-1]))
    jumps[seen[1:][found & ~spike]] = True
    return jumps


def check_jumps(times_s: Array, positions: Array, *, unit: str) -> Outcome:
    """Count jumps of a mark; see `find_jumps`.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times of the frames, strictly increasing.
    positions : ndarray, shape (n,)
        Positions; NaN where the frame was lost.
    """
    jumps = np.flatnonzero(find_jumps(times_s, positions))
    if jumps.size == 0:
        return "ok", "no jump"
    seen = np.flatnonzero(np.isfinite(positions))
    before = seen[np.searchsorted(seen, jumps) - 1]
    size = np.abs(positions[jumps] - positions[before])
    i = int(np.argmax(size))
    speed = size[i] / float(times_s[jumps[i]] - times_s[before[i]])
    shown = ", ".join(f"{t:.4f}" for t in times_s[jumps[:SHOWN]]) + (" ..." if jumps.size > SHOWN else "")
    return "warn", worded(
        f"{jumps.size} jumps of the mark at {shown} s of the track, the largest ",
        measured(float(size[i]), unit, ".3g"),
        " at ",
        measured(float(speed), f"{unit}/s", ".3g"),
        ", faster than the motion: the tracker took another feature; track it again with a smaller search window",
    )


def check_distance(first: Array, second: Array, *, unit: str) -> Outcome:
    """Whether two marks on one rigid body keep their distance.

    Parameters
    ----------
    first, second : ndarray, shape (n, n_axes)
        Positions in the same frames; NaN where lost.
    """
    distance = np.sqrt(np.sum((first - second) ** 2, axis=1))
    present = distance[np.isfinite(distance)]
    if present.size < LEAST_BLOCK:
        return "ok", f"{present.size} frames with both marks: {TOO_FEW}"
    sigma, middle = noise_sigma(distance), float(np.median(present))
    if not sigma > 0:
        return "ok", "both marks without noise"
    # single frames go beyond by chance; means of a block do not
    width = min(LEAST_BLOCK, present.size)
    means = np.mean(np.lib.stride_tricks.sliding_window_view(present, width), axis=1)
    largest = float(np.max(np.abs(means - middle)))
    text = worded(
        "distance ",
        measured(middle, unit, ".4g"),
        f", its mean over {width} frames at most {largest / sigma:.1f} times its noise off",
    )
    remedy = (
        ": one of the two marks slips, or turns out of the picture's plane; fix the marks, and set the camera square "
        "to the bore, before the next shot"
    )
    return LIMITS["distance_sigma"].outcome(largest / sigma, text, remedy)


def check_peak_locking(positions_px: Array) -> Outcome:
    """Whether the error of the positions repeats with the pixel: a tracker that prefers whole or half pixels.

    The error is that from the cubic through two neighbours on either side, which lie elsewhere in their pixels while
    the mark moves. A histogram of the fractions would take a mark that moves by whole pixels per frame for locked.

    Parameters
    ----------
    positions_px : ndarray, shape (n,)
        Positions; NaN where the frame was lost.
    """
    if positions_px.size < LEAST_MOVING:
        return "ok", f"{positions_px.size} frames: {TOO_FEW}"
    x = positions_px
    middle = x[2:-2]
    error = middle - (4 * (x[1:-3] + x[3:-1]) - (x[:-4] + x[4:])) / 6
    moving = np.isfinite(error) & (np.abs(x[3:-1] - x[1:-3]) >= 2 * MOVING_PX)
    count = int(np.count_nonzero(moving))
    if count < LEAST_MOVING:
        return "ok", f"{count} frames in motion: {TOO_FEW}"
    r, at = error[moving], middle[moving]
    # a jump or the onset is no error of the pixel
    r = np.clip(r, -3 * robust_sigma(r), 3 * robust_sigma(r))
    strength, often = max((2 * abs(complex(np.mean(r * np.exp(2j * np.pi * k * at)))), k) for k in (1, 2))
    text = f"error of {strength:.3f} pixels that repeats with every {'pixel' if often == 1 else 'half pixel'}"
    if count * strength**2 < 4 * RAYLEIGH * float(np.var(r)):
        return "ok", text
    remedy = ": the tracker does not interpolate; use its sub-pixel method, or a larger mark, before the next shot"
    return LIMITS["peak_locking"].outcome(strength, text, remedy)


def check_residual(frames: int, off: int, innovation: float, allowed: tuple[float, float]) -> Outcome:
    """Judge what the fusion of camera and accelerometer leaves of the track.

    Parameters
    ----------
    frames, off
        Frames that were fused; and those that lie further off than noise.
    innovation
        Mean squared normalised innovation.
    allowed
        Lowest and highest value that is allowed.
    """
    share = off / max(frames + off, 1)
    limit = LIMITS["residual_share"]
    text = (
        f"{off} of {frames + off} frames off the fused motion, innovations {innovation:.2f} of their expected variance"
    )
    if limit.verdict(share) != "ok":
        remedy = ": jumps, repeats or a mark that slips; look at the track and track it again"
        return limit.outcome(share, text, remedy, share=True)
    if not allowed[0] <= innovation <= allowed[1]:
        return "warn", (
            f"{text} (limits {allowed[0]:g} to {allowed[1]:g}): a dropped frame, a wrong frame rate, or a smoothed "
            "track; export the track as it was tracked, with its frame numbers"
        )
    return "ok", text
