"""Resistance and motion of a shot with their uncertainties: its breech force follows, without the breech gauge.

The breech pressure is left out even where there is one, also where only the onset hangs on it, so that the
force by the motion owes nothing to the gauge that it is compared with.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.remark import Note, NoteCode
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_identification.rows.causes import Cause, moving_zero, u_delay_s
from recoil_identification.rows.late_readings import ROLE as BREECH
from recoil_identification.rows.late_readings import settled_by_late_readings
from recoil_identification.rows.unread_resistance import unread_causes
from recoil_identification.shot.stress_waves import U_ONSET_SAMPLES
from recoil_identification.targets.forces.measured_force import U_FREE_CLOCK_S, MeasuredForce, TrackedTravel
from recoil_processing.double_integral import integrate
from recoil_processing.filters import LowPass
from recoil_processing.gaps import bridge
from recoil_processing.noise import noise_sigma
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.gauge_zero import MOVES_S, moving_zero_pa, zero_moves
from recoil_processing.shot.kinematics import (
    angular_motion,
    inertial_acceleration,
    seen_acceleration,
    travel_acceleration,
)
from recoil_processing.shot.onset import find_onset
from recoil_processing.shot.projectile import breech_force_on_body_n
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.release import end_of_travel
from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_processing.shot.signals import Signals, at_instants, collect_signals
from recoil_processing.stress_waves.ringing import Mode
from recoil_processing.stress_waves.stress_wave import strip_stress_waves
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot

REST_S = 4e-3
"""Length of the record before the onset that is taken along."""
SMALL_SHARE = 0.01
"""Share of the peak below which the force is over."""
WINDOW_FACTOR = 2.0
"""Factor on the time until the force is over: as long as that the force is estimated."""
SHIFT_SHARE = 0.005
"""Share of the peak acceleration: what a zero may have shifted by at the shot where a camera can tell."""
GUESS_CUTOFF_HZ = 300.0
"""Cut-off of the low-pass where the spectra tell none."""
RESISTANCE = (("brake_pressure", "brake_area"), ("recuperator_pressure", "recuperator_area"))
"""Gauges of the resistance and the areas they act on."""


@dataclass(frozen=True, eq=False)
class ForceRecord(ReadOnlyArrays):
    """Input of the estimators of the breech force.

    Attributes
    ----------
    measured
        Measured force on the recorder's grid, from shortly before the onset to the end of the window.
    modes
        Modes that ring on the accelerometer.
    low_pass
        Low-pass that parts motion and stress waves.
    onset_s
        First instant of motion by the accelerometer: the release.
    held_n
        Force of the battery stop at rest, beyond which the breech force moves the part.
    parts_n : mapping of str to ndarray, shape (n,)
        Parts of the resistance: ``brake``, ``recuperator``, ``friction``.
    systematic_n : mapping of str to ndarray, shape (n,)
        Error of the force by cause, if the cause is off by its standard uncertainty.
    gauge_n : ndarray, shape (n,), or None
        Breech gauge times bore area without its zero as it reads once the bore is empty, lost samples NaN; used for
        comparison only.
    u_gauge
        Relative standard uncertainty of its scale, the area's and the bore's friction included.
    gauge_zero_n : mapping of str to ndarray, shape (n,)
        Error of its force by what is left of its zero, by parts that are independent.
    """

    measured: MeasuredForce
    tracked: TrackedTravel | None
    modes: tuple[Mode, ...]
    low_pass: LowPass
    onset_s: float
    held_n: float
    parts_n: Mapping[str, Array]
    systematic_n: Mapping[str, Array]
    gauge_n: Array | None
    u_gauge: float
    gauge_zero_n: Mapping[str, Array]
    notes: tuple[Note, ...]


def force_record(fired: FiredShot) -> ForceRecord:
    """Collect what a shot tells of its breech force without the breech gauge.

    Parameters
    ----------
    fired
        Shot with its alignments, and its rig.

    Raises
    ------
    IdentificationError
        If the accelerometer or a gauge of the resistance is missing or on a clock that could not be aligned, the
        accelerometer is not on the reference clock, or shows no shot.
    """
    gauge = fired.shot.by_role("breech_pressure")
    blind = fired.shot if gauge is None else replace(fired.shot, channels=_without(fired.shot, gauge.name))
    alignments = {a.clock: a for a in fired.shot.alignments}
    signals = collect_signals(FiredShot(blind, fired.rig), alignments)
    wanted = ("recoil_acceleration", *(role for role, _ in RESISTANCE))
    missing = [r for r in wanted if r not in signals.series or not np.isfinite(signals.series[r]).any()]
    if missing:
        raise IdentificationError(
            f"breech force by the motion: no usable channel of role {', '.join(missing)}",
            expected=", ".join(wanted),
            remedy="declare the roles in the rig file, or mend the alignment",
        )
    m, times = fired.rig.mechanism, signals.times_s
    motion = angular_motion(signals, fired.rig)
    inertial = inertial_acceleration(signals, fired.rig, motion)
    seen = seen_acceleration(signals, fired.rig, motion)
    onset = find_onset(times, {"recoil_acceleration": signals.series["recoil_acceleration"]})
    waves = strip_stress_waves(
        inertial, signals.rate_hz, onset_s=onset - signals.start_s, u_onset_s=U_ONSET_SAMPLES * signals.step_s
    )
    low_pass = waves.choice.low_pass or LowPass(min(GUESS_CUTOFF_HZ, 0.1 * signals.rate_hz))
    whole = bridge(inertial)
    smooth = low_pass.apply(whole, signals.rate_hz)
    read_of = 1.0 + m.unread_share
    gauges = {role: bridge(signals.series[role]) * getattr(m, area) * read_of for role, area in RESISTANCE}
    moving = times >= onset
    travelling = moving * bridge(travel_acceleration(signals, fired.rig, motion))
    speed = integrate(travelling, signals.step_s)
    parts = {
        "brake": gauges["brake_pressure"],
        "recuperator": gauges["recuperator_pressure"],
        "friction": np.where(moving, m.friction, 0.0) + m.slide_friction * speed,
    }
    resistance = parts["brake"] + parts["recuperator"] + parts["friction"]
    force = fired.rig.specification.mass_kg * inertial + resistance
    window = _window(times, low_pass.apply(bridge(force), signals.rate_hz), onset)
    silent = (times >= signals.baseline_s[0]) & (times < signals.baseline_s[1]) & np.isfinite(force)
    held = float(np.median(force[silent])) if silent.any() else float(np.median(bridge(force)[times < onset][-10:]))
    noise = float(np.std(force[silent])) if silent.sum() >= 50 else noise_sigma(force)
    spec = fired.rig.by_role("recoil_acceleration")
    tracked, shift = _tracked(FiredShot(blind, fired.rig), alignments), signals.offsets["recoil_acceleration"].u
    notes = []
    if tracked is not None:
        # the camera tells it anew, together with a shift at the shot
        shift = max(shift if math.isfinite(shift) else 0.0, SHIFT_SHARE * float(np.max(np.abs(smooth))))
    else:
        text = "no camera that was aligned: a zero of the accelerometer that shifted at the shot is not seen"
        notes.append(Note(NoteCode.UNCHECKED, "recoil_displacement", text))
        if not math.isfinite(shift):
            shift = SHIFT_SHARE * float(np.max(np.abs(smooth)))
    measured = MeasuredForce(
        start_s=float(times[window.start]),
        step_s=signals.step_s,
        force_n=force[window],
        resistance_n=resistance[window],
        acceleration_m_s2=smooth[window],
        carried_m_s2=(whole - seen)[window],
        mass_kg=fired.rig.specification.mass_kg,
        noise_n=max(noise, 1e-9 * float(np.max(np.abs(force[np.isfinite(force)])))),
        u_gain=spec.sensor.u_scale_rel if spec is not None else 0.0,
        u_zero_m_s2=shift,
    )
    by_gauge = None
    gauge_zero_n: dict[str, Array] = {}
    if gauge is not None:
        with_gauge = collect_signals(fired, alignments)
        if "breech_pressure" in with_gauge.series:
            grid = with_gauge.times_s
            driving = breech_force_on_body_n(with_gauge.series["breech_pressure"], with_gauge.step_s, m)
            zeros, lacking_n = settled_by_late_readings(
                _zeros_of_breech(with_gauge, fired.rig, onset), with_gauge, (onset, float(grid[-1]))
            )
            by_gauge = np.interp(times[window], grid, driving + lacking_n[:, 0])
            gauge_zero_n = {one.source: np.interp(times[window], grid, one.u * one.forces_n[:, 0]) for one in zeros}
    return ForceRecord(
        measured=measured,
        tracked=tracked,
        modes=waves.modes,
        low_pass=low_pass,
        onset_s=onset,
        held_n=held,
        parts_n={name: part[window] for name, part in parts.items()},
        systematic_n=_systematic(signals, fired, gauges, parts["friction"], travelling, smooth, onset, window),
        gauge_n=by_gauge,
        u_gauge=0.0 if gauge is None else scale_uncertainty(fired.rig).gauges[0],
        gauge_zero_n=gauge_zero_n,
        notes=tuple(notes),
    )


def _zeros_of_breech(signals: Signals, rig: Rig, onset_s: float) -> tuple[Cause, ...]:
    """List how the breech gauge's zero may be off, and may move at the shot, on the grid of the signals."""
    spec, offset = rig.with_role(BREECH)[0], signals.offsets[BREECH]
    area, unmoved = rig.mechanism.force_areas[0], np.zeros(signals.times_s.size)
    u_pa = moving_zero_pa(spec, signals.series[BREECH])
    shapes = zero_moves(signals.times_s, onset_s).T if u_pa > 0 else ()
    found = [
        Cause(moving_zero(BREECH, tau_s), "Pa", u_pa, "B", -area * shape[:, np.newaxis], unmoved)
        for tau_s, shape in zip(MOVES_S, shapes, strict=False)
    ]
    if math.isfinite(offset.u) and offset.u > 0:
        whole = np.full((unmoved.size, 1), -area)
        found.append(Cause(ErrorSource(SourceKind.ZERO, BREECH), "Pa", offset.u, "A", whole, unmoved))
    return tuple(found)


