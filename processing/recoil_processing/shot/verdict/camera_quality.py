"""Checks of a camera's frames and of its tracks, wired to a shot, and of the carriage's accelerometers by the camera.

The recoiling part's accelerometer feels the motion over the ground; the travel along the tipping part, which the
camera sees, is that less the carriage's. So a share of the travel comes from each of the carriage's accelerometers, and
a sensor that is turned, or read in another's place, is off by twice that share, which moves clock and scale of the
camera.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.measured import worded
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.tracks.marker import find_marker
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import ClockAlignment
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
from recoil_processing.quality.motion_checks import check_carriage
from recoil_processing.quality.track_quality import (
    check_battery,
    check_held_ends,
    check_lost_frames,
    check_repeated_frames,
    rest_begin,
)
from recoil_processing.shot.camera_motion import recorded_motion
from recoil_processing.shot.signals import at_instants
from recoil_processing.shot.verdict.motion_quality import Recoil
from recoil_rigs.rig import ChannelSpec, Source
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.rig_tables import CARRIAGE_ACCELERATIONS

ONE_BODY = 0.05
"""Share of the travel by which two marks' travels may differ and still be of one body."""
LEAST_TRAVEL = 100.0
"""Multiple of its noise that a mark must move to be compared with another."""
LARGEST_U = 0.3
"""Standard uncertainty of a part's share: from here on a turned sensor could not be distinguished from a sound one."""


def check_frames(source: Source, recording: Recording) -> Iterator[QualityCheck]:
    """Check a camera's frames as a whole: its frame rate, its pictures, and marks that sit on one body.

    Yields
    ------
    QualityCheck
        Check of the source, under its name.
    """
    tracks = recording.tracks()
    if not tracks:
        return
    numbers, times_s = tracks[0].frame_numbers, tracks[0].time_base.times_s
    yield QualityCheck(source.name, Check.FRAME_RATE, *check_frame_rate(times_s, numbers, source.frame_rate))
    features = [track.positions for track in tracks]
    for track in tracks:
        marker = find_marker(track.positions, track.frame_numbers)
        if marker is not None:
            yield QualityCheck(
                source.name, Check.LOST_FRAMES, "fail", f"{track.name}: lost frames have a marker: {marker}"
            )
    if len(features) > 1:
        yield QualityCheck(source.name, Check.PICTURES, *check_duplicated_pictures(numbers, features))
    for first, second in combinations(tracks, 2):
        if first.positions.shape == second.positions.shape and _on_one_body(first.positions, second.positions):
            verdict, detail = check_distance(first.positions, second.positions, unit=first.unit or "px")
            yield QualityCheck(
                source.name, Check.DISTANCE, verdict, worded(f"{first.name} and {second.name}: ", detail)
            )


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


def check_track(
    channel: Channel, spec: ChannelSpec, source: Source, recording: Recording | None, *, from_battery: bool = True
) -> Iterator[tuple[Check, Outcome]]:
    """Check the positions of one mark.

    Parameters
    ----------
    channel
        A displacement of a camera.
    recording
        Recording of the track, where it is at hand: duplicated pictures are then distinguished from a mark that is
        stuck; None where it is not.
    from_battery
        Whether it is of what begins in battery and comes back there.

    Yields
    ------
    check, (verdict, detail)
    """
    times_s, samples = channel.time_base.times_s, channel.measured
    unit = SI_UNITS[channel.quantity]
    yield Check.LOST_FRAMES, check_lost_frames(times_s, samples)
    tracks = () if recording is None else recording.tracks()
    duplicated = duplicated_pictures([track.positions for track in tracks])
    known = duplicated if duplicated.size == samples.size else None
    yield Check.REPEATED_FRAMES, check_repeated_frames(samples, known)
    yield Check.HELD_ENDS, check_held_ends(samples)
    yield Check.MARKER_NOISE, check_marker_noise(times_s, samples, unit=unit)
    yield Check.JUMPS, check_jumps(times_s, samples, unit=unit)
    # from the ground a carriage that moved is no mark that did
    if from_battery and source.sees != "ground":
        sigma = marker_noise(samples)
        yield Check.BATTERY, check_battery(times_s, samples, sigma if math.isfinite(sigma) else 0.0)
    if source.scale_mm_per_px is not None and (spec.unit in (None, "px")):
        yield Check.PEAK_LOCKING, check_peak_locking(samples / (1e-3 * source.scale_mm_per_px))


