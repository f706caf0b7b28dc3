"""The tables of a declared framing, as a rig file has them; `frames.declaration` makes a framing of them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from recoil_acquisition.frames.checksum import CHECKSUMS
from recoil_acquisition.frames.field import TYPE_SIZES
from recoil_acquisition.frames.framing import BITS_PER_BYTE
from recoil_acquisition.quantities.declaration import DeclaredTable, Finite, NotNegative, Positive, Text

MOST_IN_ARRAY = 1024


def _one_of(*words: str) -> BeforeValidator:
    def check(value: Any) -> Any:
        if value not in words:
            raise ValueError(f"must be one of {', '.join(words)}")
        return value

    return BeforeValidator(check)


def _from_hex(value: Any) -> bytes:
    try:
        found = bytes.fromhex(value)
    except (ValueError, TypeError):
        found = b""
    if not found:
        raise ValueError('must be bytes in hexadecimal, such as "AA 55"')
    return found


def _listed(value: Any) -> Any:
    """Take one entry for a list of it, and bytes in hexadecimal for a table of them."""
    rows = value if isinstance(value, list | tuple) else [value]
    return [{"hex": row} if isinstance(row, str) else row for row in rows]


def _lowest_and_width(value: Any) -> tuple[int, int]:
    whole = isinstance(value, list | tuple) and all(isinstance(n, int) and not isinstance(n, bool) for n in value)
    if not (whole and len(value) == 2 and value[0] >= 0 and 1 <= value[1] <= 63):
        raise ValueError("must be the lowest bit and the number of bits")
    return value[0], value[1]


def _least_and_greatest(value: Any) -> tuple[float, float]:
    numbers = isinstance(value, list | tuple) and all(
        isinstance(n, int | float) and not isinstance(n, bool) for n in value
    )
    if not (numbers and len(value) == 2 and value[0] < value[1]):
        raise ValueError("must be the least and the greatest value")
    return float(value[0]), float(value[1])


def _name_or_names(value: Any) -> list[str]:
    names = value if isinstance(value, list | tuple) else [value]
    if not names or not all(isinstance(name, str) and name for name in names):
        raise ValueError("must be a text or a list of texts")
    return list(names)


Hex = Annotated[bytes, BeforeValidator(_from_hex)]
Order = Annotated[str, _one_of("little", "big")]
Whole = Annotated[int, Field(ge=0, le=2**31 - 1)]
Count = Annotated[int, Field(ge=1, le=2**31 - 1)]


class LengthTable(DeclaredTable):
    """``length``: fixed, or a field of the frame."""

    fixed: Count | None = None
    """Bytes of every frame."""
    at: Whole | None = Field(default=None, description="the byte of the length field, from 0")
    """Place of the length field."""
    type: Annotated[str, _one_of("u8", "u16", "u24", "u32")] | None = None
    """Type of the length field."""
    endian: Order | None = None
    """Byte order of the length field; that of the frame if left out."""
    add: Annotated[int, Field(ge=-65536)] | None = None
    """Number that is added to the field's for the length of the whole frame."""
    of: Annotated[dict[str, Any], Field(min_length=1)] | None = Field(
        default=None, description='a table such as { "49" = 9 }'
    )
    """Lengths of the whole frame by what stands there, in hexadecimal."""


class ChecksumTable(DeclaredTable):
    """``checksum``; of a line it is text, behind an asterisk unless another ``mark`` is declared."""

    algo: Annotated[str, _one_of("none", *CHECKSUMS)]
    """Name of the algorithm."""
    start: Whole = Field(default=0, alias="from")
    """First byte that the checksum is of, from 0."""
    size: Whole | None = None
    """Bytes of the checksum, where they are to be checked."""
    order: Order = "little"
    """Order of its bytes."""
    format: Annotated[str, _one_of("binary", "hex")] | None = None
    """Whether it is bytes or hexadecimal digits; of lines always digits."""
    mark: str | None = None
    """Text before the checksum; an asterisk of lines if left out."""


class RequestTable(DeclaredTable):
    """Bytes for the device: ``hex`` or ``text``, with their checksum if one is declared."""

    hex: Hex | None = None
    """Request as bytes in hexadecimal."""
    text: Text | None = None
    """Request as a text, in place of `hex`."""
    checksum: ChecksumTable | None = None
    """Checksum that is appended."""
    end: str = ""
    r"""End of a text, such as ``"\r\n"``."""


class CommandTable(RequestTable):
    """One of ``start_commands`` or ``stop_commands``."""

    wait_s: Positive | None = None
    """Time to wait after it, s."""


class PollTable(RequestTable):
    """One of ``poll``."""

    every_s: Positive
    """Time from one request to the next, s."""
    timeout_s: Positive
    """Time for which an answer is waited for, s."""


class CounterTable(DeclaredTable):
    """``counter``: the field that counts frames."""

    field: Text
    """The field that counts frames."""
    modulo: Annotated[int, Field(ge=2, le=2**62)]
    """Number at which the counter begins anew."""
    step: Count = 1
    """Number by which the counter grows from frame to frame."""


class DeviceTimeTable(DeclaredTable):
    """``device_time``: the field that holds the device's own time."""

    field: Text
    """The field that holds the device's own time."""
    tick_s: Positive
    """Time of one count of the field, s."""
    modulo: Annotated[int, Field(ge=0, le=2**62)] = 0
    """Number at which the device's time begins anew; 0 if never."""


