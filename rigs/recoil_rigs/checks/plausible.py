"""Values that a rig of this kind can have, and that are usual: a value in another unit shows by its size."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from recoil_acquisition.errors import Fault, FaultCode, KeyPath
from recoil_acquisition.quantity import SI_UNITS
from recoil_rigs.mechanism.mechanism_parameters import MechanismModel
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.tables.channel_table import USUAL_GAIN, ChannelSpec, range_si
from recoil_rigs.tables.rig_tables import FORCE_ROLES, Source


@dataclass(frozen=True)
class Bounds:
    """Bounds of a value.

    Attributes
    ----------
    possible
        Least and largest value that any such mechanism has; one beyond is a fault.
    usual
        Bounds beyond which a value is worth a second look.
    unit
        Unit of `possible` and `usual`.
    """

    possible: tuple[float, float]
    usual: tuple[float, float]
    unit: str

    def fault(self, value: float) -> str:
        """Say what is wrong with an impossible value; empty if it is possible."""
        least, largest = self.possible
        if least <= value <= largest:
            return ""
        return f"must lie between {least:.3g} and {largest:.3g} {self.unit}".rstrip() + f", found {value:g}"

    def warning(self, value: float) -> str:
        """Say what is unusual of a possible value; empty if nothing is."""
        least, largest = self.usual
        if self.fault(value) or least <= value <= largest:
            return ""
        return f"{value:g} {self.unit}".rstrip() + f" is unusual; most lie between {least:g} and {largest:g}"


MASS = Bounds((1e-2, 1e6), (1.0, 1e5), "kg")
INERTIA = Bounds((1e-6, 1e9), (1e-3, 1e7), "kg m2")
LENGTH = Bounds((-50.0, 50.0), (-20.0, 20.0), "m")
OFFSET = Bounds((-5.0, 5.0), (-1.0, 1.0), "m")
AREA = Bounds((1e-6, 1.0), (1e-5, 0.3), "m2")
QUARTER = math.pi / 2
UPRIGHT = QUARTER + 1e-3
"""Largest inclination, rad: a quarter as somebody rounds it."""

OF_SYMBOL: Mapping[str, Bounds] = MappingProxyType(
    {
        **dict.fromkeys(("m1", "m2", "m3"), MASS),
        **dict.fromkeys(("J1", "J2", "J3c"), INERTIA),
        **dict.fromkeys(("X1", "Y1", "XA", "YA", "s2", "b", "L"), LENGTH),
        **dict.fromkeys(("d2", "d", "e"), OFFSET),
        **dict.fromkeys(("bore_area", "brake_area", "recuperator_area"), AREA),
        # a carriage stands about level, a bore may point anywhere above it
        "phi10": Bounds((-QUARTER / 2, QUARTER / 2), (-0.3, 0.3), "rad"),
        "phi20": Bounds((-UPRIGHT, UPRIGHT), (-0.35, 1.4), "rad"),
        "f": Bounds((0.0, 10.0), (0.0, 2.0), ""),
        "g": Bounds((9.0, 10.5), (9.76, 9.84), "m/s2"),
        "friction": Bounds((0.0, 1e7), (0.0, 1e5), "N"),
        "bore_friction": Bounds((0.0, 0.5), (0.0, 0.05), "of the breech force (1 % is 0.01)"),
        "muzzle_brake": Bounds((0.0, 0.9), (0.0, 0.7), "of the breech force behind the exit (10 % is 0.1)"),
        "projectile_mass": Bounds((0.0, 1e4), (0.0, 200.0), "kg"),
        "bore_length": Bounds((0.0, 50.0), (0.0, 20.0), "m"),
        "tube_axial_hz": Bounds((0.0, 1e5), (0.0, 5000.0), "Hz"),
        "unread_share": Bounds((-0.5, 0.5), (-0.05, 0.05), "of the resistance that is read (1 % is 0.01)"),
        "unread_force": Bounds((0.0, 0.5), (0.0, 0.05), "of the peak resistance (1 % is 0.01)"),
        "slide_friction": Bounds((0.0, 1e6), (0.0, 1e3), "N s/m"),
        "carried_mass": Bounds((0.0, 1e5), (0.0, 100.0), "kg"),
    }
)
"""Symbol of the mechanism -> its bounds."""
OF_LINE_SYMBOL: Mapping[str, Bounds] = MappingProxyType(
    {
        "m3": Bounds((1e-6, 1e7), (1e-3, 1e5), "kg"),
        "phi20": Bounds((-UPRIGHT, UPRIGHT), (-UPRIGHT, UPRIGHT), "rad"),
        "slide_friction": Bounds((0.0, 1e6), (0.0, 1e5), "N s/m"),
    }
)
"""Symbol of the mechanism -> its bounds on a line, where they are others: a drop hammer falls, a specimen weighs
grams."""
OF_SOURCE: Mapping[str, Bounds] = MappingProxyType(
    {
        "frame_rate": Bounds((10.0, 1e7), (500.0, 1e6), "Hz"),
        "scale_mm_per_px": Bounds((1e-5, 1e3), (1e-3, 50.0), "mm/px"),
    }
)
"""Key of a source -> its bounds."""
U_REL = Bounds((0.0, 1.0), (0.0, 0.1), "of the reading (1 % is 0.01)")
U_LINEARITY = Bounds((0.0, 0.1), (0.0, 0.02), "of full scale (1 % is 0.01)")
U_AHEAD = Bounds((0.0, 0.5), (0.0, 0.15), "of the breech pressure (1 % is 0.01)")
GAIN = Bounds((1e-15, 1e15), USUAL_GAIN, "of the recorded value")
"""Gain of a newer calibration; of numbers whose unit the rig states it is the scale, of which nothing is usual."""
SCALE = Bounds(GAIN.possible, GAIN.possible, "of the channel's unit")
"""The same where it is the scale."""
U_SHARE: Mapping[str, Bounds] = MappingProxyType(
    {
        "bore_friction": Bounds((0.0, 0.5), (0.0, 0.05), "of the breech force (1 % is 0.01)"),
        "muzzle_brake": Bounds((0.0, 0.5), (0.0, 0.2), "of the breech force behind the exit (10 % is 0.1)"),
        "unread_share": Bounds((0.0, 0.5), (0.0, 0.05), "of the resistance that is read (1 % is 0.01)"),
    }
)
"""Symbol of a share -> bounds of its standard uncertainty."""

_PRESSURE = Bounds((0.0, math.inf), (1e5, 2e9), "Pa")
OF_ROLE: Mapping[str, Bounds] = MappingProxyType(
    {
        **dict.fromkeys(("breech_pressure", "brake_pressure", "recuperator_pressure"), _PRESSURE),
        "recoil_acceleration": Bounds((0.0, math.inf), (10.0, 1e6), "m/s2"),
        "recoil_displacement": Bounds((0.0, math.inf), (1e-3, 10.0), "m"),
    }
)
"""Role -> how far its sensors reach, and its peak in a shot, SI."""
OF_LINE_ROLE: Mapping[str, Bounds] = MappingProxyType(
    {
        **dict.fromkeys(FORCE_ROLES, Bounds((0.0, math.inf), (1e-2, 1e7), "N")),
        "recoil_acceleration": Bounds((0.0, math.inf), (1e-2, 1e6), "m/s2"),
        "recoil_velocity": Bounds((0.0, math.inf), (1e-3, 1e4), "m/s"),
        "recoil_displacement": Bounds((0.0, math.inf), (1e-5, 1e4), "m"),
    }
)
"""Role -> the same on a line, where it is another."""


def bounds_of(symbol: str, model: MechanismModel) -> Bounds | None:
    """Return the bounds of a value of the mechanism; None if it has none."""
    if model is MechanismModel.LINE and symbol in OF_LINE_SYMBOL:
        return OF_LINE_SYMBOL[symbol]
    return OF_SYMBOL.get(symbol)


def _bounds_of_role(role: str, model: MechanismModel) -> Bounds | None:
    if model is MechanismModel.LINE and role in OF_LINE_ROLE:
        return OF_LINE_ROLE[role]
    return OF_ROLE.get(role)


def implausible_values(
    mechanism: Mechanism | None,
    sources: Sequence[tuple[KeyPath, Source]],
    channels: Sequence[tuple[KeyPath, ChannelSpec]],
) -> list[Fault]:
    """Name the values that no such rig has, with their bounds.

    Parameters
    ----------
    mechanism
        Mechanism of the rig file; None where it is at fault otherwise.
    sources, channels
        Sources and channels with their key paths.
    """
    found = [
        Fault(key, problem, FaultCode.RANGE) for key, value, bounds in _bounded(mechanism, sources, channels)
        if (problem := bounds.fault(value))
    ]  # fmt: skip
    for symbol, u in () if mechanism is None else mechanism.u.items():
        if symbol in Mechanism.POSITIVE and u > getattr(mechanism, symbol):
            unit = OF_SYMBOL[symbol].unit
            problem = f"must be in {unit} and smaller than {symbol}, {getattr(mechanism, symbol):g}, found {u:g}"
            found.append(Fault(("mechanism", f"u_{symbol}"), problem, FaultCode.RANGE))
    return found


def unusual_values(
    mechanism: Mechanism, sources: Sequence[tuple[KeyPath, Source]], channels: Sequence[tuple[KeyPath, ChannelSpec]]
) -> list[Fault]:
    """Name the values that a rig may have and few do; parameters as of `implausible_values`."""
    scaled = {(*where, "sensor", "gain") for where, channel in channels if channel.unit is not None}
    found = [
        Fault(key, problem, FaultCode.UNUSUAL) for key, value, bounds in _bounded(mechanism, sources, channels)
        if key not in scaled and (problem := bounds.warning(value))
    ]  # fmt: skip
    for where, channel in channels:
        limits = range_si(channel)
        bounds = _bounds_of_role(channel.role, mechanism.model)
        if limits is not None and bounds is not None and (problem := bounds.warning(max(map(abs, limits)))):
            key = (*where, "sensor", "range")
            found.append(Fault(key, f"{problem}{bare_number_hint(channel)}", FaultCode.UNUSUAL))
    return found


def foreign_keys(mechanism: Mechanism, channels: Sequence[tuple[KeyPath, ChannelSpec]]) -> list[Fault]:
    """Name what a channel's ``sensor`` states and no sensor of its quantity has: it may be that of another channel.

    Parameters are as of `implausible_values`.
    """
    found = []
    for where, channel in channels:
        stated = channel.sensor.model_fields_set
        of_others = {
            "position": channel.quantity not in PLACED and any(channel.sensor.position),
            "u_distortion_m": channel.quantity != "displacement",
            "u_zero_rel": mechanism.recoils_once and channel.quantity in TURNING,
        }
        found += [
            Fault(
                (*where, "sensor", key),
                f"says nothing of a sensor of {channel.quantity.replace('_', ' ')}: is this the `sensor` table of "
                "another channel? Compare its serial number with the certificate, or leave the key out",
                FaultCode.UNUSUAL,
            )
            for key, foreign in of_others.items()
            if foreign and key in stated
        ]
    return found


TURNING = ("acceleration", "angular_rate", "angular_acceleration")
"""Quantities whose sensors' zeros a gun's rest before the shot tells."""
PLACED = (*TURNING, "displacement", "velocity")
"""Quantities that hang on where on its body a sensor sits."""


def unusual_peak(channel: ChannelSpec, peak: float, model: MechanismModel) -> str:
    """Say what is unusual of the largest value that a file has of a channel; empty if nothing is.

    Parameters
    ----------
    peak
        SI, the sign does not matter.
    model
        Model of the rig's mechanism.
    """
    limits, bounds, size = range_si(channel), _bounds_of_role(channel.role, model), abs(peak)
    problem = ""
    if limits is not None:
        reach = max(map(abs, limits))
        if size < LEAST_SHARE * reach:
            problem = f"its peak is {100 * size / reach:.2g} % of its range"
        elif size > MOST_SHARE * reach:
            problem = f"its peak is {size / reach:.3g} times its range"
    if not problem and bounds is not None:
        problem = bounds.warning(size) and f"a peak of {bounds.warning(size)}"
    return (
        problem and f"{problem}: check unit, sensitivity and amplifier{_bias_hint(channel)}{bare_number_hint(channel)}"
    )


LEAST_SHARE, MOST_SHARE = 0.01, 1.1
"""Shares of a sensor's range between which lies the peak of a shot that was measured with the right one."""


