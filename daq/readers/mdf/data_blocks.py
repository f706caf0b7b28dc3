"""The bytes of an MDF 4 file's records and of its samples of variable length, put together from their blocks.

Layout (ASAM MDF 4.1): a DT, SD, RD or DV block is its bytes; a DZ block is one of them packed by deflate, its rows and
columns exchanged or not; a DL or LD block lists them and links to the next one; an HL block links to the first DL.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from daq.readers.mdf.channel_groups import MdfDamageError

LARGEST_RATIO = 100
"""Unpacked blocks take no more than so many times the file's size: frames shrink to a tenth, not to a hundredth."""

_BLOCK = struct.Struct("<4s4xQQ")
_PACKED = struct.Struct("<2sBxLQQ")
_LIST_OF_COLUMNS = struct.Struct("<II")
_PLAIN = frozenset({b"##DT", b"##SD", b"##RD", b"##DV"})
_HAS_INVALIDATION = 0x8000_0000
_PLAIN_METHOD, _TRANSPOSED = 0, 1


class DataBlocks:
    """The data blocks of one file; each is given once.

    Parameters
    ----------
    content : bytes
        The whole file.
    open_at : int
        Address of a block whose recorder did not write its length: it reaches to the end of the file.
    """

    def __init__(self, content: bytes, open_at: int = 0) -> None:
        self.content = content
        self.open_at = open_at
        self.given: set[int] = set()
        self.left = LARGEST_RATIO * len(content)

    def read(self, at: int) -> NDArray[np.uint8]:
        """Return the bytes that one link leads to, shape (n_bytes,).

        Raises
        ------
        MdfDamageError
            If a link leads out of the file, to no data or to data that were given before; if a block is longer than
            the file, or a packed one does not unpack to its stated size.
        """
        parts = [self._part(block) for block in self._listed(at)] if at else []
        if not parts:
            return np.zeros(0, np.uint8)
        return np.concatenate(parts) if len(parts) > 1 else parts[0]

    def _listed(self, at: int) -> list[int]:
        kind, _, links = self._block(at)
        if kind == b"##HL" and links:
            at = links[0]
            kind, _, links = self._block(at) if at else (b"##DL", 0, ())
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
            raise MdfDamageError(f"the list at byte {at} keeps invalidation bits apart, which is not read here")
        return int(count)

    def _part(self, at: int) -> NDArray[np.uint8]:
        self._take(at)
        kind, length, links = self._block(at)
        body_at, end = at + _BLOCK.size + 8 * len(links), at + length
        if at == self.open_at:
            end = len(self.content)
        if kind in _PLAIN:
            return np.frombuffer(self.content, np.uint8, max(0, end - body_at), min(body_at, len(self.content)))
        if kind == b"##DZ":
            return self._unpacked(at, body_at, end)
        raise MdfDamageError(f"the block at byte {at} is {kind!r}, which holds no data")

    def _take(self, at: int) -> None:
        if at in self.given:
            raise MdfDamageError(f"links lead back to the data at byte {at}")
        self.given.add(at)

    def _block(self, at: int) -> tuple[bytes, int, tuple[int, ...]]:
        """Return a block's kind, length and links."""
        if at + _BLOCK.size > len(self.content):
            raise MdfDamageError(f"the file is cut: a block at byte {at} lies beyond its {len(self.content)} bytes")
        kind, length, count = _BLOCK.unpack_from(self.content, at)
        left = len(self.content) - at
        if count > (left - _BLOCK.size) // 8:
            raise MdfDamageError(f"the file is cut, or the block at byte {at} has no {count} links")
        if at != self.open_at and not _BLOCK.size + 8 * count <= length <= left:
            raise MdfDamageError(f"the file is cut, or the block at byte {at} has no {length} bytes: {left} to the end")
        return kind, length, struct.unpack_from(f"<{count}Q", self.content, at + _BLOCK.size)

    def _unpacked(self, at: int, body_at: int, end: int) -> NDArray[np.uint8]:
        if body_at + _PACKED.size > end:
            raise MdfDamageError(f"the packed block at byte {at} is shorter than its header")
        _, method, columns, stated, size = _PACKED.unpack_from(self.content, body_at)
        packed = memoryview(self.content)[body_at + _PACKED.size : end]
        if method not in (_PLAIN_METHOD, _TRANSPOSED) or (method == _TRANSPOSED and not columns):
            raise MdfDamageError(f"the packed block at byte {at} has the method {method} with {columns} columns")
        if stated > self.left or size > len(packed):
            raise MdfDamageError(f"the packed block at byte {at} cannot have its stated size, {stated} bytes")
        self.left -= stated
        unpacking = zlib.decompressobj()
        try:
            # one byte more than it states: whatever is longer shows
            data = unpacking.decompress(packed[:size], stated + 1)
        except zlib.error as error:
            raise MdfDamageError(f"the packed block at byte {at} does not unpack") from error
        if len(data) != stated or not unpacking.eof:
            raise MdfDamageError(f"the packed block at byte {at} does not unpack to its stated size, {stated} bytes")
        unpacked = np.frombuffer(data, np.uint8)
        if method == _PLAIN_METHOD:
            return unpacked
        rows = stated // columns
        turned = unpacked[: rows * columns].reshape(columns, rows).T.ravel()
        return np.concatenate([turned, unpacked[rows * columns :]])
