"""The recoiling mechanism: its parameters, and what each model of it answers to those who identify its mass.

Filters, clocks, checks and estimators ask the mechanism which channels tell its motion, which forces act, how it begins
and what it rests on; none of them asks which model it is. `recoil_rigs.mechanism.gun` has the three bodies of a gun,
`recoil_rigs.mechanism.line` one body on a line; a model of another kind is another class that answers.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_acquisition.quantities.quantity import STANDARD_GRAVITY_M_S2
from recoil_rigs.mechanism.bounds import OF_ROLE, OF_SYMBOL, Bounds
from recoil_rigs.tables.channel_table import ChannelSpec
from recoil_rigs.tables.force_input import AREAS, SIGNS, ForceInput
from recoil_rigs.tables.rig_tables import GAUGE_ROLES

MECHANISM = "mechanism"
"""Name of the table of a rig file in which the parameters stand."""


class MechanismModel(StrEnum):
    """Models of what moves, as a rig file names them."""

    GUN = "gun"
    LINE = "line"


@dataclass(frozen=True)
class Mechanism(ABC):
    """Parameters of the mechanism, SI units, angles in rad, NaN where not declared; and its model's answers.

    Attributes
    ----------
    model
        Name of the model.
    motion_roles
        Roles of what may tell the motion of the recoiling mass, in words, in the order in which they count.
    sure_roles
        Roles of which a channel counts only if its clock is aligned beyond doubt: what it tells others tell, too.
    positive_pulses
        Roles of what is a pulse: positive by convention while the mass recoils, and as at rest before and after.
    words
        Name of what it is, as people say it.
    bounds, bounds_of_role
        Bounds of its values by symbol; and, by role, of how far a sensor reaches and of its peak in a shot, SI.
    shared_roles
        Roles that several channels may bear.
    foreign_roles
        Roles that it does not know -> what is wrong with a channel of one, and what to do.
    spans_s
        Times from the onset, s: over which spectra are taken, of pulse, brake and the knocks at its end; and after
        which nothing is looked through for clipping or filtered. Infinite where it moves as long as the record goes on.
    recoils_once
        Whether it rests in battery until it is fired, recoils once and runs back there; if not, it may move when the
        record begins, to and fro, and is driven or held at any time.
    force_rate_hz
        Rate that its force needs at most; infinite where nothing bounds it: a hammer's blow is over in a millisecond.
    never_none
        Symbol -> standard uncertainty that it may well have, of what no such mechanism is without.
    carriage_roles
        Roles of what tells how carriage and tipping part move, on which it recoils; none where it has neither.
    m1, m2, m3
        Masses of carriage, tipping part and recoiling part, kg. ``m3`` is the specification mass.
    J1, J2, J3c
        Moments of inertia, kg m^2: of the carriage about C, of the tipping part about A, of the
        recoiling part about its centre of mass.
    X1, Y1
        Centre of mass of the carriage from C, carriage axes, m.
    XA, YA
        Trunnion A from C, carriage axes, m.
    s2, d2
        Centre of mass of the tipping part from A, tipping axes, m.
    b, d
        Centre of mass of the recoiling part in battery from A, tipping axes, m.
    e
        Offset of the breech force's line above the recoiling part's centre of mass, m.
    L, f
        Distance of ground contact D ahead of C, m, and its friction coefficient.
    phi10, phi20
        Angles of the carriage axis and of the bore axis over the horizontal, in battery, rad. On a line ``phi20``
        is that of the direction in which the forces drive.
    g
        Acceleration of gravity, m/s^2.
    bore_area, brake_area, recuperator_area
        Areas on which the breech, brake and recuperator pressures act, m^2.
    friction
        Packing friction that no gauge reads, N.
    bore_friction
        Share of the breech's force that the projectile's friction in the bore takes off.
    muzzle_brake
        Share of the breech's force that a muzzle brake takes off once the projectile is out.
    projectile_mass, bore_length
        Mass of the projectile, kg, and its travel to the exit, m, which say when that is; 0 where not declared.
    tube_axial_hz
        First mode of the tube along its axis, Hz; 0 where none is stated.
    unread_share
        Share by which the resistance that the gauges read falls short of the whole; negative where it exceeds it.
    unread_force
        Standard uncertainty of the force that acts beside all others, of whatever shape, share of the peak resistance.
    slide_friction
        Viscous friction of slides and seals, N s/m.
    carried_mass
        Mass of oil and rods that the forces move beside ``m3``, kg.
    u
        Standard uncertainties of any of these values but ``unread_force``, by symbol, in the value's unit.
    unstated
        Keys that the rig file leaves out and for which a usual value is taken, ``u_<name>`` for an uncertainty.
    """

    m3: float
    phi20: float
    friction: float
    XA: float = math.nan
    YA: float = math.nan
    b: float = math.nan
    d: float = math.nan
    phi10: float = math.nan
    bore_area: float = math.nan
    brake_area: float = math.nan
    recuperator_area: float = math.nan
    m1: float = math.nan
    m2: float = math.nan
    J1: float = math.nan
    J2: float = math.nan
    J3c: float = math.nan
    X1: float = math.nan
    Y1: float = math.nan
    s2: float = math.nan
    d2: float = math.nan
    e: float = math.nan
    L: float = math.nan
    f: float = math.nan
    g: float = STANDARD_GRAVITY_M_S2
    bore_friction: float = 0.01
    muzzle_brake: float = 0.0
    projectile_mass: float = 0.0
    bore_length: float = 0.0
    tube_axial_hz: float = 0.0
    unread_share: float = 0.0
    unread_force: float = 0.002
    slide_friction: float = 0.0
    carried_mass: float = 0.0
    u: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    unstated: frozenset[str] = frozenset()

    model: ClassVar[MechanismModel]
    words: ClassVar[str]
    motion_roles: ClassVar[Mapping[str, str]]
    sure_roles: ClassVar[frozenset[str]] = frozenset()
    positive_pulses: ClassVar[frozenset[str]] = frozenset()
    spans_s: ClassVar[tuple[float, float]]
    bounds: ClassVar[Mapping[str, Bounds]] = OF_SYMBOL
    bounds_of_role: ClassVar[Mapping[str, Bounds]] = OF_ROLE
    shared_roles: ClassVar[tuple[str, ...]]
    foreign_roles: ClassVar[Mapping[str, str]]
    recoils_once: ClassVar[bool]
    force_rate_hz: ClassVar[float]
    never_none: ClassVar[Mapping[str, float]] = MappingProxyType({})
    carriage_roles: ClassVar[tuple[str, ...]] = ()

    USUAL_U: ClassVar[Mapping[str, float]] = MappingProxyType(
        {"bore_friction": 0.006, "muzzle_brake": 0.0, "unread_share": 0.01, "slide_friction": 0.0, "carried_mass": 0.0}
    )
    """Symbol -> standard uncertainty where the rig file states neither the value nor its uncertainty."""
    OF_GUN: ClassVar[frozenset[str]] = frozenset(
        {"m1", "m2", "J1", "J2", "J3c", "X1", "Y1", "XA", "YA", "s2", "d2", "b", "d", "e", "L", "f", "phi10"}
    )
    """Symbols of carriage and tipping part, and of where the recoiling part is on them: a line has none."""
    OF_PRESSURE: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "bore_area": "breech_pressure",
            **dict.fromkeys(("bore_friction", "muzzle_brake", "projectile_mass", "bore_length"), "breech_pressure"),
            "brake_area": "brake_pressure",
            "recuperator_area": "recuperator_pressure",
        }
    )
    """Symbol -> role of the pressure that gives it a meaning; a gun has all three."""
    POSITIVE: ClassVar[frozenset[str]] = frozenset(
        {"m1", "m2", "m3", "J1", "J2", "J3c", "L", "g", "bore_area", "brake_area", "recuperator_area"}
    )

    @abstractmethod
    def forces(self, channels: Sequence[ChannelSpec]) -> tuple[ForceInput, ...]:
        """List the forces that sensors measure, driving and resisting ones, in the order of every table of them."""

    @abstractmethod
    def series(self, forces: Sequence[ForceInput]) -> tuple[str, ...]:
        """List the series that its equation of motion is made of: roles, and names of its forces."""

    def grid_series(self, forces: Sequence[ForceInput]) -> tuple[str, ...]:
        """List the series of which a channel on the reference clock may carry the grid; the first one counts."""
        return self.series(forces)

    def needs_carriage(self, role: str | None) -> bool:
        """Return whether what a role reads tells the motion only with that of a carriage: a camera's track on one."""
        return role == "recoil_displacement" and bool(self.carriage_roles)

    @property
    @abstractmethod
    def at_rest(self) -> Mapping[str, float]:
        """Readings at rest by role, SI; none of a role of which nothing is known then."""

    @abstractmethod
    def travel_acceleration(self, inertial: ArrayLike, *moving: Any, **carriage: Any) -> NDArray[np.float64]:
        """Return x'' along what the mass recoils on, m/s^2, shape (...).

        Parameters
        ----------
        inertial, moving, carriage
            Arguments of `recoil_rigs.mechanism.measured_acceleration.relative_acceleration`; only the first one counts
            where the mechanism has no `carriage_roles`.
        """

    def pressures(self, channels: Sequence[ChannelSpec]) -> tuple[ForceInput, ...]:
        """List the forces of breech, brake and recuperator pressure, with their channels, which may be none."""
        return tuple(
            ForceInput(role, role, sign, area_m2, tuple(one for one in channels if one.role == role), area)
            for role, sign, area_m2, area in zip(GAUGE_ROLES, SIGNS, self.force_areas, AREAS, strict=True)
        )

    @property
    def force_areas(self) -> tuple[float, float, float]:
        """Force per pressure of breech, brake and recuperator, m^2.

        That of the breech is without the projectile's friction, those that resist are with the share that no gauge
        reads.
        """
        whole = 1.0 + self.unread_share
        return self.bore_area * (1.0 - self.bore_friction), whole * self.brake_area, whole * self.recuperator_area

    @property
    def u_force_areas_rel(self) -> tuple[float, float, float]:
        """Relative standard uncertainties of `force_areas`."""
        bore, brake, recuperator = (
            self.u.get(name, 0.0) / getattr(self, name) for name in ("bore_area", "brake_area", "recuperator_area")
        )
        return math.hypot(bore, self.u_bore_friction_rel), brake, recuperator

    @property
    def u_bore_friction_rel(self) -> float:
        """Standard uncertainty of the bore's friction, share of the force that is left."""
        return self.u.get("bore_friction", 0.0) / (1.0 - self.bore_friction)

    @classmethod
    def symbols(cls) -> tuple[str, ...]:
        """Names of all values, without their uncertainties."""
        return tuple(f.name for f in fields(cls) if f.name not in ("u", "unstated"))

    @classmethod
    @abstractmethod
    def symbols_of(cls, roles: Collection[str]) -> tuple[str, ...]:
        """Names of the values that have a meaning where the channels have some roles."""

    @classmethod
    @abstractmethod
    def required(cls, roles: Collection[str] = frozenset()) -> tuple[str, ...]:
        """Names of the values that a rig file must state where the channels have some roles."""

    @classmethod
    def uncertain(cls) -> tuple[str, ...]:
        """Names of the values beside which a standard uncertainty may stand: all but one that is itself one."""
        return tuple(name for name in cls.symbols() if name != "unread_force")


