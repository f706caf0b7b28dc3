"""Settings of every virtual rig, whatever moves on it: what is drawn, and how well its instruments measure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from recoil_acquisition.errors import Fault, FaultCode, Row, did_you_mean
from recoil_acquisition.quantities.declaration import NotNegative, Positive
from recoil_rigs.rig import ROLES, RedundantAlignment, Rig
from recoil_rigs.tables.rig_tables import FORCE_SENSOR_ROLES
from recoil_rigs.twin.readings import Readings
from recoil_rigs.twin.unread_forces import UnreadForces

TWIN = "twin"
"""Key of the table of these settings."""

Count = Annotated[int, Field(ge=0, le=1000)]


class RecorderSettings(BaseModel):
    """Settings of the virtual rig, SI units; shares are relative to the full scale of the sensor."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    m3_true: Positive | None = None
    """True recoiling mass, kg; the mechanism's ``m3`` if left out."""
    gain_errors: bool = True
    """Whether each sensor's scale is off by a draw from its ``u_rel``."""
    wander: NotNegative = 0.001
    """Standard deviation by which a force gauge's gain wanders within a shot, where `gain_errors` are drawn: what is
    left of straightness, of hysteresis and of the mechanism's own give."""
    friction_error: bool = True
    """Whether the true packing friction is off by a draw from ``u_friction``."""
    unread_errors: bool = True
    """Whether forces that no gauge reads, the recuperator gauge's delay, and noise in the motion are drawn: from
    ``u_unread_share``, ``unread_force``, ``u_slide_friction``, ``u_carried_mass`` and ``u_delay_s``; else they are what
    the rig file states."""
    unread: UnreadForces = UnreadForces()
    """Forces that no gauge reads, see ``[twin.unread]``."""
    readings: Readings = Readings()
    """Readings that are not what the rig file takes them for, see ``[twin.readings]``."""
    sample_rate_hz: Annotated[float, Field(ge=1000, le=1e6)] = 50e3
    """Sampling rate of the recorder."""
    duration_s: Annotated[float, Field(gt=0, le=60)] = 0.5
    """Length of the record on the reference clock."""
    pre_trigger_s: Positive = 0.05
    """Time from the start of the record to the first rise of the driving force."""
    shot_to_shot: Annotated[float, Field(ge=0, le=0.2)] = 0.01
    """Relative standard deviation of the peak from shot to shot."""
    ringing: NotNegative = 0.5
    """Peak of the stress waves on the recoil accelerometer, relative to the peak of the recoil acceleration."""
    ringing_pressure: NotNegative = 0.005
    """Stress waves on the gauges of the forces, share of full scale where ``ringing`` is 0.5."""
    noise: NotNegative = 0.001
    """Standard deviation of the white noise, share of full scale."""
    bias: NotNegative = 0.0005
    """Standard deviation of the constant offset, share of full scale."""
    zero_shift: float = 0.0
    """Step of the recoil accelerometer's offset at the shot, share of full scale; those on a carriage, which the
    shock reaches by ``ringing_carriage``, shift by that part of it."""
    zero_shift_pressure: float = 0.0
    """Step of these gauges' offset at the shot, share of full scale."""
    hum: NotNegative = 0.0
    """Amplitude of the mains' hum, share of full scale."""
    hum_hz: Positive = 50.0
    """Frequency of the mains."""
    skew_s: dict[str, float] = Field(default_factory=dict)
    """Channel -> by how much it is sampled late, within one recorder."""
    bits: Annotated[int, Field(ge=0, le=32)] = 16
    """Bits of the converters over the sensors' ranges; 0 for none."""
    clock_offset_s: NotNegative = 0.03
    """Largest offset of another clock from the reference clock."""
    clock_drift: Annotated[float, Field(ge=0, le=1e-2)] = 6e-5
    """Largest drift of another clock against the reference clock."""
    camera_noise_m: NotNegative = 5e-5
    """Standard deviation of a marker's position."""
    camera_lost: Count = 4
    """Frames in which the markers were lost."""
    camera_missing: Count = 2
    """Frames that are not in the file."""
    camera_repeated: Count = 1
    """Frames that repeat the picture before them."""
    camera_dropped: Count = 0
    """Frames that are not in the file although its numbers and times go on as if they were."""
    can_format: Literal["blf", "asc"] = "blf"
    """Format of the bus's file."""
    can_rate_hz: Positive = 2000.0
    """Messages of the node per second."""
    can_bitrate_hz: Positive = 1e6
    """Bit rate of the bus."""
    can_jitter_s: NotNegative = 3e-5
    """Mean of the time that a frame waits for the bus."""
    serial_rate_hz: Positive = 1000.0
    """Frames of the serial sensor per second."""
    serial_baudrate: Positive = 921600.0
    """Bits per second of its line."""
    serial_jitter_s: NotNegative = 2e-4
    """Mean of the time by which the host stamps bytes late."""
    serial_dropped_bytes: Count = 3
    """Bytes that the host loses, all in one frame."""
    serial_corrupted_frames: Count = 1
    """Frames in which one bit is flipped."""
    dewesoft_style: Literal["comma", "semicolon"] = "comma"
    """Text export with comma and decimal point, or with semicolon, decimal comma and byte order mark."""
    measures: dict[str, str] = Field(default_factory=dict)
    """Channel -> role: what a channel without a role measures. A channel that aligns its source by
    repeating another needs no entry."""

    @property
    def telling_s(self) -> float:
        """Length of the record from its start that tells of the mass."""
        return self.duration_s

    def undrawn(self) -> dict[str, Any]:
        """Return the settings with which nothing of a shot is off."""
        return {
            "gain_errors": False, "friction_error": False, "unread_errors": False, "shot_to_shot": 0.0, "unread": {},
        }  # fmt: skip

    def ringing_share(self, role: str) -> float:
        """Return the stress waves on a motion's sensor, SI, for each m/s^2 of those on the recoil accelerometer."""
        return 1.0 if role == "recoil_acceleration" else 0.0

    def shift_share(self, role: str) -> float:
        """Return the step of a sensor's offset at the shot, share of full scale."""
        if role in FORCE_SENSOR_ROLES:
            return self.zero_shift_pressure
        return self.zero_shift if role == "recoil_acceleration" else 0.0


