"""A shot's rows of travel, velocity and force for the recoil resistance, and their errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.rows.causes import u_delay_s
from recoil_identification.rows.late_readings import settled_by_late_readings
from recoil_identification.rows.recorded_causes import recorded_causes
from recoil_identification.shot.identified import Identification
from recoil_identification.shot.preparation import Prepared
from recoil_identification.targets.resistance.resistance_law import block_means
from recoil_identification.targets.resistance.shot_balance import Terms
from recoil_processing.gaps import bridge
from recoil_processing.shot.error_source import ErrorSource
from recoil_processing.shot.gauge_zero import moving_zero_pa
from recoil_processing.shot.regression import FORCES, PRESSURE_ROLES
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.channel_table import range_si

BLOCK_S = 1e-3
"""Length of the means that the laws are fitted to: stress waves of a kilohertz and noise are averaged over."""
ASSUMED_ZERO = 5e-4
"""Share of the range: standard uncertainty of the zero of a gauge that never reads zero, where nothing states it."""


@dataclass(frozen=True, eq=False)
class ResistanceRecord(ReadOnlyArrays):
    """A shot from the release to the end of recoil.

    Attributes
    ----------
    times_s, travel_m, velocity_m_s, u_velocity_m_s : ndarray, shape (n,)
    brake_pa, recuperator_pa : ndarray, shape (n,)
        Pressures as recorded, lost samples NaN.
    terms
        Terms of the balances.
    rows : mapping of str to ndarray, shape (n_blocks,)
        Means of blocks of the columns above, and of the velocity's square as ``square``; blocks with a lost sample
        are left out.
    u_scale
        Relative standard uncertainty of travel and velocity.
    u_travel_m
        Standard uncertainty of the travel at the end beside its scale.
    u_gauges
        Relative, of breech, brake and recuperator force.
    u_zero_pa
        Standard uncertainty of each gauge's zero, Pa; keys are roles.
    u_moving_pa
        Standard uncertainty of how far each gauge's zero may move at the shot, Pa; keys are roles.
    u_clock_s
        Standard uncertainty of each gauge's instants against the motion's, s; keys are roles.
    breech_lacks_n : ndarray, shape (n,)
        Force that the breech gauge reads too little by its zero, as it reads once the bore is empty.
    left_pa : mapping of ErrorSource to ndarray, shape (n,)
        Errors that repairs may have left.
    zero_assumed
        Whether the recuperator's zero is `ASSUMED_ZERO`.
    """

    times_s: Array
    travel_m: Array
    velocity_m_s: Array
    u_velocity_m_s: Array
    brake_pa: Array
    recuperator_pa: Array
    terms: Terms
    rows: Mapping[str, Array]
    u_scale: float
    u_travel_m: float
    u_gauges: tuple[float, ...]
    u_zero_pa: Mapping[str, float]
    u_moving_pa: Mapping[str, float]
    u_clock_s: Mapping[str, float]
    breech_lacks_n: Array
    left_pa: Mapping[ErrorSource, Array]
    zero_assumed: bool


def resistance_record(
    fired: FiredShot, prepared: Prepared, found: Identification, scales: ScaleUncertainty
) -> ResistanceRecord:
    """Collect what a shot tells of the recoil resistance.

    Parameters
    ----------
    found
        Identification of the mass; it holds the regression as recorded, with the accelerometer's lateness taken off.

    Raises
    ------
    IdentificationError
        If less than `recoil_identification.targets.resistance.resistance_law.LEAST_ROWS` blocks of the recoil are
        whole.
    """
    recorded, signals, m = found.route.recorded, found.route.signals, fired.rig.mechanism
    part = slice(int(np.argmax(recorded.released > 0)), int(np.searchsorted(recorded.times_s, recorded.interval_s[1])))
    times, step = recorded.times_s[part], recorded.step_s
    x, v = found.route.travel_m[part] - found.route.travel_m[part.start], found.route.velocity_m_s[part]
    fused = found.route.fused
    u_v = np.zeros_like(v) if fused is None else fused.u_velocity_m_s[part]
    camera, accelerometer = found.route.camera, fired.rig.by_role("recoil_acceleration")
    u_own = accelerometer.sensor.u_scale_rel if accelerometer else 0.0
    u_scale = u_own if fused is None or camera is None else camera.u_rel
    pressures = [signals.series[role][part] for role in PRESSURE_ROLES]
    block = max(1, round(BLOCK_S / step))
    columns = np.column_stack([times, x, v, v**2, u_v, pressures[1], pressures[2]])
    means = block_means(columns, block)
    means = means[np.isfinite(means).all(axis=1)]
    if means.shape[0] < 20:
        raise IdentificationError(
            f"only {means.shape[0]} stretches of {1e3 * BLOCK_S:g} ms of the recoil are without lost samples",
            expected="at least 20",
            remedy="check for lost samples of the pressures",
        )
    names = ("time", "travel", "velocity", "square", "u_velocity", "brake", "recuperator")
    zeros, assumed = _zeros(found, fired.rig)
    clocks = _clocks(fired)
    carried = (bridge(prepared.inertial_m_s2) - prepared.acceleration_m_s2)[part]
    causes, lacking_n = settled_by_late_readings(
        recorded_causes(recorded, signals, fired), signals, recorded.interval_s
    )
    whole_n = recorded.forces_n.copy()
    whole_n[:, : lacking_n.shape[1]] += lacking_n
    forces = {name: bridge(whole_n[part, i]) for i, name in enumerate(FORCES)}
    errors: dict[str, Array] = {}
    for name, role, area, u in zip(FORCES, PRESSURE_ROLES, m.force_areas, scales.gauges, strict=False):
        errors[f"{role} sensitivity and area"] = u * forces[name]
        if role in assumed:
            errors[f"{role} zero"] = np.full(times.size, zeros[role] * area)
    for cause in causes:
        if np.any(cause.forces_n):
            errors[cause.source] = cause.u * cause.forces_n.sum(axis=1)[part]
    errors["packing friction"] = np.full(times.size, scales.friction_n)
    noise = []
    for role, area in zip(PRESSURE_ROLES, m.force_areas, strict=True):
        channel = fired.shot.by_role(role)
        # samples of a slower recorder that were interpolated have their errors in common
        alike = 1.0 if channel is None else max(1.0, 1.0 / (step * channel.time_base.rate_hz))
        noise.append(signals.offsets[role].noise * area * math.sqrt(alike))
    terms = Terms(
        step_s=step,
        forces_n=forces,
        carried_m_s2=carried,
        velocity_m_s=v,
        u_velocity_m_s=u_v,
        mass_kg=fired.rig.specification.mass_kg,
        force_errors_n=errors,
        noise_n=math.hypot(*(n for n in noise if math.isfinite(n))),
        u_mass_kg=fired.rig.specification.u_kg,
        u_velocity_scale=u_scale,
        u_clock_s=found.inertial.skew.u_s if math.isfinite(found.inertial.skew.u_s) else 0.0,
    )
    return ResistanceRecord(
        times_s=times,
        travel_m=x,
        velocity_m_s=v,
        u_velocity_m_s=u_v,
        brake_pa=pressures[1],
        recuperator_pa=pressures[2],
        terms=terms,
        rows=dict(zip(names, means.T, strict=True)),
        u_scale=u_scale,
        u_travel_m=0.0 if fused is None else math.hypot(*fused.u_position_m[[part.start, part.stop - 1]]),
        u_gauges=scales.gauges,
        u_zero_pa=zeros,
        u_moving_pa={role: _moving_pa(fired.rig, role, signals.series[role]) for role in PRESSURE_ROLES},
        u_clock_s=clocks,
        breech_lacks_n=lacking_n[part, 0],
        left_pa={source: left[part] for source, left in signals.left.items() if source.of in PRESSURE_ROLES},
        zero_assumed=bool(assumed),
    )


def _zeros(found: Identification, rig: Rig) -> tuple[dict[str, float], set[str]]:
    """Return the standard uncertainties of the gauges' zeros, and of which ones no baseline tells it."""
    zeros, assumed = {}, set()
    for role in PRESSURE_ROLES:
        u = found.route.signals.offsets[role].u
        if role == "recuperator_pressure" or not math.isfinite(u):
            spec = rig.by_role(role)
            full = None if spec is None else range_si(spec)
            u = 0.0 if full is None else ASSUMED_ZERO * max(abs(end) for end in full)
            assumed.add(role)
        zeros[role] = u
    return zeros, assumed


def _moving_pa(rig: Rig, role: str, reading_pa: Array) -> float:
    spec = rig.by_role(role)
    return 0.0 if spec is None else moving_zero_pa(spec, reading_pa)


def _clocks(fired: FiredShot) -> dict[str, float]:
    """Return the standard uncertainties of the gauges' instants against the recorder of the acceleration."""
    clocks = {}
    for role in PRESSURE_ROLES:
        gauge, u = fired.channel(role), u_delay_s(fired.rig, role)
        if gauge is not None and gauge.recorded.time_base.clock != fired.shot.reference_clock:
            u_offset_s = math.inf if gauge.alignment is None else gauge.alignment.u_offset_s
            u = math.hypot(u_offset_s, u)
        clocks[role] = u
    return clocks