MEANINGS: Mapping[str, str] = MappingProxyType(
    {
        "m1": "mass of the carriage, kg",
        "m2": "mass of the tipping part, kg",
        "m3": "specification mass of the recoiling part, or of the body on a line, kg",
        "J1": "moment of inertia of the carriage about C, kg m2",
        "J2": "moment of inertia of the tipping part about the trunnion A, kg m2",
        "J3c": "moment of inertia of the recoiling part about its centre of mass, kg m2",
        "X1": "centre of mass of the carriage ahead of C, carriage axes, m",
        "Y1": "centre of mass of the carriage above C, carriage axes, m",
        "XA": "trunnion A ahead of C, carriage axes, m",
        "YA": "trunnion A above C, carriage axes, m",
        "s2": "centre of mass of the tipping part from A along the bore, m",
        "d2": "centre of mass of the tipping part from A across the bore, m",
        "b": "centre of mass of the recoiling part in battery from A along the bore, m",
        "d": "centre of mass of the recoiling part in battery from A across the bore, m",
        "e": "offset of the breech force's line above the recoiling part's centre of mass, m",
        "L": "distance of the ground contact D ahead of C, m",
        "f": "friction coefficient of the ground contact D",
        "phi10": "angle of the carriage's axis over the horizontal in battery, rad",
        "phi20": "angle over the horizontal of the driving direction, of a gun before the shot, rad",
        "g": "acceleration of gravity, m/s2",
        "bore_area": "area that the breech pressure acts on, m2",
        "brake_area": "area that the brake pressure acts on, m2",
        "recuperator_area": "area that the recuperator pressure acts on, m2",
        "friction": "packing friction that no gauge reads, N",
        "bore_friction": "share of the breech's force that the projectile's friction in the bore takes off",
        "muzzle_brake": "share of the breech's force that a muzzle brake takes off once the projectile is out",
        "projectile_mass": "mass of the projectile, kg; a muzzle brake needs it",
        "bore_length": "travel of the projectile to its exit, m; a muzzle brake needs it",
        "tube_axial_hz": "first mode of the tube along its axis, Hz; 0 for none that is stated",
        "unread_share": "share by which the resistance that is read falls short of the whole",
        "unread_force": "what else resists or pushes unread: standard uncertainty as a share of the peak resistance",
        "slide_friction": "viscous friction of slides and seals, N s/m",
        "carried_mass": "oil and rods that move along beside m3, kg; for the comparison with the specification only",
    }
)
"""Symbol -> what it is, with its unit."""
UNITS: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("m1", "m2", "m3", "projectile_mass", "carried_mass"), "kg"),
        **dict.fromkeys(("J1", "J2", "J3c"), "kg m2"),
        **dict.fromkeys(("X1", "Y1", "XA", "YA", "s2", "d2", "b", "d", "e", "L", "bore_length"), "m"),
        **dict.fromkeys(("phi10", "phi20"), "rad"),
        **dict.fromkeys(("bore_area", "brake_area", "recuperator_area"), "m2"),
        **dict.fromkeys(("f", "bore_friction", "muzzle_brake", "unread_share", "unread_force"), ""),
        "g": "m/s2",
        "friction": "N",
        "slide_friction": "N s/m",
        "tube_axial_hz": "Hz",
    }
)
"""Symbol -> its unit, and that of its standard uncertainty; empty for a share."""
