"""Units that somebody chose to read: one of a quantity, SI of the others. Everything is reckoned in SI."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from recoil_acquisition.quantities.quantity import find_unit


@dataclass(frozen=True)
class UnitChoice:
    """Units that were chosen.

    Attributes
    ----------
    by_quantity
        Quantity -> spelling of its unit; SI of those that are not there.
    """

    by_quantity: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def named(cls, names: Iterable[str]) -> UnitChoice:
        """Return the choice of some units; a name that is none chooses nothing."""
        units = [(name, find_unit(name)) for name in names]
        return cls({quantity: name for name, unit in units if unit is not None for quantity in unit.quantities})

    def factor(self, unit: str) -> tuple[float, str]:
        """Return the factor from a unit to the one chosen, and that one's name; 1 and its own where none is."""
        written = find_unit(unit)
        if written is None or not written.factor or written.offset:
            return 1.0, unit
        name = next((self.by_quantity[one] for one in written.quantities if one in self.by_quantity), None)
        chosen = None if name is None else find_unit(name)
        return (1.0, unit) if chosen is None or name is None else (written.factor / chosen.factor, name)

    def to_json(self) -> list[dict[str, object]]:
        """Return, JSON types, what a program needs that shows SI values in these units."""
        chosen = ((quantity, name, find_unit(name)) for quantity, name in sorted(self.by_quantity.items()))
        return [{"quantity": q, "unit": n, "si_per_unit": u.factor} for q, n, u in chosen if u is not None]


SI = UnitChoice()
"""Nothing is chosen."""
