"""The bytes of an MDF 4 file's records and of its samples of variable length, put together from their blocks.

Layout (ASAM MDF 4.1): a DT, SD or DV block is its bytes; a DZ block is one of them packed by deflate, since MDF 4.3 by
zstd (RFC 8878) or as an LZ4 frame too, its rows and columns exchanged or not; a DL or LD block lists them and links to
the next one; an HL block links to the first DL.
"""

from __future__ import annotations

import re
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.bounded_file import SPARE_BYTES
from recoil_acquisition.readers.mdf.channel_groups import MdfCutError, MdfDamageError, MdfUnsupportedError

LARGEST_RATIO = 300
"""Ratio of the unpacked blocks to the file's size at most, beside what any file may: frames of a bus shrink to a tenth,
the same frame at the same pace to a two hundredth."""

_BEGINNING = re.compile(rb"##[A-Z]{2}\0{4}")
_BLOCK = struct.Struct("<4s4xQQ")
_PACKED = struct.Struct("<2sBxLQQ")
_LIST_OF_COLUMNS = struct.Struct("<II")
_PLAIN = frozenset({b"##DT", b"##SD", b"##DV"})
_HAS_INVALIDATION = 0x8000_0000
_DEFLATE, _ZSTD, _LZ4 = 0, 2, 4
"""Methods of packing; the odd number behind each exchanges rows and columns."""
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_ZSTD_SIZES = {0x20: "<B", 0x40: "<H", 0x60: "<H", 0x80: "<I", 0xA0: "<I", 0xC0: "<Q", 0xE0: "<Q"}
"""Layouts of the size of a zstd frame's content, by the first three bits of its descriptor."""


