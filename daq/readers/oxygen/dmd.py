"""Recordings of DEWETRON OXYGEN (.dmd), without DEWETRON's library.

The layout of blocks, texts and samples is described in `daq.readers.oxygen.blocks`, `daq.readers.oxygen.setup` and
`daq.readers.oxygen.samples`. Read are synchronous and asynchronous channels of one number per sample, with linear
scalings. What else was stored (CAN, video, strings, vectors, complex numbers, other scalings) is named in the notes
and left out.

Blocks reach beyond what was asked to be stored; samples outside the storing windows are left out, as in OXYGEN.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from daq.channel import RawCounts
from daq.errors import CorruptFileError, MissingChannelError, ReadError
from daq.readers.oxygen.blocks import ASYNC, SYNC, BlockIndex, index_blocks, is_oxygen
from daq.readers.oxygen.embedded_text import read_xml
from daq.readers.oxygen.samples import (
    INTEGERS,
    WIDTHS,
    Pieces,
    SampleLayout,
    StampedPieces,
    choose_stamped,
    count_missing,
    cut_to_windows,
)
from daq.readers.oxygen.setup import ChannelSetup, SegmentSetup, Setup, read_segments, read_setup, read_start
from daq.readers.oxygen.storing import Event, Windows, choose_windows, read_events, window_ticks
from daq.readers.reader import Declarations, SignalHeader
from daq.readers.text.text_table import unique_names
from daq.readers.time.increasing_stamps import left_out_note
from daq.timebase import TimeBase
from daq.track import Track

_WHOLE_TEXTS = ("oxy_config", "oxy_event")
"""Segments of which the last text says everything; those of ``oxy_event_recovery`` add to each other."""


class OxygenReader:
    """Reader of OXYGEN's recordings."""

    name = "DEWETRON OXYGEN recording"
    kind = "dewetron"
    suffixes = (".dmd",)

    def claims(self, head: bytes) -> bool:
        """Tell whether the file begins with DMDF and the writer's name."""
        return is_oxygen(head)

    def open(self, path: Path, declared: Declarations) -> OxygenRecording:
        """Open a recording: its block index and its setup, no samples of synchronous channels.

        Raises
        ------
        ReadError
            If it holds no samples that can be read.
        CorruptFileError
            If it is damaged.
        """
        index = index_blocks(path)
        try:
            with path.open("rb") as file:
                return OxygenRecording(index, file, declared.clock)
        except OSError as error:
            raise ReadError(f"cannot be read: {error.strerror or error}", path=path) from error


@dataclass(frozen=True, eq=False)
class _Signal:
    setup: ChannelSetup
    layout: SampleLayout
    pieces: Pieces | StampedPieces
    is_gapless: bool