def check_fusion(channel: Channel, alignment: ClockAlignment | None) -> Iterator[tuple[Check, Outcome]]:
    """Check what the accelerometer's motion leaves of a track, as its clock's alignment found it.

    Parameters
    ----------
    alignment
        Alignment of the camera's clock.

    Yields
    ------
    check, (verdict, detail)
    """
    details = None if alignment is None or alignment.status == "failed" else alignment.details
    if channel.role != "recoil_displacement" or not details or "innovation_statistic" not in details:
        return
    figures = int(details["frames"]), int(details["frames_set_aside"]), float(details["innovation_statistic"])
    yield Check.RESIDUAL, check_residual(*figures, INNOVATION_LIMITS)


def rest_after(channel: Channel, alignment: ClockAlignment | None) -> float | None:
    """Return since when a camera sees the mechanism at rest again after the shot.

    Parameters
    ----------
    channel
        The recoil displacement.
    alignment
        Alignment of the camera's clock.

    Returns
    -------
    float or None
        Instant on the reference clock; None if the track ends before, or its clock could not be aligned.
    """
    if alignment is None or alignment.status == "failed":
        return None
    samples = channel.measured
    sigma = marker_noise(samples)
    begin = rest_begin(channel.time_base.times_s, samples, sigma if math.isfinite(sigma) else 0.0)
    return None if begin is None else float(alignment.to_reference(float(channel.time_base.times_s[begin])))


def check_carriage_by_camera(
    fired: FiredShot, recoil: Recoil, camera: Channel, alignment: ClockAlignment | None
) -> Iterator[QualityCheck]:
    """Check the carriage's accelerometers, as far as the camera's clock was found by the motion.

    Parameters
    ----------
    camera
        Displacement on its own clock.
    alignment
        Alignment of the camera's clock.

    Yields
    ------
    QualityCheck
        Check of the channel of each of `CARRIAGE_ACCELERATIONS` whose part the camera track identifies, where it fits
        the accelerometers.
    """
    signals, motion = recoil.signals, recoil.motion
    angle = fired.rig.mechanism.phi20 - fired.rig.mechanism.phi10 + motion.beta
    parts = dict(zip(CARRIAGE_ACCELERATIONS, (motion.f_x * np.cos(angle), motion.f_y * np.sin(angle)), strict=True))
    parts = {role: part for role, part in parts.items() if role in signals.series}
    track = recorded_motion(signals, recoil.acceleration, at_instants(camera, fired), alignment)
    if track is None or not parts:
        return
    before = signals.times_s < signals.onset_s
    shapes = np.column_stack([part - np.median(part[before]) if before.any() else part for part in parts.values()])
    whitened = track.motion.likeliest(shapes, range(len(parts)), track.densities)
    found = None if whitened is None else whitened.solve(range(len(parts)))
    if found is None or found.innovation_statistic > INNOVATION_LIMITS[1]:
        return
    for j, role in enumerate(parts):
        channel = fired.shot.by_role(role)
        if channel is None:
            continue
        u = math.hypot(math.sqrt(float(found.covariance[2 + j, 2 + j])), channel.u_rel)
        if u > LARGEST_U:
            continue
        yield QualityCheck(
            channel.name,
            Check.CARRIAGE,
            *check_carriage(float(found.shifts_m_s2[j]), u, polarity=fired.rig.channel(channel.name).polarity),
        )