def _without(shot: Shot, name: str) -> dict[str, Channel]:
    return {n: c for n, c in shot.channels.items() if n != name}


def _window(times_s: Array, smooth_n: Array, onset_s: float) -> slice:
    """From rest to some time after the force is over, within the record."""
    behind = times_s >= onset_s
    large = np.flatnonzero(behind & (smooth_n > SMALL_SHARE * float(smooth_n[behind].max())))
    # what the resistance's errors leave may exceed the share for good: half a second is longer than any pulse
    over_s = float(times_s[large[-1]])
    falling = np.flatnonzero(behind & (smooth_n < SMALL_SHARE * float(smooth_n[behind].max())))
    after_peak = falling[falling > int(np.argmax(np.where(behind, smooth_n, -np.inf)))]
    if after_peak.size:
        over_s = float(times_s[after_peak[0]])
    end_s = onset_s + WINDOW_FACTOR * (over_s - onset_s)
    first = int(np.searchsorted(times_s, onset_s - REST_S))
    return slice(first, min(int(np.searchsorted(times_s, end_s)) + 1, times_s.size))


def _tracked(fired: FiredShot, alignments: Mapping[str, ClockAlignment]) -> TrackedTravel | None:
    camera = fired.shot.by_role("recoil_displacement")
    if camera is None:
        return None
    camera = at_instants(camera, fired)
    alignment = alignments.get(camera.time_base.clock)
    reference = camera.time_base.clock == fired.shot.reference_clock
    if not reference and (alignment is None or alignment.status == "failed"):
        return None
    times = camera.time_base.times_s if alignment is None else alignment.to_reference(camera.time_base.times_s)
    details = {} if alignment is None else alignment.details or {}
    positions = camera.measured
    there = np.isfinite(positions)
    sigma = float(details.get("marker_sigma_m", noise_sigma(positions)))
    if there.sum() < 10 or not sigma > 0:
        return None
    by_motion = "u_bias_m_s2" in details
    u_clock = 0.0 if alignment is None else U_FREE_CLOCK_S if by_motion else alignment.u_offset_s
    return TrackedTravel(times[there], positions[there], sigma, camera.u_rel, u_clock)


