"""Which channels of an MDF 4 file are measured numbers, and which are not and why."""

from __future__ import annotations

from typing import Any

INTEGERS, FLOATS = (0, 1, 2, 3), (4, 5)
"""Data types of numbers, of either byte order."""
DATA_TYPES = {6: "text", 7: "text", 8: "text", 9: "text", 10: "bytes", 11: "a sample of MIME type", 12: "a stream",
              13: "a date", 14: "a time", 15: "complex", 16: "complex"}  # fmt: skip
FIXED_LENGTH = 0
CHANNEL_TYPES = {1: "values of variable length", 4: "synchronised media", 5: "values of variable length",
                 6: "a virtual channel"}  # fmt: skip
NO_CONVERSION, LINEAR = 0, 1
NUMERIC_CONVERSIONS = frozenset({NO_CONVERSION, LINEAR, 2, 4, 5, 6})
"""None, linear, rational, and tables of numbers."""
CONVERSIONS = {3: "a formula as text", 7: "an enumeration (value to text)", 8: "an enumeration (range to text)",
               9: "text to value", 10: "text to text", 11: "a bit field as text"}  # fmt: skip
ALL_INVALID = 1
INVALIDATION = 2
"""Flag of a channel that has a bit in each record that says whether its sample is invalid."""
TIME = 1
"""Synchronisation type of a master channel."""


def why_no_channel(channel: Any, record: Any, dependencies: Any, group: Any) -> str:
    """Say why a channel is not read; empty if it is.

    Parameters
    ----------
    channel : asammdf.blocks.v4_blocks.Channel
    record : tuple or None
        asammdf's type, size, offset and first bit of the channel in a record.
    dependencies : list or None
        The blocks that a structure or an array consists of.
    group : asammdf.blocks.v4_blocks.ChannelGroup
        Whose records the channel is in.
    """
    if dependencies:
        return "an array or a structure"
    if channel.data_type not in INTEGERS + FLOATS:
        return DATA_TYPES.get(channel.data_type, f"data type {channel.data_type}")
    if channel.channel_type != FIXED_LENGTH:
        return CHANNEL_TYPES.get(channel.channel_type, f"channel type {channel.channel_type}")
    kind = NO_CONVERSION if channel.conversion is None else channel.conversion.conversion_type
    if kind not in NUMERIC_CONVERSIONS:
        return CONVERSIONS.get(kind, f"conversion {kind}")
    if channel.flags & ALL_INVALID:
        return "all of its samples are marked invalid"
    if record is None:
        return "its place in a record is not stated"
    dtype, size, offset, _ = record
    record_bytes = group.samples_byte_nr
    # asammdf's fast path takes these numbers on trust, outside Python
    if dtype.kind not in "iuf" or dtype.itemsize > 8 or not 0 < size <= 8 or not 0 <= offset <= record_bytes - size:
        return f"damaged: {size} bytes at {offset} of {record_bytes}"
    if channel.flags & INVALIDATION and channel.pos_invalidation_bit >= 8 * group.invalidation_bytes_nr:
        return f"damaged: invalidation bit {channel.pos_invalidation_bit} of {8 * group.invalidation_bytes_nr}"
    return ""


def linear(channel: Any) -> tuple[float, float] | None:
    """Return gain and offset of a channel, or None if its conversion is another."""
    conversion = channel.conversion
    if conversion is None or conversion.conversion_type == NO_CONVERSION:
        return 1.0, 0.0
    if conversion.conversion_type == LINEAR:
        # asammdf names the factor a and the shift b
        return float(conversion.a), float(conversion.b)
    return None


def unit_of(channel: Any) -> str:
    """Return the unit of a channel: that of its conversion, else its own."""
    return str((channel.conversion and channel.conversion.unit) or channel.unit or "")
