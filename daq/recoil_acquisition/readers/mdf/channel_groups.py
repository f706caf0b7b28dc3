"""The channel groups of an MDF 4 file, as its blocks describe them, and which of their channels are measured numbers.

The blocks are chains of links: one that comes back to itself would never end, and is refused. asammdf reads the groups
of buses as soon as it opens a file, outside of Python, and trusts where a channel lies in a record and how many records
there are: both are held against the record and the file here.

Layout: ASAM MDF 4.1, as published in asammdf's documentation and in the *MDF4 programming specification*:
identification 64 bytes; each block begins with its id, 4 bytes, 4 empty ones, its length, its number of links, of
8 bytes each, and the links; HD -> DG -> CG -> CN. Names, units and comments are TX blocks, a text, or MD blocks, XML,
most of them one element ``TX`` and nothing else; both end with a zero byte.
"""

from __future__ import annotations

import html
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from recoil_acquisition.readers.bounded_file import DEFLATE_RATIO

MOST_BYTES = 1 << 16

_ONE_TEXT = re.compile(r"\s*<(\w+)[^>]*>\s*<TX[^>]*>([^<]*)</TX>\s*</\1>\s*")

BUS_NAMES = (
    "CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame", "CAN_OverloadFrame", "LIN_Frame", "LIN_WakeUp",
    "LIN_ChecksumError", "LIN_TransmissionError", "LIN_SyncError", "LIN_ReceiveError", "LIN_Spike", "LIN_LongDom",
    "FLX_Frame", "FLX_Pdu", "ETH_Frame", "MOST_Message", "MOST_Packet",
)  # fmt: skip
"""Beginnings of the channel names that ASAM's bus logging standard fixes."""
BUS_EVENT = 0x0002
"""Flag of a channel group that holds frames of a bus."""
VARIABLE_LENGTH = 0x0001
"""Flag of a channel group whose records have each a length of their own."""
ALL_INVALID, INVALIDATION = 0x0001, 0x0002
"""Flags of a channel: none of its samples is valid; a bit of each record says whether its sample is."""
MASTERS = (2, 3)
"""Types of channels that are times: stored, and computed from the number of the record."""
HD_AT = 64
MOST_BLOCKS = 500_000
_DATA_GROUP = struct.Struct("<B")
_GROUP = struct.Struct("<QQH6xII")
_CHANNEL = struct.Struct("<BBBBIIII")
_PACKED = struct.Struct("<8xQQ")
_LONGEST_NAME = 4096
INTEGERS, FLOATS = (0, 1, 2, 3), (4, 5)
"""Data types of numbers, of either byte order."""
UNSIGNED = (0, 1)
UNKNOWN = -1
"""Kind, or data type, that MDF 4 has none for: channels of older files are described as its own."""
DATA_TYPES = {UNKNOWN: "a float of VAX computers, or of no known data type", 6: "text", 7: "text", 8: "text", 9: "text",
              10: "bytes", 11: "a sample of MIME type", 12: "a stream", 13: "a date", 14: "a time", 15: "complex",
              16: "complex"}  # fmt: skip
FIXED_LENGTH = 0
CHANNEL_TYPES = {UNKNOWN: "of no known channel type", 1: "values of variable length", 4: "synchronised media",
                 5: "values of variable length", 6: "a virtual channel"}  # fmt: skip


def text_of(content: bytes, at: int, most: int = MOST_BYTES) -> str:
    """Return the text at an address, without the XML around it where it is one text; empty if there is none.

    Parameters
    ----------
    most
        Bytes of its block that are looked at.
    """
    if not at or content[at : at + 4] not in (b"##TX", b"##MD") or at + 24 > len(content):
        return ""
    (length,) = struct.unpack_from("<Q", content, at + 8)
    text = content[at + 24 : at + min(length, most)].split(b"\0")[0].decode("utf-8", "replace")
    only = _ONE_TEXT.fullmatch(text)
    return html.unescape(only[2]) if only else text


class MdfDamageError(ValueError):
    """Blocks that do not hang together, or do not fit into the file."""


class MdfCutError(MdfDamageError):
    """Blocks that lie beyond the end of the file."""