def _systematic(
    signals: Signals,
    fired: FiredShot,
    gauges: Mapping[str, Array],
    friction: Array,
    travelling: Array,
    smooth: Array,
    onset_s: float,
    window: slice,
) -> dict[str, Array]:
    """Return what each cause that the motion cannot tell adds to the force, shape (n,) each."""
    m, specification = fired.rig.mechanism, fired.rig.specification
    free = (signals.times_s >= onset_s).astype(np.float64)
    static = m.at_rest.get("recoil_acceleration", 0.0)
    causes: dict[str, Array] = {"mass of the recoiling part": specification.u_kg * (smooth - static)}
    for role, area in RESISTANCE:
        spec, force = fired.rig.by_role(role), gauges[role]
        u_rel = math.hypot(spec.sensor.u_scale_rel if spec else 0.0, m.u.get(area, 0.0) / getattr(m, area))
        causes[f"{role} sensitivity and area"] = u_rel * force
        zero = signals.offsets[role].u
        if math.isfinite(zero) and zero > 0:
            causes[f"{role} zero"] = zero * getattr(m, area) * free
        u_pa = moving_zero_pa(spec, signals.series[role]) if spec else 0.0
        moves = zero_moves(signals.times_s, onset_s).T
        causes |= {
            moving_zero(role, tau_s): u_pa * getattr(m, area) * one for tau_s, one in zip(MOVES_S, moves, strict=True)
        }
        channel = fired.shot.by_role(role)
        u_s = u_delay_s(fired.rig, role)
        if channel is not None and channel.time_base.clock != fired.shot.reference_clock:
            u_s = math.hypot(u_s, fired.shot.alignment(channel.time_base.clock).u_offset_s)
        if channel is not None:
            slow = LowPass(min(GUESS_CUTOFF_HZ, 0.1 * signals.rate_hz)).apply(force, signals.rate_hz)
            causes[f"{role} clock"] = u_s * np.gradient(slow, signals.step_s)
    # as the mass takes it, of a motion whose breech force is not asked for
    resisting = [*(-gauges[role] for role, _ in RESISTANCE), -friction]
    moving = Regression(
        times_s=signals.times_s,
        step_s=signals.step_s,
        acceleration_m_s2=travelling,
        forces_n=np.column_stack([np.zeros(free.size), *resisting]) * free[:, np.newaxis],
        released=free,
        friction_direction=-free,
        release_per_s=np.zeros(free.size),
        trusted=np.ones(free.size, dtype=np.bool_),
        interval_s=(onset_s, end_of_travel(signals.times_s, integrate(travelling, signals.step_s), onset_s)),
        release_n_s=0.0,
        u_release_n_s=0.0,
    )
    for unread in unread_causes(moving, moving, m, travelling):
        causes[unread.source] = unread.u * unread.forces_n.sum(axis=1)
    causes["packing friction"] = m.u.get("friction", 0.0) * free
    for source, left in signals.left.items():
        factor = specification.mass_kg if source.of == "recoil_acceleration" else dict(RESISTANCE).get(source.of)
        if factor is not None:
            causes[source] = left * (factor if isinstance(factor, float) else getattr(m, factor))
    return {cause: error[window] for cause, error in causes.items() if np.any(error)}
