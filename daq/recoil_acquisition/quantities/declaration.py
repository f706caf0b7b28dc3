"""Tables that a rig file declares: strict types by pydantic, and every fault in the words of a rig file.

A number in quotes, ``true`` for a number or a date in quotes is a fault, because a rig file in which ``u_rel = true``
means 100 % would be worse than one that is refused. What a key means, with its unit, stands in its field's
description: a fault of the key quotes it. A text of a number with a unit is what it says in the key's own unit, which
the key's name ends in.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from types import MappingProxyType, NoneType
from typing import Annotated, Any, Generic, TypeVar, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, TypeAdapter, ValidationError, ValidationInfo
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from recoil_acquisition.errors import Fault, FaultCode, KeyPath, Row, did_you_mean, near
from recoil_acquisition.quantities.typed_quantity import NoNumberError, TypedError, number_and_unit, typed_quantity

UNITS_BY_ENDING: Mapping[str, str] = MappingProxyType(
    {
        "m_s2": "m/s2", "m_s": "m/s", "rad_s": "rad/s", "n_s_m": "N s/m", "s": "s", "hz": "Hz", "m": "m", "kg": "kg",
        "n": "N", "pa": "Pa", "rad": "rad", "rel": "", "share": "", "drift": "", "allowance": "", "frame_rate": "Hz",
        "position": "m", "mm_per_px": "mm/px",
    }
)  # fmt: skip
"""End of a key -> the unit of its value, empty for a share; the longest that fits counts."""


def unit_of_key(key: str) -> str | None:
    """Return the unit that a key's value has by the key's name; None where the name says none."""
    fitting = [ending for ending in UNITS_BY_ENDING if f"_{key}".endswith(f"_{ending}")]
    return UNITS_BY_ENDING[max(fitting, key=len)] if fitting else None


def stated_number(value: Any, unit: str | None, *, difference: bool = False) -> Any:
    """Return what a rig file states as a number: a text with a unit in the key's own, anything else as it stands.

    Parameters
    ----------
    unit
        Unit of the key; None where it is not known.
    difference
        Whether it is a standard uncertainty, as for `typed_quantity`.

    Raises
    ------
    TypedError
        If the text begins with a number, and that is in doubt or its unit is none of the key's.
    """
    if not isinstance(value, str) or unit is None:
        return value
    try:
        has_unit = bool(number_and_unit(value)[1])
    except NoNumberError:
        return value
    return typed_quantity(value, unit, difference=difference) if has_unit else value


def _in_the_unit_of_the_key(value: Any, info: ValidationInfo) -> Any:
    key = info.field_name or ""
    try:
        return stated_number(value, unit_of_key(key), difference=key.startswith("u_"))
    except TypedError as error:
        raise PydanticCustomError(_TYPED, "{problem}", {"problem": str(error)}) from error


_TYPED = "typed_quantity"
"""Type of the error of a text that is no value of its key."""
_Stated = BeforeValidator(_in_the_unit_of_the_key)
Positive = Annotated[float, _Stated, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, _Stated, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, _Stated, Field(allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]
# TOML has arrays, not tuples; what is in them is strict all the same
Pair = Annotated[tuple[Finite, Finite], Field(strict=False)]
Texts = Annotated[tuple[str, ...], Field(strict=False)]


STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
"""Configuration ``__pydantic_config__`` of a dataclass: what `checked` asks of a record that the program wrote."""


class DeclaredTable(BaseModel):
    """A table of a rig file: frozen, strict about its keys and their types."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)

    def contradictions(self) -> Sequence[Fault]:
        """Return the faults between keys that are sound alone, and in what a key holds, by their keys in the table."""
        return []


Declared = TypeVar("Declared", bound=BaseModel)
Recorded = TypeVar("Recorded")


def declared(model: type[Declared], table: Any, where: KeyPath, faults: list[Fault]) -> Declared | None:
    """Validate one table.

    Parameters
    ----------
    table
        Table as the TOML has it.
    where
        Key of the table, such as ``source[3] 'imu'``.
    faults
        List that every fault found is appended to.

    Returns
    -------
    model or None
        None if the table has a fault.
    """
    made = _validated(model, table, where, faults)
    wrong = [fault.below(where) for fault in _contradictions(made)]
    faults += wrong
    return None if wrong else made


def _validated(model: type[Declared], table: Any, where: KeyPath, faults: list[Fault]) -> Declared | None:
    try:
        return model.model_validate(table)
    except ValidationError as error:
        # a key that may be of two types has a fault of each
        # members of a union that refuse a value for reasons of their own say the same of it: it is one fault
        told = [_fault(item, where, model) for item in error.errors(include_url=False)]
        faults += (one for k, one in enumerate(told) if str(one) not in map(str, told[:k]))
        return None


def _contradictions(value: Any) -> Iterator[Fault]:
    """Yield the contradictions of a table and of the tables in it."""
    if isinstance(value, DeclaredTable):
        yield from value.contradictions()
    within = value if isinstance(value, BaseModel) else enumerate(value) if isinstance(value, tuple) else ()
    for key, one in within:
        yield from (fault.below((key,)) for fault in _contradictions(one))


