"""Recordings of DEWETRON OXYGEN (.dmd), without DEWETRON's library.

The layout of blocks, texts and samples is described in `readers.oxygen.blocks`, `readers.oxygen.setup` and
`readers.oxygen.samples`. Read are synchronous and asynchronous channels of one number per sample, with linear
scalings. What else was stored (CAN, video, strings, vectors, complex numbers, other scalings) is named in the notes
and left out.

Blocks reach beyond what was asked to be stored; samples outside the storing windows are left out, as in OXYGEN.
"""

from __future__ import annotations

from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import CorruptFileError, FileEnd, ReadError, system_errors_as
from recoil_acquisition.readers.oxygen.blocks import BlockIndex, index_blocks
from recoil_acquisition.readers.oxygen.description import read_description
from recoil_acquisition.readers.oxygen.samples import INTEGERS, Pieces
from recoil_acquisition.readers.oxygen.signal import Signal, signal_of
from recoil_acquisition.readers.oxygen.storing import choose_windows
from recoil_acquisition.readers.reader import Declarations, SignalHeader
from recoil_acquisition.readers.recording import Recording, StoredChannel
from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.timebase import AbsoluteStart, TimeBase


class OxygenReader:
    """Reader of OXYGEN's recordings."""

    name = "DEWETRON OXYGEN recording"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a recording: its block index and its setup, no samples of synchronous channels.

        Raises
        ------
        ReadError
            If it holds no samples that can be read.
        CorruptFileError
            If it is damaged.
        """
        index = index_blocks(path)
        with system_errors_as(ReadError, path, "read"), path.open("rb") as file:
            return _recording(index, file, declared.clock)


def _recording(index: BlockIndex, file: BinaryIO, clock: str) -> Recording:
    """Return the recording of a file that is open; its samples are read block by block when they are asked for."""
    description = read_description(index, file)
    setup, start = description.setup, description.start
    notes = list(index.notes)
    if start is None:
        notes.append("the start of the acquisition is not stated: times count from an unknown instant")
    windows, window_notes = choose_windows(description.events, is_finished=not index.incomplete)
    names, repeated_names = unique_names([channel.name for channel in setup.channels])
    notes += [*window_notes, *repeated_names]
    channels: list[StoredChannel] = []
    shared = Counter(channel.segment for channel in setup.channels)
    for name, channel in zip(names, setup.channels, strict=True):
        is_shared = shared[channel.segment] > 1
        signal = signal_of(name, channel, index, description.segments, windows, file, notes, is_shared=is_shared)
        if isinstance(signal, str):
            notes.append(f"{name}: left out: {signal}")
        else:
            header = SignalHeader(
                name, channel.unit, signal.pieces.count, metadata={"sample_format": channel.sample_format}
            )
            instants = partial(_instants, signal, name, index.path, clock, start)
            channels.append(StoredChannel(header, instants, partial(_samples, signal), partial(_raw, signal)))
    if not channels:
        raise ReadError(
            "there are no samples that can be read", path=index.path,
            found="; ".join(notes) or "no stored channels", remedy="export it from OXYGEN as text or HDF5",
            file_end=FileEnd.MISSING if index.incomplete else FileEnd.THERE,
        )  # fmt: skip
    metadata: dict[str, Any] = {
        "library": index.library,
        "format_version": index.version,
        **setup.properties,
        "storing_windows_s": [[None if t is None else float(t) for t in window] for window in windows],
        "not_stored": list(setup.not_stored),
    }
    return Recording(
        index.path, OxygenReader.name, channels, metadata=metadata, notes=notes, incomplete=index.incomplete,
        absolute_start=start,
    )  # fmt: skip


def _filled(signal: Signal, stored: NDArray[Any], start: int) -> NDArray[Any]:
    """Fill an array with the stored numbers from one sample on; only their blocks are touched."""
    at = 0
    for part in signal.parts(start, start + stored.size):
        stored[at : at + part.size] = part
        at += part.size
    return stored


def _samples(signal: Signal, start: int, stop: int) -> NDArray[np.float64]:
    samples: NDArray[np.float64] = _filled(signal, np.empty(stop - start), start)
    if (signal.setup.gain, signal.setup.offset) != (1.0, 0.0):
        samples *= signal.setup.gain
        samples += signal.setup.offset
    return samples


def _raw(signal: Signal, start: int, stop: int) -> RawCounts | None:
    dtype = INTEGERS.get(signal.setup.sample_format)
    if dtype is None:
        return None
    counts = _filled(signal, np.empty(stop - start, dtype), start)
    return RawCounts(counts, signal.setup.gain, signal.setup.offset, signal.setup.unit)


def _instants(signal: Signal, name: str, path: Path, clock: str, start: AbsoluteStart | None) -> TimeBase:
    """Return the instants in seconds after the acquisition's start.

    Uniform where nothing is missing between the first and the last sample, stamped elsewhere.
    """
    pieces, frequency_hz = signal.pieces, signal.setup.frequency_hz
    try:
        if isinstance(pieces, Pieces) and signal.is_gapless:
            start_s, step_s = int(pieces.tick[0]) / frequency_hz, 1.0 / frequency_hz
            return TimeBase(clock, start_s, step_s, pieces.count, None, start)
        if isinstance(pieces, Pieces):
            lengths = pieces.high - pieces.low
            ticks = np.repeat(pieces.tick - pieces.ends + lengths, lengths) + np.arange(pieces.count)
        else:
            ticks = np.concatenate(list(signal.parts(0, pieces.count, stamps=True)))
        return TimeBase.stamped(clock, ticks / frequency_hz, start)
    except ValueError as error:
        raise CorruptFileError(f"the times of {name} cannot be distinguished: {error}", path=path) from error
