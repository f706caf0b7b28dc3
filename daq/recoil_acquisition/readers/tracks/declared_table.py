"""A table of tracks whose layout the rig declares: any text or workbook that no other reader knows.

The layout is that of `recoil_acquisition.readers.tracks.layout`. Nothing of the file is guessed: rows are read strictly
from the declared line on, columns that are not declared are left out and named.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from itertools import islice, pairwise
from pathlib import Path

import numpy as np

from recoil_acquisition.errors import CorruptFileError, Fault, ReadError, Row, system_errors_as
from recoil_acquisition.quantities.declaration import declared as declare
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import is_lost, lost_value, plain_number, split_cells
from recoil_acquisition.readers.text.row_format import RowFormat
from recoil_acquisition.readers.text.rows import read_rows
from recoil_acquisition.readers.text.sheet_text import is_workbook, read_sheets
from recoil_acquisition.readers.text.text_table import TextBlock, two_line_ends
from recoil_acquisition.readers.text_file import LongText, Text, TextFile
from recoil_acquisition.readers.tracks.columns import LOST_MARKERS, Column
from recoil_acquisition.readers.tracks.frame_time import frame_clock
from recoil_acquisition.readers.tracks.layout import ColumnChoice, TrackLayout
from recoil_acquisition.readers.tracks.recording import TrackTable, track_recording
from recoil_acquisition.remark import Note, NoteCode

PART_BYTES = 1 << 20
"""Bytes of a text that are held at a time."""

NO_ROW = re.compile("(?!)")

REMEDY = "correct `layout` of this source in the rig file"


class DeclaredTrackReader:
    """Reader of tables of tracks that the rig describes."""

    name = "declared track table"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a table.

        Raises
        ------
        ReadError
            If no layout is declared or it is faulty, a column is not there, or nothing states the frame rate.
        CorruptFileError
            If there is no row, or a declared cell is no number.
        """
        if declared.layout is None:
            raise ReadError(
                "no layout is declared",
                path=path,
                place=f"source {declared.clock!r}",
                remedy="declare `layout` of this source in the rig file",
            )
        faults: list[Fault] = []
        layout = declare(TrackLayout, declared.layout, (Row("source", declared.clock), "layout"), faults)
        if layout is None:
            raise ReadError(" | ".join(str(fault) for fault in faults), path=path, remedy=REMEDY)
        file, layout = _text_of(path, layout)
        header = list(islice(_lines(file), layout.first_line - 1))
        headings = _headings(header, layout, path)
        columns, at = _columns(layout, headings, path)
        heading = header[layout.header_row - 1] if layout.header_row is not None else ""
        block = _block(file, layout, columns, at, heading)
        values = read_rows(block)
        for i, column in enumerate(columns):
            if column.kind not in ("frame", "time") and layout.lost_values:
                values[np.isin(values[:, i], layout.lost_values), i] = np.nan
        clock = frame_clock(block, values, columns, declared.frame_rate_hz)
        left_out = [name for i, name in enumerate(headings) if i not in at and name]
        text = f"columns that the layout does not declare were left out: {', '.join(left_out)}"
        notes = (Note(NoteCode.LEFT_OUT, None, text),) if left_out else ()
        metadata = {"header": header, "encoding": file.encoding}
        return track_recording(
            TrackTable(path, self.name, columns, values, clock, metadata, notes, block.dropped), declared
        )


def _text_of(path: Path, layout: TrackLayout) -> tuple[Text, TrackLayout]:
    """Return a file's text; that of a workbook is its first sheet's, with tabs and decimal points."""
    with system_errors_as(ReadError, path, "read", "check the name and the folder"), path.open("rb") as opened:
        head = opened.read(1024)
    if not is_workbook(head):
        return LongText(path), layout
    sheet = read_sheets(path)[0]
    return TextFile(path, sheet.text.encode(), "utf-8"), layout.model_copy(update={"separator": "\t", "decimal": "."})


def _lines(file: Text) -> Iterator[str]:
    """Yield the lines of a text, the last one if it has no end too; a part of the text is held at a time."""
    at, cut = 0, b""
    while at < file.size:
        part = file.read(at, min(at + PART_BYTES, file.size))
        at += len(part)
        *whole, cut = (cut + part).split(file.line_end)
        for line in whole:
            yield line.removesuffix(b"\r").decode(file.encoding, errors="replace")
    yield cut.decode(file.encoding, errors="replace")


def _cells(line: str, layout: TrackLayout) -> list[str]:
    if layout.separator == " ":
        return line.split()
    return split_cells(line, layout.separator)


def _headings(lines: Sequence[str], layout: TrackLayout, path: Path) -> list[str]:
    if layout.header_row is None:
        return []
    if layout.header_row > len(lines):
        raise CorruptFileError(
            "the file ends above the declared headings",
            path=path,
            expected=f"headings in line {layout.header_row}",
            found=f"{len(lines)} lines",
            remedy=REMEDY,
        )
    return _cells(lines[layout.header_row - 1], layout)


def _columns(layout: TrackLayout, headings: Sequence[str], path: Path) -> tuple[tuple[Column, ...], list[int]]:
    """Return the declared columns and where they are in a row, from 0."""
    columns: list[Column] = []
    at: list[int] = []

    def add(key: str, choice: ColumnChoice | None, column: Column) -> None:
        if choice is not None:
            columns.append(column)
            at.append(_place(choice, headings, key, layout, path))

    add("frame_column", layout.frame_column, Column("frame", "frame", ""))
    add("time_column", layout.time_column, Column("time", "time", layout.time_unit))
    for i, f in enumerate(layout.features):
        key = f"features[{i}]"
        add(f"{key}.x", f.x, Column("position", f"{f.name} x", layout.unit, f.name, "X"))
        add(f"{key}.y", f.y, Column("position", f"{f.name} y", layout.unit, f.name, "Y"))
        add(f"{key}.angle", f.angle, Column("angle", f"{f.name} angle", layout.angle_unit, f.name))
    return tuple(columns), at