@dataclass(frozen=True)
class DeclaredRow(Generic[Declared]):
    """A row of an array of tables, validated once.

    Attributes
    ----------
    where
        Key of the row, such as ``source[3] 'imu'``.
    texts
        Texts that it states, by their keys: also those of a row at fault, so that one fault does not cause others.
    table
        Row without keys that it should not have: one that is misspelt must not hide what else is wrong. None if what
        is left has a fault.
    sound
        Whether each of its keys is sound alone, and none is there that it should not have.
    """

    where: KeyPath
    texts: Mapping[str, str]
    table: Declared | None
    sound: bool


@dataclass(frozen=True)
class DeclaredRows(Generic[Declared]):
    """An array of tables; no row where there is a fault of the array."""

    rows: tuple[DeclaredRow[Declared], ...] = ()

    @property
    def names(self) -> list[str]:
        """Names of the rows, also of those at fault."""
        return [row.texts["name"] for row in self.rows if "name" in row.texts]

    @property
    def legible(self) -> list[tuple[KeyPath, Declared]]:
        """Rows that can be read, with their keys."""
        return [(row.where, row.table) for row in self.rows if row.table is not None]

    @property
    def sound(self) -> list[tuple[KeyPath, Declared]]:
        """Rows that are sound, with their keys."""
        return [(row.where, row.table) for row in self.rows if row.table is not None and row.sound]


def declared_rows(
    tables: Mapping[str, Any], key: str, model: type[Declared], faults: list[Fault]
) -> DeclaredRows[Declared]:
    """Validate an array of tables.

    Parameters
    ----------
    tables
        Tables of the whole rig file.
    key
        Key of the array: ``source`` or ``channel``.
    faults
        List that every fault found is appended to.
    """
    rows = tables.get(key, [])
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        faults.append(Fault((key,), f"at least one table [[{key}]] is needed", FaultCode.MISSING))
        return DeclaredRows()
    return DeclaredRows(tuple(_row(model, key, i, row, faults) for i, row in enumerate(rows)))


def _row(
    model: type[Declared], key: str, index: int, row: dict[str, Any], faults: list[Fault]
) -> DeclaredRow[Declared]:
    texts = MappingProxyType({one: value for one, value in row.items() if isinstance(value, str)})
    where = (Row(key, texts.get("name"), index),)
    table = _validated(model, row, where, faults)
    known = row if table is not None else _without_unknown_keys(model, row)
    with suppress(ValidationError):
        table = table or model.model_validate(known)
    faults += (fault.below(where) for fault in _contradictions(table))
    return DeclaredRow(where, texts, table, sound=known == row)


def _without_unknown_keys(model: type[BaseModel], table: dict[str, Any]) -> dict[str, Any]:
    """Return a table without the keys that it, or a table in it, should not have."""
    known = deepcopy(table)
    try:
        model.model_validate(table)
    except ValidationError as error:
        for item in error.errors(include_url=False):
            if item["type"] == "extra_forbidden":
                holder: Any = known
                for part in item["loc"][:-1]:
                    # pydantic puts there which member of a union it tried, which is no key
                    holder = holder[part] if isinstance(part, int) else holder.get(part, holder)
                holder.pop(item["loc"][-1], None)
    return known


def unknown_keys(table: Mapping[str, Any], known: Sequence[str], where: KeyPath) -> list[Fault]:
    """Name the keys of a table that it should not have, each with the nearest known one."""
    return [unknown_key((*where, key), str(key), known) for key in table if key not in known]


def unknown_key(place: KeyPath, key: str, known: Sequence[str]) -> Fault:
    """Name a key that a table should not have, with the nearest known one if any is near."""
    names = tuple(sorted(known))
    problem, meant = f"unknown key; {did_you_mean(key, names, quote='`')}", near(key, names)
    return Fault(place, problem, FaultCode.UNKNOWN, known=names, meant=() if meant is None else (meant,))


def checked(kind: type[Recorded], document: Mapping[str, Any]) -> Recorded:
    """Make a dataclass of what the program wrote of it as JSON; ValueError with every fault and its key's path."""
    try:
        if kind not in _ADAPTERS:
            _ADAPTERS[kind] = TypeAdapter(kind)
        made: Recorded = _ADAPTERS[kind].validate_json(json.dumps(document))
        return made
    except ValidationError as error:
        faults = [f"{_path(item['loc'])} {_problem(item)}" for item in error.errors(include_url=False)]
        raise ValueError("; ".join(faults)) from error


_ADAPTERS: dict[type[Any], TypeAdapter[Any]] = {}
"""Adapters by their types, made once each: one takes as long as a thousand checks."""

