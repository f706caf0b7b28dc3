"""Errors of sensors, clocks and declared lengths, and the directions in which they move columns of a regression."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.shot.shot import Shot
from recoil_identification.inference.unknown import Prior
from recoil_identification.shot.preparation import Prepared
from recoil_identification.targets.parameters.load_cells import LOAD_CELLS
from recoil_processing.shot.clocks.forced_recoil import RATE_ROLES
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import FORCES, PRESSURE_ROLES
from recoil_rigs.shots.fired_shot import FiredShot

Columns = Mapping[str, Array]


def released(force: str) -> str:
    """Return the name of a force's column in the equation along the bore, which is zero while the part is held."""
    return f"{force} released"


RELEASED = tuple(released(force) for force in FORCES)
"""Columns of all forces of the equation along the bore."""


@dataclass(frozen=True, eq=False)
class SensorError:
    """One error that a sensor, a clock or a declared length may have.

    Attributes
    ----------
    source
        Sensor, clock or length that is off.
    u
        Standard uncertainty of the error's size, in `unit`.
    unit
        Unit of the size; ``1`` for a share of a scale.
    directions : mapping of str to ndarray, shape (n,)
        Amount that an error of size one adds to the true value, by column: it is taken off again by subtraction.
    geometry
        Field of `recoil_rigs.mechanism.mechanism_regressor.Geometry` that is wrong by the size; empty for none.
    """

    source: ErrorSource
    u: float
    unit: str
    directions: Columns
    geometry: str = ""

    @property
    def prior(self) -> Prior:
        """Prior of its size, beside the shot."""
        return Prior.of(self.source, self.source, self.u)


COLUMNS_OF = {
    "recoil_acceleration": ("acc",),
    "carriage_acceleration_x": ("f_x",),
    "carriage_acceleration_y": ("f_y",),
    "carriage_rate": ("w1", "dw1", "alpha"),
    "tipping_rate": ("w2", "dw2"),
    "recoil_displacement": ("x", "dx"),
    **{role: (released(name),) for role, name in zip(PRESSURE_ROLES, FORCES, strict=False)},
    **{role: (load,) for load, role in LOAD_CELLS.items()},
}
"""Role -> columns that are late if its clock is."""


def scale_of(role: str) -> ErrorSource:
    """Return the source that is the scale of a role's sensor."""
    return ErrorSource(SourceKind.SCALE, role)


