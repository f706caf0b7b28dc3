"""ProAnalyst's text export of tracked features, and tables like it.

No verbatim export is published, and users strip or edit the header, so the numbers are found
first: the first of at least five rows of equal width that hold nothing else. What stands above is
kept verbatim, and its last rows are read as headings. Time is frame number over frame rate, never
the row number; a frame that is not in the file is a gap. A feature whose coordinates are all exactly
-1, which is how the software marks a lost feature, or whose cells are empty, is lost in that frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.channel import RawCounts
from daq.errors import CorruptFileError, MissingChannelError
from daq.readers.reader import Declarations, SignalHeader
from daq.readers.text_file import decode_head, read_text
from daq.readers.text_table import (
    SEPARATORS,
    Block,
    find_block,
    has_decimal_comma,
    is_lost,
    is_number,
    read_block,
    split_cells,
    unique_names,
)
from daq.readers.track_columns import Column, columns_from_headings, columns_from_numbers, increasing_whole
from daq.readers.track_time import frame_clock
from daq.timebase import AbsoluteStart, TimeBase
from daq.track import Track

BLOCK_ROWS = 5
"""Rows of numbers in a row that make a block."""

HEADER_LINES = 60
"""Lines above which the numbers must begin."""


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


class ProAnalystTextReader:
    """Reader of ProAnalyst's text export."""

    name = "ProAnalyst text"
    kind = "camera"
    suffixes = (".csv", ".txt")

    def claims(self, head: bytes) -> bool:
        """Tell whether numbers stand under headings of a track, or without any under whole frame numbers."""
        lines = decode_head(head).split("\n")[:-1][: HEADER_LINES + BLOCK_ROWS]
        found = find_numbers(lines)
        if found is None:
            return False
        row, separator = found
        header = [split_cells(line, separator) for line in lines[:row]]
        if any(cells and cells[0].casefold().startswith(("time", "scorer")) for cells in header):
            return False
        numbers = [split_cells(line, separator) for line in lines[row : row + BLOCK_ROWS]]
        columns = columns_from_headings(header[-3:], len(numbers[0]))
        if columns is not None:
            return any(column.kind in ("frame", "position") for column in columns)
        first = [cells[0] for cells in numbers]
        return not any(header) and all(is_number(c) for c in first) and _whole(first)

    def open(self, path: Path, declared: Declarations) -> ProAnalystTextRecording:
        """Open an export.

        Raises
        ------
        ReadError
            If there is neither a time column nor a declared frame rate.
        CorruptFileError
            If no block of numbers is found, or a row of it is damaged.
        """
        file = read_text(path)
        lines = file.lines(0, HEADER_LINES + BLOCK_ROWS)
        found = find_numbers(lines)
        if found is None:
            raise CorruptFileError(
                "no block of numbers",
                path=path,
                expected=f"{BLOCK_ROWS} rows of numbers of equal width within {HEADER_LINES} lines",
                remedy="export the tracks as text again",
            )
        row, separator = found
        start = 0
        for _ in range(row):
            start = file.data.find(b"\n", start) + 1
        numbers = [split_cells(line, separator) for line in lines[row : row + BLOCK_ROWS]]
        width = len(numbers[0])
        header = [split_cells(line, separator) for line in lines[:row]]
        if all(not cells[-1] for cells in numbers) and (not header or len(header[-1]) < width or not header[-1][-1]):
            width -= 1
        comma = has_decimal_comma(numbers, separator)
        columns = columns_from_headings(header[-3:], width)
        labels = [c.name for c in columns] if columns else [f"column {i + 1}" for i in range(width)]
        block = find_block(file, start, separator, labels, decimal_comma=comma)
        values, _ = read_block(block)
        metadata = {
            "header": lines[:row],
            "encoding": file.encoding,
            "separator": separator,
            "decimal_mark": "," if comma else ".",
        }
        return ProAnalystTextRecording(block, values, columns or columns_from_numbers(values), declared, metadata)


def _whole(cells: Sequence[str]) -> bool:
    return increasing_whole(np.array([float(cell.replace(",", ".")) for cell in cells]))


