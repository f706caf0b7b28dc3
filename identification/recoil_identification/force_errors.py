"""Errors that the forces and the carriage's sensors may have besides the gauges' scales, in a camera's mass.

Each is of one standard uncertainty and written as a force: what moves the tipping part by mistake moves the travel as
a force would that is its mass times as large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_processing.double_integral import integrate
from recoil_processing.shot.clocks.forced_recoil import CARRIAGE_ACCELERATIONS, RATE_ROLES, ForcedRecoil
from recoil_processing.shot.kinematics import AngularMotion, relative_to_tipping_part
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_processing.shot.signals import static_value

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NamedErrors(ReadOnlyArrays):
    """Errors of the force by their sources.

    Attributes
    ----------
    kinds
        ``A`` for zeros, by the noise of the pre-trigger baseline; ``B`` for the rest.
    columns_n : ndarray, shape (n, n_errors)
    """

    sources: tuple[str, ...]
    kinds: tuple[str, ...]
    columns_n: Array


def force_errors(forced: ForcedRecoil) -> NamedErrors:
    """Return what may be wrong with the forces, and with the motion of the tipping part.

    Parameters
    ----------
    forced
        Of a shot with its alignments.
    """
    free, signals = forced.recorded.released, forced.signals
    found = [("A", source, error) for source, error in forced.inputs.perturbations.zeros]
    # late and early are one error but for its sign
    found += [("B", source, error) for source, error in forced.inputs.perturbations.clocks[::2]]
    for (role, cause), left in signals.left.items():
        if role in PRESSURE_ROLES:
            area = forced.rig.mechanism.force_areas[PRESSURE_ROLES.index(role)]
            found.append(("B", f"{role} {cause}", left * area * free))
        elif role in CARRIAGE_ACCELERATIONS:
            found.append(("B", f"{role} {cause}", _as_force(forced, _with_error(forced.motion, role, left))))
    for role in CARRIAGE_ACCELERATIONS:
        u = signals.offsets[role].u
        if math.isfinite(u) and u > 0:
            found.append(("A", f"{role} zero", _as_force(forced, _with_error(forced.motion, role, u * free))))
    for role in (*CARRIAGE_ACCELERATIONS, *RATE_ROLES):
        spec = forced.rig.by_role(role)
        if spec is not None and role in signals.series and spec.sensor.u_rel:
            other = _with_scale(forced, role, spec.sensor.u_rel)
            found.append(("B", f"{role} sensitivity", _as_force(forced, other)))
    empty = np.zeros((free.size, 0))
    return NamedErrors(
        tuple(source for _, source, _ in found),
        tuple(kind for kind, _, _ in found),
        np.column_stack([empty, *(error for _, _, error in found)]),
    )


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


def _as_force(forced: ForcedRecoil, other: AngularMotion) -> Array:
    """Return the force that would change the travel as another motion of the tipping part does, shape (n,)."""
    rigid, free = forced.inputs.force_n / forced.mass_kg, forced.recorded.released
    moved = relative_to_tipping_part(rigid, forced.rig.mechanism, other, forced.signals.step_s, free)
    return np.asarray(forced.mass_kg * (moved - forced.acceleration_m_s2))
