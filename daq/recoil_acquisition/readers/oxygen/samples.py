"""Samples of one channel of a .dmd file of DEWETRON OXYGEN, read block by block.

The payload of a block of synchronous samples holds one channel behind the other: sample ``i`` is at bit
``raw_offset + i * raw_stride``, both from the setup. A block keeps the length for which it was made, so its head's
count says how many samples of it are valid. An asynchronous block holds pairs: u64 tick, then the number. The payload
of a segment whose compression is ``lz4`` is u32 length and one LZ4 block, which must become that long.

A signal is the blocks that hold it, and which of their samples were to be stored.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, ReadError, system_errors_as
from recoil_acquisition.readers.oxygen.blocks import ASYNC, MOST_TICKS, SYNC, BlockIndex, SampleBlocks
from recoil_acquisition.readers.oxygen.setup import ChannelSetup, SegmentSetup, Windows, window_ticks
from recoil_acquisition.readers.time.increasing_stamps import keep_increasing, left_out_note
from recoil_acquisition.remark import Note, NoteCode, Remark

WIDTHS = {"sint24": 3, "sint32": 4, "uint32": 4, "float": 4, "double": 8}
"""Bytes of one sample by its format."""

INTEGERS = {"sint24": np.dtype(np.int32), "sint32": np.dtype(np.int32), "uint32": np.dtype(np.uint32)}

_STORED = {"sint32": "<i4", "uint32": "<u4", "float": "<f4", "double": "<f8"}
_MOST_BLOCK = 1 << 26
"""Bytes of one block, decompressed: what the files themselves state as their largest."""
_LZ4_GAIN = 255
"""Ratio by which an LZ4 block becomes longer, at most."""
_STAMP = 8

NONE_STORED = "no sample of it is within the storing windows"


@dataclass(frozen=True, eq=False)
class Pieces:
    """The parts of blocks that a channel consists of.

    Attributes
    ----------
    block, low, high : ndarray of int64, shape (n_pieces,)
        Block of each piece, and its samples ``low`` to ``high`` (excluded).
    tick : ndarray of int64, shape (n_pieces,)
        Tick of the first sample of each piece.
    ends : ndarray of int64, shape (n_pieces,)
        Number of samples up to the end of each piece.
    """

    block: NDArray[np.int64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]
    tick: NDArray[np.int64]
    ends: NDArray[np.int64]

    @property
    def count(self) -> int:
        """Number of samples."""
        return int(self.ends[-1]) if self.ends.size else 0

    @classmethod
    def of(cls, block: NDArray[Any], low: NDArray[Any], high: NDArray[Any], tick: NDArray[Any]) -> Pieces:
        """Make the pieces that are not empty."""
        kept = high > low
        return cls(block[kept], low[kept], high[kept], tick[kept], np.cumsum((high - low)[kept]))


@dataclass(frozen=True, eq=False)
class SampleLayout:
    """Layout of the samples of one channel in the blocks of its segment.

    Attributes
    ----------
    sample_format
        Format of a sample, a key of `WIDTHS`.
    offset, stride
        Byte of the first sample within a synchronous block, and bytes from one to the next.
    is_packed
        Whether payloads are LZ4.
    """

    path: Path
    blocks: SampleBlocks
    sample_format: str
    offset: int
    stride: int
    is_packed: bool

    def check_lengths(self) -> None:
        """Compare the counts of all blocks with their lengths.

        Raises
        ------
        CorruptFileError
            If a block cannot hold as many samples as it says.
        """
        needed = self.offset + (self.blocks.count - 1) * self.stride + WIDTHS[self.sample_format]
        held = self.blocks.length * _LZ4_GAIN if self.is_packed else self.blocks.length
        short = np.flatnonzero((self.blocks.count > 0) & (needed > held))
        if short.size:
            self._refuse(int(short[0]), f"{int(needed[short[0]])} bytes", f"{int(self.blocks.length[short[0]])}")

    def _refuse(self, block: int, expected: str, found: str) -> None:
        raise CorruptFileError(
            "a block of samples is not as long as its head says", path=self.path,
            place=f"byte {int(self.blocks.offset[block])}", expected=expected, found=found,
        )  # fmt: skip

    def payload(self, file: BinaryIO, block: int) -> bytes:
        """Read one payload, decompressed."""
        content = self._read(file, block, 0, int(self.blocks.length[block]))
        return self._unpack(content, block) if self.is_packed else content

    def _read(self, file: BinaryIO, block: int, start: int, length: int) -> bytes:
        file.seek(int(self.blocks.offset[block]) + start)
        content = file.read(length)
        if len(content) < length:
            self._refuse(block, f"{length} bytes", f"{len(content)}")
        return content

    def _unpack(self, content: bytes, block: int) -> bytes:
        from lz4.block import LZ4BlockError, decompress

        length = int.from_bytes(content[:4], "little")
        if len(content) < 5 or length > min(_MOST_BLOCK, _LZ4_GAIN * len(content)):
            self._refuse(block, f"at most {_LZ4_GAIN} times {len(content)} bytes", f"{length} bytes promised")
        try:
            unpacked: bytes = decompress(content[4:], uncompressed_size=length)
        except (LZ4BlockError, ValueError, MemoryError, OverflowError) as error:
            raise CorruptFileError(
                f"a compressed block is damaged: {error}", path=self.path,
                place=f"byte {int(self.blocks.offset[block])}",
            ) from error  # fmt: skip
        if len(unpacked) != length:
            self._refuse(block, f"{length} bytes decompressed", f"{len(unpacked)}")
        return unpacked

    def stored(self, file: BinaryIO, block: int, low: int, high: int) -> NDArray[Any]:
        """Read samples ``low`` to ``high`` of a synchronous block as they are stored, shape (high - low,)."""
        width = WIDTHS[self.sample_format]
        start, length = self.offset + low * self.stride, (high - low - 1) * self.stride + width
        if self.is_packed:
            content = self.payload(file, block)[start : start + length]
            if len(content) < length:
                self._refuse(block, f"{start + length} bytes decompressed", f"{start + len(content)}")
        else:
            content = self._read(file, block, start, length)
        return decode(content, high - low, 0, self.stride, self.sample_format)

    def stamped(self, file: BinaryIO, block: int) -> tuple[NDArray[np.int64], NDArray[Any]]:
        """Read the ticks and the stored samples of an asynchronous block, shapes (n_samples,)."""
        count, width = int(self.blocks.count[block]), _STAMP + WIDTHS[self.sample_format]
        content = self.payload(file, block)
        if len(content) < count * width:
            self._refuse(block, f"{count} stamped samples of {width} bytes", f"{len(content)} bytes")
        ticks = np.ndarray((count,), "<u8", content, 0, (width,))
        if count and int(ticks.max()) >= MOST_TICKS:
            self._refuse(block, f"stamps below {MOST_TICKS}", str(int(ticks.max())))
        return ticks.astype(np.int64), decode(content, count, _STAMP, width, self.sample_format)


def decode(content: bytes, count: int, offset: int, stride: int, sample_format: str) -> NDArray[Any]:
    """Turn bytes into numbers, shape (count,): one every ``stride`` bytes, from ``offset`` on."""
    if not count:
        return np.empty(0)
    if sample_format == "sint24":
        # four bytes from the one before: an arithmetic shift leaves the sign and drops that one
        wide: NDArray[np.int32] = np.ndarray((count,), "<i4", b"\0" + content, offset, (stride,))
        return wide >> 8
    return np.ndarray((count,), _STORED[sample_format], content, offset, (stride,)).copy()


def cut_to_windows(blocks: SampleBlocks, windows: list[tuple[int, int]]) -> Pieces:
    """Choose what synchronous blocks hold of storing windows.

    Parameters
    ----------
    blocks
        Blocks that do not overlap.
    windows
        Storing windows in order, ticks, the end excluded.
    """
    parts = []
    for first, end in windows:
        begin = max(int(np.searchsorted(blocks.tick, first, "right")) - 1, 0)
        stop = int(np.searchsorted(blocks.tick, end, "left"))
        chosen = np.arange(begin, max(stop, begin), dtype=np.int64)
        low = np.clip(first - blocks.tick[chosen], 0, blocks.count[chosen])
        high = np.clip(end - blocks.tick[chosen], 0, blocks.count[chosen])
        parts.append((chosen, low, high, blocks.tick[chosen] + low))
    return Pieces.of(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def count_missing(pieces: Pieces, ticks: list[tuple[int, int]]) -> int:
    """Count the samples that storing windows should hold and the file does not."""
    last = int(pieces.tick[-1] + pieces.high[-1] - pieces.low[-1]) if pieces.tick.size else 0
    first = int(pieces.tick[0]) if pieces.tick.size else 0
    wanted = 0
    for begin, end in ticks:
        # an end or a begin that is not stated is where the samples end or begin
        wanted += max((last if end == MOST_TICKS else end) - (first if begin == 0 else begin), 0)
    return max(wanted - pieces.count, 0)


@dataclass(frozen=True, eq=False)
class StampedPieces:
    """Pieces of an asynchronous channel.

    Attributes
    ----------
    block : ndarray of int64, shape (n_pieces,)
        Block of each piece.
    chosen
        Samples of the block that belong to the channel, for each piece.
    ends : ndarray of int64, shape (n_pieces,)
        Number of samples up to the end of each piece.
    met, repeated, backward
        Samples within the windows, and those of them that are left out for their stamps.
    """

    block: NDArray[np.int64]
    chosen: tuple[slice | NDArray[np.int64], ...]
    ends: NDArray[np.int64]
    met: int
    repeated: int
    backward: int

    @property
    def count(self) -> int:
        """Number of samples."""
        return int(self.ends[-1]) if self.ends.size else 0


def choose_stamped(layout: SampleLayout, file: BinaryIO, windows: list[tuple[int, int]]) -> StampedPieces:
    """Choose what asynchronous blocks hold of storing windows, with stamps that increase strictly.

    Every block is read once, one at a time: only its stamps tell how many samples there are.
    """
    blocks: list[int] = []
    chosen: list[NDArray[np.int64]] = []
    met = repeated = backward = 0
    largest = -1
    for block in range(layout.blocks.tick.size):
        ticks, _ = layout.stamped(file, block)
        inside = np.zeros(ticks.size, bool)
        for first, end in windows:
            inside |= (ticks >= first) & (ticks < end)
        places = np.flatnonzero(inside)
        met += int(places.size)
        before = ticks[places] < largest
        backward += int(before.sum())
        places = places[~before]
        kept, again, back = keep_increasing(ticks[places])
        repeated, backward = repeated + again, backward + back
        places = places[kept]
        if not places.size:
            continue
        if blocks and int(ticks[places[0]]) == largest:  # the last one of the block before is repeated
            chosen[-1] = chosen[-1][:-1]
            repeated += 1
        largest = int(ticks[places[-1]])
        blocks.append(block)
        chosen.append(places)
    sizes = np.array([places.size for places in chosen], np.int64)
    return StampedPieces(
        np.array(blocks, np.int64), tuple(_as_slice(p) for p in chosen), np.cumsum(sizes), met, repeated, backward
    )


def _as_slice(places: NDArray[np.int64]) -> slice | NDArray[np.int64]:
    """Spare the memory of places that are one behind the other."""
    if places.size and int(places[-1]) - int(places[0]) == places.size - 1:
        return slice(int(places[0]), int(places[-1]) + 1)
    return places


@dataclass(frozen=True, eq=False)
class Signal:
    """A channel whose samples can be read.

    Attributes
    ----------
    layout
        Layout of its samples in their blocks.
    pieces
        Pieces of the blocks within the storing windows.
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
    file: BinaryIO, notes: list[Remark], *, is_shared: bool,
) -> Signal | str:  # fmt: skip
    """Return the signal of a channel, or why it is left out.

    Parameters
    ----------
    windows
        Storing windows of the samples.
    file
        Same file, opened: the stamps of asynchronous samples are read.
    notes
        List that notes on missing samples are added to.
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
        text = f"{name}: {missing} samples of its storing windows are not in the file"
        notes.append(Note(NoteCode.LOST, name, text))
    return Signal(channel, layout, pieces, not gaps.size) if pieces.count else NONE_STORED
