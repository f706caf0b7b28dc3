"""Mass that is added to the recoiling part for the shots to come, as somebody at the range states it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.quantities.typed_quantity import typed_quantity
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from recoil_acquisition.store.shot_log_row import NUMBERS, ShotLogRow
from recoil_daq.live.line_entry import LineEntry
from recoil_rigs.tables.knowledge import Knowledge

QUESTION = "added mass of the shots to come, kg, and its u (such as 12.5 0.05); - for not stated"
NOT_STATED = "-"
"""Answer that takes back what was stated."""
_BETWEEN = re.compile(r"\s*(?:\+-|\+/-|±)\s*|(?<=\S)\s+(?=[+-]?[.,]?\d)", re.ASCII)
_TYPED = frozenset("0123456789.,+- ±/kgtlbozm")
_LONGEST = 32


@dataclass(frozen=True)
class AddedMass:
    """Mass that shots carry beside the bare recoiling part.

    Attributes
    ----------
    kg
        Mass, kg; 0 for nothing, negative if some was taken off.
    u_kg
        Standard uncertainty, kg; None if nobody stated it.
    """

    kg: float
    u_kg: float | None = None

    @classmethod
    def of(cls, text: str) -> AddedMass:
        """Read one number or two: the mass, and its standard uncertainty, in kg.

        Raises
        ------
        ValueError
            If the text is neither.
        """
        parts = [part for part in _BETWEEN.split(text.strip()) if part]
        if not 1 <= len(parts) <= 2:
            raise ValueError(f"{text.strip()!r} is no mass: one number or two, kg")
        numbers = []
        for part, column in zip(parts, ("added_mass_kg", "u_added_mass_kg"), strict=False):
            try:
                numbers.append(typed_quantity(part, NUMBERS[column]))
            except ValueError as error:
                raise ValueError(f"{part!r} is no mass: it {error}") from error
        kg, u_kg = (*numbers, None)[:2]
        if u_kg is not None and u_kg < 0.0:
            raise ValueError(f"a standard uncertainty is not negative: {u_kg:g}")
        return cls(kg or 0.0, 0.0 if u_kg is None and not kg else u_kg)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Signs and units that were rather mistaken, each in a sentence."""
        return ShotLogRow("", added_mass_kg=self.kg, u_added_mass_kg=self.u_kg or 0.0).doubts

    @property
    def cells(self) -> Mapping[str, str]:
        """Cells of the shot log."""
        stated = {} if self.u_kg is None else {"u_added_mass_kg": repr(self.u_kg)}
        return {"added_mass_kg": repr(self.kg), **stated}

    def note(self, out: Path, shot: str) -> str:
        """Write it into the row of a shot; return why it could not be, empty if it was.

        What somebody wrote into the row before stays.

        Parameters
        ----------
        out
            Folder of the shot files.
        """

        def with_mass(log: ShotLog) -> ShotLog:
            return log if "added_mass_kg" in log.cells(shot) else log.with_cells(shot, self.cells)

        try:
            ShotLog.changed(out / SHOT_LOG, with_mass)
        except RecoilDaqError as error:
            return f"the added mass of shot {shot}, {self}, is not in the shot log: {error}"
        return ""

    def __str__(self) -> str:
        exact = "" if not self.kg else ", taken as exact" if self.u_kg is None else f", u {self.u_kg:g} kg"
        return f"{self.kg:g} kg{exact}"


BARE = AddedMass(0.0, 0.0)
"""Nothing added."""


def weight_of(knowledge: Knowledge) -> AddedMass | None:
    """Return the mass that a rig has at hand for every second shot; None if it states none."""
    kg = knowledge.weighed_mass_kg
    return None if kg is None else AddedMass(kg, knowledge.u_weighed_mass_kg)


def mass_entry() -> LineEntry:
    """Return the entry of what the shots to come carry."""
    return LineEntry(QUESTION, _TYPED, _LONGEST)
