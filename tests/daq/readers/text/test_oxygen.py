from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.text.dewesoft import DewesoftTextReader
from recoil_acquisition.readers.text.oxygen import OxygenTextReader
from tests.builders import text_tables as build
from tests.builders.opened_files import open_bytes

READER = OxygenTextReader()
opened = partial(open_bytes, READER, "a.csv")


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ","), (";", "."), ("\t", ","), ("|", ",")])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_every_way_of_writing_gives_the_same_numbers(
    separator: str, decimal: str, encoding: str, line_end: str, tmp_path: Path
) -> None:
    header = separator.join(["Time [s]", "AI 1/1 [m/s²]", "AI 2/1 [MPa]"])
    content = build.table(
        ["Prüfstand", header], build.seconds(decimal), separator=separator, decimal=decimal, encoding=encoding,
        line_end=line_end,
    )  # fmt: skip
    assert READER.claims(Head(content)) is Claim.CERTAIN
    assert not DewesoftTextReader().claims(Head(content))
    recording = opened(tmp_path, content)
    assert [(s.name, s.unit) for s in recording.signals] == [("AI 1/1", "m/s²"), ("AI 2/1", "MPa")]
    np.testing.assert_array_equal(recording.read("AI 1/1"), [row[0] for row in build.rows()])
    base = recording.time_base("AI 1/1")
    assert (base.start_s, base.step_s) == (0.0, 5e-5)
    assert recording.notes == ()


def test_a_row_of_units_is_told_from_a_row_of_numbers(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.OXYGEN_UNIT_ROW)
    assert [(s.name, s.unit) for s in recording.signals] == [("AI 1/1", "m/s²"), ("AI 2/1", "")]
    assert recording.time_base("AI 1/1").step_s == 5e-5


def test_stamps_with_a_zone_state_it_and_give_the_step(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.OXYGEN_ABSOLUTE)
    start = recording.absolute_start
    assert start is not None
    assert (start.text, start.zone) == ("2026-08-03T12:23:05.757000", "+02:00")
    assert recording.time_base("AI 1/1").step_s == 5e-5


def test_stamps_without_a_zone_leave_it_unknown(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.table(["Time;a [V];b [V]"], build.instants(), separator=";"))
    start = recording.absolute_start
    assert start is not None
    assert start.zone == "unknown"


def test_a_zone_that_changes_is_taken_off_each_stamp_and_sets_the_clock_back(tmp_path: Path) -> None:
    content = build.OXYGEN_ABSOLUTE.decode("utf-16").replace("+02:00", "+01:00", 3)
    recording = opened(tmp_path, content)
    with pytest.raises(CorruptFileError, match="line 5, time column: time does not increase: a second"):
        recording.time_base("AI 1/1")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("Time [s];a [V]\n0.0;1,5\n0.1;2,5\n", "both '1,5' and '0.0' are numbers"),
        ("Time [s];a [V]\n1,000;1,500\n2,000;2,500\n", "may be a decimal comma or group thousands"),
        ("Time [s];x,a [V];y\n1;2,3;4\n2;2,3;4\n", "may be a decimal|more than one way"),
    ],
)
def test_what_can_be_read_in_two_ways_is_refused_and_says_how_to_declare(text: str, why: str, tmp_path: Path) -> None:
    if "x,a" in text:
        recording = opened(tmp_path, text)  # only `;` leaves a heading of time alone: one way
        np.testing.assert_array_equal(recording.read("x,a"), [2.3, 2.3])
        return
    assert READER.claims(Head(text.encode())) is Claim.SHAPE
    with pytest.raises(ReadError, match=why) as caught:
        opened(tmp_path, text)
    assert caught.value.remedy is not None
    assert "[source.layout]" in caught.value.remedy


def test_a_decimal_comma_between_commas_is_refused_and_says_how_to_declare(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match=r"do not fit the header.*expected 2 cells.*found 4.*source\.layout"):
        opened(tmp_path, "Time [s],a [V]\n0,0,1,5\n0,1,2,5\n")


@pytest.mark.parametrize("heading", ["Time [x]", "Time []", "Time"])
def test_time_without_a_known_unit_is_never_guessed(heading: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="unit of the time column is unknown"):
        opened(tmp_path, f"{heading};a [V]\n0;1\n1;2\n2;3\n")


def test_another_decimal_mark_further_down_is_an_error_with_its_line(tmp_path: Path) -> None:
    rows = "".join(f"{i};{i}.5\n" for i in range(200)).replace("150;150.5", "150;150,5")
    recording = opened(tmp_path, "Time [s];a [V]\n" + rows)
    with pytest.raises(CorruptFileError, match=r"line 152, column 'a': a cell is not a number.*'150,5'"):
        recording.read("a")
