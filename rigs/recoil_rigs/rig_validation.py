"""From pydantic's errors to faults of a rig file, each with its key path and what would be right."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from recoil_acquisition.errors import Fault, nearest_first
from recoil_rigs.rig_tables import (
    ExposureAlignment,
    FixedAlignment,
    MotionAlignment,
    RedundantAlignment,
    Sensor,
    Table,
    TriggerAlignment,
)

Row = TypeVar("Row", bound=Table)

ALIGNMENTS: Mapping[str, type[Table]] = MappingProxyType(
    {
        "motion": MotionAlignment,
        "redundant": RedundantAlignment,
        "trigger": TriggerAlignment,
        "exposure": ExposureAlignment,
        "fixed": FixedAlignment,
    }
)
"""Method of an alignment -> its table."""


def validated_rows(tables: Mapping[str, Any], key: str, model: type[Row], faults: list[Fault]) -> list[tuple[str, Row]]:
    """Validate an array of tables; return the sound ones with their key paths.

    Parameters
    ----------
    tables : mapping
        The whole rig file.
    key : str
        ``source`` or ``channel``.
    model : type of Table
    faults : list of Fault
        Every fault found is appended.
    """
    rows = tables.get(key, [])
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        faults.append(Fault(key, f"at least one table [[{key}]] is needed"))
        return []
    sound: list[tuple[str, Row]] = []
    for i, row in enumerate(rows):
        where = f"{key}[{i}]" + (f" '{row['name']}'" if isinstance(row.get("name"), str) else "")
        try:
            sound.append((where, model.model_validate(row)))
        except ValidationError as error:
            faults += [_fault(item, where, model) for item in error.errors(include_url=False)]
    return sound


def unknown_keys(table: Mapping[str, Any], known: Sequence[str], prefix: str) -> list[Fault]:
    """Name the keys of a table that it should not have, each with the nearest known one."""
    return [_unknown_key(f"{prefix}{key}", key, known) for key in table if key not in known]


def names_in(tables: Mapping[str, Any], key: str) -> list[str]:
    """Names in an array of tables, those of faulty tables too, so that one fault does not cause others."""
    rows = tables.get(key, [])
    if not isinstance(rows, list):
        return []
    return [row["name"] for row in rows if isinstance(row, dict) and isinstance(row.get("name"), str)]


def did_you_mean(name: str, names: Sequence[str]) -> str:
    """Phrase a question for the nearest known name."""
    return f"did you mean {nearest_first(name, names)[0]!r}?" if names else "none is declared"


_PROBLEMS = {
    "date_type": "must be a date such as 2026-03-01, without quotes",
    "dict_type": "must be a table",
    "missing": "is missing",
    "model_attributes_type": "must be a table",
    "model_type": "must be a table",
    "string_too_short": "must not be empty",
    "too_long": "has too many values",
    "tuple_type": "must be an array of two numbers",
}
"""Type of a pydantic error -> the same in the words of a rig file."""


def _fault(item: ErrorDetails, where: str, model: type[Table]) -> Fault:
    """Say one of pydantic's errors in the words of a rig file."""
    parts = list(item["loc"])
    if len(parts) > 1 and parts[0] == "align":
        model = ALIGNMENTS[str(parts.pop(1))]  # pydantic puts the method there, which is no key
    elif parts and parts[0] == "sensor":
        model = Sensor
    place = where + "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts)
    kind, found = item["type"], item["input"]
    if kind == "extra_forbidden":
        return _unknown_key(place, str(parts[-1]), list(model.model_fields))
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        method = found.get("method")
        known = list(ALIGNMENTS)
        if kind == "union_tag_not_found":
            return Fault(f"{place}.method", f"is missing; one of {', '.join(known)}")
        nearest = did_you_mean(str(method), known)
        return Fault(f"{place}.method", f"unknown method {method!r}; {nearest} (known: {', '.join(known)})")
    problem = _PROBLEMS.get(kind, item["msg"].removeprefix("Value error, ").replace("Input should be", "must be"))
    shown = "" if kind == "missing" or isinstance(found, dict | BaseModel) else f", found {_short(found)}"
    return Fault(place, problem[:1].lower() + problem[1:] + shown)


def _unknown_key(place: str, key: str, known: Sequence[str]) -> Fault:
    nearest = nearest_first(key, sorted(known))
    return Fault(place, f"unknown key; did you mean `{nearest[0]}`? (known: {', '.join(sorted(known))})")


def _short(value: Any) -> str:
    """Show a value as the file has it, cut to what fits into a line."""
    text = repr(value) if not isinstance(value, dt.date) else value.isoformat()
    return text if len(text) <= 60 else f"{text[:57]}..."
