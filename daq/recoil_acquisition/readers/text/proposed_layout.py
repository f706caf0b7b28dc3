"""The layout that a table of text seems to have, as a rig may declare it: a proposal to a person, never an assumption.

Rows of numbers are sought, of one width by one separator; above them the line that is as wide and holds no numbers
names the columns, and one between the two their units. A column is the time by its name; the first one also by its
unit, if no other column has a unit of time.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import takewhile
from typing import Any, TypeAlias

from recoil_acquisition.files.bounded_toml import toml_value
from recoil_acquisition.quantities.quantity import find_unit
from recoil_acquisition.quantities.typed_quantity import TypedError, typed_quantity
from recoil_acquisition.readers.text.cells import BLANKS, has_decimal_comma, is_lost, is_number, split_cells, split_unit
from recoil_acquisition.readers.text_file import HEADER_LINES, LOOKED_AT
from recoil_acquisition.readers.time.time_units import TIME_UNITS_S
from recoil_acquisition.readers.time.wall_clock import is_time_of_day, is_wall_clock

_SEPARATORS = ("\t", ";", ",", "|")
_FEWEST_ROWS = 2
_LEAST_STEP_S = 1e-12
_TIME = re.compile(
    r"(time|zeit|t|temps|tiempo|timestamp|x[ _-]?axis|elapsed|seconds?|date[ /_]?time)\b.*", re.IGNORECASE
)
# a cell of numbers may follow behind a comma, but no number ends within another
_NUMBER = r"(?>\d{1,15}(?:[.,]\d{1,15})?)(?!\.?\d)(?:e[+-]?\d{1,3})?"
_RATE = re.compile(
    rf"(?:rate|frequency|freq|frequenz|fs)\b[^\d\n]{{0,12}}({_NUMBER}(?:\s*[kM]?(?:Hz|S/s)\b)?)",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"(?:interval|intervall|increment|period|delta[ _]?[tx]|dt|schrittweite)\b[^\d\n]{0,12}"
    rf"({_NUMBER}(?:\s*[mun\u00b5\u03bc]?s\b)?)",
    re.IGNORECASE,
)
"""Words of a heading by which samples come so often, or so far apart."""
_UNITS_S = ("s", "ms", "us", "ns", "min", "h")
"""Units of time that a layout takes."""


_Rows: TypeAlias = tuple[str, int, int, list[list[str]]]
"""Separator, index of the first row, number of columns, and cells of the first rows."""


@dataclass(frozen=True)
class ProposedLayout:
    """A layout that a table of text seems to have.

    Attributes
    ----------
    table
        Keys of ``layout`` as a rig has them.
    lacking
        Keys that it needs beside them and that no line of the file tells, in words.
    rate_hz, rate_line
        Samples per second that a line above the table seems to state, and its number from 1; NaN and 0 without one.
    """

    table: Mapping[str, Any]
    lacking: tuple[str, ...]
    rate_hz: float = math.nan
    rate_line: int = 0

    def __str__(self) -> str:
        more = f", and in it {' and '.join(self.lacking)}, which no line tells" if self.lacking else ""
        return f"`layout = {toml_value(self.table)}` of its source{more}"


def propose_layout(lines: Sequence[str]) -> ProposedLayout | None:
    """Propose the layout of a table of text.

    Parameters
    ----------
    lines
        First lines of the file.

    Returns
    -------
    ProposedLayout or None
        Layout of the table; None if the lines hold no table of numbers.
    """
    found = [one for separator in _SEPARATORS if (one := _rows(lines, separator)) is not None]
    # every separator may have blanks about it
    found = found or [one for one in (_rows(lines, BLANKS),) if one is not None]
    if not found:
        return None
    separator, first, width, rows = max(found, key=_likeness)
    layout: dict[str, Any] = {"separator": separator}
    if separator != "," and has_decimal_comma(rows):
        layout["decimal"] = ","
    named = _line_above(lines, separator, first, width)
    units = None if named is None else _line_above(lines, separator, named, width)
    if named is not None and units is not None and are_units(split_cells(lines[named], separator)):
        named, units = units, named
    else:
        units = None
    names = [] if named is None else split_cells(lines[named], separator)
    if named is not None:
        layout["header_row"] = named + 1
    else:
        layout["names"] = [f"column_{i + 1}" for i in range(width)]
    if units is not None:
        layout["unit_row"] = units + 1
    layout["first_row"] = first + 1
    cells = names if units is None else split_cells(lines[units], separator)
    lacking = _add_time(layout, names, cells, rows[0], apart=units is not None)
    return ProposedLayout(layout, lacking, *stated_rate(lines[:first]))


def _add_time(
    layout: dict[str, Any], names: Sequence[str], cells: Sequence[str], row: Sequence[str], *, apart: bool
) -> tuple[str, ...]:
    """Add the column of time, if one is named so, and its unit, if that is stated; return the keys that lack."""
    at = next((i for i, name in enumerate(names) if _TIME.fullmatch(name)), None)
    if at is None and names:
        units = [_bare(cell) if apart else split_unit(cell)[1] for cell in cells]
        in_time = [i for i, unit in enumerate(units) if unit.casefold() in TIME_UNITS_S]
        at = 0 if in_time == [0] else None
    if at is None:
        return ("`time_column` or `rate_hz`",)
    name, unit = (names[at], _bare(cells[at])) if apart else split_unit(names[at])
    layout["time_column"] = name if list(names).count(names[at]) == 1 else at + 1
    seconds = TIME_UNITS_S.get(unit.casefold())
    if seconds is None:
        return ("`time_unit`",) if is_number(row[at]) else ()
    if apart or unit not in TIME_UNITS_S:
        layout["time_unit"] = next(one for one in _UNITS_S if TIME_UNITS_S[one] == seconds)
    return ()


def stated_rate(lines: Sequence[str]) -> tuple[float, int]:
    """Return the one rate that lines state, Hz, and the number of the first that does; NaN and 0 of none or several."""
    found: list[tuple[float, int]] = []
    for number, line in enumerate(lines, 1):
        for pattern, unit in ((_RATE, "Hz"), (_STEP, "s")):
            for text in pattern.findall(line):
                try:
                    value = typed_quantity(text.rstrip(".,"), unit)
                except TypedError:
                    continue
                if _LEAST_STEP_S < (1.0 / value if unit == "Hz" and value > 0.0 else value) < math.inf:
                    found.append((float(f"{value if unit == 'Hz' else 1.0 / value:.9g}"), number))
    return found[0] if len({rate for rate, _ in found}) == 1 else (math.nan, 0)


def _likeness(table: _Rows) -> tuple[float, int, int]:
    """Return how much a reading of lines is a table: few of its cells are text, and it is wide and begins early."""
    _, first, width, rows = table
    cells = [cell for row in rows for cell in row]
    return -sum(not _is_value(cell) and not is_lost(cell) for cell in cells) / len(cells), width, -first


def _rows(lines: Sequence[str], separator: str) -> _Rows | None:
    """Find the first line from which on rows of numbers follow: their width, and the first of them."""
    cells = [split_cells(line, separator) for line in lines[: HEADER_LINES + LOOKED_AT]]
    sound = [_is_row(one) for one in cells]
    for first, row in enumerate(cells[:HEADER_LINES]):
        if not sound[first]:
            continue
        following = [one for one, is_sound in zip(cells[first:], sound[first:], strict=True) if is_sound]
        alike = list(takewhile(partial(_is_as_wide, row), following))
        # other lines of the head may follow
        below = alike[max(1, len(alike) // 2) :]
        if any(map(_heads, row, zip(*below, strict=True))):
            continue
        if len(alike) >= min(_FEWEST_ROWS, len(following)) and len(following) >= _FEWEST_ROWS:
            width = len(row) - (len(row) > 2 and all(not one[-1] for one in alike))
            return separator, first, width, alike[:LOOKED_AT]
    return None


def _heads(cell: str, below: Sequence[str]) -> bool:
    """Return whether a cell names something where no row below does: its line is of a head that is as wide as they."""
    return _names(cell) and not is_lost(cell) and not any(map(_names, below))


def _is_as_wide(row: Sequence[str], other: Sequence[str]) -> bool:
    return len(row) == len(other)


def _is_row(cells: Sequence[str]) -> bool:
    """Return whether most cells of a line are numbers, or times, and at least two are there."""
    kinds = Counter("number" if _is_value(cell) else "lost" if is_lost(cell) else "text" for cell in cells)
    return len(cells) > 1 and kinds["number"] > 0 and kinds["text"] <= kinds["number"]


def _is_value(cell: str) -> bool:
    return is_number(cell) or is_time_of_day(cell) or is_wall_clock(cell)


def _line_above(lines: Sequence[str], separator: str, below: int, width: int) -> int | None:
    """Return the nearest line above a row that is as wide and names something; blank lines may lie between."""
    for at in range(below - 1, -1, -1):
        if not lines[at].strip(f" {separator}"):
            continue
        cells = split_cells(lines[at], separator)
        while len(cells) > width and not cells[-1]:
            cells.pop()
        if _is_row(cells) and _names(cells[0]):
            continue  # a line of a head that labels its numbers
        return at if len(cells) == width and any(map(_names, cells)) and not _is_row(cells) else None
    return None


def _names(cell: str) -> bool:
    return any(sign.isalpha() for sign in cell) and not _is_value(cell)


def _bare(cell: str) -> str:
    return re.sub(r"^[\[(](.*)[\])]$", r"\1", cell).strip()


def _is_unit(bare: str) -> bool:
    return not bare or bare == "-" or find_unit(bare) is not None or bare.casefold() in TIME_UNITS_S


def are_units(cells: Sequence[str]) -> bool:
    """Return whether all cells of a line are units, some of them more than a dash."""
    bare = [_bare(cell) for cell in cells]
    # the first may be the label of the line
    bare = bare if len(bare) < 3 or _is_unit(bare[0]) else bare[1:]
    return all(map(_is_unit, bare)) and any(sign.isalpha() for one in bare for sign in one)
