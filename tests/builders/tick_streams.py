"""A stream of samples by tick in a form of its own, for what is alike in all such streams.

A piece is a channel, a first tick, a count, and as many float32 or int32.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.capture.live_source import LiveChannel
from recoil_acquisition.devices.described import described_events
from recoil_acquisition.devices.device import STREAM, Block
from recoil_acquisition.log.record import Kind, Record
from recoil_acquisition.readers.captured import CapturedSource
from recoil_acquisition.streams.tick_stream import StreamDescription, TickChannel, TickItem, TickSamples

HEAD = struct.Struct("<BBqI")
RATE_HZ = 1000
CHANNELS = (
    TickChannel("p", "MPa", Fraction(RATE_HZ), 1, 0.5, -1.0),
    TickChannel("a", "m/s2", Fraction(5 * RATE_HZ), 5),
)
DESCRIPTION = StreamDescription(CHANNELS, 1_700_000_000_123_456_789, "PTP")


class PieceDecoder:
    """Decoder of pieces, which may be cut anywhere."""

    def __init__(self) -> None:
        self._held = b""

    def feed(self, data: bytes) -> list[TickItem]:
        self._held += data
        found: list[TickItem] = []
        while len(self._held) >= HEAD.size:
            channel, form, first, count = HEAD.unpack_from(self._held)
            ends = HEAD.size + 4 * count
            if len(self._held) < ends:
                break
            raw = np.frombuffer(self._held[HEAD.size : ends], "<i4" if form else "<f4")
            found.append(TickSamples(channel, first, raw))
            self._held = self._held[ends:]
        return found

    def skip(self) -> None:
        self._held = b""

    def describe(self, description: StreamDescription) -> None:
        del description


def piece(
    channel: int, first_tick: int, values: Sequence[float] | np.ndarray[Any, Any], *, whole: bool = False
) -> bytes:
    raw = np.asarray(values, "<i4" if whole else "<f4")
    return HEAD.pack(channel, whole, first_tick, raw.size) + raw.tobytes()


def said(host_ns: int, description: StreamDescription = DESCRIPTION) -> list[Block]:
    return list(described_events("daq", host_ns, description))


def data(host_ns: int, *pieces: bytes) -> Block:
    return Block("daq", host_ns, b"".join(pieces), STREAM)


def captured(blocks: Sequence[Block]) -> CapturedSource:
    kinds = {"event": Kind.EVENT, STREAM: Kind.STREAM}
    records = tuple(
        Record(number, 0, kinds[one.kind], one.host_ns, one.payload, 0, 0, number, 0)
        for number, one in enumerate(blocks)
    )
    return CapturedSource("daq", "dewetron", "oxygen", records, None, "")


def live(name: str, signal: str, factor: float = 1.0) -> LiveChannel:
    return LiveChannel(name, signal, factor, 0.0, "Pa")


PATH = Path("0001.rdlog")
