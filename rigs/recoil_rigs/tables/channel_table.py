"""The tables of a rig file on channels and their sensors.

Types are strict, see `recoil_acquisition.quantities.declaration`.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from recoil_acquisition.errors import Fault, FaultCode, did_you_mean, nearest_first
from recoil_acquisition.quantities.declaration import DeclaredTable, Finite, NotNegative, Pair, Positive, Text
from recoil_acquisition.quantities.quantity import SI_UNITS, UNITS, Unit, find_unit, normalise_unit
from recoil_rigs.tables.rig_tables import GAUGE_ROLES, ROLES
from recoil_rigs.tables.sensitivity import (
    Sensitivity,
    amplifier_missing,
    bare_sensitivity,
    output_from_text,
    sensitivity_from_text,
)

USUAL_K = 2.0
"""Coverage factor of a certificate that states none."""
ROUNDING = 1e-9
"""Relative difference of two numbers that say the same."""
USUAL_U_ZERO_REL = 1e-3
"""Share of the range by which a gauge's zero may move in a shot: thermal shock of a good gauge."""
UNRESTED_U_ZERO_REL = 1e-2
"""Share of its range by which the zero of an accelerometer may be off that was not seen at rest."""
USUAL_U_DISTORTION_M = 1e-4
"""Length by which a camera's optics may bend a travel."""
USUAL_U_LINE_S = 2e-3
"""Delay by which an orifice or a line before a recuperator's gauge may make it late."""
STATIC_U_DYNAMIC_REL = 5e-3
"""Share by which the scale of a breech gauge that was calibrated at rest may be another in a pulse of some ms: with a
certificate of 0.5 % it makes 0.7 %, what the best standard of dynamic pressure reaches (U 1.5 %, Metrologia 55 (2018)
S52)."""


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
    U_rel: NotNegative | None = Field(
        default=None, description="the expanded uncertainty of its scale, relative, as certified, in place of `u_rel`"
    )
    k: Positive | None = Field(default=None, description="the coverage factor of `U_rel`; 2 if left out")
    nu: Annotated[float, Field(ge=1)] = Field(
        default=math.inf, description="the degrees of freedom of `u_rel`, 1 or more; infinite if left out"
    )
    calibration: Literal["static", "dynamic"] | None = None
    """How its certificate was found: ``static``, at rest, or ``dynamic``, in pulses like the shot's. A breech gauge is
    static if left out, and its scale in such a pulse is known half a percent less well."""
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

    @model_validator(mode="before")
    @classmethod
    def _takes_what_is_certified(cls, stated: Any) -> Any:
        """Turn an expanded uncertainty into a standard one, ``u_rel = U_rel / k`` (JCGM 100:2008, 4.3.3)."""
        if not isinstance(stated, dict) or "U_rel" not in stated or "u_rel" in stated:
            return stated
        whole, k = stated["U_rel"], stated.get("k", USUAL_K)
        is_number = all(isinstance(one, int | float) and not isinstance(one, bool) for one in (whole, k))
        return {**stated, "u_rel": whole / k} if is_number and k > 0 else stated

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
        if self.k is not None and self.U_rel is None:
            faults.append("`k` needs `U_rel`, of which it is the coverage factor")
        if self.U_rel is not None and abs(self.u_rel * (self.k or USUAL_K) - self.U_rel) > ROUNDING * self.U_rel:
            faults.append("`u_rel` is not `U_rel` / `k`: state one of them")
        if math.isfinite(self.nu) and not self.u_rel:
            faults.append("`nu` needs `u_rel`, or `U_rel` and `k`: it says how well that is known")
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

    def contradictions(self) -> list[Fault]:
        """Return what is wrong with its role, quantity and unit, and with its sensor's chain."""
        return [*_faults_of_role(self), *_faults_of_unit(self), *_faults_of_chain(self), *_faults_of_gauge(self)]

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
    def u_dynamic_rel(self) -> float:
        """Relative standard uncertainty of its scale in the shot beside that of its certificate.

        No other gauge reads pulses that steep: brake, recuperator and the force on a line are slow beside their gauges.
        """
        is_of_pulses = self.role == GAUGE_ROLES[0] and self.sensor.calibration != "dynamic"
        return STATIC_U_DYNAMIC_REL if is_of_pulses else 0.0

    @property
    def u_scale_rel(self) -> float:
        """Relative standard uncertainty of its scale in the shot, that of its certificate and `u_dynamic_rel`."""
        u_rel, u_dynamic_rel = self.sensor.u_scale_rel, self.u_dynamic_rel
        return math.hypot(u_rel, u_dynamic_rel) if u_dynamic_rel else u_rel

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


