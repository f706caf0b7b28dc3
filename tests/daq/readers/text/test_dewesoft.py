from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, MissingChannelError, ReadError
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.text.dewesoft import DewesoftTextReader
from recoil_acquisition.readers.text.dewesoft_time import _NAMES, MONTHS, parse_dewesoft_stamp, rate_from_stamps
from recoil_acquisition.readers.time.wall_clock import Stamps
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import dewesoft_text, motion_rows

READER = DewesoftTextReader()
opened = partial(open_bytes, READER, "a.csv")


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ","), (";", "."), ("\t", ","), ("\t", ".")])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("preamble", [(), ("Prüfstand 3", "", "Events;1", "Time of export: 12:00")])
def test_every_way_of_writing_gives_the_same_numbers(
    separator: str, decimal: str, encoding: str, preamble: tuple[str, ...], tmp_path: Path
) -> None:
    rows = motion_rows(50)
    content = dewesoft_text(rows, separator=separator, decimal=decimal, encoding=encoding, preamble=preamble)
    assert READER.claims(Head(content))
    recording = opened(tmp_path, content)
    assert [(s.name, s.unit) for s in recording.signals] == [("AI 1/acc", "m/s2"), ("AI 2/p", "MPa")]
    expected = np.array([float(f"{r[1]:.15g}") for r in rows])
    np.testing.assert_array_equal(recording.read("AI 1/acc"), expected)
    assert recording.metadata["preamble"] == list(preamble)
    assert recording.time_base("AI 1/acc").step_s == 5e-5
    assert recording.notes == ()


def test_samples_are_not_parsed_before_they_are_asked_for(tmp_path: Path) -> None:
    recording = opened(tmp_path, "Time (s),a (V)\n0.0,1\n0.1,2\n0.2,broken\n0.3,4\n")
    assert recording.signals[0].sample_count == 4
    with pytest.raises(CorruptFileError, match="line 4, column 'a \\(V\\)'"):
        recording.read("a")


def test_milliseconds_and_delphi_exponents_are_read(tmp_path: Path) -> None:
    recording = opened(tmp_path, "Time (ms),a (V)\n" + "".join(f"{0.5 * i:.1f},-{i}.5E-015\n" for i in range(30)))
    base = recording.time_base("a")
    assert base.step_s == 5e-4
    assert base.start_s == 0.0
    assert recording.read("a")[3] == -3.5e-15


def test_an_empty_cell_is_a_lost_sample_and_noted(tmp_path: Path) -> None:
    recording = opened(tmp_path, "Time (s),a (V),Video/Camera 0 ()\n0.0,1,0\n0.1,,1\n0.2,3,\n")
    np.testing.assert_array_equal(recording.read("a"), [1, np.nan, 3])
    np.testing.assert_array_equal(recording.read("Video/Camera 0"), [0, 1, np.nan])
    assert sum("1 of 3 cells are empty" in note for note in recording.notes) == 2
    assert recording.signals[1].unit == ""


def test_equal_names_are_told_apart_and_noted(tmp_path: Path) -> None:
    recording = opened(tmp_path, "Time (s),a (V),a (V)\n0.0,1,2\n0.1,3,4\n")
    assert [s.name for s in recording.signals] == ["a", "a#2"]
    np.testing.assert_array_equal(recording.read("a#2"), [2, 4])
    assert any("named 'a'" in note for note in recording.notes)


def test_a_gap_makes_a_stamped_time_base_and_a_note(tmp_path: Path) -> None:
    times = [0.0, 0.001, 0.002, 0.003, 0.5, 0.501, 0.502]
    recording = opened(tmp_path, "Time (s),a (V)\n" + "".join(f"{t:.3f},1\n" for t in times))
    base = recording.time_base("a")
    assert base.step_s is None
    np.testing.assert_array_equal(base.times_s, times)
    assert any("(1 gaps)" in note for note in recording.notes)