class MdfUnsupportedError(ValueError):
    """Blocks that a sound file may have, and that are not read here."""


@dataclass(frozen=True)
class MdfChannel:
    """A channel by its CN block.

    Attributes
    ----------
    at
        Address of the block.
    kind, sync, data_type
        Type of channel, of what it synchronises over, and of its data, as numbered by the standard.
    bit, byte, bits
        First bit, in the first byte of a record, and number of bits.
    flags, invalid_at
        Flags of the channel, and, where a flag says that there is one, the bit of the invalidation bytes that says that
        a sample is not valid.
    conversion_at, data_at, unit_at, comment_at
        Addresses of its conversion, of its samples of variable length and of texts, or 0.
    is_composed
        Whether it is a structure or an array.
    """

    at: int
    name: str
    kind: int
    sync: int
    data_type: int
    bit: int
    byte: int
    bits: int
    flags: int
    invalid_at: int
    conversion_at: int
    data_at: int
    unit_at: int = 0
    comment_at: int = 0
    is_composed: bool = False


@dataclass(frozen=True)
class DataGroup:
    """Channel groups whose records are stored together.

    Attributes
    ----------
    at, data_at
        Addresses of the block and of its records.
    id_bytes
        Size of the number before each record that says of which group it is; 0 if there is one group alone.
    unpacked
        Bytes that its packed blocks state that they unpack to, as far as they can; 0 of the head of a file.
    size
        Bytes of its records, where no block states them.
    """

    at: int
    data_at: int
    id_bytes: int
    unpacked: int = 0
    size: int = 0


@dataclass(frozen=True)
class ChannelGroup:
    """Records of one kind by their CG block.

    Attributes
    ----------
    at
        Address of the block.
    stored
        Data group that the records are in.
    width, invalidation_width
        Bytes of a record, and of its invalidation bits behind them.
    channels
        Channels of the group, each structure followed by its parts.
    channel_count
        Channels beside the time, parts of structures not counted.
    name_at
        Address of its name, or 0.
    source_at
        Address of the block on where its records came from, or 0.
    """

    at: int
    stored: DataGroup
    record_id: int
    count: int
    flags: int
    width: int
    invalidation_width: int
    channels: tuple[MdfChannel, ...]
    channel_count: int
    name_at: int = 0
    source_at: int = 0

    @property
    def is_bus(self) -> bool:
        """Return whether the samples are events of a bus."""
        return bool(self.flags & BUS_EVENT) or any(one.name.startswith(BUS_NAMES) for one in self.channels)

    @property
    def stated_bytes(self) -> int:
        """Return what all records take; a group of variable length has both halves of its size in its widths."""
        if self.flags & VARIABLE_LENGTH:
            return self.width | self.invalidation_width << 32
        return self.count * (self.width + self.invalidation_width)

    def misfit(self) -> str:
        """Say which channel is not within a record; empty if all are."""
        for one in self.channels:
            if 8 * one.byte + one.bit + one.bits > 8 * self.width:
                return f"the channel {one.name} has {one.bits} bits from byte {one.byte} of {self.width} in a record"
            if one.flags & INVALIDATION and one.invalid_at >= 8 * self.invalidation_width:
                return f"the channel {one.name} has its invalidation bit beyond the record"
        return ""


def iter_groups(data: Any, *, strict: bool = True) -> Iterator[ChannelGroup]:
    """Walk the channel groups of a file.

    Parameters
    ----------
    data
        Bytes of a whole file, or of its head.
    strict
        Whether the data are all of a file: a chain that leaves them is an error then, and groups of a bus are checked;
        of a head it is the end of what can be read.

    Raises
    ------
    MdfDamageError
        With `strict`, if a chain leaves the data, comes back to itself, or has another block than it must; or if a
        group of a bus states more records than the file can hold, or a channel beyond them.
    """
    walk = _Walk(data, whole=strict)
    try:
        for at in walk.chain(walk.links(HD_AT, b"##HD")[0], b"##DG"):
            links = walk.links(at, b"##DG")
            (id_bytes,) = walk.fields(at, len(links), _DATA_GROUP)
            before = walk.unpacked
            if strict:
                walk.follow_data(links[2])
            stored = DataGroup(at, links[2], id_bytes, walk.unpacked - before)
            for group_at in walk.chain(links[1], b"##CG"):
                group = walk.group(group_at, stored)
                if strict and group.is_bus:
                    _check(group, len(data) + walk.unpacked)
                yield group
    except MdfDamageError:
        if strict:
            raise


