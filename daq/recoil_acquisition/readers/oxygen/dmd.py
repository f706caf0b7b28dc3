"""Recordings of DEWETRON OXYGEN (.dmd), without DEWETRON's library.

The layout of blocks, texts and samples is described in `recoil_acquisition.readers.oxygen.blocks`,
`recoil_acquisition.readers.oxygen.setup` and `recoil_acquisition.readers.oxygen.samples`. Read are synchronous and
asynchronous channels of one number per sample, with linear scalings. What else was stored (CAN, video, strings,
vectors, complex numbers, other scalings) is named in the notes and left out.

Blocks reach beyond what was asked to be stored; samples outside the storing windows are left out, as in OXYGEN. Of
texts that each say all of a thing (segments, setup, final events) the last one holds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import CorruptFileError, FileEnd, ReadError, system_errors_as
from recoil_acquisition.readers.oxygen.blocks import BlockIndex, index_blocks, local, read_xml
from recoil_acquisition.readers.oxygen.samples import INTEGERS, Pieces, Signal, signal_of
from recoil_acquisition.readers.oxygen.setup import (
    ChannelSetup,
    Event,
    SegmentSetup,
    Setup,
    choose_windows,
    read_events,
    read_segments,
    read_setup,
    read_start,
)
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.statements import Statements
from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.remark import Note, NoteCode

_OF_INPUT = frozenset({"Scaling", "Unit", "Range", "InputOffset"})
"""Properties that are of the amplifier's input, or that made the samples."""
_SETUPS = "oxy_config"
_WHOLE_TEXTS = (_SETUPS, "oxy_event")
"""Segments of which the last text says everything; those of ``oxy_event_recovery`` add to each other."""


@dataclass(frozen=True, eq=False)
class Description:
    """Description of a file by its texts.

    Attributes
    ----------
    setup
        Last setup of the file.
    start
        Start of the acquisition; None if none is stated.
    """

    segments: Mapping[int, SegmentSetup]
    setup: Setup
    events: list[Event]
    start: AbsoluteStart | None


def read_description(index: BlockIndex, file: BinaryIO) -> Description:
    """Read the last description of the segments, the last setup, and all events.

    Raises
    ------
    CorruptFileError
        If the setup is missing, or a text is damaged.
    ReadError
        If setups state several starts.
    """
    path = index.path
    try:
        segments = read_segments(read_xml(path, file, index.configs[-1])) if index.configs else {}
        setup: Setup | None = None
        final: list[Event] | None = None
        recovery: set[Event] = set()
        starts: list[AbsoluteStart | None] = []
        latest = {block.segment: block for block in index.texts}
        for block in index.texts:
            name = segments[block.segment].name if block.segment in segments else ""
            if name in _WHOLE_TEXTS and block is not latest[block.segment]:
                if name == _SETUPS:
                    starts.append(read_start(read_setup(read_xml(path, file, block)).properties))
                continue  # a later one says all of this again, but for another start
            text = read_xml(path, file, block)
            kind = local(text)
            if kind == "MeasurementConfig":
                setup = read_setup(text)
            elif kind == "Events" and name == "oxy_event":
                final = list(read_events(text))
            elif kind == "Events":
                recovery.update(read_events(text))
        if setup is None:
            raise CorruptFileError(
                "the setup of the measurement is missing", path=path, expected="MeasurementConfig",
                found=index.incomplete or "none",
            )  # fmt: skip
        start = read_start(setup.properties)
        _check_one_start(index, [*starts, start])
    except (ValueError, KeyError, OverflowError) as error:
        raise CorruptFileError(f"the setup is damaged: {error}", path=path) from error
    return Description(segments, setup, sorted(recovery) if final is None else final, start)


def _check_one_start(index: BlockIndex, starts: list[AbsoluteStart | None]) -> None:
    """Refuse a file whose setups state several starts: of the ticks of which one counts is not known."""
    stated = list(dict.fromkeys(start for start in starts if start is not None))
    if len(stated) > 1:
        raise ReadError(
            f"a second recording begins at {stated[1].text}", path=index.path,
            expected=f"one acquisition, that of {stated[0].text}", found=f"{len(stated)} in its setups",
            remedy="export each from OXYGEN as a file of its own",
        )  # fmt: skip


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
        text = "the start of the acquisition is not stated: times count from an unknown instant"
        notes.append(Note(NoteCode.TIME, None, text))
    windows, window_notes = choose_windows(description.events, is_finished=not index.incomplete)
    names, repeated_names = unique_names([channel.name for channel in setup.channels])
    notes += [*window_notes, *repeated_names]
    channels: list[StoredChannel] = []
    shared = Counter(channel.segment for channel in setup.channels)
    for name, channel in zip(names, setup.channels, strict=True):
        is_shared = shared[channel.segment] > 1
        signal = signal_of(name, channel, index, description.segments, windows, file, notes, is_shared=is_shared)
        if isinstance(signal, str):
            notes.append(Note(NoteCode.LEFT_OUT, name, f"{name}: left out: {signal}"))
        else:
            header = SignalHeader(
                name, channel.unit, signal.pieces.count, metadata={"sample_format": channel.sample_format}
            )
            instants = partial(_instants, signal, name, index.path, clock, start)
            channels.append(
                StoredChannel(
                    header, instants, partial(_samples, signal), partial(_raw, signal), beside=_beside(channel)
                )
            )
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


def _beside(channel: ChannelSetup) -> Statements:
    """Return the properties of a channel: those of OXYGEN itself are in its chain of scalings, or of its input."""
    own = [name for name in channel.said if "/" in name or name in _OF_INPUT]
    return Statements(channel.said, own)


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