def _faults_of_role(channel: ChannelSpec) -> Iterator[Fault]:
    if channel.role and channel.role not in ROLES:
        problem = f"unknown role {channel.role!r}; {did_you_mean(channel.role, list(ROLES), quote='`')}"
        yield Fault(("role",), problem, FaultCode.UNKNOWN)
    elif channel.role and channel.quantity in SI_UNITS and channel.quantity != ROLES[channel.role]:
        problem = f"role {channel.role!r} needs quantity {ROLES[channel.role]!r}, found {channel.quantity!r}"
        yield Fault(("quantity",), problem, FaultCode.CONTRADICTION)


def _faults_of_unit(channel: ChannelSpec) -> Iterator[Fault]:
    if channel.quantity not in SI_UNITS:
        nearest = did_you_mean(channel.quantity, list(SI_UNITS), quote="`")
        problem = f"unknown quantity {channel.quantity!r}; {nearest}"
        yield Fault(("quantity",), problem, FaultCode.UNKNOWN)
        return
    if channel.unit is None:
        return
    unit, sensitivity, problem = find_unit(channel.unit), channel.sensitivity, ""
    if channel.unit == "px":
        problem = "" if channel.quantity == "displacement" else f"'px' is no unit of {channel.quantity}"
    elif unit is None:
        nearest = ", ".join(nearest_first(normalise_unit(channel.unit), sorted(UNITS))[:3])
        problem = f"unknown unit {channel.unit!r}; nearest known: {nearest}"
    elif channel.quantity not in unit.quantities and not (sensitivity and sensitivity.turned_into(unit)):
        fitting = ", ".join(u for u, v in UNITS.items() if channel.quantity in v.quantities)
        chain = "; volts need `sensitivity` in `sensor`" if "voltage" in unit.quantities else ""
        problem = f"{channel.unit!r} is no unit of {channel.quantity}; one of {fitting}{chain}"
    if problem:
        yield Fault(("unit",), problem, FaultCode.UNIT)


def _faults_of_gauge(channel: ChannelSpec) -> Iterator[Fault]:
    """Name what only a pressure's gauge has, and what only the breech's."""
    for key, of in {"u_linearity_rel": GAUGE_ROLES, "gauge_ahead": GAUGE_ROLES[:1]}.items():
        if getattr(channel.sensor, key) is not None and channel.role not in of:
            problem = f"is of a channel with the role {' or '.join(of)} alone; leave it out"
            yield Fault(("sensor", key), problem, FaultCode.CONTRADICTION)


def _faults_of_chain(channel: ChannelSpec) -> Iterator[Fault]:
    """Check that a sensitivity is one of what the channel measures, and that the way to volts is known."""
    sensor = channel.sensor
    sensitivity = channel.sensitivity if channel.quantity in SI_UNITS else None
    if sensitivity is None:
        return
    if channel.quantity not in sensitivity.per.quantities:
        problem = f"{sensor.sensitivity!r} is per {sensitivity.per_name}, which is no unit of {channel.quantity}"
        if sensitivity.per_name == "V":
            remedy = 'of a bridge write its output over its load, such as "0.02 mV/V/kN"'
        else:
            remedy = f"one of {', '.join(u for u, v in UNITS.items() if channel.quantity in v.quantities)}"
        yield Fault(("sensor", "sensitivity"), f"{problem}; {remedy}", FaultCode.UNIT)
    at_amplifier = ("sensor", "amplifier")
    recorded = find_unit(channel.unit) if channel.unit is not None else None
    in_output = recorded is not None and bool(recorded.quantities & sensitivity.output.quantities)
    in_words, stated = isinstance(sensor.sensitivity, str), "amplifier" in sensor.model_fields_set
    if in_words and sensitivity.needs_amplifier and not stated and not in_output:
        yield Fault(at_amplifier, amplifier_missing(sensitivity), FaultCode.MISSING)
    if sensor.zero is not None and not sensitivity.turned_into(output_from_text(sensor.zero)[1]):
        problem = f"{sensor.zero!r} is nothing that a chain of {sensitivity.output_name} gives out"
        yield Fault(("sensor", "zero"), problem, FaultCode.UNIT)
    if not 1e-60 < sensitivity.value * sensor.amplifier < 1e60:
        yield Fault(at_amplifier, f"{sensor.amplifier:g} is no gain that a chain has", FaultCode.RANGE)
