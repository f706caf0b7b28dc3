"""The channel groups of an MDF 2 or 3 file, described as those of MDF 4.

Layout (MDF 3.3.1, as Vector publishes it): identification 64 bytes; each block begins with two letters and its length,
2 bytes, then links of 4 bytes, then its fields, in the byte order of the file; later versions append fields. HD -> DG
-> CG -> CN. The first bit of a channel is counted from the record's begin; a channel of type 1 is the time. Records
have no block around them: they begin where a link leads, and are as long as their groups say. A number before each
record says of which group it is, and may stand behind it once more.
"""

from __future__ import annotations

import codecs
import struct
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from recoil_acquisition.readers.mdf.channel_groups import (
    FIXED_LENGTH,
    HD_AT,
    MASTERS,
    UNKNOWN,
    ChannelGroup,
    DataGroup,
    MdfChannel,
    MdfCutError,
    MdfDamageError,
)
from recoil_acquisition.readers.mdf.master import TIME

MOST_TEXT = 2000
"""Bytes that are read of a text."""
_FIELDS = {
    "HD": "3IH10s8s32s32s32s32s", "DG": "4I2H", "CG": "3I3HI", "CN": "5IH32s128s4H3d", "CC": "H2d20s2H", "TX": "",
}  # fmt: skip
"""Fields of a block behind its length, as of the oldest version."""
_ORDER_AT, _CODE_PAGE_AT = 24, 30

_UNSIGNED, _SIGNED, _FLOAT, _DOUBLE = range(4)
"""Data types in the byte order of the file, and of those with an order of their own what is left of them."""
_NUMBERS = {_UNSIGNED: 0, _SIGNED: 2, _FLOAT: 4, _DOUBLE: 4}
_MOTOROLA, _INTEL = 9, 13
"""First of the data types with the highest byte first, and with the lowest one."""
_OTHERS = {7: 7, 8: 10}
"""Texts and bytes, as MDF 4 numbers them."""
_LONG_NAME_AT, _BYTES_AT = 218, 226
_REDUCED_AT = 26


class OldBlocks:
    """The blocks of one file.

    Parameters
    ----------
    content
        Bytes of the whole file.

    Attributes
    ----------
    order
        Byte order of the blocks, as `struct` writes it: that in which the header block has its few hundred bytes. The
        identification states it too, yet some programs mean the numbers in records alone by that.
    is_big_endian, has_other_floats
        Whether numbers in records whose type states no byte order begin with their highest byte, and whether their
        floats are others than those of IEEE 754.

    Raises
    ------
    MdfDamageError
        If the file ends before its header block.
    """

    def __init__(self, content: bytes) -> None:
        self.content, self.order = content, "<"
        (little,) = self.unpacked("H", HD_AT + 2)
        self.order = "<" if little & 0xFF > little >> 8 else ">"
        self.is_big_endian, self.has_other_floats = (bool(field) for field in self.unpacked("2H", _ORDER_AT))
        self._encoding = _encoding(*self.unpacked("H", _CODE_PAGE_AT))
        self._texts: dict[int, str] = {}

    def unpacked(self, layout: str, at: int) -> tuple[Any, ...]:
        """Return fields, as `struct` names them, from an address; raises `MdfDamageError` if the file ends before."""
        fields = struct.Struct(self.order + layout)
        if at + fields.size > len(self.content):
            raise MdfCutError(f"the file is cut: fields at byte {at} lie beyond its {len(self.content)} bytes")
        return fields.unpack_from(self.content, at)

    def block(self, at: int, kind: str) -> tuple[int, tuple[Any, ...]]:
        """Return the length of a block, and the fields that it has in every version.

        Raises
        ------
        MdfDamageError
            If there is no such block.
        """
        found, length, *fields = self.unpacked("2sH" + _FIELDS[kind], at)
        least = struct.calcsize("<2sH" + _FIELDS[kind])
        if at < HD_AT or found != kind.encode():
            raise MdfDamageError(f"a link to byte {at} leads to {found!r}, not to a block {kind}")
        if not least <= length <= len(self.content) - at:
            raise MdfDamageError(f"the block at byte {at} has no {length} bytes: {least} to {len(self.content) - at}")
        return length, tuple(fields)

    def text(self, at: int) -> str:
        """Return the text of a TX block; empty without one, or of a damaged one."""
        if at not in self._texts:
            try:
                length, _ = self.block(at, "TX")
            except MdfDamageError:
                length = 0
            self._texts[at] = self.decoded(self.content[at + 4 : at + min(length, MOST_TEXT)])
        return self._texts[at]

    def decoded(self, field: bytes) -> str:
        """Return the text of a field, which ends with a zero byte where it is shorter."""
        return field.split(b"\0")[0].decode(self._encoding, "replace").strip()


def _encoding(code_page: int) -> str:
    """Return the encoding of texts, by the number of a code page; 0 where the program did not say."""
    try:
        return codecs.lookup(f"cp{code_page}").name
    except LookupError:
        return "latin-1"


