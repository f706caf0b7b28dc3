"""Cells of a text table: separators, decimal marks, lost samples, and headings with units."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Sequence
from functools import cache

from recoil_acquisition.quantities.quantity import find_unit
from recoil_acquisition.remark import Note, NoteCode, Remark

SEPARATORS = ("\t", ";", ",")
"""Separators in the order in which they are tried: a comma may also be a decimal mark."""

LOST_WORDS = ("nan", "-nan", "inf", "+inf", "-inf", "infinity", "+infinity", "-infinity")
"""Words, in any case, that stand for a sample that is no number."""

OVERLOAD_WORDS = (
    "ol", "o.l", "over", "overload", "ovld", "ovl", "overrange", "over range", "ovrng", "overflow", "ovfl",
    "\u221e",
)  # fmt: skip
"""Words, in any case and with either sign, by which meters and recorders say that the input was beyond their range."""

BLANKS = " "
"""Separator that any number of blanks is: there are no empty cells between them."""
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?", re.ASCII)
_MOST_DIGITS = 15
"""Digits of a whole number that a file counts by, which float64 holds too; Python refuses to read some thousands."""
_MOST_DECIMALS = 300
"""Place beyond which float64 has no digit."""
_GROUPED = re.compile(
    r"[+-]?(?:[1-9]\d{0,2}(?P<mark>[., '\u2019\u00a0\u2009\u202f])\d{3}(?:(?P=mark)\d{3})*"
    r"|[1-9]\d?(?P<pair>[.,' \u2019\u00a0\u2009\u202f])(?:\d{2}(?P=pair))+\d{3})(?:[.,]\d*)?"
)
"""Pattern of whole thousands, or lakhs and crores, behind one mark; a decimal mark may follow."""
MARKS = {"'": "'\u2019", " ": " \u00a0\u2009\u202f"}
"""Marks between thousands that are printed in several ways, with all of them."""

_BEFORE_UNIT = ", "
"""Signs that may stand between a name and its unit in a heading."""
_BARE_UNIT = re.compile(r"[^\W\d_]{1,4}(/[^\W\d_]{1,2}\d?)?|%|°")
"""Pattern of a unit that stands behind these signs."""

_OF_PRESSURE = re.compile(r"[^\W\d_]{2,4} ?\((a|g|abs)\)")
"""Pattern of a unit whose parentheses say what a pressure counts from."""

_C_RUNTIME = re.compile(r"[+-]?1[.,]#(?P<what>inf|qnan|snan|ind|nan)0*", re.IGNORECASE)
"""Pattern of what is no number, as the C library of Windows printed it until 2015: its digits may be cut or filled with
zeros."""
_NAN = re.compile(r"[+-]?nan\((?:ind|snan)\)|novalue|#(?:n/a|num!|div/0!|value!)", re.IGNORECASE)
"""Pattern of what is no number, as the C library of Windows prints it since, DIAdem a value that is not there, and
spreadsheets what has no value."""


def split_cells(line: str, separator: str) -> list[str]:
    """Split one line into stripped cells; quotes around a cell are taken off. Any number of blanks is one separator."""
    if separator == BLANKS:
        return [quoted.strip('"') for quoted in re.findall(r'"[^"]*"|[^\s"]+', line)] or [""]
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
    except (csv.Error, StopIteration):
        return [cell.strip().strip('"') for cell in line.split(separator)]


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, with either decimal mark."""
    return _NUMBER.fullmatch(cell) is not None


def number_of(cell: str) -> float | None:
    """Return the number of a cell, with either decimal mark; None if it is none, or none that float64 holds."""
    value = float(cell.replace(",", ".")) if is_number(cell) else math.nan
    return value if math.isfinite(value) else None


def whole_number(text: str) -> int | None:
    """Return the number that digits are, 0 to 9 alone and no more of them than a count has; None if they are not."""
    return int(text) if text.isascii() and text.isdecimal() and len(text) <= _MOST_DIGITS else None


def is_lost(cell: str) -> bool:
    """Return whether a cell stands for a lost sample: empty, one of `LOST_WORDS`, or a word for an overload."""
    return lost_value(cell) is not None


