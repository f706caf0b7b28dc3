"""The tables of a declared framing, as a rig file has them; `frames.declaration` makes a framing of them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from recoil_acquisition.declaration import DeclaredTable, Finite, NotNegative, Positive, Text
from recoil_acquisition.frames.checksum import CHECKSUMS
from recoil_acquisition.frames.field import TYPE_SIZES
from recoil_acquisition.frames.framing import BITS_PER_BYTE

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
    at: Whole | None = Field(default=None, description="the byte of the length field, from 0")
    type: Annotated[str, _one_of("u8", "u16", "u24", "u32")] | None = None
    endian: Order | None = None
    add: Annotated[int, Field(ge=-65536)] | None = None
    of: Annotated[dict[str, Any], Field(min_length=1)] | None = Field(
        default=None, description='a table such as { "49" = 9 }'
    )


class ChecksumTable(DeclaredTable):
    """``checksum``; of a line it is text, behind an asterisk unless another ``mark`` is declared."""

    algo: Annotated[str, _one_of("none", *CHECKSUMS)]
    start: Whole = Field(default=0, alias="from")
    size: Whole | None = None
    order: Order = "little"
    format: Annotated[str, _one_of("binary", "hex")] | None = None
    mark: str | None = None


class RequestTable(DeclaredTable):
    """Bytes for the device: ``hex`` or ``text``, with their checksum if one is declared."""

    hex: Hex | None = None
    text: Text | None = None
    checksum: ChecksumTable | None = None
    end: str = ""


class CommandTable(RequestTable):
    """One of ``start_commands`` or ``stop_commands``."""

    wait_s: Positive | None = None


class PollTable(RequestTable):
    """One of ``poll``."""

    every_s: Positive
    timeout_s: Positive


class CounterTable(DeclaredTable):
    """``counter``: the field that counts frames."""

    field: Text
    modulo: Annotated[int, Field(ge=2, le=2**62)]
    step: Count = 1


class DeviceTimeTable(DeclaredTable):
    """``device_time``: the field that holds the device's own time."""

    field: Text
    tick_s: Positive
    modulo: Annotated[int, Field(ge=0, le=2**62)] = 0


class WhenTable(DeclaredTable):
    """``when``: which frames a frame type is."""

    at: Whole
    equals: int | str | None = None
    text: Text | None = None


class TlvTable(DeclaredTable):
    """``tlv``: how the elements of a frame follow each other."""

    start: Whole = Field(alias="from")
    length_type: Annotated[str, _one_of("u8", "u16")] = Field(alias="len")
    id_type: Annotated[str, _one_of("u8", "u16")] = Field(alias="id")
    length_includes: Whole = Field(default=0, alias="len_includes")
    id_first: bool = False
    endian: Order = "big"


class FieldTable(DeclaredTable):
    """One of ``fields``, or an array of them: they follow each other and differ in their names only."""

    name: Annotated[list[str], BeforeValidator(_name_or_names)]
    at: Whole | None = None
    type: Annotated[str, _one_of(*TYPE_SIZES)] | None = None
    endian: Order | None = None
    scale: Finite = 1.0
    offset: Finite = 0.0
    unit: str = ""
    plausible: Annotated[tuple[float, float], BeforeValidator(_least_and_greatest)] | None = None
    count: Annotated[int, Field(ge=1, le=MOST_IN_ARRAY)] | None = None
    bits: Annotated[tuple[int, int], BeforeValidator(_lowest_and_width)] | None = None
    id: Whole | None = None


class FrameTable(DeclaredTable):
    """One of ``frames``: how it is recognised, and its fields."""

    when: WhenTable | None = None
    fields: list[FieldTable] = Field(default=[], description="a list of at least one field")
    tlv: TlvTable | None = None


class FramingTable(FrameTable):
    """The whole table."""

    kind: Literal["sync", "fixed", "delimiter", "cobs", "slip", "idle"]
    max: Count | None = None
    checksum: ChecksumTable | None = None
    frames: Annotated[list[FrameTable], Field(min_length=1)] | None = Field(
        default=None, description="a list of tables"
    )
    only_known: bool = False
    counter: CounterTable | None = None
    device_time: DeviceTimeTable | None = None
    baudrate: Positive | None = None
    bits_per_byte: Annotated[int, Field(ge=7, le=13)] = BITS_PER_BYTE
    rate_hz: Positive | None = None
    poll: Annotated[list[PollTable], BeforeValidator(_listed)] = Field(default=[])
    start_commands: Annotated[list[CommandTable], BeforeValidator(_listed)] = Field(default=[])
    stop_commands: Annotated[list[CommandTable], BeforeValidator(_listed)] = Field(default=[])
    endian: Order = "little"
    timeout_s: Positive | None = None
    sync: Hex | None = None
    length: LengthTable | None = None
    look_ahead: bool = False
    delimiter: Text = "\n"
    start: str = ""
    comment: str = ""
    separator: Text = ","
    gap_s: Annotated[NotNegative, Field(description="a time in seconds")] | None = None
