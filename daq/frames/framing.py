"""What a declared framing is: how frames are cut out of a byte stream, and what is in them."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from daq.frames.checksum import Checksum

TYPE_SIZES = MappingProxyType(
    {"u8": 1, "i8": 1, "u16": 2, "i16": 2, "u24": 3, "i24": 3, "u32": 4, "i32": 4, "f32": 4, "f64": 8}
)
"""Bytes of the binary types of a field: unsigned, signed and IEEE 754 numbers."""

DEFAULT_MAX = 1024
"""Longest frame or line where a framing states none."""


@dataclass(frozen=True)
class Field:
    """One number of a frame.

    Attributes
    ----------
    name : str
    at : int
        Byte from the frame's first, from an element's data in a frame of elements, or the number of
        the cell in a line of text.
    type : str
        A key of `TYPE_SIZES`; ``text`` in a line.
    big_endian : bool
    scale, offset : float
        ``value = scale * raw + offset``.
    unit : str
    element : int or None
        Identifier of the element that holds it, in a frame of elements.
    """

    name: str
    at: int
    type: str
    big_endian: bool = False
    scale: float = 1.0
    offset: float = 0.0
    unit: str = ""
    element: int | None = None

    @property
    def size(self) -> int:
        """Bytes of a binary field; 0 in a line."""
        return TYPE_SIZES.get(self.type, 0)


@dataclass(frozen=True)
class Selector:
    """Which frames a frame type is: those that hold given bytes, or a given cell, at a place."""

    at: int
    equals: bytes


@dataclass(frozen=True)
class Elements:
    """How the elements of a frame follow each other, each with an identifier and a length.

    Attributes
    ----------
    start : int
        Byte of the frame where the first begins; they end at the checksum.
    length_type, id_type : str
        ``u8`` or ``u16``.
    length_includes : int
        Bytes of the element's head that its length counts along.
    id_first : bool
    big_endian : bool
    """

    start: int
    length_type: str
    id_type: str
    length_includes: int = 0
    id_first: bool = False
    big_endian: bool = True


@dataclass(frozen=True)
class FrameType:
    """One kind of frame in a stream: how it is recognised, and its fields."""

    fields: tuple[Field, ...]
    when: Selector | None = None
    elements: Elements | None = None


@dataclass(frozen=True)
class Length:
    """How long a frame is: fixed, or a field of it plus a constant; all bytes counted."""

    fixed: int | None = None
    at: int = 0
    type: str = "u8"
    big_endian: bool = False
    add: int = 0

    @property
    def head(self) -> int:
        """Bytes that must be there before the length is known."""
        return 0 if self.fixed is not None else self.at + TYPE_SIZES[self.type]

    def of(self, head: bytes | bytearray, start: int = 0) -> int:
        """Return the length of the frame that begins at a byte."""
        if self.fixed is not None:
            return self.fixed
        place = start + self.at
        return (
            int.from_bytes(head[place : place + TYPE_SIZES[self.type]], "big" if self.big_endian else "little")
            + self.add
        )


@dataclass(frozen=True)
class ChecksumField:
    """A frame's last bytes: the checksum of those from ``start`` up to it."""

    algorithm: Checksum
    start: int
    big_endian: bool = False

    @property
    def size(self) -> int:
        """Bytes of the field."""
        return self.algorithm.size

    def holds(self, frame: bytes) -> bool:
        """Tell whether a frame's checksum is right."""
        stated = int.from_bytes(frame[-self.size :], "big" if self.big_endian else "little")
        return self.algorithm.of(frame[self.start : -self.size]) == stated


@dataclass(frozen=True)
class PacketCounter:
    """The field that counts frames, from 0 to ``modulo - 1``."""

    field: str
    modulo: int


@dataclass(frozen=True)
class DeviceTime:
    """The field that holds the device's own time, in ticks, which wraps at ``modulo`` if it is not 0."""

    field: str
    tick_s: float
    modulo: int = 0


@dataclass(frozen=True)
class Framing:
    """How to find frames in a byte stream, and what they hold.

    Attributes
    ----------
    kind : str
        ``sync`` or ``delimiter``.
    types : tuple of FrameType
    sync : bytes
        What every frame begins with, of kind ``sync``.
    length : Length
    maximum : int
        Longest frame or line in bytes: a longer one is damage.
    checksum : ChecksumField or None
    delimiter, start, comment : bytes
        What ends a line; what it begins with, and what marks a comment, each empty if nothing does.
    separator : str
        Between the cells of a line.
    counter : PacketCounter or None
    device_time : DeviceTime or None
    baudrate : float
        Of the port, to date frames back; 0 if not declared.
    rate_hz : float
        Of the frames that hold samples; 0 if not declared.
    """

    kind: str
    types: tuple[FrameType, ...]
    sync: bytes = b""
    length: Length = Length(fixed=1)
    maximum: int = DEFAULT_MAX
    checksum: ChecksumField | None = None
    delimiter: bytes = b"\n"
    start: bytes = b""
    comment: bytes = b""
    separator: str = ","
    counter: PacketCounter | None = None
    device_time: DeviceTime | None = None
    baudrate: float = 0.0
    rate_hz: float = 0.0

    @property
    def fields(self) -> tuple[Field, ...]:
        """All fields of all frame types."""
        return tuple(field for frame_type in self.types for field in frame_type.fields)

    def type_of(self, frame: bytes) -> FrameType | None:
        """Return the first type whose selector fits a frame, or None."""
        for frame_type in self.types:
            when = frame_type.when
            if when is None:
                return frame_type
            if self.kind == "delimiter":
                cells = frame.split(self.separator.encode())
                if when.at < len(cells) and cells[when.at].strip() == when.equals:
                    return frame_type
            elif frame[when.at : when.at + len(when.equals)] == when.equals:
                return frame_type
        return None
