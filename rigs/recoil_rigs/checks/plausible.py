"""Values that a rig of this kind can have, and that are usual: a value in another unit shows by its size."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from types import MappingProxyType

from recoil_acquisition.errors import Fault, FaultCode, KeyPath
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_rigs.mechanism.bounds import LENGTH, Bounds
from recoil_rigs.mechanism.mechanism_parameters import UNITS, Mechanism
from recoil_rigs.tables.channel_table import USUAL_GAIN, ChannelSpec, range_si
from recoil_rigs.tables.rig_tables import Source

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
            unit = UNITS[symbol]
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
    found += _exact_zeros(mechanism)
    for where, channel in channels:
        limits = range_si(channel)
        bounds = mechanism.bounds_of_role.get(channel.role)
        if limits is not None and bounds is not None and (problem := bounds.warning(max(map(abs, limits)))):
            key = (*where, "sensor", "range")
            found.append(Fault(key, f"{problem}{bare_number_hint(channel)}", FaultCode.UNUSUAL))
    return found


def _exact_zeros(mechanism: Mechanism) -> Iterator[Fault]:
    """Doubt what a rig states to be exactly nothing and physics gives to all of its kind: it would be in the mass."""
    for symbol, u in mechanism.never_none.items():
        if getattr(mechanism, symbol) == 0 == mechanism.u.get(symbol, 0.0):
            key = symbol if symbol == "unread_force" else f"u_{symbol}"
            problem = (
                "none at all is unusual: no gun is without it, and what it takes would be taken for mass; state what "
                f"it may be by `{key}`, for example {u:g}"
            )
            yield Fault(("mechanism", symbol), problem, FaultCode.UNUSUAL)


def foreign_keys(
    mechanism: Mechanism, sources: Sequence[tuple[KeyPath, Source]], channels: Sequence[tuple[KeyPath, ChannelSpec]]
) -> list[Fault]:
    """Name what a channel's ``sensor`` states and nothing hangs on.

    No sensor of its quantity has such a key, and it may be that of another channel, or nobody asks what it says.
    Parameters are as of `implausible_values`.
    """
    found = []
    # a clock is aligned by them, so that what they are late by is its offset
    quantities = {channel.name: channel.quantity for _, channel in channels}
    by_forces = {
        one.name for _, one in sources
        if mechanism.recoils_once and quantities.get(getattr(one.align, "against", None) or "") == "pressure"
    }  # fmt: skip
    compared = {getattr(one.align, key, None) for _, one in sources for key in ("channel", "against")}
    for where, channel in channels:
        of_others = {
            "position": channel.quantity not in PLACED and any(channel.sensor.position),
            "u_distortion_m": channel.quantity != "displacement",
            "u_zero_rel": mechanism.recoils_once and channel.quantity in PLACED,
            **dict.fromkeys(OF_A_DROOP, mechanism.recoils_once and channel.role == "recoil_displacement"),
        }
        foreign = (
            f"says nothing of a sensor of {channel.quantity.replace('_', ' ')}: is this the `sensor` table of "
            "another channel? Compare its serial number with the certificate, or leave the key out"
        )
        idle = _idle_keys(mechanism, channel, {one.role for _, one in channels})
        if not channel.enters_estimate:
            idle = dict.fromkeys((*OF_AN_ESTIMATE, *(() if channel.name in compared else ("u_delay_s",))), UNASKED)
        if channel.role == "recoil_displacement" and channel.source in by_forces:
            idle = {"u_delay_s": FOUND_WITH_THE_CLOCK}
        problems = {**idle, **dict.fromkeys((key for key, one in of_others.items() if one), foreign)}
        found += [
            Fault((*where, "sensor", key), problem, FaultCode.UNUSUAL)
            for key, problem in problems.items()
            if key in channel.sensor.model_fields_set
        ]
    return found


def _idle_keys(mechanism: Mechanism, channel: ChannelSpec, roles: Collection[str]) -> Mapping[str, str]:
    """Return the keys of a line's sensor of motion that change no digit of its mass, each with why not."""
    if mechanism.recoils_once or channel.role not in mechanism.motion_roles:
        return {}
    told_by = next(role for role in mechanism.motion_roles if role in roles)
    idle = {}
    if channel.quantity not in TURNING:
        idle["u_zero_rel"] = (
            f"changes no mass: what a constant adds to a {channel.quantity} is gone from the acceleration; leave it out"
        )
    if channel.role != told_by:
        idle["u_delay_s"] = (
            f"changes no mass: {told_by} tells the acceleration, and this channel where friction points; state it of "
            "that sensor, or leave it out"
        )
    return idle


OF_A_DROOP = ("time_constant_s", "u_time_constant_s")
"""Keys of what drains, as charge does: no camera."""
OF_AN_ESTIMATE = ("u_gain", "u_zero_rel", "u_time_constant_s")
"""Keys that estimates read, beside ``u_rel``, which a certificate states of any sensor."""
UNASKED = (
    "changes nothing: no estimate reads a channel without a role; give the channel the role that it has, or leave the "
    "key out"
)
FOUND_WITH_THE_CLOCK = (
    "changes nothing: the clock is aligned by the forces, and what the channel is late by is found with its offset; "
    "leave it out"
)
TURNING = ("acceleration", "angular_rate", "angular_acceleration")
"""Quantities whose sensors' zeros a gun's rest before the shot tells."""
PLACED = (*TURNING, "displacement", "velocity")
"""Quantities that hang on where on its body a sensor sits."""


def unusual_peak(channel: ChannelSpec, peak: float, mechanism: Mechanism) -> str:
    """Say what is unusual of the largest value that a file has of a channel; empty if nothing is.

    Parameters
    ----------
    peak
        SI, the sign does not matter.
    mechanism
        Mechanism of the rig.
    """
    limits, bounds, size = range_si(channel), mechanism.bounds_of_role.get(channel.role), abs(peak)
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
    for symbol, bounds in () if mechanism is None else mechanism.bounds.items():
        if not math.isnan(value := getattr(mechanism, symbol)):
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
