"""SLEAP's analysis table as text: one row per animal and frame.

Columns ``track``, ``frame_idx``, ``instance.score``, then ``<node>.x``, ``<node>.y``, ``<node>.score`` for every
node; frames are counted from 0, coordinates are in pixels, the centre of the first one being 0. A frame in which
nothing was found has no row, a node that was not found has empty cells, and the file has no time. Source: SLEAP
documentation, "Export data for analysis", and ``sleap.io.convert``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.row_counter import whole
from recoil_acquisition.readers.text.recording import about_text_columns
from recoil_acquisition.readers.text.rows import iter_rows
from recoil_acquisition.readers.text.text_table import TextBlock
from recoil_acquisition.readers.tracks.block import read_headed_text
from recoil_acquisition.readers.tracks.columns import Column
from recoil_acquisition.readers.tracks.frame_time import counted_clock
from recoil_acquisition.readers.tracks.layout import first_cells
from recoil_acquisition.readers.tracks.recording import TrackTable, track_recording

MOST_TRACKS = 256
"""Animals of one recording; more of them are identities that were lost and found anew."""

MOST_BYTES, MOST_RATIO = 1 << 26, 10
"""Size of animals side by side in every frame: bytes, or so many times the file's size where that is more."""

JOIN = "join the tracks of one animal in SLEAP and export again"

Places = NDArray[np.intp]


class SleapTextReader:
    """Reader of SLEAP's analysis table as text."""

    name = "SLEAP text"

    def claims(self, head: Head) -> Claim:
        """Be certain of headings with a frame index and a node's coordinate."""
        named = any("frame_idx" in cells and any(c.endswith(".x") for c in cells) for cells in first_cells(head))
        return Claim.CERTAIN if named else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a table.

        Raises
        ------
        ReadError
            If no frame rate is declared.
        CorruptFileError
            If a row is damaged, or an animal is in one frame twice.
        """
        text = read_headed_text(path, lambda cells: "frame_idx" in cells)
        names = text.rows[0]
        if "frame_idx" not in names or len(set(names)) < len(names):
            raise CorruptFileError("no heading of a SLEAP table", path=path, place="line 1", expected="frame_idx, once")
        named = names[0] == "track"
        block = text.block(names, text_columns=int(named))
        values, animals, animal = _instances(block, named=named)
        at = names.index("frame_idx")
        frames, row = _frames(values[:, at], block)
        left_out = [i for i in block.text_columns if i != at and not (named and i == 0)]
        kept = [i for i in range(len(names)) if i != at and not (named and i == 0) and i not in left_out]
        table = _paths(values, kept, row, animal, (frames.size, len(animals)), block)
        del values
        columns = tuple(sleap_column(name if len(animals) > 1 else "", names[i]) for name in animals for i in kept)
        clock = counted_clock(frames, declared.frame_rate_hz, path)
        metadata = {"tracks": animals, "encoding": text.file.encoding, "first_pixel": 0}
        notes = about_text_columns(names, {i: block.text_columns[i] for i in left_out})
        return track_recording(
            TrackTable(path, self.name, columns, table, clock, metadata, notes, incomplete=block.dropped), declared
        )


def _instances(block: TextBlock, *, named: bool) -> tuple[NDArray[np.float64], list[str], Places]:
    """Read the rows, each of which is an animal in a frame; return them, the animals, and the animal of each row."""
    values = np.empty((block.row_count, len(block.format.columns)))
    animal: Places = np.zeros(len(values), dtype=np.intp)
    number: dict[str, int] = {}
    for rows, numbers, names in iter_rows(block, named=named):
        values[rows] = numbers
        for name in dict.fromkeys(names):
            number.setdefault(name, len(number))
        if len(number) > 1:
            animal[rows] = list(map(number.__getitem__, names))
    if len(number) > MOST_TRACKS:
        raise CorruptFileError(
            f"{len(number)} tracks in one file",
            path=block.file.path,
            expected=f"at most {MOST_TRACKS}",
            remedy=JOIN,
        )
    return values, list(number) or [""], animal


def _frames(numbers: NDArray[np.float64], block: TextBlock) -> tuple[NDArray[np.int64], Places]:
    """Return the frames, increasing, and which of them each row is of."""
    bad = np.flatnonzero(~whole(numbers))
    if bad.size:
        place = block.place(int(bad[0]), "frame_idx")
        raise CorruptFileError("the frame is no whole number", path=block.file.path, place=place)
    if (np.diff(numbers) > 0).all():
        return numbers.astype(np.int64), np.arange(numbers.size)
    frames, row = np.unique(numbers.astype(np.int64), return_inverse=True)
    return frames, row


def _paths(
    values: NDArray[np.float64],
    kept: Sequence[int],
    row: Places,
    animal: Places,
    shape: tuple[int, int],
    block: TextBlock,
) -> NDArray[np.float64]:
    """Put the animals of a frame side by side; an animal that is not in a frame is NaN there.

    Parameters
    ----------
    values : ndarray of float64, shape (n_rows, n_columns)
    kept
        Columns that are taken.
    row, animal : ndarray of intp, shape (n_rows,)
        Frame and animal of each row, as indices.
    shape
        Number of frames and of animals.

    Returns
    -------
    ndarray of float64, shape (n_frames, n_animals * n_kept)
    """
    frames, animals = shape
    size = 8 * frames * animals * len(kept)
    if size > max(MOST_BYTES, MOST_RATIO * block.stop):
        raise ReadError(
            f"{animals} tracks over {frames} frames, of which few are in any one frame", path=block.file.path,
            found=f"{len(values)} rows, {size >> 20} MB side by side", remedy=JOIN,
        )  # fmt: skip
    place = row * animals + animal
    order = np.sort(place)
    if (order[1:] == order[:-1]).any():
        _, first, count = np.unique(place, return_index=True, return_counts=True)
        raise CorruptFileError(
            "a track is in one frame more than once", path=block.file.path,
            place=block.place(int(first[count > 1].min()), "frame_idx"),
            remedy="track the instances in SLEAP, so that each has a track of its own, and export again",
        )  # fmt: skip
    del order
    table = np.full((frames * animals, len(kept)), np.nan)
    for i, column in enumerate(kept):
        table[place, i] = values[:, column]
    return table.reshape(frames, -1)


def sleap_column(animal: str, heading: str) -> Column:
    """Return the column of a heading such as ``tip.x`` or ``instance.score``."""
    node, _, what = heading.rpartition(".")
    feature = " ".join(part for part in (animal, node) if part)
    name = " ".join(part for part in (animal, heading) if part)
    if what in ("x", "y"):
        return Column("position", name, "px", feature, what.upper())
    return Column("score" if what == "score" else "derived", name, "", feature)
