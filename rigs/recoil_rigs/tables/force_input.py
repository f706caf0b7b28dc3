"""The measured forces of a rig, in the order in which every table of its forces has them.

A gun has three: the breech drives, brake and recuperator hold, each a pressure on an area. A body on a line has a force
for each channel that reads one, driving or resisting, and one for each pressure that has a channel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from recoil_rigs.mechanism.mechanism_parameters import Mechanism
from recoil_rigs.tables.rig_tables import FORCE_ROLES, GAUGE_ROLES, ChannelSpec

AREAS = ("bore_area", "brake_area", "recuperator_area")
"""Areas on which the pressures of `GAUGE_ROLES` act, in their order."""
SIGNS = (1.0, -1.0, -1.0)
"""Signs of the forces of these pressures: the breech drives, the others hold."""


@dataclass(frozen=True)
class ForceInput:
    """One measured force on the moving part.

    Attributes
    ----------
    name
        Name of its series, its column and its scale: the role of a pressure, the name of a channel of a force.
    role
        Role of the channels that measure it.
    sign
        Sign of its part in the whole force: 1 where it drives, -1 where it resists.
    per_reading
        Force per reading: m^2 of a pressure, 1 of a force.
    channels
        Channels of the rig that measure it; several are gauges of one pressure, whose mean counts.
    area
        Symbol of the area that a pressure acts on; empty of a force.
    """

    name: str
    role: str
    sign: float
    per_reading: float
    channels: tuple[ChannelSpec, ...]
    area: str = ""

    @property
    def unit(self) -> str:
        """Unit of its reading."""
        return "Pa" if self.area else "N"


def force_inputs(mechanism: Mechanism, channels: Sequence[ChannelSpec]) -> tuple[ForceInput, ...]:
    """List the measured forces of a mechanism whose sensors are given."""

    def of(role: str) -> tuple[ChannelSpec, ...]:
        return tuple(one for one in channels if one.role == role)

    of_pressures = zip(GAUGE_ROLES, SIGNS, mechanism.force_areas, AREAS, strict=True)
    pressures = [ForceInput(role, role, sign, area_m2, of(role), area) for role, sign, area_m2, area in of_pressures]
    if not mechanism.on_a_line:
        return tuple(pressures)
    # a share that is not read is missing of what resists alone
    per_reading = {1.0: 1.0, -1.0: 1.0 + mechanism.unread_share}
    forces = [
        ForceInput(one.name, role, sign, per_reading[sign], (one,))
        for role, sign in zip(FORCE_ROLES, (1.0, -1.0), strict=True)
        for one in of(role)
    ]
    return (*forces, *(one for one in pressures if one.channels))
