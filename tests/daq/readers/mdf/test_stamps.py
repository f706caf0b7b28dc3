"""The times of frames, in whole nanoseconds."""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.readers.mdf.channel_groups import (
    INVALIDATION,
    ChannelGroup,
    DataGroup,
    MdfChannel,
    MdfDamageError,
    MdfUnsupportedError,
)
from recoil_acquisition.readers.mdf.master import times_ns
from recoil_acquisition.readers.mdf.records import Records
from tests.builders.mdf_logs import Blocks

MEASURED, MASTER = 0, 2
TIME, ANGLE = 1, 2
UNSIGNED, FLOAT = 0, 4
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
