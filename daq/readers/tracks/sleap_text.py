"""SLEAP's analysis table as text: one row per animal and frame.

Columns ``track``, ``frame_idx``, ``instance.score``, then ``<node>.x``, ``<node>.y``, ``<node>.score`` for every
node; frames are counted from 0, coordinates are in pixels, the centre of the first one being 0. A frame in which
nothing was found has no row, a node that was not found has empty cells, and the file has no time. Source: SLEAP
documentation, "Export data for analysis", and ``sleap.io.convert``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq.errors import CorruptFileError
from daq.readers.reader import Declarations
from daq.readers.text.text_file import decode_head, read_text
from daq.readers.text.text_table import SEPARATORS, Block, find_block, has_decimal_comma, read_block, split_cells
from daq.readers.tracks.columns import Column
from daq.readers.tracks.frame_time import counted_clock
from daq.readers.tracks.recording import TrackRecording, TrackTable, refuse_layout
from daq.readers.tracks.signature import signature

MOST_TRACKS = 256
"""Animals of one film; more of them are identities that were lost and found anew."""


class SleapTextReader:
    """Reader of SLEAP's analysis table as text."""

    name = "SLEAP text"
    kind = "camera"
    suffixes = (".csv",)

    def claims(self, head: bytes) -> bool:
        """Tell whether the headings have a frame index and a node's coordinate."""
        return signature(decode_head(head).split("\n")[:1]) == "sleap"

    def open(self, path: Path, declared: Declarations) -> TrackRecording:
        """Open a table.

        Raises
        ------
        ReadError
            If no frame rate is declared.
        CorruptFileError
            If a row is damaged, or an animal is in one frame twice.
        """
        refuse_layout(declared, path)
        file = read_text(path)
        lines = file.lines(0, 6)
        separator = next((s for s in SEPARATORS if "frame_idx" in split_cells(lines[0], s)), ",")
        names = split_cells(lines[0], separator)
        if "frame_idx" not in names or len(set(names)) < len(names):
            raise CorruptFileError("no heading of a SLEAP table", path=path, place="line 1", expected="frame_idx, once")
        texts = names[0] == "track"
        comma = has_decimal_comma([split_cells(line, separator)[texts:] for line in lines[1:]], separator)
        block = find_block(file, file.start_of(1), separator, names, decimal_comma=comma)
        values, tracks = read_block(block, text_first_column=texts)
        at = names.index("frame_idx")
        numbers = values[:, at]
        bad = np.flatnonzero(~(np.isfinite(numbers) & (numbers == np.round(numbers)) & (np.abs(numbers) < 2.0**53)))
        if bad.size:
            raise CorruptFileError("the frame is no whole number", path=path, place=block.place(int(bad[0]), names[at]))
        frames, row = np.unique(numbers.astype(np.int64), return_inverse=True)
        animals = list(dict.fromkeys(tracks)) or [""]
        kept = [i for i in range(len(names)) if i != at and not (texts and i == 0)]
        if len(animals) > MOST_TRACKS:
            raise CorruptFileError(
                f"{len(animals)} tracks in one film", path=path, expected=f"at most {MOST_TRACKS}",
                remedy="join the tracks of one animal in SLEAP and export again",
            )  # fmt: skip
        index = np.array([animals.index(t) for t in tracks] or np.zeros(len(values)), dtype=np.intp)
        _refuse_doubles(row, index, len(animals), block)
        table = np.full((frames.size, len(animals), len(kept)), np.nan)
        table[row, index] = values[:, kept]
        columns = tuple(sleap_column(animal if len(animals) > 1 else "", names[i]) for animal in animals for i in kept)
        clock = counted_clock(frames, declared.frame_rate_hz, path)
        metadata = {"tracks": animals, "encoding": file.encoding, "first_pixel": 0}
        flat = table.reshape(frames.size, -1)
        return TrackRecording(
            TrackTable(path, self.name, columns, flat, clock, metadata, incomplete=block.dropped), declared
        )


def _refuse_doubles(row: NDArray[np.intp], animal: NDArray[np.intp], animals: int, block: Block) -> None:
    """Refuse a table in which one animal is in one frame twice."""
    _, first, count = np.unique(row * animals + animal, return_index=True, return_counts=True)
    if (count > 1).any():
        place = block.place(int(first[count > 1][0]), "frame_idx")
        raise CorruptFileError(
            "a track is in one frame more than once",
            path=block.file.path,
            place=place,
            remedy="track the instances in SLEAP, so that each has a track of its own, and export again",
        )


def sleap_column(animal: str, heading: str) -> Column:
    """Return the column of a heading such as ``tip.x`` or ``instance.score``."""
    node, _, what = heading.rpartition(".")
    feature = " ".join(part for part in (animal, node) if part)
    name = " ".join(part for part in (animal, heading) if part)
    if what in ("x", "y"):
        return Column("position", name, "px", feature, what.upper())
    return Column("score" if what == "score" else "derived", name, "", feature)
