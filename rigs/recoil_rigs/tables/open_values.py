"""Values of a rig file that only a person knows and that nobody has stated yet: texts that begin with ``TODO``.

They are taken out before the file is validated, so that what else is wrong shows, and refused one by one: nothing is
ever taken in their place.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
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


def without_open_values(tables: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[OpenValue, ...]]:
    """Return a rig file's tables without its open values, and these in the order of the file."""
    found: list[OpenValue] = []
    return _sound(tables, (), found), tuple(found)


def _sound(table: Mapping[str, Any], where: KeyPath, found: list[OpenValue]) -> dict[str, Any]:
    kept: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            kept[key] = _sound(value, (*where, key), found)
        elif isinstance(value, list) and any(isinstance(one, dict) for one in value):
            kept[key] = [
                _sound(one, _place(where, key, i, one), found) if isinstance(one, dict) else one
                for i, one in enumerate(value)
            ]
        elif (question := question_of(value)) is not None:
            found.append(OpenValue((*where, key), question))
        else:
            kept[key] = value
    return kept


def _place(where: KeyPath, key: str, index: int, row: Mapping[str, Any]) -> KeyPath:
    if where or key not in _ROWS:
        return (*where, key, index)
    name = row.get("name")
    return (Row(key, name if isinstance(name, str) else None, index),)


def count_stated(tables: Mapping[str, Any]) -> int:
    """Return how many values a rig file states that only a person knows: of mechanism, knowledge, roles and sensors."""
    rows = tables.get("channel", [])
    channels = [row for row in rows if isinstance(row, dict)] if isinstance(rows, list) else []
    of_people = [tables[key] for key in _OF_PEOPLE if key in tables]
    of_people += [row[key] for row in channels for key in _OF_PEOPLE_IN_CHANNELS if key in row]
    return sum(1 for one in of_people for _ in _values(one))


def _values(value: Any) -> Iterator[Any]:
    """Yield the values of a table, of those in it too; an array of numbers is one."""
    if isinstance(value, dict):
        for one in value.values():
            yield from _values(one)
    elif isinstance(value, list) and any(isinstance(one, dict) for one in value):
        for one in value:
            yield from _values(one)
    else:
        yield value
