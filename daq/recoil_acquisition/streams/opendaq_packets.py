"""Packets in which the process that reads an openDAQ device hands on what it reads, and their decoder.

All numbers are little endian. A packet is a head of 24 bytes and a content:

====== ======= ==================================================================================================
bytes  type    meaning
====== ======= ==================================================================================================
0-3    text    ``oDaq``
4      u8      version of the format, 1
5      u8      kind: ``D`` description, ``S`` samples, ``F`` fault; of others, which tell how the process is, see
               `recoil_acquisition.devices.opendaq_process`; they are never recorded
6-7    u16     place of the channel in the description; 0 of what is no samples
8-11   u32     epoch: samples belong to the description of the same epoch
12-15  u32     bytes of the content, `LARGEST_CONTENT` at most
16-19  u32     CRC-32 of the content
20-23  u32     CRC-32 of bytes 0 to 19
====== ======= ==================================================================================================

Samples: i64 tick of the first, u32 their number, u8 their type (place in `VALUE_TYPES`), u8 whether each has a tick of
its own, two zero bytes; then these ticks (i64), if so; then the values. A description is what
`recoil_acquisition.streams.packed_description` makes of it. A fault is a line of UTF-8.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.errors import visible
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.streams.packed_description import description_of, packed_description
from recoil_acquisition.streams.tick_stream import StreamDescription, StreamFault, TickItem, TickSamples

DESCRIPTION, SAMPLES, FAULT = b"D", b"S", b"F"
RECORDED = (DESCRIPTION, SAMPLES, FAULT)
VALUE_TYPES = tuple(np.dtype(name) for name in ("i1", "u1", "<i2", "<u2", "<i4", "<u4", "<i8", "<u8", "<f4", "<f8"))
"""Types of values; the place of each is its number in a packet."""
LARGEST_CONTENT = 1 << 18
_TOKEN, _VERSION = b"oDaq", 1
_HEAD = struct.Struct("<4sBcHIIII")
_CRC_FROM = _HEAD.size - 4
_SAMPLES = struct.Struct("<qIBBH")
_TICK = np.dtype("<i8")


@dataclass(frozen=True)
class Packet:
    """One packet.

    Attributes
    ----------
    packed
        All its bytes.
    """

    kind: bytes
    channel: int
    epoch: int
    packed: bytes

    @property
    def content(self) -> bytes:
        """Its bytes behind the head."""
        return self.packed[_HEAD.size :]


def packet(kind: bytes, content: bytes = b"", *, epoch: int = 0, channel: int = 0) -> bytes:
    """Return the bytes of a packet; ValueError if the content is too long."""
    if len(content) > LARGEST_CONTENT:
        raise ValueError(f"the content has {len(content)} bytes, more than {LARGEST_CONTENT}")
    head = _HEAD.pack(_TOKEN, _VERSION, kind, channel, epoch, len(content), zlib.crc32(content), 0)[:_CRC_FROM]
    return head + zlib.crc32(head).to_bytes(4, "little") + content


def samples_packet(epoch: int, channel: int, ticks: Array, values: Array, *, own_ticks: bool) -> bytes:
    """Return samples that follow each other as a packet.

    Parameters
    ----------
    ticks : ndarray of int64, shape (n_samples,)
        Tick of each.
    values : ndarray, shape (n_samples,)
        Values, of one of `VALUE_TYPES`.
    own_ticks
        Whether the ticks go with them, beside the first.
    """
    number = VALUE_TYPES.index(values.dtype.newbyteorder("<"))
    content = _SAMPLES.pack(int(ticks[0]), len(values), number, own_ticks, 0)
    if own_ticks:
        content += ticks.astype(_TICK, copy=False).tobytes()
    return packet(SAMPLES, content + values.tobytes(), epoch=epoch, channel=channel)


def description_packet(epoch: int, described: StreamDescription) -> bytes:
    """Return a description as a packet."""
    return packet(DESCRIPTION, packed_description(described), epoch=epoch)


class PacketScan:
    """Whole packets out of bytes that are cut anywhere."""

    def __init__(self) -> None:
        self._held = b""
        self._begins, self._strange = True, 0

    def skip(self) -> None:
        """Note that bytes are missing before the next: what is half there is dropped."""
        self._held, self._begins, self._strange = b"", True, 0

    def feed(self, data: bytes) -> Iterator[Packet | StreamFault]:
        """Return the packets that some more bytes complete, and in one line each what is none.

        Before the first packet there may be the rest of one of which the beginning was not recorded: that is no fault.
        """
        held, at = self._held + data, 0
        while True:
            found = held.find(_TOKEN, at)
            if found < 0:
                found = max(at, len(held) - len(_TOKEN) + 1)
                self._strange += found - at
                at = found
                break
            self._strange += found - at
            at = found
            if len(held) - at < _HEAD.size:
                break
            _, version, kind, channel, epoch, size, crc, head_crc = _HEAD.unpack_from(held, at)
            ends = at + _HEAD.size + size
            good = version == _VERSION and size <= LARGEST_CONTENT
            good = good and head_crc == zlib.crc32(held[at : at + _CRC_FROM])
            if good and len(held) < ends:
                break
            packed = held[at:ends]
            if not good or crc != zlib.crc32(memoryview(packed)[_HEAD.size :]):
                self._strange += 1
                at += 1
                continue
            if self._strange and not (self._begins and self._strange <= _HEAD.size + LARGEST_CONTENT):
                yield StreamFault(f"{self._strange} bytes are no packet of an openDAQ stream")
            self._begins, self._strange = False, 0
            yield Packet(kind, channel, epoch, packed)
            at = ends
        self._held = held[at:]


class OpendaqDecoder:
    """Decoder of the packets of one stream, a `recoil_acquisition.streams.tick_stream.TickDecoder`."""

    def __init__(self) -> None:
        self._scan = PacketScan()
        self._described: StreamDescription | None = None
        self._epoch: int | None = None
        self._strange: int | None = None

    def feed(self, data: bytes) -> list[TickItem]:
        """Return what the next bytes complete, in their order; nothing that they hold raises."""
        made: list[TickItem] = []
        for one in self._scan.feed(data):
            if isinstance(one, StreamFault):
                made.append(one)
            elif one.kind == SAMPLES:
                made += self._samples(one)
            elif one.kind == DESCRIPTION:
                made.append(self._describe(one))
            elif one.kind == FAULT:
                made.append(StreamFault(visible(one.content.decode(errors="replace"))))
        return made

    def skip(self) -> None:
        """Note that bytes are missing before the next: what is half there will not be completed."""
        self._scan.skip()

    def describe(self, description: StreamDescription) -> None:
        """Take what a device said of the stream, for bytes that begin behind the stream's own description."""
        self._described, self._epoch = description, None

    def _describe(self, one: Packet) -> TickItem:
        try:
            self._described, self._epoch = description_of(one.content), one.epoch
        except ValueError as error:
            return StreamFault(f"a description cannot be read: {error}")
        return self._described

    def _samples(self, one: Packet) -> Iterator[TickItem]:
        if self._epoch is None:
            self._epoch = one.epoch
        if one.epoch != self._epoch:
            if one.epoch != self._strange:
                yield StreamFault("the description of some samples is missing: they are left out")
            self._strange = one.epoch
            return
        described = self._described
        if described is not None and one.channel >= len(described.channels):
            yield StreamFault(f"samples of channel {one.channel + 1} of {len(described.channels)}")
            return
        try:
            yield samples_of(one)
        except ValueError as error:
            yield StreamFault(f"samples of channel {one.channel + 1} cannot be read: {error}")


def samples_of(packet: Packet) -> TickSamples:
    """Return the samples of a packet of samples; ValueError if its content contradicts itself."""
    content = packet.content
    if len(content) < _SAMPLES.size:
        raise ValueError(f"{len(content)} bytes")
    first, count, number, own, _ = _SAMPLES.unpack_from(content)
    if number >= len(VALUE_TYPES) or own > 1 or not count:
        raise ValueError(f"{count} values of type {number}")
    kind, at = VALUE_TYPES[number], _SAMPLES.size
    if len(content) != at + count * (kind.itemsize + own * _TICK.itemsize):
        raise ValueError(f"{len(content)} bytes for {count} values of type {number}")
    ticks = None
    if own:
        ticks = np.frombuffer(content, _TICK, count, at)
        at += ticks.nbytes
        if ticks[0] != first or (np.diff(ticks) <= 0).any():
            raise ValueError("ticks that run backwards")
    return TickSamples(packet.channel, first, np.frombuffer(content, kind, count, at), ticks)
