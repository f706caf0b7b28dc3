"""Values of a rig file that only a person knows and that nobody has stated yet: texts that begin with ``TODO``.

They are taken out before the file is validated, so that what else is wrong shows, and refused one by one: nothing is
ever taken in their place.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from recoil_acquisition.errors import Fault, FaultCode, KeyPath, Row

OPEN_MARK = "TODO"
"""Word by which the text of an open value begins."""
_OPEN = re.compile(rf"{OPEN_MARK}\b[\s:,]*(.*)", re.DOTALL)
_ROWS = ("source", "channel")
"""Arrays of tables whose rows have names."""
_OF_PEOPLE = ("mechanism", "knowledge")
"""Tables all of whose values only a person knows."""
_OF_PEOPLE_IN_CHANNELS = ("role", "polarity", "sensor")
"""Keys of a channel likewise."""


@dataclass(frozen=True)
class OpenValue:
    """A value that nobody has stated yet.

    Attributes
    ----------
    parts
        Parts of its key, outermost first.
    question
        Text behind the mark: what it means, its unit, where it stands; empty if nothing stands there.
    """

    parts: KeyPath
    question: str

    def fault(self) -> Fault:
        """Return the fault for which a rig file with it is refused."""
        asked = f": {self.question}" if self.question else ": write the value in place of the text"
        return Fault(self.parts, f"is open{asked}", FaultCode.OPEN)


def question_of(value: Any) -> str | None:
    """Return the question of an open value, or of an array that holds one; None of any other value."""
    if isinstance(value, list):
        return next((question for one in value if (question := question_of(one)) is not None), None)
    found = _OPEN.match(value) if isinstance(value, str) else None
    return None if found is None else found.group(1).strip()


@dataclass(frozen=True)
class StatedTables:
    """Tables of a rig file without its open values.

    Attributes
    ----------
    open
        Open values, in the order of the file.
    stated
        Number of the values that only a person knows and that the tables state: of mechanism, knowledge, roles and
        sensors. An array of numbers is one.
    """

    tables: dict[str, Any]
    open: tuple[OpenValue, ...]
    stated: int


def without_open_values(tables: Mapping[str, Any]) -> StatedTables:
    """Part a rig file's tables from its open values."""
    found: list[OpenValue] = []
    stated: list[KeyPath] = []
    kept = _sound(tables, (), found, stated)
    return StatedTables(kept, tuple(found), sum(map(_is_of_people, stated)))


def _sound(table: Mapping[str, Any], where: KeyPath, found: list[OpenValue], stated: list[KeyPath]) -> dict[str, Any]:
    kept: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            kept[key] = _sound(value, (*where, key), found, stated)
        elif isinstance(value, list) and any(isinstance(one, dict) for one in value):
            kept[key] = [
                _sound(one, _place(where, key, i, one), found, stated) if isinstance(one, dict) else one
                for i, one in enumerate(value)
            ]
        elif (question := question_of(value)) is not None:
            found.append(OpenValue((*where, key), question))
        else:
            kept[key] = value
            stated.append((*where, key))
    return kept


def _is_of_people(parts: KeyPath) -> bool:
    """Whether only a person knows a value, by its key."""
    is_of_channel = isinstance(parts[0], Row) and parts[0].table == "channel"
    return parts[1] in _OF_PEOPLE_IN_CHANNELS if is_of_channel else parts[0] in _OF_PEOPLE


def _place(where: KeyPath, key: str, index: int, row: Mapping[str, Any]) -> KeyPath:
    if where or key not in _ROWS:
        return (*where, key, index)
    name = row.get("name")
    return (Row(key, name if isinstance(name, str) else None, index),)