def _place(choice: ColumnChoice, headings: Sequence[str], key: str, layout: TrackLayout, path: Path) -> int:
    if isinstance(choice, int):
        return choice - 1
    found = [i for i, heading in enumerate(headings) if heading.casefold() == choice.casefold()]
    exact = [i for i in found if headings[i] == choice]
    found = exact or found
    if len(found) == 1:
        return found[0]
    near = get_close_matches(choice, [h for h in headings if h], n=3, cutoff=0.4)
    raise ReadError(
        f"{len(found)} columns are headed {choice!r}" if found else f"no column is headed {choice!r}",
        path=path,
        place=f"line {layout.header_row}, layout.{key}",
        expected="one of " + ", ".join(repr(h) for h in (near or headings[:8])),
        remedy=f"{REMEDY}; a column may be given by its number, from 1",
    )


def _rows(lines: Iterator[str]) -> Iterator[str]:
    """Yield the complete rows: the last line has no end, and blank lines below the last row are none."""
    waiting: list[str] = []
    for row, _ in pairwise(lines):
        waiting.append(row)
        if row.strip():
            yield from waiting
            waiting.clear()


def _block(file: Text, layout: TrackLayout, columns: Sequence[Column], at: Sequence[int], heading: str) -> TextBlock:
    """Return the declared columns alone, written plainly; a last row that may be cut is left out.

    Where the row of headings stands again, another recording was put behind the first one.
    """
    end = file.read(max(file.size - PART_BYTES, 0), file.size).rpartition(file.line_end)[2]
    if b"\r" in end.strip():
        raise two_line_ends(file, file.size - len(end))
    dropped = "the last row has no line end and may be cut: it was left out" if end.strip() else ""
    body, least = bytearray(), max(at) + 1
    whole, groups = _row_of_numbers(layout, at), [f"c{i}" for i in at]
    short: CorruptFileError | None = None
    rows = _rows(islice(_lines(file), layout.first_line - 1, None))
    for n, row in enumerate(rows):
        if short is not None:
            raise short
        if (found := whole.match(row)) is not None:
            body += ("\t".join([found[group] for group in groups]) + "\n").encode()
            continue
        if heading.strip() and row.strip() == heading.strip():
            raise CorruptFileError(
                "a second recording begins: its headings stand here", path=file.path,
                place=f"line {layout.first_line + n}", expected="one recording per file",
                remedy="take the recordings apart there, and give the one that is meant",
            )  # fmt: skip
        cells = _cells(row, layout)
        if len(cells) < least:
            short = CorruptFileError(
                "a row has too few cells for the declared columns",
                path=file.path,
                place=f"line {layout.first_line + n}",
                expected=f"at least {least} cells",
                found=f"{len(cells)}",
                remedy=f"{REMEDY}: its `separator`, `first_row` or columns",
            )
            continue
        plain = (_plain(cells[i], c, layout, n, file.path) for i, c in zip(at, columns, strict=True))
        body += ("\t".join(plain) + "\n").encode()
    if short is not None and (dropped or not body):
        raise short
    if short is not None:
        dropped = f"the last row has fewer than {least} cells: it was left out"
    if not body:
        raise CorruptFileError(
            "there is no complete row of numbers", path=file.path, place=f"line {layout.first_line}", remedy=REMEDY
        )
    names = tuple(column.name for column in columns)
    written = TextFile(file.path, bytes(body), "utf-8")
    rows_as_written = RowFormat(
        file.path, "utf-8", "\t", names, len(names), layout.decimal == ",", thousands=layout.thousands
    )
    told = "; ".join(filter(None, (file.cut, dropped)))
    markers = LOST_MARKERS | frozenset(layout.lost_values)
    return TextBlock(written, 0, len(body) - 1, layout.first_line, rows_as_written, told, markers=markers)


def _row_of_numbers(layout: TrackLayout, at: Sequence[int]) -> re.Pattern[str]:
    """Return what matches a row without quotes whose declared cells are all numbers: as most rows are, at once."""
    parting, mark = re.escape(layout.separator), re.escape(layout.decimal)
    number = rf" *(?P<c{{}}>[+-]?(?:[0-9]+(?:{mark}[0-9]*)?|{mark}[0-9]+)(?:[eE][+-]?[0-9]+)?) *"
    cells = [number.format(i) if i in at else rf'[^{parting}"]*' for i in range(max(at) + 1)]
    if layout.separator == " " or layout.thousands:
        return NO_ROW
    return re.compile(parting.join(cells) + rf'(?:{parting}[^"]*)?\Z')


def _plain(cell: str, column: Column, layout: TrackLayout, row: int, path: Path) -> str:
    """Write a cell's number with the layout's decimal mark alone; a lost one as nan, an overload as inf."""
    if (cell.casefold() in layout.lost_texts and column.kind not in ("frame", "time")) or is_lost(cell):
        return "nan" if math.isnan(lost_value(cell) or math.nan) else repr(lost_value(cell))
    plain = plain_number(cell, decimal=layout.decimal, thousands=layout.thousands or "")
    if plain is None:
        raise CorruptFileError(
            "a cell is not a number",
            path=path,
            place=f"line {layout.first_line + row}, column {column.name!r}",
            expected=f"a number with decimal {layout.decimal!r}, an empty cell, or one of `lost`",
            found=repr(cell[:40]),
            remedy=f"{REMEDY}: its `decimal`, `thousands`, `first_row`, columns or `lost`",
        )
    return plain.replace(".", layout.decimal)
