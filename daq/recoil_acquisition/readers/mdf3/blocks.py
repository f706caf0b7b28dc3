"""The blocks of an MDF 2 or 3 file.

Layout (MDF 3.3.1, as Vector publishes it): identification 64 bytes; each block begins with two letters and its length,
2 bytes, then links of 4 bytes, then its fields, in the byte order of the file; later versions append fields. Records
have no block around them: they begin where a link leads, and are as long as their groups say.
"""

from __future__ import annotations

import codecs
import struct
from typing import Any

from recoil_acquisition.readers.mdf.channel_groups import HD_AT, MdfCutError, MdfDamageError

MOST_TEXT = 2000
"""Bytes that are read of a text."""
_FIELDS = {
    "HD": "3IH10s8s32s32s32s32s", "DG": "4I2H", "CG": "3I3HI", "CN": "5IH32s128s4H3d", "CC": "H2d20s2H", "TX": "",
}  # fmt: skip
"""Fields of a block behind its length, as of the oldest version."""
_ORDER_AT, _CODE_PAGE_AT = 24, 30


class OldBlocks:
    """The blocks of one file.

    Parameters
    ----------
    content
        All of the file.

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
