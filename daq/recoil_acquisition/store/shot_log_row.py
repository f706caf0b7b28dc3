"""A row of the shot log: what people and the program know of a shot, by columns that have a meaning."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from recoil_acquisition.files.strict_json import as_floats

COLUMNS = (
    "shot", "time", "configuration", "added_mass_kg", "u_added_mass_kg", "charge", "charge_temperature_c",
    "elevation_deg", "exclude", "notes",
)  # fmt: skip
"""Columns of a log that the program begins."""
FURTHER = ("muzzle_velocity_m_s", "u_muzzle_velocity_m_s")
"""Columns that have a meaning where somebody adds them."""
KNOWN = (*COLUMNS, *FURTHER)
"""Columns that have a meaning."""
NUMBERS: Mapping[str, str] = MappingProxyType(
    {
        "added_mass_kg": "kg", "u_added_mass_kg": "kg", "charge_temperature_c": "degC", "elevation_deg": "deg",
        "muzzle_velocity_m_s": "m/s", "u_muzzle_velocity_m_s": "m/s",
    }
)  # fmt: skip
"""Columns that hold a number or nothing -> the number's unit."""

POSSIBLE = {
    "charge_temperature_c": (-273.15, math.inf), "elevation_deg": (-90.0, 90.0), "muzzle_velocity_m_s": (1.0, 2e4),
}  # fmt: skip
"""Bounds beyond which a number is none of its column's."""
USUAL = {
    "added_mass_kg": (0.0, 5000.0), "u_added_mass_kg": (0.0, 100.0), "charge_temperature_c": (-80.0, 150.0),
    "elevation_deg": (-90.0, 90.0), "muzzle_velocity_m_s": (20.0, 3000.0), "u_muzzle_velocity_m_s": (0.0, 100.0),
}  # fmt: skip
"""Bounds beyond which a sign, a unit or a column was rather mistaken."""


@dataclass(frozen=True)
class ShotLogRow:
    """A shot's row.

    Attributes
    ----------
    shot
        The shot's name, also where a spreadsheet took the zeros before it away.
    time
        Time of the shot, as it stands in the log.
    configuration
        Name of how the mechanism was built for the shot.
    added_mass_kg, u_added_mass_kg
        Mass that was added to the recoiling part, negative if some was taken off, and its standard uncertainty.
    charge_temperature_c, elevation_deg
        Temperature and elevation; None where the log has none.
    exclude
        Reason why the shot is left out where shots are combined; empty if it is not.
    own
        Cells of a rig's own columns, those that are not empty.
    u_added_mass_stated
        Whether the log has an uncertainty of the added mass, be it 0.
    muzzle_velocity_m_s, u_muzzle_velocity_m_s
        Muzzle velocity that was measured, and its standard uncertainty; None where the log has none.
    """

    shot: str
    time: str = ""
    configuration: str = ""
    added_mass_kg: float = 0.0
    u_added_mass_kg: float = 0.0
    charge: str = ""
    charge_temperature_c: float | None = None
    elevation_deg: float | None = None
    exclude: str = ""
    notes: str = ""
    own: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    u_added_mass_stated: bool = False
    muzzle_velocity_m_s: float | None = None
    u_muzzle_velocity_m_s: float | None = None

    @property
    def doubts(self) -> tuple[str, ...]:
        """Numbers of it that are rather a sign, a unit or a column that was mistaken, each in a sentence."""
        stated = {name: value for name in NUMBERS if (value := getattr(self, name)) is not None}
        found = [
            f"{name} {stated[name]:g} is not between {low:g} and {high:g}: a wrong unit, or another column's?"
            for name, (low, high) in USUAL.items()
            if name in stated and not low <= stated[name] <= high and not (name == "added_mass_kg" and stated[name] < 0)
        ]
        added_kg = self.added_mass_kg
        if added_kg < 0:
            found.insert(
                0, f"added_mass_kg {added_kg:g} says that {-added_kg:g} kg were taken off the recoiling part; if they "
                f"were added, it is {-added_kg:g}",
            )  # fmt: skip
        if added_kg and self.u_added_mass_kg > abs(added_kg):
            found.append(
                f"u_added_mass_kg {self.u_added_mass_kg:g} is more than the added mass of {added_kg:g} kg itself"
            )
        return tuple(found)

    @property
    def added_mass_is_exact(self) -> bool:
        """Whether the added mass is taken as exact because nothing states its uncertainty."""
        return self.added_mass_kg != 0.0 and self.u_added_mass_kg == 0.0 and not self.u_added_mass_stated

    def to_json(self) -> dict[str, Any]:
        """Return the cells that are not empty, by column: numbers where a column holds numbers, else texts."""
        cells = {name: getattr(self, name) for name in KNOWN}
        stated = self.u_added_mass_stated or self.u_added_mass_kg != 0.0
        empty = {name for name, value in cells.items() if value in ("", None)}
        empty |= {"added_mass_kg"} if self.added_mass_kg == 0.0 and not stated else set()
        empty |= set() if stated else {"u_added_mass_kg"}
        return {name: value for name, value in cells.items() if name not in empty} | dict(self.own)

    @classmethod
    def of_json(cls, cells: Mapping[str, Any]) -> ShotLogRow:
        """Return the row that `to_json` said; TypeError if there is no shot, or no number where one belongs."""
        known = {name: value for name, value in cells.items() if name in KNOWN}
        for name, value in known.items():
            if isinstance(value, bool) or not isinstance(value, int | float if name in NUMBERS else str):
                raise TypeError(f"{name} {value!r}")
        own = MappingProxyType({name: str(value) for name, value in cells.items() if name not in KNOWN})
        known = as_floats(known, cls)
        return cls(**known, own=own, u_added_mass_stated="u_added_mass_kg" in cells)
