"""Recordings of DEWETRON OXYGEN (.dmd), without DEWETRON's library.

The layout of blocks, texts and samples is described in `readers.oxygen.blocks`, `readers.oxygen.setup` and
`readers.oxygen.samples`. Read are synchronous and asynchronous channels of one number per sample, with linear
scalings. What else was stored (CAN, video, strings, vectors, complex numbers, other scalings) is named in the notes
and left out.

Blocks reach beyond what was asked to be stored; samples outside the storing windows are left out, as in OXYGEN.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import CorruptFileError, MissingChannelError, ReadError
from recoil_acquisition.readers.oxygen.blocks import BlockIndex, index_blocks
from recoil_acquisition.readers.oxygen.description import read_description
from recoil_acquisition.readers.oxygen.samples import INTEGERS, Pieces
from recoil_acquisition.readers.oxygen.signal import Signal, signal_of
from recoil_acquisition.readers.oxygen.storing import choose_windows
from recoil_acquisition.readers.reader import Declarations, SignalHeader
from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.timebase import TimeBase
from recoil_acquisition.track import Track


class OxygenReader:
    """Reader of OXYGEN's recordings."""

    name = "DEWETRON OXYGEN recording"

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
        description = read_description(index, file)
        setup, self.absolute_start = description.setup, description.start
        notes = list(index.notes)
        if self.absolute_start is None:
            notes.append("the start of the acquisition is not stated: times count from an unknown instant")
        windows, told = choose_windows(description.events, is_finished=not index.incomplete)
        notes += told
        names, repeated_names = unique_names([channel.name for channel in setup.channels])
        notes += repeated_names
        self._signals: dict[str, Signal] = {}
        shared = Counter(channel.segment for channel in setup.channels)
        for name, channel in zip(names, setup.channels, strict=True):
            is_shared = shared[channel.segment] > 1
            signal = signal_of(name, channel, index, description.segments, windows, file, notes, is_shared=is_shared)
            if isinstance(signal, str):
                notes.append(f"{name}: left out: {signal}")
            else:
                self._signals[name] = signal
        if not self._signals:
            raise ReadError(
                "there are no samples that can be read", path=self.path,
                found="; ".join(notes) or "no stored channels", remedy="export it from OXYGEN as text or HDF5",
            )  # fmt: skip
        self.signals = tuple(
            SignalHeader(name, s.setup.unit, s.pieces.count, metadata={"sample_format": s.setup.sample_format})
            for name, s in self._signals.items()
        )
        self.notes = tuple(notes)
        self.metadata: dict[str, Any] = {
            "library": index.library,
            "format_version": index.version,
            **setup.properties,
            "storing_windows_s": [[None if t is None else float(t) for t in window] for window in windows],
            "not_stored": list(setup.not_stored),
        }

    def _find(self, name: str) -> Signal:
        try:
            return self._signals[name]
        except KeyError:
            raise MissingChannelError(name, tuple(self._signals), path=self.path) from None

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
        for part in signal.parts(start, stop):
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
        for part in signal.parts(start, stop):
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
            ticks = np.concatenate(list(signal.parts(0, pieces.count, stamps=True)))
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
