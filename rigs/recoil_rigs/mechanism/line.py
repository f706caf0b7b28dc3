"""One body on a straight line: ``m3 x'' = sum of the driving forces - sum of the resisting ones``.

x, acceleration and forces count along the driving force, whose direction rises by ``phi20`` over the horizontal.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_rigs.mechanism.bounds import OF_ROLE, OF_SYMBOL, UPRIGHT, Bounds
from recoil_rigs.mechanism.mechanism_parameters import Mechanism, MechanismModel
from recoil_rigs.tables.channel_table import ChannelSpec
from recoil_rigs.tables.force_input import ForceInput
from recoil_rigs.tables.rig_tables import CARRIED_ROLES, FORCE_ROLES, FORCE_SENSOR_ROLES


class Line(Mechanism):
    """One body: a force for each channel that reads one, driving or resisting, and for each pressure with a channel."""

    model, words = MechanismModel.LINE, "a body on a line"
    motion_roles = MappingProxyType(
        {
            "recoil_acceleration": "the body's accelerometer",
            "recoil_velocity": "the body's speed",
            "recoil_displacement": "the body's displacement",
        }
    )
    sure_roles = frozenset(motion_roles)
    bounds = MappingProxyType(
        {
            **OF_SYMBOL,
            # a drop hammer falls, a specimen weighs grams
            "m3": Bounds((1e-6, 1e7), (1e-3, 1e5), "kg"),
            "phi20": Bounds((-UPRIGHT, UPRIGHT), (-UPRIGHT, UPRIGHT), "rad"),
            "slide_friction": Bounds((0.0, 1e6), (0.0, 1e5), "N s/m"),
        }
    )
    bounds_of_role = MappingProxyType(
        {
            **OF_ROLE,
            **dict.fromkeys(FORCE_ROLES, Bounds((0.0, math.inf), (1e-2, 1e7), "N")),
            "recoil_acceleration": Bounds((0.0, math.inf), (1e-2, 1e6), "m/s2"),
            "recoil_velocity": Bounds((0.0, math.inf), (1e-3, 1e4), "m/s"),
            "recoil_displacement": Bounds((0.0, math.inf), (1e-5, 1e4), "m"),
        }
    )
    shared_roles = FORCE_SENSOR_ROLES
    foreign_roles = MappingProxyType(
        {
            role: f"a body on a line has no role {role!r}: leave it out, the channel is recorded all the same"
            for role in CARRIED_ROLES
        }
    )
    spans_s = (math.inf, math.inf)
    recoils_once = False
    force_rate_hz = math.inf

    def forces(self, channels: Sequence[ChannelSpec]) -> tuple[ForceInput, ...]:
        """List the driving forces, the resisting ones, and those of its pressures.

        A share that is not read is missing of what resists alone.
        """
        whole = zip(FORCE_ROLES, (1.0, -1.0), (1.0, 1.0 + self.unread_share), strict=True)
        read = [
            ForceInput(one.name, role, sign, per_reading, (one,))
            for role, sign, per_reading in whole
            for one in channels
            if one.role == role
        ]
        return (*read, *(one for one in self.pressures(channels) if one.channels))

    def series(self, forces: Sequence[ForceInput]) -> tuple[str, ...]:
        """List the roles of its motion and its forces."""
        return (*self.motion_roles, *(force.name for force in forces))

    @property
    def at_rest(self) -> Mapping[str, float]:
        """Readings at rest by role.

        Its accelerometer feels ``g sin(phi20)`` along the line while its speed stays the same; what its force gauges
        read then nobody knows.
        """
        return {
            "recoil_acceleration": self.g * math.sin(self.phi20), "breech_pressure": 0.0, "brake_pressure": 0.0,
        }  # fmt: skip

    def travel_acceleration(self, inertial: ArrayLike, *moving: Any, **carriage: Any) -> NDArray[np.float64]:  # noqa: ARG002 - of a gun
        """Return x'' along the line, m/s^2, shape (...): what gravity adds at rest is taken off."""
        return np.asarray(np.asarray(inertial) - self.g * np.sin(self.phi20))

    @classmethod
    def symbols_of(cls, roles: Collection[str]) -> tuple[str, ...]:
        """Names of the values that neither carriage nor tipping part has, nor a pressure that no channel reads."""
        without = {symbol for symbol, role in cls.OF_PRESSURE.items() if role not in roles}
        return tuple(symbol for symbol in cls.symbols() if symbol not in cls.OF_GUN | without)

    @classmethod
    def required(cls, roles: Collection[str] = frozenset()) -> tuple[str, ...]:
        """Names of the specification mass, the direction, the friction, and the areas of its pressures."""
        areas = (symbol for symbol, role in cls.OF_PRESSURE.items() if role in roles and symbol.endswith("_area"))
        return ("m3", "phi20", "friction", *areas)