def _check(group: ChannelGroup, most_bytes: int) -> None:
    problem = group.misfit()
    if group.flags & VARIABLE_LENGTH and group.channels:
        problem = f"the group at byte {group.at} is of variable length and has channels"
    if not problem and group.stated_bytes > most_bytes:
        problem = (
            f"the group at byte {group.at} states {group.count} records, {group.stated_bytes} bytes: more than the "
            "file can hold"
        )
    if problem:
        raise MdfDamageError(problem)


class _Walk:
    """A walk over blocks, each of which is met once."""

    def __init__(self, data: Any, *, whole: bool) -> None:
        self.data, self.size, self.whole = data, len(data), whole
        self.met: set[int] = set()
        self.given: set[int] = set()
        self.unpacked = 0
        self.conversions: set[int] = set()
        self.conversions_size = 0

    def links(self, at: int, name: bytes = b"##") -> tuple[int, ...]:
        if not HD_AT <= at <= self.size - 24 or at in self.met or len(self.met) > MOST_BLOCKS:
            raise MdfDamageError(f"a link to byte {at} leads nowhere, or back")
        self.met.add(at)
        found, length, count = struct.unpack_from("<4s4xQQ", self.data, at)
        if not found.startswith(name):
            raise MdfDamageError(f"a link to byte {at} leads to {found!r}, not to a block {name.decode()}")
        if count > (min(length, self.size - at) - 24) // 8 or (self.whole and length > self.size - at):
            raise MdfDamageError(f"the block at byte {at} has no {count} links in {length} bytes")
        links: tuple[int, ...] = struct.unpack_from(f"<{count}Q", self.data, at + 24)
        least = {b"##HD": 1, b"##DG": 3, b"##CG": 2, b"##CN": 3, b"##DL": 1, b"##HL": 1, b"##LD": 1}
        if count < least.get(found, 0):
            raise MdfDamageError(f"the block at byte {at} has {count} links")
        return links

    def fields(self, at: int, links: int, layout: struct.Struct) -> tuple[Any, ...]:
        """Return what stands behind a block's links."""
        body_at = at + 24 + 8 * links
        (length,) = struct.unpack_from("<Q", self.data, at + 8)
        if body_at + layout.size > min(at + length, self.size):
            raise MdfDamageError(f"the block at byte {at} ends early")
        return layout.unpack_from(self.data, body_at)

    def chain(self, at: int, name: bytes) -> Iterator[int]:
        while at:
            here = at
            yield here
            if here not in self.met:
                self.links(here, name)
            at = struct.unpack_from("<Q", self.data, here + 24)[0]
            if at in self.met:
                raise MdfDamageError(f"the chain of blocks {name.decode()} leads back to byte {at}")

    def group(self, at: int, stored: DataGroup) -> ChannelGroup:
        links = self.links(at, b"##CG")
        record_id, records, flags, width, invalidation_width = self.fields(at, len(links), _GROUP)
        channels: list[MdfChannel] = []
        count = 0
        for channel_at in self.chain(links[1], b"##CN"):
            first = len(channels)
            self.channel(channel_at, channels, 0)
            count += channels[first].kind not in MASTERS
        name_at, source_at = (links[n] if len(links) > n else 0 for n in (2, 3))
        return ChannelGroup(
            at, stored, record_id, records, flags, width, invalidation_width, tuple(channels), count, name_at, source_at
        )

    def channel(self, at: int, channels: list[MdfChannel], depth: int) -> None:
        """Add a channel and its parts."""
        if depth > 20:
            raise MdfDamageError(f"structures within structures at byte {at}")
        links = self.links(at, b"##CN")
        conversion_at, data_at, unit_at, comment_at = (links[n] if len(links) > n else 0 for n in (4, 5, 6, 7))
        kind, sync, data_type, bit, byte, bits, flags, invalid_at = self.fields(at, len(links), _CHANNEL)
        name = self.text(links[2])
        self.meet_conversion(conversion_at)
        channels.append(
            MdfChannel(
                at, name, kind, sync, data_type, bit, byte, bits, flags, invalid_at, conversion_at, data_at, unit_at,
                comment_at, bool(links[1]),
            )
        )  # fmt: skip
        if links[1] and self.name(links[1]) == b"##CN":
            for part in self.chain(links[1], b"##CN"):
                self.channel(part, channels, depth + 1)

    def meet_conversion(self, at: int) -> None:
        """Count the bytes of a conversion once, however many channels have it."""
        if at in self.conversions or self.name(at) != b"##CC":
            return
        self.conversions.add(at)
        (length,) = struct.unpack_from("<Q", self.data, at + 8)
        self.conversions_size += min(length, self.size - at)
        if self.whole and self.conversions_size > self.size:
            raise MdfDamageError(f"the conversions up to byte {at} lie over one another")

    def follow_data(self, at: int) -> None:
        """Follow the lists of a group's samples."""
        if at and self.name(at) == b"##HL":
            at = self.links(at)[0]
        if at and self.name(at) not in (b"##DL", b"##LD"):
            self.count_unpacked(at)
            return
        while at:
            if self.name(at) not in (b"##DL", b"##LD"):
                raise MdfDamageError(f"a link to byte {at} leads to no list of data")
            at, *parts = self.links(at)
            for part in parts:
                self.count_unpacked(part)

    def count_unpacked(self, at: int) -> None:
        """Add what a compressed block states that it unpacks to, as far as deflate can; each is given once."""
        if at and at in self.given:
            raise MdfDamageError(f"a link leads back to the data at byte {at}")
        self.given.add(at)
        if self.name(at) == b"##DZ":
            stated, packed = self.fields(at, 0, _PACKED)
            self.unpacked += min(stated, DEFLATE_RATIO * min(packed, self.size - at))

    def name(self, at: int) -> bytes:
        """Return the four letters of a block."""
        return bytes(self.data[at : at + 4]) if HD_AT <= at <= self.size - 24 else b""

    def text(self, at: int) -> str:
        if self.name(at) not in (b"##TX", b"##MD"):
            if at and self.whole:
                raise MdfDamageError(f"a link to byte {at} leads to no text")
            return ""
        (length,) = struct.unpack_from("<Q", self.data, at + 8)
        return bytes(self.data[at + 24 : at + min(length, _LONGEST_NAME)]).split(b"\0")[0].decode("utf-8", "replace")


