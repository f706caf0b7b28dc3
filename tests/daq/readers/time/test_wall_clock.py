import datetime as dt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.readers.text.dewesoft_time import parse_dewesoft_stamp
from recoil_acquisition.readers.time.wall_clock import LEAST_ALIKE, Stamps, parse_time_of_day, parse_wall_clock

START = dt.datetime(2026, 8, 3, 23, 59, 58)


def printed(ns: int, form: str, decimals: int, ending: str) -> str:
    second, fraction = divmod(ns, 1_000_000_000)
    whole = (START + dt.timedelta(seconds=second)).strftime(form)
    return f"{whole}.{f'{fraction:09d}'[:decimals]}{ending}"


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=60)
@given(
    form=st.sampled_from(["%Y-%m-%dT%H:%M:%S", "%d.%m.%Y %H:%M:%S", "%Y/%m/%d %H:%M:%S"]),
    decimals=st.integers(1, 9),
    ending=st.sampled_from(["", "Z", " UTC", "+02:00", "-0330"]),
    step_ns=st.integers(1, 400_000_000),
    count=st.integers(1, 60),
)
def test_stamps_of_one_layout_are_read_as_each_of_them_would_be(form, decimals, ending, step_ns, count):
    cells = [printed(i * step_ns, form, decimals, ending) for i in range(count)]
    together, alone = Stamps(parse_wall_clock), Stamps(parse_wall_clock)
    np.testing.assert_array_equal(together.seconds(cells), [alone.seconds([cell])[0] for cell in cells])
    assert together.first == alone.first
    assert together.resolution_s == alone.resolution_s == 10.0**-decimals


@pytest.mark.parametrize(
    ("parse", "cell"),
    [(parse_wall_clock, "2026-08-03 12:00:00.{}"), (parse_dewesoft_stamp, "3-Aug-26 12:00:00.{}"),
     (parse_time_of_day, "12:00:00,{}")],
)  # fmt: skip
def test_each_kind_of_stamp_is_read_alike_in_a_row(parse, cell):
    cells = [cell.format(f"{i:03d}") for i in range(100)]
    np.testing.assert_allclose(Stamps(parse).seconds(cells), 1e-3 * np.arange(100), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("cell", "problem"),
    [
        ("2026-08-03 12:00:00.12x", "is not a stamp"),
        ("2026-08-03 12:00:00", ""),
        ("2026-08-03 12:61:00.123", "minute must be in"),
        ("2026-08-03 12:00:00;123", "is not a stamp"),
        ("2026-08-03 12:00:00.١٢٣", ""),
        ("2026-08-03 12:00:00.123\0", "is not a stamp"),
        ("", "is not a stamp"),
    ],
)
def test_a_cell_that_is_unlike_its_neighbours_is_read_for_itself(cell, problem):
    cells = [f"2026-08-03 12:00:00.{i:03d}" for i in range(4 * LEAST_ALIKE)]
    cells[2 * LEAST_ALIKE] = cell
    if not problem:
        assert np.isfinite(Stamps(parse_wall_clock).seconds(cells)).all()
        return
    with pytest.raises(ValueError, match=problem) as caught:
        Stamps(parse_wall_clock).seconds(cells)
    assert caught.value.args[1] == 2 * LEAST_ALIKE


def test_stamps_of_several_zones_are_instants():
    cells = [
        "2026-08-03 12:00:00.5+01:00",
        "2026-08-03 13:00:01+02:00",
        "2026-08-03T11:00:02Z",
        "2026-08-03 05:30:03-05:30",
    ]
    np.testing.assert_allclose(Stamps(parse_wall_clock).seconds(cells), [0.0, 0.5, 1.5, 2.5])


def test_a_leap_second_is_called_that():
    with pytest.raises(ValueError, match=r"is a leap second, .* export relative time"):
        parse_wall_clock("2016-12-31 23:59:60.5Z")


