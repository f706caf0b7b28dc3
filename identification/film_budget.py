"""Contributions to a camera's mass beyond noise and the gauges' scales: clocks, zeros, repairs, the carriage's sensors.

They are errors of the force or of the travel of one standard uncertainty; the estimator answers to each.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.budget import BudgetRow
from identification.filmed_recoil import FilmedRecoil
from identification.forced_recoil import CARRIAGE_ROLES
from identification.kinematics import Turning, relative_to_tipping_part
from identification.regression import AREAS, PRESSURE_ROLES
from identification.signals import static_value
from processing.double_integral import integrate

Array = NDArray[np.float64]

RATE_ROLES = ("carriage_rate", "tipping_rate")


def film_contributions(filmed: FilmedRecoil) -> tuple[float, tuple[BudgetRow, ...]]:
    """Evaluate what is uncertain of a film's mass but the gauges' scales.

    Parameters
    ----------
    filmed : FilmedRecoil

    Returns
    -------
    u_random_kg : float
        Standard uncertainty by noise alone, the clocks' offset being known.
    rows : tuple of BudgetRow
        Of the clocks, the zeros, the repairs and the carriage's sensors.
    """
    forced, found, clock = filmed.forced, filmed.found, filmed.clock
    levels = found.marker_sigma_m, found.density
    times, positions = filmed.frame_times_s, filmed.positions_m
    sources, errors = _force_errors(filmed)
    held = forced.film_mass(times, positions, u_shift_s=0.0, levels=levels)
    free_shift = np.inf if filmed.by_force else clock.u_offset_s
    found = forced.film_mass(times, positions, u_shift_s=free_shift, levels=levels, probes_n=errors)
    answers = dict.fromkeys(sources, 0.0)
    for source, answer in zip(sources, found.answers_kg, strict=True):
        # a clock's larger direction counts
        answers[source] = max(answers[source], abs(float(answer)))
    own = f"alignment of clock {clock.clock}"
    # what the offset costs the film, found with the mass or known beforehand
    offset_kg = max(found.u_kg**2 + found.u_shift_kg**2 - held.u_kg**2, 0.0) ** 0.5
    middle_s = float(np.mean(forced.recorded.interval_s))
    stretched = times + (times - middle_s) * clock.u_drift
    drift = forced.film_mass(stretched, positions, u_shift_s=free_shift, levels=levels)
    drift_kg = abs(drift.mass_kg - found.mass_kg)
    answers[own] = float(np.hypot(np.hypot(answers.get(own, 0.0), offset_kg), drift_kg))
    kinds = {source: "A" if source.endswith(" zero") else "B" for source in answers}
    return held.u_kg, tuple(BudgetRow(source, u, kinds[source]) for source, u in answers.items())


def _force_errors(filmed: FilmedRecoil) -> tuple[list[str], Array]:
    """Name errors of one standard uncertainty, and return them as forces, shape (n, n_errors)."""
    forced = filmed.forced
    probes, free = forced.inputs.probes, forced.recorded.released
    found = [*probes.zeros, *probes.clocks]
    for (role, cause), left in forced.signals.left.items():
        if role in PRESSURE_ROLES:
            area = getattr(forced.rig.mechanism, AREAS[PRESSURE_ROLES.index(role)])
            found.append((f"{role} {cause}", left * area * free))
        elif role in CARRIAGE_ROLES:
            found.append((f"{role} {cause}", _as_force(filmed, _with_error(forced.motion, role, left))))
    for role in CARRIAGE_ROLES:
        u = forced.signals.offsets[role].u
        if math.isfinite(u) and u > 0:
            found.append((f"{role} zero", _as_force(filmed, _with_error(forced.motion, role, u * free))))
    for role in (*CARRIAGE_ROLES, *RATE_ROLES):
        spec = forced.rig.by_role(role)
        if spec is None or role not in forced.signals.series or not spec.sensor.u_rel:
            continue
        other = _with_scale(filmed, role, spec.sensor.u_rel)
        found.append((f"{role} sensitivity", _as_force(filmed, other)))
    empty = np.zeros((free.size, 0))
    return [source for source, _ in found], np.column_stack([empty, *(error for _, error in found)])


def _with_scale(filmed: FilmedRecoil, role: str, error: float) -> Turning:
    """Let one of the carriage's sensors read high by a share of what it reads beyond its reading at rest."""
    motion, step_s = filmed.forced.motion, filmed.forced.signals.step_s
    if role == "carriage_rate":
        beta = motion.beta - error * integrate(motion.w1, step_s)
        return replace(motion, w1=(1.0 + error) * motion.w1, dw1=(1.0 + error) * motion.dw1, beta=beta)
    if role == "tipping_rate":
        beta = motion.beta + error * integrate(motion.w2, step_s)
        return replace(motion, w2=(1.0 + error) * motion.w2, dw2=(1.0 + error) * motion.dw2, beta=beta)
    reading = motion.f_x if role == CARRIAGE_ROLES[0] else motion.f_y
    static = static_value(role, filmed.forced.rig.mechanism) or 0.0
    return _with_error(motion, role, error * (reading - static))


def _with_error(motion: Turning, role: str, error: Array) -> Turning:
    """Add an error to what one of the carriage's accelerometers reads."""
    if role == CARRIAGE_ROLES[0]:
        return replace(motion, f_x=motion.f_x + error)
    return replace(motion, f_y=motion.f_y + error)


def _as_force(filmed: FilmedRecoil, other: Turning) -> Array:
    """Return the force that would change the travel as another motion of the tipping part does, shape (n,)."""
    forced = filmed.forced
    rigid = forced.inputs.force_n / forced.mass_kg
    free = forced.recorded.released
    moved = relative_to_tipping_part(rigid, forced.rig.mechanism, other, forced.signals.step_s, free)
    return np.asarray(forced.mass_kg * (moved - forced.acceleration_m_s2) * free)
