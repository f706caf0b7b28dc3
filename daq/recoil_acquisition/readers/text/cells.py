"""Cells of a text table: separators, decimal marks, lost samples, and headings with units."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

SEPARATORS = ("\t", ";", ",")
"""Separators in the order in which they are tried: a comma may also be a decimal mark."""

LOST_WORDS = ("nan", "-nan", "inf", "+inf", "-inf", "infinity", "+infinity", "-infinity")
"""Words, in any case, that stand for a sample that is no number."""

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")


def split_cells(line: str, separator: str) -> list[str]:
    """Split one line into stripped cells; quotes around a cell are taken off."""
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
    except (csv.Error, StopIteration):
        return [cell.strip().strip('"') for cell in line.split(separator)]


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, with either decimal mark."""
    return _NUMBER.fullmatch(cell) is not None


def is_lost(cell: str) -> bool:
    """Return whether a cell stands for a lost sample: empty, or one of `LOST_WORDS`."""
    return not cell or cell.casefold() in LOST_WORDS


def has_decimal_comma(rows: Sequence[Sequence[str]], separator: str) -> bool:
    """Return whether numbers are written with a decimal comma; never where the comma separates cells."""
    return separator != "," and any("," in cell and is_number(cell) for row in rows for cell in row)


def split_unit(heading: str) -> tuple[str, str]:
    """Split a column's heading into name and unit.

    The unit is the content of the last pair of parentheses or brackets at the end, or what stands
    behind a last comma and a space; ``()`` and ``(-)`` state none. Names may hold parentheses.

    Returns
    -------
    tuple of str
        Name and unit; the unit is empty if none is stated.
    """
    text = heading.strip()
    for opening, closing in ("()", "[]"):
        if text.endswith(closing):
            depth = 0
            for i in range(len(text) - 1, -1, -1):
                depth += (text[i] == closing) - (text[i] == opening)
                if depth == 0:
                    unit = text[i + 1 : -1].strip()
                    return text[:i].strip(), "" if unit == "-" else unit
    name, comma, unit = text.rpartition(", ")
    if comma and name and re.fullmatch(r"[^\W\d_]{1,4}(/[^\W\d_]{1,2}\d?)?|%|°", unit):
        return name.strip(), unit
    return text, ""


def unique_names(names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Make equal names distinct by ``#2``, ``#3`` ... and say so.

    Returns
    -------
    tuple of tuple of str
        The names, and a note per name that was repeated.
    """
    seen: dict[str, int] = {}
    taken = set(names)
    unique = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        candidate, n = name, seen[name]
        while n > 1 and (candidate := f"{name}#{n}") in taken:
            n += 1
        taken.add(candidate)
        unique.append(candidate)
    notes = tuple(
        f"{count} signals are named {n!r}: the later ones read {n}#2 ..." for n, count in seen.items() if count > 1
    )
    return tuple(unique), notes


def decimals(cell: str) -> int:
    """Return the place of a number's last printed digit: 6 for ``0.000020``, 9 for ``1.5E-008``; 0 if it is none."""
    mantissa, _, exponent = cell.strip().casefold().replace(",", ".").partition("e")
    try:
        return len(mantissa.partition(".")[2]) - (int(exponent) if exponent else 0)
    except ValueError:
        return 0
