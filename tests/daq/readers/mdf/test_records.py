"""Records that are stored together, found one by one, and the numbers that a channel has in them."""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.readers.mdf.channel_groups import ChannelGroup, DataGroup, MdfChannel, MdfDamageError
from recoil_acquisition.readers.mdf.records import Records, VariableSamples, record_places, split

UNSIGNED, UNSIGNED_BIG, SIGNED, SIGNED_BIG, FLOAT, FLOAT_BIG, BYTES = 0, 1, 2, 3, 4, 5, 10


def channel(
    data_type: int, bit: int = 0, byte: int = 0, bits: int = 8, flags: int = 0, invalid_at: int = 0
) -> MdfChannel:
    return MdfChannel(0, "n", 0, 0, data_type, bit, byte, bits, flags, invalid_at, 0, 0)


def group(width: int, *, count: int = 1, invalidation: int = 0, flags: int = 0, id_bytes: int = 0) -> ChannelGroup:
    return ChannelGroup(0, DataGroup(0, 0, id_bytes), 7, count, flags, width, invalidation, (), 1)


def records(rows: list[bytes], invalidation: int = 0) -> Records:
    width = len(rows[0])
    data = np.frombuffer(b"".join(rows), np.uint8).reshape(-1, width)
    return Records(group(width - invalidation, count=len(rows), invalidation=invalidation), data)


@given(st.integers(1, 57), st.integers(0, 7), st.integers(0, 3), st.booleans(), st.booleans(), st.data())
def test_integers_of_any_size_anywhere_are_read(bits, bit, byte, signed: bool, big: bool, data) -> None:
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    numbers = data.draw(st.lists(st.integers(low, high), min_size=1, max_size=4))
    count = (bit + bits + 7) // 8
    noise = data.draw(st.binary(min_size=count, max_size=count))
    mask = ((1 << bits) - 1) << bit
    rows = []
    for number in numbers:
        whole = int.from_bytes(noise, "little") & ~mask | (number << bit) & mask
        rows.append(bytes(byte) + whole.to_bytes(count, "big" if big else "little") + b"\xff")
    data_type = (SIGNED_BIG if big else SIGNED) if signed else (UNSIGNED_BIG if big else UNSIGNED)
    assert records(rows).numbers(channel(data_type, bit, byte, bits)).tolist() == numbers


@pytest.mark.parametrize(("bits", "letter"), [(16, "e"), (32, "f"), (64, "d")])
def test_floats_of_both_orders_are_read(bits: int, letter: str) -> None:
    numbers = [0.5, -1.25, 1024.0]
    for data_type, order in ((FLOAT, "<"), (FLOAT_BIG, ">")):
        rows = [b"x" + struct.pack(order + letter, number) for number in numbers]
        assert records(rows).numbers(channel(data_type, byte=1, bits=bits)).tolist() == numbers


@pytest.mark.parametrize(
    "bad", [channel(BYTES), channel(UNSIGNED, 1, bits=64), channel(UNSIGNED, bits=0), channel(FLOAT, bits=24)]
)
def test_what_is_no_number_is_refused(bad: MdfChannel) -> None:
    with pytest.raises(MdfDamageError, match="the channel n"):
        records([bytes(16)]).numbers(bad)


def test_a_float_is_no_integer() -> None:
    with pytest.raises(MdfDamageError, match="no integer"):
        records([bytes(8)]).integers(channel(FLOAT, bits=64))


def test_samples_are_valid_unless_their_bit_or_their_channel_says_otherwise() -> None:
    stored = records([b"a\x00", b"b\x04", b"c\xfb"], invalidation=1)
    assert stored.valid(channel(UNSIGNED)).tolist() == [True, True, True]
    assert stored.valid(channel(UNSIGNED, flags=2, invalid_at=2)).tolist() == [True, False, True]
    assert stored.valid(channel(UNSIGNED, flags=1)).tolist() == [False, False, False]


def test_samples_of_variable_length_are_taken_where_they_are_or_not_at_all() -> None:
    data = np.frombuffer(b"\x02\0\0\0ab\x00\0\0\0\x09\0\0\0cd", np.uint8)
    samples, lengths = VariableSamples(data).taken(np.array([0, 6, 10, 15, 2**63], np.uint64), 64)
    assert lengths.tolist() == [2, 0, -1, -1, -1]
    assert bytes(samples[0]) == b"ab"
    by_starts = VariableSamples(data, np.array([0, 6]))
    assert by_starts.taken(np.array([0, 6, 5], np.uint64), 64)[1].tolist() == [2, 0, -1]
    assert by_starts.in_order(3, 1)[1].tolist() == [-1, 0, -1]
    assert VariableSamples(data[:0], np.zeros(0, np.int64)).taken(np.array([0], np.uint64), 64)[1].tolist() == [-1]


def test_records_are_counted_by_the_file_or_by_what_it_holds() -> None:
    data = np.arange(10, dtype=np.uint8)
    for counted, rows, left in ((True, 2, 4), (False, 3, 1)):
        (one,), spare = split(data, [group(3, count=2)], counted=counted)
        assert one.rows.shape == (rows, 3)
        assert spare == left


@pytest.mark.parametrize(
    ("groups", "problem"),
    [
        ([group(0)], "have no width"),
        ([group(3), group(3)], "without numbers"),
        ([group(3, flags=1)], "without numbers"),
        ([group(3, id_bytes=3)], "have 3 bytes"),
    ],
)
def test_records_that_cannot_be_told_apart_are_refused(groups: list[ChannelGroup], problem: str) -> None:
    with pytest.raises(MdfDamageError, match=problem):
        split(np.zeros(9, np.uint8), groups, counted=True)


