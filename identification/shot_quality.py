"""Is this shot usable? The checks of all channels and clocks of one shot, in the order of the rig."""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from daq.channel import Channel
from daq.errors import IdentificationError
from daq.quantity import SI_UNITS
from daq.readers.reader import Recording
from daq.shot import ClockAlignment, QualityCheck, Shot, Verdict
from identification.acquisition_quality import check_acquisition, check_clock_fits
from identification.onset import find_onset
from identification.signals import QUIET_MARGIN_S, static_value
from processing.quality import (
    Outcome,
    check_clipping,
    check_flat_tops,
    check_losses,
    check_lost_frames,
    check_polarity,
    check_quiet,
    check_repeated_frames,
    check_zero_shift,
)
from rigs.assemble import range_si
from rigs.rig import MotionAlignment, RedundantAlignment, Rig, TriggerAlignment

Array = NDArray[np.float64]

LEAST_SAMPLES = 8
"""Fewer are no record."""
POSITIVE_PULSES = ("recoil_acceleration", "breech_pressure", "recoil_displacement")


def check_shot(
    shot: Shot,
    rig: Rig,
    alignments: Sequence[ClockAlignment],
    recordings: Mapping[str, Recording],
    on: dt.date,
) -> tuple[QualityCheck, ...]:
    """Check all channels and clocks of a shot, and what its acquisition lost.

    Parameters
    ----------
    shot : Shot
    rig : Rig
    alignments : sequence of ClockAlignment
    recordings : mapping of str to Recording
        By source: what their readers noted becomes part of the verdict.
    on : date
        Day of the shot, for the calibrations' due dates.

    Returns
    -------
    tuple of QualityCheck
    """
    checks: list[QualityCheck] = []
    for source in rig.sources:
        wanted = [c.name for c in rig.channels_of(source.name)]
        if wanted and not any(name in shot.channels for name in wanted):
            detail = f"no file of source {source.name} was given: {', '.join(wanted)} missing; add its file"
            checks.append(QualityCheck(source.name, "file", "fail", detail))
        if source.name in recordings:
            checks += _file_checks(source.name, recordings[source.name])
    checks += _file_names(recordings)
    essential = {c.source for c in rig.channels if c.role}
    checks += check_acquisition(shot.acquisition, recordings, essential)
    checks += check_clock_fits(shot.clock_fits)
    by_clock = {a.clock: a for a in alignments}
    onset = _onset(shot, checks)
    for channel in shot.channels.values():
        for name, (verdict, detail) in _channel_checks(channel, shot, rig, by_clock, onset):
            checks.append(QualityCheck(channel.name, name, verdict, detail))
    for alignment in alignments:
        checks.append(_alignment_check(alignment))
        checks += _zero_shift(alignment, shot, onset)
    for fault in rig.overdue(on):
        name = fault.key.removeprefix("channel '").removesuffix("'.sensor.due")
        checks.append(QualityCheck(name, "calibration", "warn", fault.problem))
    return tuple(checks)


def _file_checks(source: str, recording: Recording) -> list[QualityCheck]:
    """Whether a file was cut off, and what its reader noted."""
    checks = [QualityCheck(source, "reader", "ok", note) for note in recording.notes]
    if recording.incomplete:
        checks.insert(0, QualityCheck(source, "file", "warn", f"was cut off: {recording.incomplete}"))
    return checks


def _file_names(recordings: Mapping[str, Recording]) -> list[QualityCheck]:
    """Whether files that carry a number of one and the same width carry the same number."""
    numbers = {source: re.findall(r"\d{3,}", r.path.stem) for source, r in recordings.items()}
    numbered = {source: found[0] for source, found in numbers.items() if len(found) == 1}
    if len(set(numbered.values())) > 1 and len({len(number) for number in numbered.values()}) == 1:
        shown = ", ".join(f"{source} {recordings[source].path.name}" for source in numbered)
        return [
            QualityCheck("shot", "file names", "warn", f"the files' numbers differ ({shown}): are they of one shot?")
        ]
    return []


