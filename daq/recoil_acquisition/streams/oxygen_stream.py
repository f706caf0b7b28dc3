"""The data stream of an OXYGEN recorder (DST, version 1.5): packets, their parts, and the samples in them.

Layout, little-endian, as DEWETRON's own clients read it (pyOxygenStream, MIT; the parser for LabVIEW, MIT). The
document of the protocol was not found, and no real recorder was met.

====== ======================================================================================================
part   content
====== ======================================================================================================
packet token ``OXYGEN<<``, u32 size of the whole packet, then parts of u32 size, with these eight bytes, u32 type
1      version, stream, sequence number, status, seed, number of parts: six u32
2      text, `recoil_acquisition.streams.oxygen_text`
3      type of the numbers, dimension, number of samples: three u32; u64 tick of the first, f64 ticks per second;
       numbers
5      type, dimension, number of samples: three u32; f64 ticks per second; with each sample, before it, its tick, u64
4, 6   samples of variable size: nobody decodes them, they keep their place
7      end of the packet
====== ======================================================================================================

The parts of samples stand for the channels in their order: a part that cannot be read keeps its place, and where their
number is not that of the channels, none is taken for any.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.streams.oxygen_text import StatedChannel, read_text
from recoil_acquisition.streams.tick_stream import (
    StreamDescription,
    StreamFault,
    TickChannel,
    TickItem,
    TickSamples,
)

TOKEN = b"OXYGEN<<"
LARGEST_PACKET = 64 << 20
"""Bytes; a packet that says more is damaged: one of 64 channels of 1 MHz holds 26 MB in 100 ms."""
FIRST, LAST, ERROR = 0x1, 0x2, 0x10000000
"""Bits of a packet's status."""
LONGEST_NAME = 512

_HEAD, _PART, _INFO = struct.Struct("<8sI"), struct.Struct("<2I"), struct.Struct("<6I")
_SYNC, _ASYNC = struct.Struct("<3IQd"), struct.Struct("<3Id")
_INFO_SIZE = _PART.size + _INFO.size
_LEAST_PACKET = _HEAD.size + _INFO_SIZE
_LEAST_RATE_HZ, _MOST_RATE_HZ = 1e-6, 1e10
_MOST_TICK = 1 << 62
_NUMBERS = {
    0: "<i1", 1: "<u1", 2: "<i2", 3: "<u2", 4: "i24", 5: "u24", 6: "<i4", 7: "<u4", 8: "<i8", 9: "<u8", 10: "<f4",
    11: "<f8", 12: "<f4 complex", 13: "<f8 complex",
}  # fmt: skip
"""Types of numbers; 14 to 16 are texts, bytes and frames of a bus."""


@dataclass(frozen=True)
class PacketInfo:
    """Head of a packet: what it says of itself."""

    version: int
    stream: int
    sequence: int
    status: int
    seed: int
    parts: int


@dataclass(frozen=True)
class _Part:
    """Samples of one channel in a packet, a column for each of its components; none where it cannot be read."""

    rate: Fraction
    columns: NDArray[Any] | None
    is_complex: bool = False
    first_tick: int = 0
    ticks: NDArray[np.int64] | None = None

    @property
    def layout(self) -> tuple[Fraction, int, bool, bool]:
        width = 0 if self.columns is None else self.columns.shape[1]
        return self.rate, width, self.is_complex, self.ticks is not None


