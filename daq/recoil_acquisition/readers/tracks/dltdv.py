"""Points digitised with DLTdv or Argus: ``xypts.csv``.

One header row names every column after its point and camera, ``pt1_cam1_X`` (DLTdv) or ``Track 1_cam_1_x`` (Argus);
then one row per frame without number or time. Frames are counted from 1. Coordinates are pixels, the first of which
is 1; a point that was not digitised is ``NaN``. DLTdv8 counts rows of pixels from the top, DLTdv5 and Argus from the
bottom, which the file does not say. Source: T. L. Hedrick, DLTdv manual, "Data files".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.rows import read_rows
from recoil_acquisition.readers.tracks.block import read_headed_text
from recoil_acquisition.readers.tracks.columns import Column, without_text
from recoil_acquisition.readers.tracks.frame_time import counted_clock
from recoil_acquisition.readers.tracks.layout import POINT_COLUMN, first_cells
from recoil_acquisition.readers.tracks.recording import TrackTable, track_recording
from recoil_acquisition.remark import Note, NoteCode

ROWS_ARE_FRAMES = "rows are frames, counted from 1: the file has no frame numbers, and a missing frame cannot be seen"


class DltdvReader:
    """Reader of the points of DLTdv and Argus."""

    name = "DLTdv points"

    def claims(self, head: Head) -> Claim:
        """Be certain where every heading names a point and a camera."""
        is_own = any(all(map(POINT_COLUMN.fullmatch, cells)) for cells in first_cells(head))
        return Claim.CERTAIN if is_own else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file of points.

        Raises
        ------
        ReadError
            If no frame rate is declared.
        CorruptFileError
            If the header or a row is damaged.
        """
        text = read_headed_text(path, lambda cells: len(cells) > 1)
        columns = tuple(_column(name, path, i) for i, name in enumerate(text.rows[0], start=1))
        block = text.block([column.name for column in columns])
        values = read_rows(block)
        columns = without_text(columns, block.text_columns)
        clock = counted_clock(np.arange(1, len(values) + 1, dtype=np.int64), declared.frame_rate_hz, path)
        cameras = {column.feature.casefold().rpartition("_cam")[2] for column in columns}
        notes = [Note(NoteCode.UNSEEN, None, ROWS_ARE_FRAMES)]
        if len(cameras) > 1:
            apart = f"points of {len(cameras)} cameras: frame offsets between them are not in this file"
            notes.append(Note(NoteCode.UNSEEN, None, apart))
        metadata = {"first_pixel": 1, "cameras": len(cameras), "encoding": text.file.encoding}
        return track_recording(
            TrackTable(path, self.name, columns, values, clock, metadata, tuple(notes), block.dropped), declared
        )


def _column(name: str, path: Path, number: int) -> Column:
    found = POINT_COLUMN.fullmatch(name)
    if found is None:
        raise CorruptFileError(
            "a heading names no point and camera",
            path=path,
            place=f"line 1, column {number}",
            expected="a name such as pt1_cam1_X",
            found=repr(name[:40]),
            remedy="export it again",
        )
    return Column("position", name, "px", found["feature"], found["axis"].upper())