def _onset(shot: Shot, checks: list[QualityCheck]) -> float | None:
    """Onset of force on the reference clock; a shot without one fails."""
    series = {
        role: np.asarray(c.samples, dtype=np.float64)
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
        checks.append(QualityCheck("shot", "onset", "fail", str(error)))
        return None


def _channel_checks(
    channel: Channel, shot: Shot, rig: Rig, by_clock: Mapping[str, ClockAlignment], onset: float | None
) -> Iterator[tuple[str, Outcome]]:
    spec = rig.channel(channel.name)
    samples = np.asarray(channel.samples, dtype=np.float64)
    times = channel.time_base.times_s
    unit = SI_UNITS[channel.quantity]
    present = samples[np.isfinite(samples)]
    if present.size < LEAST_SAMPLES:
        found = f"only {present.size} samples" if present.size else "no sample at all"
        yield "losses", ("fail", f"{found}: check the sensor and its signal's name")
        return
    if np.ptp(present) == 0:
        # what nothing is made of may stand still: a temperature, a mark on the tipping part
        verdict: Verdict = "fail" if channel.role or channel.name in _aligning(rig) else "warn"
        yield "constant", (verdict, f"always {present[0]:.4g} {unit}: sensor not connected, or the wrong signal")
        return
    if rig.source(channel.time_base.clock).kind == "camera":
        yield "lost frames", check_lost_frames(times, samples)
        yield "repeated frames", check_repeated_frames(samples)
    else:
        yield "losses", check_losses(samples, channel.time_base.rate_hz)
    limits = range_si(spec)
    if limits is not None:
        yield "range", check_clipping(samples, *limits, unit=unit)
    elif rig.source(channel.time_base.clock).kind != "camera":
        yield "range", check_flat_tops(samples)
    alignment = by_clock.get(channel.time_base.clock)
    reference = times if alignment is None else alignment.to_reference(times)
    aligned = channel.time_base.clock == shot.reference_clock or (
        alignment is not None and alignment.status != "failed"
    )
    if onset is None or not aligned:
        return
    quiet = reference < onset - QUIET_MARGIN_S
    if channel.role and channel.quantity != "displacement":
        static = None if spec.sensor.time_constant_s else static_value(channel.role, rig.mechanism)
        yield "silence", check_quiet(samples, quiet, static, unit=unit)
    if channel.role in POSITIVE_PULSES:
        yield "polarity", check_polarity(samples, quiet)


def _aligning(rig: Rig) -> set[str]:
    """Names of the channels that clocks are aligned by."""
    names = set()
    for source in rig.sources:
        if isinstance(source.align, RedundantAlignment | TriggerAlignment):
            names.add(source.align.channel)
        if isinstance(source.align, RedundantAlignment | MotionAlignment):
            names.add(source.align.against)
    return names


def _alignment_check(a: ClockAlignment) -> QualityCheck:
    if a.status == "failed":
        return QualityCheck(a.clock, "alignment", "fail", f"by {a.method}: {'; '.join(a.reasons)}")
    offset = f"offset {1e3 * a.offset_s:+.4f} ms, u {1e6 * a.u_offset_s:.1f} us"
    text = f"{offset}, drift {1e6 * a.drift:+.1f} ppm, by {a.method}"
    if a.status == "ambiguous":
        return QualityCheck(a.clock, "alignment", "warn", f"{text}; ambiguous: {'; '.join(a.reasons)}")
    return QualityCheck(a.clock, "alignment", "ok", text)


def _zero_shift(alignment: ClockAlignment, shot: Shot, onset: float | None) -> list[QualityCheck]:
    """Compare the accelerometer's zero during the shot, as the camera tells it, with the one before the shot."""
    details = alignment.details or {}
    accelerometer = shot.by_role("recoil_acceleration")
    if alignment.status == "failed" or "u_bias_m_s2" not in details or accelerometer is None or onset is None:
        return []
    samples = np.asarray(accelerometer.samples, dtype=np.float64)
    quiet = samples[(accelerometer.time_base.times_s < onset - QUIET_MARGIN_S) & np.isfinite(samples)]
    if quiet.size < LEAST_SAMPLES:
        return []
    # the fit's constant is what the accelerometer lacks; the silence fixes the zero as well as its noise allows
    bias = -float(details["integration_constants"][2])
    u = math.hypot(float(details["u_bias_m_s2"]), float(np.std(quiet)) / math.sqrt(quiet.size))
    verdict, detail = check_zero_shift(bias, u, float(np.nanmax(np.abs(samples))), unit=SI_UNITS["acceleration"])
    return [QualityCheck(accelerometer.name, "zero shift", verdict, detail)]
