"""Frames and times of a table of tracks are known by what they hold, in whatever language they are headed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, NoFrameRateError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.tracks.proanalyst_text import ProAnalystTextReader
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import tracks_text

POINT = "Marke - X (mm),Marke - Y (mm)"
SKIPPED = (7, 8, 20)
TAKEN = "columns were taken by what they hold"


def opened(folder: Path, content: bytes | str, rate_hz: float | None = None) -> Recording:
    return open_bytes(ProAnalystTextReader(), "a.csv", folder, content, Declarations("camera", frame_rate_hz=rate_hz))


def about(recording: Recording) -> str:
    return " | ".join(map(str, recording.notes))


@pytest.mark.parametrize(
    ("headings", "taken"),
    [
        ("Bild,Zeit (s)", ("Bild", "Zeit")),
        ("Image,Temps (s)", ("Image", "Temps")),
        ("Кадр,Время [s]", ("Кадр", "Время")),
        ("番号,時間 (sec)", ("番号", "時間")),
        ("Frame,Zeit (s)", ("Zeit",)),
        ("Bild,Time (s)", ("Bild",)),
    ],
)
@pytest.mark.parametrize("rate_hz", [None, 6000.0])
def test_headings_of_any_language_say_the_same(
    headings: str, taken: tuple[str, ...], rate_hz: float | None, tmp_path: Path
) -> None:
    english = opened(tmp_path, tracks_text(header=f"Frame,Time (s),{POINT}", skip=SKIPPED, lost=[11]), rate_hz)
    other = opened(tmp_path, tracks_text(header=f"{headings},{POINT}", skip=SKIPPED, lost=[11]), rate_hz)
    np.testing.assert_array_equal(other.tracks()[0].frame_numbers, english.tracks()[0].frame_numbers)
    np.testing.assert_array_equal(other.time_base("Marke - X").times_s, english.time_base("Marke - X").times_s)
    assert [one.name for one in other.signals] == [one.name for one in english.signals] == ["Marke - X", "Marke - Y"]
    own = [note for note in other.notes if TAKEN not in note]
    assert own == list(english.notes)
    assert all(f"'{name}' as " in about(other) for name in taken)
    assert TAKEN not in about(english)


def test_times_without_a_unit_are_known_by_the_declared_rate(tmp_path: Path) -> None:
    content = tracks_text(header=f"Bild,Zeit,{POINT}", skip=SKIPPED)
    times_s = opened(tmp_path, content, 6000.0).time_base("Marke - X").times_s
    np.testing.assert_allclose(times_s[:9], np.array([*range(7), 9, 10]) / 6000.0)
    assert "'Zeit'" not in about(opened(tmp_path, content, 2000.0))
    with pytest.raises(NoFrameRateError, match="`time_column` in its `layout`"):
        opened(tmp_path, content)


@pytest.mark.parametrize(
    "header",
    [
        f"Bild,Weg (mm),{POINT}",
        f"Bild,Weg,{POINT}",
        "Bild,Lage - X,Marke - X (mm),Marke - Y (mm)",
        f"Bild,Speed,{POINT}",
    ],
)
def test_a_path_that_increases_steadily_is_no_time(header: str, tmp_path: Path) -> None:
    recording = opened(tmp_path, tracks_text(header=header, rate_hz=2.0, skip=SKIPPED), 1000.0)
    assert "as time" not in about(recording)
    assert recording.time_base("Marke - X").times_s[7] == pytest.approx(0.009)


def rows(header: str, count: int, row: str) -> str:
    return header + "\n" + "".join(row.format(i=i, n=i + 10 * (i > 9) + 1, x=0.5 * i) + "\n" for i in range(count))


@pytest.mark.parametrize(
    ("header", "row"),
    [
        (" ,Area,X,Y,Slice", "{i},0,{x},1.5,{n}"),
        ("Nr,Area,X,Y,Slice n°", "{i},0,{x},1.5,{n}"),
        ("p1_x,p1_y,p1_error,fnum", "{x},1.5,0.25,{n}"),
        ("Bild;X;Y", "{n};{x};1.5"),
    ],
)
def test_the_column_that_skips_frames_counts_them_and_not_the_number_of_the_row(
    header: str, row: str, tmp_path: Path
) -> None:
    recording = opened(tmp_path, rows(header, 30, row), 1000.0)
    x = next(one.name for one in recording.signals if one.name.casefold().endswith("x"))
    np.testing.assert_allclose(1e3 * recording.time_base(x).times_s, [*range(1, 11), *range(21, 41)])
    assert "missing frames (numbers between 1 and 40 that are not in the file): 10" in about(recording)


def test_tracks_under_one_another_are_refused_where_their_frames_begin_anew(tmp_path: Path) -> None:
    two = rows(" ,Track n°,Slice n°,X,Y", 20, "{i},1,{n},{x},1.5") + rows("", 20, "{i},2,{n},{x},2.5").lstrip()
    with pytest.raises(CorruptFileError, match=r"line 22, column 'Slice n°'.*export one clip per file"):
        opened(tmp_path, two, 1000.0)


def test_a_row_number_alone_counts_the_frames_and_a_column_without_a_heading_has_a_name(tmp_path: Path) -> None:
    recording = opened(tmp_path, rows(" ,X,Y,", 12, "{i},{x},1.5,{x}"), 1000.0)
    assert recording.time_base("X").times_s[11] == pytest.approx(0.011)
    assert [one.name for one in recording.signals] == ["X", "Y", "column 4"]


def test_the_reported_table_has_its_gap() -> None:
    path = shared_file("reports/imagej_gap.csv")
    recording = ProAnalystTextReader().open(path, Declarations("camera", frame_rate_hz=1000.0))
    frames = np.array([*range(1, 11), *range(21, 41)])
    times_s = recording.time_base("X").times_s
    np.testing.assert_allclose(times_s - times_s[0], (frames - 1) / 1000.0)
    np.testing.assert_array_equal(recording.read("X"), 10.0 + frames)
    np.testing.assert_array_equal(recording.read("Y"), 20.0 + 2 * frames)
    assert "10" in about(recording)
