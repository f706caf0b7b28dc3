"""MATLAB files of version 4 (``-v4``), variable by variable.

Layout: MathWorks, *MAT-File Format* (Level 4 MAT-Files): each variable is five 32-bit integers, the type, the numbers
of rows and columns, whether there is an imaginary part, the length of the name with its zero byte; the name; the
numbers column by column. The decimal digits of the type are the byte order, zero, the type of the numbers, and whether
they are numbers, a text or a sparse matrix. Nothing stands before the first variable.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.mat.variable import LONGEST_TEXT, MOST_VARIABLES, MatContents
from recoil_acquisition.readers.recording import map_to_corrupt_file

HEADER_BYTES = 20
_NUMBERS = ("f8", "f4", "i4", "i2", "u2", "u1")
"""numpy's type by the digit of the numbers' type."""
_FULL, _TEXT = 0, 1
_LONGEST_NAME = 64
_ORDERS = {0: "<", 1: ">"}


@dataclass(frozen=True)
class _Header:
    """A variable: where its numbers begin, and what they are."""

    name: str
    stored: np.dtype[Any]
    kind: int
    shape: tuple[int, int]
    is_complex: bool
    data_at: int

    @property
    def end(self) -> int:
        return self.data_at + (1 + self.is_complex) * self.shape[0] * self.shape[1] * self.stored.itemsize


def is_mat_v4(head: bytes, size: int) -> bool:
    """Return whether a file of so many bytes begins with a sound variable of version 4."""
    try:
        return _header(head, 0).end <= size
    except ValueError:
        return False


def read_mat_v4(path: Path) -> MatContents:
    """List the variables of a file; the numbers of vectors are not read.

    Raises
    ------
    CorruptFileError
        If it contradicts its format.
    """
    contents = MatContents("4", "")
    for found in _headers(path):
        if isinstance(found, str):
            contents = replace(contents, incomplete=f"{found}: {len(contents.vectors)} before it were read")
            break
        name, count = found.name, found.shape[0] * found.shape[1]
        read = partial(_load, path, found)
        if found.kind == _TEXT:
            if count > LONGEST_TEXT or found.shape[0] > 1:
                contents.left_out[name] = f"a text of {count} characters"
            else:
                contents.texts[name] = "".join(chr(int(code) & 0xFF) for code in read(0, count))
        elif found.kind != _FULL or found.is_complex:
            contents.left_out[name] = "complex" if found.is_complex else "a sparse matrix: save it as full vectors"
        else:
            contents.take_numbers(name, found.shape, found.stored.newbyteorder("="), read)
    return contents


def _headers(path: Path) -> Iterator[_Header | str]:
    """Yield the variables one after the other; last, of a file that is cut, how that shows."""
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        for _ in range(MOST_VARIABLES):
            if at >= size:
                return
            file.seek(at)
            head = file.read(HEADER_BYTES + _LONGEST_NAME)
            if len(head) < HEADER_BYTES:
                yield f"the variable at byte {at} is cut off"
                return
            try:
                found = _header(head, at)
            except ValueError as error:
                raise CorruptFileError("no variable", path=path, place=f"byte {at}", found=str(error)) from error
            if found.end > size:
                yield f"the variable {found.name!r} at byte {at} is cut off"
                return
            yield found
            at = found.end
    raise CorruptFileError(f"more than {MOST_VARIABLES} variables", path=path)


def _header(head: bytes, at: int) -> _Header:
    """Read what stands before a variable's numbers; raises ``ValueError`` if it is none."""
    if len(head) < HEADER_BYTES:
        raise ValueError(f"{len(head)} bytes")
    for machine, order in _ORDERS.items():
        kind, rows, columns, imaginary, length = struct.unpack_from(f"{order}5i", head)
        if kind // 1000 == machine and 0 <= kind < 5000:
            break
    else:
        raise ValueError(f"the type {head[:4]!r}")
    number, content = kind % 100 // 10, kind % 10
    if kind % 1000 // 100 or number >= len(_NUMBERS) or content > 2 or imaginary not in (0, 1):
        raise ValueError(f"a variable of type {kind}, imaginary {imaginary}")
    if rows < 0 or columns < 0 or not 1 < length <= _LONGEST_NAME:
        raise ValueError(f"{rows} rows, {columns} columns, a name of {length} bytes")
    name = head[HEADER_BYTES : HEADER_BYTES + length]
    if not name.endswith(b"\0") or not name[:-1].isascii() or not name[:-1].decode().isidentifier():
        raise ValueError(f"the name {name!r}")
    return _Header(
        name[:-1].decode(), np.dtype(order + _NUMBERS[number]), content, (rows, columns), bool(imaginary),
        at + HEADER_BYTES + length,
    )  # fmt: skip


def _load(path: Path, header: _Header, start: int, stop: int) -> NDArray[Any]:
    size = (stop - start) * header.stored.itemsize
    with map_to_corrupt_file(path, "a whole MATLAB file of version 4"), path.open("rb") as file:
        file.seek(header.data_at + start * header.stored.itemsize)
        content = file.read(size)
        if len(content) < size:
            raise CorruptFileError(f"variable {header.name!r} ends early", path=path, expected=f"{size} bytes")
    return np.frombuffer(content, header.stored).astype(header.stored.newbyteorder("="))
