"""Samples in a packet of an OXYGEN recorder: what the head of each part says of them, and where their numbers stand.

The layout is that of `recoil_acquisition.streams.oxygen_stream`. A packet is mostly laid out as the one before it, with
other ticks and numbers: then its heads are compared as a whole, and taken apart once.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

PART = struct.Struct("<2I")
"""Head of a part: its size, with these bytes, and its type."""
_SYNC, _ASYNC, _TICK = struct.Struct("<3IQd"), struct.Struct("<3Id"), struct.Struct("<Q")
_AHEAD_OF_TICK, _RATE_BYTES = 12, 8
"""Bytes of a head ahead of its tick, and of the rate behind it."""
_LEAST_RATE_HZ, _MOST_RATE_HZ = 1e-6, 1e10
_MOST_TICK = 1 << 62
_NUMBERS = {
    0: "<i1", 1: "<u1", 2: "<i2", 3: "<u2", 4: "i24", 5: "u24", 6: "<i4", 7: "<u4", 8: "<i8", 9: "<u8", 10: "<f4",
    11: "<f8", 12: "<f4 complex", 13: "<f8 complex",
}  # fmt: skip
"""Types of numbers; 14 to 16 are texts, bytes and frames of a bus."""


class SamplePlace(NamedTuple):
    """Place and form of the samples of one channel in a packet.

    Attributes
    ----------
    at, row
        Place of the first number, and bytes from one sample to the next.
    length
        Number of samples.
    width, number_bytes, form
        Numbers of a sample, bytes and form of each.
    """

    at: int
    row: int
    length: int
    width: int
    number_bytes: int
    form: str


class Part(NamedTuple):
    """Samples of one channel in a packet.

    Attributes
    ----------
    place
        Place of the numbers; None where they cannot be read.
    ticks : ndarray of int64, shape (n_samples,), or None
        Tick of each sample where they have ticks of their own.
    """

    rate: Fraction
    place: SamplePlace | None
    is_complex: bool = False
    first_tick: int = 0
    ticks: NDArray[np.int64] | None = None

    @property
    def layout(self) -> tuple[Fraction, int, bool, bool]:
        """Layout, which does not change within a description."""
        return self.rate, 0 if self.place is None else self.place.width, self.is_complex, self.ticks is not None


@dataclass(frozen=True, eq=False)
class PacketShape:
    """Layout of a packet all of whose samples are of fixed rates.

    Attributes
    ----------
    size
        Size of the packet, bytes.
    places : ndarray of intp, shape (n_bytes,)
        Places of all that the heads of its parts say, but for ticks.
    said
        Bytes there.
    ticks_at
        Place of the tick of each of the `parts`.
    """

    size: int
    places: NDArray[np.intp]
    said: bytes
    ticks_at: tuple[int, ...]
    parts: tuple[Part, ...]

    def parts_of(self, packet: memoryview) -> list[Part] | None:
        """Return the samples of a packet that is laid out so; None if it is another."""
        if len(packet) != self.size or np.frombuffer(packet, np.uint8)[self.places].tobytes() != self.said:
            return None
        ticks = [_TICK.unpack_from(packet, at)[0] for at in self.ticks_at]
        if max(ticks) >= _MOST_TICK:
            return None
        return [Part(one.rate, one.place, one.is_complex, tick) for one, tick in zip(self.parts, ticks, strict=True)]


def shape_of(packet: memoryview, heads: Sequence[int], parts: Sequence[Part]) -> PacketShape | None:
    """Return how a packet is laid out; None where not all of its samples are of fixed rates.

    Parameters
    ----------
    heads
        Places at which its parts begin.
    parts
        Samples of at least one channel.
    """
    places = [one.place for one in parts if one.place is not None and one.ticks is None]
    if len(places) < len(parts):
        return None
    begins = [one.at - _SYNC.size for one in places]
    spans = [(at, at + PART.size) for at in heads]
    spans += [(at, at + _AHEAD_OF_TICK) for at in begins]
    spans += [(at + _SYNC.size - _RATE_BYTES, at + _SYNC.size) for at in begins]
    where = np.concatenate([np.arange(*span) for span in spans])
    ticks_at = tuple(at + _AHEAD_OF_TICK for at in begins)
    return PacketShape(len(packet), where, np.frombuffer(packet, np.uint8)[where].tobytes(), ticks_at, tuple(parts))


def part_of(packet: memoryview, begins: int, ends: int, kind: int) -> Part:
    """Read the head of the samples of one channel; ValueError if they are not what it says.

    Parameters
    ----------
    begins, ends
        Place of the part behind its own size and type.
    """
    if kind in (4, 6):
        raise ValueError(f"type {kind}, samples of variable size, which nobody decodes")
    head = _SYNC if kind == 3 else _ASYNC
    if ends - begins < head.size:
        raise ValueError(f"{ends - begins} bytes, too few for their head")
    code, dimension, count, *first, rate_hz = head.unpack_from(packet, begins)
    if not (math.isfinite(rate_hz) and _LEAST_RATE_HZ <= rate_hz <= _MOST_RATE_HZ):
        raise ValueError(f"{rate_hz:g} ticks per second")
    if code not in _NUMBERS:
        raise ValueError(f"numbers of type {code}, which is no number")
    if not 1 <= dimension <= 4096:
        raise ValueError(f"{dimension} numbers a sample")
    form, _, is_complex = _NUMBERS[code].partition(" ")
    width = dimension * (2 if is_complex else 1)
    size = 3 if form.endswith("24") else np.dtype(form).itemsize
    ahead = 0 if kind == 3 else 8
    row = ahead + width * size
    at = begins + head.size
    if count * row != ends - at:
        raise ValueError(f"{ends - at} bytes, where {count} samples have {count * row}")
    place, rate = SamplePlace(at + ahead, row, count, width, size, form), _exactly(rate_hz)
    if kind == 3:
        if first[0] >= _MOST_TICK:
            raise ValueError(f"tick {first[0]}")
        return Part(rate, place, bool(is_complex), first[0])
    ticks = np.ndarray((count,), "<u8", packet, at, (row,)) if count else np.zeros(0, "<u8")
    if count and int(ticks.max()) >= _MOST_TICK:
        raise ValueError(f"tick {int(ticks.max())}")
    return Part(rate, place, bool(is_complex), int(ticks[0]) if count else 0, ticks.astype(np.int64))


@lru_cache
def _exactly(rate_hz: float) -> Fraction:
    """Return a rate exactly, the same object for the same rate: comparing two of them costs nothing then."""
    return Fraction(rate_hz)


def columns_of(packet: memoryview, place: SamplePlace) -> NDArray[Any]:
    """Return the numbers of some samples, shape (length, width).

    A number of three bytes is read as one of four that begins a byte before it, and shifted down.
    """
    shape, steps, form = (place.length, place.width), (place.row, place.number_bytes), place.form
    if place.number_bytes == 3:
        return np.asarray(np.ndarray(shape, "<i4" if form == "i24" else "<u4", packet, place.at - 1, steps) >> 8)
    return np.ndarray(shape, form, packet, place.at, steps)