class ProAnalystTextRecording:
    """One opened tracking export.

    Parameters
    ----------
    block : Block
    values : ndarray of float64, shape (n_frames, n_columns)
    columns : tuple of Column
    declared : Declarations
    metadata : mapping
    """

    reader = ProAnalystTextReader.name
    absolute_start: AbsoluteStart | None = None

    def __init__(
        self,
        block: Block,
        values: NDArray[np.float64],
        columns: tuple[Column, ...],
        declared: Declarations,
        metadata: Mapping[str, Any],
    ) -> None:
        self.path = block.file.path
        self.incomplete = block.dropped
        self._columns, self._values = columns, values
        clock = frame_clock(block, values, columns, declared.frame_rate_hz)
        notes = [*([block.dropped] if block.dropped else []), *clock.notes]
        self._frames = clock.numbers
        self._time_base = TimeBase.stamped(declared.clock, clock.times_s)
        self._features: dict[str, list[int]] = {}
        for i, column in enumerate(columns):
            if column.kind == "position":
                self._features.setdefault(column.feature, []).append(i)
        repeated = self._repeated_pictures()
        self._mark_lost(notes)
        if repeated:
            shown = ", ".join(map(str, repeated[:8])) + (" ..." if len(repeated) > 8 else "")
            notes.append(f"repeated pictures (all features exactly as before): {len(repeated)}, frames {shown}")
        if any(c.kind == "derived" for c in columns):
            notes.append(
                "columns that the tracking software derived carry its own filter: "
                + ", ".join(c.name for c in columns if c.kind == "derived")
            )
        signal_columns = [i for i, c in enumerate(columns) if c.kind in ("position", "derived")]
        names, repeats = unique_names([columns[i].name for i in signal_columns])
        self._column = dict(zip(names, signal_columns, strict=True))
        self.signals = tuple(
            SignalHeader(n, columns[i].unit, len(values), metadata={"kind": columns[i].kind})
            for n, i in self._column.items()
        )
        self.metadata: Mapping[str, Any] = {
            **metadata,
            "frame_rate_hz": clock.rate_hz,
            "repeated_frames": repeated,
        }
        self.notes = (*notes, *repeats)

    def _repeated_pictures(self) -> list[int]:
        """Frame numbers whose coordinates all equal those of the frame before."""
        positions = [i for at in self._features.values() for i in at]
        if not positions:
            return []
        same = (np.diff(self._values[:, positions], axis=0) == 0).all(axis=1)
        lost = (self._values[1:, positions] == -1).all(axis=1)
        return [int(n) for n in self._frames[1:][same & ~lost]]

    def _mark_lost(self, notes: list[str]) -> None:
        """Set coordinates of lost features to NaN and count them."""
        for feature, at in self._features.items():
            values = self._values[:, at]
            marked = (values == -1).all(axis=1) & (len(at) > 1)
            empty = np.isnan(values).any(axis=1)
            self._values[np.flatnonzero(marked)[:, None], at] = np.nan
            lost = int((marked | empty).sum())
            if lost:
                kinds = f"{int(marked.sum())} marked -1, {int(empty.sum())} empty"
                notes.append(f"{feature or 'feature1'}: lost in {lost} of {len(values)} frames ({kinds})")

    def _index(self, name: str) -> int:
        try:
            return self._column[name]
        except KeyError:
            raise MissingChannelError(name, tuple(self._column), path=self.path) from None

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read coordinates of one signal in the file's unit, lost ones NaN, shape (stop - start,)."""
        return self._values[start:stop, self._index(name)].copy()

    def raw(self, name: str) -> RawCounts | None:
        """Return None: a text export holds no raw counts."""
        self._index(name)
        return None

    def time_base(self, name: str) -> TimeBase:
        """Return the frames' instants: frame number over frame rate."""
        self._index(name)
        return self._time_base

    def tracks(self) -> tuple[Track, ...]:
        """Return the features' paths; a frame that lost one coordinate lost them all."""
        tracks = []
        for n, (feature, at) in enumerate(self._features.items(), start=1):
            positions = self._values[:, at].copy()
            positions[np.isnan(positions).any(axis=1)] = np.nan
            axes = tuple(self._columns[i].axis for i in at)
            tracks.append(
                Track(
                    feature or f"feature{n}", axes, positions, self._frames, self._columns[at[0]].unit, self._time_base
                )
            )
        return tuple(tracks)
