"""The blocks of an MDF 4 file, checked before a library follows them.

Layout (ASAM MDF 4): from byte 64 on, blocks of an identification (``##`` and two letters), their length, a number of
links and the links, which are addresses of other blocks or zero. A library that trusts them reads beyond the file, or
follows a chain that leads back into itself for ever.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

from daq.errors import CorruptFileError

_BLOCK = struct.Struct("<2s2s4xQQ")
_PACKED = struct.Struct("<2sBxLQQ")
_HEADER_AT = 64
_LARGEST_RATIO = 100
"""Unpacked blocks take no more than so many times the file's size: samples shrink to a tenth, not to a hundredth."""

_PART_BYTES = 1 << 16
"""Of a compressed block that are held at a time."""

_CHAINED: Mapping[bytes, tuple[int, ...]] = {b"HD": (0,), b"DG": (0, 1, 2), b"CG": (0, 1), b"CN": (0, 1), b"HL": (0,)}
"""Links that make up the tree of groups and channels: each block of it is reached once."""

_DATA = frozenset({b"DT", b"SD", b"RD", b"DV", b"DI"})


def check_blocks(path: Path, content: bytes, *, finished: bool) -> None:
    """Check all blocks that can be reached.

    Parameters
    ----------
    path : Path
        For messages.
    content : bytes
        The whole file.
    finished : bool
        Whether the recorder closed the file; if not, the length of its data is not yet written.

    Raises
    ------
    CorruptFileError
        If a link leads out of the file or to no block, blocks lead back to themselves, or a compressed block does
        not unpack to its stated size.
    """
    seen: set[int] = set()
    chained: set[int] = set()
    waiting = [_HEADER_AT]
    unpacked = 0
    while waiting:
        at = waiting.pop()
        if at in seen:
            continue
        seen.add(at)
        kind, length, links = _block(path, content, at, finished=finished)
        if kind == b"DZ":
            unpacked += _check_packed(path, content, at, length, len(content) * _LARGEST_RATIO - unpacked)
        followed = range(len(links)) if kind == b"DL" else _CHAINED.get(kind, ())
        for number in followed:
            if number < len(links) and links[number]:
                if links[number] in chained:
                    raise CorruptFileError("blocks lead back to themselves", path=path, place=f"byte {at}")
                chained.add(links[number])
        waiting += [link for link in links if link]


def _block(path: Path, content: bytes, at: int, *, finished: bool) -> tuple[bytes, int, tuple[int, ...]]:
    """Return a block's kind, length and links."""
    place = f"byte {at}"
    if at + _BLOCK.size > len(content):
        raise CorruptFileError(
            "the file is cut: a block lies beyond its end",
            path=path,
            place=place,
            found=f"{len(content)} bytes",
            remedy="copy the file again",
        )
    mark, kind, length, count = _BLOCK.unpack_from(content, at)
    if mark != b"##":
        raise CorruptFileError("a link leads to no block", path=path, place=place, expected="##")
    if kind in _DATA and not finished:
        return kind, length, ()
    if length < _BLOCK.size + 8 * count or at + length > len(content):
        raise CorruptFileError(
            "the file is cut, or the length of a block is wrong",
            path=path,
            place=place,
            expected=f"{length} bytes with {count} links",
            found=f"{len(content) - at} bytes to the end",
            remedy="copy the file again",
        )
    return kind, length, struct.unpack_from(f"<{count}Q", content, at + _BLOCK.size)


def _check_packed(path: Path, content: bytes, at: int, length: int, limit: int) -> int:
    """Unpack a compressed block for its size, within bounds; return the size."""
    body = at + _BLOCK.size
    if length < _BLOCK.size + _PACKED.size:
        raise CorruptFileError("a compressed block is shorter than its header", path=path, place=f"byte {at}")
    _, method, _, stated, size = _PACKED.unpack_from(content, body)
    packed = memoryview(content)[body + _PACKED.size : at + length]
    if method not in (0, 1):
        raise CorruptFileError(
            "a block's compression is unknown", path=path, place=f"byte {at}", expected="0 or 1", found=str(method)
        )
    try:
        fits = stated <= limit and _unpacked_size(packed[:size], stated) == stated
    except (zlib.error, OverflowError) as error:
        raise CorruptFileError("a compressed block does not unpack", path=path, place=f"byte {at}") from error
    if not fits or size > len(packed):
        raise CorruptFileError(
            "a compressed block does not unpack to its stated size",
            path=path,
            place=f"byte {at}",
            expected=f"{stated} bytes",
        )
    return int(stated)


def _unpacked_size(packed: memoryview, most: int) -> int:
    """Return the size to which a block unpacks, or some larger one than ``most``; little of it is held at a time."""
    unpacking = zlib.decompressobj()
    size = 0
    for at in range(0, len(packed), _PART_BYTES):
        part: bytes | memoryview = packed[at : at + _PART_BYTES]
        while part and not unpacking.eof and size <= most:
            size += len(unpacking.decompress(part, _PART_BYTES))
            part = unpacking.unconsumed_tail
    return size if size > most else size + len(unpacking.flush())