class OxygenDecoder:
    """Decoder of the stream.

    It begins with whatever comes first: bytes in front of the first packet, as the welcome is, belong to none. Behind a
    packet the next one begins, or something is wrong.

    Attributes
    ----------
    packets, lost_packets
        Numbers of packets that were read, and that are missing by their sequence numbers.
    info
        Head of the last packet; None before the first.
    description
        Description that is in force; None before there is one.
    """

    def __init__(self) -> None:
        self.packets = self.lost_packets = 0
        self.info: PacketInfo | None = None
        self.description: StreamDescription | None = None
        self._stated: tuple[StatedChannel, ...] | None = None
        self._start_utc_ns: int | None = None
        self._layout: tuple[Any, ...] = ()
        self._told_of: tuple[Any, ...] = ()
        self._held = bytearray()
        self._in_step = self._is_wrong = False
        self._unsaid = ""

    def feed(self, data: bytes) -> list[TickItem]:
        """Return what the next bytes complete, in their order; nothing that they hold raises."""
        self._held += data
        items: list[TickItem] = []
        while (packet := self._next(items)) is not None:
            items += self._read(packet)
        return items

    def skip(self) -> None:
        """Note that bytes are missing before the next: what is half there will not be completed."""
        self._held.clear()
        self._in_step, self.info = False, None
        self._stated = None  # what the stream said of itself may have been said anew since

    def describe(self, description: StreamDescription) -> None:
        """Take what a device said of the stream, where the stream did not say it to this decoder."""
        if self._stated is None:
            self.description, self._layout, self._unsaid = description, (), ""

    def _next(self, items: list[TickItem]) -> bytes | None:
        """Return the next whole packet; None where it is not there yet."""
        held = self._held
        while len(held) >= _LEAST_PACKET:
            token, size = _HEAD.unpack_from(held)
            plausible = _LEAST_PACKET <= size <= LARGEST_PACKET
            begins = token == TOKEN and plausible and _PART.unpack_from(held, _HEAD.size) == (_INFO_SIZE, 1)
            if begins:
                if len(held) < size:
                    return None
                with memoryview(held) as whole:
                    packet = bytes(whole[:size])
                del held[:size]
                self._in_step = True
                return packet
            if self._in_step:
                self._in_step = False
                said = f"a packet of {size} bytes" if token == TOKEN else f"{bytes(held[:8])!r} where a packet begins"
                items.append(StreamFault(f"{said}: the stream is damaged", is_out_of_step=True))
            place = held.find(TOKEN, 1)
            del held[: len(held) - len(TOKEN) + 1 if place < 0 else place]
        return None

    def _read(self, packet: bytes) -> list[TickItem]:
        """Take a packet apart."""
        items: list[TickItem] = []
        parts: list[_Part] = []
        self._is_wrong = False
        at, view = _HEAD.size, memoryview(packet)
        while at < len(packet):
            if len(packet) - at < _PART.size:
                return [*items, StreamFault(f"{len(packet) - at} bytes behind the last part of a packet")]
            size, kind = _PART.unpack_from(packet, at)
            if not _PART.size <= size <= len(packet) - at:
                return [*items, StreamFault(f"a part of {size} bytes where {len(packet) - at} are left")]
            part = view[at + _PART.size : at + size]
            if kind == 1:
                items += self._take_info(part)
            elif kind == 2:
                items += self._take_text(bytes(part))
            elif kind in (3, 4, 5, 6):
                try:
                    parts.append(_part_of(packet, at + _PART.size, at + size, kind))
                except ValueError as error:
                    parts.append(_Part(Fraction(0), None))
                    items.append(StreamFault(f"part {len(parts)} of the samples: {error}"))
            elif kind != 7:
                items.append(StreamFault(f"a part of an unknown type {kind}"))
            at += size
        self.packets += 1
        if self._is_wrong or not parts:
            return items
        return items + ([StreamFault(self._unsaid, is_out_of_step=True)] if self._unsaid else self._samples(parts))

    def _take_info(self, part: memoryview) -> list[TickItem]:
        if len(part) < _INFO.size:
            return [StreamFault("a packet that says too little of itself")]
        info, before = PacketInfo(*_INFO.unpack_from(part)), self.info
        self.info = info
        if before is not None and before.seed != info.seed:
            self._forget(f"another configuration (seed {info.seed}), of which nothing is said")
        elif before is not None:
            missing = (info.sequence - before.sequence - 1) & 0xFFFFFFFF
            if missing < 1 << 31:  # else it came late, or twice
                self.lost_packets += missing
            else:
                self.info = before if not info.status & LAST else info
        self._is_wrong = bool(info.status & ERROR)
        said = f"the recorder says that packet {info.sequence} is wrong (status {info.status:#x}): left out"
        return [StreamFault(said)] if self._is_wrong else []

    def _forget(self, problem: str) -> None:
        """Take no sample for what the stream said before: neither scalings nor the order of its channels hold."""
        self._stated, self.description, self._start_utc_ns = None, None, None
        self._unsaid = f"{problem}: left out"

    def _take_text(self, content: bytes) -> list[TickItem]:
        try:
            text = read_text(content)
        except ValueError as error:
            problem = " ".join(str(error).split())[:200]
            self._forget(f"channels that cannot be read ({problem})")
            return [StreamFault(problem)]
        if text.channels is not None:
            self._stated, self._unsaid = text.channels, ""
        elif text.start_utc_ns is not None:
            self._start_utc_ns = text.start_utc_ns
        return []

    def _samples(self, parts: list[_Part]) -> list[TickItem]:
        """Return the samples of a packet, behind a new description where there is one."""
        layout = tuple(one.layout for one in parts)
        items: list[TickItem] = []
        if self._stated is not None:
            said = self._stated, self._start_utc_ns, layout
            if said != self._told_of or self.description is None:
                if len(parts) != len(self._stated):
                    return [_miscounted(len(parts), len(self._stated))]
                described = _described(self._stated, self._start_utc_ns, parts)
                if self._told_of and self._told_of[:2] == said[:2] and not _goes_with(parts, self._told_of[2]):
                    # the same text, and a part that cannot be read, or has no samples: nothing was described anew
                    return [StreamFault("a packet whose parts are laid out otherwise than those before it")]
                self._told_of = said
                if described != self.description:
                    self.description = described
                    items.append(described)
        elif self.description is not None and layout != self._layout:
            if (fault := _contradiction(parts, self.description)) is not None:
                return [fault]
            self._layout = layout
        place = 0
        for one in parts:
            if one.columns is None:
                continue
            for column in one.columns.T:
                if column.size:
                    items.append(TickSamples(place, one.first_tick, column, one.ticks))
                place += 1
        return items


