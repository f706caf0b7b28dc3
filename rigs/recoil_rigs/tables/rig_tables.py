"""The tables of a rig file: sources, how clocks are aligned, and the roles of channels.

Types are strict, see `recoil_acquisition.quantities.declaration`.
"""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from recoil_acquisition.devices.can_device import delivers_several_buses
from recoil_acquisition.errors import Fault, FaultCode, FramingError
from recoil_acquisition.files.shot_name import composed
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.live_kind import live_kind_of, live_kinds
from recoil_acquisition.quantities.declaration import DeclaredTable, Finite, NotNegative, Positive, Text, declared
from recoil_acquisition.readers.can.buses import bus_number
from recoil_acquisition.readers.text.layout import TextLayout
from recoil_acquisition.readers.tracks.layout import TrackLayout

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
CARRIAGE_ROLES = (*CARRIAGE_ACCELERATIONS, "carriage_rate", "tipping_rate")
"""Roles whose term in the equation of motion is taken at rest where no channel measures it."""
CARRIED_ROLES = tuple(
    role for role in ROLES if role.partition("_")[0] in ("carriage", "tipping", "ground", "elevating")
)
"""Roles on carriage, tipping part and ground, of which a line has none."""

SourceKind = Literal["dewetron", "can", "serial", "camera"]


class MotionAlignment(DeclaredTable):
    """Align a source by a motion that the reference clock has in another quantity.

    What may be compared says `MOTIONS`. A camera may be aligned ``against`` the breech pressure, and any source of a
    body on a line ``against`` one of its forces, which stands for all: by the motion that the forces drive.
    ``channel`` is the source's; without it its travel, or its one channel that ``against`` can be compared with.
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


class AbsoluteAlignment(DeclaredTable):
    """Align a source by absolute time: what its own start and that of the reference clock say.

    Both clocks must be locked to absolute time, see ``time`` of a source. Where a motion, or a channel that both
    recorded, tells the offset too, it is the second opinion.
    """

    method: Literal["absolute"]
    u_s: Positive | None = None
    """Standard uncertainty of the two clocks' offset, s; if left out, that of their locks: between two by PTP 150 ns,
    by GPS 1 us, by IRIG-B 10 us."""
    channel: Text | None = None
    """Name of the source's channel that the second opinion compares; the recoil's, if left out."""
    against: Text | None = None
    """Name of the reference clock's channel that it is compared with; the recoil's accelerometer, or the channel of the
    same role, if left out."""
    drift_allowance: NotNegative = 5e-5
    """Share by which the source's clock may run fast or slow for the second opinion; 1e-6 is 1 ppm."""


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
    MotionAlignment | RedundantAlignment | TriggerAlignment | ExposureAlignment | AbsoluteAlignment | FixedAlignment,
    Field(discriminator="method"),
]


class AbsoluteTime(DeclaredTable):
    """Absolute time of a recorder's clock, or of this computer's where a bus or a port is read live.

    What a recorder says of its lock itself counts before it.
    """

    by: Literal["ptp", "gps", "irig-b", "free"] = Field(
        description="what the clock is locked to; `free` where to nothing"
    )


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
    required: bool = True
    """Whether a shot waits for it and an armed range needs its device; ``false`` for one that may stay away."""
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
    time: AbsoluteTime | None = None
    """Absolute time that its clock is locked to, see ``time``."""
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
            faults.append(_no_live_kind(self.kind, self.device))
        if self.match is not None and self.match.count(SHOT_PLACE) > 1:
            faults.append(f"`match` has `{SHOT_PLACE}` more than once, which is the one place of the shot's number")
        if self.kind == "can" and self.database is None:
            faults.append('a can source needs `database = "<file>.dbc"`')
        if self.kind == "serial" and self.framing is None:
            faults.append("a serial source needs `framing = { ... }`")
        if faults:
            raise ValueError("; ".join(faults))
        return self

    def contradictions(self) -> list[Fault]:
        """Return what is wrong with its bus, and with framing and layout as its readers will take them."""
        faults = []
        if delivers_several_buses(self.device):
            if self.bus is None:
                problem = "is missing: the device delivers several buses; say which one this source is"
                faults.append(Fault(("bus",), problem, FaultCode.MISSING))
            elif bus_number(self.bus) is None:
                problem = f"{self.bus!r} ends in no number, by which buses are told apart live"
                faults.append(Fault(("bus",), problem, FaultCode.VALUE))
        if self.framing is not None:
            try:
                framing_from_table(self.framing)
            except FramingError as error:
                faults += error.faults
        if self.layout is not None:
            declared(TrackLayout if self.kind == "camera" else TextLayout, self.layout, ("layout",), faults)
        return faults

    @property
    def pattern(self) -> re.Pattern[str] | None:
        """Pattern of `match` for composed names, without regard to case; the shot's number is its group ``shot``."""
        if self.match is None:
            return None
        place = "\ue000"  # a letter that globs and regular expressions leave alone
        text = fnmatch.translate(composed(self.match).replace(SHOT_PLACE, place))
        return re.compile(text.replace(place, r"(?P<shot>[0-9]{1,9})"), re.IGNORECASE)


def _no_live_kind(kind: str, device: Mapping[str, Any]) -> str:
    """Say which kinds of device a source may have, where none is chosen by the keys of its table."""
    fitting = [one for one in live_kinds() if kind in one.source_kinds]
    if not fitting:
        return (
            f"a {kind} source has no `device`: its files are handed over after the shot, and no package that reads one "
            "live is installed"
        )
    keys = ", ".join(f"`{key}`" for key in device) or "no key"
    known = ", ".join(f"`{one.key}`, as {one.example}" for one in fitting)
    return f"a {kind} source's `device` has {keys}, of which none chooses a kind: there is {known}"