class DataBlocks:
    """The data blocks of one file; each is given once.

    Parameters
    ----------
    content
        Bytes of the whole file.
    open_at
        Address of a block whose recorder did not write its length: it reaches to the next block, or the file's end.
    """

    def __init__(self, content: bytes, open_at: int = 0) -> None:
        self.content = content
        self.open_at = open_at
        self.given: set[int] = set()
        self.left = LARGEST_RATIO * len(content) + SPARE_BYTES

    def read(self, at: int) -> NDArray[np.uint8]:
        """Return the bytes that one link leads to, shape (n_bytes,).

        Raises
        ------
        MdfDamageError
            If a link leads out of the file, to no data or to data that were given before; if a block is longer than
            the file, or a packed one does not unpack to its stated size.
        MdfUnsupportedError
            If a block is packed otherwise than by deflate, or invalidation bits are kept apart.
        """
        parts = [self._part(block) for block in self.places(at)]
        if not parts:
            return np.zeros(0, np.uint8)
        return np.concatenate(parts) if len(parts) > 1 else parts[0]

    def places(self, at: int) -> list[int]:
        """Return the addresses of the blocks that one link leads to; raises as `read` does."""
        if not at:
            return []
        kind, _, links = self._block(at)
        if kind == b"##HL" and links:
            at = links[0]
            if not at:
                return []
            kind, _, links = self._block(at)
        if kind not in (b"##DL", b"##LD"):
            return [at]
        found: list[int] = []
        while True:
            self._take(at)
            count = self._columns(at, len(links)) if kind == b"##LD" else len(links) - 1
            found += [link for link in links[1 : 1 + count] if link]
            if not links or not links[0]:
                return found
            at = links[0]
            kind, _, links = self._block(at)

    def _columns(self, at: int, links: int) -> int:
        fields_at = at + _BLOCK.size + 8 * links
        if fields_at + _LIST_OF_COLUMNS.size > len(self.content):
            raise MdfDamageError(f"the block at byte {at} ends early")
        flags, count = _LIST_OF_COLUMNS.unpack_from(self.content, fields_at)
        if flags & _HAS_INVALIDATION:
            raise MdfUnsupportedError("invalidation bits that are kept apart from the records")
        return int(count)

    def _part(self, at: int) -> NDArray[np.uint8]:
        self._take(at)
        kind, length, links = self._block(at)
        body_at, end = at + _BLOCK.size + 8 * len(links), at + length
        if at == self.open_at:
            end = self._next_block(body_at)
        if kind in _PLAIN:
            return np.frombuffer(self.content, np.uint8, max(0, end - body_at), min(body_at, len(self.content)))
        if kind == b"##DZ":
            return self._unpacked(at, body_at, end)
        raise MdfDamageError(f"the block at byte {at} is {kind!r}, which holds no data")

    def _next_block(self, at: int) -> int:
        """Return where the next block begins behind a place, which is a multiple of 8, or the end of the file."""
        for found in _BEGINNING.finditer(self.content, at):
            if found.start() % 8 == 0:
                return found.start()
        return len(self.content)

    def _take(self, at: int) -> None:
        if at in self.given:
            raise MdfDamageError(f"links lead back to the data at byte {at}")
        self.given.add(at)

    def _block(self, at: int) -> tuple[bytes, int, tuple[int, ...]]:
        """Return a block's kind, length and links."""
        if at + _BLOCK.size > len(self.content):
            raise MdfCutError(f"the file is cut: a block at byte {at} lies beyond its {len(self.content)} bytes")
        kind, length, count = _BLOCK.unpack_from(self.content, at)
        left = len(self.content) - at
        if at == self.open_at:
            return kind, length, ()
        if not _BLOCK.size + 8 * count <= length <= left:
            raise MdfCutError(f"the file is cut, or the block at byte {at} has no {length} bytes: {left} to the end")
        return kind, length, struct.unpack_from(f"<{count}Q", self.content, at + _BLOCK.size)

    def _unpacked(self, at: int, body_at: int, end: int) -> NDArray[np.uint8]:
        if body_at + _PACKED.size > end:
            raise MdfDamageError(f"the packed block at byte {at} is shorter than its header")
        _, method, columns, stated, size = _PACKED.unpack_from(self.content, body_at)
        packed = memoryview(self.content)[body_at + _PACKED.size : end]
        unpack = {_DEFLATE: _inflated, _ZSTD: _zstd_unpacked, _LZ4: _lz4_unpacked}.get(method & ~1)
        if unpack is None:
            raise MdfUnsupportedError(f"a block that is packed by the method {method}")
        is_turned = bool(method & 1)
        if is_turned and not columns:
            raise MdfDamageError(f"the packed block at byte {at} has rows without columns")
        if stated > self.left or size > len(packed):
            raise MdfDamageError(f"the packed block at byte {at} cannot have its stated size, {stated} bytes")
        self.left -= stated
        try:
            data = unpack(packed[:size], stated)
        except (zlib.error, RuntimeError, struct.error) as error:
            raise MdfDamageError(f"the packed block at byte {at} does not unpack") from error
        if data is None or len(data) != stated:
            raise MdfDamageError(f"the packed block at byte {at} does not unpack to its stated size, {stated} bytes")
        unpacked = np.frombuffer(data, np.uint8)
        if not is_turned:
            return unpacked
        rows = stated // columns
        turned = unpacked[: rows * columns].reshape(columns, rows).T.ravel()
        return np.concatenate([turned, unpacked[rows * columns :]])


def _inflated(packed: memoryview, stated: int) -> bytes | None:
    """Unpack deflate to one byte more than is stated, so that whatever is longer shows; None if there is more."""
    unpacking = zlib.decompressobj()
    data = unpacking.decompress(packed, stated + 1)
    return data if unpacking.eof else None


def _lz4_unpacked(packed: memoryview, stated: int) -> bytes | None:
    from lz4.frame import LZ4FrameDecompressor

    unpacking = LZ4FrameDecompressor()
    data: bytes = unpacking.decompress(packed, max_length=stated + 1)
    return data if unpacking.eof else None


def _zstd_unpacked(packed: memoryview, stated: int) -> bytes | None:
    """Unpack a frame of zstd that says itself how long its content is: the library makes room for as much."""
    try:
        import zstd
    except ImportError as error:
        raise MdfUnsupportedError("a block that is packed by zstd, which is read where zstd is installed") from error
    if len(packed) < 6 or bytes(packed[:4]) != _ZSTD_MAGIC or not (kind := packed[4] & 0xE0):
        return None
    layout = _ZSTD_SIZES[kind]
    at = 5 + (not kind & 0x20) + (0, 1, 2, 4)[packed[4] & 3]  # behind the window's size, and a dictionary's number
    (size,) = struct.unpack_from(layout, packed, at)
    if size + (256 if layout == "<H" else 0) != stated:
        return None
    try:
        return bytes(zstd.decompress(bytes(packed)))
    except zstd.Error:
        return None
