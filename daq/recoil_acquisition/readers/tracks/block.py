"""The block of numbers of a tracking export: under whatever stands above it, or below header rows of known number.

A text of known header rows is read in parts: beside its numbers, of which there is one copy, no more of it is held than
a part.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.text.cells import SEPARATORS, has_decimal_comma, is_lost, is_number, split_cells
from recoil_acquisition.readers.text.rows import read_rows
from recoil_acquisition.readers.text.text_table import TextBlock, find_block
from recoil_acquisition.readers.text_file import HEADER_LINES, LongText, TextFile
from recoil_acquisition.readers.tracks.columns import (
    LOST_MARKERS,
    Column,
    columns_from_headings,
    columns_from_numbers,
    found_by_numbers,
    without_text,
)
from recoil_acquisition.readers.tracks.frame_time import frame_clock
from recoil_acquisition.readers.tracks.recording import TrackTable
from recoil_acquisition.remark import Note, NoteCode, Remark

BLOCK_ROWS = 5
"""Rows of numbers in a row that make a block."""

HEAD_ROWS = 6
"""Rows by which the header and the decimal mark of a text with header rows are found."""

Cells = Sequence[str]


def find_numbers(lines: Sequence[str]) -> tuple[int, str] | None:
    """Find the first line of the numbers and their separator, or None.

    Where no rows hold nothing else, rows of two numbers at least beside columns of text are numbers too.
    """
    return _find_rows(lines, beside_text=False) or _find_rows(lines, beside_text=True)


def _find_rows(lines: Sequence[str], *, beside_text: bool) -> tuple[int, str] | None:
    for separator in SEPARATORS:
        run, kinds = 0, ""
        for i, line in enumerate(lines):
            cells = split_cells(line, separator)
            own = "".join("n" if is_number(cell) else " " if is_lost(cell) else "t" for cell in cells)
            numbers = own.count("n") if len(cells) > 1 else 0
            numeric = numbers > 0 if "t" not in own else beside_text and numbers > 1
            both = _agreeing(kinds, own) if run else None
            run, kinds = (run + 1, both) if numeric and both is not None else (int(numeric), own)
            if run == BLOCK_ROWS:
                return i - BLOCK_ROWS + 1, separator
    return None


def _agreeing(kinds: str, others: str) -> str | None:
    """Return the kinds of the cells of rows of which none has text where another has a number; None if one has."""
    if len(kinds) != len(others) or any(a != b and " " not in (a, b) for a, b in zip(kinds, others, strict=True)):
        return None
    return "".join(max(a, b) for a, b in zip(kinds, others, strict=True))


def read_track_table(file: TextFile, reader: str, declared_hz: float | None) -> TrackTable:
    """Read the tracks of a text whose columns are named by headings, or by the numbers alone.

    Parameters
    ----------
    reader
        Name of the format's reader.
    declared_hz
        Frame rate that the rig declares, Hz; None if it declares none.

    Raises
    ------
    ReadError
        If there is neither a time column nor a declared frame rate.
    CorruptFileError
        If no block of numbers is found, or a row of it is damaged.
    """
    lines = file.lines(HEADER_LINES + BLOCK_ROWS)
    found = find_numbers(lines)
    if found is None:
        raise CorruptFileError(
            "no block of numbers",
            path=file.path,
            expected=f"{BLOCK_ROWS} rows of numbers of equal width within {HEADER_LINES} lines",
            remedy="export the tracks as text again",
        )
    row, separator = found
    numbers = [split_cells(line, separator) for line in lines[row : row + BLOCK_ROWS]]
    width = len(numbers[0])
    header = [split_cells(line, separator) for line in lines[:row]]
    if all(not cells[-1] for cells in numbers) and (not header or len(header[-1]) < width or not header[-1][-1]):
        width -= 1
    comma = has_decimal_comma(numbers)
    columns = columns_from_headings(header[-3:], width)
    labels = [c.name for c in columns] if columns else [f"column {i + 1}" for i in range(width)]
    block = find_block(file, file.line_start(row), separator, labels, decimal_comma=comma, markers=LOST_MARKERS)
    values = read_rows(block)
    metadata = {
        "header": lines[:row],
        "encoding": file.encoding,
        "separator": separator,
        "decimal_mark": "," if comma else ".",
    }
    headed = without_text(columns or columns_from_numbers(values), block.text_columns)
    columns = found_by_numbers(headed, values, declared_hz) if columns else headed
    clock = frame_clock(block, values, columns, declared_hz)
    return TrackTable(
        file.path, reader, columns, values, clock, metadata, about_numbers(headed, columns), block.dropped,
        minus_one_is_lost=True,
    )  # fmt: skip


def about_numbers(headed: Sequence[Column], columns: Sequence[Column]) -> tuple[Remark, ...]:
    """Return the note on columns that were known by their numbers."""
    found = [f"{one.name!r} as {one.kind}" for one, was in zip(columns, headed, strict=True) if one.kind != was.kind]
    text = f"columns were taken by what they hold: {', '.join(found)}; if they are not, declare the source's `layout`"
    return (Note(NoteCode.TRACK, None, text),) if found else ()


@dataclass(frozen=True, eq=False)
class HeadedText:
    """A text whose first rows head its columns.

    Attributes
    ----------
    rows
        Cells of the first rows, those of the header and some of the numbers.
    """

    file: LongText
    separator: str
    rows: tuple[Cells, ...]

    def block(self, labels: Sequence[str], *, header_rows: int = 1, text_columns: int = 0) -> TextBlock:
        """Delimit the rows of numbers below the header.

        Parameters
        ----------
        labels
            Names of the columns, for messages.
        text_columns
            First columns that hold no numbers, and so say nothing about the decimal mark.

        Raises
        ------
        CorruptFileError
            If there is no complete row.
        """
        comma = has_decimal_comma([row[text_columns:] for row in self.rows[header_rows:]])
        start = self.file.line_start(header_rows)
        return find_block(self.file, start, self.separator, labels, decimal_comma=comma, markers=LOST_MARKERS)


def read_headed_text(path: Path, is_header: Callable[[Cells], bool]) -> HeadedText:
    """Read the first rows of a text, parted by the separator with which the first of them is a header.

    Raises
    ------
    ReadError
        If the file cannot be read.
    CorruptFileError
        If it announces UTF-16 and is not.
    """
    file = LongText(path)
    lines = file.lines(HEAD_ROWS)
    separator = next((s for s in SEPARATORS if is_header(split_cells(lines[0], s))), ",")
    return HeadedText(file, separator, tuple(split_cells(line, separator) for line in lines))
