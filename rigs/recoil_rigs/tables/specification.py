"""The mass that a recoiling part should have: what an identified mass is compared with."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Specification:
    """Masses that the rig file and the shot log state of what the forces move.

    Attributes
    ----------
    m3_kg, u_m3_kg
        Mass of the recoiling part by the rig file, and its standard uncertainty.
    added_kg, u_added_kg
        Mass that was added for a shot by the shot log; negative if some was taken off.
    carried_kg, u_carried_kg
        Mass of oil and rods that the forces move beside it, by the rig file.
    """

    m3_kg: float
    u_m3_kg: float = 0.0
    added_kg: float = 0.0
    u_added_kg: float = 0.0
    carried_kg: float = 0.0
    u_carried_kg: float = 0.0

    @property
    def mass_kg(self) -> float:
        """Their sum."""
        return self.m3_kg + self.added_kg + self.carried_kg

    @property
    def u_kg(self) -> float:
        """Standard uncertainty of the sum."""
        return math.hypot(self.u_m3_kg, self.u_added_kg, self.u_carried_kg)

    def normalised_error(self, mass_kg: float, u_kg: float) -> float:
        """Return ``E_n = (m - m_spec) / (2 sqrt(u^2 + u_spec^2))`` (ISO/IEC 17043, annex B) of an identified mass.

        NaN where neither has an uncertainty.
        """
        expanded = 2 * math.hypot(u_kg, self.u_kg)
        return (mass_kg - self.mass_kg) / expanded if expanded > 0 else math.nan

    def to_json(self) -> dict[str, float]:
        """Return its parts in JSON types, as reports have them."""
        return {
            "m3_kg": self.m3_kg,
            "u_m3_kg": self.u_m3_kg,
            "added_mass_kg": self.added_kg,
            "u_added_mass_kg": self.u_added_kg,
            "carried_mass_kg": self.carried_kg,
            "u_carried_mass_kg": self.u_carried_kg,
        }


def mass_decimals(u: float | None, least: int = 2) -> int:
    """Return how many decimals a mass has where one is in kilograms and another in grams.

    Parameters
    ----------
    u
        Standard uncertainty of the mass, or of what is compared with it; None and NaN are "no number".
    least
        Decimals of the mass of a gun.
    """
    if u is None or not math.isfinite(u) or u <= 0.0:
        return least
    return max(least, 1 - int(f"{u:.1e}".partition("e")[2]))
