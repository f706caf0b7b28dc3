"""Cells of the armed screen: numbers with a unit as a range engineer reads them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.capture.engine import Level
from recoil_daq.live.screen.screen_cells import (
    METER_CELLS,
    disk_left,
    folder_text,
    meter,
    now_text,
    peak_text,
)
from tests.builders.live_status import BRAKE, RATE, state_of, status


@pytest.mark.parametrize(
    ("value", "unit", "end", "text"),
    [
        (2e4, "Pa", 300e6, "0.02 MPa"),
        (1.66e6, "Pa", 6e6, "1.660 MPa"),
        (3e4, "Pa", 1e6, "30.0 kPa"),
        (-2.1, "m/s^2", 12_000.0, "-2.1 m/s2"),
        (-2.1, "m/s^2", 5000.0, "-2.1 m/s2"),
        (-8e-4, "rad/s", 1.0, "-0.8 mrad/s"),
        (-1e-5, "rad/s", 1.0, "0.0 mrad/s"),
        (1.5, "kg", 900.0, "1.50 kg"),
        (7e11, "Pa", 300e6, "700 GPa"),
        (math.inf, "Pa", 300e6, "-"),
    ],
)
def test_a_level_keeps_the_prefix_of_its_range_so_that_only_digits_move(value, unit, end, text) -> None:
    assert now_text(replace(BRAKE, unit=unit, range=(-end, end), level=Level(value, value, value))) == text


@given(st.floats(0.0, 16e6), st.floats(0.0, 16e6))
def test_levels_of_one_channel_have_one_unit_and_one_width_behind_the_point(one: float, other: float) -> None:
    texts = [now_text(replace(BRAKE, level=Level(x, x, x))) for x in (one, other)]
    assert len({text.partition(".")[2] for text in texts if "." in text} - {""}) >= 1
    assert {text.split(" ")[1] for text in texts} == {"MPa"}
    assert {len(text.partition(".")[2]) for text in texts} == {len("000 MPa")}


@pytest.mark.parametrize(
    ("peak", "text"), [((-8e5, 131.4e6), "131.4 MPa"), ((-2260.0, 1240.0), "-2.26 kPa"), ((-4e4, 7.48e6), "7.48 MPa")]
)
def test_the_peak_is_the_extreme_that_is_further_from_zero(peak, text: str) -> None:
    assert peak_text(replace(BRAKE, peak=peak)) == text


def test_the_level_has_the_trigger_and_the_last_peak_in_it() -> None:
    assert meter(BRAKE) == "·█▒·······┃·········"
    assert meter(replace(BRAKE, peak=(-1e5, 12e6))) == "·█▒·······┃····▲····"
    assert meter(replace(BRAKE, peak=(0.0, 8e6))) == meter(BRAKE)  # the trigger is seen before the peak
    assert meter(replace(BRAKE, range=None)) == ""
    assert meter(replace(BRAKE, level=Level(17e6, 15e6, 17e6))).endswith("▒█")
    assert meter(RATE).index("█") == 10


numbers = st.floats(allow_nan=True, allow_infinity=True)


@given(numbers, numbers, numbers, st.one_of(st.none(), numbers), numbers)
def test_the_level_is_drawn_or_left_out_for_whatever_a_sensor_sends(last, low, high, trigger, peak) -> None:
    drawn = meter(replace(BRAKE, level=Level(last, low, high), triggers_at=trigger, peak=(peak, peak)))
    if all(map(math.isfinite, (last, low, high))):
        assert len(drawn) == METER_CELLS
        assert drawn.count("█") == 1
    else:
        assert drawn == ""


@pytest.mark.parametrize(
    ("disk", "written", "text", "little"),
    [
        (0, 0, "0.0 GB, 0 min", True),
        (0, 36 * 10**9, "0.0 GB, 0 min", True),
        (2 * 10**9, 0, "2.0 GB", False),
        (9 * 10**8, 0, "0.9 GB", True),
        (77 * 10**9, 0, "77 GB", False),
        (83 * 10**9, 36 * 10**9, "83 GB, 2.4 h", False),
        (35 * 10**8, 3725 * 10**6, "3.5 GB, 58 min", False),
        (35 * 10**8, 3725 * 10**6 * 8, "3.5 GB, 7 min", True),
    ],
)
def test_a_disk_that_is_nearly_full_is_little(disk: int, written: int, text: str, little: bool) -> None:
    assert disk_left(state_of(status(disk_free_bytes=disk, journal_bytes=written))) == (text, little)


def test_a_long_folder_is_named_by_its_end() -> None:
    assert folder_text(Path("incoming")) == "incoming/"
    assert folder_text(Path("/mnt/recorder/of/the/day/incoming"), most=24) == ".../incoming/"