def _miscounted(parts: int, channels: int) -> StreamFault:
    return StreamFault(f"a packet of {parts} channels, where {channels} are described: none of them is taken for any")


def _goes_with(parts: list[_Part], layout: tuple[Any, ...]) -> bool:
    """Return whether a change of the layout is one of rates or types, and not a part that could not be read."""
    return all(one.columns is not None or not width for one, (_, width, _, _) in zip(parts, layout, strict=True))


def _contradiction(parts: list[_Part], description: StreamDescription) -> StreamFault | None:
    """Say how a packet differs from what a device said of the stream."""
    rates = [one.rate for one in parts if one.columns is not None for _ in one.columns.T]
    if len(rates) != len(description.channels):
        return _miscounted(len(rates), len(description.channels))
    if any(rate != channel.tick_rate for rate, channel in zip(rates, description.channels, strict=True)):
        return StreamFault("a packet of other rates than are described")
    return None


def _described(stated: tuple[StatedChannel, ...], start_utc_ns: int | None, parts: list[_Part]) -> StreamDescription:
    """Put what the text says and how the samples come together."""
    channels: list[TickChannel] = []
    for one, part in zip(stated, parts, strict=True):
        if part.columns is None:
            continue
        width, step = part.columns.shape[1], 0 if part.ticks is not None else 1
        for place in range(width):
            name, offset = one.name[:LONGEST_NAME], one.offset
            if part.is_complex:
                name = f"{name} {'imaginary' if place % 2 else 'real'}"
                offset = 0.0 if place % 2 else offset
            if width > 1 + part.is_complex:
                name = f"{name} [{place // (1 + part.is_complex)}]"
            channels.append(TickChannel(name, one.unit[:LONGEST_NAME], part.rate, step, one.factor, offset))
    return StreamDescription(tuple(channels), start_utc_ns)


def _part_of(packet: bytes, begins: int, ends: int, kind: int) -> _Part:
    """Read the samples of one channel; ValueError if they are not what their head says.

    Parameters
    ----------
    begins, ends
        Place of the part behind its own size and type.
    """
    if kind in (4, 6):
        raise ValueError(f"type {kind}, samples of variable size, which nobody decodes")
    head = _SYNC if kind == 3 else _ASYNC
    if ends - begins < head.size:
        raise ValueError(f"{ends - begins} bytes, too few for their head")
    code, dimension, count, *first, rate_hz = head.unpack_from(packet, begins)
    if not (math.isfinite(rate_hz) and _LEAST_RATE_HZ <= rate_hz <= _MOST_RATE_HZ):
        raise ValueError(f"{rate_hz:g} ticks per second")
    if code not in _NUMBERS:
        raise ValueError(f"numbers of type {code}, which is no number")
    if not 1 <= dimension <= 4096:
        raise ValueError(f"{dimension} numbers a sample")
    form, _, is_complex = _NUMBERS[code].partition(" ")
    width = dimension * (2 if is_complex else 1)
    size = 3 if form.endswith("24") else np.dtype(form).itemsize
    ahead = 0 if kind == 3 else 8
    row = ahead + width * size
    at = begins + head.size
    if count * row != ends - at:
        raise ValueError(f"{ends - at} bytes, where {count} samples have {count * row}")
    columns = _columns(packet, at + ahead, count, width, row, form)
    rate = _exactly(rate_hz)
    if kind == 3:
        if first[0] >= _MOST_TICK:
            raise ValueError(f"tick {first[0]}")
        return _Part(rate, columns, bool(is_complex), first[0])
    ticks = np.ndarray((count,), "<u8", packet, at, (row,)) if count else np.zeros(0, "<u8")
    if count and int(ticks.max()) >= _MOST_TICK:
        raise ValueError(f"tick {int(ticks.max())}")
    return _Part(rate, columns, bool(is_complex), int(ticks[0]) if count else 0, ticks.astype(np.int64))


@lru_cache
def _exactly(rate_hz: float) -> Fraction:
    """Return a rate exactly, the same object for the same rate: comparing two of them costs nothing then."""
    return Fraction(rate_hz)


def _columns(packet: bytes, at: int, count: int, width: int, row: int, form: str) -> NDArray[Any]:
    """Return numbers of some bytes, shape (count, width), where a row of them begins each so many bytes.

    A number of three bytes is read as one of four that begins a byte before it, and shifted down.
    """
    if not count:
        return np.zeros((0, width), "<i4" if form.endswith("24") else form)
    if form.endswith("24"):
        wide = np.ndarray((count, width), "<i4" if form == "i24" else "<u4", packet, at - 1, (row, 3))
        return np.asarray(wide >> 8)
    return np.ndarray((count, width), form, packet, at, (row, np.dtype(form).itemsize))
