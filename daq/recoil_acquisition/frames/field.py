"""Contents of a frame: fields, the elements that hold some of them, and how kinds of frames differ."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

TYPE_SIZES = MappingProxyType(
    {
        "u8": 1,
        "i8": 1,
        "u16": 2,
        "i16": 2,
        "u24": 3,
        "i24": 3,
        "u32": 4,
        "i32": 4,
        "u64": 8,
        "i64": 8,
        "f32": 4,
        "f64": 8,
        "fp1632": 6,
    }
)
"""Bytes of the binary types of a field: unsigned and signed whole numbers, IEEE 754 numbers, and Xsens'
fixed-point number of 48 bits, whose 32 bits of fraction precede its 16 bits before the point (MT Low Level
Communication Protocol, MT0101P, section on data formats)."""


@dataclass(frozen=True)
class Field:
    """One number of a frame.

    Attributes
    ----------
    at
        Byte from the frame's first, from an element's data in a frame of elements, or the number of
        the cell in a line of text.
    type
        A key of `TYPE_SIZES`; ``text`` in a line.
    scale, offset
        Line from the stored number: ``value = scale * raw + offset``.
    element
        Identifier of the element that holds it, in a frame of elements.
    bits
        Lowest bit and number of bits of a slice of a whole number, bit 0 the least significant. A slice of
        a signed type has its sign in its highest bit.
    plausible
        Least and greatest value, scaled, that the sensor can give: a frame beyond them is no good frame.
    """

    name: str
    at: int
    type: str
    big_endian: bool = False
    scale: float = 1.0
    offset: float = 0.0
    unit: str = ""
    element: int | None = None
    bits: tuple[int, int] | None = None
    plausible: tuple[float, float] | None = None

    @property
    def size(self) -> int:
        """Bytes of a binary field; 0 in a line."""
        return TYPE_SIZES.get(self.type, 0)

    @property
    def checked(self) -> bool:
        """Whether some of its values make a frame no good frame; so does a u64 beyond 63 bits, which no raw holds."""
        return self.plausible is not None or (self.type == "u64" and self.bits is None)

    def accepts(self, raw: float) -> bool:
        """Return whether a raw value may stand in a good frame."""
        if self.type == "u64" and raw >= 2**63:
            return False
        if self.plausible is None:
            return True
        return self.plausible[0] <= float(raw) * self.scale + self.offset <= self.plausible[1]


@dataclass(frozen=True)
class Selector:
    """Frames that belong to a frame type: those that hold given bytes, or a given cell, at a place."""

    at: int
    equals: bytes


@dataclass(frozen=True)
class Elements:
    """Sequence of the elements of a frame, each with an identifier and a length.

    Attributes
    ----------
    start
        Byte of the frame where the first begins; they end at the checksum.
    length_type, id_type
        Types of length and identifier: ``u8`` or ``u16``.
    length_includes
        Bytes of the element's head that its length counts along.
    """

    start: int
    length_type: str
    id_type: str
    length_includes: int = 0
    id_first: bool = False
    big_endian: bool = True

    @property
    def head(self) -> int:
        """Bytes of an element before its data."""
        return TYPE_SIZES[self.length_type] + TYPE_SIZES[self.id_type]

    def places(self, buffer: bytes, at: int, end: int) -> list[tuple[int, int, int]]:
        """Return identifier, first byte and size of each element's data, up to the first that does not fit."""
        id_size, length_size = TYPE_SIZES[self.id_type], TYPE_SIZES[self.length_type]
        found = []
        while at + id_size + length_size <= end:
            id_at, length_at = (at, at + id_size) if self.id_first else (at + length_size, at)
            identifier = int.from_bytes(buffer[id_at : id_at + id_size], "big" if self.big_endian else "little")
            stated = int.from_bytes(buffer[length_at : length_at + length_size], "big" if self.big_endian else "little")
            size = stated - self.length_includes
            at += id_size + length_size
            if size < 0 or at + size > end:
                break
            found.append((identifier, at, size))
            at += size
        return found


@dataclass(frozen=True)
class FrameType:
    """One kind of frame in a stream: how it is recognised, and its fields."""

    fields: tuple[Field, ...]
    when: Selector | None = None
    elements: Elements | None = None
