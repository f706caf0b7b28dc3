"""What a stored number stands for: conversion blocks from bytes, sound and damaged."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from recoil_acquisition.readers.mdf.channel_groups import (
    ChannelGroup,
    DataGroup,
    MdfChannel,
    MdfDamageError,
    MdfUnsupportedError,
)
from recoil_acquisition.readers.mdf.conversion import conversion_values, linear, unit_of, whole_numbers
from recoil_acquisition.readers.mdf.records import Records

AT = 8
MASTER, VIRTUAL_MASTER, VIRTUAL = 2, 3, 6


def block(kind: int, *values: float, references: int = 0, links: int | None = None, unit_at: int = 0) -> bytes:
    links = 4 + references if links is None else links
    addresses = [0, unit_at, *[0] * (links - 2)][:links]
    body = struct.pack("<B3xHHdd", kind, references, len(values), 0.0, 0.0) + struct.pack(f"<{len(values)}d", *values)
    head = struct.pack("<4s4xQQ", b"##CC", 24 + 8 * links + len(body), links)
    return bytes(AT) + head + struct.pack(f"<{links}Q", *addresses) + body


def channel(kind: int = 0, conversion_at: int = AT, unit_at: int = 0) -> MdfChannel:
    return MdfChannel(0, "n", kind, 0, 0, 0, 0, 8, 0, 0, conversion_at, 0, unit_at)


def records(*numbers: int) -> Records:
    group = ChannelGroup(0, DataGroup(0, 0, 0), 7, len(numbers), 0, 1, 0, (), 1)
    return Records(group, np.array(numbers, np.uint8).reshape(-1, 1))


def test_a_linear_conversion_has_its_offset_first() -> None:
    assert linear(block(1, 2.0, 3.0), channel()) == (2.0, 3.0)
    assert linear(block(1, 2.0, 3.0, 4.0), channel()) == (2.0, 3.0)
    assert linear(b"", channel(conversion_at=0)) == (0.0, 1.0)
    assert linear(block(0), channel()) == (0.0, 1.0)


@pytest.mark.parametrize("values", [(), (2.0,), (2.0, float("nan")), (float("inf"), 1.0), (2.0, 1.0, float("nan"))])
def test_a_linear_conversion_without_two_numbers_is_damaged(values: tuple[float, ...]) -> None:
    with pytest.raises(MdfDamageError, match="is linear and has the numbers"):
        linear(block(1, *values), channel())


def test_a_conversion_that_is_not_linear_is_said_to_be_so() -> None:
    with pytest.raises(MdfUnsupportedError, match="not linear, but of type 3"):
        linear(block(3), channel())


def test_whole_numbers_are_stored_counted_looked_up_or_computed() -> None:
    stored = records(2, 0, 2)
    assert whole_numbers(b"", stored, channel(conversion_at=0)).tolist() == [2, 0, 2]
    for virtual in (VIRTUAL_MASTER, VIRTUAL):
        assert whole_numbers(b"", stored, channel(virtual, conversion_at=0)).tolist() == [0, 1, 2]
    assert whole_numbers(b"", stored, channel(MASTER, conversion_at=0)).tolist() == [2, 0, 2]
    assert whole_numbers(block(1, 5.0, 2.0), stored, channel()).tolist() == [9, 5, 9]
    for table in (4, 5):
        assert whole_numbers(block(table, 0.0, 7.0, 2.0, 64.0), stored, channel()).tolist() == [64, 7, 64]
    for text in (7, 8):
        assert whole_numbers(block(text, 0.0), stored, channel()).tolist() == [2, 0, 2]


def test_what_is_not_whole_or_in_no_table_is_damaged() -> None:
    with pytest.raises(MdfDamageError, match="not whole"):
        whole_numbers(block(1, 0.5, 2.0), records(1), channel())
    with pytest.raises(MdfDamageError, match="not whole"):
        whole_numbers(block(1, 0.0, 2.0**53), records(1), channel())
    assert whole_numbers(block(1, 0.0, 2.0**52), records(1), channel()).tolist() == [2**52]
    with pytest.raises(MdfDamageError, match="has the number 3, which its conversion has not"):
        whole_numbers(block(4, 0.0, 7.0), records(0, 3), channel())


def test_a_key_that_a_table_has_no_value_for_is_as_if_it_were_not_there() -> None:
    cut = block(4, 0.0, 7.0, 2.0, 64.0, 3.0)
    assert whole_numbers(cut, records(2, 0), channel()).tolist() == [64, 7]
    with pytest.raises(MdfDamageError, match="has the number 3, which its conversion has not"):
        whole_numbers(cut, records(3), channel())


def test_a_block_must_hold_the_links_and_the_values_that_it_states() -> None:
    sound = block(1, 2.0, 3.0)
    assert conversion_values(sound, channel()) == (1, (2.0, 3.0))
    for wrong in (block(1, 2.0, 3.0, references=1, links=4), block(1, 2.0, 3.0, references=0, links=5)):
        with pytest.raises(MdfDamageError, match="links and 2 values"):
            conversion_values(wrong, channel())
    more = bytearray(sound)
    struct.pack_into("<H", more, AT + 24 + 32 + 6, 3)
    with pytest.raises(MdfDamageError, match="4 links and 3 values"):
        conversion_values(bytes(more), channel())
    shorter = bytearray(sound)
    struct.pack_into("<Q", shorter, AT + 8, len(sound) - AT - 1)
    with pytest.raises(MdfDamageError, match="4 links and 2 values"):
        conversion_values(bytes(shorter), channel())
    with pytest.raises(MdfDamageError, match="ends early"):
        conversion_values(sound[: AT + 24 + 32 + 23], channel())
    for other in (sound[: AT + 23], sound.replace(b"##CC", b"##CN"), bytes(AT)):
        with pytest.raises(MdfDamageError, match="leads to no conversion"):
            conversion_values(other, channel())


def text_block(text: str) -> bytes:
    return struct.pack("<4s4xQQ", b"##TX", 24 + 8, 0) + text.encode().ljust(8, b"\0")


def test_the_unit_of_a_conversion_comes_before_the_channels_own() -> None:
    plain = block(1, 0.0, 1.0)
    own_at = len(plain)
    content = block(1, 0.0, 1.0, unit_at=own_at + 32) + text_block("g") + text_block("m/s")
    assert unit_of(content, channel(unit_at=own_at)) == "m/s"
    assert unit_of(plain + text_block("g"), channel(unit_at=own_at)) == "g"
    assert unit_of(content, channel(conversion_at=0, unit_at=own_at)) == "g"
    # a link that leads to no conversion, and one whose links are cut off
    assert unit_of(content, channel(conversion_at=own_at, unit_at=own_at)) == "g"
    assert unit_of(plain[: AT + 39], channel()) == ""
    assert unit_of(block(1, unit_at=AT)[: AT + 40], channel()) == ""


def test_the_unit_of_a_conversion_that_is_cut_behind_its_link_is_still_known() -> None:
    conversion_at = AT + len(text_block("g"))
    cut = block(1, 0.0, 1.0, unit_at=AT)[AT : AT + 40]
    assert unit_of(bytes(AT) + text_block("g") + cut, channel(conversion_at=conversion_at)) == "g"
    assert unit_of(bytes(AT) + text_block("g") + cut[:-1], channel(conversion_at=conversion_at)) == ""