def test_samples_are_as_wide_as_the_longest_that_is_taken() -> None:
    data = np.frombuffer(b"\x02\0\0\0ab\x00\0\0\0\x03\0\0\0cde", np.uint8)
    for offsets, most, width in (([0, 6, 10], 64, 3), ([0, 6, 10], 2, 2), ([6], 64, 0), ([0, 10], 1, 0), ([], 64, 0)):
        samples, lengths = VariableSamples(data).taken(np.array(offsets, np.uint64), most)
        assert samples.shape == (len(offsets), width)
        assert lengths.max(initial=0) == width


def test_where_the_last_record_begins_is_said_of_groups_that_share_their_data_alone() -> None:
    (alone,), _ = split(np.zeros(6, np.uint8), [group(3, count=2)], counted=True)
    assert alone.last_at == -1
    first, second, none = (replace(group(2, id_bytes=1), record_id=n) for n in (1, 2, 3))
    data = np.frombuffer(b"\x01ab\x02cd\x02ef\x01gh", np.uint8)
    shared, left = split(data, [first, second, none], counted=True)
    assert left == 0
    assert [bytes(one.rows.ravel()) for one in shared] == [b"abgh", b"cdef", b""]
    assert [one.last_at for one in shared] == [10, 7, -1]


def test_samples_that_share_bytes_are_not_taken_unless_they_are_the_very_same() -> None:
    content = bytearray(40)
    for at, length in ((0, 8), (6, 1), (12, 1), (17, 3), (24, 6), (30, 2)):
        content[at] = length  # the second lies within the first, the last begins within the one before
    data = np.frombuffer(bytes(content), np.uint8)
    offsets = [12, 0, 6, 12, 30, 17, 24]
    for order in (slice(None), slice(None, None, -1)):
        _, lengths = VariableSamples(data).taken(np.array(offsets[order], np.uint64), 64)
        assert lengths.tolist() == [1, -1, -1, 1, -1, 3, -1][order]
    assert VariableSamples(data).taken(np.array([0, 12, 12], np.uint64), 64)[1].tolist() == [8, 1, 1]


STRIDES = {1: 9, 2: 0, 3: 3}
"""A group of 8 bytes and one of 2 with their numbers, and one of variable length."""

RECORDS = st.one_of(
    st.just(b"\1" + bytes(8)),
    st.binary(min_size=2, max_size=2).map(lambda data: b"\3" + data),
    st.binary(max_size=5).map(lambda data: b"\2" + struct.pack("<I", len(data)) + data),
)
RUNS = st.lists(st.tuples(st.lists(RECORDS, min_size=1, max_size=5), st.integers(1, 200)), max_size=5)


def bytes_of(content: bytes) -> np.ndarray:
    return np.frombuffer(content, np.uint8)


@pytest.mark.exhaustive
@given(RUNS, st.integers(0, 8))
def test_every_record_is_found_once_and_one_that_is_not_whole_is_left(runs, cut: int) -> None:
    records = [record for several, times in runs for record in several * times]
    content = b"".join(records)
    content = content[: len(content) - cut]
    begins = np.cumsum([0, *map(len, records)])
    whole = int(np.searchsorted(begins, len(content), side="right")) - 1
    places, numbers, left = record_places(bytes_of(content), STRIDES, 1)
    np.testing.assert_array_equal(places, begins[:whole])
    assert numbers.tolist() == [record[0] for record in records[:whole]]
    assert left == len(content) - begins[whole]


@pytest.mark.parametrize("id_bytes", [1, 2, 4, 8])
def test_numbers_of_every_size_are_read(id_bytes: int) -> None:
    content = b"".join((7).to_bytes(id_bytes, "little") + bytes([n % 256]) for n in range(1000))
    places, numbers, left = record_places(bytes_of(content + b"\7"[: id_bytes - 1]), {7: id_bytes + 1}, id_bytes)
    np.testing.assert_array_equal(places, np.arange(1000) * (id_bytes + 1))
    assert set(numbers.tolist()) == {7}
    assert left == (id_bytes > 1)


class LookedUp(dict[int, int]):
    """Strides that count how often one is asked for: once per record that is gone through by itself."""

    count = 0

    def get(self, number: int, default: int | None = None) -> int | None:  # type: ignore[override]
        self.count += 1
        return super().get(number, default)


@pytest.mark.parametrize(
    "messages",
    [
        [b"\3ab"],
        [b"\3ab", b"\5cd"],  # as long as one another, of two groups
        [b"\2" + struct.pack("<I", n) + bytes(n) for n in (4, 2)],  # of one group, not as long as one another
        [b"\2" + struct.pack("<I", n) + bytes(n) for n in range(32)],
    ],
    ids=["one", "two groups", "two lengths", "many lengths"],
)
def test_messages_that_a_logger_writes_over_and_over_are_not_gone_through_one_by_one(messages: list[bytes]) -> None:
    strides = LookedUp({**STRIDES, 5: 3})
    places, numbers, left = record_places(bytes_of(b"".join(messages * 3000)), strides, 1)
    assert (places.size, left) == (3000 * len(messages), 0)
    assert numbers.tolist() == [message[0] for message in messages] * 3000
    assert strides.count <= 128


def test_a_record_of_no_group_is_refused_behind_many_that_repeat() -> None:
    content = (b"\3ab" * 500) + b"\4ab"
    with pytest.raises(MdfDamageError, match="number 4, 1500 bytes behind"):
        record_places(bytes_of(content), STRIDES, 1)
