"""Errors of the carriage's sensors, as causes that act on a travel that the forces drive.

A camera sees the recoil relative to the tipping part. What tells of that part's motion wrongly moves the travel.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recoil_identification.causes import NO_CARRIAGE_RATE, Cause
from recoil_identification.inference.unknown import Scope
from recoil_processing.double_integral import integrate
from recoil_processing.shot.clocks.forced_recoil import CARRIAGE_ACCELERATIONS, RATE_ROLES, ForcedRecoil
from recoil_processing.shot.kinematics import AngularMotion, lacks, relative_to_tipping_part, turning_as_one
from recoil_processing.shot.signals import static_value

Array = NDArray[np.float64]


def carriage_causes(forced: ForcedRecoil) -> tuple[Cause, ...]:
    """List the zeros, the scales and what repairs may have left of the carriage's sensors.

    Parameters
    ----------
    forced
        Of a shot with its alignments.
    """
    free, signals = forced.recorded.released, forced.signals

    def cause(source: str, unit: str, u: float, kind: str, other: AngularMotion, scope: Scope = "shot") -> Cause:
        """State an error of a sensor by the motion that it tells if it is off by a standard uncertainty."""
        return Cause(source, unit, u, kind, np.zeros((free.size, 3)), -_moved(forced, other) / u, scope=scope)

    found = []
    for (role, repair), left in signals.left.items():
        if role in CARRIAGE_ACCELERATIONS:
            found.append(cause(f"{role} {repair}", "1", 1.0, "B", _with_error(forced.motion, role, left)))
    for role in CARRIAGE_ACCELERATIONS:
        u = signals.offsets[role].u
        if math.isfinite(u) and u > 0:
            found.append(cause(f"{role} zero", "m/s^2", u, "A", _with_error(forced.motion, role, u * free)))
    for role in (*CARRIAGE_ACCELERATIONS, *RATE_ROLES):
        spec = forced.rig.by_role(role)
        if spec is not None and role in signals.series and spec.sensor.u_scale_rel:
            other = _with_scale(forced, role, spec.sensor.u_scale_rel)
            found.append(cause(f"{role} sensitivity", "1", spec.sensor.u_scale_rel, "B", other, "sensor"))
    if lacks(signals, forced.rig, "carriage_rate"):  # without both rates the camera gives no mass
        found.append(cause(NO_CARRIAGE_RATE, "1", 1.0, "B", turning_as_one(forced.motion)))
    return tuple(found)


def _with_scale(forced: ForcedRecoil, role: str, error: float) -> AngularMotion:
    """Let one of the carriage's sensors read high by a share of what it reads beyond its reading at rest."""
    motion, step_s = forced.motion, forced.signals.step_s
    if role == "carriage_rate":
        beta = motion.beta - error * integrate(motion.w1, step_s)
        return replace(motion, w1=(1.0 + error) * motion.w1, dw1=(1.0 + error) * motion.dw1, beta=beta)
    if role == "tipping_rate":
        beta = motion.beta + error * integrate(motion.w2, step_s)
        return replace(motion, w2=(1.0 + error) * motion.w2, dw2=(1.0 + error) * motion.dw2, beta=beta)
    reading = motion.f_x if role == CARRIAGE_ACCELERATIONS[0] else motion.f_y
    static = static_value(role, forced.rig.mechanism) or 0.0
    return _with_error(motion, role, error * (reading - static))


def _with_error(motion: AngularMotion, role: str, error: Array) -> AngularMotion:
    """Add an error to what one of the carriage's accelerometers reads."""
    if role == CARRIAGE_ACCELERATIONS[0]:
        return replace(motion, f_x=motion.f_x + error)
    return replace(motion, f_y=motion.f_y + error)


def _moved(forced: ForcedRecoil, other: AngularMotion) -> Array:
    """Return what another motion of the tipping part adds to the travel's acceleration, shape (n,)."""
    rigid, free = forced.inputs.force_n / forced.mass_kg, forced.recorded.released
    moved = relative_to_tipping_part(rigid, forced.rig.mechanism, other, forced.signals.step_s, free)
    return np.asarray(moved - forced.acceleration_m_s2)