def contradiction(key: str, problem: str) -> Fault:
    """Return the fault of a setting that does not go with another one."""
    return Fault((TWIN, key), problem, FaultCode.CONTRADICTION)


def faults_of_recorders(rig: Rig, settings: RecorderSettings, roles: Iterable[str]) -> list[Fault]:
    """Return what the instruments of a virtual rig lack or contradict.

    Parameters
    ----------
    roles
        Roles that a sensor of the rig's model may have.
    """
    faults = []
    if settings.pre_trigger_s >= settings.duration_s:
        faults.append(contradiction("pre_trigger_s", f"must be shorter than duration_s = {settings.duration_s}"))
    others = [source.name for source in rig.sources if source.name != rig.reference_clock]
    if others and settings.clock_offset_s >= 0.5 * settings.duration_s:
        problem = "must be shorter than half of duration_s: clocks must overlap"
        faults.append(contradiction("clock_offset_s", problem))
    faults += _faults_of_measures(rig, settings, tuple(roles))
    for source in rig.sources:
        if source.kind == "camera" and source.frame_rate is None:
            key = (Row("source", source.name), "frame_rate")
            faults.append(Fault(key, "is missing; a virtual camera needs one", FaultCode.MISSING))
    return faults


def measured_roles(rig: Rig, settings: RecorderSettings) -> Mapping[str, str]:
    """Return what each channel measures, as a role: its own, its twin's in ``measures``, or the one it repeats."""
    roles: dict[str, str] = {c.name: c.role or settings.measures.get(c.name, "") for c in rig.channels}
    for source in rig.sources:
        if isinstance(source.align, RedundantAlignment) and not roles.get(source.align.channel):
            roles[source.align.channel] = roles.get(source.align.against, "")
    return roles


def _faults_of_measures(rig: Rig, settings: RecorderSettings, known: tuple[str, ...]) -> list[Fault]:
    faults: list[Fault] = []
    roles: Mapping[str, Any] = measured_roles(rig, settings)
    quantities = {c.name: c.quantity for c in rig.channels}
    measures = (TWIN, "measures")
    for key in ("measures", "skew_s"):
        for name in (one for one in getattr(settings, key) if one not in quantities):
            problem = f"no such channel; {did_you_mean(name, sorted(quantities), quote='`')}"
            faults.append(Fault((TWIN, key, name), problem, FaultCode.UNKNOWN))
    for name, role in settings.measures.items():
        if name not in quantities:
            continue
        if role not in known:
            problem = f"unknown role; {did_you_mean(role, known, quote='`')}"
            faults.append(Fault((*measures, name), problem, FaultCode.UNKNOWN, name))
        elif ROLES[role] != quantities[name]:
            problem = f"{role} is no {quantities[name]}"
            faults.append(Fault((*measures, name), problem, FaultCode.CONTRADICTION, name))
    for name, role in roles.items():
        if not role:
            problem = "say which role's quantity this channel measures"
            faults.append(Fault((*measures, name), problem, FaultCode.MISSING, name))
    return faults