def lost_value(cell: str) -> float | None:
    """Return what a cell says that stands for a lost sample: NaN, or infinity for an overload; None if it does not."""
    if not cell:
        return math.nan
    if "0" <= cell[0] <= "9" and "#" not in cell:
        return None
    word = cell.casefold()
    if word in LOST_WORDS:
        return math.nan if "nan" in word else float(word)
    sign = -math.inf if word[0] == "-" else math.inf
    if word.lstrip("+-") in OVERLOAD_WORDS:
        return sign
    if found := _C_RUNTIME.fullmatch(word):
        return sign if found["what"] == "inf" else math.nan
    return math.nan if _NAN.fullmatch(word) else None


def groups_thousands(cell: str) -> bool:
    """Return whether a cell may be a number whose thousands are set apart: ``1.000``, ``1'000``, ``1,00,000``."""
    return _GROUPED.fullmatch(cell) is not None


def plain_number(cell: str, *, decimal: str, thousands: str = "") -> str | None:
    """Return a cell's number as `float` reads it; None if it is none by the marks that it may have.

    Parameters
    ----------
    decimal
        Decimal mark, a point or a comma.
    thousands
        Mark that may set its thousands apart, or lakhs and crores; empty if nothing may.
    """
    if thousands and (whole := _whole_part(thousands).match(cell)) is not None:
        cell = re.sub(r"[^\d+-]", "", whole.group()) + cell[whole.end() :]
    if is_number(cell) and ("." if decimal == "," else ",") not in cell and cell.isascii():
        return cell.replace(",", ".")
    return None


@cache
def _whole_part(thousands: str) -> re.Pattern[str]:
    """Return what matches the whole part of a number whose thousands are set apart."""
    mark = f"[{re.escape(MARKS.get(thousands, thousands))}]"
    return re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:{mark}\d{{2,3}})*{mark}\d{{3}}(?![\deE])")


def has_decimal_comma(rows: Sequence[Sequence[str]]) -> bool:
    """Return whether numbers are written with a decimal comma, which needs quotes where the comma separates cells.

    Beside decimal points commas are none if they may set thousands apart.
    """
    numbers = [cell for row in rows for cell in row if ("," in cell or "." in cell) and is_number(cell)]
    commas = [cell for cell in numbers if "," in cell]
    return bool(commas) and (len(commas) == len(numbers) or not all(map(groups_thousands, commas)))


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
    name, comma, unit = text.rpartition(_BEFORE_UNIT)
    if comma and name and _OF_PRESSURE.fullmatch(unit) and find_unit(unit) is not None:
        return name.strip(), unit
    for opening, closing in ("()", "[]"):
        if text.endswith(closing):
            depth = 0
            for i in range(len(text) - 1, -1, -1):
                depth += (text[i] == closing) - (text[i] == opening)
                if depth == 0:
                    unit = text[i + 1 : -1].strip()
                    return text[:i].strip(), "" if unit == "-" else unit
    name, comma, unit = text.rpartition(_BEFORE_UNIT)
    if comma and name and _BARE_UNIT.fullmatch(unit):
        return name.strip(), unit
    return text, ""


def unique_names(names: Sequence[str]) -> tuple[tuple[str, ...], tuple[Remark, ...]]:
    """Make equal names distinct by ``#2``, ``#3`` ... and say so.

    Returns
    -------
    names : tuple of str
    notes : tuple of Remark
        Notes, one for each name that was repeated.
    """
    last: dict[str, int] = {}
    taken = set(names)
    unique = []
    for name in names:
        candidate, n = name, last.get(name, 0) + 1
        while n > 1 and (candidate := f"{name}#{n}") in taken:
            n += 1
        last[name] = n
        taken.add(candidate)
        unique.append(candidate)
    notes = tuple(
        Note(NoteCode.NAMES, n, f"{count} signals are named {n!r}: the later ones read {n}#2 ...")
        for n, count in Counter(names).items()
        if count > 1
    )
    return tuple(unique), notes


def decimals(cell: str) -> int:
    """Return the place of a number's last printed digit: 6 for ``0.000020``, 9 for ``1.5E-008``; 0 if it is none."""
    mantissa, _, exponent = cell.strip().casefold().replace(",", ".").partition("e")
    power = whole_number(exponent.lstrip("+-")) if exponent else 0
    if power is None:
        return 0
    place = len(mantissa.partition(".")[2]) + (power if exponent.startswith("-") else -power)
    return min(max(place, -_MOST_DECIMALS), _MOST_DECIMALS)
