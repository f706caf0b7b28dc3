"""The times of measured channels, by how a file states them."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.mdf.reader import MdfReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.timebase import TimeBase
from tests.builders.mdf_logs import Blocks, identification_block

STORED, COMPUTED = 2, 3
UNSIGNED, FLOAT = 0, 4


def opened(
    folder: Path, kind: int, data_type: int, stamps: Sequence[bytes], conversion: Callable[[Blocks], int]
) -> Recording:
    """Open a file of a channel `n` that has a byte behind each stamp."""
    blocks, width = Blocks(identification_block(b"MDF     ")), len(stamps[0])
    value = blocks.column("n", 0, UNSIGNED, width, 8, 0)
    time = blocks.column("t", kind, data_type, 0, 8 * width, value, conversion=conversion(blocks))
    sizes = struct.pack("<QQHHLLL", 0, len(stamps), 0, 0, 0, width + 1, 0)
    group = blocks.add("##CG", (0, time, 0, 0, 0, 0), sizes)
    samples = blocks.add("##DT", (), b"".join(stamp + b"x" for stamp in stamps))
    path = folder / "a.mf4"
    path.write_bytes(blocks.closed(blocks.add("##DG", (0, group, samples, 0), bytes(8))))
    return MdfReader().open(path, Declarations("dewetron"))


def time_base(
    folder: Path, kind: int, data_type: int, stamps: Sequence[bytes], conversion: Callable[[Blocks], int]
) -> TimeBase:
    return opened(folder, kind, data_type, stamps, conversion).time_base("n")


def test_times_that_are_computed_from_the_number_of_a_record_are_even(tmp_path: Path) -> None:
    base = time_base(tmp_path, COMPUTED, UNSIGNED, [b""] * 7, lambda blocks: blocks.linear(2.0, 0.5))
    assert (base.start_s, base.step_s, base.count) == (2.0, 0.5, 7)


def test_times_that_are_computed_by_a_table_are_not_taken_to_be_even(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="its time is computed by a conversion that is not linear"):
        time_base(tmp_path, COMPUTED, UNSIGNED, [b""] * 2, lambda blocks: blocks.table([(0.0, 0.0), (1.0, 9.0)]))


def test_counts_that_a_table_makes_times_of_are_read_through_it(tmp_path: Path) -> None:
    times = [(0.0, 0.0), (50.0, 0.1), (100.0, 0.4)]
    base = time_base(tmp_path, STORED, UNSIGNED, [bytes([n]) for n in (0, 50, 100)], lambda blocks: blocks.table(times))
    np.testing.assert_array_equal(base.times_s, [0.0, 0.1, 0.4])


@pytest.mark.parametrize("first_s", [0.0, 1000.0])
def test_the_rounding_of_short_floats_is_not_taken_for_an_uneven_rate(first_s: float, tmp_path: Path) -> None:
    # near 1000 s neighbouring floats of 32 bits are 61 us apart
    stamps = [struct.pack("<f", first_s + n / 1000) for n in range(200)]
    base = time_base(tmp_path, STORED, FLOAT, stamps, lambda blocks: blocks.linear(0.0, 1.0))
    assert base.step_s == pytest.approx(1e-3)
    assert base.start_s == pytest.approx(first_s, abs=1e-4)


@pytest.mark.parametrize(("third", "is_even"), [(31, True), (28, False)])
def test_a_tick_is_what_a_clock_resolves_where_samples_are_ten_ticks_apart(
    third: int, is_even: bool, tmp_path: Path
) -> None:
    # a rate that the ticks do not divide: most samples are ten ticks apart, or nine
    stamps = [struct.pack("<I", n * third // 3) for n in range(60)]
    base = time_base(tmp_path, STORED, UNSIGNED, stamps, lambda blocks: blocks.linear(0.0, 1e-3))
    assert (base.step_s is not None) == is_even


def test_times_of_which_there_is_nothing_to_say_are_not_noted(tmp_path: Path) -> None:
    stamps = [struct.pack("<d", n / 1000) for n in range(9)]
    assert opened(tmp_path, STORED, FLOAT, stamps, lambda blocks: blocks.linear(0.0, 1.0)).notes == ()
