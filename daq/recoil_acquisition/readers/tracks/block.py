"""The block of numbers of a tracking export without a fixed layout, found under whatever stands above it."""

from __future__ import annotations

from collections.abc import Sequence

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.text.cells import SEPARATORS, has_decimal_comma, is_lost, is_number, split_cells
from recoil_acquisition.readers.text.rows import read_rows
from recoil_acquisition.readers.text.text_table import find_block
from recoil_acquisition.readers.text_file import HEADER_LINES, TextFile
from recoil_acquisition.readers.tracks.columns import columns_from_headings, columns_from_numbers
from recoil_acquisition.readers.tracks.frame_time import frame_clock
from recoil_acquisition.readers.tracks.recording import TrackTable

BLOCK_ROWS = 5
"""Rows of numbers in a row that make a block."""


def find_numbers(lines: Sequence[str]) -> tuple[int, str] | None:
    """Find the first line of the numbers and their separator, or None."""
    for separator in SEPARATORS:
        width, run = 0, 0
        for i, line in enumerate(lines):
            cells = split_cells(line, separator)
            numeric = len(cells) > 1 and any(map(is_number, cells)) and all(is_number(c) or is_lost(c) for c in cells)
            run = run + 1 if numeric and len(cells) == width else int(numeric)
            width = len(cells)
            if run == BLOCK_ROWS:
                return i - BLOCK_ROWS + 1, separator
    return None


def read_track_table(file: TextFile, reader: str, declared_hz: float | None) -> TrackTable:
    """Read the tracks of a text whose columns are named by headings, or by the numbers alone.

    Parameters
    ----------
    reader
        Name of the format's reader.
    declared_hz
        The frame rate that the rig declares.

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
    comma = has_decimal_comma(numbers, separator)
    columns = columns_from_headings(header[-3:], width)
    labels = [c.name for c in columns] if columns else [f"column {i + 1}" for i in range(width)]
    block = find_block(file, file.line_start(row), separator, labels, decimal_comma=comma)
    values = read_rows(block)
    metadata = {
        "header": lines[:row],
        "encoding": file.encoding,
        "separator": separator,
        "decimal_mark": "," if comma else ".",
    }
    columns = columns or columns_from_numbers(values)
    clock = frame_clock(block, values, columns, declared_hz)
    return TrackTable(
        file.path, reader, columns, values, clock, metadata, incomplete=block.dropped, minus_one_is_lost=True
    )
