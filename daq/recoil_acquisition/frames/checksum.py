"""Checksums of serial protocols, for one frame and for many at once.

Each is given with the value it returns for the nine bytes ``123456789``, the customary check.
CRCs are table driven (D. V. Sarwate, Communications of the ACM 31(8), 1988); their parameters are
those of the catalogue by G. Cook, in the notation of the Rocksoft model.
"""

from __future__ import annotations

import binascii
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, reduce
from itertools import accumulate
from operator import xor
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.uint8]
Sums = NDArray[np.int64]

_SHORT = 150
"""Number of bytes up to which an array combines them no quicker than one after the other."""


@dataclass(frozen=True)
class Checksum:
    """One algorithm.

    Attributes
    ----------
    size
        Bytes of its value.
    check
        Value over ``123456789``.
    of
        Value over bytes.
    of_rows
        Values over the rows of an array of bytes, shape (n_frames, n_bytes) -> (n_frames,).
    """

    name: str
    size: int
    check: int
    of: Callable[[bytes], int]
    of_rows: Callable[[Rows], Sums]


@dataclass(frozen=True)
class Crc:
    """A cyclic redundancy check whose input and output are both reflected, or neither.

    Attributes
    ----------
    width
        Number of bits: 8, 16 or 32.
    polynomial, initial, final
        Polynomial without its highest term, start value and the value the result is XORed with.
    """

    width: int
    polynomial: int
    initial: int
    final: int
    reflected: bool

    @cached_property
    def table(self) -> Sums:
        """Remainders of the 256 bytes, shape (256,)."""
        top, mask = 1 << (self.width - 1), (1 << self.width) - 1
        reversed_polynomial = int(f"{self.polynomial:0{self.width}b}"[::-1], 2)
        table = []
        for byte in range(256):
            value = byte if self.reflected else byte << (self.width - 8)
            for _ in range(8):
                if self.reflected:
                    value = value >> 1 ^ (reversed_polynomial if value & 1 else 0)
                else:
                    value = (value << 1 ^ (self.polynomial if value & top else 0)) & mask
            table.append(value)
        return np.array(table, dtype=np.int64)

    @cached_property
    def _list(self) -> list[int]:
        return [int(value) for value in self.table]

    def of(self, data: bytes) -> int:
        """Return the remainder of bytes."""
        value, table, shift, mask = self.initial, self._list, self.width - 8, (1 << self.width) - 1
        if self.reflected:
            for byte in data:
                value = value >> 8 ^ table[(value ^ byte) & 0xFF]
        else:
            for byte in data:
                value = value << 8 & mask ^ table[value >> shift ^ byte]
        return value ^ self.final

    def of_rows(self, rows: Rows) -> Sums:
        """Return the remainders of rows of bytes, shape (n_frames, n_bytes) -> (n_frames,).

        A remainder is linear over GF(2): it is the exclusive or of what each byte contributes at its place
        and of what the start value becomes over as many zeros.
        """
        count = rows.shape[1]
        contributions, starts = _by_place(self, 1 << (count - 1).bit_length() if count else 1)
        places = np.arange(count - 1, -1, -1) * 256
        value = np.bitwise_xor.reduce(contributions.take(rows + places), axis=1, initial=0)
        return np.asarray(value ^ starts[count] ^ self.final)

    def _after_zero(self, value: Sums) -> Sums:
        """Return states of the register after one more byte that is zero."""
        if self.reflected:
            return np.asarray(value >> 8 ^ self.table[value & 0xFF])
        return np.asarray(value << 8 & (1 << self.width) - 1 ^ self.table[value >> (self.width - 8)])


@lru_cache(maxsize=64)
def _by_place(crc: Crc, count: int) -> tuple[Sums, Sums]:
    """Return what each byte adds to a remainder before 0 to ``count - 1`` zeros, and the start value after zeros.

    Shapes (count * 256,) and (count + 1,).
    """
    contributions, starts = [crc.table], [np.array(crc.initial, dtype=np.int64)]
    for _ in range(count):
        contributions.append(crc._after_zero(contributions[-1]))
        starts.append(crc._after_zero(starts[-1]))
    return np.concatenate(contributions[:count]), np.array(starts)


