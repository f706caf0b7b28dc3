"""MATLAB files of version 5 to 7 (``-v6``, ``-v7``), read element by element.

Only arrays of real numbers and texts are read. Cells, structures, objects and function handles are
named by their class and skipped: nothing in a file is ever made into an object. Every size is held
against the bytes that are there, and a compressed variable is inflated no further than its array needs.

Layout: MathWorks, *MAT-File Format* (Level 5 MAT-Files: header, data elements, small data elements,
``miMATRIX`` sub-elements, ``miCOMPRESSED``).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
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
    STRUCTURE,
    MatContents,
    MatVariable,
    array_reason,
)
from recoil_acquisition.readers.recording import map_to_corrupt_file

HEADER_BYTES = 128
MATRIX, COMPRESSED = 14, 15
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""numpy's type of each ``mi`` type of numbers."""
CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
"""numpy's type of each ``mx`` class of numbers."""
OTHER_CLASSES = {
    1: CELL, 2: STRUCTURE, 3: "an object: save what it holds as vectors", 5: "a sparse array: save it as full vectors",
    16: "a function handle",
}  # fmt: skip
OPAQUE = 17
CHARACTERS = 4
COMPLEX = 0x0800
TEXT_ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
START_BYTES = 8192
"""Bytes of each variable that are read first, enough for its class, shape and name, and for a scalar or a text."""
PIECE_BYTES = 1 << 18
"""Bytes that are read, and inflated, at a time."""
WHOLE = "a whole MATLAB file of version 5"


def is_mat_v5(head: bytes) -> bool:
    """Return whether a file begins with the header of a Level 5 MAT-file."""
    return (
        len(head) >= HEADER_BYTES
        and head[124:128] in (b"\x00\x01IM", b"\x01\x00MI")
        and all(byte >= 9 for byte in head[:4])
    )


@dataclass(frozen=True)
class _Element:
    """One variable: where its bytes are, and whether they are compressed."""

    at: int
    size: int
    compressed: bool


@dataclass(frozen=True)
class _Array:
    """The head of one array; `data_at` and `data_size` count from the start of its element's content."""

    name: str
    kind: int
    is_complex: bool
    shape: tuple[int, ...]
    data_type: int
    data_at: int
    data_size: int
    small: bytes = b""


def read_mat_v5(path: Path) -> MatContents:
    """List the variables of a file; the numbers of vectors are not read.

    Raises
    ------
    ReadError
        If it unpacks to more than a recording does.
    CorruptFileError
        If it contradicts its format.
    """
    size = path.stat().st_size
    vectors: list[MatVariable] = []
    scalars: dict[str, float] = {}
    texts: dict[str, str] = {}
    left_out: dict[str, str] = {}
    incomplete = ""
    unpacked = 0
    with map_to_corrupt_file(path, WHOLE), path.open("rb") as file:
        head = file.read(HEADER_BYTES)
        if not is_mat_v5(head):
            raise CorruptFileError("no header of a MATLAB file", path=path, place="byte 124", expected="IM or MI")
        order = "<" if head[126:128] == b"IM" else ">"
        at = HEADER_BYTES
        while at < size:
            file.seek(at)
            tag = file.read(8)
            kind, length = struct.unpack(f"{order}II", tag) if len(tag) == 8 else (0, 0)
            if len(tag) < 8 or at + 8 + length > size:
                incomplete = f"the variable at byte {at} is cut off: {len(vectors)} before it were read"
                break
            if kind not in (MATRIX, COMPRESSED):
                raise CorruptFileError(
                    "no variable",
                    path=path,
                    place=f"byte {at}",
                    expected="an element of type 14 or 15",
                    found=f"{kind}",
                )
            element = _Element(at + 8, length, kind == COMPRESSED)
            # Only whole elements of 8 bytes stand uncompressed; compressed ones are not padded
            at += 8 + length
            content = _content(file, element, 0, START_BYTES)
            if element.compressed:
                inner, stated = struct.unpack_from(f"{order}II", content)
                if inner != MATRIX:
                    left_out[f"the element at byte {element.at}"] = f"type {inner}"
                    continue
            else:
                stated = length
            array = _array(content[8 * element.compressed :], order, stated)
            if isinstance(array, tuple):
                left_out |= [array]
                continue
            _sort(path, element, array, order, vectors, scalars, texts, left_out)
            unpacked += array.data_size
            if unpacked > most_unpacked(size):
                raise ReadError(
                    f"the file unpacks to more than {most_unpacked(size) / 1e6:.0f} MB", path=path,
                    place=f"variable {array.name!r}", remedy="save fewer variables, or with -v6, if this is right",
                )  # fmt: skip
    text = head[:116].decode("latin-1").rstrip("\0 ")
    return MatContents("5", text, tuple(vectors), scalars, texts, left_out, incomplete)


