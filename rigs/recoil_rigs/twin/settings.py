"""The rig file's table ``[twin]``: how the virtual rig moves, and how well its instruments measure.

Every key has a default, so that any rig with a complete ``[mechanism]`` can be simulated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from recoil_acquisition.bounded_toml import parse_toml
from recoil_acquisition.declaration import NotNegative, Positive, declared
from recoil_acquisition.errors import Fault, FaultCode, RigError, Row, nearest_first
from recoil_rigs.mechanism import Mechanism
from recoil_rigs.rig import ROLES, RedundantAlignment, Rig
from recoil_rigs.twin.readings import Readings
from recoil_rigs.twin.unread_forces import UnreadForces

_TWIN = "twin"

Count = Annotated[int, Field(ge=0, le=1000)]


class TwinSettings(BaseModel):
    """Settings of the virtual rig, SI units; shares are relative to the full scale of the sensor.

    The mechanism's loads are those of a hydraulic brake with a throttle that narrows along the stroke,
    a gas recuperator, and a stop that holds the recoiling part in battery.
    """

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

    released_mass_kg: NotNegative = 0.0
    """Part of the recoiling mass that lets go while it moves, with the velocity that it has; its centre of mass is
    that of the recoiling part."""
    release_after_s: Positive = 0.02
    """Time from the first rise of the breech force to the instant at which it lets go."""
    unread: UnreadForces = UnreadForces()
    """Forces that no gauge reads, see ``[twin.unread]``."""
    readings: Readings = Readings()
    """Readings that are not what the rig file takes them for, see ``[twin.readings]``."""

    sample_rate_hz: Annotated[float, Field(ge=1000, le=1e6)] = 50e3
    """Sampling rate of the Dewetron recorder."""
    duration_s: Annotated[float, Field(gt=0, le=10)] = 0.5
    """Length of the record on the reference clock."""
    pre_trigger_s: Positive = 0.05
    """Time from the start of the record to the first rise of the breech force."""

    peak_pressure_pa: Positive = 130e6
    """Peak of the breech pressure."""
    rise_s: Positive = 1.5e-3
    """Time constant of the breech pressure's rise."""
    decay_s: Positive = 5.5e-3
    """Time constant of its decay."""
    shot_to_shot: Annotated[float, Field(ge=0, le=0.2)] = 0.01
    """Relative standard deviation of the peak from shot to shot."""

    stroke_m: Positive = 0.9
    """Travel at which the brake's throttle is closed but for its leak."""
    orifice_m2: Positive = 6.0e-4
    """Area of the brake's throttle in battery."""
    leak_m2: Positive = 2.0e-5
    """Area of its leak."""
    oil_density_kg_m3: Positive = 870.0
    """Density of the brake's oil."""
    discharge: Positive = 0.7
    """Discharge coefficient of the throttle."""
    recuperator_pressure_pa: Positive = 1.65e6
    """Gas pressure of the recuperator in battery."""
    recuperator_volume_m3: Positive = 0.0165
    """Gas volume of the recuperator in battery."""
    polytropic: Positive = 1.3
    """Exponent of the gas."""
    counter_recoil_n_s2_m2: NotNegative = 8000.0
    """Throttling of the counter-recoil in a chamber that no gauge reads: force over squared velocity."""
    packing_stiffness_n_m: Positive = 5e7
    """Stiffness of the packing before it slides: what makes its friction hold at rest."""
    stop_stiffness_n_m: Positive = 5e9
    """Stiffness of the stop that holds the recoiling part in battery."""
    stop_damping_n_s_m: NotNegative = 5e5
    """Damping of the stop that holds the recoiling part in battery."""

    elevating_stiffness_n_m_rad: Positive = 2e6
    """Stiffness of the elevating gear between carriage and tipping part."""
    elevating_damping_n_m_s_rad: NotNegative = 2.5e4
    """Damping of the elevating gear between carriage and tipping part."""
    ground_stiffness_n_m: Positive = 3e7
    """Stiffness of the ground at C, in both directions, and at D."""
    ground_damping_n_s_m: NotNegative = 2e5
    """Damping of the ground at C, in both directions, and at D."""
    ground_slip_m_s: Positive = 5e-3
    """Velocity at which the friction at D is fully there."""

    tube_modes: Annotated[int, Field(ge=0, le=2)] = 0
    """Bending modes of the tube, a part of the recoiling part; 0 for a rigid one."""
    tube_length_m: Positive = 2.5
    """Length from its clamp to its free end."""
    tube_mass_kg: Positive = 160.0
    """Mass of the tube, a part of the recoiling one."""
    tube_bending_stiffness_n_m2: Positive = 2e6
    """Modulus of elasticity times second moment of area."""
    tube_damping: Annotated[float, Field(ge=0, lt=1)] = 0.01
    """Damping of each mode, share of the critical one."""
    tube_root_m: float = 0.0
    """Place of the clamp ahead of the recoiling part's centre of mass; the axis is that of the breech force."""

    ringing: NotNegative = 0.5
    """Peak of the stress waves on the recoil accelerometer, relative to the peak of the recoil acceleration."""
    ringing_carriage: NotNegative = 0.04
    """Stress waves on the carriage's accelerometers, relative to those on the recoil accelerometer."""
    ringing_rate_s_m: NotNegative = 1e-4
    """Stress waves on the gyros, rad/s per m/s^2 of those on the recoil accelerometer."""
    ringing_pressure: NotNegative = 0.005
    """Stress waves on the pressure gauges, share of full scale where ``ringing`` is 0.5."""
    noise: NotNegative = 0.001
    """Standard deviation of the white noise, share of full scale."""
    bias: NotNegative = 0.0005
    """Standard deviation of the constant offset, share of full scale."""
    zero_shift: float = 0.0
    """Step of the recoil accelerometer's offset at the shot, share of full scale; those on the carriage, which the
    shock reaches by ``ringing_carriage``, shift by that part of it."""
    zero_shift_pressure: float = 0.0
    """Step of the pressure gauges' offset at the shot, share of full scale."""
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


