"""Checksums of serial protocols.

Each is given with the value it returns for the nine bytes ``123456789``, the customary check.
CRCs are table driven (D. V. Sarwate, Communications of the ACM 31(8), 1988); their parameters are
those of the catalogue by G. Cook, in the notation of the Rocksoft model.
"""

from __future__ import annotations

import binascii
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import accumulate
from operator import xor
from types import MappingProxyType

import numpy as np

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
    """

    name: str
    size: int
    check: int
    of: Callable[[bytes], int]


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
    def table(self) -> list[int]:
        """Remainders of the 256 bytes."""
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
        return table

    def of(self, data: bytes) -> int:
        """Return the remainder of bytes."""
        value, table, shift, mask = self.initial, self.table, self.width - 8, (1 << self.width) - 1
        if self.reflected:
            for byte in data:
                value = value >> 8 ^ table[(value ^ byte) & 0xFF]
        else:
            for byte in data:
                value = value << 8 & mask ^ table[value >> shift ^ byte]
        return value ^ self.final


def _xor8(data: bytes) -> int:
    if len(data) < _SHORT:
        return reduce(xor, data, 0)
    return int(np.bitwise_xor.reduce(np.frombuffer(data, dtype=np.uint8), initial=0))


def _sum8(data: bytes) -> int:
    return sum(data) & 0xFF


def _negative_sum8(data: bytes) -> int:
    return -sum(data) & 0xFF


def _fletcher16(data: bytes) -> int:
    return (sum(data) & 0xFF) << 8 | sum(accumulate(data)) & 0xFF


_REVERSED_BITS = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def _crc_kermit(data: bytes) -> int:
    """Take the remainder that is not reflected, of bytes with their bits reversed, and reverse it."""
    value = binascii.crc_hqx(data.translate(_REVERSED_BITS), 0)
    return _REVERSED_BITS[value & 0xFF] << 8 | _REVERSED_BITS[value >> 8]


CHECKSUMS = MappingProxyType(
    {
        c.name: c
        for c in (
            # exclusive or of all bytes, as in NMEA 0183
            Checksum("xor8", 1, 0x31, _xor8),
            # sum of all bytes modulo 256
            Checksum("sum8", 1, 0xDD, _sum8),
            # what brings the sum of all bytes to a multiple of 256, as in Xsens Xbus
            Checksum("neg-sum8", 1, 0x23, _negative_sum8),
            # two sums modulo 256, the plain one in the high byte, as in MicroStrain MIP
            Checksum("fletcher16", 2, 0xDD15, _fletcher16),
            Checksum("crc8", 1, 0xF4, Crc(8, 0x07, 0x00, 0x00, reflected=False).of),
            Checksum("crc16-modbus", 2, 0x4B37, Crc(16, 0x8005, 0xFFFF, 0x0000, reflected=True).of),
            Checksum("crc16-xmodem", 2, 0x31C3, lambda d: binascii.crc_hqx(d, 0)),
            Checksum("crc16-ccitt-false", 2, 0x29B1, lambda d: binascii.crc_hqx(d, 0xFFFF)),
            Checksum("crc16-kermit", 2, 0x2189, _crc_kermit),
            Checksum("crc32", 4, 0xCBF43926, zlib.crc32),
        )
    }
)
"""Checksums by the names that they have in a framing."""
