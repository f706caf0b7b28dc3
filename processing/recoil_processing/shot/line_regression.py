"""The equation of motion of a body on a line as a linear regression: ``m3 a' = sum F_j - friction``.

Gravity is in neither side, for a' is the specific force along the line.
"""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_processing.shot.line_motion import LineMotion
from recoil_processing.shot.regression import Regression, refuse_lost
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import Rig


def line_motion(signals: Signals, rig: Rig) -> LineMotion:
    """Return the motion of a body on a line by its signals.

    Raises
    ------
    IdentificationError
        If nothing was recorded of it.
    """
    forces = [signals.series[force.name] for force in rig.forces if force.name in signals.series]
    static = rig.mechanism.at_rest.get("recoil_acceleration", 0.0)
    offset = signals.offsets.get("recoil_acceleration")
    u_zero = 0.0 if offset is None else offset.u
    return LineMotion.of(signals.times_s, signals.series, forces, static, u_zero)


def line_regression(signals: Signals, rig: Rig, motion: LineMotion) -> Regression:
    """Set up both sides of the equation of motion of a body on a line, as recorded.

    While it is held, before it moves and after, both sides are zero by construction.

    Raises
    ------
    IdentificationError
        If a force was not recorded or all that tells of it is lost, or a speed is needed that nothing tells.
    """
    m, s = rig.mechanism, signals.series
    missing = [force.name for force in rig.forces if force.name not in s]
    if missing or not rig.forces:
        raise IdentificationError(
            f"no usable channel of force {', '.join(missing)}" if missing else "the rig has no channel of a force",
            expected="every force that the rig declares, on a clock that could be aligned",
            remedy="declare its role in the rig file, or mend the alignment",
        )
    inside = (signals.times_s >= motion.interval_s[0]) & (signals.times_s <= motion.interval_s[1])
    refuse_lost({force.name: s[force.name] for force in rig.forces}, inside)
    rubs = any((m.friction, m.slide_friction, m.u.get("friction", 0.0), m.u.get("slide_friction", 0.0)))
    if rubs and not motion.speed_told and motion.driven[0]:
        raise IdentificationError(
            "the body moves when the record begins, and nothing tells how fast: where its friction points is unknown",
            expected="a channel of role recoil_velocity or recoil_displacement, or a rest before the motion",
            remedy="record the speed, begin the record earlier, or state a friction of 0 with `u_friction = 0`",
        )
    whole = 1.0 + m.unread_share
    direction = motion.friction_direction
    speed = np.where(motion.driven, motion.velocity_m_s, 0.0)
    columns = [force.sign * force.per_reading * s[force.name] for force in rig.forces]
    forces = np.column_stack([*columns, whole * (m.friction * direction - m.slide_friction * speed)])
    released = motion.driven.astype(np.float64)
    static = m.at_rest.get("recoil_acceleration", 0.0)
    forces = np.where(motion.driven[:, np.newaxis], forces, 0.0)
    acceleration = np.where(motion.driven, motion.acceleration_m_s2, motion.acceleration_m_s2 - static)
    return Regression(
        times_s=signals.times_s,
        step_s=signals.step_s,
        acceleration_m_s2=acceleration,
        forces_n=forces,
        released=released,
        friction_direction=direction,
        release_per_s=np.zeros(speed.size),
        trusted=np.isfinite(acceleration) & np.isfinite(forces).all(axis=1),
        interval_s=motion.interval_s,
        release_n_s=0.0,
        u_release_n_s=0.0,
        gauges=tuple(force.name for force in rig.forces),
        signs=tuple(force.sign for force in rig.forces),
        motion_role=motion.role,
        speed_m_s=speed,
        travel_m=motion.travel_m,
        turning_n=whole * math.hypot(m.friction, m.u.get("friction", 0.0)),
    )
