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

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

from recoil_acquisition.streams.oxygen_parts import PART, PacketShape, Part, SamplePlace, columns_of, part_of, shape_of
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

_HEAD, _INFO = struct.Struct("<8sI"), struct.Struct("<6I")
_INFO_SIZE = PART.size + _INFO.size
_LEAST_PACKET = _HEAD.size + _INFO_SIZE


@dataclass(frozen=True)
class PacketInfo:
    """Head of a packet: what it says of itself."""

    version: int
    stream: int
    sequence: int
    status: int
    seed: int
    parts: int


class TickSpan(NamedTuple):
    """Place and size of the samples of one channel in a packet, without their numbers.

    Attributes
    ----------
    channel, first_tick
        Place of the channel and tick of its first sample, as of `TickSamples`.
    samples
        Number of samples, at least 1.
    sample_bytes
        Size of one number as it was sent and is read, bytes.
    has_ticks
        Whether each sample has a tick of its own.
    """

    channel: int
    first_tick: int
    samples: int
    sample_bytes: int
    has_ticks: bool = False


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
        self._held: list[bytes] = []  # put together once all of a packet is there: a large one comes in many pieces
        self._held_bytes = self._due_bytes = 0
        self._in_step = self._is_wrong = False
        self._unsaid = ""
        self._shape: PacketShape | None = None

    def feed(self, data: bytes) -> list[TickItem]:
        """Return what the next bytes complete, in their order; nothing that they hold raises."""
        return self._taken(data, with_numbers=True)

    def follow(self, data: bytes) -> list[StreamDescription | TickSpan | StreamFault]:
        """Return what `feed` does, but of samples their places alone: no number is read."""
        return self._taken(data, with_numbers=False)

    def _taken(self, data: bytes, *, with_numbers: bool) -> list[Any]:
        self._held.append(data)
        self._held_bytes += len(data)
        items: list[Any] = []
        for packet in self._packets(items) if self._held_bytes >= self._due_bytes else ():
            found, parts = self._read(packet)
            items += found
            items += _samples(packet, parts) if with_numbers else _spans(parts)
        return items

    def skip(self) -> None:
        """Note that bytes are missing before the next: what is half there will not be completed."""
        self._hold(b"", 0)
        self._in_step, self.info = False, None
        self._stated = None  # what the stream said of itself may have been said anew since

    def describe(self, description: StreamDescription) -> None:
        """Take what a device said of the stream, where the stream did not say it to this decoder."""
        if self._stated is None:
            self.description, self._layout, self._unsaid, self._shape = description, (), "", None

    def _hold(self, rest: bytes, due_bytes: int) -> None:
        """Hold what no packet is yet until so many bytes are there."""
        self._held, self._held_bytes, self._due_bytes = [rest] if rest else [], len(rest), due_bytes

    def _packets(self, items: list[TickItem]) -> Iterator[memoryview]:
        """Yield the whole packets that are held, and say what is between them; hold the rest."""
        held = b"".join(self._held)
        at, due_bytes, view = 0, _LEAST_PACKET, memoryview(held)
        while len(held) - at >= _LEAST_PACKET:
            token, size = _HEAD.unpack_from(held, at)
            plausible = _LEAST_PACKET <= size <= LARGEST_PACKET
            if token == TOKEN and plausible and PART.unpack_from(held, at + _HEAD.size) == (_INFO_SIZE, 1):
                if len(held) - at < size:
                    due_bytes = size
                    break
                self._in_step = True
                yield view[at : at + size]
                at += size
                continue
            if self._in_step:
                self._in_step = False
                said = f"a packet of {size} bytes" if token == TOKEN else f"{held[at : at + 8]!r} where a packet begins"
                items.append(StreamFault(f"{said}: the stream is damaged", is_out_of_step=True))
            place = held.find(TOKEN, at + 1)
            at = len(held) - len(TOKEN) + 1 if place < 0 else place
        self._hold(held[at:], due_bytes)

    def _read(self, packet: memoryview) -> tuple[list[TickItem], Sequence[Part]]:
        """Take a packet apart: return what it says, and its samples where they can be taken for any."""
        if self._shape is not None and (alike := self._shape.parts_of(packet)) is not None:
            return self._taken_apart(self._take_info(packet[_HEAD.size + PART.size : _LEAST_PACKET]), alike)
        items: list[TickItem] = []
        parts: list[Part] = []
        heads: list[int] = []
        kinds: list[int] = []
        self._shape = None
        at = _HEAD.size
        while at < len(packet):
            if len(packet) - at < PART.size:
                return [*items, StreamFault(f"{len(packet) - at} bytes behind the last part of a packet")], ()
            size, kind = PART.unpack_from(packet, at)
            if not PART.size <= size <= len(packet) - at:
                return [*items, StreamFault(f"a part of {size} bytes where {len(packet) - at} are left")], ()
            part = packet[at + PART.size : at + size]
            heads.append(at)
            kinds.append(kind)
            if kind == 1:
                items += self._take_info(part)
            elif kind == 2:
                items += self._take_text(bytes(part))
            elif kind in (3, 4, 5, 6):
                try:
                    parts.append(part_of(packet, at + PART.size, at + size, kind))
                except ValueError as error:
                    parts.append(Part(Fraction(0), None))
                    items.append(StreamFault(f"part {len(parts)} of the samples: {error}"))
            elif kind != 7:
                items.append(StreamFault(f"a part of an unknown type {kind}"))
            at += size
        items, taken = self._taken_apart(items, parts)
        if taken and kinds.count(1) == 1 and 2 not in kinds and not any(isinstance(one, StreamFault) for one in items):
            self._shape = shape_of(packet, heads, parts)
        return items, taken

    def _taken_apart(self, items: list[TickItem], parts: Sequence[Part]) -> tuple[list[TickItem], Sequence[Part]]:
        """Return what a packet says, and its samples: none where it is wrong, or nothing is said of them."""
        self.packets += 1
        if self._is_wrong or not parts:
            return items, ()
        if self._unsaid:
            return [*items, StreamFault(self._unsaid, is_out_of_step=True)], ()
        if self._shape is not None:  # nothing was said since the last one, and it is as that
            return items, parts
        new, taken = self._described(parts)
        return items + new, taken

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

    def _described(self, parts: Sequence[Part]) -> tuple[list[TickItem], Sequence[Part]]:
        """Return a new description where there is one, and the samples of a packet if they are what is described."""
        layout = tuple(one.layout for one in parts)
        items: list[TickItem] = []
        if self._stated is not None:
            said = self._stated, self._start_utc_ns, layout
            if said != self._told_of or self.description is None:
                if len(parts) != len(self._stated):
                    return [_miscounted(len(parts), len(self._stated))], ()
                described = _described(self._stated, self._start_utc_ns, parts)
                if self._told_of and self._told_of[:2] == said[:2] and not _goes_with(parts, self._told_of[2]):
                    # the same text, and a part that cannot be read, or has no samples: nothing was described anew
                    return [StreamFault("a packet whose parts are laid out otherwise than those before it")], ()
                self._told_of = said
                if described != self.description:
                    self.description = described
                    items.append(described)
        elif self.description is not None and layout != self._layout:
            if (fault := _contradiction(parts, self.description)) is not None:
                return [fault], ()
            self._layout = layout
        return items, parts


