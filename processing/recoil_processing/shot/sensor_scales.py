"""Scales that the mass hangs on, as the rig states them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_rigs.rig import Rig

MOTION_ROLES = ("recoil_acceleration", "recoil_displacement")
BORE_FRICTION = ErrorSource(SourceKind.BORE_FRICTION)
"""Part of the breech force's scale that is neither a gauge's nor an area's."""


def of_gauge(channel: str) -> ErrorSource:
    """Return the part that one of several gauges of a pressure has in the scale of their mean."""
    return ErrorSource(SourceKind.SENSITIVITY, channel)


def dynamic_scale(of: str) -> ErrorSource:
    """Return the part that the scale of a force in a pulse has beside that at rest; of one of several gauges too."""
    return ErrorSource(SourceKind.DYNAMIC_SCALE, of)


@dataclass(frozen=True)
class ScaleUncertainty:
    """Standard uncertainties of what the scale of the mass hangs on.

    Attributes
    ----------
    acceleration
        Standard uncertainty of the scale of what measured the motion, an accelerometer where there is one, relative.
    gauges
        Standard uncertainties of the measured forces, gauge and area together, the bore's friction too, relative.
    friction_n
        Standard uncertainty of the packing friction, N: absolute, because a friction that is declared as zero may have
        one.
    parts
        Parts of these uncertainties that no sensor's certificate states, by the force's name or the role: the area, the
        friction, the standard or the scale in a pulse, and its relative standard uncertainty. Sensors that were
        calibrated against one standard share its part. Where several gauges measure one pressure each of them is a
        part, see `of_gauge`.
    forces
        Names of the measured forces, in the order of `gauges`.
    motion_role
        Role of what measured the motion.
    """

    acceleration: float
    gauges: tuple[float, ...]
    friction_n: float
    parts: Mapping[str, tuple[tuple[ErrorSource, float], ...]] = field(default_factory=dict)
    forces: tuple[str, ...] = PRESSURE_ROLES
    motion_role: str = "recoil_acceleration"


def scale_uncertainty(rig: Rig, motion_role: str = "recoil_acceleration") -> ScaleUncertainty:
    """Collect the standard uncertainties of the sensors' scales, areas included, and of the friction.

    Parameters
    ----------
    motion_role
        Role of what measured the motion.
    """
    m, parts, total = rig.mechanism, {}, {}
    of_forces = {force.name: (force.channels, force.area) for force in rig.forces}
    of_motion = {role: (rig.with_role(role), "") for role in dict.fromkeys((*MOTION_ROLES, motion_role))}
    for name, (channels, area) in (of_forces | of_motion).items():
        listed: dict[ErrorSource, float] = {}
        if area and (u_area := m.u.get(area, 0.0) / getattr(m, area)):
            listed[ErrorSource(SourceKind.AREA, area)] = u_area
        if name == "breech_pressure" and m.u_bore_friction_rel:
            listed[BORE_FRICTION] = m.u_bore_friction_rel
        standards: dict[ErrorSource, float] = {}
        own: dict[ErrorSource, float] = {}
        dynamic: dict[ErrorSource, float] = {}
        for channel in channels:
            sensor = channel.sensor
            if sensor.u_reference_rel:
                standard = ErrorSource(SourceKind.STANDARD, sensor.reference)
                standards[standard] = standards.get(standard, 0.0) + sensor.u_reference_rel / len(channels)
            if channel.u_dynamic_rel:
                of = name if len(channels) == 1 else channel.name
                dynamic[dynamic_scale(of)] = channel.u_dynamic_rel / len(channels)
            own[of_gauge(channel.name)] = math.sqrt(sensor.u_scale_rel**2 - sensor.u_reference_rel**2) / len(channels)
        total[name] = math.hypot(*own.values(), *standards.values(), *dynamic.values(), *listed.values())
        # of the mean of several gauges each has its part
        listed |= standards | dynamic | (own if len(channels) > 1 else {})
        if listed:
            parts[name] = tuple(listed.items())
    return ScaleUncertainty(
        acceleration=total[motion_role],
        gauges=tuple(total[name] for name in of_forces),
        friction_n=m.u.get("friction", 0.0),
        parts=parts,
        forces=tuple(of_forces),
        motion_role=motion_role,
    )
