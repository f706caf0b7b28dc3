"""OXYGEN's text export, whose layout is not published.

So a file is known as one of OXYGEN's by the names in it alone, or where a rig says that its source is a recorder: many
programs write a table of time and units. Nothing is assumed of it: header row, a row of units or units in brackets,
separator, decimal mark and the column of time are found from the file, and where it can be read in more than one way
it is refused. Such a file is read by what the rig declares in ``[source.layout]``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import is_number, split_cells, split_unit
from recoil_acquisition.readers.text.recording import text_recording
from recoil_acquisition.readers.text.table_layout import TableLayout
from recoil_acquisition.readers.text.time_base import TimeSource
from recoil_acquisition.readers.text_file import HEADER_LINES, LOOKED_AT, LongText
from recoil_acquisition.readers.time.time_units import TIME_UNITS_S
from recoil_acquisition.readers.time.wall_clock import is_wall_clock, parse_wall_clock

SEPARATORS = ("\t", ";", ",", "|")

DECLARE = (
    "declare its layout in the rig: `[source.layout]` with `separator`, `decimal`, `thousands`, `header_row`,"
    " `unit_row`, `time_column`, `time_unit` as needed"
)

_TIME_REMEDY = f"export with relative time in seconds, or {DECLARE}"
_TIME = re.compile(r"(time|zeit|timestamp|date ?/? ?time|date and time|datetime)\s*(\[[^\[\]]*\])?", re.IGNORECASE)
_OXYGEN = re.compile(r"oxygen|dewetron|\b(?:AI|DI|CNT) \d+/[A-Z]?\d+\b|@POWER/\d", re.IGNORECASE)
"""Names of the program and its maker, and how it names its channels."""
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}([.,]\d{3})")


@dataclass(frozen=True, kw_only=True)
class Reading(TableLayout):
    """One way to read a table's layout.

    Attributes
    ----------
    header_row
        Index of its line.
    rows
        Cells of the first rows.
    """

    header_row: int
    rows: tuple[tuple[str, ...], ...]


def readings(lines: Sequence[str]) -> list[Reading]:
    """Return every way in which lines are a table whose first column is time."""
    found = []
    for separator in SEPARATORS:
        for i, line in enumerate(lines[:HEADER_LINES]):
            cells = split_cells(line, separator)
            if len(cells) < 2 or not _TIME.fullmatch(cells[0]):
                continue
            reading = _reading(lines, i, separator, cells)
            if reading is not None:
                found.append(reading)
            break
    return found


def _reading(lines: Sequence[str], i: int, separator: str, cells: list[str]) -> Reading | None:
    ends_empty = not cells[-1]
    names = cells[:-1] if ends_empty else cells
    below = [split_cells(line, separator) for line in lines[i + 1 : i + 3]]
    units = _units(below[0], len(names)) if below and not _begins_a_row(below[0]) else None
    if units is None:
        headings = tuple(split_unit(name) if name.endswith("]") else (name, "") for name in names)
        # Without any unit this is not this format's header but some table's
        if not any(name.endswith("]") for name in names):
            return None
    else:
        headings = tuple(zip(names, units, strict=True))
    first = i + 1 + (units is not None)
    while first < len(lines) and not lines[first].strip():
        first += 1
    rows = [tuple(split_cells(line, separator)) for line in lines[first : first + LOOKED_AT] if line.strip()]
    if not rows or not _begins_a_row(rows[0]):
        return None
    time = TimeSource(0, unit_s=TIME_UNITS_S.get(headings[0][1]), remedy=_TIME_REMEDY)
    if is_wall_clock(rows[0][0]):
        time = TimeSource(0, parse=parse_wall_clock, remedy=_TIME_REMEDY)
    return Reading(separator=separator, first_row=first, headings=headings, time=time, header_row=i, rows=tuple(rows))


def _begins_a_row(cells: Sequence[str]) -> bool:
    return bool(cells) and (is_number(cells[0]) or is_wall_clock(cells[0]))


def _units(cells: Sequence[str], width: int) -> list[str] | None:
    """Return the units of a row that holds nothing else, or None."""
    cells = cells[:-1] if len(cells) == width + 1 and not cells[-1] else cells
    if len(cells) != width or any(is_number(cell) for cell in cells):
        return None
    bare = [re.sub(r"[\[(](.*)[\])]", r"\1", cell).strip() for cell in cells]
    units = ["" if unit == "-" else unit for unit in bare]
    return units if units[0] == "" or units[0] in TIME_UNITS_S else None


def decimal_mark(reading: Reading, path: Path) -> str:
    """Find the decimal mark of a reading's numbers.

    Raises
    ------
    ReadError
        If both marks occur, or those that occur may as well group thousands.
    """
    cells = [cell for row in reading.rows for cell in row[int(reading.time.parse is not None) :] if is_number(cell)]
    commas = [c for c in cells if "," in c]
    points = [c for c in cells if "." in c]
    if commas and points:
        raise _ambiguous(path, f"both {commas[0]!r} and {points[0]!r} are numbers")
    marked = commas or points
    if commas and all(_GROUPED.fullmatch(c) for c in marked):
        raise _ambiguous(path, f"{marked[0]!r} may be a decimal comma or group thousands")
    return "," if commas else "."


def _ambiguous(path: Path, found: str) -> ReadError:
    return ReadError("the table can be read in more than one way", path=path, found=found, remedy=DECLARE)


class OxygenTextReader:
    """Reader of OXYGEN's text export."""

    name = "OXYGEN text export"

    def claims(self, head: Head) -> Claim:
        """Be certain of OXYGEN's own words over a table of time with units; without them it has its shape alone."""
        lines = head.lines[: HEADER_LINES + 3]
        tables = readings(lines)
        if any(_OXYGEN.search(line) for found in tables for line in lines[: found.header_row + 1]):
            return Claim.CERTAIN
        return Claim.SHAPE if tables else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open an export.

        Raises
        ------
        ReadError
            If it can be read in more than one way, or its time column states no unit.
        CorruptFileError
            If it has no header row or no complete row.
        """
        file = LongText(path)
        lines = file.lines(HEADER_LINES + LOOKED_AT + 2)
        found = readings(lines)
        if not found:
            raise CorruptFileError(
                "no header row", path=path, expected=f"a first cell `Time [s]` within {HEADER_LINES} lines",
                remedy=DECLARE,
            )  # fmt: skip
        if len(found) > 1:
            shown = " and ".join(repr(reading.separator) for reading in found)
            raise _ambiguous(path, f"{shown} between cells")
        reading = found[0]
        whole = [row for row in reading.rows[:-1] if len(row) - len(reading.headings) not in (0, 1)]
        again = [i for i, line in enumerate(lines[reading.first_row :]) if line == lines[reading.header_row]]
        if again:
            line = reading.first_row + again[0] + 1
            raise CorruptFileError(
                f"a second recording begins: its headings stand in line {line}", path=path, place=f"line {line}",
                expected="one recording per file",
                remedy="take the recordings apart there, and give the one that is meant",
            )  # fmt: skip
        if whole or any(len(row) > len(reading.headings) and row[-1] for row in reading.rows):
            width = len(next(iter(whole), reading.rows[0]))
            raise CorruptFileError(
                "the rows do not fit the header", path=path, place=f"line {reading.first_row + 1}",
                expected=f"{len(reading.headings)} cells between {reading.separator!r}", found=f"{width}",
                remedy=f"export with a decimal point or another separator, or {DECLARE}",
            )  # fmt: skip
        reading = replace(reading, decimal_comma=decimal_mark(reading, path) == ",")
        block = reading.block(file)
        if reading.time.parse is None and reading.time.unit_s is None:
            raise ReadError(
                "the unit of the time column is unknown", path=path, place=f"line {reading.header_row + 1}",
                expected="`Time [s]`, or s, ms, us, ns, min or h in a row of units",
                found=repr(reading.headings[0][1]), remedy=_TIME_REMEDY,
            )  # fmt: skip
        return text_recording(self.name, block, reading, declared.clock, reading.head(lines))
