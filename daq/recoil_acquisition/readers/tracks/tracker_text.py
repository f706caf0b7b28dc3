r"""Data that Tracker (Open Source Physics) exports from its tables.

An optional line ``#multi:``, a row with the names of the tracks, each over its first column, and a row of variables
that begins with ``t``: ``x``, ``y``, ``v_{x}`` or ``vx`` ...; then one row per step. A step without a mark keeps its
row, with empty cells; velocities, which are central differences, are empty at the ends. Separated by tabs, semicolons,
commas or several spaces, often with a separator at the end of the row. Time is in seconds; lengths are in whatever
the user calibrated, which the file does not say. Source: Tracker help, "Exporting data"; examples quoted by the
physics department of Brock University.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import has_decimal_comma, split_cells
from recoil_acquisition.readers.text.rows import read_rows
from recoil_acquisition.readers.text.text_table import find_block
from recoil_acquisition.readers.text_file import LongText, Text
from recoil_acquisition.readers.tracks.columns import AXES, LOST_MARKERS, Column, without_text
from recoil_acquisition.readers.tracks.frame_time import frame_clock
from recoil_acquisition.readers.tracks.layout import spread, spread_text, tracker_header
from recoil_acquisition.readers.tracks.recording import TrackTable, track_recording

HEAD_ROWS = 9
"""Rows by which header and decimal mark are found."""


class TrackerTextReader:
    """Reader of Tracker's exported data."""

    name = "Tracker text"

    def claims(self, head: Head) -> Claim:
        """Be certain of a row of names over a row of variables that begins with the time."""
        return Claim.CERTAIN if tracker_header(head.lines[:8]) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open an export.

        Raises
        ------
        ReadError
            If it has no variable but the time.
        CorruptFileError
            If its header or a row is damaged, or time does not increase.
        """
        file = LongText(path)
        head = file.lines(HEAD_ROWS)
        found = tracker_header(head[:4])
        if found is None:
            raise CorruptFileError(
                "no header of a Tracker export",
                path=path,
                expected="a row of track names over a row that begins with `t`",
                remedy="export it again with File > Export > Data File",
            )
        row, separator = found
        lines = [split_cells(spread(line), separator) for line in head[: row + 6]]
        columns = _columns(lines[row - 1], lines[row], single=row == 1)
        comma = has_decimal_comma(lines[row + 1 :])
        parted: Text = spread_text(file) if any(spread(line) != line for line in head) else file
        start = parted.line_start(row + 1)
        labels = [column.name for column in columns]
        block = find_block(parted, start, separator, labels, decimal_comma=comma, markers=LOST_MARKERS)
        values = read_rows(block)
        # a frame column of one track of several is empty where that track is
        columns = tuple(
            replace(c, kind="derived") if c.kind == "frame" and np.isnan(values[:, i]).any() else c
            for i, c in enumerate(columns)
        )
        columns = without_text(columns, block.text_columns)
        clock = frame_clock(block, values, columns, declared.frame_rate_hz)
        metadata = {"header": head[: row + 1], "encoding": file.encoding, "separator": separator}
        return track_recording(
            TrackTable(path, self.name, columns, values, clock, metadata, incomplete=block.dropped), declared
        )


def _columns(over: list[str], names: list[str], *, single: bool) -> tuple[Column, ...]:
    """Return the columns under a row of track names over a row of variables."""
    while not names[-1]:
        names = names[:-1]
    only = next(cell for cell in over if cell)
    feature, columns = "", [Column("time", names[0], "s")]
    for track, name in zip([*over[1:], *[""] * len(names)], names[1:], strict=False):
        feature = only if single else track or feature
        if name.casefold() == "frame":
            columns.append(Column("frame", f"{feature} {name}", "", feature))
        elif name.casefold() in AXES:
            columns.append(Column("position", f"{feature} {name}", "", feature, name.upper()))
        else:
            columns.append(Column("derived", f"{feature} {name}", "", feature))
    return tuple(columns)