def sensor_errors(
    fired: FiredShot,
    prepared: Prepared,
    columns: Columns,
    left: Mapping[ErrorSource, Array],
    rest: Mapping[str, float],
    onset_s: float,
) -> list[SensorError]:
    """Describe what may be wrong of every column; those that are exactly known are left out.

    Parameters
    ----------
    fired, prepared
        Shot with its alignments and its rig, and its signals.
    columns : mapping of str to ndarray, shape (n,)
        Columns behind the low-pass, by name.
    left : mapping to ndarray, shape (n,)
        Remainders of repairs behind the same low-pass, by role and repair.
    rest
        Loads while nothing moves, by column.
    onset_s
        Onset of force.
    """
    m, c, signals = fired.rig.mechanism, columns, prepared.signals
    step, since = signals.step_s, signals.times_s - onset_s
    ramp = np.maximum(since, 0.0)
    one = (since >= 0.0).astype(np.float64)
    found = []

    def add(source: ErrorSource, u: float, unit: str, directions: Columns, geometry: str = "") -> None:
        if math.isfinite(u) and u > 0:
            found.append(SensorError(source, u, unit, directions, geometry))

    def u_of(role: str) -> float:
        spec = fired.rig.by_role(role)
        return spec.u_scale_rel if spec is not None and role in _channels(fired.shot) else 0.0

    statics = {
        "f_x": m.g * math.sin(m.phi10),
        "f_y": m.g * math.cos(m.phi10),
        "acc": prepared.static_m_s2,
    }
    travel = {"x": c["x"], "dx": c["dx"]}
    acc = {"acc": c["acc"] - statics["acc"]}
    if prepared.fused is None:
        acc |= travel
    add(scale_of("recoil_acceleration"), u_of("recoil_acceleration"), "1", acc)
    for role, name in (("carriage_acceleration_x", "f_x"), ("carriage_acceleration_y", "f_y")):
        add(scale_of(role), u_of(role), "1", {name: c[name] - statics[name]})
    add(scale_of("carriage_rate"), u_of("carriage_rate"), "1", _rate1(c["w1"], c["dw1"], c["alpha"]))
    add(scale_of("tipping_rate"), u_of("tipping_rate"), "1", _rate2(c["w2"], c["dw2"], c["alpha"] + c["beta"]))
    if prepared.fused is not None:
        add(scale_of("recoil_displacement"), u_of("recoil_displacement"), "1", travel)
    for role, u_area, name in zip(PRESSURE_ROLES, m.u_force_areas_rel, FORCES, strict=False):
        u = math.hypot(u_of(role), u_area)
        forces = {released(name): c[released(name)]}
        if name == "breech":
            forces["breech"] = c["breech"]
        add(ErrorSource(SourceKind.SCALE_AND_AREA, role), u, "1", forces)
    add(
        ErrorSource(SourceKind.FRICTION), m.u.get("friction", 0.0), "N", {released("friction"): c["friction_direction"]}
    )
    for load, role in LOAD_CELLS.items():
        if load in c:
            add(scale_of(role), u_of(role), "1", {load: c[load] - rest[load]})
    zeros: dict[str, Columns] = {
        "recoil_acceleration": {"acc": c["released"]},
        "carriage_acceleration_x": {"f_x": one},
        "carriage_acceleration_y": {"f_y": one},
        "carriage_rate": _rate1(one, np.zeros_like(one), ramp),
        "tipping_rate": _rate2(one, np.zeros_like(one), ramp),
    }
    for role, directions in zeros.items():
        unit = "rad/s" if role in RATE_ROLES else "m/s^2"
        add(ErrorSource(SourceKind.ZERO, role), signals.offsets[role].u, unit, directions)
    for source in signals.left:
        if source.of in ("recoil_acceleration", "carriage_acceleration_x", "carriage_acceleration_y"):
            add(source, 1.0, "1", {COLUMNS_OF[source.of][0]: left[source]})
    for field, unit in (("XA", "m"), ("YA", "m"), ("phi10", "rad"), ("phi20", "rad"), ("L", "m")):
        add(ErrorSource(SourceKind.DECLARED, field), m.u.get(field, 0.0), unit, {}, field)
    add(ErrorSource(SourceKind.FORCE_LINE), math.hypot(m.u.get("e", 0.0), m.u.get("d", 0.0)), "m", {}, "force_line")
    for clock in sorted({channel.time_base.clock for channel in fired.shot.channels.values()}):
        if clock == fired.shot.reference_clock:
            continue
        roles = [role for role in COLUMNS_OF if _channels(fired.shot).get(role) == clock]
        names = [name for role in roles for name in COLUMNS_OF[role] if name in c]
        if "breech_pressure" in roles:
            names.append("breech")
        late = {name: -np.gradient(c[name], step) for name in names}
        gyros = [role in roles for role in ("carriage_rate", "tipping_rate")]
        if any(gyros):
            late["beta"] = -(gyros[1] * c["w2"] - gyros[0] * c["w1"])
        add(ErrorSource(SourceKind.ALIGNMENT, clock), fired.shot.alignment(clock).u_offset_s, "s", late)
    return found


def _channels(shot: Shot) -> dict[str, str]:
    """Return the clock of every role that the shot has."""
    return {channel.role: channel.time_base.clock for channel in shot.channels.values() if channel.role}


def _rate1(rate: Array, change: Array, turned: Array) -> dict[str, Array]:
    return {"w1": rate, "dw1": change, "alpha": turned, "beta": -turned}


def _rate2(rate: Array, change: Array, turned: Array) -> dict[str, Array]:
    return {"w2": rate, "dw2": change, "beta": turned}
