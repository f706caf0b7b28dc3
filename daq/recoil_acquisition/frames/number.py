"""Binary numbers of a frame: one at a time for a stream, at many places at once for a capture."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.frames.field import Field

_FRACTION = 2.0**-32


def number_at(data: bytes, at: int, field: Field) -> float:
    """Return the raw number of a binary field whose bytes begin at a place.

    Returns
    -------
    int or float
    """
    piece = data[at : at + field.size]
    if field.type in ("f32", "f64"):
        value: float = struct.unpack((">" if field.big_endian else "<") + ("f" if field.size == 4 else "d"), piece)[0]
        return value
    order = "big" if field.big_endian else "little"
    if field.type == "fp1632":
        return int.from_bytes(piece[:4], "big") * _FRACTION + int.from_bytes(piece[4:], "big", signed=True)
    whole = int.from_bytes(piece, order, signed=field.type[0] == "i")  # type: ignore[arg-type]  # one of two literals
    if field.bits is None:
        return whole
    lowest, count = field.bits
    part = whole >> lowest & (1 << count) - 1
    return part - (1 << count) if field.type[0] == "i" and part >> (count - 1) else part


def numbers_at(buffer: bytes, begins: NDArray[np.int64], field: Field) -> NDArray[Any]:
    """Return the raw numbers of a binary field at each of some bytes of a buffer.

    Parameters
    ----------
    begins : ndarray of int64, shape (n,)
        Places of the field's first byte.

    Returns
    -------
    ndarray of int64 or float64, shape (n,)
        Numbers; a u64 beyond 63 bits becomes negative: see `Field.checked`.
    """
    data = np.frombuffer(buffer, dtype=np.uint8)
    return numbers_of(data[begins[:, None] + np.arange(field.size)], field)


def numbers_of(rows: NDArray[np.uint8], field: Field) -> NDArray[Any]:
    """Return the raw numbers of a binary field whose bytes are rows, shape (n, size) -> (n,)."""
    if field.type == "fp1632":
        fraction = np.ascontiguousarray(rows[:, :4]).view(">u4").reshape(-1)
        whole = np.ascontiguousarray(rows[:, 4:]).view(">i2").reshape(-1)
        return np.asarray(fraction * _FRACTION + whole)
    if field.type[0] == "f":
        code = f"{'>' if field.big_endian else '<'}f{field.size}"
        # a signalling NaN is damage like any other: it warns nobody here
        with np.errstate(invalid="ignore"):
            return np.ascontiguousarray(rows).view(code).reshape(-1).astype(np.float64)
    value = np.zeros(len(rows), dtype=np.int64)
    for column in (rows if field.big_endian else rows[:, ::-1]).T:
        value = value << 8 | column
    signed = field.type[0] == "i"
    width = 8 * field.size
    if field.bits is not None:
        lowest, width = field.bits
        value = value >> lowest & (1 << width) - 1
    if signed and width < 64:
        value -= (value >> (width - 1)) << width
    return value
