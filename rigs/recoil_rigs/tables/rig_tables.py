"""The tables of a rig file: sources, sensors, channels, and how clocks are aligned.

Types are strict, see `recoil_acquisition.declaration`.
"""

from __future__ import annotations

import datetime as dt
import fnmatch
import math
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from recoil_acquisition.declaration import DeclaredTable, Finite, NotNegative, Pair, Positive, Text
from recoil_acquisition.live_kind import live_kind_of
from recoil_acquisition.quantity import SI_UNITS, Unit, find_unit
from recoil_rigs.tables.sensitivity import Sensitivity, bare_sensitivity, output_from_text, sensitivity_from_text

GAUGE_ROLES = ("breech_pressure", "brake_pressure", "recuperator_pressure")
"""Roles that several channels may bear: gauges of one pressure."""
FORCE_ROLES = ("driving_force", "resisting_force")
"""Roles that several channels may bear, each a force of its own that adds to the others: load cells of a line."""
FORCE_SENSOR_ROLES = (*GAUGE_ROLES, *FORCE_ROLES)
"""Roles of what reads a force: a gauge of its pressure, or a load cell."""
LINE_ROLES = (*FORCE_ROLES, "recoil_velocity")
"""Roles that only a body on a line has."""
CARRIAGE_ACCELERATIONS = ("carriage_acceleration_x", "carriage_acceleration_y")
"""Roles of the accelerometers on the carriage, in the order of the carriage's axes."""
ROLES = MappingProxyType(
    {
        "recoil_acceleration": "acceleration",
        "carriage_acceleration_x": "acceleration",
        "carriage_acceleration_y": "acceleration",
        "carriage_rate": "angular_rate",
        "tipping_rate": "angular_rate",
        "carriage_angular_acceleration": "angular_acceleration",
        "tipping_angular_acceleration": "angular_acceleration",
        "breech_pressure": "pressure",
        "brake_pressure": "pressure",
        "recuperator_pressure": "pressure",
        "recoil_displacement": "displacement",
        "recoil_velocity": "velocity",
        "driving_force": "force",
        "resisting_force": "force",
        "ground_force_x": "force",
        "ground_force_y": "force",
        "ground_force_d": "force",
        "ground_friction_d": "force",
        "elevating_moment": "torque",
        "trigger": "voltage",
    }
)
"""Role -> the quantity that its channel must have; each but the trigger's enters the estimate.

The ground's forces are those on the carriage, positive forward and up: ``x`` and ``y`` at its base point C, ``d``
upward and ``friction_d`` forward at the contact D. The elevating gear's moment is that on the tipping part,
positive if it raises the muzzle. On a line a driving force is positive where it drives, a resisting one where it
resists.
"""
CARRIED_ROLES = tuple(
    role for role in ROLES if role.partition("_")[0] in ("carriage", "tipping", "ground", "elevating")
)
"""Roles on carriage, tipping part and ground, of which a line has none."""

SourceKind = Literal["dewetron", "can", "serial", "camera"]


class MotionAlignment(DeclaredTable):
    """Align a source by a motion that the reference clock has in another quantity.

    What may be compared says `MOTIONS`. A camera may be aligned ``against`` the breech pressure: by the motion that
    the forces drive. ``channel`` is the source's; without it its travel, or its one channel that ``against`` can be
    compared with.
    """

    method: Literal["motion"]
    against: Text = Field(description="the name of the reference clock's channel of that motion")
    channel: Text | None = None
    """Name of the source's channel that moves; its travel, or the one that fits, if left out."""
    drift_allowance: NotNegative = 5e-5
    """Share by which the source's clock may run fast or slow where the records cannot tell; 1e-6 is 1 ppm."""


class RedundantAlignment(DeclaredTable):
    """Align a source by one of its channels that repeats a channel of the reference clock."""

    method: Literal["redundant"]
    channel: Text = Field(description="the name of the source's channel")
    against: Text = Field(description="the name of the reference clock's channel that it repeats")
    drift_allowance: NotNegative = 5e-5
    """Share by which the source's clock may run fast or slow where the records cannot tell; 1e-6 is 1 ppm."""


class TriggerAlignment(DeclaredTable):
    """Align a source by the trigger edge that one of its channels recorded."""

    method: Literal["trigger"]
    channel: Text = Field(description="the name of the source's channel that recorded the edge")
    drift_allowance: NotNegative = 5e-5
    """Share by which the source's clock may run fast or slow where the records cannot tell; 1e-6 is 1 ppm."""


