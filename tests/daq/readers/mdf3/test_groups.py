"""Chains of blocks that do not hang together, and blocks and fields that would end behind the file."""

from __future__ import annotations

import struct

import pytest

from recoil_acquisition.readers.mdf.channel_groups import MdfDamageError
from recoil_acquisition.readers.mdf3.groups import OldBlocks, OldGroups
from tests.builders.mdf3_files import DATA, UNSIGNED, OldFile


def walked(file: OldFile, first: int) -> OldGroups:
    return OldGroups(OldBlocks(file.closed(first)), first)


def two_channels() -> tuple[OldFile, int, int, int, int]:
    file = OldFile()
    last = file.channel("b", DATA, 8, 8, UNSIGNED)
    first = file.channel("a", DATA, 0, 8, UNSIGNED, last)
    group = file.group(first, 2, 3)
    return file, file.data_group(group, file.records(bytes(6))), group, first, last


def test_groups_and_channels_are_in_the_order_of_the_file() -> None:
    file, at, group, first, last = two_channels()
    found = walked(file, at)
    (one,) = found.groups
    assert [(channel.at, channel.name, channel.byte) for channel in one.channels] == [(first, "a", 0), (last, "b", 1)]
    assert (one.at, one.width, one.count, one.channel_count, one.stored.size) == (group, 2, 3, 2, 6)
    assert found.blocks_size == 28 + 2 * 228 + 30
    assert {group, first, last, one.stored.data_at} <= found.linked


def test_any_link_back_is_refused() -> None:
    for chain in range(3):
        file, at, group, first, last = two_channels()
        block = (at, group, last)[chain]
        back = (at, group, first)[chain]
        struct.pack_into("<I", file.content, block + 4, back)
        with pytest.raises(MdfDamageError, match=f"leads back to byte {back}"):
            walked(file, at)


@pytest.mark.parametrize("link", [1, 63, 64, 2**32 - 1])
def test_a_link_to_no_such_block_is_refused(link: int) -> None:
    file, at, *_ = two_channels()
    struct.pack_into("<I", file.content, at + 8, link)
    with pytest.raises(MdfDamageError, match=r"leads to|lie beyond"):
        walked(file, at)


@pytest.mark.parametrize("length", [0, 217, 60_000])
def test_a_block_shorter_than_its_fields_or_longer_than_the_file_is_refused(length: int) -> None:
    file, at, _, first, _ = two_channels()
    struct.pack_into("<H", file.content, first + 2, length)
    with pytest.raises(MdfDamageError, match=f"has no {length} bytes"):
        walked(file, at)


def test_blocks_over_one_another_are_refused() -> None:
    file, at, _, first, last = two_channels()
    size = len(file.content)
    for block in (first, last):
        struct.pack_into("<H", file.content, block + 2, size - block)
    with pytest.raises(MdfDamageError, match="over one another"):
        walked(file, at)


def test_more_than_two_numbers_at_a_record_are_refused() -> None:
    file, _, group, *_ = two_channels()
    with pytest.raises(MdfDamageError, match="has 3 numbers"):
        walked(file, file.data_group(group, 64, numbers=3))


def test_fields_may_end_with_the_file_and_not_behind_it() -> None:
    content = bytes(OldFile().closed(0))
    end, blocks = len(content), OldBlocks(content)
    assert blocks.unpacked("2I", end - 8) == struct.unpack_from("<2I", content, end - 8)
    with pytest.raises(MdfDamageError, match=f"fields at byte {end - 7} lie beyond its {end} bytes"):
        blocks.unpacked("2I", end - 7)


def test_a_block_may_end_with_the_file_and_not_behind_it() -> None:
    content = bytearray(OldFile().closed(0))
    at = len(content)
    content += b"TX" + struct.pack("<H", 10) + b"speed\0"
    assert OldBlocks(bytes(content)).block(at, "TX") == (10, ())
    assert OldBlocks(bytes(content)).text(at) == "speed"
    with pytest.raises(MdfDamageError, match=f"the block at byte {at} has no 10 bytes: 4 to 9"):
        OldBlocks(bytes(content[:-1])).block(at, "TX")
