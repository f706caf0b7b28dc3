"""One signal of a file of DEWETRON OXYGEN: the blocks that hold it, and which of their samples were to be stored."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import ReadError, system_errors_as
from recoil_acquisition.readers.oxygen.blocks import ASYNC, SYNC, BlockIndex
from recoil_acquisition.readers.oxygen.samples import (
    WIDTHS,
    Pieces,
    SampleLayout,
    StampedPieces,
    choose_stamped,
    count_missing,
    cut_to_windows,
)
from recoil_acquisition.readers.oxygen.setup import ChannelSetup, SegmentSetup
from recoil_acquisition.readers.oxygen.storing import Windows, window_ticks
from recoil_acquisition.readers.time.increasing_stamps import left_out_note

NONE_STORED = "no sample of it is within the storing windows"


@dataclass(frozen=True, eq=False)
class Signal:
    """A channel whose samples can be read.

    Attributes
    ----------
    layout
        Of its samples in their blocks.
    pieces
        Of the blocks, within the storing windows.
    is_gapless
        Whether no sample is missing between the first and the last one.
    """

    setup: ChannelSetup
    layout: SampleLayout
    pieces: Pieces | StampedPieces
    is_gapless: bool

    def parts(self, start: int, stop: int, *, stamps: bool = False) -> Iterator[NDArray[Any]]:
        """Yield the stored numbers (or the ticks) of samples start to stop, block by block."""
        pieces, layout = self.pieces, self.layout
        first = int(np.searchsorted(pieces.ends, start, "right"))
        with system_errors_as(ReadError, layout.path, "read"), layout.path.open("rb", buffering=0) as file:
            for i in range(first, pieces.ends.size):
                before = int(pieces.ends[i - 1]) if i else 0
                low, high = max(start - before, 0), min(stop, int(pieces.ends[i])) - before
                if low >= high:
                    return
                if isinstance(pieces, Pieces):
                    at = int(pieces.low[i])
                    yield layout.stored(file, int(pieces.block[i]), at + low, at + high)
                else:
                    both = layout.stamped(file, int(pieces.block[i]))
                    yield both[0 if stamps else 1][pieces.chosen[i]][low:high]


def signal_of(
    name: str, channel: ChannelSetup, index: BlockIndex, segments: Mapping[int, SegmentSetup], windows: Windows,
    file: BinaryIO, notes: list[str], *, is_shared: bool,
) -> Signal | str:  # fmt: skip
    """Return the signal of a channel, or why it is left out.

    Parameters
    ----------
    windows
        In which samples were to be stored.
    file
        The same file, opened: the stamps of asynchronous samples are read.
    notes
        Gets what is missing.
    is_shared
        Whether other channels are in the same blocks.

    Raises
    ------
    CorruptFileError
        If a block is shorter than its samples.
    """
    if channel.refused:
        return channel.refused
    if channel.sample_format not in WIDTHS:
        return f"its samples are of format {channel.sample_format!r}"
    blocks, segment = index.samples.get(channel.segment), segments.get(channel.segment)
    if blocks is None:
        return "the file holds no samples of it"
    if segment is None or segment.frequency_hz != channel.frequency_hz or not 0 < channel.frequency_hz < math.inf:
        stated = "none" if segment is None else f"{segment.frequency_hz:g} Hz"
        return f"its time base is {channel.frequency_hz:g} Hz, that of its segment {stated}"
    if segment.compression not in ("", "lz4"):
        return f"its samples are compressed by {segment.compression!r}"
    if {SYNC: "SYNC", ASYNC: "ASYNC"}[blocks.kind] != channel.frequency:
        return f"it is {channel.frequency!r}, but its blocks are not"
    layout = SampleLayout(
        index.path, blocks, channel.sample_format, channel.bit_offset // 8, channel.bit_stride // 8,
        segment.compression == "lz4",
    )  # fmt: skip
    ticks = window_ticks(windows, channel.frequency_hz)
    if blocks.kind == ASYNC:
        if is_shared:
            return "it shares its asynchronous blocks with another channel"
        stamped = choose_stamped(layout, file, ticks)
        notes += left_out_note(name, stamped.met, stamped.repeated, stamped.backward)
        return Signal(channel, layout, stamped, False) if stamped.count else NONE_STORED
    if channel.bit_offset % 8 or channel.bit_stride % 8 or layout.stride < WIDTHS[channel.sample_format]:
        return f"its samples are {channel.bit_stride} bits apart"
    layout.check_lengths()
    if (blocks.tick[1:] < (blocks.tick + blocks.count)[:-1]).any():
        step = int(np.flatnonzero(blocks.tick[1:] < (blocks.tick + blocks.count)[:-1])[0]) + 1
        return f"its blocks overlap in time: a second recording begins at byte {int(blocks.offset[step])}"
    pieces = cut_to_windows(blocks, ticks)
    gaps = np.flatnonzero(pieces.tick[1:] != (pieces.tick + pieces.high - pieces.low)[:-1])
    if missing := count_missing(pieces, ticks):
        notes.append(f"{name}: {missing} samples of its storing windows are not in the file")
    return Signal(channel, layout, pieces, not gaps.size) if pieces.count else NONE_STORED