class ExposureAlignment(DeclaredTable):
    """Align a camera by the pulses of its exposures, which ``channel`` of the reference clock recorded.

    A pulse rises where an exposure starts. Where the recorder has more pulses than the track has frames, ``against``,
    the recoiling part's accelerometer, decides which pulse is which frame's.
    """

    method: Literal["exposure"]
    channel: Text = Field(description="the name of the reference clock's channel that recorded the pulses")
    against: Text | None = None
    """Name of the reference clock's channel of the motion, which says which pulse is which frame's."""
    drift_allowance: NotNegative = 5e-5
    """Share by which the source's clock may run fast or slow where the records cannot tell; 1e-6 is 1 ppm."""


class FixedAlignment(DeclaredTable):
    """Take the offset as known: ``t_ref = (1 + drift) * t_source + offset_s``."""

    method: Literal["fixed"]
    offset_s: Finite = Field(description="the reference clock's time at the source's zero, s")
    u_offset_s: NotNegative = 0.0
    """Standard uncertainty of `offset_s`, s."""
    drift: Finite = 0.0
    """Share by which the source's clock runs slow; 1e-6 is 1 ppm."""
    u_drift: NotNegative = 0.0
    """Standard uncertainty of `drift`."""


Alignment = Annotated[
    MotionAlignment | RedundantAlignment | TriggerAlignment | ExposureAlignment | FixedAlignment,
    Field(discriminator="method"),
]

MOTIONS = MappingProxyType(
    {
        "displacement": ("acceleration", "velocity"),
        "velocity": ("acceleration", "displacement"),
        "acceleration": ("velocity",),
        "angular_rate": ("angular_acceleration",),
        "angular_acceleration": ("angular_rate",),
    }
)
"""Quantity of a source's channel -> quantities that the same motion may have on the reference clock.

They are one integral apart, or two where the travel is the source's. A travel on the reference clock is not
differentiated twice: what noise that leaves determines no offset.
"""


KIND_OF_KEY = MappingProxyType(
    {
        "database": "can",
        "bus": "can",
        "counters": "can",
        "framing": "serial",
        "frame_rate": "camera",
        "u_frame_rate": "camera",
        "scale_mm_per_px": "camera",
        "exposure_s": "camera",
        "exposure_stamp": "camera",
        "sees": "camera",
    }
)
"""Key of a source -> the one kind that has it."""


LAYOUT_KINDS = ("dewetron", "camera")
"""Kinds of source whose files may be tables of text that do not state their own layout."""


SHOT_PLACE = "{shot}"
"""Place of the shot's number in the names of a source's files, in its ``match``."""


