"""Signals out of CAN frames, for whole arrays at once.

A signal is a run of bits. Counted from its least significant bit, bit k of a little-endian
(Intel) signal that starts at bit s lies in byte ``(s + k) // 8``; a big-endian (Motorola) signal runs
through the bytes the other way. Both are cut into pieces within one byte, so that a signal of 16 bits
takes a few array operations. The numbering is that of the DBC format.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.can.parameter_groups import is_j1939
from recoil_acquisition.readers.statements import last_of_all

UInt64Array = NDArray[np.uint64]

_WORD = 8
_RESERVED = 0xFB
_KINDS = ((0xFF, "not available, "), (0xFE, "error, "), (_RESERVED, "reserved, "))
"""Least highest byte of the numbers of SAE J1939-71 that are no measurement, and what they are."""
_ROWS = 16384
"""Frames that are decoded at once: they stay in the processor's cache."""


@dataclass(frozen=True)
class BitRun:
    """A run of a signal's bits within one byte.

    Attributes
    ----------
    shift
        Bits of the byte below the run.
    count
        Bits of the run.
    place
        Place of the run's lowest bit in the signal.
    """

    byte: int
    shift: int
    count: int
    place: int


def bit_runs_of(start: int, length: int, *, little_endian: bool) -> tuple[BitRun, ...]:
    """Cut a signal into pieces within one byte, the least significant first.

    Parameters
    ----------
    start
        Number of the first bit as in a DBC file: the least significant bit of a little-endian signal, the most
        significant of a big-endian one; bit b of byte n has number 8 n + b.
    length
        Bits of the signal.
    """
    if little_endian:
        places = [start + k for k in range(length)]
    else:
        first = 8 * (start // 8) + 7 - start % 8
        places = [8 * (p // 8) + 7 - p % 8 for p in range(first + length - 1, first - 1, -1)]
    pieces: list[BitRun] = []
    for k, place in enumerate(places):
        byte, bit = divmod(place, 8)
        last = pieces[-1] if pieces else None
        if last is not None and last.byte == byte and last.shift + last.count == bit:
            pieces[-1] = BitRun(byte, last.shift, last.count + 1, last.place)
        else:
            pieces.append(BitRun(byte, bit, 1, k))
    return tuple(pieces)


def gather(data: NDArray[np.uint8], pieces: tuple[BitRun, ...]) -> UInt64Array:
    """Put a signal's bits together: out of one word of eight bytes where they fit in, else piece by piece.

    Parameters
    ----------
    data : ndarray of uint8, shape (n_frames, width)
    pieces
        Runs of the signal's bits, within the width.

    Returns
    -------
    ndarray of uint64, shape (n_frames,)
    """
    lowest = pieces[0]
    first = min(piece.byte for piece in pieces)
    if data.shape[1] >= _WORD and max(piece.byte for piece in pieces) - first < _WORD and data.strides[1] == 1:
        begin = min(first, data.shape[1] - _WORD)
        little_endian = lowest.byte <= pieces[-1].byte
        words = data[:, begin : begin + _WORD].view("<u8" if little_endian else ">u8")[:, 0]
        below = 8 * (lowest.byte - begin if little_endian else begin + _WORD - 1 - lowest.byte) + lowest.shift
        length = pieces[-1].place + pieces[-1].count
        return (words >> np.uint64(below)) & np.uint64((1 << length) - 1)
    value = np.zeros(len(data), dtype=np.uint64)
    for piece in pieces:
        bits = (data[:, piece.byte] >> np.uint8(piece.shift)) & np.uint8((1 << piece.count) - 1)
        value |= bits.astype(np.uint64) << np.uint64(piece.place)
    return value


@dataclass(frozen=True, eq=False)
class SignalLayout:
    """Place and meaning of a signal's bits.

    Attributes
    ----------
    kind
        Kind of the stored number: ``unsigned``, ``signed`` or ``float``.
    scale, offset
        Numbers of ``value = scale * raw + offset``.
    multiplexer
        Name of the signal that says when this one is in the frame; empty if it always is.
    multiplexer_ranges
        Ranges of values of the multiplexer with which the signal is in the frame.
    raw_limits
        Least and largest stored number of the database's range; None where it states none.
    codes
        Stored numbers that are no measurement, from and to, and what they are called.
    comment
        Comment of the database; empty where it has none.
    """

    name: str
    unit: str
    pieces: tuple[BitRun, ...]
    length: int
    kind: str
    scale: float
    offset: float
    multiplexer: str
    multiplexer_ranges: tuple[range, ...]
    raw_limits: tuple[int, int] | None = None
    codes: tuple[tuple[int, int, str], ...] = ()
    comment: str = ""

    @property
    def bytes_needed(self) -> int:
        """Bytes that a frame must have to hold the signal."""
        return max(piece.byte for piece in self.pieces) + 1

    def raw(self, data: NDArray[np.uint8]) -> NDArray[Any]:
        """Return the stored numbers of frames that are long enough, shape (n_frames,)."""
        bits = gather(data, self.pieces)
        if self.kind == "float":
            unsigned = {16: np.uint16, 32: np.uint32, 64: np.uint64}[self.length]
            return bits.astype(unsigned).view({16: np.float16, 32: np.float32, 64: np.float64}[self.length])
        if self.kind == "signed":
            unused = np.uint64(64 - self.length)
            return (bits << unused).view(np.int64) >> unused.astype(np.int64)
        return bits

    def decode(self, data: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return the values of frames that are long enough, shape (n_frames,); NaN where a code stands for one."""
        values = np.empty(len(data), dtype=np.float64)
        for at in range(0, len(data), _ROWS):
            raw = self.raw(data[at : at + _ROWS])
            if raw.dtype == np.uint64 and self.length < 64:
                raw = raw.view(np.int64)  # processors convert signed integers faster
            part = values[at : at + _ROWS]
            part[:] = raw
            part *= self.scale
            part += self.offset
            for low, high, _ in self.codes:
                part[(raw >= low) & (raw <= high)] = np.nan
        return values

    def remarkable(self, data: NDArray[np.uint8]) -> tuple[dict[str, int], int]:
        """Count what is no measurement, or beyond what the database says, of frames that are long enough.

        Returns
        -------
        codes
            How many frames hold each code, by what it is called.
        outside
            How many hold another number outside of the database's range.
        """
        if self.raw_limits is None and not self.codes:
            return {}, 0
        raw = self.raw(data)
        outside = np.zeros(raw.size, dtype=bool)
        if self.raw_limits is not None:
            outside = (raw < self.raw_limits[0]) | (raw > self.raw_limits[1])
        found: dict[str, int] = {}
        counted = np.zeros(raw.size, dtype=bool)
        for low, high, called in self.codes:
            held = (raw >= low) & (raw <= high) & ~counted
            counted |= held
            outside &= ~held
            if held.any():
                found[called] = found.get(called, 0) + int(np.count_nonzero(held))
        return found, int(np.count_nonzero(outside))


_OF_CODES = frozenset({"gensigsna", "gensiginvalidvalue", "gensigerrorvalue"})
"""Attributes of a signal, in small letters, whose value is a stored number that is no measurement."""


def layout_of(signal: Any, *, is_j1939: bool = False) -> SignalLayout | None:
    """Take a signal's layout from a parsed database; values of its multiplexer may be there as ranges.

    Parameters
    ----------
    is_j1939
        Whether its message is one of SAE J1939.

    Returns
    -------
    SignalLayout or None
        Layout of the signal; None if it has none that is a number: over 64 bits, or a float of another size.
    """
    if not 1 <= signal.length <= 64 or (signal.is_float and signal.length not in (16, 32, 64)):
        return None
    limits = None if signal.is_float else _raw_limits(signal)
    return SignalLayout(
        name=signal.name,
        unit=signal.unit or "",
        pieces=bit_runs_of(signal.start, signal.length, little_endian=signal.byte_order == "little_endian"),
        length=signal.length,
        kind="float" if signal.is_float else "signed" if signal.is_signed else "unsigned",
        scale=float(signal.scale),
        offset=float(signal.offset),
        multiplexer=signal.multiplexer_signal or "",
        multiplexer_ranges=tuple(
            one if isinstance(one, range) else range(one, one + 1) for one in signal.multiplexer_ids or ()
        ),
        raw_limits=limits,
        codes=() if signal.is_float else _codes(signal, limits, is_j1939=is_j1939),
        comment=str(signal.comment or ""),
    )


def _raw_limits(signal: Any) -> tuple[int, int] | None:
    """Return the stored numbers of a database's least and largest value; None where it states no range."""
    if signal.minimum is None or signal.maximum is None or not signal.minimum < signal.maximum or not signal.scale:
        return None
    ends = [(float(end) - float(signal.offset)) / float(signal.scale) for end in (signal.minimum, signal.maximum)]
    if not all(math.isfinite(end) for end in ends):
        return None
    low, high = sorted(round(end) for end in ends)
    return low, high


def _codes(signal: Any, limits: tuple[int, int] | None, *, is_j1939: bool) -> tuple[tuple[int, int, str], ...]:
    """Return the stored numbers that are no measurement: named by the database, or of a standard, beyond its range.

    A number that the database names and has in its range is one that may be measured, such as a gear. Where it states
    no range, names of the largest numbers alone, and of the smallest below 0, are those of codes. Beyond the range SAE
    J1939-71 has the largest numbers for what is not available, in error, or reserved, from FB in the highest byte on,
    and NMEA 2000 the three largest. A message of J1939 has them where the database states no range, too.
    What an attribute names is one wherever it lies.
    """
    attributed = [(raw, raw, f"{raw} {name!r}") for raw, name in _as_stored(signal, _attributed(signal)).items()]
    return (*attributed, *_of_names(signal, limits, is_j1939=is_j1939))


def _of_names(signal: Any, limits: tuple[int, int] | None, *, is_j1939: bool) -> tuple[tuple[int, int, str], ...]:
    """Return the codes that the database's names or a standard tell, see `_codes`."""
    length = int(signal.length)
    least, most = _ends(signal)
    named = _as_stored(signal, {int(raw): str(name) for raw, name in (signal.choices or {}).items()})
    has_ranges = length % 8 == 0 and not signal.is_signed
    if limits is None and is_j1939 and has_ranges:
        limits = 0, (_RESERVED << length - 8) - 1
    if limits is None:
        named = last_of_all(named, least, most)
        return tuple((raw, raw, f"{raw} {name!r}") for raw, name in named.items())
    low, high = limits
    codes = [(raw, raw, f"{raw} {name!r}") for raw, name in named.items() if not low <= raw <= high]
    reserved = 5 << length - 8 if has_ranges else 3 if length >= 8 else 1
    begin = max(most - reserved + 1, high + 1)
    taken = sorted(raw for raw in named if begin <= raw <= most)
    for first, stop in itertools.pairwise([begin - 1, *taken, most + 1]):
        if stop - first > 1:
            codes += _unnamed(first + 1, stop - 1, length, is_j1939=is_j1939 and has_ranges)
    return tuple(codes)


def _ends(signal: Any) -> tuple[int, int]:
    """Return the smallest and the largest number that a signal can store."""
    length = int(signal.length)
    return (-(1 << length - 1), (1 << length - 1) - 1) if signal.is_signed else (0, (1 << length) - 1)


def _as_stored(signal: Any, named: Mapping[int, str]) -> dict[int, str]:
    """Return the names of numbers that a signal can store; some tools write signed ones as they stand in the frame."""
    least, most = _ends(signal)
    beyond = 1 << int(signal.length)
    signed = {(raw - beyond if most < raw < -2 * least else raw): name for raw, name in named.items()}
    return {raw: name for raw, name in signed.items() if least <= raw <= most}


def _attributed(signal: Any) -> dict[int, str]:
    """Return the stored numbers that an attribute of the database says to be no measurement, whatever its range."""
    attributes = getattr(getattr(signal, "dbc", None), "attributes", None) or {}
    found = {}
    for name, one in attributes.items():
        if str(name).casefold() in _OF_CODES:
            with suppress(ValueError):
                found[int(str(one.value).strip(), 0)] = str(name)
    return found


def _unnamed(low: int, high: int, length: int, *, is_j1939: bool) -> Iterator[tuple[int, int, str]]:
    """Yield codes that the database does not name: those of J1939 by their kind."""
    for begin, kind in _KINDS if is_j1939 else ((0, ""),):
        first = max(low, begin << max(length - 8, 0))
        if first <= high:
            yield first, high, f"{kind}{_hexadecimal(first, length)} and above"
            high = first - 1


def _hexadecimal(raw: int, length: int) -> str:
    return f"0x{raw:0{-(-length // 4)}X}"


def told_apart(names: Sequence[str]) -> list[str]:
    """Give each of some names one of its own: the second of one name ends in ``#2``, as in tables of text."""
    taken, own = set(names), []
    so_far = Counter[str]()
    for name in names:
        so_far[name] += 1
        number = so_far[name]
        while number > 1 and f"{name}#{number}" in taken:
            number += 1
        own.append(name if number == 1 else f"{name}#{number}")
        taken.add(own[-1])
    return own


def layouts_of(message: Any) -> dict[str, SignalLayout]:
    """Take the layouts of all signals of a message that are decoded, by their names."""
    of_group = is_j1939(message)
    found = {signal.name: layout_of(signal, is_j1939=of_group) for signal in message.signals}
    return {name: layout for name, layout in found.items() if layout is not None}


def present(
    layout: SignalLayout, layouts: dict[str, SignalLayout], data: NDArray[np.uint8], length: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return which frames hold a signal, by its multiplexer and the multiplexer's own, shape (n_frames,).

    Parameters
    ----------
    layouts
        Layouts of all signals of the message.
    data : ndarray of uint8, shape (n_frames, width)
    length : ndarray of int64, shape (n_frames,)
    """
    everywhere = np.ones(len(data), dtype=bool)
    if not layout.multiplexer or layout.multiplexer not in layouts:
        return everywhere
    multiplexer = layouts[layout.multiplexer]
    if multiplexer.bytes_needed > data.shape[1]:
        return ~everywhere
    raw, chosen = multiplexer.raw(data), ~everywhere
    for one in layout.multiplexer_ranges:
        chosen |= (raw >= one.start) & (raw < one.stop)
    chosen &= length >= multiplexer.bytes_needed
    return chosen & present(multiplexer, layouts, data, length)
