"""A text table whose layout the rig declares, because the file does not state it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from recoil_acquisition.errors import CorruptFileError, Fault, FileEnd, ReadError, nearest_first
from recoil_acquisition.quantities.declaration import declared as declare
from recoil_acquisition.readers.foreign_formats import foreign_format
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import number_of, split_cells, split_unit
from recoil_acquisition.readers.text.layout import MOST_ROWS, TextLayout, column_named
from recoil_acquisition.readers.text.proposed_layout import are_units, stated_rate
from recoil_acquisition.readers.text.recording import text_recording
from recoil_acquisition.readers.text.table_layout import TableLayout
from recoil_acquisition.readers.text.time_base import TimeSource
from recoil_acquisition.readers.text_file import LOOKED_AT, LongText
from recoil_acquisition.readers.time.time_units import TIME_UNITS_S
from recoil_acquisition.readers.time.wall_clock import STAMP_FORMS, parse_wall_clock
from recoil_acquisition.remark import Note, NoteCode, Remark

_SAME_RATE = 0.1
"""Share by which two statements of a rate may differ: the first rows may have a gap, or few digits."""
_REMEDY = "correct `[source.layout]` in the rig file"


class DeclaredTextReader:
    """Reader of a text table by its declared layout; it is chosen by the rig alone."""

    name = "declared text table"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a table.

        Raises
        ------
        ReadError
            If no layout is declared, it is at fault, or it names what the file does not have.
        CorruptFileError
            If the file is shorter than the layout says, or has no complete row.
        """
        if declared.layout is None:
            raise ReadError("the rig declares no layout of this text table", path=path, remedy=_REMEDY)
        faults: list[Fault] = []
        layout = declare(TextLayout, declared.layout, ("layout",), faults)
        if layout is None:
            said = " | ".join(str(fault) for fault in faults)
            raise ReadError(f"the declared layout is at fault: {said}", path=path, place="[source]", remedy=_REMEDY)
        head = Head.of(path)
        if b"\0" in head.content[:32] and (foreign := foreign_format(head)) is not None:
            raise ReadError(
                f"this is {foreign.name}, and its source declares a layout", path=path, expected="a table of text",
                remedy=foreign.remedy,
            )  # fmt: skip
        file = LongText(path, layout.encoding)
        lines = file.lines(MOST_ROWS)
        if len(lines) < layout.first_row:
            raise CorruptFileError(
                "the file is shorter than its declared layout", path=path, file_end=FileEnd.MISSING,
                expected=f"numbers from line {layout.first_row}", found=f"{len(lines)} lines", remedy=_REMEDY,
            )  # fmt: skip
        headings = _headings(layout, lines, path)
        time, notes = _time(layout, headings, path)
        notes += [*_about_units(layout, lines, headings), *_about_rate(layout, lines, time)]
        table = TableLayout(
            separator=layout.separator, first_row=layout.first_row - 1, headings=headings, time=time,
            decimal_comma=layout.decimal == ",", missing=layout.missing, comment=layout.comment,
            thousands=layout.thousands,
        )  # fmt: skip
        return text_recording(
            self.name, table.block(file), table, declared.clock, table.head(lines), notes=notes,
            declared={"layout": dict(declared.layout)},
        )  # fmt: skip


def _row(layout: TextLayout, lines: list[str], number: int) -> list[str]:
    line = lines[number - 1].lstrip(" ")
    cells = split_cells(line.removeprefix(layout.comment), layout.separator)
    while len(cells) > 1 and not cells[-1]:
        cells.pop()
    return cells


def _headings(layout: TextLayout, lines: list[str], path: Path) -> list[tuple[str, str]]:
    """Return name and unit of every column."""
    if layout.header_row is None:
        names = [(name, "") for name in layout.names]
    else:
        cells = _row(layout, lines, layout.header_row)
        apart = layout.unit_row is not None or layout.units
        names = [(cell, "") if apart else split_unit(cell) for cell in cells]
    units: list[str] | None = list(layout.units) or None
    where = "`units`"
    if layout.unit_row is not None:
        # Units of the last columns may be empty, and a row of units is cut off then
        cells = _row(layout, lines, layout.unit_row)
        units = [split_unit(f"x {cell}")[1] if cell[:1] in ("[", "(") else cell for cell in cells]
        units += [""] * (len(names) - len(units))
        where = f"line {layout.unit_row}, the declared row of units"
    if len(names) < 2:
        raise ReadError(
            "the declared row of names has one cell only", path=path, place=f"line {layout.header_row}",
            expected=f"names between {layout.separator!r}", remedy=_REMEDY,
        )  # fmt: skip
    if units is not None and len(units) != len(names):
        raise ReadError(
            "names and units do not fit each other", path=path, place=where,
            expected=f"{len(names)} units", found=f"{len(units)}", remedy=_REMEDY,
        )  # fmt: skip
    if units is None:
        return names
    return [(name, "" if unit == "-" else unit) for (name, _), unit in zip(names, units, strict=True)]


