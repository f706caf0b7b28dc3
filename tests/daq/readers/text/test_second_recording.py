"""Two recordings in one text: told, in every table, and no time of one taken for the other's."""

from __future__ import annotations

import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.recording import Recording
from tests.builders import exported_files, track_files
from tests.builders import text_tables as tables
from tests.builders.opened_files import open_table

ROWS = [f"{1e-3 * i:.3f};{i}.5;{i}.25" for i in range(40)]
LAYOUT = {"separator": ";", "header_row": 1, "first_row": 2, "time_column": 1, "time_unit": "s"}
TRACKS = "\n".join(["Frame;x;y", *(f"{i};{i}.5;2.25" for i in range(40)), ""]).encode()
TRACK_LAYOUT = {"separator": ";", "header_row": 1, "frame_column": 1, "features": [{"name": "tip", "x": 2, "y": 3}]}
DEWESOFT = "\n".join(["Time (s);a (V);b (V)", *ROWS, ""]).encode()
TWO_LINES_ABOVE = b"Stand 3\n\n" + DEWESOFT

TABLES: dict[str, tuple[bytes, int, str, dict]] = {
    "dewesoft": (DEWESOFT, 1, "dewetron", {}),
    "dewesoft with lines above": (TWO_LINES_ABOVE, 3, "dewetron", {}),
    "oxygen": (tables.OXYGEN, 1, "dewetron", {}),
    "oxygen with a row of units": (tables.OXYGEN_UNIT_ROW, 4, "dewetron", {}),
    "dasylab": (tables.DASYLAB_TABS.replace(b"\r", b"\n"), 1, "dewetron", {}),
    "declared": (DEWESOFT, 1, "dewetron", {"layout": LAYOUT}),
    "declared without time": (
        DEWESOFT, 1, "dewetron",
        {"layout": {"separator": ";", "header_row": 1, "first_row": 2, "rate_hz": 1000.0}},
    ),
    "our own": (exported_files.csv_file(), 11, "dewetron", {}),
    "proanalyst": (b"Frame;tip - X;tip - Y" + TRACKS[9:], 1, "camera", {}),
    "declared tracks": (TRACKS, 1, "camera", {"layout": TRACK_LAYOUT}),
    "deeplabcut": (track_files.deeplabcut(), 3, "camera", {}),
    "dltdv": (track_files.dltdv(), 1, "camera", {}),
    "tracker": (track_files.tracker(), 2, "camera", {}),
    "sleap": (track_files.sleap_text(), 1, "camera", {}),
}  # fmt: skip
UNSEEN = ("dltdv", "declared without time")
"""Tables whose rows have no number and no time: only their headings show that another one begins."""


def read_all(recording: Recording) -> None:
    for signal in recording.signals:
        recording.read(signal.name)
        recording.time_base(signal.name)


@pytest.mark.parametrize("name", TABLES)
def test_a_table_put_behind_another_with_its_headings_is_refused(name, tmp_path):
    content, _, kind, declared = TABLES[name]
    read_all(open_table(tmp_path, content, kind, **declared))
    with pytest.raises(ReadError, match=r"a second recording begins|more rows than the file promises") as caught:
        read_all(open_table(tmp_path, content + content, kind, **declared))
    assert (caught.value.place or "").startswith("line ")


@pytest.mark.parametrize("name", [name for name in TABLES if name not in UNSEEN])
def test_rows_that_begin_anew_are_refused(name, tmp_path):
    content, above, kind, declared = TABLES[name]
    rows = content.split(b"\n", above)[above]
    pattern = r"second recording|more rows than|larger than the one before|does not increase|more than once"
    with pytest.raises(ReadError, match=pattern) as caught:
        read_all(open_table(tmp_path, content + rows, kind, **declared))
    assert (caught.value.place or "").startswith("line ")


def test_a_time_of_day_that_goes_back_is_no_missing_rate(tmp_path):
    rows = [f"12:00:00.{10 * i:03d},{i}" for i in range(60)] + [f"11:00:00.{10 * i:03d},{i}" for i in range(60)]
    with pytest.raises(ReadError, match="line 62, time column: time does not increase: a second recording begins"):
        read_all(open_table(tmp_path, "\n".join(["Time,a (V)", *rows, ""]).encode(), "dewetron"))


def test_stamps_an_hour_later_keep_their_own_time(tmp_path):
    first = [f"2026-08-03 12:23:05.{100000 * i:06d}\t{i}.5" for i in range(10)]
    second = [f"2026-08-03 13:23:05.{100000 * i:06d}\t{i}.5" for i in range(10)]
    content = "\n".join(["Date/Time\tAI 1/1 [V]", *first, *second, ""]).encode()
    recording = open_table(tmp_path, content, "dewetron")
    times_s = recording.time_base("AI 1/1").times_s
    assert times_s[10] == pytest.approx(3600.0)
    assert any("1 gaps" in note for note in recording.notes)