def _sort(
    path: Path, element: _Element, array: _Array, order: str,
    vectors: list[MatVariable], scalars: dict[str, float], texts: dict[str, str], left_out: dict[str, str],
) -> None:  # fmt: skip
    count = prod(array.shape)
    if array.kind == CHARACTERS:
        if array.data_type in TEXT_ENCODINGS and count <= LONGEST_TEXT and (array.small or not count):
            width = "" if array.data_type in (1, 2, 16) else ("-le" if order == "<" else "-be")
            # Two-byte characters are also stored under the type of plain integers
            texts[array.name] = array.small.decode(TEXT_ENCODINGS[array.data_type] + width, "replace")
        else:
            left_out[array.name] = f"a text of {count} characters"
        return
    long = [n for n in array.shape if n != 1]
    if array.is_complex or len(long) > 1 or not count:
        left_out[array.name] = "complex" if array.is_complex else array_reason(array.shape)
        return
    stored = np.dtype(order + NUMBERS[array.data_type])
    if stored.itemsize * count != array.data_size:
        raise CorruptFileError(
            f"variable {array.name!r} contradicts itself", path=path, place=f"byte {element.at}",
            expected=f"{count} numbers of {stored.itemsize} bytes", found=f"{array.data_size} bytes",
        )  # fmt: skip
    if array.data_size > (DEFLATE_RATIO if element.compressed else 1) * element.size:
        raise CorruptFileError(
            f"variable {array.name!r} states more than it can hold", path=path, place=f"byte {element.at}",
            expected=f"{array.data_size} bytes", found=f"{element.size} stored",
        )  # fmt: skip
    dtype = np.dtype(CLASSES[array.kind])
    if count == 1:
        scalars[array.name] = float(np.frombuffer(array.small, stored, 1)[0])
        return
    vectors.append(MatVariable(array.name, count, dtype, partial(_load, path, element, array, stored, dtype)))


def _content(file: BufferedReader, element: _Element, begin: int, size: int) -> bytearray:
    """Return bytes of an element's content from one on, inflated if need be; fewer if it ends before."""
    if not element.compressed:
        content = bytearray(max(min(size, element.size - begin), 0))
        file.seek(element.at + begin)
        del content[file.readinto(content) :]
        return content
    content, have = bytearray(size), -begin
    for piece in _inflated(file, element):
        wanted = piece[max(-have, 0) : size - have]
        content[max(have, 0) : max(have, 0) + len(wanted)] = wanted
        have += len(piece)
        if have >= size:
            break
    del content[max(have, 0) :]
    return content


def _inflated(file: BufferedReader, element: _Element) -> Iterator[bytes]:
    file.seek(element.at)
    inflate, left = zlib.decompressobj(), element.size
    while left and not inflate.eof and (block := file.read(min(left, PIECE_BYTES))):
        left -= len(block)
        while block and not inflate.eof:
            yield inflate.decompress(block, PIECE_BYTES)
            block = inflate.unconsumed_tail


def _array(content: bytearray, order: str, stated: int) -> _Array | tuple[str, str]:
    """Read the head of an array; or name it, and say why it is none of numbers or text."""
    flags_type, flags_at, flags_size, at = _tag(content, 0, order)
    if flags_type != 6 or flags_size != 8:
        raise ValueError(f"array flags of type {flags_type}, {flags_size} bytes")
    flags = struct.unpack_from(f"{order}I", content, flags_at)[0]
    kind = flags & 0xFF
    if kind == OPAQUE:
        return "an object", "of a class: save what it holds as vectors"
    dims_type, dims_at, dims_size, at = _tag(content, at, order)
    if dims_type != 5 or not 8 <= dims_size <= 256 or dims_size % 4:
        raise ValueError(f"dimensions of type {dims_type}, {dims_size} bytes")
    shape = struct.unpack_from(f"{order}{dims_size // 4}i", content, dims_at)
    if min(shape) < 0:
        raise ValueError(f"shape {shape}")
    name_type, name_at, name_size, at = _tag(content, at, order)
    if name_type != 1 or name_size > 4096:
        raise ValueError(f"a name of type {name_type}, {name_size} bytes")
    name = content[name_at : name_at + name_size].decode("latin-1")
    if kind != CHARACTERS and kind not in CLASSES:
        return name, OTHER_CLASSES.get(kind, f"class {kind}").format(name=name)
    if prod(shape) == 0:
        return name, "empty"
    data_type, data_at, data_size, _ = _tag(content, at, order)
    if kind in CLASSES and data_type not in NUMBERS:
        raise ValueError(f"numbers of type {data_type} in {name!r}")
    if data_at + data_size > stated:
        raise ValueError(f"{name!r}: {data_size} bytes at {data_at} of {stated}")
    small = bytes(content[data_at : data_at + data_size]) if data_size <= 4 * LONGEST_TEXT else b""
    if small and len(small) < data_size:
        raise ValueError(f"{name!r} ends early")
    return _Array(name, kind, bool(flags & COMPLEX), shape, data_type, data_at, data_size, small)


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
    path: Path, element: _Element, array: _Array, stored: np.dtype[Any], dtype: np.dtype[Any], start: int, stop: int
) -> NDArray[Any]:
    begin, size = 8 * element.compressed + array.data_at + start * stored.itemsize, (stop - start) * stored.itemsize
    with map_to_corrupt_file(path, WHOLE), path.open("rb") as file:
        content = _content(file, element, begin, size)
        if len(content) < size:
            raise CorruptFileError(
                f"variable {array.name!r} ends early", path=path, place=f"byte {element.at}",
                expected=f"{begin + size} bytes inflated", found=f"{begin + len(content)}",
            )  # fmt: skip
    return np.frombuffer(content, stored).astype(dtype, copy=False)
