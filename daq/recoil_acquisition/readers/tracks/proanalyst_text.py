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

from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.text.cells import is_number, split_cells
from recoil_acquisition.readers.text.text_file import decode_head, read_text
from recoil_acquisition.readers.tracks.block import BLOCK_ROWS, HEADER_LINES, find_numbers, read_track_table
from recoil_acquisition.readers.tracks.columns import columns_from_headings, increasing_whole
from recoil_acquisition.readers.tracks.recording import TrackRecording, refuse_layout
from recoil_acquisition.readers.tracks.signature import signature


class ProAnalystTextReader:
    """Reader of ProAnalyst's text export."""

    name = "ProAnalyst text"
    kind = "camera"
    suffixes = (".csv", ".txt")

    def claims(self, head: bytes) -> bool:
        """Tell whether numbers stand under headings of a track."""
        header, numbers = _parts(head)
        columns = columns_from_headings(header[-3:], len(numbers[0])) if numbers else None
        return columns is not None and any(column.kind in ("frame", "position") for column in columns)

    def suits(self, head: bytes) -> str:
        """Say so if there is nothing but numbers under whole ones that increase, as they stand in many a table."""
        header, numbers = _parts(head)
        first = [cells[0] for cells in numbers]
        bare = bool(numbers) and not any(header) and all(map(is_number, first)) and _whole(first)
        return "numbers without headings, as of camera tracks and of other tables" if bare else ""

    def open(self, path: Path, declared: Declarations) -> TrackRecording:
        """Open an export.

        Raises
        ------
        ReadError
            If there is neither a time column nor a declared frame rate, or a unit is unknown.
        CorruptFileError
            If no block of numbers is found, or a row of it is damaged.
        """
        refuse_layout(declared, path)
        return TrackRecording(read_track_table(read_text(path), self.name, declared.frame_rate_hz), declared)


def _parts(head: bytes) -> tuple[list[list[str]], list[list[str]]]:
    """Return the cells of the rows above the numbers and of the first rows of them, none if it is another's table."""
    lines = decode_head(head).split("\n")[:-1][: HEADER_LINES + BLOCK_ROWS]
    found = find_numbers(lines)
    if found is None or signature(lines):
        return [], []
    row, separator = found
    header = [split_cells(line, separator) for line in lines[:row]]
    if any(cells and cells[0].casefold().startswith(("time", "scorer")) for cells in header):
        return [], []
    return header, [split_cells(line, separator) for line in lines[row : row + BLOCK_ROWS]]


def _whole(cells: Sequence[str]) -> bool:
    return increasing_whole(np.array([float(cell.replace(",", ".")) for cell in cells]))