def read_settings(rig: Rig) -> TwinSettings:
    """Validate a rig's table ``[twin]`` and what else a simulation needs of the rig.

    Raises
    ------
    RigError
        With every fault, keyed ``twin.<key>``, ``mechanism.<symbol>`` or by the source.
    """
    faults: list[Fault] = []
    settings = declared(TwinSettings, dict(rig.twin), (_TWIN,), faults)
    if settings is None:
        raise RigError(rig.path, faults)
    missing = [s for s in Mechanism.symbols() if math.isnan(getattr(rig.mechanism, s))]
    needed = "is missing; a simulation needs all of the model"
    faults += [Fault(("mechanism", s), needed, FaultCode.MISSING) for s in missing]
    if settings.pre_trigger_s >= settings.duration_s:
        faults.append(_contradiction("pre_trigger_s", f"must be shorter than duration_s = {settings.duration_s}"))
    if settings.clock_offset_s >= 0.5 * settings.duration_s:
        problem = "must be shorter than half of duration_s: clocks must overlap"
        faults.append(_contradiction("clock_offset_s", problem))
    faults += faults_of_mass(replace(rig.mechanism, m3=settings.m3_true or rig.mechanism.m3), settings)
    swept = rig.mechanism.recuperator_area * settings.stroke_m * 1.2
    if settings.recuperator_volume_m3 <= swept:
        problem = f"must exceed {swept:.4g} m3, what the recuperator's piston sweeps in 1.2 strokes"
        faults.append(_contradiction("recuperator_volume_m3", problem))
    faults += _faults_of_measures(rig, settings)
    for source in rig.sources:
        if source.kind == "camera" and source.frame_rate is None:
            key = (Row("source", source.name), "frame_rate")
            faults.append(Fault(key, "is missing; a virtual camera needs one", FaultCode.MISSING))
    if faults:
        raise RigError(rig.path, faults)
    return settings


def with_settings(rig: Rig, given: Mapping[str, Any]) -> Rig:
    """Give a rig other settings of its virtual rig; the text of its file stays what it was.

    Parameters
    ----------
    given
        Key of ``[twin]`` -> value; a key of a table within it is written with a dot, ``unread.packing_share``.

    Raises
    ------
    RigError
        With every fault of the settings, as `read_settings`.
    """
    twin: dict[str, Any] = dict(rig.twin)
    for key, value in given.items():
        *tables, last = key.split(".")
        within = twin
        for table in tables:
            inner = within.get(table, {})
            if not isinstance(inner, Mapping):
                problem = f"{table} is no table, it has no key within it"
                raise RigError(rig.path, [Fault((_TWIN, *key.split(".")), problem, FaultCode.UNKNOWN)])
            within[table] = dict(inner)
            within = within[table]
        within[last] = value
    other = replace(rig, twin=twin)
    read_settings(other)
    return other


