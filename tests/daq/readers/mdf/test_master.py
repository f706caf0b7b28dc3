"""The times of measured channels and of frames, by how a file states them."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.mdf.channel_groups import (
    INVALIDATION,
    ChannelGroup,
    DataGroup,
    MdfChannel,
    MdfDamageError,
    MdfUnsupportedError,
)
from recoil_acquisition.readers.mdf.master import times_ns
from recoil_acquisition.readers.mdf.reader import MdfReader
from recoil_acquisition.readers.mdf.records import Records
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from tests.builders.mdf_logs import Blocks, identification_block
from tests.builders.opened_files import open_bytes

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
    content = blocks.closed(blocks.add("##DG", (0, group, samples, 0), bytes(8)))
    return open_bytes(MdfReader(), "a.mf4", folder, content)


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


@pytest.mark.parametrize("third", [31, 28])
def test_even_samples_whose_rate_the_ticks_do_not_divide_are_even(third: int, tmp_path: Path) -> None:
    # most samples are ten ticks apart, or nine
    stamps = [struct.pack("<I", n * third // 3) for n in range(60)]
    base = time_base(tmp_path, STORED, UNSIGNED, stamps, lambda blocks: blocks.linear(0.0, 1e-3))
    assert base.step_s == pytest.approx(third / 3000, rel=5e-3)


def test_samples_that_lie_a_tick_off_their_beat_are_not_even(tmp_path: Path) -> None:
    ticks = [9 * n + (n % 7 == 3) + 4 * (n % 11 == 5) for n in range(60)]
    stamps = [struct.pack("<I", tick) for tick in ticks]
    base = time_base(tmp_path, STORED, UNSIGNED, stamps, lambda blocks: blocks.linear(0.0, 1e-3))
    assert base.step_s is None
    np.testing.assert_allclose(base.times_s, 1e-3 * np.array(ticks))


def test_times_of_which_there_is_nothing_to_say_are_not_noted(tmp_path: Path) -> None:
    stamps = [struct.pack("<d", n / 1000) for n in range(9)]
    assert opened(tmp_path, STORED, FLOAT, stamps, lambda blocks: blocks.linear(0.0, 1.0)).notes == ()


@pytest.mark.parametrize(("unit", "unit_s"), [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("min", 60.0), ("h", 3600.0)])
def test_times_are_in_the_unit_that_their_channel_states(unit: str, unit_s: float, tmp_path: Path) -> None:
    computed = time_base(tmp_path, COMPUTED, UNSIGNED, [b""] * 7, lambda blocks: blocks.linear(2.0, 0.5, unit))
    assert (computed.start_s, computed.step_s) == (2.0 * unit_s, 0.5 * unit_s)
    counts = [bytes([n]) for n in (0, 2, 4, 6)]
    stored = time_base(tmp_path, STORED, UNSIGNED, counts, lambda blocks: blocks.linear(1.0, 0.5, unit))
    np.testing.assert_allclose(stored.times_s, unit_s * np.array([1.0, 2.0, 3.0, 4.0]), rtol=1e-12)


def test_times_in_no_unit_of_time_are_refused_by_name_and_so_is_whoever_asks(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=r"group 0: its time is in 'deg', which is no unit of time"):
        opened(tmp_path, COMPUTED, UNSIGNED, [b""] * 7, lambda blocks: blocks.linear(2.0, 0.5, "deg"))


@pytest.mark.parametrize(("sync", "axis"), [(2, "an angle"), (3, "a distance"), (4, "a count")])
def test_samples_over_another_axis_than_time_are_refused_by_name(sync: int, axis: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mf4"
    opened(tmp_path, COMPUTED, UNSIGNED, [b""] * 7, lambda blocks: blocks.linear(2.0, 0.5))
    content = path.read_bytes()
    place = content.index(bytes([COMPUTED, 1, UNSIGNED, 0]))
    path.write_bytes(content[: place + 1] + bytes([sync]) + content[place + 2 :])
    with pytest.raises(ReadError, match=f"its samples are not over time, but over {axis}"):
        MdfReader().open(path, Declarations("dewetron"))


def test_a_group_over_time_and_angle_is_read_over_time_and_its_angle_is_a_channel(tmp_path: Path) -> None:
    blocks = Blocks(identification_block(b"MDF     "))
    time = blocks.column("t", STORED, FLOAT, 8, 64, 0, conversion=blocks.linear(0.0, 1.0, "ms"))
    angle = blocks.column("phi", STORED, FLOAT, 0, 64, time)
    place = bytes(blocks.content).index(bytes([STORED, 1, FLOAT, 0]), angle)
    blocks.content[place + 1] = 2
    group = blocks.add("##CG", (0, angle, 0, 0, 0, 0), struct.pack("<QQHHLLL", 0, 3, 0, 0, 0, 16, 0))
    samples = blocks.add("##DT", (), struct.pack("<6d", 0.0, 0.0, 1.5, 1.0, 3.0, 2.0))
    path = tmp_path / "a.mf4"
    path.write_bytes(blocks.closed(blocks.add("##DG", (0, group, samples, 0), bytes(8))))
    recording = MdfReader().open(path, Declarations("dewetron"))
    assert [signal.name for signal in recording.signals] == ["phi"]
    np.testing.assert_array_equal(recording.read("phi"), [0.0, 1.5, 3.0])
    assert recording.time_base("phi").step_s == 1e-3


MEASURED, MASTER = 0, 2
TIME, ANGLE = 1, 2
YEAR_S = 366 * 86400


def times(
    *, offset_s: float = 0.0, factor_s: float = 1e-9, data_type: int = UNSIGNED, unit: str = ""
) -> tuple[bytes, MdfChannel]:
    """A conversion, and the channel of 8 bytes that has it; the byte behind says whether a stamp is invalid."""
    blocks = Blocks(bytes(64))
    at = blocks.linear(offset_s, factor_s, unit)
    return bytes(blocks.content), MdfChannel(0, "t", MASTER, TIME, data_type, 0, 0, 64, INVALIDATION, 0, at, 0)


def stamped(rows: list[bytes], *channels: MdfChannel) -> Records:
    group = ChannelGroup(0, DataGroup(0, 0, 0), 7, len(rows), 0, len(rows[0]) - 1, 1, channels, 1)
    return Records(group, np.frombuffer(b"".join(rows), np.uint8).reshape(len(rows), -1))


@pytest.mark.parametrize("offset_s", [0.0, 5.0])
def test_whole_counts_of_nanoseconds_are_kept_exactly_where_floats_could_not(offset_s: float) -> None:
    counts = [2**53 + 1, 2**60 + 1, 2**60 + 3]
    content, master = times(offset_s=offset_s)
    found, sound = times_ns(content, stamped([struct.pack("<Qx", count) for count in counts], master))
    assert found.tolist() == [count + round(offset_s * 1e9) for count in counts]
    assert sound.all()


def test_ticks_that_are_no_whole_nanoseconds_are_rounded_to_one() -> None:
    content, master = times(offset_s=-1.0, factor_s=0.4e-9)
    found, sound = times_ns(content, stamped([struct.pack("<Qx", count) for count in (1, 2, 10)], master))
    assert found.tolist() == [-1_000_000_000, -999_999_999, -999_999_996]
    assert sound.all()


@pytest.mark.parametrize("factor_s", [1.0, 0.4e-9])
def test_stamps_that_are_invalid_or_a_century_away_are_no_times(factor_s: float) -> None:
    content, master = times(factor_s=factor_s)
    decades = round(50 * YEAR_S / factor_s)
    rows = [struct.pack("<Q", count) + mark for count, mark in ((5, b"\0"), (5, b"\1"), (decades, b"\0"))]
    rows += [struct.pack("<Q", count) + b"\0" for count in (2 * decades, 2**64 - 1)]
    found, sound = times_ns(content, stamped(rows, master))
    assert sound.tolist() == [True, False, True, False, False]
    assert found[[0, 2]].tolist() == [round(5 * factor_s * 1e9), 50 * YEAR_S * 1_000_000_000]


def test_floats_that_are_invalid_or_no_numbers_are_no_times() -> None:
    content, master = times(factor_s=1.0, data_type=FLOAT)
    stamps = [(0.25, b"\0"), (0.5, b"\1"), (float("nan"), b"\0"), (float("-inf"), b"\0"), (-0.25, b"\0")]
    found, sound = times_ns(content, stamped([struct.pack("<d", stamp) + mark for stamp, mark in stamps], master))
    assert sound.tolist() == [True, False, False, False, True]
    assert found[sound].tolist() == [250_000_000, -250_000_000]


def test_the_times_are_those_of_the_channel_that_is_a_master_and_one_of_time() -> None:
    content, time = times()
    time = replace(time, byte=16, flags=0)
    angle = replace(time, name="angle", sync=ANGLE, byte=0)
    measured = replace(time, name="duration", kind=MEASURED, byte=8)
    rows = [struct.pack("<QQQx", 1, 2, 3)]
    assert times_ns(content, stamped(rows, angle, measured, time))[0].tolist() == [3]
    with pytest.raises(MdfDamageError, match="has no times"):
        times_ns(content, stamped(rows, angle, measured))


@pytest.mark.parametrize(("unit", "unit_s"), [("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("min", 60.0)])
def test_times_of_frames_are_in_the_unit_that_is_stated(unit: str, unit_s: float) -> None:
    content, channel = times(factor_s=1e-3, offset_s=2.0, unit=unit)
    found, _ = times_ns(content, stamped([struct.pack("<QB", 5, 0)], channel))
    assert found[0] == round(2.005 * unit_s * 1e9)


def test_times_of_frames_in_no_unit_of_time_are_refused_by_name() -> None:
    content, channel = times(unit="deg")
    with pytest.raises(MdfUnsupportedError, match="are in 'deg', no unit of time"):
        times_ns(content, stamped([struct.pack("<QB", 5, 0)], channel))
