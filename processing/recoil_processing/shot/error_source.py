"""Where an error comes from: what a row of the budget, a prior of a sensor or a part of a scale is about.

It is its name, as budgets, reports and reasons print it, and is made here alone: whoever decides by a source asks for
its kind and for what it is of, and never takes its name apart. It lies in this room because the parts of the sensors'
scales (`recoil_processing.shot.sensor_scales`) and the errors of the force
(`recoil_processing.shot.clocks.estimator_inputs`) are sources too, and no lower room makes one.
"""

from __future__ import annotations

from enum import StrEnum
from types import MappingProxyType
from typing import Any, Self


class SourceKind(StrEnum):
    """Kind of a source of error."""

    RANDOM = "random"
    """Noise of the rows themselves."""
    SENSITIVITY = "sensitivity"
    """Scale of a role's sensor, or of one of several gauges of a pressure."""
    FORCE_SCALE = "force scale"
    """Scale of a gauge with its piston's area, where the area has no row of its own."""
    CAMERA_SCALE = "camera scale"
    SCALE = "scale"
    """Scale of a sensor in the equations of motion of all bodies."""
    SCALE_AND_AREA = "scale and area"
    """Scale of a gauge in those equations, with its piston's area."""
    AREA = "area"
    """Area that the rig declares."""
    DECLARED = "declared"
    """Length or angle that the rig declares."""
    STANDARD = "standard"
    """Calibration standard that several sensors share."""
    FRICTION = "friction"
    """Packing friction."""
    SLIDE_FRICTION = "slide friction"
    """Viscous friction of slides and seals."""
    UNREAD_SHARE = "unread share"
    """Share by which the resistance that gauges read falls short of the whole."""
    UNREAD_FORCE = "unread force"
    """Force of unknown shape along the travel that no gauge reads, all its shapes together."""
    UNREAD_SHAPE = "unread shape"
    """One of its shapes."""
    FORCE_LINE = "force line"
    """Distance between the line of the forces and the centre of mass."""
    ZERO = "zero"
    MOVING_ZERO = "moving zero"
    """Zero of a gauge that moves at the shot with a time constant."""
    REPAIR = "repair"
    """Remainder of a disturbance that was repaired."""
    LOST_SAMPLES = "lost samples"
    BRIDGED = "bridged"
    """What bridges lost samples of a role, where no low-pass notices it."""
    BRIDGED_SHAPE = "bridged shape"
    """Part of that, a shape of known form and unknown size."""
    """Samples that were bridged."""
    NOT_RECORDED = "not recorded"
    """Motion that no sensor recorded."""
    RELEASE = "release"
    """Velocity that the battery stop gives the part."""
    GAS = "gas"
    """Pressure left in a bore that is taken for empty."""
    SKEW = "skew"
    """Delay between the chains of acceleration and force."""
    DELAY = "delay"
    """Delay of a gauge's chain."""
    ALIGNMENT = "alignment"
    """Offset of a clock."""
    CLOCK_RATE = "clock rate"
    CAMERA_LATE = "camera late"
    """Rest of the camera clock's offset, which its frames tell."""
    CAMERA_GAIN = "camera gain"
    """Ratio of the scales of camera and accelerometer, by which the camera's clock was aligned."""
    PLACE = "place"
    """Place of the part before the shot."""
    PICTURE = "picture"
    """Shape in which optics bend the camera's picture."""
    CARRIAGE_PART = "carriage part"
    """Scale of the carriage's part of the travel that a camera sees."""
    CARRIAGE_ZERO = "carriage zero"
    """Zero of that part."""
    GAUGE_DIFFERENCE = "gauge difference"
    """Zero or delay of a difference of several gauges of one pressure."""
    MASS_CHANGE = "mass change"
    """Shape in which the mass may change during the shot."""
    KNOWN_IMPULSE = "known impulse"
    """Impulse of a force that the rig declares."""
    KNOWN_LOAD = "known load"
    """Load on a gauge that the rig declares."""
    PARAMETER = "parameter"
    """Parameter of the mechanism that is held at a value."""
    CHOICE = "choice"
    """Choice of the analyst."""
    RANDOM_OF_SHOTS = "random of shots"
    """What each of many shots has of its own: noise, zeros, and how far gains and friction do not repeat."""
    SENSOR_SCALE = "sensor scale"
    """Scale of one sensor in many shots, by its serial number."""
    BORE_FRICTION = "bore friction"
    """Share of the breech's force that the projectile's friction in the bore takes off."""
    LINEARITY = "linearity"
    """Line of a gauge that is bent."""
    HYSTERESIS = "hysteresis"
    """Reading of a gauge as the pressure falls, beside that as it rises."""
    GAUGE_AHEAD = "gauge ahead"
    """Pressure between the breech face and a gauge that sits ahead of it."""
    MUZZLE_BRAKE = "muzzle brake"
    """Share of the breech's force that a muzzle brake takes off behind the projectile."""
    TUBE = "tube"
    """Swing of the tube along its axis."""
    ADDED_MASS = "added mass"
    """Mass that was weighed and added to the recoiling part of some shots."""


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


