"""Channels of an MDF file that are measured numbers, and why the others are not."""

from __future__ import annotations

from recoil_acquisition.readers.mdf.channel_groups import ALL_INVALID, INVALIDATION, MASTERS, ChannelGroup, MdfChannel

INTEGERS, FLOATS = (0, 1, 2, 3), (4, 5)
"""Data types of numbers, of either byte order."""
UNSIGNED = (0, 1)
UNKNOWN = -1
"""Kind, or data type, that MDF 4 has none for: channels of older files are described as its own."""
DATA_TYPES = {UNKNOWN: "a float of VAX computers, or of no known data type", 6: "text", 7: "text", 8: "text", 9: "text",
              10: "bytes", 11: "a sample of MIME type", 12: "a stream", 13: "a date", 14: "a time", 15: "complex",
              16: "complex"}  # fmt: skip
FIXED_LENGTH = 0
CHANNEL_TYPES = {UNKNOWN: "of no known channel type", 1: "values of variable length", 4: "synchronised media",
                 5: "values of variable length", 6: "a virtual channel"}  # fmt: skip


def non_numeric_reason(channel: MdfChannel, group: ChannelGroup) -> str:
    """Say why the bits of a channel are not read as numbers; empty if they are."""
    if channel.is_composed:
        return "an array or a structure"
    if channel.data_type not in INTEGERS + FLOATS:
        return DATA_TYPES.get(channel.data_type, f"data type {channel.data_type}")
    if channel.flags & ALL_INVALID:
        return "all of its samples are marked invalid"
    last_bit, held = 8 * channel.byte + channel.bit + channel.bits, 8 * group.width
    is_float = channel.data_type in FLOATS
    if (
        last_bit > held
        or not 0 < channel.bit + channel.bits <= 64
        or channel.bit > 7
        or (is_float and (channel.bits not in (16, 32, 64) or channel.bit))
    ):
        return f"damaged: {channel.bits} bits of data type {channel.data_type} up to bit {last_bit} of {held}"
    if channel.flags & INVALIDATION and channel.invalid_at >= 8 * group.invalidation_width:
        return f"damaged: invalidation bit {channel.invalid_at} of {8 * group.invalidation_width}"
    return ""


def rejection_reason(channel: MdfChannel, group: ChannelGroup) -> str:
    """Say why a channel is no measured signal; empty if it is."""
    # where a group is over time, a stored master of something else, an angle say, is measured like any channel
    if not (reason := non_numeric_reason(channel, group)) and channel.kind not in (FIXED_LENGTH, MASTERS[0]):
        return CHANNEL_TYPES.get(channel.kind, f"channel type {channel.kind}")
    return reason