class WhenTable(DeclaredTable):
    """``when``: which frames a frame type is."""

    at: Whole
    """Place of the content: the byte, or of lines the number of the part, from 0."""
    equals: int | str | None = None
    """Content at that place: a number, bytes in hexadecimal, or of lines a text."""
    text: Text | None = None
    """Content at that place as a text, in place of `equals`."""


class TlvTable(DeclaredTable):
    """``tlv``: how the elements of a frame follow each other."""

    start: Whole = Field(alias="from")
    """The byte of the first element, from 0."""
    length_type: Annotated[str, _one_of("u8", "u16")] = Field(alias="len")
    """Type of an element's length."""
    id_type: Annotated[str, _one_of("u8", "u16")] = Field(alias="id")
    """Type of an element's identifier."""
    length_includes: Whole = Field(default=0, alias="len_includes")
    """Bytes that the length counts beside the values."""
    id_first: bool = False
    """Whether the identifier stands before the length."""
    endian: Order = "big"
    """Byte order of length and identifier."""


class FieldTable(DeclaredTable):
    """One of ``fields``, or an array of them: they follow each other and differ in their names only."""

    name: Annotated[list[str], BeforeValidator(_name_or_names)]
    """Name of the field, which is the signal's; a list for numbers that follow each other."""
    at: Whole | None = None
    """Place of the field: its first byte, or of lines the number of the part, from 0."""
    type: Annotated[str, _one_of(*TYPE_SIZES)] | None = None
    """Type of the field."""
    endian: Order | None = None
    """Byte order of the field; that of the frame if left out."""
    scale: Finite = 1.0
    """Factor of ``value = scale * number + offset``."""
    offset: Finite = 0.0
    """Offset of ``value = scale * number + offset``."""
    unit: str = ""
    """Unit of the value."""
    plausible: Annotated[tuple[float, float], BeforeValidator(_least_and_greatest)] | None = None
    """Least and greatest value of the field; a frame beyond is taken for a damaged one."""
    count: Annotated[int, Field(ge=1, le=MOST_IN_ARRAY)] | None = None
    """Number of such fields that follow each other, ``name_0`` and so on."""
    bits: Annotated[tuple[int, int], BeforeValidator(_lowest_and_width)] | None = None
    """Lowest bit and number of bits, of a number that is a part of a larger one."""
    id: Whole | None = None
    """Identifier of its element, with ``tlv``."""


class FrameTable(DeclaredTable):
    """One of ``frames``: how it is recognised, and its fields."""

    when: WhenTable | None = None
    """Mark by which the type of frame is recognised."""
    fields: list[FieldTable] = Field(default=[], description="a list of at least one field")
    """Fields that a frame holds."""
    tlv: TlvTable | None = None
    """Layout of elements that follow each other, each with an identifier and a length."""


class FramingTable(FrameTable):
    """The whole table."""

    kind: Literal["sync", "fixed", "delimiter", "cobs", "slip", "idle"]
    """Kind of framing: what marks a frame."""
    max: Count | None = None
    """Bytes that a frame has at most."""
    checksum: ChecksumTable | None = None
    """Checksum, which tells a sound frame from a damaged one."""
    frames: Annotated[list[FrameTable], Field(min_length=1)] | None = Field(
        default=None, description="a list of tables"
    )
    """Types of frames, each with ``when`` and ``fields``, in place of ``fields``."""
    only_known: bool = False
    """Whether a frame counts only if its type is one of these."""
    counter: CounterTable | None = None
    """Field that counts frames: a gap in it is lost frames."""
    device_time: DeviceTimeTable | None = None
    """Field that dates the frames by the device's own clock."""
    baudrate: Positive | None = None
    """Bits per second of the line."""
    bits_per_byte: Annotated[int, Field(ge=7, le=13)] = BITS_PER_BYTE
    """Bits of the line for a byte, start and stop included."""
    rate_hz: Positive | None = None
    """Frames per second, where neither a clock nor the host dates them."""
    poll: Annotated[list[PollTable], BeforeValidator(_listed)] = Field(default=[])
    """Requests that the host sends again and again."""
    start_commands: Annotated[list[CommandTable], BeforeValidator(_listed)] = Field(default=[])
    """Commands that the host sends when it opens the port."""
    stop_commands: Annotated[list[CommandTable], BeforeValidator(_listed)] = Field(default=[])
    """Commands that the host sends before it closes the port."""
    endian: Order = "little"
    """Byte order of the numbers."""
    timeout_s: Positive | None = None
    """Silence that ends a half frame, s."""
    sync: Hex | None = None
    """Bytes that begin a frame, in hexadecimal."""
    length: LengthTable | None = None
    """Length of a frame."""
    look_ahead: bool = False
    """Whether a frame counts only if the next begins behind it."""
    delimiter: Text = "\n"
    """Text that ends a line."""
    start: str = ""
    """Text that begins a line."""
    comment: str = ""
    """Text that begins a line that is a comment."""
    separator: Text = ","
    """Text between the parts of a line."""
    gap_s: Annotated[NotNegative, Field(description="a time in seconds")] | None = None
    """Silence that ends a frame; 3.5 characters at the baud rate if left out."""