def non_numeric_reason(channel: MdfChannel, group: ChannelGroup) -> str:
    """Say why the bits of a channel are not read as numbers; empty if they are."""
    if channel.is_composed:
        return "an array or a structure"
    if channel.data_type not in INTEGERS + FLOATS:
        return DATA_TYPES.get(channel.data_type, f"data type {channel.data_type}")
    if channel.flags & ALL_INVALID:
        return "all of its samples are marked invalid"
    last_bit, held = 8 * channel.byte + channel.bit + channel.bits, 8 * group.width
    is_float = channel.data_type in FLOATS
    if (
        last_bit > held
        or not 0 < channel.bit + channel.bits <= 64
        or channel.bit > 7
        or (is_float and (channel.bits not in (16, 32, 64) or channel.bit))
    ):
        return f"damaged: {channel.bits} bits of data type {channel.data_type} up to bit {last_bit} of {held}"
    if channel.flags & INVALIDATION and channel.invalid_at >= 8 * group.invalidation_width:
        return f"damaged: invalidation bit {channel.invalid_at} of {8 * group.invalidation_width}"
    return ""


def rejection_reason(channel: MdfChannel, group: ChannelGroup) -> str:
    """Say why a channel is no measured signal; empty if it is."""
    # where a group is over time, a stored master of something else, an angle say, is measured like any channel
    if not (reason := non_numeric_reason(channel, group)) and channel.kind not in (FIXED_LENGTH, MASTERS[0]):
        return CHANNEL_TYPES.get(channel.kind, f"channel type {channel.kind}")
    return reason
