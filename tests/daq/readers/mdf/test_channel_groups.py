"""The walk over a file's groups: what a channel may state of its record, and what chains and lists may not do."""

from __future__ import annotations

import struct
from dataclasses import replace

import pytest

from recoil_acquisition.readers.mdf import channel_groups
from recoil_acquisition.readers.mdf.channel_groups import (
    INVALIDATION,
    ChannelGroup,
    DataGroup,
    MdfChannel,
    MdfDamageError,
    iter_groups,
)
from tests.builders.mdf_logs import Blocks, identification_block, listed_log, measured_file

FRAMES = [(1_000_000 * n, 0x123, bytes([n])) for n in range(40)]


def channel(bit: int, byte: int, bits: int, flags: int = 0, invalid_at: int = 0) -> MdfChannel:
    return MdfChannel(0, "n", 0, 0, 0, bit, byte, bits, flags, invalid_at, 0, 0)


def group(*channels: MdfChannel, width: int = 4, invalidation: int = 1) -> ChannelGroup:
    return ChannelGroup(0, DataGroup(0, 0, 0), 7, 1, 0, width, invalidation, channels, 1)


def test_a_channel_may_take_all_of_a_record_and_not_a_bit_more() -> None:
    assert group(channel(0, 0, 32)).misfit() == ""
    assert group(channel(3, 3, 5)).misfit() == ""
    assert "6 bits from byte 3 of 4" in group(channel(3, 3, 6)).misfit()
    assert "33 bits from byte 0 of 4" in group(channel(0, 0, 33)).misfit()
    assert "1 bits from byte 4 of 4" in group(channel(0, 4, 1)).misfit()


def test_an_invalidation_bit_may_be_the_last_of_a_record_and_none_behind_it() -> None:
    assert group(channel(0, 0, 8, INVALIDATION, 7)).misfit() == ""
    assert "invalidation bit beyond" in group(channel(0, 0, 8, INVALIDATION, 8)).misfit()
    assert group(channel(0, 0, 8, 0, 8)).misfit() == ""
    assert group(channel(0, 0, 8, INVALIDATION, 15), invalidation=2).misfit() == ""


def test_a_group_of_a_bus_is_known_by_its_flag_or_by_its_channels_name() -> None:
    plain = group(channel(0, 0, 8))
    assert not plain.is_bus
    assert replace(plain, flags=0x0002).is_bus
    assert not replace(plain, flags=0x0004).is_bus
    assert not replace(plain, flags=0x0001).is_bus
    assert replace(plain, channels=(replace(channel(0, 0, 8), name="LIN_Frame.ID"),)).is_bus


def test_a_groups_name_is_kept_where_there_is_one() -> None:
    found = list(iter_groups(measured_file([("speed", "m/s", [(0.0, 1.0)]), ("way", "m", [(0.0, 2.0)])])))
    assert all(one.name_at for one in found)
    blocks = Blocks(identification_block(b"MDF     "))
    short = blocks.add("##CG", (0, blocks.column("t", 2, 4, 0, 64, 0)), struct.pack("<QQHHLLL", 1, 0, 0, 0, 0, 8, 0))
    (without,) = iter_groups(blocks.closed(blocks.add("##DG", (0, short, 0, 0), struct.pack("<B7x", 0))))
    assert without.name_at == 0
    assert [one.name for one in without.channels] == ["t"]


def nested(depth: int) -> bytes:
    blocks, inside = Blocks(identification_block(b"MDF     ")), 0
    for _ in range(depth):
        inside = blocks.column("part", 0, 0, 0, 8, 0, inside=inside)
    first = blocks.add("##CG", (0, inside, 0, 0, 0, 0), struct.pack("<QQHHLLL", 1, 0, 0, 0, 0, 8, 0))
    return blocks.closed(blocks.add("##DG", (0, first, 0, 0), struct.pack("<B7x", 0)))


def test_structures_may_be_twenty_deep_and_no_deeper() -> None:
    (found,) = iter_groups(nested(21))
    assert len(found.channels) == 21
    with pytest.raises(MdfDamageError, match="structures within structures"):
        list(iter_groups(nested(22)))
    assert list(iter_groups(nested(22), strict=False)) == []


def test_a_file_of_too_many_blocks_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    content = nested(5)
    met = 3 + 5  # the header, a data group, a channel group and the channels
    monkeypatch.setattr(channel_groups, "MOST_BLOCKS", met - 1)
    assert [len(one.channels) for one in iter_groups(content)] == [5]
    monkeypatch.setattr(channel_groups, "MOST_BLOCKS", met - 2)
    with pytest.raises(MdfDamageError, match="leads nowhere"):
        list(iter_groups(content))


def blocks_of(content: bytes, kind: bytes) -> list[int]:
    return [at for at in range(64, len(content) - 24, 8) if content[at : at + 4] == kind]


def test_what_lists_unpack_to_is_counted_as_far_as_deflate_can() -> None:
    content = listed_log(FRAMES)
    # of the records, not of what a channel has in blocks of its own
    (at,) = (at for at in blocks_of(content, b"##DZ") if content[at + 24 : at + 26] == b"DT")
    stated, packed = struct.unpack_from("<QQ", content, at + 32)
    assert [one.stored.unpacked for one in iter_groups(content)] == [stated]
    assert [one.stored.unpacked for one in iter_groups(content, strict=False)] == [0]
    lying = bytearray(content)
    struct.pack_into("<Q", lying, at + 32, 1 << 40)
    assert [one.stored.unpacked for one in iter_groups(bytes(lying))] == [1032 * packed]


def test_data_that_two_lists_name_lead_back() -> None:
    content = bytearray(listed_log(FRAMES))
    first, second = blocks_of(content, b"##DL")[-2:]
    content[first + 32 : first + 40] = content[second + 32 : second + 40]
    with pytest.raises(MdfDamageError, match="leads back to the data"):
        list(iter_groups(bytes(content)))
