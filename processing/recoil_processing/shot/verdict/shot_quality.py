"""Is this shot usable? The checks of all channels and clocks of one shot, in the order of the rig."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.files.shot_name import numbers_of
from recoil_acquisition.measured import joined, worded
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.remark import Caution, CautionCode
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_processing.alignment.absolute_alignment import METHOD, WARNED
from recoil_processing.quality.level_checks import check_zero_shift
from recoil_processing.quality.limits import Outcome
from recoil_processing.quality.loss_checks import GAP_STEPS
from recoil_processing.shot.onset import find_onset
from recoil_processing.shot.signals import BASELINE_MARGIN_S, collect_signals
from recoil_processing.shot.thinned import thinned
from recoil_processing.shot.verdict.acquisition_quality import check_acquisition, check_clock_fits
from recoil_processing.shot.verdict.camera_quality import (
    check_carriage_by_camera,
    check_frames,
    check_fusion,
    check_track,
    rest_after,
)
from recoil_processing.shot.verdict.channel_quality import LEAST_SAMPLES, check_channel
from recoil_processing.shot.verdict.consequence import weighed
from recoil_processing.shot.verdict.motion_quality import Recoil, check_camera_velocity, check_motion, recoil_of
from recoil_processing.shot.verdict.sensor_quality import check_sensors
from recoil_rigs.rig import Rig, Source
from recoil_rigs.shots.assemble import about_unknown_unit, unknown_unit
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.calibration_day import CalibrationDay

NO_REST = (
    "the record begins in motion: the zero of an accelerometer is known as its `u_zero_rel` says, to 1 % of its range "
    "if left out; its noise is what the mass and the forces leave of it"
)
NONE_LEFT_OUT: Mapping[str, str] = MappingProxyType({})
SHOWS_MOTION = 0.05
"""Share of a channel's peak, of an accelerometer's velocity, from which on it shows a motion."""
UNCHECKED = (
    "no accelerometer on the recoiling part: the camera's scale and velocity, and the forces' sign, impulse and skew, "
    "cannot be checked by it; the residual of camera track and forces is what there is"
)


def check_shot(
    fired: FiredShot,
    alignments: Sequence[ClockAlignment],
    recordings: Mapping[str, Recording],
    day: CalibrationDay,
    without: Mapping[str, str] = NONE_LEFT_OUT,
    replaced: Collection[str] = (),
) -> tuple[QualityCheck, ...]:
    """Check all channels and clocks of a shot, and what its acquisition lost.

    Parameters
    ----------
    recordings
        Recordings by source: what their readers noted becomes part of the verdict.
    day
        Day that the calibrations must cover.
    without
        Sources that somebody left out, each with the name of its file, empty if none was given.
    replaced
        Sources whose instrument's own file took the place of what was read live.

    Returns
    -------
    tuple of QualityCheck
    """
    fired = FiredShot(replace(fired.shot, alignments=tuple(alignments)), fired.rig)
    checks: list[QualityCheck] = []
    for source in fired.rig.sources:
        wanted = [c.name for c in fired.rig.channels_of(source.name)]
        if wanted and not any(name in fired.shot.channels for name in wanted):
            absent = _absent(source, wanted, fired.shot, without)
            checks.append(QualityCheck(source.name, Check.FILE, "fail", absent))
        if source.name in recordings:
            checks += _file_checks(source.name, recordings[source.name])
            if source.kind == "camera":
                checks += check_frames(source, recordings[source.name])
    checks += _unknown_units(fired.rig, recordings)
    checks += _file_names(recordings)
    essential = {c.source for c in fired.rig.channels if c.role}
    checks += [
        check
        for check in check_acquisition(fired.shot.acquisition, recordings, essential, replaced)
        if check.channel not in without
    ]
    checks += check_clock_fits(fired.shot.clock_fits)
    by_clock = {a.clock: a for a in alignments}
    # of a motion, and of what the mass hangs on, the thinned channels tell the same
    lean, _ = thinned(fired)
    # what may move from the first on has a motion without an onset, too
    once = fired.rig.mechanism.recoils_once
    onset = _onset(fired.shot, checks) if once else _rest_s(fired, by_clock, checks)
    shifts = [check for alignment in alignments for check in _zero_shift(alignment, fired.shot, onset)]
    recoil = None if once and onset is None else recoil_of(lean, by_clock)
    checks += _channels(fired, by_clock, recordings, onset, recoil, zero_by_camera=bool(shifts))
    checks += [alignment_check(alignment) for alignment in alignments]
    checks = _with_gaps_named(checks, fired, alignments)
    checks += shifts
    checks += check_sensors(fired, alignments)
    checks += calibration_checks(fired.rig, day)
    return tuple(weighed(checks, lean, recoil))


def calibration_checks(rig: Rig, day: CalibrationDay) -> list[QualityCheck]:
    """Name the calibrations that do not cover the day of a shot."""
    faults = rig.not_calibrated(day)
    return [QualityCheck(str(fault.subject), Check.CALIBRATION, "warn", fault.problem) for fault in faults]


def _absent(source: Source, wanted: Sequence[str], shot: Shot, without: Mapping[str, str]) -> str:
    """Say why a shot has no channel of a source."""
    name, missing = source.name, f"{', '.join(wanted)} missing"
    if name in without:
        file = f" and its file {without[name]}" if without[name] else ""
        return f"source {name}{file} left out, as asked: {missing}; add its file to have it"
    acquired = () if shot.acquisition is None else shot.acquisition.sources
    if any(one.name == name and one.blocks for one in acquired):
        return (
            f"all that source {name} delivered was taken outside the shot's window: {missing}; "
            "find what keeps the host from reading it, before the next shot"
        )
    if not source.required:
        return f"nothing of source {name}, which may stay away: {missing}; add its file to have it"
    return f"no file of source {name} was given: {missing}; add its file"


def _channels(
    fired: FiredShot,
    by_clock: Mapping[str, ClockAlignment],
    recordings: Mapping[str, Recording],
    onset: float | None,
    recoil: Recoil | None,
    *,
    zero_by_camera: bool,
) -> list[QualityCheck]:
    """Check every channel by itself, and then those of one motion against one another."""
    mechanism = fired.rig.mechanism
    camera = fired.shot.by_role("recoil_displacement")
    rest_s = None
    if camera is not None and camera.role in mechanism.positive_pulses:
        rest_s = rest_after(camera, by_clock.get(camera.time_base.clock))
    breech = fired.shot.by_role("breech_pressure")
    driven = None
    if breech is not None and np.isfinite(breech.samples).any():
        driven = mechanism.force_areas[0] * float(np.nanmax(breech.samples)) / mechanism.m3
    checks = []
    for channel in fired.shot.channels.values():
        clock = channel.time_base.clock
        alignment = by_clock.get(clock)
        found = list(
            check_channel(
                channel,
                fired.rig,
                reference_s=_reference_times(channel, fired.shot, alignment),
                onset_s=onset,
                rest_s=rest_s,
                driven_m_s2=driven,
                counted=clock in recordings and "missing_frames" in recordings[clock].metadata,
            )
        )
        source = fired.rig.source(clock)
        if source.kind == "camera" and not {check for check, _ in found} & {Check.CONSTANT, Check.LOSSES}:
            spec, recording = fired.rig.channel(channel.name), recordings.get(clock)
            from_battery = channel.role in mechanism.positive_pulses
            found += check_track(channel, spec, source, recording, from_battery=from_battery)
            found += check_fusion(channel, alignment)
            found += _against_camera(channel, fired.rig, alignment, recoil)
        checks += [QualityCheck(channel.name, check, verdict, detail) for check, (verdict, detail) in found]
    if camera is not None and mechanism.needs_carriage(camera.role):
        if recoil is not None and not fired.rig.camera_on_ground and not recoil.turned:
            checks += check_carriage_by_camera(fired, recoil, camera, by_clock.get(camera.time_base.clock))
        if fired.shot.by_role("recoil_acceleration") is None:
            checks.append(QualityCheck(camera.name, Check.SECOND_SENSOR, "warn", UNCHECKED))
    if recoil is not None:
        checks += check_motion(fired, recoil, rest_s, zero_by_camera=zero_by_camera)
    return checks


def _file_checks(source: str, recording: Recording) -> list[QualityCheck]:
    """Whether a file was cut off, and what its reader noted."""
    checks = [
        QualityCheck(source, _check_of(note), "warn" if isinstance(note, Caution) else "ok", worded(note))
        for note in recording.notes
    ]
    if recording.incomplete:
        checks.insert(0, QualityCheck(source, Check.FILE, "warn", f"was cut off: {recording.incomplete}"))
    return checks


def _check_of(note: str) -> Check:
    late = isinstance(note, Caution) and note.code is CautionCode.LATE_STAMPS
    return Check.LATE_STAMPS if late else Check.READER


def _unknown_units(rig: Rig, recordings: Mapping[str, Recording]) -> list[QualityCheck]:
    """Whether files state units that are none, so that those of the rig count."""
    return [
        QualityCheck(spec.name, Check.READER, "warn", about_unknown_unit(spec, header, recordings[spec.source].path))
        for spec in rig.channels
        if spec.source in recordings
        for header in recordings[spec.source].signals
        if header.name == spec.signal and unknown_unit(spec, header)
    ]


def _file_names(recordings: Mapping[str, Recording]) -> list[QualityCheck]:
    """Whether files that carry one number each carry the same."""
    numbers = {source: numbers_of(r.path) for source, r in recordings.items()}
    numbered = {source: found for source, found in numbers.items() if len(found) == 1}
    if len(set(numbered.values())) > 1:
        shown = ", ".join(f"{source} {recordings[source].path.name}" for source in numbered)
        return [
            QualityCheck(
                "shot", Check.FILE_NAMES, "warn", f"the files' numbers differ ({shown}): are they of one shot?"
            )
        ]
    return []


def _onset(shot: Shot, checks: list[QualityCheck]) -> float | None:
    """Onset of force on the reference clock; a shot without one fails."""
    series = {
        role: c.measured
        for role in ("breech_pressure", "recoil_acceleration")
        if (c := shot.by_role(role)) is not None and c.time_base.clock == shot.reference_clock
    }
    if not series:
        return None
    carrier = shot.by_role(next(iter(series)))
    if carrier is None:
        return None
    try:
        return find_onset(carrier.time_base.times_s, series)
    except IdentificationError as error:
        checks.append(QualityCheck("shot", Check.ONSET, "fail", str(error)))
        return None


def _rest_s(fired: FiredShot, alignments: Mapping[str, ClockAlignment], checks: list[QualityCheck]) -> float | None:
    """Return the end of the rest that a record begins with; None without any."""
    try:
        signals = collect_signals(fired, alignments)
    except IdentificationError as error:
        checks.append(QualityCheck("shot", Check.ONSET, "fail", str(error)))
        return None
    if signals.baseline_s[1] > signals.baseline_s[0]:
        return signals.onset_s
    checks.append(QualityCheck("shot", Check.BASELINE, "ok", NO_REST))
    return None


def _reference_times(channel: Channel, shot: Shot, alignment: ClockAlignment | None) -> Array | None:
    """Instants of a channel on the reference clock; None if its clock could not be aligned."""
    if channel.time_base.clock == shot.reference_clock:
        return channel.time_base.times_s
    if alignment is None or alignment.status == "failed":
        return None
    return alignment.to_reference(channel.time_base.times_s)


def _against_camera(
    channel: Channel, rig: Rig, alignment: ClockAlignment | None, recoil: Recoil | None
) -> list[tuple[Check, Outcome]]:
    """Compare the accelerometer's velocity with the camera's."""
    if recoil is None or recoil.turned or alignment is None or alignment.status == "failed":
        return []
    if not rig.mechanism.needs_carriage(channel.role):
        return []
    seen_s = channel.time_base.times_s - rig.channel(channel.name).sensor.delay_s
    positions = channel.measured
    outcome = check_camera_velocity(recoil, alignment.to_reference(seen_s), positions)
    return [] if outcome is None else [(Check.VELOCITY, outcome)]


def alignment_check(a: ClockAlignment) -> QualityCheck:
    """Judge a clock's alignment, and say by what it is, and what a second opinion on it gives."""
    if a.status == "failed":
        return QualityCheck(a.clock, Check.ALIGNMENT, "fail", worded(f"by {a.method}: ", joined("; ", a.reasons)))
    offset = f"offset {1e3 * a.offset_s:+.4f} ms, u {1e6 * a.u_offset_s:.1f} us"
    text = f"{offset}, drift {1e6 * a.drift:+.1f} ppm, by {a.method}"
    if a.status == "ambiguous":
        return QualityCheck(a.clock, Check.ALIGNMENT, "warn", worded(f"{text}; ambiguous: ", joined("; ", a.reasons)))
    details = a.details or {}
    if a.method == METHOD:
        own, other = (details[METHOD][side]["lock"] for side in ("source", "reference"))
        text += f", locked to {own}, the reference to {other}"
    if WARNED in details:
        return QualityCheck(a.clock, Check.ALIGNMENT, "warn", f"{text}; {details[WARNED]}")
    if "second_apart_s" in details:
        apart, u = (1e6 * float(details[key]) for key in ("second_apart_s", "u_second_s"))
        text += f"; {details['second_method']} gives {apart:+.1f} us from it, u {u:.1f} us"
    return QualityCheck(a.clock, Check.ALIGNMENT, "ok", text)