_PROBLEMS = {
    "date_type": "must be a date such as 2026-03-01, without quotes",
    "dict_type": "must be a table",
    "model_attributes_type": "must be a table",
    "model_type": "must be a table",
    "string_too_short": "must not be empty",
    "too_long": "has too many values",
    "too_short": "has too few values",
    "list_type": "must be an array",
    "tuple_type": "must be an array",
    "bool_type": "must be true or false",
    "float_type": "must be a finite number",
    "int_type": "must be a whole number",
    "string_type": "must be a text",
    "finite_number": "must be a finite number",
    "dataclass_type": "must be a table",
    "unexpected_keyword_argument": "is unknown",
    "missing": "is missing",
}
"""Type of a pydantic error -> the same in the words of a rig file."""
_OF_THE_KEY = {_TYPED, "value_error", "missing", "extra_forbidden", "union_tag_invalid", "union_tag_not_found"}


_CODES = {
    _TYPED: FaultCode.UNIT,
    "missing": FaultCode.MISSING,
    "finite_number": FaultCode.RANGE,
    "greater_than": FaultCode.RANGE,
    "greater_than_equal": FaultCode.RANGE,
    "less_than": FaultCode.RANGE,
    "less_than_equal": FaultCode.RANGE,
}
"""Type of a pydantic error -> code, where the type's ending does not tell."""


def _code(item: ErrorDetails) -> FaultCode:
    kind = item["type"]
    if kind == "value_error" and isinstance(item["input"], dict | BaseModel):
        return FaultCode.CONTRADICTION  # found by a check of a whole table
    return _CODES.get(kind, FaultCode.TYPE if kind.endswith("_type") else FaultCode.VALUE)


def _fault(item: ErrorDetails, where: KeyPath, model: type[BaseModel]) -> Fault:
    """Say one of pydantic's errors in the words of a rig file."""
    place, holder, field = _at(item["loc"], where, model)
    kind, found = item["type"], item["input"]
    if kind == "extra_forbidden":
        known = [field.alias or name for name, field in holder.model_fields.items()] if holder else []
        return unknown_key(place, str(item["loc"][-1]), known)
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        key = item["ctx"]["discriminator"].strip("'")
        tags = [tag.strip("'") for tag in _tags(field, key)]
        if kind == "union_tag_not_found":
            return Fault((*place, key), f"is missing; one of {', '.join(tags)}", FaultCode.MISSING)
        tag = str(found.get(key))
        return Fault((*place, key), f"unknown {key} {tag!r}; {did_you_mean(tag, tags)}", FaultCode.VALUE)
    meaning = (field.description or "") if field else ""
    if kind == "missing":
        return Fault(place, f"is missing{f': {meaning}' if meaning else ''}", FaultCode.MISSING)
    problem = f"must be {meaning}" if meaning and kind not in _OF_THE_KEY else _problem(item)
    shown = "" if isinstance(found, dict | BaseModel) else f", found {_short(found)}"
    return Fault(place, problem + shown, _code(item))


def _problem(item: ErrorDetails) -> str:
    said = item["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    return _PROBLEMS.get(item["type"], said[:1].lower() + said[1:])


def _path(loc: tuple[int | str, ...]) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc).lstrip(".")


def _at(
    loc: tuple[int | str, ...], where: KeyPath, model: type[BaseModel]
) -> tuple[KeyPath, type[BaseModel] | None, FieldInfo | None]:
    """Follow the place of an error through nested tables: its key, the table that it is in, and its field."""
    holder: type[BaseModel] | None = model
    kind: Any = model
    field: FieldInfo | None = None
    for part in loc:
        if isinstance(part, int):
            where = (*where, part)
            kind = next(iter(get_args(kind)), None)
        elif _is_table(kind):
            where = (*where, part)
            holder, field = kind, _field_of(kind, part)
            kind = None if field is None else _plain(field.annotation)
        elif get_origin(kind) is dict:
            where = (*where, part)
        else:
            # pydantic puts there which member of a union it tried, which is no key
            kind = next(iter(_members(kind, part)), None)
    return where, holder, field


def _field_of(model: type[BaseModel], key: str) -> FieldInfo | None:
    """Return the field that a table's key is of; it may have another name in the program."""
    return next((field for name, field in model.model_fields.items() if key == (field.alias or name)), None)


def _plain(kind: Any) -> Any:
    """Take what Annotated and Optional put around a type off it."""
    while True:
        if get_origin(kind) is Annotated:
            kind = get_args(kind)[0]
        elif NoneType in get_args(kind):
            rest = [one for one in get_args(kind) if one is not NoneType]
            if len(rest) > 1:
                return kind
            kind = rest[0]
        else:
            return kind


def _members(union: Any, tag: str) -> list[type[BaseModel]]:
    """Return the tables of a union that bear a tag."""
    return [one for one in get_args(union) if _is_table(one) and tag in _literals(one)]


def _is_table(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)


def _literals(model: type[BaseModel]) -> list[str]:
    return [str(tag) for field in model.model_fields.values() for tag in get_args(field.annotation)]


def _tags(field: FieldInfo | None, key: str) -> list[str]:
    members = get_args(_plain(field.annotation)) if field else ()
    return [str(tag) for one in members for tag in get_args(one.model_fields[key].annotation)]


def _short(value: Any) -> str:
    """Show a value as the file has it, cut to what fits into a line."""
    text = repr(value) if not isinstance(value, dt.date) else value.isoformat()
    return text if len(text) <= 60 else f"{text[:57]}..."