class Source(DeclaredTable):
    """One recorder, bus, port or camera; its name is also the name of its clock.

    ``bus`` says which bus of a CAN log it is; sources that all say so may share one file.
    ``match`` is a glob of its files' names; `SHOT_PLACE` in it is where the shot's number stands. A file that is
    dropped into the watched folder is complete when it has not changed for ``settle_s``.
    """

    name: Text = Field(description="a name for the source and its clock")
    kind: SourceKind = Field(description="'recorder', 'can', 'serial' or 'camera'")
    match: str | None = None
    """Pattern of its files' names, such as ``"*_daq*.csv"``; ``{shot}`` in it stands where the shot's number is."""
    settle_s: NotNegative = 1.0
    """Time without change after which a dropped file, live, is taken as whole, s."""
    database: str | None = None
    """The file of a bus's messages, beside the rig file: DBC, KCD, SYM or ARXML."""
    bus: Annotated[int, Field(ge=0)] | Text | None = Field(
        default=None, description="the number of a bus of the log, not negative, or its name such as 'can0'"
    )
    """Bus of a log, or of a device that delivers several, that the source is; all where it is left out."""
    counters: Annotated[tuple[Text, ...], Field(strict=False)] | None = None
    """Signals of a bus that count messages, such as ``["Node.counter"]``: a gap is a lost one."""
    framing: dict[str, Any] | None = None
    """Framing that cuts a serial stream into frames, see ``[source.framing]``."""
    frame_rate: Positive | None = None
    """Frames per second, as set at the camera."""
    u_frame_rate: NotNegative | None = None
    """Standard uncertainty of the frames per second of its file, beside what its clock may run fast or slow; if left
    out, that of rounding where a frame takes whole microseconds and the frames per second are no whole number, else
    none."""
    scale_mm_per_px: Positive | None = None
    """Millimetres per pixel; needed where the file is in pixels."""
    layout: dict[str, Any] | None = None
    """Places of columns in a recorder's or a camera's table of text that does not say so itself."""
    exposure_s: Positive | None = None
    """Time for which a frame is exposed, s: the instant of a frame is the middle of it."""
    exposure_stamp: Literal["start", "middle", "end"] | None = None
    """Instant of its exposure that the time of a frame is; the start if left out."""
    sees: Literal["tipping_part", "ground"] | None = None
    """Body that it sees the recoil against: ``tipping_part`` where it moves with that, so that it sees the travel along
    the bore, or ``ground`` where it stands on a tripod, so that the carriage's motion is in what it sees; the tipping
    part if left out."""
    device: dict[str, Any] | None = None
    """Device that is opened live, see ``device``."""
    align: Alignment | None = None
    """Way in which its clock is found on the reference clock, see ``align``; needed of every other source."""

    @field_validator("kind", mode="before")
    @classmethod
    def _any_recorder(cls, kind: Any) -> Any:
        """Take ``recorder``, which means any, for what the readers of recorders' files call themselves."""
        return "dewetron" if kind == "recorder" else kind

    @model_validator(mode="after")
    def _fits_its_kind(self) -> Source:
        faults = [
            f"a {self.kind} source has no `{key}`, only a {kind} source has"
            for key, kind in KIND_OF_KEY.items()
            if self.kind != kind and getattr(self, key) is not None
        ]
        if self.layout is not None and self.kind not in LAYOUT_KINDS:
            faults.append(f"a {self.kind} source has no `layout`: its files are no tables of text")
        if self.exposure_stamp is not None and self.exposure_s is None:
            faults.append("`exposure_stamp` needs `exposure_s`")
        if self.frame_rate is not None and self.exposure_s is not None and self.exposure_s * self.frame_rate > 1.0:
            faults.append(f"`exposure_s` is longer than a frame, {1.0 / self.frame_rate:.4g} s")
        if isinstance(self.align, ExposureAlignment) and self.kind != "camera":
            faults.append(f"a {self.kind} source has no exposures to be aligned by")
        if self.device is not None and live_kind_of(self.kind, self.device) is None:
            faults.append(f"a {self.kind} source has no `device`: its files are handed over after the shot")
        if self.match is not None and self.match.count(SHOT_PLACE) > 1:
            faults.append(f"`match` has `{SHOT_PLACE}` more than once, which is the one place of the shot's number")
        if self.kind == "can" and self.database is None:
            faults.append('a can source needs `database = "<file>.dbc"`')
        if self.kind == "serial" and self.framing is None:
            faults.append("a serial source needs `framing = { ... }`")
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @property
    def pattern(self) -> re.Pattern[str] | None:
        """Pattern of `match`, without regard to case; the shot's number is its group ``shot``."""
        if self.match is None:
            return None
        place = "\ue000"  # a letter that globs and regular expressions leave alone
        text = fnmatch.translate(self.match.replace(SHOT_PLACE, place))
        return re.compile(text.replace(place, r"(?P<shot>[0-9]{1,9})"), re.IGNORECASE)


USUAL_U_ZERO_REL = 1e-3
"""Share of the range by which a gauge's zero may move in a shot: thermal shock of a good gauge."""
UNRESTED_U_ZERO_REL = 1e-2
"""Share of its range by which the zero of an accelerometer may be off that was not seen at rest."""
USUAL_U_DISTORTION_M = 1e-4
"""Length by which a camera's optics may bend a travel."""
USUAL_U_LINE_S = 2e-3
"""Delay by which an orifice or a line before a recuperator's gauge may make it late."""


class GaugeAhead(DeclaredTable):
    """Place of a breech gauge that sits ahead of the breech face, at the chamber's mouth.

    It reads low by ``u_share`` or less while the projectile is near: ``p (1 - e (L0 / (L0 + x))^2)`` with the chamber's
    length L0 and the projectile's travel x.
    """

    chamber_length_m: Positive
    """Length of the chamber, m."""
    projectile_mass_kg: Positive
    """Mass of the projectile, kg."""
    u_share: NotNegative
    """Standard uncertainty of the share e: half of charge over projectile, times the square of the gauge's place
    between face and projectile."""