def _with_gaps_named(
    checks: Sequence[QualityCheck], fired: FiredShot, alignments: Sequence[ClockAlignment]
) -> list[QualityCheck]:
    """Name what is missing of the reference clock in the motion by which a clock is aligned that is in doubt."""
    doubtful = {a.clock for a in alignments if a.status != "ok"}
    clocks: dict[str, list[str]] = {}
    for source in fired.rig.sources:
        against = fired.shot.channels.get(getattr(source.align, "against", None) or "")
        if source.name in doubtful and against is not None and _gap_in_motion(against):
            clocks.setdefault(against.name, []).append(source.name)
    return [
        replace(
            check,
            check=Check.REFERENCE_GAP,
            detail=worded(check.detail, f"; it is the motion by which {', '.join(clocks[check.channel])} is aligned"),
        )
        if check.channel in clocks and check.check in (Check.TIME_STEPS, Check.LOSSES) and check.verdict != "ok"
        else check
        for check in checks
    ]


def _gap_in_motion(channel: Channel) -> bool:
    """Return whether several samples in a row are missing between the first and the last that shows a motion."""
    there = np.isfinite(channel.measured)
    times, samples = channel.time_base.times_s[there], channel.measured[there]
    if samples.size < LEAST_SAMPLES:
        return False
    moves, steps = samples - np.median(samples[: samples.size // 10 + 1]), np.diff(times)
    if channel.quantity == "acceleration":  # small where the part coasts
        moves = np.cumsum(moves[1:] * steps)
    first, *_, last = np.flatnonzero(np.abs(moves) >= SHOWS_MOTION * np.abs(moves).max())
    return bool(np.any(steps[first : last + 1] > GAP_STEPS * np.median(steps)))


def _zero_shift(alignment: ClockAlignment, shot: Shot, onset: float | None) -> list[QualityCheck]:
    """Compare the accelerometer's zero during the shot, as the camera shows it, with the one before the shot."""
    details = alignment.details or {}
    accelerometer = shot.by_role("recoil_acceleration")
    if alignment.status == "failed" or "u_bias_m_s2" not in details or accelerometer is None or onset is None:
        return []
    samples = accelerometer.measured
    baseline = samples[(accelerometer.time_base.times_s < onset - BASELINE_MARGIN_S) & np.isfinite(samples)]
    if baseline.size < LEAST_SAMPLES:
        return []
    # the fit's constant is what the accelerometer lacks; the baseline fixes the zero as well as its noise allows
    bias = -float(details["integration_constants"][2]) + float(details.get("shifted_zero_m_s2", 0.0))
    u = math.hypot(float(details["u_bias_m_s2"]), float(np.std(baseline)) / math.sqrt(baseline.size))
    verdict, detail = check_zero_shift(bias, u, float(np.nanmax(np.abs(samples))), unit=SI_UNITS["acceleration"])
    return [QualityCheck(accelerometer.name, Check.ZERO_SHIFT, verdict, detail)]