def set_apart(rig: Rig) -> dict[str, Any]:
    """Return the settings of a rig's virtual rig that its file does not have, or has otherwise, by dotted key."""
    own = parse_toml(rig.text).get(_TWIN, {})
    return dict(_differing(own, rig.twin, ""))


def _differing(own: Any, other: Any, key: str) -> Iterator[tuple[str, Any]]:
    if isinstance(other, Mapping) and isinstance(own, Mapping):
        for name in other:
            yield from _differing(own.get(name, {} if isinstance(other[name], Mapping) else None), other[name],
                                  f"{key}.{name}" if key else name)  # fmt: skip
    elif own != other:
        yield key, other


def _contradiction(key: str, problem: str) -> Fault:
    return Fault((_TWIN, key), problem, FaultCode.CONTRADICTION)


def faults_of_mass(mechanism: Mechanism, settings: TwinSettings) -> list[Fault]:
    """Return why a mechanism's recoiling mass cannot lose or hold what the settings make a part of it, if it cannot."""
    released, gas = settings.released_mass_kg, settings.unread.leaving_gas_kg
    faults = []
    if released >= mechanism.m3:
        problem = f"must be less than the recoiling mass, {mechanism.m3:g} kg"
        faults.append(_contradiction("released_mass_kg", problem))
    elif released + gas >= mechanism.m3:
        problem = f"must be less than what else is left of the recoiling mass, {mechanism.m3 - released:g} kg"
        faults.append(Fault((_TWIN, "unread", "leaving_gas_kg"), problem, FaultCode.CONTRADICTION))
    if settings.tube_modes:
        faults += _faults_of_tube(mechanism, settings, mechanism.m3 - released - gas)
    return faults


def _faults_of_tube(mechanism: Mechanism, settings: TwinSettings, m3_kg: float) -> list[Fault]:
    """Return why the tube cannot be a part of the recoiling part, if it cannot."""
    if settings.tube_mass_kg >= m3_kg:
        problem = f"must be less than the recoiling mass of {m3_kg:g} kg, which it is a part of"
        return [_contradiction("tube_mass_kg", problem)]
    root, length = settings.tube_root_m, settings.tube_length_m
    middle = math.hypot(root + 0.5 * length, mechanism.e)
    # about the centre of mass of both, the parts' own inertias and their masses' at its distances add up
    others = settings.tube_mass_kg * (length**2 / 12 + middle**2 * m3_kg / (m3_kg - settings.tube_mass_kg))
    if others >= mechanism.J3c:
        problem = f"such a tube alone would give the recoiling part {others:.0f} kg m2, more than J3c"
        return [_contradiction("tube_length_m", problem)]
    return []


def measured_roles(rig: Rig, settings: TwinSettings) -> Mapping[str, str]:
    """Return what each channel measures, as a role: its own, its twin's in ``measures``, or the one it repeats."""
    roles: dict[str, str] = {c.name: c.role or settings.measures.get(c.name, "") for c in rig.channels}
    for source in rig.sources:
        if isinstance(source.align, RedundantAlignment) and not roles.get(source.align.channel):
            roles[source.align.channel] = roles.get(source.align.against, "")
    return roles


def _faults_of_measures(rig: Rig, settings: TwinSettings) -> list[Fault]:
    faults: list[Fault] = []
    roles: Mapping[str, Any] = measured_roles(rig, settings)
    quantities = {c.name: c.quantity for c in rig.channels}
    measures = (_TWIN, "measures")
    for name, role in settings.measures.items():
        if name not in quantities:
            nearest = nearest_first(name, sorted(quantities))[0]
            problem = f"no such channel; did you mean `{nearest}`?"
            faults.append(Fault((*measures, name), problem, FaultCode.UNKNOWN))
        elif role not in ROLES:
            problem = f"unknown role; did you mean `{nearest_first(role, list(ROLES))[0]}`?"
            faults.append(Fault((*measures, name), problem, FaultCode.UNKNOWN, name))
        elif ROLES[role] != quantities[name]:
            problem = f"{role} is no {quantities[name]}"
            faults.append(Fault((*measures, name), problem, FaultCode.CONTRADICTION, name))
    for name in settings.skew_s:
        if name not in quantities:
            nearest = nearest_first(name, sorted(quantities))[0]
            problem = f"no such channel; did you mean `{nearest}`?"
            faults.append(Fault((_TWIN, "skew_s", name), problem, FaultCode.UNKNOWN))
    for name, role in roles.items():
        if not role:
            problem = "say which role's quantity this channel measures"
            faults.append(Fault((*measures, name), problem, FaultCode.MISSING, name))
    return faults
