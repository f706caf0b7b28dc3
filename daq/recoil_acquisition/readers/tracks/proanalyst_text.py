"""ProAnalyst's exports of tracked features, as text and in a workbook (``.xlsx``), and tables like them.

No verbatim export is published, and users strip or edit the header, so the numbers are found
first: the first of at least five rows of equal width that hold nothing else. What stands above is
kept verbatim, and its last rows are read as headings. Time is frame number over frame rate, never
the row number; a frame that is not in the file is a gap. A feature whose coordinates are all exactly
-1, which is how the software marks a lost feature, or whose cells are empty, is lost in that frame.

The rows of a sheet are read like the lines of the text: whatever header, then frame, time and two columns per feature.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import is_lost, is_number, split_cells
from recoil_acquisition.readers.text.sheet_text import Sheet, is_workbook, read_sheets
from recoil_acquisition.readers.text_file import HEADER_LINES, TextFile, read_text
from recoil_acquisition.readers.tracks.block import BLOCK_ROWS, find_numbers, read_track_table
from recoil_acquisition.readers.tracks.columns import columns_from_headings, increasing_whole
from recoil_acquisition.readers.tracks.recording import track_recording
from recoil_acquisition.remark import Note, NoteCode


class ProAnalystWorkbookReader:
    """Reader of ProAnalyst's workbook."""

    name = "ProAnalyst workbook"

    def claims(self, head: Head) -> Claim:
        """Take a workbook for some program's tracks: what is in it shows only once it is unpacked."""
        return Claim.GENERIC if is_workbook(head.content) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a workbook; its first sheet that holds a block of numbers is read, the others are named.

        Raises
        ------
        ReadError
            If openpyxl is missing, a unit is unknown, or there is neither a time column nor a declared frame rate.
        CorruptFileError
            If it is damaged, or no sheet holds a block of numbers.
        """
        sheets = tuple(Sheet(s.name, _padded(s.text)) for s in read_sheets(path))
        sheet = next((s for s in sheets if _has_numbers(s.text)), None)
        if sheet is None:
            raise CorruptFileError(
                "no sheet holds a block of numbers",
                path=path,
                expected=f"{BLOCK_ROWS} rows of numbers of equal width within {HEADER_LINES} rows",
                found=", ".join(repr(s.name) for s in sheets[:8]),
                remedy="export the tracks again",
            )
        file = TextFile(path, sheet.text.encode(), "utf-8")
        table = read_track_table(file, self.name, declared.frame_rate_hz)
        others = [s.name for s in sheets if s is not sheet]
        text = f"sheet {sheet.name!r} was read, the others were not: {', '.join(others)}"
        notes = (Note(NoteCode.LEFT_OUT, None, text),) if others else ()
        metadata = {**table.metadata, "sheet": sheet.name}
        return track_recording(replace(table, metadata=metadata, notes=(*notes, *table.notes)), declared)


def _has_numbers(text: str) -> bool:
    found = find_numbers(text.split("\n", HEADER_LINES + BLOCK_ROWS)[: HEADER_LINES + BLOCK_ROWS])
    return found is not None and found[1] == "\t"


def _padded(text: str) -> str:
    """Give the rows that begin with a number the same number of cells: empty ones at a row's end are not stored."""
    lines = text.split("\n")[:-1]
    marks = [line.count("\t") if is_number(line.lstrip("\t").partition("\t")[0]) else -1 for line in lines]
    most = max(marks, default=0)
    return "".join(
        f"{line}{chr(9) * (most - n)}\n" if n >= 0 else f"{line}\n" for line, n in zip(lines, marks, strict=True)
    )


class ProAnalystTextReader:
    """Reader of ProAnalyst's text export."""

    name = "ProAnalyst text"

    def claims(self, head: Head) -> Claim:
        """Take numbers under headings of a track for some program's tracks; numbers alone have their shape only."""
        header, numbers = _beginning(head)
        if not numbers:
            return Claim.NO
        if any(cells and cells[0].casefold().startswith("time") for cells in header):
            return Claim.NO  # a table that begins with time is a recorder's
        columns = columns_from_headings(header[-3:], len(numbers[0])) or ()
        if any(column.kind == "frame" for column in columns):
            return Claim.GENERIC
        if axes := {column.axis for column in columns if column.kind == "position"}:
            # inertial sensors have X, Y and Z and no frames: a rig says by `match` that they are a camera's
            return Claim.NO if "Z" in axes else Claim.GENERIC
        first = [cells[0] for cells in numbers]
        of_numbers = all(is_number(cell) or is_lost(cell) for cells in numbers for cell in cells)
        is_bare = not any(header) and of_numbers and all(map(is_number, first)) and _whole(first)
        return Claim.SHAPE if is_bare else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open an export.

        Raises
        ------
        ReadError
            If there is neither a time column nor a declared frame rate, or a unit is unknown.
        CorruptFileError
            If no block of numbers is found, or a row of it is damaged.
        """
        return track_recording(read_track_table(read_text(path), self.name, declared.frame_rate_hz), declared)


def _whole(cells: Sequence[str]) -> bool:
    return increasing_whole(np.array([float(cell.replace(",", ".")) for cell in cells]))


def _beginning(head: Head) -> tuple[list[list[str]], list[list[str]]]:
    """Return the cells above the numbers, and those of the first rows of numbers; both empty if there are none."""
    lines = head.lines[:-1][: HEADER_LINES + BLOCK_ROWS]
    found = find_numbers(lines)
    if found is None:
        return [], []
    row, separator = found
    header = [split_cells(line, separator) for line in lines[:row]]
    return header, [split_cells(line, separator) for line in lines[row : row + BLOCK_ROWS]]


def has_coordinates(head: Head) -> bool:
    """Return whether a table has a heading of a coordinate, whatever its first column is."""
    header, numbers = _beginning(head)
    columns = columns_from_headings(header[-3:], len(numbers[0])) if numbers else None
    return any(column.kind == "position" for column in columns or ())