def _bias_hint(channel: ChannelSpec) -> str:
    """Name the bias that a chain may have and the rig does not state; empty for another channel."""
    stated = channel.sensor.sensitivity is None or channel.sensor.zero is not None
    return "" if stated else ", and state `zero` of a sensor with a bias"


def bare_number_hint(channel: ChannelSpec) -> str:
    """Say what a sensitivity that is a bare number means; empty for another."""
    sensor = channel.sensor
    if sensor.sensitivity is None or isinstance(sensor.sensitivity, str):
        return ""
    si = SI_UNITS[channel.quantity]
    means = f"`sensitivity = {sensor.sensitivity:g}` is {sensor.sensitivity:g} {sensor.sensitivity_unit} per {si}"
    return f'; {means}: write it as on the certificate, such as "40 mV/MPa"'


def _bounded(
    mechanism: Mechanism | None,
    sources: Sequence[tuple[KeyPath, Source]],
    channels: Sequence[tuple[KeyPath, ChannelSpec]],
) -> Iterator[tuple[KeyPath, float, Bounds]]:
    """Pass every value that has bounds, with its key."""
    values = {} if mechanism is None else {symbol: getattr(mechanism, symbol) for symbol in OF_SYMBOL}
    model = MechanismModel.GUN if mechanism is None else mechanism.model
    for symbol, value in values.items():
        bounds = bounds_of(symbol, model)
        if bounds is not None and not math.isnan(value):
            yield ("mechanism", symbol), value, bounds
    for symbol, bounds in U_SHARE.items():
        if mechanism is not None and symbol in mechanism.u:
            yield ("mechanism", f"u_{symbol}"), mechanism.u[symbol], bounds
    for where, source in sources:
        for key, bounds in OF_SOURCE.items():
            if getattr(source, key) is not None:
                yield (*where, key), getattr(source, key), bounds
    for where, channel in channels:
        yield (*where, "sensor", "u_rel"), channel.sensor.u_rel, U_REL
        if channel.sensor.u_linearity_rel is not None:
            yield (*where, "sensor", "u_linearity_rel"), channel.sensor.u_linearity_rel, U_LINEARITY
        if channel.sensor.gauge_ahead is not None:
            yield (*where, "sensor", "gauge_ahead", "u_share"), channel.sensor.gauge_ahead.u_share, U_AHEAD
        yield (*where, "sensor", "gain"), channel.sensor.gain, GAIN
        for i, place in enumerate(channel.sensor.position):
            yield (*where, "sensor", "position", i), place, LENGTH
