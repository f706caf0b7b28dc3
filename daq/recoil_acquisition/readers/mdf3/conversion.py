"""The conversions of channels of an MDF 2 or 3 file.

Layout (MDF 3.3.1, CC block): the range, the unit, 20 bytes, the type, the number of values or of pairs, and the values.
A type 6 is a quotient of two straight lines of what is left of a number over an offset, computed as the rational one
that it is. Types 7 and 8, exponential and logarithmic, are named and not read: programs are at odds over which of them
is which.
"""

from __future__ import annotations

from recoil_acquisition.readers.containers.stored_channels import Damaged
from recoil_acquisition.readers.mdf.channel_groups import MdfChannel, MdfDamageError
from recoil_acquisition.readers.mdf.conversion import VIRTUAL_MASTER
from recoil_acquisition.readers.mdf.number_conversion import (
    INTERPOLATED,
    LINEAR,
    NEAREST,
    NONE,
    RATIONAL,
    NumberConversion,
    checked_conversion,
)
from recoil_acquisition.readers.mdf3.blocks import OldBlocks

_POLYNOMIAL = 6
_KINDS = {0: LINEAR, 1: INTERPOLATED, 2: NEAREST, _POLYNOMIAL: RATIONAL, 9: RATIONAL, 65535: NONE}
_OTHERS = {7: "an exponential conversion", 8: "a logarithmic conversion", 10: "a formula as text",
           11: "an enumeration (value to text)", 12: "an enumeration (range to text)", 132: "a date",
           133: "a time"}  # fmt: skip
_RATE_AT, _VALUES_AT = 210, 46
_LONGER = 0xFFFF
"""Length of a block that is longer than its length can say."""


def number_conversion(blocks: OldBlocks, channel: MdfChannel) -> NumberConversion | str:
    """Return the conversion of a channel to numbers, or why it has none; of a computed time, the step between two."""
    try:
        if channel.kind == VIRTUAL_MASTER:
            return checked_conversion(LINEAR, (0.0, *blocks.unpacked("d", channel.at + _RATE_AT)))
        if not channel.conversion_at:
            return NumberConversion(NONE, ())
        length, (*_, kind, count) = blocks.block(channel.conversion_at, "CC")
        if kind not in _KINDS:
            return _OTHERS.get(kind, f"conversion {kind}")
        values = _values(blocks, channel.conversion_at, length, _count(_KINDS[kind], count))
    except MdfDamageError as error:
        return Damaged(f"damaged: {error}")
    return checked_conversion(_KINDS[kind], _rational(*values) if kind == _POLYNOMIAL else values)


def unit_of(blocks: OldBlocks, channel: MdfChannel) -> str:
    """Return the unit of a channel; empty if its conversion states none, or is damaged."""
    try:
        _, (*_, unit, _, _) = blocks.block(channel.conversion_at, "CC")
    except MdfDamageError:
        return ""
    return blocks.decoded(unit)


def _count(kind: int, stated: int) -> int:
    return {NONE: 0, LINEAR: 2, RATIONAL: 6}.get(kind, 2 * stated)


def _values(blocks: OldBlocks, at: int, length: int, count: int) -> tuple[float, ...]:
    if length < _VALUES_AT + 8 * count and length != _LONGER:
        raise MdfDamageError(f"the conversion at byte {at} has {length} bytes for {count} numbers")
    return blocks.unpacked(f"{count}d", at + _VALUES_AT)


def _rational(p1: float, p2: float, p3: float, p4: float, p5: float, p6: float) -> tuple[float, ...]:
    """Return the coefficients of ``(p2 - p4 (x - p5 - p6)) / (p3 (x - p5 - p6) - p1)`` as those of a rational one."""
    return 0.0, -p4, p2 + p4 * (p5 + p6), 0.0, p3, -p1 - p3 * (p5 + p6)
