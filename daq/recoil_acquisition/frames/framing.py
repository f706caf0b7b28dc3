"""A declared framing: how frames are cut out of a byte stream, and what is in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property
from types import MappingProxyType
from typing import Literal

from recoil_acquisition.frames.checksum import Checksum
from recoil_acquisition.frames.field import TYPE_SIZES, Field, FrameType

DEFAULT_MAX = 1024
"""Longest frame or line where a framing states none."""

BITS_PER_BYTE = 10
"""Bits of a byte on the line: a start bit, eight data bits and a stop bit; one more with parity."""


@dataclass(frozen=True)
class Length:
    """Length of a frame, all bytes counted: fixed, a field of it plus a constant, or looked up by a field's value.

    Attributes
    ----------
    at
        Byte of the length field.
    type
        Type of the length field, a key of `recoil_acquisition.frames.field.TYPE_SIZES`.
    add
        Bytes that the field does not count.
    by_value
        Length of a frame for each value of the field; empty if the field is the length.
    """

    fixed: int | None = None
    at: int = 0
    type: str = "u8"
    big_endian: bool = False
    add: int = 0
    by_value: Mapping[int, int] = dataclass_field(default_factory=lambda: MappingProxyType({}))

    @cached_property
    def head(self) -> int:
        """Bytes that must be there before the length is known."""
        return 0 if self.fixed is not None else self.at + TYPE_SIZES[self.type]

    def of(self, head: bytes | bytearray, start: int = 0) -> int:
        """Return the length of the frame that begins at a byte; 0 for a value that has none."""
        if self.fixed is not None:
            return self.fixed
        place = start + self.at
        value = int.from_bytes(head[place : start + self.head], self._order)
        return self.by_value.get(value, 0) if self.by_value else value + self.add

    @cached_property
    def _order(self) -> Literal["big", "little"]:
        return "big" if self.big_endian else "little"


@dataclass(frozen=True)
class ChecksumField:
    """A frame's last bytes: the checksum of those from ``start`` up to it.

    Attributes
    ----------
    big_endian
        Order of the bytes; hexadecimal text always has the highest digit first.
    hexadecimal
        Whether it stands as text, two digits per byte.
    mark
        Bytes that stand before the checksum and are not covered, such as the asterisk of NMEA 0183.
    """

    algorithm: Checksum
    start: int
    big_endian: bool = False
    hexadecimal: bool = False
    mark: bytes = b""

    @cached_property
    def size(self) -> int:
        """Bytes of the field, its mark included."""
        return len(self.mark) + self.algorithm.size * (2 if self.hexadecimal else 1)

    def holds(self, frame: bytes) -> bool:
        """Return whether a frame's checksum is right."""
        covered = len(frame) - self.size
        if covered < self.start:
            return False
        if not self.hexadecimal and not self.mark:
            stated = int.from_bytes(frame[covered:], "big" if self.big_endian else "little")
            return self.algorithm.of(frame[self.start : covered]) == stated
        return frame[covered:].upper() == self.of(frame[:covered]).upper()

    def of(self, data: bytes) -> bytes:
        """Return the bytes that close a frame whose other bytes are given."""
        value = self.algorithm.of(data[self.start :])
        if self.hexadecimal:
            return self.mark + f"{value:0{2 * self.algorithm.size}X}".encode()
        return self.mark + value.to_bytes(self.algorithm.size, "big" if self.big_endian else "little")


@dataclass(frozen=True)
class PacketCounter:
    """The field that counts frames, from 0 to ``modulo - 1``, by ``step`` from frame to frame."""

    field: str
    modulo: int
    step: int = 1


@dataclass(frozen=True)
class DeviceTime:
    """The field that holds the device's own time, in ticks, which wraps at ``modulo`` if it is not 0."""

    field: str
    tick_s: float
    modulo: int = 0


@dataclass(frozen=True)
class Command:
    """Bytes for the device, checksum included, and how long to wait for it behind them."""

    data: bytes
    wait_s: float = 0.0


@dataclass(frozen=True)
class Poll:
    """A request that a device must be sent for each frame.

    Attributes
    ----------
    request
        Bytes to send, the checksum included.
    every_s
        Time from one request to the next.
    timeout_s
        Time that the reply may take.
    """

    request: bytes
    every_s: float
    timeout_s: float


@dataclass(frozen=True)
class Framing:
    """Rules to find frames in a byte stream, and the fields that they hold.

    Attributes
    ----------
    kind
        Kind of framing: ``sync``, ``fixed``, ``delimiter``, ``cobs``, ``slip`` or ``idle``.
    sync
        Bytes that every frame of kind ``sync`` begins with.
    length
        Length of a frame, of kinds ``sync`` and ``fixed``.
    maximum
        Longest frame or line in bytes, decoded: a longer one is damage.
    delimiter, start, comment
        Bytes that end a line, begin a line, and begin a comment, each empty if there are none.
    separator
        Text between the cells of a line.
    baudrate
        Bit rate of the port, to date frames back; 0 if not declared.
    bits_per_byte
        Bits of a byte on the line, start, stop and parity included.
    rate_hz
        Rate of the frames that hold samples; 0 if not declared.
    silence_s
        Silence on the line that ends what came before it: a frame of kind ``idle``, and a half frame of
        every other; 0 if none does.
    look_ahead
        Whether a frame, of kind ``sync``, is one only if the sync bytes follow it.
    only_known
        Whether a frame that no type fits is no good frame.
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
    bits_per_byte: int = BITS_PER_BYTE
    rate_hz: float = 0.0
    silence_s: float = 0.0
    look_ahead: bool = False
    only_known: bool = False
    poll: tuple[Poll, ...] = ()
    start_commands: tuple[Command, ...] = ()
    stop_commands: tuple[Command, ...] = ()

    @property
    def fields(self) -> tuple[Field, ...]:
        """All fields of all frame types."""
        return tuple(field for frame_type in self.types for field in frame_type.fields)

    @property
    def byte_s(self) -> float:
        """The time that a byte takes on the line; 0 if the baud rate is not declared."""
        return self.bits_per_byte / self.baudrate if self.baudrate else 0.0

    @property
    def trailer(self) -> int:
        """Bytes of the checksum at a frame's end."""
        return self.checksum.size if self.checksum else 0

    def closed(self, frame: bytes) -> bytes:
        """Return a frame with the checksum of its other bytes in the place of its last ones."""
        if self.checksum is None:
            return frame
        body = frame[: -self.checksum.size]
        return body + self.checksum.of(body)

    def type_of(self, frame: bytes) -> FrameType | None:
        """Return the first type whose selector fits a frame, or None."""
        cells: list[bytes] | None = None
        for frame_type in self.types:
            when = frame_type.when
            if when is None:
                return frame_type
            if self.kind == "delimiter":
                cells = frame.split(self.separator.encode()) if cells is None else cells
                if when.at < len(cells) and cells[when.at].strip() == when.equals:
                    return frame_type
            elif frame[when.at : when.at + len(when.equals)] == when.equals:
                return frame_type
        return None