def _about_units(layout: TextLayout, lines: list[str], headings: Sequence[tuple[str, str]]) -> list[Remark]:
    """Say that a row below the names reads as units do, where the layout declares none."""
    if layout.unit_row is not None or layout.units or layout.header_row is None:
        return []
    for number in range(layout.header_row + 1, layout.first_row):
        cells = _row(layout, lines, number)
        if len(cells) == len(headings) and are_units(cells):
            text = f"line {number} reads as units do ({', '.join(cells[:4])}), and the layout does not say so"
            return [Note(NoteCode.UNITS, None, f"{text}: it is passed over; declare `unit_row = {number}`")]
    return []


def _about_rate(layout: TextLayout, lines: list[str], time: TimeSource) -> list[Remark]:
    """Say that a line above the rows states another rate than the rows, or the rig, have."""
    stated_hz, line = stated_rate(lines[: layout.first_row - 1])
    rate_hz = layout.rate_hz
    if rate_hz is None and time.unit_s is not None and time.column is not None:
        cells = [split_cells(row, layout.separator) for row in lines[layout.first_row - 1 :][:LOOKED_AT]]
        printed = [number_of(one[time.column].replace(",", ".")) for one in cells if len(one) > time.column]
        times = [one for one in printed if one is not None]
        if len(times) > 1 and times[-1] > times[0]:
            rate_hz = (len(times) - 1) / ((times[-1] - times[0]) * time.unit_s)
    if rate_hz is None or not abs(stated_hz / rate_hz - 1.0) > _SAME_RATE:
        return []
    whose = "the column of time has" if layout.rate_hz is None else "the rig declares"
    text = f"line {line} states {stated_hz:.6g} Hz, {whose} {rate_hz:.6g} Hz: that counts"
    return [Note(NoteCode.CONTRADICTION, None, text)]


def _time(layout: TextLayout, headings: list[tuple[str, str]], path: Path) -> tuple[TimeSource, list[Remark]]:
    """Return where time comes from, and what to say about it."""
    origin = "declared by the rig"
    if layout.time_column is None:
        return TimeSource(None, rate_hz=layout.rate_hz, rate_origin=origin, remedy=_REMEDY), []
    names = [name for name, _ in headings]
    at = column_named(names, layout.time_column)
    if at is None:
        shown = ", ".join(repr(n) for n in nearest_first(str(layout.time_column), names)[:5])
        raise ReadError(
            "the declared time column is not in the file, or more than once", path=path,
            expected=repr(layout.time_column), found=shown, remedy=_REMEDY,
        )  # fmt: skip
    if layout.time_unit is not None:
        own = headings[at][1]
        text = f"the time column states {own!r}, the rig declares {layout.time_unit!r}: the rig counts"
        differ = own not in ("", layout.time_unit)
        notes: list[Remark] = [Note(NoteCode.CONTRADICTION, None, text)] if differ else []
        unit_s = TIME_UNITS_S[layout.time_unit]
        return TimeSource(at, unit_s=unit_s, rate_hz=layout.rate_hz, rate_origin=origin, remedy=_REMEDY), notes
    if headings[at][1] in TIME_UNITS_S:
        unit_s = TIME_UNITS_S[headings[at][1]]
        return TimeSource(at, unit_s=unit_s, rate_hz=layout.rate_hz, rate_origin=origin, remedy=_REMEDY), []
    return TimeSource(
        at, parse=parse_wall_clock, rate_hz=layout.rate_hz, rate_origin=origin,
        remedy=f"{_REMEDY}: `time_unit` for relative time; stamps read {STAMP_FORMS}",
    ), []  # fmt: skip
