"""Where an error comes from: what a row of the budget, a prior of a sensor or a part of a scale is about.

It is its name, as budgets, reports and reasons print it, and is made here alone: whoever decides by a source asks for
its kind and for what it is of, and never takes its name apart. It lies in this room because the parts of the sensors'
scales (`recoil_processing.shot.sensor_scales`) and the errors of the force
(`recoil_processing.shot.clocks.estimator_inputs`) are sources too, and no lower room makes one.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Any, Self


class SourceGroup(StrEnum):
    """Group of sources of error, by what a better one would take: another sensor, a test of forces, a quieter shot."""

    SENSORS = "sensors"
    """What gauges, camera, their clocks and their zeros may be off by."""
    UNREAD_FORCES = "unread forces"
    """Forces that no gauge reads."""
    MOTION_NOISE = "motion noise"
    """What is left at random of the shot's own rows, and of choices among them."""
    GEOMETRY = "geometry"
    """Lengths, areas and masses that the rig file and the shot log state."""


class SourceKind(StrEnum):
    """Kind of a source of error: how a file spells it, the name of its sources, and the group that they belong to.

    Attributes
    ----------
    named
        Name of the kind's sources, with the places of what they are of and of the further words.
    group
        Group in which a budget adds them up.
    """

    named: str
    group: SourceGroup

    def __new__(cls, value: str, named: str, group: SourceGroup) -> Self:
        """Keep what the row states."""
        self = str.__new__(cls, value)
        self._value_, self.named, self.group = value, named, group
        return self

    RANDOM = "random", "random errors of this shot", SourceGroup.MOTION_NOISE
    """Noise of the rows themselves."""
    SENSITIVITY = "sensitivity", "{of} sensitivity", SourceGroup.SENSORS
    """Scale of a role's sensor, or of one of several gauges of a pressure."""
    DYNAMIC_SCALE = "dynamic scale", "{of} dynamic scale", SourceGroup.SENSORS
    """Scale of a gauge in a pulse, beside that at rest; of a role's gauge, or of one of several."""
    FORCE_SCALE = "force scale", "{of} sensitivity and area", SourceGroup.SENSORS
    """Scale of a gauge with its piston's area, where the area has no row of its own."""
    CAMERA_SCALE = "camera scale", "camera scale", SourceGroup.SENSORS
    SCALE = "scale", "{of} scale", SourceGroup.SENSORS
    """Scale of a sensor in the equations of motion of all bodies."""
    SCALE_AND_AREA = "scale and area", "{of} scale and area", SourceGroup.SENSORS
    """Scale of a gauge in those equations, with its piston's area."""
    AREA = "area", "{of}", SourceGroup.GEOMETRY
    """Area that the rig declares."""
    DECLARED = "declared", "{of}", SourceGroup.GEOMETRY
    """Length or angle that the rig declares."""
    STANDARD = "standard", "standard {of}", SourceGroup.SENSORS
    """Calibration standard that several sensors share."""
    FRICTION = "friction", "packing friction", SourceGroup.UNREAD_FORCES
    """Packing friction."""
    SLIDE_FRICTION = "slide friction", "slide friction", SourceGroup.UNREAD_FORCES
    """Viscous friction of slides and seals."""
    UNREAD_SHARE = "unread share", "share of the resistance that no gauge reads", SourceGroup.UNREAD_FORCES
    """Share by which the resistance that gauges read falls short of the whole."""
    UNREAD_FORCE = "unread force", "force of unknown shape that no gauge reads", SourceGroup.UNREAD_FORCES
    """Force of unknown shape along the travel that no gauge reads, all its shapes together."""
    UNREAD_SHAPE = "unread shape", "shape {detail} of the force that no gauge reads", SourceGroup.UNREAD_FORCES
    """One of its shapes."""
    FORCE_LINE = "force line", "force line", SourceGroup.GEOMETRY
    """Distance between the line of the forces and the centre of mass."""
    ZERO = "zero", "{of} zero", SourceGroup.SENSORS
    MOVING_ZERO = "moving zero", "{of} zero that moves in {detail} ms", SourceGroup.SENSORS
    """Zero of a gauge that moves at the shot with a time constant."""
    REPAIR = "repair", "{of} {detail}", SourceGroup.SENSORS
    """Remainder of a disturbance that was repaired."""
    LOST_SAMPLES = "lost samples", "samples lost at {detail} ms", SourceGroup.SENSORS
    BRIDGED = "bridged", "{of} bridged samples", SourceGroup.SENSORS
    """What bridges lost samples of a role, where no low-pass notices it."""
    BRIDGED_SHAPE = "bridged shape", "{of} bridged samples, shape {detail}", SourceGroup.SENSORS
    """Part of that, a shape of known form and unknown size."""
    NOT_RECORDED = "not recorded", "{of}, not recorded", SourceGroup.SENSORS
    """Motion that no sensor recorded."""
    RELEASE = "release", "release from the battery stop", SourceGroup.UNREAD_FORCES
    """Velocity that the battery stop gives the part."""
    GAS = "gas", "gas left in the bore", SourceGroup.UNREAD_FORCES
    """Pressure left in a bore that is taken for empty."""
    SKEW = "skew", "skew of acceleration and force", SourceGroup.SENSORS
    """Delay between the chains of acceleration and force."""
    DELAY = "delay", "{of} delay", SourceGroup.SENSORS
    """Delay of a gauge's chain."""
    LINE = "line", "{of} delay of its line", SourceGroup.SENSORS
    """Delay of the line or orifice between a gauge and what it measures, of which the rig says nothing."""
    ALIGNMENT = "alignment", "alignment of clock {of}", SourceGroup.SENSORS
    """Offset of a clock."""
    CLOCK_RATE = "clock rate", "rate of clock {of}", SourceGroup.SENSORS
    CAMERA_LATE = "camera late", "camera late", SourceGroup.SENSORS
    """Rest of the camera clock's offset, which its frames tell."""
    CAMERA_GAIN = "camera gain", "camera alignment", SourceGroup.SENSORS
    """Ratio of the scales of camera and accelerometer, by which the camera's clock was aligned."""
    PLACE = "place", "place before the shot", SourceGroup.SENSORS
    """Place of the part before the shot."""
    PICTURE = "picture", "{detail} of the camera's picture", SourceGroup.SENSORS
    """Shape in which optics bend the camera's picture."""
    CARRIAGE_PART = "carriage part", "the carriage's part of the travel too large", SourceGroup.SENSORS
    """Scale of the carriage's part of the travel that a camera sees."""
    CARRIAGE_ZERO = "carriage zero", "zero of the carriage's part of the travel", SourceGroup.SENSORS
    """Zero of that part."""
    GAUGE_DIFFERENCE = "gauge difference", "{detail} of the gauges of {of}", SourceGroup.SENSORS
    """Zero or delay of a difference of several gauges of one pressure."""
    # one shot cannot tell a mass that changes from a force that no gauge reads
    MASS_CHANGE = "mass change", "change {detail} of ln mass", SourceGroup.UNREAD_FORCES
    """Shape in which the mass may change during the shot."""
    KNOWN_IMPULSE = "known impulse", "declared impulse of {of}", SourceGroup.SENSORS
    """Impulse of a force that the rig declares."""
    KNOWN_LOAD = "known load", "declared load on {of}", SourceGroup.SENSORS
    """Load on a gauge that the rig declares."""
    PARAMETER = "parameter", "{of}", SourceGroup.GEOMETRY
    """Parameter of the mechanism that is held at a value."""
    CHOICE = "choice", "{detail}", SourceGroup.MOTION_NOISE
    """Choice of the analyst."""
    RANDOM_OF_SHOTS = "random of shots", "random errors of the shots", SourceGroup.MOTION_NOISE
    """What each of many shots has of its own: noise, zeros, and how far gains and friction do not repeat."""
    SENSOR_SCALE = "sensor scale", "{of} scale, sensor {detail}", SourceGroup.SENSORS
    """Scale of one sensor in many shots, by its serial number."""
    SENSOR_DYNAMIC = "sensor dynamic scale", "{of} dynamic scale, sensor {detail}", SourceGroup.SENSORS
    """Its scale in a pulse, beside that at rest."""
    BORE_FRICTION = "bore friction", "bore_friction", SourceGroup.UNREAD_FORCES
    """Share of the breech's force that the projectile's friction in the bore takes off."""
    LINEARITY = "linearity", "{of} linearity", SourceGroup.SENSORS
    """Line of a gauge that is bent."""
    HYSTERESIS = "hysteresis", "{of} hysteresis", SourceGroup.SENSORS
    """Reading of a gauge as the pressure falls, beside that as it rises."""
    GAUGE_AHEAD = "gauge ahead", "{of} ahead of the breech face", SourceGroup.SENSORS
    """Pressure between the breech face and a gauge that sits ahead of it."""
    MUZZLE_BRAKE = "muzzle brake", "muzzle_brake", SourceGroup.UNREAD_FORCES
    """Share of the breech's force that a muzzle brake takes off behind the projectile."""
    TUBE = "tube", "tube along its axis", SourceGroup.SENSORS
    """Swing of the tube along its axis."""
    HANGING_PART = "hanging part", "part that hangs elastically", SourceGroup.UNREAD_FORCES
    """Part of the recoiling mass that hangs on it elastically."""
    BREAKAWAY = "breakaway", "friction that breaks away", SourceGroup.UNREAD_FORCES
    """Friction that is larger near to rest."""
    TIME_CONSTANT = "time constant", "{of} time constant", SourceGroup.SENSORS
    """Time constant of an amplifier that nobody declared."""
    UNSTATED = "unstated", "what nobody stated of the breech chain and its like", SourceGroup.SENSORS
    """Shapes that no rig states, each as likely as the shot makes it."""
    ADDED_MASS = "added mass", "added mass of {detail}", SourceGroup.GEOMETRY
    """Mass that was weighed and added to the recoiling part of some shots."""