OF_TIME = (SourceKind.SKEW, SourceKind.DELAY, SourceKind.ALIGNMENT)
"""Kinds that make something late, instead of reading high or low."""
_SPELLED = {
    SourceKind.RANDOM: "random errors of this shot",
    SourceKind.RANDOM_OF_SHOTS: "random errors of the shots",
    SourceKind.SENSITIVITY: "{of} sensitivity",
    SourceKind.SENSOR_SCALE: "{of} scale, sensor {detail}",
    SourceKind.FORCE_SCALE: "{of} sensitivity and area",
    SourceKind.CAMERA_SCALE: "camera scale",
    SourceKind.SCALE: "{of} scale",
    SourceKind.SCALE_AND_AREA: "{of} scale and area",
    SourceKind.AREA: "{of}",
    SourceKind.DECLARED: "{of}",
    SourceKind.BORE_FRICTION: "bore_friction",
    SourceKind.LINEARITY: "{of} linearity",
    SourceKind.HYSTERESIS: "{of} hysteresis",
    SourceKind.GAUGE_AHEAD: "{of} ahead of the breech face",
    SourceKind.MUZZLE_BRAKE: "muzzle_brake",
    SourceKind.TUBE: "tube along its axis",
    SourceKind.ADDED_MASS: "added mass of {detail}",
    SourceKind.STANDARD: "standard {of}",
    SourceKind.FRICTION: "packing friction",
    SourceKind.SLIDE_FRICTION: "slide friction",
    SourceKind.UNREAD_SHARE: "share of the resistance that no gauge reads",
    SourceKind.UNREAD_FORCE: "force of unknown shape that no gauge reads",
    SourceKind.UNREAD_SHAPE: "shape {detail} of the force that no gauge reads",
    SourceKind.FORCE_LINE: "force line",
    SourceKind.ZERO: "{of} zero",
    SourceKind.MOVING_ZERO: "{of} zero that moves in {detail} ms",
    SourceKind.REPAIR: "{of} {detail}",
    SourceKind.LOST_SAMPLES: "samples lost at {detail} ms",
    SourceKind.BRIDGED: "{of} bridged samples",
    SourceKind.BRIDGED_SHAPE: "{of} bridged samples, shape {detail}",
    SourceKind.NOT_RECORDED: "{of}, not recorded",
    SourceKind.RELEASE: "release from the battery stop",
    SourceKind.GAS: "gas left in the bore",
    SourceKind.SKEW: "skew of acceleration and force",
    SourceKind.DELAY: "{of} delay",
    SourceKind.ALIGNMENT: "alignment of clock {of}",
    SourceKind.CLOCK_RATE: "rate of clock {of}",
    SourceKind.CAMERA_LATE: "camera late",
    SourceKind.CAMERA_GAIN: "camera alignment",
    SourceKind.PLACE: "place before the shot",
    SourceKind.PICTURE: "{detail} of the camera's picture",
    SourceKind.CARRIAGE_PART: "the carriage's part of the travel too large",
    SourceKind.CARRIAGE_ZERO: "zero of the carriage's part of the travel",
    SourceKind.GAUGE_DIFFERENCE: "{detail} of the gauges of {of}",
    SourceKind.MASS_CHANGE: "change {detail} of ln mass",
    SourceKind.KNOWN_IMPULSE: "declared impulse of {of}",
    SourceKind.KNOWN_LOAD: "declared load on {of}",
    SourceKind.PARAMETER: "{of}",
    SourceKind.CHOICE: "{detail}",
}
"""Name of each kind's sources."""
KINDS_OF = {
    SourceGroup.SENSORS: (
        SourceKind.SENSITIVITY, SourceKind.SENSOR_SCALE, SourceKind.FORCE_SCALE, SourceKind.CAMERA_SCALE,
        SourceKind.SCALE, SourceKind.SCALE_AND_AREA, SourceKind.STANDARD, SourceKind.ZERO, SourceKind.MOVING_ZERO,
        SourceKind.REPAIR, SourceKind.LOST_SAMPLES, SourceKind.BRIDGED, SourceKind.BRIDGED_SHAPE,
        SourceKind.NOT_RECORDED, SourceKind.SKEW, SourceKind.DELAY, SourceKind.ALIGNMENT, SourceKind.CLOCK_RATE,
        SourceKind.CAMERA_LATE, SourceKind.CAMERA_GAIN, SourceKind.PLACE, SourceKind.PICTURE,
        SourceKind.CARRIAGE_PART, SourceKind.CARRIAGE_ZERO, SourceKind.GAUGE_DIFFERENCE,
        SourceKind.LINEARITY, SourceKind.HYSTERESIS, SourceKind.GAUGE_AHEAD, SourceKind.TUBE,
        SourceKind.KNOWN_IMPULSE, SourceKind.KNOWN_LOAD,
    ),
    SourceGroup.UNREAD_FORCES: (
        SourceKind.FRICTION, SourceKind.BORE_FRICTION, SourceKind.MUZZLE_BRAKE, SourceKind.SLIDE_FRICTION,
        SourceKind.UNREAD_SHARE, SourceKind.UNREAD_FORCE, SourceKind.UNREAD_SHAPE, SourceKind.RELEASE, SourceKind.GAS,
        # one shot cannot tell a mass that changes from a force that no gauge reads
        SourceKind.MASS_CHANGE,
    ),
    SourceGroup.MOTION_NOISE: (SourceKind.RANDOM, SourceKind.RANDOM_OF_SHOTS, SourceKind.CHOICE),
    SourceGroup.GEOMETRY: (
        SourceKind.AREA, SourceKind.DECLARED, SourceKind.FORCE_LINE, SourceKind.PARAMETER, SourceKind.ADDED_MASS,
    ),
}  # fmt: skip
"""Kinds of each group."""
GROUP_OF = MappingProxyType({kind: group for group, kinds in KINDS_OF.items() for kind in kinds})
"""Kind -> its group; every kind has one."""


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
        self = super().__new__(cls, _SPELLED[kind].format(of=of, detail=detail))
        self.kind, self.of, self.detail = kind, of, detail
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Keep kind and detail where it is given to another process."""
        return type(self), (self.kind, self.of, self.detail)

    @property
    def group(self) -> SourceGroup:
        """Group in which a budget adds it up."""
        return GROUP_OF[self.kind]

    @property
    def is_of_time(self) -> bool:
        """True if it makes something late."""
        return self.kind in OF_TIME