def _places(parts: Sequence[Part]) -> Iterator[tuple[int, int, Part, SamplePlace]]:
    """Yield the channel, the column and the part of all samples of a packet."""
    channel = 0
    for part in parts:
        if (place := part.place) is None:
            continue
        for column in range(place.width if place.length else 0):
            yield channel + column, column, part, place
        channel += place.width


def _samples(packet: memoryview, parts: Sequence[Part]) -> Iterator[TickSamples]:
    """Yield the samples of a packet."""
    for channel, column, part, place in _places(parts):
        if not column:
            columns = columns_of(packet, place)
        yield TickSamples(channel, part.first_tick, columns[:, column], part.ticks)


def _spans(parts: Sequence[Part]) -> Iterator[TickSpan]:
    """Yield where the samples of a packet are."""
    for channel, _, part, place in _places(parts):
        yield TickSpan(channel, part.first_tick, place.length, place.number_bytes, part.ticks is not None)


def _miscounted(parts: int, channels: int) -> StreamFault:
    return StreamFault(f"a packet of {parts} channels, where {channels} are described: none of them is taken for any")


def _goes_with(parts: Sequence[Part], layout: tuple[Any, ...]) -> bool:
    """Return whether a change of the layout is one of rates or types, and not a part that could not be read."""
    return all(one.place is not None or not width for one, (_, width, _, _) in zip(parts, layout, strict=True))


def _contradiction(parts: Sequence[Part], description: StreamDescription) -> StreamFault | None:
    """Say how a packet differs from what a device said of the stream."""
    rates = [one.rate for one in parts if one.place is not None for _ in range(one.place.width)]
    if len(rates) != len(description.channels):
        return _miscounted(len(rates), len(description.channels))
    if any(rate != channel.tick_rate for rate, channel in zip(rates, description.channels, strict=True)):
        return StreamFault("a packet of other rates than are described")
    return None


def _described(stated: tuple[StatedChannel, ...], start_utc_ns: int | None, parts: Sequence[Part]) -> StreamDescription:
    """Put what the text says and how the samples come together."""
    channels: list[TickChannel] = []
    for one, part in zip(stated, parts, strict=True):
        if part.place is None:
            continue
        width, step = part.place.width, 0 if part.ticks is not None else 1
        for place in range(width):
            name, offset = one.name[:LONGEST_NAME], one.offset
            if part.is_complex:
                name = f"{name} {'imaginary' if place % 2 else 'real'}"
                offset = 0.0 if place % 2 else offset
            if width > 1 + part.is_complex:
                name = f"{name} [{place // (1 + part.is_complex)}]"
            channels.append(TickChannel(name, one.unit[:LONGEST_NAME], part.rate, step, one.factor, offset))
    return StreamDescription(tuple(channels), start_utc_ns)
