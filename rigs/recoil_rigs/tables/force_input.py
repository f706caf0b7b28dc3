"""One measured force of a rig, and what the three pressures of a gun act on."""

from __future__ import annotations

from dataclasses import dataclass

from recoil_rigs.tables.channel_table import ChannelSpec

AREAS = ("bore_area", "brake_area", "recuperator_area")
"""Areas on which the pressures of `recoil_rigs.tables.rig_tables.GAUGE_ROLES` act, in their order."""
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