def test_a_change_to_an_unknown_zone_is_named_with_its_row():
    cells = [f"2026-08-03 12:00:{i // 20:02d}.{5 * (i % 20):02d}{'Z' if i < 40 else ''}" for i in range(60)]
    with pytest.raises(ValueError, match="the zone changes from UTC to") as caught:
        Stamps(parse_wall_clock).seconds(cells)
    assert caught.value.args[1] == 40


@pytest.mark.parametrize(
    ("cell", "text"),
    [
        ("2026-08-03 02:23:05.25 pm", "2026-08-03T14:23:05.25"),
        ("2026/8/3 12:00:00 AM", "2026-08-03T00:00:00"),
        ("3.8.2026 12:00:00 p.m.", "2026-08-03T12:00:00"),
        ("08/25/2026 2:23:05,250 PM", "2026-08-25T14:23:05.250"),
        ("25/08/2026 14:23:05", "2026-08-25T14:23:05"),
        ("25-08-2026, 14:23:05Z", "2026-08-25T14:23:05"),
        ("08/08/2026 14:23:05", "2026-08-08T14:23:05"),
    ],
)
def test_a_date_is_read_whose_order_only_one_reading_has_and_halves_of_the_day_are(cell, text):
    stamps = Stamps(parse_wall_clock)
    assert stamps.seconds([cell]).tolist() == [0.0]
    assert stamps.start.text == text


@pytest.mark.parametrize("cell", ["13/13/2026 14:23:05", "08/25/2026 14:23:05 PM", "2026-08-03 0:23:05 am", "1:00 PM"])
def test_what_no_calendar_or_clock_has_is_refused(cell):
    with pytest.raises(ValueError, match=r"is not a|month must be|the hour"):
        Stamps(parse_wall_clock).seconds([cell])


@pytest.mark.parametrize(
    ("cells", "seconds", "start"),
    [
        (["03/04/2026 11:59:59 PM", "03/04/2026 11:59:59.5 PM"], [0.0, 0.5], None),
        (["03/12/2026 23:59:59", "03/13/2026 00:00:01"], [0.0, 2.0], "2026-03-12T23:59:59"),
        (["12/03/2026 23:59:59", "13/03/2026 00:00:01"], [0.0, 2.0], "2026-03-12T23:59:59"),
        (["02/28/2026 23:59:59", "03/01/2026 00:00:01"], [0.0, 2.0], "2026-02-28T23:59:59"),
    ],
)
def test_a_day_above_twelve_anywhere_tells_the_order_of_all_dates(cells, seconds, start):
    stamps = Stamps(parse_wall_clock)
    together = [float(stamps.seconds([cell])[0]) for cell in cells]
    assert together == seconds
    assert Stamps(parse_wall_clock).seconds(cells).tolist() == seconds
    assert (None if stamps.start is None else stamps.start.text) == start


@pytest.mark.parametrize(
    ("cells", "problem"),
    [
        (["03/04/2026 23:59:59", "03/05/2026 00:00:01"], "whether day or month is first"),
        (["05/05/2026 23:59:59", "05/06/2026 00:00:01"], "whether day or month is first"),
        (["03/25/2026 23:59:59", "25/03/2026 23:59:59"], "day and month change places"),
    ],
)
def test_dates_that_change_while_their_order_is_open_are_refused(cells, problem):
    with pytest.raises(ValueError, match=problem) as caught:
        Stamps(parse_wall_clock).seconds(cells)
    assert caught.value.args[1] == 1


def test_a_time_of_day_in_halves_is_read():
    cells = ["11:59:59.5 AM", "12:00:00 PM", "1:00:00 PM"]
    assert Stamps(parse_time_of_day).seconds(cells).tolist() == [0.0, 0.5, 3600.5]
    cells = [f"01:00:00.{i:03d} PM" for i in range(100)]
    np.testing.assert_allclose(Stamps(parse_time_of_day).seconds(cells), 1e-3 * np.arange(100), rtol=0, atol=1e-12)
    assert parse_dewesoft_stamp("3-Aug-26 02:23:05.123 PM").second == dt.datetime(2026, 8, 3, 14, 23, 5)
