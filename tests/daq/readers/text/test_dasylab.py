from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.text.dasylab import DasylabTextReader, start_from, step_from
from tests.builders import text_tables as build
from tests.builders.opened_files import open_bytes

READER = DasylabTextReader()
opened = partial(open_bytes, READER, "a.asc")


def test_delta_gives_the_rate_and_the_recording_date_the_start(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.DASYLAB)
    assert [(s.name, s.unit) for s in recording.signals] == [("voltage", "V"), ("voltage2", "V")]
    np.testing.assert_array_equal(recording.read("voltage2"), [row[1] for row in build.rows()])
    base = recording.time_base("voltage")
    assert (base.start_s, base.step_s) == (0.0, 0.2)
    start = recording.absolute_start
    assert start is not None
    assert (start.text, start.zone) == ("2016-07-15T16:52:39", "unknown")


def test_a_wrong_number_of_channels_is_noted_and_the_headings_count(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.DASYLAB)
    assert len(recording.signals) == 2
    assert any("states 16 channels, the headings name 2" in note for note in recording.notes)
    right = opened(tmp_path, build.DASYLAB.replace(b": 16", b": 2"))
    assert not any("channels" in note for note in right.notes)


def test_headings_between_tabs_alone_are_enough(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.DASYLAB_TABS)
    assert [(s.name, s.unit) for s in recording.signals] == [("Disp", "in"), ("Load", "lb")]
    assert recording.time_base("Disp").step_s == 0.2
    assert recording.absolute_start is None


def test_times_that_contradict_delta_are_refused(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.DASYLAB.replace(b"0.2 sec.", b"0.1 sec."))
    with pytest.raises(CorruptFileError, match=r"contradicts the sample rate; expected 10 Hz, from `Delta`"):
        recording.time_base("voltage")


def test_a_record_over_midnight_goes_on(tmp_path: Path) -> None:
    rows = "".join(f"{t};1,5\n" for t in ("23:59:58", "23:59:59", "00:00:00", "00:00:01"))
    head = "DASYLab - V 13\nDelta : 1 sec.\nMeasurement time[hh:mm:ss];a [V]\n"
    recording = opened(tmp_path, head + rows)
    assert recording.time_base("a").count == 4
    assert recording.time_base("a").step_s == 1.0


@pytest.mark.parametrize(
    ("text", "step_s"),
    [("0.2 sec.", 0.2), ("0,2 sec.", 0.2), ("5 ms", 5e-3), ("1E-005 s", 1e-5), ("3 turns", None), ("", None),
     ("1.2.3 s", None), ("0 s", None)],
)  # fmt: skip
def test_delta_is_read_in_the_units_it_states(text: str, step_s: float | None) -> None:
    assert step_from(text) == (None if step_s is None else pytest.approx(step_s, rel=1e-15))


@pytest.mark.parametrize(
    ("text", "start"),
    [
        ("7/15/2016,  4:52:39 PM", "2016-07-15T16:52:39"),
        ("7/7/2016 12:00:01 AM", "2016-07-07T00:00:01"),
        ("7/1/2016, 4:52:39 PM", None),
        ("01.07.2016, 16:52:39", "2016-07-01T16:52:39"),
        ("7/1/2016 16:52:39", None),
        ("13/1/2016 4:52:39 PM", "2016-01-13T16:52:39"),
    ],
)
def test_a_date_is_read_only_where_its_order_is_told(text: str, start: str | None) -> None:
    found = start_from(text)
    assert (None if found is None else found.text) == start


def test_a_date_whose_order_is_not_told_is_noted(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.DASYLAB.replace(b"7/15/2016", b"7/1/2016"))
    assert recording.absolute_start is None
    assert any("order of day and month" in note for note in recording.notes)


def test_a_file_without_headings_or_channels_is_refused(tmp_path: Path) -> None:
    assert READER.claims(Head(b"DASYLab - V 11\n"))
    with pytest.raises(CorruptFileError, match="no row of headings"):
        opened(tmp_path, "DASYLab - V 11\n1;2\n")
    with pytest.raises(CorruptFileError, match="no channel"):
        opened(tmp_path, "DASYLab - V 11\nDate;Measurement time[s];\n1;2\n")
    with pytest.raises(ReadError, match="unit of the time column"):
        opened(tmp_path, "DASYLab - V 11\nMeasurement time[turns];a [V]\n1;2\n")