def _xor8(data: bytes) -> int:
    if len(data) < _SHORT:
        return reduce(xor, data, 0)
    return int(np.bitwise_xor.reduce(np.frombuffer(data, dtype=np.uint8), initial=0))


def _xor8_rows(rows: Rows) -> Sums:
    return np.asarray(np.bitwise_xor.reduce(rows, axis=1, initial=0), dtype=np.int64)


def _sum8(data: bytes) -> int:
    return sum(data) & 0xFF


def _sum8_rows(rows: Rows) -> Sums:
    return np.asarray(rows.sum(axis=1, dtype=np.int64) & 0xFF)


def _negative_sum8(data: bytes) -> int:
    return -sum(data) & 0xFF


def _negative_sum8_rows(rows: Rows) -> Sums:
    return np.asarray(-rows.sum(axis=1, dtype=np.int64) & 0xFF)


def _fletcher16(data: bytes) -> int:
    return (sum(data) & 0xFF) << 8 | sum(accumulate(data)) & 0xFF


def _fletcher16_rows(rows: Rows) -> Sums:
    count = rows.shape[1]
    # sums of products of whole numbers far below 2**53: exact, and quick, in double precision
    weights = np.stack([np.ones(count), np.arange(count, 0.0, -1.0)], axis=1)
    sums = (rows.astype(np.float64) @ weights).astype(np.int64) & 0xFF
    return np.asarray(sums[:, 0] << 8 | sums[:, 1])


_REVERSED_BITS = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def _crc_kermit(data: bytes) -> int:
    """Take the remainder that is not reflected, of bytes with their bits reversed, and reverse it."""
    value = binascii.crc_hqx(data.translate(_REVERSED_BITS), 0)
    return _REVERSED_BITS[value & 0xFF] << 8 | _REVERSED_BITS[value >> 8]


def _crc(name: str, check: int, crc: Crc, of: Callable[[bytes], int] | None = None) -> Checksum:
    """Make a checksum of a CRC; ``of`` is the same remainder by the standard library, many times as fast."""
    return Checksum(name, crc.width // 8, check, of or crc.of, crc.of_rows)


CHECKSUMS = MappingProxyType(
    {
        c.name: c
        for c in (
            # exclusive or of all bytes, as in NMEA 0183
            Checksum("xor8", 1, 0x31, _xor8, _xor8_rows),
            # sum of all bytes modulo 256
            Checksum("sum8", 1, 0xDD, _sum8, _sum8_rows),
            # what brings the sum of all bytes to a multiple of 256, as in Xsens Xbus
            Checksum("neg-sum8", 1, 0x23, _negative_sum8, _negative_sum8_rows),
            # two sums modulo 256, the plain one in the high byte, as in MicroStrain MIP
            Checksum("fletcher16", 2, 0xDD15, _fletcher16, _fletcher16_rows),
            _crc("crc8", 0xF4, Crc(8, 0x07, 0x00, 0x00, reflected=False)),
            _crc("crc16-modbus", 0x4B37, Crc(16, 0x8005, 0xFFFF, 0x0000, reflected=True)),
            _crc(
                "crc16-xmodem",
                0x31C3,
                Crc(16, 0x1021, 0x0000, 0x0000, reflected=False),
                lambda d: binascii.crc_hqx(d, 0),
            ),
            _crc(
                "crc16-ccitt-false",
                0x29B1,
                Crc(16, 0x1021, 0xFFFF, 0x0000, reflected=False),
                lambda d: binascii.crc_hqx(d, 0xFFFF),
            ),
            _crc("crc16-kermit", 0x2189, Crc(16, 0x1021, 0x0000, 0x0000, reflected=True), _crc_kermit),
            _crc("crc32", 0xCBF43926, Crc(32, 0x04C11DB7, 0xFFFFFFFF, 0xFFFFFFFF, reflected=True), zlib.crc32),
        )
    }
)
"""Checksums by the names that they have in a framing."""
