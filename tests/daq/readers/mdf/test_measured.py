"""The samples of groups that are stored together: held once, and given as they are stored."""

from __future__ import annotations

import struct
import tracemalloc
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.readers.mdf.channel_groups import iter_groups
from recoil_acquisition.readers.mdf.measured import NumberChannel, StoredGroups
from recoil_acquisition.readers.mdf.number_conversion import NumberConversion
from recoil_acquisition.readers.mdf.reader import Mdf4Contents
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders.mdf3_files import DATA, TIME, UNSIGNED, OldFile
from tests.builders.mdf_logs import Blocks, identification_block

GROUPS, RECORDS = 20, 20_000


def old_file() -> bytes:
    file, following = OldFile(), 0
    for number in range(GROUPS):
        time = file.channel("t", TIME, 0, 0, UNSIGNED, rate=0.001)
        group = file.group(file.channel(f"n{number}", DATA, 0, 8, UNSIGNED, time), 1, RECORDS)
        following = file.data_group(group, file.records(bytes(RECORDS)), following)
    return file.closed(following)


def new_file() -> bytes:
    blocks, following = Blocks(identification_block(b"MDF     ")), 0
    for number in range(GROUPS):
        value = blocks.column(f"n{number}", 0, 0, 0, 8, 0)
        time = blocks.column("t", 3, 0, 0, 0, value, conversion=blocks.linear(0.0, 0.001))
        sizes = struct.pack("<QQHHLLL", 0, RECORDS, 0, 0, 0, 1, 0)
        group = blocks.add("##CG", (0, time, 0, 0, 0, 0), sizes)
        following = blocks.add("##DG", (following, group, blocks.add("##DT", (), bytes(RECORDS)), 0), bytes(8))
    return blocks.closed(following)


def test_all_groups_share_one_copy_of_their_file(tmp_path: Path) -> None:
    for content in (old_file(), new_file()):
        (tmp_path / "a").write_bytes(content)
        recording = recognise(tmp_path / "a").open(tmp_path / "a", Declarations("c"))
        tracemalloc.start()
        assert [recording.read(signal.name).size for signal in recording.signals] == [RECORDS] * GROUPS
        held = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        assert held < 2 * len(content)


NATURAL, SIGNED = 0, 2


def integers(path: Path, data_type: int, bits: int, numbers: Sequence[int]) -> NumberChannel:
    """A file of one channel, whose bits are the lowest of 64."""
    blocks = Blocks(identification_block(b"MDF     "))
    value = blocks.column("n", 0, data_type, 0, bits, 0)
    sizes = struct.pack("<QQHHLLL", 0, len(numbers), 0, 0, 0, 8, 0)
    group_at = blocks.add("##CG", (0, value, 0, 0, 0, 0), sizes)
    samples = blocks.add("##DT", (), b"".join(struct.pack("<Q", number % 2**64) for number in numbers))
    content = blocks.closed(blocks.add("##DG", (0, group_at, samples, 0), bytes(8)))
    path.write_bytes(content)
    (group,) = iter_groups(content)
    stored = StoredGroups((group,), lambda: Mdf4Contents(path.read_bytes()))
    return NumberChannel(stored, group, group.channels[0], NumberConversion(0, ()), None)


@pytest.mark.parametrize(
    ("bits", "size"), [(1, 1), (8, 1), (9, 2), (16, 2), (17, 4), (32, 4), (33, 8), (63, 8), (64, 8)]
)
def test_counts_have_the_smallest_type_that_holds_their_bits(bits: int, size: int, tmp_path: Path) -> None:
    for data_type, letter, numbers in (
        (NATURAL, "u", [0, 1, 2**bits - 1]),
        (SIGNED, "i", [0, -1, -(2 ** (bits - 1)), 2 ** (bits - 1) - 1]),
    ):
        raw = integers(tmp_path / "a.mf4", data_type, bits, numbers).counts("V", 0.5, 1.0, 0, len(numbers))
        assert raw is not None
        assert raw.counts.dtype == f"{letter}{size}"
        assert raw.counts.tolist() == numbers


def test_samples_of_a_file_that_is_gone_since_are_still_given(tmp_path: Path) -> None:
    channel = integers(tmp_path / "a.mf4", NATURAL, 8, range(9))
    np.testing.assert_array_equal(channel.samples(0, 2), [0, 1])
    (tmp_path / "a.mf4").unlink()
    np.testing.assert_array_equal(channel.samples(2, 9), range(2, 9))