OF_TIME = (SourceKind.SKEW, SourceKind.DELAY, SourceKind.LINE, SourceKind.ALIGNMENT)
"""Kinds that make something late, instead of reading high or low."""


class ErrorSource(str):
    """Source of an error, by its name.

    Parameters
    ----------
    kind, of, detail
        See the attributes.

    Attributes
    ----------
    kind
        Kind of the source.
    of
        Role, channel, clock, standard or symbol of the mechanism that is off; empty where the kind says all.
    detail
        Further words that tell sources of one kind apart: time constant, repair, instant, shape; empty for none.
    """

    __slots__ = ("detail", "kind", "of")
    kind: SourceKind
    of: str
    detail: str

    def __new__(cls, kind: SourceKind, of: str = "", detail: str = "") -> Self:
        """Spell the name."""
        self = super().__new__(cls, kind.named.format(of=of, detail=detail))
        self.kind, self.of, self.detail = kind, of, detail
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Keep kind and detail where it is given to another process."""
        return type(self), (self.kind, self.of, self.detail)

    @property
    def group(self) -> SourceGroup:
        """Group in which a budget adds it up."""
        return self.kind.group

    @property
    def is_of_time(self) -> bool:
        """True if it makes something late."""
        return self.kind in OF_TIME

    @property
    def is_late_alone(self) -> bool:
        """True if it makes something late and can make nothing early: a line, an orifice."""
        return self.kind is SourceKind.LINE
