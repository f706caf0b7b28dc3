"""A gun: carriage, tipping part and recoiling part, whose equations are those of `recoil_rigs.mechanism.model`."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_rigs.mechanism.measured_acceleration import relative_acceleration
from recoil_rigs.mechanism.mechanism_parameters import Mechanism, MechanismModel
from recoil_rigs.tables.channel_table import ChannelSpec
from recoil_rigs.tables.force_input import ForceInput
from recoil_rigs.tables.rig_tables import CARRIAGE_ROLES, GAUGE_ROLES, LINE_ROLES


class Gun(Mechanism):
    """Three bodies: the breech drives the recoiling part, brake and recuperator hold it, each a pressure on an area."""

    model, words = MechanismModel.GUN, "a gun"
    motion_roles = MappingProxyType(
        {
            "recoil_acceleration": "the recoiling part's accelerometer",
            "recoil_displacement": "the camera's track of the recoiling part",
        }
    )
    positive_pulses = frozenset({"recoil_acceleration", "recoil_displacement", *GAUGE_ROLES})
    shared_roles = GAUGE_ROLES
    foreign_roles = MappingProxyType(
        {
            role: f'role {role!r} is one of a body on a line: write `model = "line"` in [mechanism]'
            for role in LINE_ROLES
        }
    )
    spans_s = (0.12, 0.3)
    recoils_once = True
    force_rate_hz = 20e3
    never_none = MappingProxyType(
        {"friction": 100.0, "bore_friction": 0.006, "unread_share": 0.01, "unread_force": 0.002}
    )
    carriage_roles = CARRIAGE_ROLES

    def forces(self, channels: Sequence[ChannelSpec]) -> tuple[ForceInput, ...]:
        """List the forces of its three pressures."""
        return self.pressures(channels)

    def series(self, forces: Sequence[ForceInput]) -> tuple[str, ...]:  # noqa: ARG002 - its forces are roles
        """List the roles of its pressures, and of the motion of recoiling part, carriage and tipping part."""
        return (
            "recoil_acceleration", "carriage_acceleration_x", "carriage_acceleration_y", "carriage_rate",
            "tipping_rate", *GAUGE_ROLES,
        )  # fmt: skip

    def grid_series(self, forces: Sequence[ForceInput]) -> tuple[str, ...]:  # noqa: ARG002 - as above
        """List the accelerometer and the breech pressure."""
        return "recoil_acceleration", "breech_pressure"

    @property
    def at_rest(self) -> Mapping[str, float]:
        """Readings at rest in battery by role.

        The recoiling part's accelerometer points along -e5, so it feels ``-g sin(phi20)``; the carriage's feel
        ``g sin(phi10)`` and ``g cos(phi10)`` (specific force; `measured_acceleration.carriage_specific_force`). The
        recuperator holds the part with a pressure that is not known.
        """
        return {
            "recoil_acceleration": -self.g * math.sin(self.phi20),
            "carriage_acceleration_x": self.g * math.sin(self.phi10),
            "carriage_acceleration_y": self.g * math.cos(self.phi10),
            "carriage_rate": 0.0,
            "tipping_rate": 0.0,
            "breech_pressure": 0.0,
            "brake_pressure": 0.0,
        }

    def travel_acceleration(self, inertial: ArrayLike, *moving: Any, **carriage: Any) -> NDArray[np.float64]:
        """Return x'' along the tipping part, m/s^2, shape (...)."""
        return relative_acceleration(self, inertial, *moving, **carriage)

    @classmethod
    def symbols_of(cls, roles: Collection[str]) -> tuple[str, ...]:  # noqa: ARG003 - it has all three pressures
        """Names of all values."""
        return cls.symbols()

    @classmethod
    def required(cls, roles: Collection[str] = frozenset()) -> tuple[str, ...]:  # noqa: ARG003 - as above
        """Names of the lengths, angles and areas, of the specification mass and the friction."""
        return (
            "m3", "phi20", "friction", "XA", "YA", "b", "d", "phi10", "bore_area", "brake_area", "recuperator_area",
        )  # fmt: skip