def test_time_that_does_not_increase_is_refused_with_its_line(tmp_path: Path) -> None:
    recording = opened(tmp_path, "Time (s),a (V)\n0.0,1\n0.1,2\n0.1,3\n0.5,4\n")
    with pytest.raises(CorruptFileError, match="line 4"):
        recording.time_base("a")


def test_a_missing_time_is_refused(tmp_path: Path) -> None:
    recording = opened(tmp_path, "Time (s),a (V)\n0.0,1\n,2\n0.2,3\n")
    with pytest.raises(CorruptFileError, match="line 3, time column"):
        recording.time_base("a")


@pytest.mark.parametrize("heading", ["Time", "Time (-)", "Time (turns)"])
def test_time_in_an_unknown_unit_is_never_guessed(heading: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=r"line 1: the unit of the time column is unknown"):
        opened(tmp_path, f"{heading},a (V)\n0.0,1\n0.1,2\n")


def absolute_text(rate_hz: float, count: int, month: str = "Aug") -> str:
    stamps = 5.757 + np.floor(np.arange(count) / rate_hz * 1000 + 1e-9) / 1000
    lines = [f"03-{month}-26 12:23:{s:06.3f},{i}" for i, s in enumerate(stamps)]
    return "Time (-),AI 1/AI 1 (m/s2)\n" + "".join(line + "\n" for line in lines)


@pytest.mark.parametrize(("rate_hz", "count"), [(1000.0, 40), (20000.0, 2000), (100000.0, 4000), (200000.0, 9000)])
def test_absolute_time_is_rebuilt_from_the_row_number(rate_hz: float, count: int, tmp_path: Path) -> None:
    recording = opened(tmp_path, absolute_text(rate_hz, count))
    base = recording.time_base("AI 1/AI 1")
    assert base.step_s == 1 / rate_hz
    assert base.start_s == 0.0
    start = recording.absolute_start
    assert start is not None
    assert (start.text, start.zone) == ("2026-08-03T12:23:05.757", "unknown")
    assert any(f"{rate_hz:g} Hz" in note for note in recording.notes)


def test_absolute_time_too_short_for_a_rate_is_refused_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="too few") as few:
        opened(tmp_path, absolute_text(1000.0, 10)).time_base("AI 1/AI 1")
    assert few.value.remedy is not None
    with pytest.raises(ReadError, match="too short to decide"):
        opened(tmp_path, absolute_text(20000.0, 30)).time_base("AI 1/AI 1")


def test_absolute_time_with_a_jump_is_refused(tmp_path: Path) -> None:
    lines = absolute_text(1000.0, 60).splitlines()
    del lines[30:40]
    with pytest.raises(ReadError, match="no constant"):
        opened(tmp_path, "\n".join(lines) + "\n").time_base("AI 1/AI 1")


@pytest.mark.parametrize(
    ("month", "number"), [("Okt", 10), ("Mrz", 3), ("févr.", 2), ("août", 8), ("DIC", 12), ("maj", 5), ("Ağu", 8)]
)
def test_a_month_in_a_language_that_tells_it_is_read(month: str, number: int, tmp_path: Path) -> None:
    start = opened(tmp_path, absolute_text(1000.0, 40, month=month)).absolute_start
    assert start is not None
    assert start.text == f"2026-{number:02d}-03T12:23:05.757"


def test_every_month_name_stands_for_one_month() -> None:
    assert len(MONTHS) == sum(len(names.split()) for names in _NAMES)


@pytest.mark.parametrize("month", ["lis", "srp", "Xyz"])
def test_a_month_that_is_not_told_is_refused_with_what_to_export(month: str, tmp_path: Path) -> None:
    recording = opened(tmp_path, absolute_text(1000.0, 40, month=month))
    with pytest.raises(CorruptFileError, match=f"line 2, time column: '{month}' is not known.*relative time"):
        recording.time_base("AI 1/AI 1")