class Sensor(DeclaredTable):
    """One sensor, its calibration and its chain. Positions in metres, in its body's axes.

    ``delay_s`` is the delay of the whole chain behind the sensor, its anti-alias filter included; without it that of
    ``filter_hz`` counts, by ``filter_type`` and ``filter_order``. ``resonance_hz`` and ``resonance_damping`` are those
    of the sensor on its mount, and come on top. The 0 of a ``u_rel`` that is left out is no statement, see
    `states_u_rel`. Sensors that name one ``reference`` are off together by what their standard is off.

    ``gain`` and ``offset`` are what a newer calibration says of the values as recorded, before the polarity:
    ``gain * value + offset``, both in the channel's unit, in SI without one or where the chain is recorded in volts.
    """

    model: str = ""
    """The sensor's type."""
    serial: str = ""
    """Serial number, by which the sensor is known from shot to shot."""
    certificate: str = ""
    """Number of its certificate."""
    calibrated: dt.date | None = None
    """Date of its certificate."""
    due: dt.date | None = None
    """Date by which it is to be calibrated again; ``check`` refuses one before the day of the files, or today."""
    u_rel: NotNegative = 0.0
    """Relative standard uncertainty of its scale, 1 % is 0.01; must be written where the role enters the estimate."""
    reference: str = Field(default="", description="the standard that it was calibrated against, as a name")
    u_reference_rel: NotNegative = Field(default=0.0, description="the part of `u_rel` that the standard brings")
    u_zero_rel: NotNegative | None = Field(
        default=None, description="a share of the range, not negative, by which the zero may move"
    )
    u_linearity_rel: NotNegative | None = Field(
        default=None, description="a share of full scale, not negative, of a pressure gauge"
    )
    """Standard uncertainty of what its line is bent by, half of it in the middle, and of its hysteresis; none where it
    is left out."""
    gauge_ahead: GaugeAhead | None = None
    """Place of a breech gauge ahead of the breech face, see ``gauge_ahead``; at the face if left out."""
    u_distortion_m: NotNegative | None = Field(
        default=None, description="a length in m, not negative, by which optics may bend a travel"
    )
    range: Pair | None = Field(default=None, description="an array [lowest, highest] in the channel's unit")
    gain: Positive = Field(default=1.0, description="a positive factor on the recorded values, by a newer calibration")
    u_gain: NotNegative = Field(default=0.0, description="the standard uncertainty of `gain`, not negative")
    offset: Finite = Field(default=0.0, description="a number in the channel's unit, added after `gain`")
    sensitivity: Positive | Text | None = Field(
        default=None,
        description=(
            'a text as on the certificate, such as "40 mV/MPa", or a positive number per SI unit with '
            "`sensitivity_unit`, of a channel that is recorded in volts"
        ),
    )
    sensitivity_unit: Literal["pC", "mV", "V"] | None = None
    """Unit of a `sensitivity` that is a bare number, per SI unit: 40 and ``"mV"`` are 40 mV per pascal."""
    zero: Text | None = None
    """Output at zero with its unit, such as ``"2.5 V"``, of a channel that is recorded in what the chain gives out and
    whose `sensitivity` is stated: the bias of most capacitive accelerometers. It moves no `range`."""
    amplifier: Positive = 1.0
    """V per pC of a charge amplifier, V per mA, V per mV/V of a bridge; the gain where the sensor gives out volts."""
    time_constant_s: Positive | None = None
    """Time constant with which a piezoelectric chain loses its charge, s."""
    u_time_constant_s: NotNegative | None = None
    """Standard uncertainty of `time_constant_s`, s."""
    filter_hz: Positive | None = None
    """Cut-off of its anti-alias filter, Hz, whose delay is taken off."""
    filter_type: Literal["bessel", "butterworth"] | None = None
    """Characteristic of that filter."""
    filter_order: Annotated[int, Field(ge=1, le=25)] | None = None
    """Order of that filter."""
    delay_s: NotNegative = 0.0
    """Delay of the whole chain, its filter included, s, in place of what `filter_hz` says."""
    u_delay_s: NotNegative | None = None
    """Standard uncertainty of the delay, s."""
    resonance_hz: Positive | None = None
    """Resonance of the sensor on its mount, Hz, whose delay is taken off."""
    resonance_damping: NotNegative | None = None
    """Damping of that resonance, share of the critical one."""
    position: Pair = (0.0, 0.0)
    """Place ``[along, across]`` from its body's reference point, in the body's axes, m: A for the carriage's
    accelerometers, the centre of mass for the recoiling part's, and for its mark that a camera on the ground sees."""

    @field_validator("sensitivity")
    @classmethod
    def _is_a_sensitivity(cls, sensitivity: float | str | None) -> float | str | None:
        """Refuse what is no sensitivity."""
        if isinstance(sensitivity, str):
            sensitivity_from_text(sensitivity)
        return sensitivity

    @field_validator("zero")
    @classmethod
    def _is_an_output(cls, zero: str | None) -> str | None:
        """Refuse what is no output."""
        if zero is not None:
            output_from_text(zero)
        return zero

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Sensor:
        faults = []
        if self.zero is not None and self.sensitivity is None:
            faults.append("`zero` needs `sensitivity`: without it nothing says what an output means")
        if self.range is not None and not self.range[0] < self.range[1]:
            faults.append("`range` must be [lowest, highest]")
        if isinstance(self.sensitivity, str):
            if self.sensitivity_unit is not None:
                faults.append(f"`sensitivity_unit` is in {self.sensitivity!r} already: leave it out")
        elif (self.sensitivity is None) != (self.sensitivity_unit is None):
            faults.append("`sensitivity` and `sensitivity_unit` go together")
        if self.u_reference_rel and not self.reference:
            faults.append("`u_reference_rel` needs `reference`, the standard's name")
        if self.u_reference_rel > self.u_rel:
            faults.append("`u_reference_rel` is a part of `u_rel` and cannot be larger")
        if self.filter_hz is None and (self.filter_type is not None or self.filter_order is not None):
            faults.append("`filter_type` and `filter_order` need `filter_hz`")
        if self.time_constant_s is None and self.u_time_constant_s is not None:
            faults.append("`u_time_constant_s` needs `time_constant_s`")
        if self.filter_type is None and self.filter_order is not None:
            faults.append("`filter_order` needs `filter_type`")
        if (self.resonance_hz is None) != (self.resonance_damping is None):
            faults.append("`resonance_hz` and `resonance_damping` go together")
        if self.calibrated is not None and self.due is not None and self.due < self.calibrated:
            faults.append("`due` lies before `calibrated`")
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @property
    def u_scale_rel(self) -> float:
        """Relative standard uncertainty of the scale: ``u_rel``, and what is uncertain of ``gain``."""
        return math.hypot(self.u_rel, self.u_gain / self.gain) if self.u_gain else self.u_rel

    @property
    def u_moving_zero_rel(self) -> float:
        """Share of the range by which the zero may move in a shot, a usual one where none is stated."""
        return USUAL_U_ZERO_REL if self.u_zero_rel is None else self.u_zero_rel

    @property
    def u_bent_m(self) -> float:
        """Length by which a camera's optics may bend a travel, a usual one where none is stated."""
        return USUAL_U_DISTORTION_M if self.u_distortion_m is None else self.u_distortion_m

    @property
    def states_u_rel(self) -> bool:
        """Whether ``u_rel`` was written down."""
        return "u_rel" in self.model_fields_set


