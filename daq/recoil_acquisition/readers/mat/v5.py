"""MATLAB files of version 5 to 7 (``-v6``, ``-v7``), read element by element.

Arrays of real numbers, texts, and these as fields of structures are read. Cells, objects and function handles are
named by their class and skipped: nothing in a file is ever made into an object. Every size is held
against the bytes that are there, and a compressed variable is inflated no further than its array needs.

Layout: MathWorks, *MAT-File Format* (Level 5 MAT-Files: header, data elements, small data elements,
``miMATRIX`` sub-elements, ``miCOMPRESSED``).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from io import BufferedReader
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.bounded_file import DEFLATE_RATIO, most_unpacked
from recoil_acquisition.readers.mat.variable import (
    CELL,
    LONGEST_TEXT,
    MOST_VARIABLES,
    STRUCTURE,
    MatContents,
)
from recoil_acquisition.readers.recording import map_to_corrupt_file

HEADER_BYTES = 128
MATRIX, COMPRESSED = 14, 15
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""numpy's type of each ``mi`` type of numbers."""
CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
"""numpy's type of each ``mx`` class of numbers."""
STRUCT, CHARACTERS, OPAQUE = 2, 4, 17
OTHER_CLASSES = {
    1: CELL, STRUCT: STRUCTURE, 3: "an object: save what it holds as vectors",
    5: "a sparse array: save it as full vectors", 16: "a function handle",
}  # fmt: skip
COMPLEX = 0x0800
TEXT_ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
START_BYTES = 8192
"""Bytes of each variable that are read first, enough for its class, shape and name, and for a scalar or a text."""
PIECE_BYTES = 1 << 18
"""Bytes that are read, and inflated, at a time."""
DEEPEST = 8
"""Structures within one another whose fields are read."""
WHOLE = "a whole MATLAB file of version 5"


def is_mat_v5(head: bytes) -> bool:
    """Return whether a file begins with the header of a Level 5 MAT-file."""
    return (
        len(head) >= HEADER_BYTES
        and head[124:128] in (b"\x00\x01IM", b"\x01\x00MI")
        and all(byte >= 9 for byte in head[:4])
    )


def read_mat_v5(path: Path) -> MatContents:
    """List the variables of a file, and the fields of its structures; the numbers of vectors are not read.

    Raises
    ------
    ReadError
        If it unpacks to more than a recording does.
    CorruptFileError
        If it contradicts its format.
    """
    with map_to_corrupt_file(path, WHOLE), path.open("rb") as file:
        head = file.read(HEADER_BYTES)
        if not is_mat_v5(head):
            raise CorruptFileError("no header of a MATLAB file", path=path, place="byte 124", expected="IM or MI")
        listing = _Listing(path, "<" if head[126:128] == b"IM" else ">", head)
        at = HEADER_BYTES
        while at < listing.size:
            file.seek(at)
            tag = file.read(8)
            kind, length = struct.unpack(f"{listing.order}II", tag) if len(tag) == 8 else (0, 0)
            if len(tag) < 8 or at + 8 + length > listing.size:
                before = f"{len(listing.contents.vectors)} before it were read"
                return replace(listing.contents, incomplete=f"the variable at byte {at} is cut off: {before}")
            if kind not in (MATRIX, COMPRESSED):
                raise CorruptFileError(
                    "no variable",
                    path=path,
                    place=f"byte {at}",
                    expected="an element of type 14 or 15",
                    found=f"{kind}",
                )
            packed = kind == COMPRESSED
            # Only whole elements of 8 bytes stand uncompressed; compressed ones are not padded
            array = _Array(path, at + 8 * packed, length + 8 * (not packed), packed)
            listing.take(array, array.read(0, START_BYTES))
            at += 8 + length
    return listing.contents