def test_a_waterfall_is_refused_by_name(tmp_path: Path) -> None:
    text = "OT 1/Gov/Order\nwaterfall (g (peak))\nSpeed (rpm)/Orders (-),0,0.125\n1000,1,2\n1100,3,4\n"
    assert READER.claims(Head(text.encode()))
    with pytest.raises(ReadError, match="not a time history"):
        opened(tmp_path, text)


def test_a_decimal_comma_between_commas_is_refused_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match="export with a decimal point"):
        opened(tmp_path, "Time (s),a (V)\n0,0,1,5\n0,1,2,5\n").read("a")


def test_a_file_without_a_time_heading_is_refused(tmp_path: Path) -> None:
    assert not READER.claims(Head(b"x,y\n1,2\n"))
    with pytest.raises(CorruptFileError, match="no header row"):
        opened(tmp_path, "x,y\n1,2\n")


def test_an_unknown_signal_names_the_nearest_first(tmp_path: Path) -> None:
    recording = opened(tmp_path, dewesoft_text(motion_rows()))
    with pytest.raises(MissingChannelError) as caught:
        recording.read("AI 2/P")
    assert caught.value.nearest[0] == "AI 2/p"


@pytest.mark.parametrize("year", ["26", "2026"])
def test_a_stamp_is_read_with_two_or_four_digits_of_year(year: str) -> None:
    stamp = parse_dewesoft_stamp(f"3-aug-{year} 1:02:03.25")
    assert stamp.text == "2026-08-03T01:02:03.25"
    assert stamp.decimals == 2


def test_a_record_over_midnight_goes_on() -> None:
    stamps = Stamps(parse_dewesoft_stamp)
    np.testing.assert_array_equal(stamps.seconds(["31-Dec-25 23:59:59.999", "01-Jan-26 00:00:00.001"]), [0.0, 0.002])
    assert stamps.resolution_s == 1e-3


def test_a_rate_beside_the_decades_is_taken_only_where_no_decade_agrees() -> None:
    stamps = np.floor(np.arange(3000) / 2400.0 * 1000) / 1000
    assert rate_from_stamps(stamps, 1e-3) == (2400.0, ())


@pytest.mark.parametrize("shot", ["plain", "ringing", "gains"])
def test_a_shot_of_an_independent_simulation_is_read(shot: str) -> None:
    path = shared_file(f"shots/{shot}/dewetron.csv")
    truth = json.loads((path.parent / "truth.json").read_text())
    assert READER.claims(Head.of(path))
    recording = READER.open(path, Declarations("dewetron"))
    assert len(recording.signals) == 8
    base = recording.time_base("AI 6/p_breech")
    assert (base.step_s, base.start_s, base.count) == (2e-5, 0.0, 21000)
    pressure = recording.read("AI 6/p_breech")
    assert base.times_s[np.argmax(pressure > 20.0)] == pytest.approx(truth["t_fire"], abs=0.01)
    assert recording.notes == ()


def test_the_published_excerpt_with_absolute_time_is_read() -> None:
    path = shared_file("dewetron/dewesoftx_abs_time_excerpt_3Axis_acc_0009.csv")
    recording = READER.open(path, Declarations("dewetron"))
    assert [s.name for s in recording.signals][3] == "Time int/der 1/AI 1/v"
    assert recording.read("Time int/der 2/AI 2/v")[0] == -5.02480569563517e-15
    assert recording.time_base("AI 1/AI 1").step_s == 1e-3
    assert any("960" in note for note in recording.notes)


# ---- times of day


def of_day(ms: int, mark: str = ".") -> str:
    return f"{ms // 3_600_000 % 24:02d}:{ms // 60_000 % 60:02d}:{ms // 1000 % 60:02d}{mark}{ms % 1000:03d}"