class ChannelSpec(DeclaredTable):
    """One channel: which signal of which source it is, what it measures and with which sensor."""

    name: Text = Field(description="a name for the channel")
    source: Text = Field(description="the name of the source that records it")
    signal: Text = Field(description="the signal's name in the source's files, without its unit")
    quantity: Text = Field(description="the quantity that it measures, such as acceleration, pressure, angular_rate")
    unit: str | None = None
    """Unit of the file's numbers where the file states none, and of `range` and `offset`, which are in SI without it.
    Where volts are recorded those two are in the unit that `sensitivity` is per."""
    role: str = ""
    """Role in the equation of motion, see the roles; leave it out if it has none."""
    polarity: Literal[1, -1] = 1
    """-1 turns the record, where the sensor is mounted the other way round."""
    sensor: Sensor = Sensor()
    """The sensor that measures it."""

    @property
    def sensitivity(self) -> Sensitivity | None:
        """The sensor's sensitivity, whose bare number is per SI unit of the channel's quantity."""
        stated = self.sensor.sensitivity
        if stated is None or isinstance(stated, str):
            return None if stated is None else sensitivity_from_text(stated)
        return bare_sensitivity(stated, self.sensor.sensitivity_unit or "V", SI_UNITS[self.quantity])

    @property
    def measured_at_zero_si(self) -> float:
        """Reading that `zero` of the sensor would be without a bias, SI: it is taken off where the chain applies."""
        sensitivity, zero = self.sensitivity, self.sensor.zero
        if sensitivity is None or zero is None:
            return 0.0
        value, unit = output_from_text(zero)
        return unit.to_si(value) * sensitivity.per_recorded(unit, self.sensor.amplifier)

    @property
    def own_unit(self) -> Unit | None:
        """Unit of what is measured: ``unit`` where it is one, else that of a sensitivity in words; None for SI."""
        return None if (name := self.own_unit_name) is None else find_unit(name)

    @property
    def own_unit_name(self) -> str | None:
        """Spelling of `own_unit`."""
        unit = find_unit(self.unit) if self.unit is not None else None
        stated = sensitivity_from_text(self.sensor.sensitivity) if isinstance(self.sensor.sensitivity, str) else None
        is_of_the_chain = stated is not None and unit is not None and stated.turned_into(unit)
        if unit is not None and self.quantity in unit.quantities and not is_of_the_chain:
            return self.unit
        return None if stated is None else stated.per_name

    @property
    def u_line_s(self) -> float:
        """Delay by which a recuperator's gauge may be late of whose delay the rig file says nothing, s; else 0."""
        says = {"delay_s", "u_delay_s"} & self.sensor.model_fields_set
        return 0.0 if says or self.role != "recuperator_pressure" else USUAL_U_LINE_S

    @property
    def enters_estimate(self) -> bool:
        """Whether the channel's role is one of which the estimate is made: any but the trigger's."""
        return self.role in ROLES and self.role != "trigger"