class OxygenRecording:
    """One opened recording; its samples are read block by block when they are asked for.

    Parameters
    ----------
    index : BlockIndex
    file : binary file
        The same file, opened.
    clock : str
        Name of the source.
    """

    reader = OxygenReader.name

    def __init__(self, index: BlockIndex, file: BinaryIO, clock: str) -> None:
        self.path, self.incomplete, self._clock = index.path, index.incomplete, clock
        self._notes = list(index.notes)
        setup, segments, events = self._texts(index, file)
        windows, told = choose_windows(events, is_finished=not index.incomplete)
        self._notes += told
        names, repeated_names = unique_names([channel.name for channel in setup.channels])
        self._notes += repeated_names
        self._signals: dict[str, _Signal] = {}
        shared = Counter(channel.segment for channel in setup.channels)
        for name, channel in zip(names, setup.channels, strict=True):
            reason = self._add(name, channel, index, segments, windows, file, shared[channel.segment] > 1)
            if reason:
                self._notes.append(f"{name}: left out: {reason}")
        if not self._signals:
            raise ReadError(
                "there are no samples that can be read", path=self.path,
                found="; ".join(self._notes) or "no stored channels", remedy="export it from OXYGEN as text or HDF5",
            )  # fmt: skip
        self.signals = tuple(
            SignalHeader(name, s.setup.unit, s.pieces.count, metadata={"sample_format": s.setup.sample_format})
            for name, s in self._signals.items()
        )
        self.notes = tuple(self._notes)
        self.metadata: dict[str, Any] = {
            "library": index.library,
            "format_version": index.version,
            **setup.properties,
            "storing_windows_s": [[None if t is None else float(t) for t in window] for window in windows],
            "not_stored": list(setup.not_stored),
        }

    def _texts(self, index: BlockIndex, file: BinaryIO) -> tuple[Setup, dict[int, SegmentSetup], list[Event]]:
        """Read the last description of the segments, the last setup, and all events."""
        try:
            segments = read_segments(read_xml(self.path, file, index.configs[-1])) if index.configs else {}
            setup: Setup | None = None
            final: list[Event] | None = None
            recovery: set[Event] = set()
            latest = {block.segment: block for block in index.texts}
            for block in index.texts:
                name = segments[block.segment].name if block.segment in segments else ""
                if name in _WHOLE_TEXTS and block is not latest[block.segment]:
                    continue  # a later one says all of this again
                text = read_xml(self.path, file, block)
                kind = text.tag.rpartition("}")[2]
                if kind == "MeasurementConfig":
                    setup = read_setup(text)
                elif kind == "Events" and name == "oxy_event":
                    final = list(read_events(text))
                elif kind == "Events":
                    recovery.update(read_events(text))
            if setup is None:
                raise CorruptFileError(
                    "the setup of the measurement is missing", path=self.path, expected="MeasurementConfig",
                    found=index.incomplete or "none",
                )  # fmt: skip
            self.absolute_start = read_start(setup.properties)
        except (ValueError, KeyError, OverflowError) as error:
            raise CorruptFileError(f"the setup is damaged: {error}", path=self.path) from error
        if self.absolute_start is None:
            self._notes.append("the start of the acquisition is not stated: times count from an unknown instant")
        return setup, segments, sorted(recovery) if final is None else final

    def _add(
        self, name: str, channel: ChannelSetup, index: BlockIndex, segments: dict[int, SegmentSetup],
        windows: Windows, file: BinaryIO, is_shared: bool,
    ) -> str:  # fmt: skip
        """Take one channel in; return why it is left out, or nothing."""
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
            self.path, blocks, channel.sample_format, channel.bit_offset // 8, channel.bit_stride // 8,
            segment.compression == "lz4",
        )  # fmt: skip
        ticks = window_ticks(windows, channel.frequency_hz)
        if blocks.kind == ASYNC:
            if is_shared:
                return "it shares its asynchronous blocks with another channel"
            stamped = choose_stamped(layout, file, ticks)
            self._notes += left_out_note(name, stamped.met, stamped.repeated, stamped.backward)
            return self._take(name, _Signal(channel, layout, stamped, False))
        if channel.bit_offset % 8 or channel.bit_stride % 8 or layout.stride < WIDTHS[channel.sample_format]:
            return f"its samples are {channel.bit_stride} bits apart"
        layout.check_lengths()
        if (blocks.tick[1:] < (blocks.tick + blocks.count)[:-1]).any():
            return "its blocks overlap in time"
        pieces = cut_to_windows(blocks, ticks)
        gaps = np.flatnonzero(pieces.tick[1:] != (pieces.tick + pieces.high - pieces.low)[:-1])
        if missing := count_missing(pieces, ticks):
            self._notes.append(f"{name}: {missing} samples of its storing windows are not in the file")
        return self._take(name, _Signal(channel, layout, pieces, not gaps.size))

    def _take(self, name: str, signal: _Signal) -> str:
        if not signal.pieces.count:
            return "no sample of it is within the storing windows"
        self._signals[name] = signal
        return ""

    def _find(self, name: str) -> _Signal:
        try:
            return self._signals[name]
        except KeyError:
            raise MissingChannelError(name, tuple(self._signals), path=self.path) from None

    def _parts(self, signal: _Signal, start: int, stop: int, *, stamps: bool = False) -> Iterator[NDArray[Any]]:
        """Yield the stored numbers (or the ticks) of samples start to stop, block by block."""
        pieces, layout = signal.pieces, signal.layout
        first = int(np.searchsorted(pieces.ends, start, "right"))
        try:
            with self.path.open("rb", buffering=0) as file:
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
        except OSError as error:
            raise ReadError(f"cannot be read: {error.strerror or error}", path=self.path) from error

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read samples of one signal in the file's unit, shape (stop - start,); only their blocks are touched.

        Raises
        ------
        MissingChannelError
            If there is no such signal.
        CorruptFileError
            If a block is damaged.
        """
        signal = self._find(name)
        start, stop, _ = slice(start, stop).indices(signal.pieces.count)
        samples = np.empty(max(stop - start, 0))
        at = 0
        for part in self._parts(signal, start, stop):
            samples[at : at + part.size] = part
            at += part.size
        if (signal.setup.gain, signal.setup.offset) != (1.0, 0.0):
            samples *= signal.setup.gain
            samples += signal.setup.offset
        return samples

    def raw(self, name: str, start: int = 0, stop: int | None = None) -> RawCounts | None:
        """Return the stored integers; None if the source stored floats."""
        signal = self._find(name)
        dtype = INTEGERS.get(signal.setup.sample_format)
        if dtype is None:
            return None
        start, stop, _ = slice(start, stop).indices(signal.pieces.count)
        counts = np.empty(max(stop - start, 0), dtype)
        at = 0
        for part in self._parts(signal, start, stop):
            counts[at : at + part.size] = part
            at += part.size
        return RawCounts(counts, signal.setup.gain, signal.setup.offset, signal.setup.unit)

    def time_base(self, name: str) -> TimeBase:
        """Return the instants of one signal, in seconds after the acquisition's start.

        Uniform where nothing is missing between the first and the last sample, stamped elsewhere.
        """
        signal = self._find(name)
        pieces, frequency_hz = signal.pieces, signal.setup.frequency_hz
        if isinstance(pieces, Pieces) and signal.is_gapless:
            start_s, step_s = int(pieces.tick[0]) / frequency_hz, 1.0 / frequency_hz
            return self._made(name, start_s, step_s, pieces.count, None)
        if isinstance(pieces, Pieces):
            lengths = pieces.high - pieces.low
            ticks = np.repeat(pieces.tick - pieces.ends + lengths, lengths) + np.arange(pieces.count)
        else:
            ticks = np.concatenate(list(self._parts(signal, 0, pieces.count, stamps=True)))
        return self._made(name, 0.0, None, pieces.count, ticks / frequency_hz)

    def _made(
        self, name: str, start_s: float, step_s: float | None, count: int, stamps_s: NDArray[np.float64] | None
    ) -> TimeBase:
        try:
            if stamps_s is not None:
                return TimeBase.stamped(self._clock, stamps_s, self.absolute_start)
            return TimeBase(self._clock, start_s, step_s, count, None, self.absolute_start)
        except ValueError as error:
            raise CorruptFileError(f"the times of {name} cannot be told apart: {error}", path=self.path) from error

    def tracks(self) -> tuple[Track, ...]:
        """Return nothing: this is no camera."""
        return ()