@dataclass(frozen=True)
class _Array:
    """An array with its tag: `size` stored bytes at `at`, of which, inflated, it begins at `begin`."""

    path: Path
    at: int
    size: int
    packed: bool
    begin: int = 0

    def read(self, begin: int, size: int) -> bytearray:
        """Return bytes of it from one on, inflated if need be; fewer if it ends before."""
        begin += self.begin
        with self.path.open("rb") as file:
            if not self.packed:
                content = bytearray(max(min(size, self.size - begin), 0))
                file.seek(self.at + begin)
                del content[file.readinto(content) :]
                return content
            content, have = bytearray(size), -begin
            for piece in self._inflated(file):
                wanted = piece[max(-have, 0) : size - have]
                content[max(have, 0) : max(have, 0) + len(wanted)] = wanted
                have += len(piece)
                if have >= size:
                    break
        del content[max(have, 0) :]
        return content

    def _inflated(self, file: BufferedReader) -> Iterator[bytes]:
        file.seek(self.at)
        inflate, left = zlib.decompressobj(), self.size
        while left and not inflate.eof and (block := file.read(min(left, PIECE_BYTES))):
            left -= len(block)
            while block and not inflate.eof:
                yield inflate.decompress(block, PIECE_BYTES)
                block = inflate.unconsumed_tail


class _Listing:
    """List of the variables of a file, as far as it was gone through."""

    def __init__(self, path: Path, order: str, head: bytes) -> None:
        self.path, self.order, self.size = path, order, path.stat().st_size
        self.contents = MatContents("5", head[:116].decode("latin-1").rstrip("\0 "))
        self._seen = self._unpacked = 0
        self._whole = lru_cache(maxsize=1)(_load)

    def take(self, array: _Array, start: bytearray, field: str = "", depth: int = 0) -> None:
        """Look at one array by its first bytes; `field` is its name where it is a field of a structure."""
        self._seen += 1
        if self._seen > MOST_VARIABLES:
            raise CorruptFileError(f"more than {MOST_VARIABLES} variables", path=self.path)
        left_out, order = self.contents.left_out, self.order
        tag, stated = struct.unpack_from(f"{order}II", start)
        if tag != MATRIX:
            left_out[field or f"the element at byte {array.at}"] = f"type {tag}"
            return
        flags_type, flags_at, flags_size, at = _tag(start, 8, order)
        if flags_type != 6 or flags_size != 8:
            raise ValueError(f"array flags of type {flags_type}, {flags_size} bytes")
        flags = struct.unpack_from(f"{order}I", start, flags_at)[0]
        kind = flags & 0xFF
        if kind == OPAQUE:
            left_out[field or "an object"] = "of a class: save what it holds as vectors"
            return
        dims_type, dims_at, dims_size, at = _tag(start, at, order)
        if dims_type != 5 or not 8 <= dims_size <= 256 or dims_size % 4:
            raise ValueError(f"dimensions of type {dims_type}, {dims_size} bytes")
        shape = struct.unpack_from(f"{order}{dims_size // 4}i", start, dims_at)
        if min(shape) < 0:
            raise ValueError(f"shape {shape}")
        name_type, name_at, name_size, at = _tag(start, at, order)
        if name_type != 1 or name_size > 4096:
            raise ValueError(f"a name of type {name_type}, {name_size} bytes")
        name, count = field or start[name_at : name_at + name_size].decode("latin-1"), prod(shape)
        if kind == STRUCT and count == 1 and depth < DEEPEST:
            if not depth:
                self._hold(array, name, stated)
            self._take_fields(array, start if depth else array.read(0, 8 + stated), at, name, depth)
        elif kind != CHARACTERS and kind not in CLASSES:
            left_out[name] = OTHER_CLASSES.get(kind, f"class {kind}").format(name=name)
        elif not count:
            left_out[name] = "empty"
        else:
            data_type, data_at, data_size, _ = _tag(start, at, order)
            if data_at + data_size > 8 + stated:
                raise ValueError(f"{name!r}: {data_size} bytes at {data_at} of {8 + stated}")
            if kind == CHARACTERS:
                self._take_text(name, count, data_type, bytes(start[data_at : data_at + data_size]), data_size)
            elif flags & COMPLEX:
                left_out[name] = "complex"
            else:
                self._take_numbers(array, name, shape, kind, data_type, data_at, data_size)

    def _take_text(self, name: str, count: int, data_type: int, stored: bytes, size: int) -> None:
        if data_type not in TEXT_ENCODINGS or count > LONGEST_TEXT or len(stored) < size:
            self.contents.left_out[name] = f"a text of {count} characters"
            return
        width = "" if data_type in (1, 2, 16) else ("-le" if self.order == "<" else "-be")
        # Two-byte characters are also stored under the type of plain integers
        self.contents.texts[name] = stored.decode(TEXT_ENCODINGS[data_type] + width, "replace")

    def _take_numbers(
        self, array: _Array, name: str, shape: tuple[int, ...], kind: int, data_type: int, data_at: int, size: int
    ) -> None:
        if data_type not in NUMBERS:
            raise ValueError(f"numbers of type {data_type} in {name!r}")
        stored, count = np.dtype(self.order + NUMBERS[data_type]), prod(shape)
        if stored.itemsize * count != size:
            raise CorruptFileError(
                f"variable {name!r} contradicts itself", path=self.path, place=f"byte {array.at}",
                expected=f"{count} numbers of {stored.itemsize} bytes", found=f"{size} bytes",
            )  # fmt: skip
        self._hold(array, name, size)
        dtype = np.dtype(CLASSES[kind])
        read = partial(_load, array, name, data_at, stored, dtype)
        if array.packed and sum(n != 1 for n in shape) == 2:
            # it is asked for column by column, each of which would be inflated from the beginning on
            read = partial(_part, partial(self._whole, *read.args, 0, count))
        self.contents.take_numbers(name, shape, dtype, read)

    def _hold(self, array: _Array, name: str, size: int) -> None:
        """Hold the bytes that a variable states to have against those of the file."""
        if size > (DEFLATE_RATIO if array.packed else 1) * array.size:
            raise CorruptFileError(
                f"variable {name!r} states more than it can hold", path=self.path, place=f"byte {array.at}",
                expected=f"{size} bytes", found=f"{array.size} stored",
            )  # fmt: skip
        self._unpacked += size
        if self._unpacked > most_unpacked(self.size):
            raise ReadError(
                f"the file unpacks to more than {most_unpacked(self.size) / 1e6:.0f} MB", path=self.path,
                place=f"variable {name!r}", remedy="save fewer variables, or with -v6, if this is right",
            )  # fmt: skip

    def _take_fields(self, array: _Array, content: bytearray, at: int, name: str, depth: int) -> None:
        """Take the fields of one structure, whose names and values stand behind its own name, at `at`."""
        _, length_at, _, at = _tag(content, at, self.order)
        _, names_at, names_size, at = _tag(content, at, self.order)
        length = struct.unpack_from(f"{self.order}i", content, length_at)[0]
        if not 0 < length <= 64 or names_size > len(content):
            raise ValueError(f"{name!r}: {names_size} bytes of names of {length}")
        for first in range(names_at, names_at + names_size, length):
            field = f"{name}.{content[first : first + length].split(bytes(1))[0].decode('latin-1')}"
            _, data_at, size, following = _tag(content, at, self.order)
            if data_at + size > len(content):
                raise ValueError(f"{field!r} ends early")
            if size:
                inner = content[at : data_at + size]
                self.take(replace(array, begin=array.begin + at), inner, field, depth + 1)
            at = following