USUAL_GAIN = (0.8, 1.25)
"""Gains by which a newer calibration corrects values; beyond them it is the scale of counts."""
LARGEST_CORRECTION = 0.1
"""Share of its range by which a newer calibration may move a sensor's zero; beyond it the sensor has a bias."""


def range_si(spec: ChannelSpec) -> tuple[float, float] | None:
    """Return the sensor's declared range in SI; its numbers are in the channel's unit, or SI without one.

    It is the certificate's, whatever a bias and a scale make of the file's numbers. Only what corrects engineering
    units by a little moves it with them: such a record is clipped where its recorded values reach the range.
    """
    sensor = spec.sensor
    if sensor.range is None:
        return None
    unit, (low, high) = spec.own_unit, sensor.range
    shift = spec.polarity * sensor.offset
    if USUAL_GAIN[0] <= sensor.gain <= USUAL_GAIN[1] and abs(shift) <= LARGEST_CORRECTION * (high - low):
        low, high = sensor.gain * low + shift, sensor.gain * high + shift
    return (low, high) if unit is None else (unit.to_si(low), unit.to_si(high))


def names_in(tables: Mapping[str, Any], key: str) -> list[str]:
    """Return the names in an array of tables, those of faulty ones too, so that one fault does not cause others."""
    rows = tables.get(key, [])
    if not isinstance(rows, list):
        return []
    return [row["name"] for row in rows if isinstance(row, dict) and isinstance(row.get("name"), str)]


def roles_in(tables: Mapping[str, Any]) -> frozenset[str]:
    """Return the roles of a rig's channels, also of faulty ones."""
    rows = tables.get("channel", [])
    found = (row.get("role") for row in rows if isinstance(row, dict)) if isinstance(rows, list) else ()
    return frozenset(role for role in found if isinstance(role, str) and role)


def quantities_in(tables: Mapping[str, Any]) -> dict[str, str]:
    """Return the quantities of a rig's channels by name, also of faulty ones; empty where none is known."""
    rows = tables.get("channel", [])
    found = {row["name"]: row.get("quantity") for row in rows if isinstance(row, dict) and "name" in row}
    return {name: str(found[name]) if found[name] in SI_UNITS else "" for name in names_in(tables, "channel")}
