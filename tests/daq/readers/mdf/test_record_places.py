"""Records that are stored together are found one by one, however often they repeat."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.readers.mdf.channel_groups import MdfDamageError
from recoil_acquisition.readers.mdf.records import record_places

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
