"""DeepLabCut's table of tracked body parts, as text.

The layout is that of pandas' ``to_csv`` of the software's own table: rows ``scorer``, ``individuals`` (several
animals only), ``bodyparts`` and ``coords``, then one row per frame: its number, counted from 0, and ``x``, ``y``,
``likelihood`` of every part, in pixels. A part that was not seen has coordinates all the same: only its likelihood
is low. The file has no time. Source: the DeepLabCut user guide, "How does DeepLabCut store its output?".

The same table as HDF5 is refused: the names of its columns are kept as a Python pickle, which runs code when it is
read.
"""

from __future__ import annotations

from pathlib import Path

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.hdf5.kind import SIGNATURE
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import is_number
from recoil_acquisition.readers.text.rows import read_rows
from recoil_acquisition.readers.tracks.block import read_headed_text
from recoil_acquisition.readers.tracks.columns import Column, without_text
from recoil_acquisition.readers.tracks.frame_time import frame_clock
from recoil_acquisition.readers.tracks.layout import first_cells
from recoil_acquisition.readers.tracks.recording import TrackTable, track_recording

_LEVELS = (("scorer", "bodyparts", "coords"), ("scorer", "individuals", "bodyparts", "coords"))
_SCORES = ("likelihood",)


class DeepLabCutReader:
    """Reader of DeepLabCut's text table."""

    name = "DeepLabCut"

    def claims(self, head: Head) -> Claim:
        """Be certain of a first cell ``scorer``, and of an HDF5 file that names the software's table."""
        is_text = any(cells[0].casefold() == "scorer" for cells in first_cells(head))
        return Claim.CERTAIN if is_text or b"df_with_missing" in head.content else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a table.

        Raises
        ------
        ReadError
            If it is HDF5, labels for training, or no frame rate is declared.
        CorruptFileError
            If its header or a row is damaged.
        """
        text = read_headed_text(path, lambda cells: len(cells) > 1)
        if text.file.read(0, len(SIGNATURE)) == SIGNATURE:
            raise ReadError(
                "the HDF5 table of DeepLabCut names its columns by a Python pickle, which is not read",
                path=path,
                expected="the same table as text",
                remedy="export it as csv (`save_as_csv=True`, or `deeplabcut.convert_h5_to_csv`)",
            )
        rows = text.rows
        header = tuple(row[0].casefold() for row in rows)
        levels = next((names for names in _LEVELS if header[: len(names)] == names), None)
        if levels is None:
            raise CorruptFileError(
                "the header is not DeepLabCut's",
                path=path,
                place="line 1, column 1",
                expected="rows scorer, bodyparts, coords",
                found=", ".join(repr(name[:20]) for name in header[:4]),
                remedy="export it again",
            )
        above, width = rows[: len(levels)], len(rows[0])
        if any(len(row) != width for row in above):
            raise CorruptFileError("the header rows differ in width", path=path, place=f"lines 1 to {len(levels)}")
        data = [row for row in rows[len(levels) :] if len(row) == width]
        if data and not is_number(data[0][0]):
            raise ReadError(
                "these are labels for training, by picture and not by frame",
                path=path,
                place=f"line {len(levels) + 1}",
                found=repr(data[0][0][:40]),
                remedy="export the analysed video instead",
            )
        columns = (Column("frame", "frame", ""), *(_column(cells) for cells in list(zip(*above, strict=True))[1:]))
        block = text.block([column.name for column in columns], header_rows=len(levels))
        values = read_rows(block)
        columns = without_text(columns, block.text_columns)
        clock = frame_clock(block, values, columns, declared.frame_rate_hz)
        scorers = list(dict.fromkeys(above[0][1:]))
        metadata = {"scorer": scorers[0] if len(scorers) == 1 else scorers, "encoding": text.file.encoding}
        return track_recording(
            TrackTable(path, self.name, columns, values, clock, metadata, incomplete=block.dropped), declared
        )


def _column(cells: tuple[str, ...]) -> Column:
    """Return the column that stands under one cell of each header row: scorer, individual, part, coordinate."""
    feature, coordinate = " ".join(cell for cell in cells[1:-1] if cell), cells[-1]
    name = f"{feature} {coordinate}"
    if coordinate.casefold() in ("x", "y", "z"):
        return Column("position", name, "px", feature, coordinate.upper())
    return Column("score" if coordinate.casefold() in _SCORES else "derived", name, "", feature)