@pytest.mark.parametrize(("separator", "mark"), [(",", "."), (";", ","), ("\t", ".")])
@pytest.mark.parametrize("first_ms", [0, 45_296_780, 86_399_500])
def test_a_time_of_day_is_relative_to_the_first_row(separator: str, mark: str, first_ms: int, tmp_path: Path) -> None:
    rows = [separator.join((of_day(first_ms + 10 * i, mark), f"{i}{mark}25")) for i in range(200)]
    recording = opened(tmp_path, "\n".join([f"Time{separator}a (g)", *rows, ""]))
    np.testing.assert_array_equal(recording.read("a"), np.arange(200) + 0.25)
    base = recording.time_base("a")
    np.testing.assert_allclose(base.times_s, 0.01 * np.arange(200), atol=1e-12)
    assert recording.absolute_start is None


def test_a_time_of_day_without_a_fraction_or_a_rate_is_refused(tmp_path: Path) -> None:
    rows = "".join(f"{of_day(7 * i)},{i}\n" for i in range(200))
    with pytest.raises(ReadError, match=r"absolute time is not fine enough.*declare its layout") as caught:
        opened(tmp_path, f"Time,a (g)\n{rows}").time_base("a")
    assert ".dxd" not in str(caught.value)


def test_the_shared_table_with_times_of_day_is_read() -> None:
    path = shared_file("reports/hms.csv")
    recording = READER.open(path, Declarations("dewetron"))
    assert recording.time_base("acc").step_s == 0.01
    np.testing.assert_allclose(recording.read("acc"), np.sin(np.arange(200)), atol=6e-4)
    np.testing.assert_array_equal(recording.read("p"), np.arange(200.0))


def two_times(second: str, times: Callable[[int], str]) -> str:
    rows = "".join(f"{k * 1e-3:.3f},{k},{times(k)},{k}\n" for k in range(60))
    return f"Time (s),p (MPa),{second},a (m/s2)\n{rows}"


@pytest.mark.parametrize(
    ("heading", "times"),
    [
        ("Time (s)", lambda k: f"{k * 2e-3:.3f}"),
        ("Time (ms)", lambda k: f"{2 * k}"),
        ("Time 2 (s)", lambda k: f"{k * 1e-3 + 0.5:.3f}"),
        ("time_2 (s)", lambda k: "" if k % 2 else f"{k * 1e-3:.3f}"),
    ],
)
def test_several_columns_of_time_that_differ_are_refused(
    heading: str, times: Callable[[int], str], tmp_path: Path
) -> None:
    with pytest.raises(ReadError, match="several columns of time differ, and which signals each dates is not stated"):
        opened(tmp_path, two_times(heading, times))


@pytest.mark.parametrize(
    ("heading", "times"), [("Time (s)", lambda k: f"{k * 1e-3:.3f}"), ("Time (ms)", lambda k: f"{k}.0")]
)
def test_a_column_of_time_that_stands_again_is_no_signal(
    heading: str, times: Callable[[int], str], tmp_path: Path
) -> None:
    recording = opened(tmp_path, two_times(heading, times))
    assert [one.name for one in recording.signals] == ["p", "a"]
    assert recording.time_base("a").rate_hz == pytest.approx(1000.0)


def test_lines_that_end_in_two_ways_lose_no_row_in_silence(tmp_path: Path) -> None:
    rows = [f"{k * 1e-3:.3f},{k},1" for k in range(60)]
    content = "Time (s),p (MPa),a (m/s2)\n" + "\n".join(rows[:40]) + "\n" + "\r".join(rows[40:]) + "\r"
    with pytest.raises(CorruptFileError, match="lines end in two ways"):
        opened(tmp_path, content)


@pytest.mark.parametrize("last", ["1e308", "1700000000000000000", "-1e308"])
def test_a_time_that_no_recording_has_is_refused(last: str, tmp_path: Path) -> None:
    rows = [f"{k * 1e-3:.3f},{k},1\n" for k in range(60)]
    first, behind = ([f"{last},0,1\n"], []) if last[0] == "-" else ([], [f"{last},60,1\n"])
    recording = opened(tmp_path, "".join(["Time (s),p (MPa),a (m/s2)\n", *first, *rows, *behind]))
    with pytest.raises(CorruptFileError, match="the time is longer than any recording"):
        recording.time_base("p")
