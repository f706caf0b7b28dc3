"""ProAnalyst's text export of tracked features, and tables like it.

No verbatim export is published, and users strip or edit the header, so the numbers are found
first: the first of at least five rows of equal width that hold nothing else. What stands above is
kept verbatim, and its last rows are read as headings. Time is frame number over frame rate, never
the row number; a frame that is not in the file is a gap. A feature whose coordinates are all exactly
-1, which is how the software marks a lost feature, or whose cells are empty, is lost in that frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import is_lost, is_number, split_cells
from recoil_acquisition.readers.text_file import HEADER_LINES, read_text
from recoil_acquisition.readers.tracks.block import BLOCK_ROWS, find_numbers, read_track_table
from recoil_acquisition.readers.tracks.columns import columns_from_headings, increasing_whole
from recoil_acquisition.readers.tracks.recording import refuse_layout, track_recording


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
        if any(column.kind in ("frame", "position") for column in columns):
            return Claim.GENERIC
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
        refuse_layout(declared, path)
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
