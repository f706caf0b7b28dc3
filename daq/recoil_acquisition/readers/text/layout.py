"""The layout of a text table that does not tell it, as the rig declares it in ``[source.layout]``."""

from __future__ import annotations

import codecs
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from recoil_acquisition.errors import ReadError, nearest_first

SEPARATORS = ("\t", ";", ",", "|")
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1250", "cp1251", "cp1252", "latin-1", "ascii")
UNITS = ("s", "ms", "us", "ns", "min", "h")
MOST_ROWS = 1000
"""Line that a header or first row may be at most: the file's beginning is looked at alone."""


@dataclass(frozen=True)
class TextLayout:
    """How a text table is laid out.

    Attributes
    ----------
    separator : str
        Between cells: tab, ``;``, ``,`` or ``|``.
    first_row : int
        Line of the first row of numbers, from 1.
    decimal : str
        ``.`` or ``,``.
    encoding : str or None
        By the byte order mark, UTF-8 or Windows-1252 if left out.
    header_row, unit_row : int or None
        Lines of names and units, from 1.
    time_column : str or int or None
        Name of the time column, or its number from 1.
    time_unit : str or None
        Unit of relative time; None if the column holds stamps.
    rate_hz : float or None
        Sample rate, where there is no column of time.
    names, units : tuple of str
        Of every column, where no row of the file holds them.
    missing : tuple of str
        Texts that mean a lost sample.
    comment : str
        What begins a line that is no row.
    """

    separator: str
    first_row: int
    decimal: str = "."
    encoding: str | None = None
    header_row: int | None = None
    unit_row: int | None = None
    time_column: str | int | None = None
    time_unit: str | None = None
    rate_hz: float | None = None
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    comment: str = ""


KEYS = tuple(field.name for field in fields(TextLayout))


def layout_faults(table: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return every fault of a declared layout: its key, and what is wrong and would be right."""
    faults = []
    for key in table:
        if key not in KEYS:
            near = ", ".join(f"`{name}`" for name in nearest_first(str(key), KEYS)[:3])
            faults.append((str(key), f"no such key; the nearest are {near}"))
    faults += [
        (key, f"must be {wanted}, found {table[key]!r}")
        for key, wanted in _KINDS.items()
        if key in table and not _fits(key, table[key])
    ]
    faults += [(key, "is missing") for key in ("separator", "first_row") if key not in table]
    return faults or _contradictions(table)


_KINDS = {
    "separator": 'one of "\\t", ";", "," and "|"',
    "first_row": f"the line of the first row of numbers, from 1 to {MOST_ROWS}",
    "decimal": '"." or ","',
    "encoding": f"one of {', '.join(ENCODINGS)}",
    "header_row": "the line of the names, from 1",
    "unit_row": "the line of the units, from 1",
    "time_column": "the name of the column of time, or its number from 1",
    "time_unit": f"one of {', '.join(UNITS)}",
    "rate_hz": "a positive number",
    "names": "a list of different texts",
    "units": "a list of texts",
    "missing": "a list of texts",
    "comment": "a text of one to four ASCII characters that begins no number",
}


def _fits(key: str, value: Any) -> bool:
    if key in ("first_row", "header_row", "unit_row"):
        return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MOST_ROWS
    if key == "time_column":
        whole = isinstance(value, int) and not isinstance(value, bool) and value >= 1
        return whole or (isinstance(value, str) and bool(value))
    if key == "rate_hz":
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return number and math.isfinite(value) and value > 0
    if key in ("names", "units", "missing"):
        texts = isinstance(value, list | tuple) and all(isinstance(text, str) for text in value)
        return texts and (key != "names" or (len(value) > 1 and len(set(value)) == len(value) and all(value)))
    if not isinstance(value, str):
        return False
    if key == "comment":
        return 1 <= len(value) <= 4 and value.isascii() and value.isprintable() and value[0] not in "+-.,;| 0123456789"
    if key == "encoding":
        return _encoding(value) in {_encoding(name) for name in ENCODINGS}
    return value in {"separator": SEPARATORS, "decimal": (".", ","), "time_unit": UNITS}[key]


def _encoding(name: str) -> str:
    try:
        return codecs.lookup(name).name
    except (LookupError, ValueError):
        return ""


def _contradictions(table: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the faults between keys that are sound alone."""
    faults = []
    if table["separator"] == "," and table.get("decimal") == ",":
        faults.append(("decimal", "a comma cannot both separate cells and mark decimals"))
    if "names" not in table and "header_row" not in table:
        faults.append(("header_row", "is missing; or declare `names`"))
    if "names" in table and "header_row" in table:
        faults.append(("names", "is declared twice: by `header_row` as well"))
    if "units" in table and "unit_row" in table:
        faults.append(("units", "is declared twice: by `unit_row` as well"))
    if "units" in table and "names" in table and len(table["units"]) != len(table["names"]):
        faults.append(("units", f"has {len(table['units'])} texts, `names` has {len(table['names'])}"))
    faults += [
        (key, f"must lie above `first_row`, {table['first_row']}, found {table[key]}")
        for key in ("header_row", "unit_row")
        if table.get(key, 0) >= table["first_row"]
    ]
    if "unit_row" in table and table.get("header_row") == table["unit_row"]:
        faults.append(("unit_row", "is the row of names as well; leave it out where names hold their units"))
    if "time_column" not in table and "rate_hz" not in table:
        faults.append(("time_column", "is missing; or declare `rate_hz`"))
    if "time_unit" in table and "time_column" not in table:
        faults.append(("time_unit", "needs `time_column`"))
    faults += _faults_of_time_column(table)
    return faults


def _faults_of_time_column(table: Mapping[str, Any]) -> list[tuple[str, str]]:
    column, names = table.get("time_column"), table.get("names")
    if names is None or column is None:
        return []
    if isinstance(column, str) and column not in names:
        near = ", ".join(repr(name) for name in nearest_first(column, names)[:3])
        return [("time_column", f"{column!r} is not among `names`; the nearest are {near}")]
    if isinstance(column, int) and column > len(names):
        return [("time_column", f"is {column}, but there are {len(names)} names")]
    return []


def layout_from_table(table: Mapping[str, Any]) -> TextLayout:
    """Make a layout from what the rig declares.

    Raises
    ------
    ReadError
        With every fault.
    """
    faults = layout_faults(table)
    if faults:
        raise ReadError(
            "the declared layout is at fault: " + " | ".join(f"{key}: {problem}" for key, problem in faults),
            place="[source.layout]",
        )
    values: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}
    return TextLayout(**values)


def column_named(names: Sequence[str], wanted: str | int) -> int | None:
    """Return the index of a column by its name or its number from 1; None if there is none or more than one."""
    if isinstance(wanted, int):
        return wanted - 1 if wanted <= len(names) else None
    return names.index(wanted) if names.count(wanted) == 1 else None