def _tag(content: bytearray, at: int, order: str) -> tuple[int, int, int, int]:
    """Read a tag: type, place and size of its data, place of the next element."""
    first, size = struct.unpack_from(f"{order}II", content, at)
    if first >> 16:
        size = first >> 16
        if size > 4:
            raise ValueError(f"a small element of {size} bytes")
        return first & 0xFFFF, at + 4, size, at + 8
    return first, at + 8, size, at + 8 + (size + 7) // 8 * 8


def _load(
    array: _Array, name: str, data_at: int, stored: np.dtype[Any], dtype: np.dtype[Any], start: int, stop: int
) -> NDArray[Any]:
    begin, size = data_at + start * stored.itemsize, (stop - start) * stored.itemsize
    with map_to_corrupt_file(array.path, WHOLE):
        content = array.read(begin, size)
        if len(content) < size:
            raise CorruptFileError(
                f"variable {name!r} ends early", path=array.path, place=f"byte {array.at}",
                expected=f"{begin + size} bytes inflated", found=f"{begin + len(content)}",
            )  # fmt: skip
    return np.frombuffer(content, stored).astype(dtype, copy=False)


def _part(whole: Callable[[], NDArray[Any]], start: int, stop: int) -> NDArray[Any]:
    return whole()[start:stop].copy()
