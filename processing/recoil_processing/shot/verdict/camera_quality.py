"""The checks of a camera's frames and of its tracks, wired to a shot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.quantity import SI_UNITS
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.tracks.marker import find_marker
from recoil_acquisition.shot import ClockAlignment, QualityCheck
from recoil_processing.alignment.align import INNOVATION_LIMITS
from recoil_processing.quality.frame_checks import check_duplicated_pictures, check_frame_rate, duplicated_pictures
from recoil_processing.quality.limits import Outcome
from recoil_processing.quality.marker_checks import (
    check_distance,
    check_jumps,
    check_marker_noise,
    check_peak_locking,
    check_residual,
    marker_noise,
)
from recoil_processing.quality.track_quality import (
    check_battery,
    check_held_ends,
    check_lost_frames,
    check_repeated_frames,
    rest_begin,
)
from recoil_rigs.rig import ChannelSpec, Source

Array = NDArray[np.float64]

ONE_BODY = 0.05
"""Share of the travel by which two marks' travels may differ and still be of one body."""
LEAST_TRAVEL = 100.0
"""Times its noise that a mark must move to be compared with another."""


def check_frames(source: Source, recording: Recording) -> Iterator[QualityCheck]:
    """Check a camera's frames as a whole: its frame rate, its pictures, and marks that sit on one body.

    Yields
    ------
    QualityCheck
        By the source's name.
    """
    tracks = recording.tracks()
    if not tracks:
        return
    numbers, times_s = tracks[0].frame_numbers, tracks[0].time_base.times_s
    yield QualityCheck(source.name, "frame rate", *check_frame_rate(times_s, numbers, source.frame_rate))
    features = [track.positions for track in tracks]
    for track in tracks:
        marker = find_marker(track.positions, track.frame_numbers)
        if marker is not None:
            yield QualityCheck(source.name, "lost frames", "fail", f"{track.name}: lost frames have a marker: {marker}")
    if len(features) > 1:
        yield QualityCheck(source.name, "pictures", *check_duplicated_pictures(numbers, features))
    for first, second in combinations(tracks, 2):
        if first.positions.shape == second.positions.shape and _on_one_body(first.positions, second.positions):
            verdict, detail = check_distance(first.positions, second.positions, unit=first.unit or "px")
            yield QualityCheck(source.name, "distance", verdict, f"{first.name} and {second.name}: {detail}")


def check_track(
    channel: Channel, spec: ChannelSpec, source: Source, recording: Recording | None
) -> Iterator[tuple[str, Outcome]]:
    """Check the positions of one mark.

    Parameters
    ----------
    channel
        A displacement of a camera.
    recording
        Its recording, where it is at hand: duplicated pictures are then distinguished from a mark that is stuck.

    Yields
    ------
    check, (verdict, detail)
    """
    times_s, samples = channel.time_base.times_s, channel.measured
    unit = SI_UNITS[channel.quantity]
    yield "lost frames", check_lost_frames(times_s, samples)
    tracks = () if recording is None else recording.tracks()
    duplicated = duplicated_pictures([track.positions for track in tracks])
    known = duplicated if duplicated.size == samples.size else None
    yield "repeated frames", check_repeated_frames(samples, known)
    yield "held ends", check_held_ends(samples)
    yield "marker noise", check_marker_noise(times_s, samples, unit=unit)
    yield "jumps", check_jumps(times_s, samples, unit=unit)
    if channel.role == "recoil_displacement":
        sigma = marker_noise(samples)
        yield "battery", check_battery(times_s, samples, sigma if math.isfinite(sigma) else 0.0)
    if source.scale_mm_per_px is not None and (spec.unit in (None, "px")):
        yield "peak locking", check_peak_locking(samples / (1e-3 * source.scale_mm_per_px))


def check_fusion(channel: Channel, alignment: ClockAlignment | None) -> Iterator[tuple[str, Outcome]]:
    """Check what the accelerometer's motion leaves of a track, as its clock's alignment found it.

    Parameters
    ----------
    alignment
        Of the camera's clock.

    Yields
    ------
    check, (verdict, detail)
    """
    details = None if alignment is None or alignment.status == "failed" else alignment.details
    if channel.role != "recoil_displacement" or not details or "innovation_statistic" not in details:
        return
    figures = int(details["frames"]), int(details["frames_set_aside"]), float(details["innovation_statistic"])
    yield "residual", check_residual(*figures, INNOVATION_LIMITS)


def rest_after(channel: Channel, alignment: ClockAlignment | None) -> float | None:
    """Return since when a camera sees the mechanism at rest again after the shot.

    Parameters
    ----------
    channel
        The recoil displacement.
    alignment
        Of the camera's clock.

    Returns
    -------
    float or None
        On the reference clock; None if the track ends before, or its clock could not be aligned.
    """
    if alignment is None or alignment.status == "failed":
        return None
    samples = channel.measured
    sigma = marker_noise(samples)
    begin = rest_begin(channel.time_base.times_s, samples, sigma if math.isfinite(sigma) else 0.0)
    return None if begin is None else float(alignment.to_reference(float(channel.time_base.times_s[begin])))


def _on_one_body(first: Array, second: Array) -> bool:
    """Return whether two marks make the same large motion, so that they sit on one body."""
    moves = []
    for positions in (first, second):
        noise = [marker_noise(axis) for axis in positions.T]
        present = positions[np.isfinite(positions).all(axis=1)]
        travel = np.ptp(present, axis=0) if present.size else np.zeros(positions.shape[1])
        if not any(span > LEAST_TRAVEL * n > 0 for span, n in zip(travel, noise, strict=True)):
            return False
        moves.append(travel)
    largest = float(np.max(moves))
    return bool(np.max(np.abs(moves[0] - moves[1])) < ONE_BODY * largest)