class OldGroups:
    """The groups of a file, walked once; a chain that leads back is refused, and so are blocks over one another.

    Attributes
    ----------
    groups
        Groups in the order of the file.
    blocks_size
        Bytes that all blocks of their chains, and their conversions, take.
    linked
        Addresses that any of them links to.
    has_reduced_samples
        Whether a group has samples of several records each.

    Raises
    ------
    MdfDamageError
        If blocks do not hang together.
    """

    def __init__(self, blocks: OldBlocks, first_at: int) -> None:
        self._blocks = blocks
        self._met: set[int] = set()
        self.linked: set[int] = set()
        self.has_reduced_samples = False
        self.blocks_size = 0
        self.groups = [group for at in self._chain(first_at, "DG") for group in self._stored_groups(at)]

    def _chain(self, at: int, kind: str) -> Iterator[int]:
        while at:
            if at in self._met:
                raise MdfDamageError(f"the chain of blocks {kind} leads back to byte {at}")
            self._met.add(at)
            length, (following, *_) = self._blocks.block(at, kind)
            self._count(at, length)
            yield at
            at = following

    def _count(self, at: int, length: int) -> None:
        self.blocks_size += length
        if self.blocks_size > len(self._blocks.content):
            raise MdfDamageError(f"the blocks up to byte {at} lie over one another")

    def _meet_conversion(self, at: int) -> None:
        """Count the bytes of a conversion once, however many channels have it; one that is damaged has none."""
        if at in self._met:
            return
        self._met.add(at)
        try:
            length, _ = self._blocks.block(at, "CC")
        except MdfDamageError:
            return
        self._count(at, length)

    def _stored_groups(self, at: int) -> list[ChannelGroup]:
        _, (following, first, triggers_at, data_at, _, numbers) = self._blocks.block(at, "DG")
        self.linked |= {following, first, triggers_at, data_at}
        if numbers > 2:
            raise MdfDamageError(f"the data group at byte {at} has {numbers} numbers at each record")
        stored = DataGroup(at, data_at, min(numbers, 1))
        groups = [self._group(group_at, stored, behind=int(numbers == 2)) for group_at in self._chain(first, "CG")]
        stored = replace(stored, size=sum(stored.id_bytes * group.count + group.stated_bytes for group in groups))
        return [replace(group, stored=stored) for group in groups]

    def _group(self, at: int, stored: DataGroup, *, behind: int) -> ChannelGroup:
        length, (following, first, comment_at, record_id, _, width, count) = self._blocks.block(at, "CG")
        (reduced_at,) = self._blocks.unpacked("I", at + _REDUCED_AT) if length >= _REDUCED_AT + 4 else (0,)
        self.has_reduced_samples |= bool(reduced_at)
        self.linked |= {following, first, comment_at, reduced_at}
        channels = tuple(self._channel(channel_at) for channel_at in self._chain(first, "CN"))
        measured = sum(channel.kind not in MASTERS for channel in channels)
        # the number behind a record is passed over like the bits that MDF 4 has there
        return ChannelGroup(at, stored, record_id, count, 0, width, behind, channels, measured, comment_at)

    def _channel(self, at: int) -> MdfChannel:
        length, fields = self._blocks.block(at, "CN")
        conversion_at, source_at, parts_at, comment_at, kind, short_name, _, bit, bits, data_type = fields[1:11]
        name, name_at = self._blocks.decoded(short_name), 0
        if length >= _LONG_NAME_AT + 4:
            (name_at,) = self._blocks.unpacked("I", at + _LONG_NAME_AT)
            name = self._blocks.text(name_at) or name
        if length >= _BYTES_AT + 2:
            bit += 8 * self._blocks.unpacked("H", at + _BYTES_AT)[0]
        self._meet_conversion(conversion_at)
        self.linked |= {fields[0], conversion_at, source_at, parts_at, comment_at, name_at}
        computed = not bits
        kind = {0: FIXED_LENGTH, 1: MASTERS[computed]}.get(kind, UNKNOWN)
        return MdfChannel(
            at, name, kind, TIME * (kind in MASTERS), self._data_type(data_type), bit % 8, bit // 8, bits, 0, 0,
            conversion_at, 0, 0, comment_at, bool(parts_at),
        )  # fmt: skip

    def _data_type(self, data_type: int) -> int:
        """Return the number that MDF 4 has for a data type."""
        is_big_endian, number = self._blocks.is_big_endian, data_type
        if _MOTOROLA <= data_type < _INTEL + len(_NUMBERS):
            is_big_endian = data_type < _INTEL
            number = (data_type - _MOTOROLA) % len(_NUMBERS)
        elif data_type in (_FLOAT, _DOUBLE) and self._blocks.has_other_floats:
            return UNKNOWN
        if number in _NUMBERS:
            return _NUMBERS[number] + is_big_endian
        return _OTHERS.get(data_type, UNKNOWN)


def counted(group: ChannelGroup, linked: set[int], size: int) -> ChannelGroup:
    """Return a group with the records that reach up to the next block, or to the end of the file.

    Parameters
    ----------
    group
        Stored alone.
    linked
        Addresses of blocks.
    size
        Bytes of the file.
    """
    stored, width = group.stored, group.stored.id_bytes + group.width + group.invalidation_width
    end = min([at for at in linked if stored.data_at < at <= size], default=size)
    count = (end - stored.data_at) // width if stored.data_at and width else 0
    return replace(group, count=count, stored=replace(stored, size=count * width))
