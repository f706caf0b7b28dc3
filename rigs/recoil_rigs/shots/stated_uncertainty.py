"""Uncertainties that a rig's certificates state of what all its shots share, and the rig as if they stated others.

A sensor's scale goes by ``<channel>.u_rel``, a share; a value of the mechanism by ``u_<name>``, in its unit; the
force that nobody reads by ``unread_force``, a share.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from recoil_acquisition.errors import Fault, FaultCode, RigError, did_you_mean
from recoil_rigs.mechanism.mechanism_parameters import UNITS
from recoil_rigs.rig import Rig
from recoil_rigs.tables.channel_table import ChannelSpec
from recoil_rigs.tables.force_input import AREAS
from recoil_rigs.tables.rig_tables import FORCE_SENSOR_ROLES

SCALED_ROLES = (*FORCE_SENSOR_ROLES, "recoil_acceleration", "recoil_velocity", "recoil_displacement")
"""Roles whose scale is the same in every shot of a rig, and enters the mass."""
OF_MECHANISM = ("friction", *AREAS, "bore_friction", "unread_share", "slide_friction", "carried_mass")
"""Values of the mechanism likewise, where its model has them."""
ITSELF_UNCERTAIN = "unread_force"
"""Value of the mechanism that is itself a standard uncertainty: it goes by its own name, a share."""
_SHARES = ("bore_friction", "unread_share", ITSELF_UNCERTAIN)
LARGEST_SHARE = 0.5
"""Share of a scale, or of a value of the mechanism, beyond which it is not known at all: a percentage was meant,
perhaps."""


def unit_of_uncertainty(key: str) -> str | None:
    """Return the unit of a standard uncertainty by its key, empty for a share; None for a key that is none."""
    return "" if key.endswith(".u_rel") else UNITS.get(key.removeprefix("u_"))


def stated_uncertainties(rig: Rig) -> dict[str, float]:
    """Return the standard uncertainties by their keys; 0 for what the rig file takes as exact."""
    scales = {f"{one.name}.u_rel": one.sensor.u_rel for one in rig.channels if one.role in SCALED_ROLES}
    having = rig.mechanism.symbols_of({one.role for one in rig.channels})
    of_mechanism = {f"u_{symbol}": rig.mechanism.u.get(symbol, 0.0) for symbol in OF_MECHANISM if symbol in having}
    return scales | of_mechanism | {ITSELF_UNCERTAIN: rig.mechanism.unread_force}


def with_uncertainties(rig: Rig, stated: Mapping[str, float]) -> Rig:
    """State other standard uncertainties; the part of a scale's that comes from a standard shrinks as the whole does.

    Raises
    ------
    RigError
        With every key that is none, and every number that is no standard uncertainty of it.
    """
    faults = list(_faults(rig, stated))
    if faults:
        raise RigError(rig.path, faults)
    channels = tuple(_with_scale(one, stated.get(f"{one.name}.u_rel")) for one in rig.channels)
    of_mechanism = {symbol: stated[f"u_{symbol}"] for symbol in OF_MECHANISM if f"u_{symbol}" in stated}
    mechanism = replace(
        rig.mechanism,
        unread_force=stated.get(ITSELF_UNCERTAIN, rig.mechanism.unread_force),
        u=MappingProxyType(dict(rig.mechanism.u) | of_mechanism),
        unstated=rig.mechanism.unstated - set(stated),
    )
    return replace(rig, channels=channels, mechanism=mechanism)


def with_dynamic_certificate(rig: Rig, name: str) -> Rig:
    """Let the certificate of a channel's sensor be one that was found in pulses like the shot's."""

    def dynamic(channel: ChannelSpec) -> ChannelSpec:
        sensor = channel.sensor.model_copy(update={"calibration": "dynamic"})
        return channel.model_copy(update={"sensor": sensor})

    return replace(rig, channels=tuple(dynamic(one) if one.name == name else one for one in rig.channels))


def _with_scale(channel: ChannelSpec, u_rel: float | None) -> ChannelSpec:
    sensor = channel.sensor
    if u_rel is None or channel.role not in SCALED_ROLES:
        return channel
    of_standard = sensor.u_reference_rel * min(1.0, u_rel / sensor.u_rel if sensor.u_rel else 1.0)
    other = sensor.model_copy(update={"u_rel": u_rel, "u_reference_rel": of_standard})
    return channel.model_copy(update={"sensor": other})


def _faults(rig: Rig, stated: Mapping[str, float]) -> list[Fault]:
    known = stated_uncertainties(rig)
    channels = {f"{one.name}.u_rel": one.name for one in rig.channels}
    faults = []
    for key, u in stated.items():
        symbol = key.removeprefix("u_")
        if key not in known:
            problem = f"no such uncertainty, or none that shots share; {did_you_mean(key, list(known))}"
            faults.append(Fault((key,), problem, FaultCode.UNKNOWN, channels.get(key)))
        elif not (math.isfinite(u) and u >= 0):
            problem = f"must be a standard uncertainty, not negative, found {u:g}"
            faults.append(Fault((key,), problem, FaultCode.RANGE, channels.get(key)))
        elif symbol not in OF_MECHANISM or symbol in _SHARES:
            if u > LARGEST_SHARE:
                problem = f"must be a share of at most {LARGEST_SHARE:g}, found {u:g}: 0.002 is 0.2 %"
                faults.append(Fault((key,), problem, FaultCode.RANGE, channels.get(key)))
        elif 0 < getattr(rig.mechanism, symbol) * LARGEST_SHARE < u:
            value = getattr(rig.mechanism, symbol)
            problem = f"must be at most half of {symbol} = {value:g}, in its unit, found {u:g}"
            faults.append(Fault((key,), problem, FaultCode.RANGE))
    return faults
