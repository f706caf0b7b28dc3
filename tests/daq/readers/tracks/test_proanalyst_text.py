from __future__ import annotations

import io
import json
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import surest_claim
from recoil_acquisition.readers.text import sheet_text
from recoil_acquisition.readers.text.sheet_text import read_sheets
from recoil_acquisition.readers.tracks.columns import classify, columns_from_headings
from recoil_acquisition.readers.tracks.proanalyst_text import ProAnalystTextReader, ProAnalystWorkbookReader
from tests.builders import track_files as build
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import dewesoft_text, motion_rows, tracks_text

READER = ProAnalystTextReader()


def opened(tmp_path: Path, content: bytes | str, rate_hz: float | None = None) -> Recording:
    return open_bytes(READER, "a.csv", tmp_path, content, Declarations("camera", frame_rate_hz=rate_hz))


@pytest.mark.parametrize(
    ("heading", "kind", "name", "unit", "feature", "axis"),
    [
        ("Frame", "frame", "Frame", "", "", ""),
        ("Frame No.", "frame", "Frame No.", "", "", ""),
        ("Time (s)", "time", "Time", "s", "", ""),
        ("t", "time", "t", "", "", ""),
        ("Feature #1 - X (mm)", "position", "Feature #1 - X", "mm", "Feature #1", "X"),
        ("HIP_Y", "position", "HIP_Y", "", "HIP", "Y"),
        ("x", "position", "x", "", "", "X"),
        ("Feature #1 - Velocity X (mm/s)", "derived", "Feature #1 - Velocity X", "mm/s", "", ""),
        ("HIP_ANG", "angle", "HIP_ANG", "", "HIP", ""),
    ],
)
def test_headings_are_classified_by_their_words(
    heading: str, kind: str, name: str, unit: str, feature: str, axis: str
) -> None:
    column = classify(heading)
    assert (column.kind, column.name, column.unit, column.feature, column.axis) == (kind, name, unit, feature, axis)


def test_a_merged_row_of_features_stands_over_a_row_of_axes() -> None:
    rows = [
        ["Project: a.avi"],
        ["", "", "Muzzle", "", "Cradle", ""],
        ["Frame", "Time", "X", "Y", "X", "Y"],
        ["", "(s)", "(mm)", "(mm)", "(mm)", "(mm)"],
    ]
    columns = columns_from_headings(rows, 6)
    assert columns is not None
    assert [(c.kind, c.feature, c.axis, c.unit) for c in columns] == [
        ("frame", "", "", ""),
        ("time", "", "", "s"),
        ("position", "Muzzle", "X", "mm"),
        ("position", "Muzzle", "Y", "mm"),
        ("position", "Cradle", "X", "mm"),
        ("position", "Cradle", "Y", "mm"),
    ]


def test_time_is_frame_number_over_rate_and_not_the_printed_time(tmp_path: Path) -> None:
    recording = opened(tmp_path, tracks_text(200, skip=[7, 8]))
    numbers = np.delete(np.arange(200), [7, 8])
    np.testing.assert_array_equal(recording.time_base("Feature #1 - X").times_s, numbers / 6000.0)
    assert recording.metadata["frame_rate_hz"] == 6000.0
    assert any(note.startswith("missing frames") and note.endswith(": 2") for note in recording.notes)
    (track,) = recording.tracks()
    np.testing.assert_array_equal(track.frame_numbers, numbers)
    assert (track.name, track.axes, track.unit) == ("Feature #1", ("X", "Y"), "mm")


def test_pairs_of_minus_one_are_lost_and_a_single_one_is_a_coordinate(tmp_path: Path) -> None:
    text = tracks_text(20, lost=[4, 5]).decode().replace("\r\n10,0.001667,3.0000,", "\r\n10,0.001667,-1,")
    recording = opened(tmp_path, text)
    x, y = recording.read("Feature #1 - X"), recording.read("Feature #1 - Y")
    assert np.flatnonzero(np.isnan(x)).tolist() == [4, 5] == np.flatnonzero(np.isnan(y)).tolist()
    assert x[10] == -1.0
    assert any("lost in 2 of 20 frames (2 marked -1, 0 empty)" in note for note in recording.notes)


def test_blank_and_nan_cells_are_lost_on_every_axis_of_the_track(tmp_path: Path) -> None:
    lines = tracks_text(20).decode().split("\r\n")
    lines[4] = "3,0.000500,,1.5"
    lines[6] = "5,0.000833,NaN,NaN"
    recording = opened(tmp_path, "\r\n".join(lines))
    assert np.isnan(recording.tracks()[0].positions).all(axis=1).nonzero()[0].tolist() == [3, 5]
    assert recording.read("Feature #1 - Y")[3] == 1.5
    assert any("(0 marked -1, 2 empty)" in note for note in recording.notes)


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ","), ("\t", ","), ("\t", "."), (";", ".")])
@pytest.mark.parametrize("header", [None, "Frame,Time (s),Feature #1 - X (mm),Feature #1 - Y (mm)"])
def test_every_way_of_writing_gives_the_same_track(
    separator: str, decimal: str, header: str | None, tmp_path: Path
) -> None:
    whole = tracks_text(30, header=header).decode().replace(",", separator).replace(".", decimal)
    assert READER.claims(Head(whole.encode("utf-16"))) is (Claim.SHAPE if header is None else Claim.GENERIC)
    recording = opened(tmp_path, whole.encode("utf-16"))
    (track,) = recording.tracks()
    np.testing.assert_array_equal(track.positions[:, 0], np.round(0.25 * np.arange(30) + 0.5, 4))
    assert track.unit == ("" if header is None else "mm")


def test_a_file_without_header_names_its_features(tmp_path: Path) -> None:
    recording = opened(tmp_path, tracks_text(header=None))
    assert [s.name for s in recording.signals] == ["feature1 X", "feature1 Y"]
    assert recording.metadata["header"] == []


def test_fourteen_lines_of_header_with_numbers_are_kept_verbatim(tmp_path: Path) -> None:
    header = ["ProAnalyst", "Frame rate,6000", "1,2", "3,4", *[f"line {i}" for i in range(9)]]
    text = "\n".join(header) + "\n" + tracks_text(line_end="\n").decode()
    assert READER.claims(Head(text.encode())) is Claim.GENERIC
    recording = opened(tmp_path, text)
    assert recording.metadata["header"][:-1] == header
    assert recording.signals[0].sample_count == 40


def test_without_time_the_declared_rate_is_needed(tmp_path: Path) -> None:
    text = "Frame,x,y\n" + "".join(f"{i},{i}.5,{2 * i}.25\n" for i in range(10, 30))
    with pytest.raises(ReadError, match="frame rate is unknown") as caught:
        opened(tmp_path, text)
    assert "frame_rate" in str(caught.value.remedy)
    recording = opened(tmp_path, text, 500.0)
    np.testing.assert_allclose(recording.time_base("x").times_s, np.arange(10, 30) / 500.0)


def test_neither_frame_nor_time_says_that_gaps_cannot_be_seen(tmp_path: Path) -> None:
    recording = opened(tmp_path, "x,y\n" + "".join(f"{i}.5,{2 * i}.25\n" for i in range(20)), 500.0)
    assert any("missing frame cannot be seen" in note for note in recording.notes)


def test_a_declared_rate_that_agrees_within_the_print_is_taken(tmp_path: Path) -> None:
    recording = opened(tmp_path, tracks_text(40), 6000.05)
    assert recording.metadata["frame_rate_hz"] == 6000.05
    assert recording.notes == ()


@pytest.mark.parametrize(
    ("declared", "word"), [(30.0, "contradicts"), (6010.0, "contradicts"), (6003.0, "differs from")]
)
def test_a_declared_rate_that_contradicts_the_file_is_noted(declared: float, word: str, tmp_path: Path) -> None:
    recording = opened(tmp_path, tracks_text(300), declared)
    assert recording.metadata["frame_rate_hz"] == 6000.0
    assert any(word in note for note in recording.notes)


def test_time_in_milliseconds_is_converted_and_an_unknown_unit_is_refused(tmp_path: Path) -> None:
    rows = "".join(f"{i},{i * 0.5:.1f},1.5,{i}.5\n" for i in range(20))
    recording = opened(tmp_path, "Frame,Time (ms),x,y\n" + rows)
    assert recording.metadata["frame_rate_hz"] == 2000.0
    with pytest.raises(ReadError, match="unit of the time column"):
        opened(tmp_path, "Frame,Time (fields),x,y\n" + rows)


def test_frames_are_numbered_by_time_where_they_have_no_number(tmp_path: Path) -> None:
    times = np.delete(np.arange(40), [12, 13]) / 6000.0
    text = "x,y,Time (s)\n" + "".join(f"1.5,{i}.5,{t:.6f}\n" for i, t in enumerate(times))
    recording = opened(tmp_path, text)
    np.testing.assert_allclose(recording.time_base("x").times_s, times, atol=1e-12)
    assert any(note.startswith("missing frames") for note in recording.notes)


def test_a_wrong_printed_time_does_not_move_the_frames(tmp_path: Path) -> None:
    text = tracks_text(200).decode().replace("\r\n50,0.008333,", "\r\n50,0.008400,")
    recording = opened(tmp_path, text)
    assert recording.metadata["frame_rate_hz"] == 6000.0
    assert any("printed time of 1 frames disagrees" in note for note in recording.notes)


def test_a_time_that_starts_before_the_trigger_keeps_its_zero(tmp_path: Path) -> None:
    text = "Frame,Time (s),x,y\n" + "".join(f"{i + 1},{(i - 10) / 500:.4f},{i}.5,1.5\n" for i in range(40))
    recording = opened(tmp_path, text)
    np.testing.assert_allclose(recording.time_base("x").times_s, (np.arange(40) - 10) / 500, atol=1e-12)


@pytest.mark.parametrize("bad", ["4", "5.5", "", "3"])
def test_a_frame_number_that_does_not_increase_is_refused_with_its_line(bad: str, tmp_path: Path) -> None:
    text = tracks_text(20).decode().replace("\r\n5,", f"\r\n{bad},")
    with pytest.raises(CorruptFileError, match="line 7, column 'Frame'"):
        opened(tmp_path, text)


def test_repeated_pictures_are_counted_and_listed(tmp_path: Path) -> None:
    lines = tracks_text(20).decode().split("\r\n")
    lines[9] = ",".join([*lines[9].split(",")[:2], *lines[8].split(",")[2:]])
    recording = opened(tmp_path, "\r\n".join(lines))
    assert recording.metadata["repeated_frames"] == [8]
    assert any("repeated pictures" in note for note in recording.notes)


def test_derived_columns_are_signals_but_no_tracks(tmp_path: Path) -> None:
    text = "Frame,x (mm),y (mm),Speed (mm/s)\n" + "".join(f"{i},{i}.5,1.5,{i}.25\n" for i in range(20))
    recording = opened(tmp_path, text, 100.0)
    assert [s.name for s in recording.signals] == ["x", "y", "Speed"]
    assert len(recording.tracks()) == 1
    assert any("its own filter: Speed" in note for note in recording.notes)


@pytest.mark.parametrize(
    "content",
    [
        dewesoft_text(motion_rows()),
        b"Time (s),x (mm),y (mm)\n" + b"0.1,1,2\n" * 9,
        b"scorer,a,a,a\nbodyparts,t,t,t\ncoords,x,y,likelihood\n" + b"0,1.5,2.5,0.9\n" * 9,
        b'schema = "recoil-daq/rig/1"\nname = "x"\n' + b"a = 1\n" * 9,
        b'{"a": [1, 2, 3]}\n',
        b"(1700000000.250000) can0 100#0900EFFFFA03C100\n" * 9,
        b"0.5,1.5\n0.6,1.5\n0.7,1.5\n0.8,1.5\n0.9,1.5\n1.0,1.5\n",
        b"1,2\n1,3\n1,4\n1,5\n1,6\n1,7\n",
        bytes(range(256)),
    ],
)
def test_other_files_are_not_taken(content: bytes) -> None:
    assert READER.name not in [reader.name for reader in surest_claim(Head(content))[1] if reader.claims(Head(content))]


def test_a_file_without_numbers_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match="no block of numbers"):
        opened(tmp_path, "Frame,x,y\n1,2,3\n")


def test_the_synthetic_track_agrees_with_its_truth() -> None:
    path = shared_file("tracks/SYNTHETIC_proanalyst_like_2000fps.csv")
    truth = json.loads((path.parent / "SYNTHETIC_truth.json").read_text())
    recording = READER.open(path, Declarations("camera", frame_rate_hz=truth["fps"]))
    first = recording.tracks()[0]
    assert first.frame_numbers[first.lost].tolist() == truth["lost_frames"]
    assert truth["frame_not_recorded"] not in first.frame_numbers
    assert recording.metadata["repeated_frames"] == [truth["duplicated_picture_frame"]]
    assert recording.metadata["frame_rate_hz"] == truth["fps"]


@pytest.mark.parametrize("name", ["SYNTHETIC_proanalyst_like_noheader.csv", "SYNTHETIC_proanalyst_like_tab.txt"])
def test_the_synthetic_variants_give_the_same_track(name: str) -> None:
    whole = READER.open(shared_file("tracks/SYNTHETIC_proanalyst_like_2000fps.csv"), Declarations("camera"))
    variant = READER.open(shared_file(f"tracks/{name}"), Declarations("camera"))
    np.testing.assert_array_equal(variant.tracks()[0].positions, whole.tracks()[0].positions[:400])
    np.testing.assert_array_equal(variant.tracks()[0].time_base.times_s, np.arange(400) / 2000.0)


@pytest.mark.parametrize("name", ["008_129_DB", "100_AJ_DB"])
def test_real_published_tracks_need_a_declared_rate(name: str) -> None:
    path = shared_file(f"tracks/proanalyst_paws_jones2020_{name}.csv")
    assert READER.claims(Head.of(path))
    with pytest.raises(ReadError, match="frame rate"):
        READER.open(path, Declarations("camera"))
    recording = READER.open(path, Declarations("camera", frame_rate_hz=2000.0))
    assert len(recording.metadata["repeated_frames"]) > 700


@pytest.mark.parametrize(("shot", "missing"), [("plain", 7), ("ringing", 8), ("gains", 11)])
def test_a_shot_of_an_independent_simulation_has_its_track(shot: str, missing: int) -> None:
    path = shared_file(f"shots/{shot}/camera.csv")
    recording = READER.open(path, Declarations("camera", frame_rate_hz=6000.0))
    (track,) = recording.tracks()
    gaps = int((np.diff(track.frame_numbers) - 1).sum())
    assert any(note.endswith(f": {gaps}") for note in recording.notes)
    assert gaps in (missing, 7, 8, 11)
    np.testing.assert_array_equal(track.time_base.times_s, track.frame_numbers / 6000.0)


WORKBOOK = ProAnalystWorkbookReader()
CAMERA = Declarations("camera")
opened_workbook = partial(open_bytes, WORKBOOK, "a.xlsx", declared=CAMERA)


def test_a_workbook_gives_what_the_same_text_gives(tmp_path: Path) -> None:
    rows = build.workbook_rows(lost=[5])
    recording = opened_workbook(tmp_path, build.workbook({"Tracks": rows}))
    text = tmp_path / "a.txt"
    text.write_text("".join("\t".join(map(str, row)) + "\n" for row in rows))
    same = ProAnalystTextReader().open(text, CAMERA)
    assert recording.signals == same.signals
    assert recording.notes == same.notes
    for name in ("Muzzle X", "Muzzle Y"):
        np.testing.assert_array_equal(recording.read(name), same.read(name))
        np.testing.assert_array_equal(recording.time_base(name).times_s, same.time_base(name).times_s)
    assert (recording.metadata["sheet"], recording.metadata["frame_rate_hz"]) == ("Tracks", 2000.0)
    assert "Muzzle: lost in 1 of 24 frames (1 marked -1, 0 empty)" in recording.notes


def test_what_a_spreadsheet_program_writes_is_read_with_blank_cells_lost(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["Feature export"])
    sheet.append([None, None, "Muzzle", None, "Cradle", None])
    sheet.append(["Frame", "Time (ms)", "X (mm)", "Y (mm)", "X (mm)", "Y (mm)"])
    for i in range(12):
        sheet.append([i, i * 0.5, i + 0.5, 2.0 * i, *([None, None] if i == 3 else [i + 7.25, 1.5 * i])])
    book.create_sheet("Remarks").append(["a good shot"])
    book.save(tmp_path / "b.xlsx")
    recording = WORKBOOK.open(tmp_path / "b.xlsx", CAMERA)
    assert [(t.name, int(t.lost.sum())) for t in recording.tracks()] == [("Muzzle", 0), ("Cradle", 1)]
    assert recording.metadata["frame_rate_hz"] == 2000.0
    assert "sheet 'Sheet' was read, the others were not: Remarks" in recording.notes


def test_an_angle_is_a_signal_of_its_feature_and_lost_with_it(tmp_path: Path) -> None:
    rows: list[list[object]] = [["Frame", "HIP_X", "HIP_Y", "HIP_ANG (deg)", "HIP_ANG_VEL (deg/s)"]]
    rows += [[i, *([-1, -1, -1] if i == 4 else [i + 0.5, 2.5, 0.25 * i - 1.0]), 3.5] for i in range(10)]
    recording = opened_workbook(
        tmp_path, build.workbook({"a": rows}), declared=Declarations("camera", frame_rate_hz=100.0)
    )
    header = next(s for s in recording.signals if s.name == "HIP_ANG")
    assert (header.unit, header.metadata["kind"]) == ("deg", "angle")
    assert np.flatnonzero(np.isnan(recording.read("HIP_ANG"))).tolist() == [4]
    assert recording.read("HIP_ANG")[0] == -1.0
    assert any(note.endswith("its own filter: HIP_ANG_VEL") for note in recording.notes)


def test_an_unknown_unit_is_refused_with_what_to_declare(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="column 'Muzzle X'") as caught:
        opened_workbook(tmp_path, build.workbook({"a": build.workbook_rows(unit="furlong")}))
    assert "'furlong'" in str(caught.value)
    assert "declare the columns and their `unit` in `layout`" in str(caught.value)
    with pytest.raises(ReadError, match="not known as that of displacement"):
        opened_workbook(tmp_path, build.workbook({"a": build.workbook_rows(unit="bar")}))


def test_a_workbook_without_numbers_or_values_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match="no sheet holds a block of numbers"):
        opened_workbook(tmp_path, build.workbook({"a": [["x", "y"], [1, 2]]}))
    with pytest.raises(CorruptFileError, match="holds no values"):
        opened_workbook(tmp_path, build.workbook({"a": []}))


def test_entities_are_refused(tmp_path: Path) -> None:
    bomb = b'<!DOCTYPE z [<!ENTITY a "aaaaaaaaaa">]>'
    with pytest.raises(ReadError, match="declares entities"):
        opened_workbook(tmp_path, build.workbook({"a": build.workbook_rows()}, extra=bomb))


def test_a_part_that_inflates_without_bound_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="inflates beyond what is read"):
        opened_workbook(tmp_path, build.workbook({"a": build.workbook_rows()}, extra=b" " * (2 << 20)))


def test_a_row_far_below_and_a_cell_far_to_the_right_do_not_fill_memory(tmp_path: Path) -> None:
    content = build.workbook({"a": build.workbook_rows()}, dimension="A1:XFD1048576")
    assert opened_workbook(tmp_path, content).signals[0].sample_count == build.COUNT
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "xl/s0.xml":
                far = b"".join(b'<row r="%d"><c r="XFD%d"><v>1</v></c></row>' % (i, i) for i in range(100, 200))
                data = data.replace(b"</sheetData>", far + b"</sheetData>")
            new.writestr(name, data)
    with pytest.raises(ReadError, match="more cells than the file can hold"):
        opened_workbook(tmp_path, buffer.getvalue())
    deep = content_with(content, b'<row r="1048577"><c r="A1048577"><v>1</v></c></row>')
    with pytest.raises(ReadError, match="more cells than the file can hold"):
        opened_workbook(tmp_path, deep)


def content_with(content: bytes, row: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            data = old.read(name)
            new.writestr(name, data.replace(b"</sheetData>", row + b"</sheetData>") if name == "xl/s0.xml" else data)
    return buffer.getvalue()


def test_a_workbook_that_names_one_sheet_many_times_is_refused_by_the_cells_of_all(tmp_path: Path) -> None:
    once = build.workbook({"Tracks": build.workbook_rows()})
    many = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(once)) as whole, zipfile.ZipFile(many, "w", zipfile.ZIP_DEFLATED) as written:
        for part in whole.namelist():
            content = whole.read(part).decode()
            if part == "xl/workbook.xml":
                sheet = content[content.index("<sheet ") : content.index("</sheets>")]
                content = content.replace(sheet, "".join(sheet.replace("Tracks", f"T{i}") for i in range(200)))
            written.writestr(part, content)
    path = tmp_path / "a.xlsx"
    path.write_bytes(many.getvalue())
    with pytest.raises(ReadError, match="its sheets have more cells than the file can hold"):
        read_sheets(path)


def test_an_archive_that_is_no_workbook_is_refused(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("a.txt", "1,2,3\n")
    assert not WORKBOOK.claims(Head(buffer.getvalue()))
    with pytest.raises(CorruptFileError, match="not a readable workbook"):
        opened_workbook(tmp_path, buffer.getvalue())


@settings(max_examples=30, deadline=None)
@given(values=st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20))
def test_numbers_read_back_exactly(values: list[float], tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("sheet") / "a.xlsx"
    path.write_bytes(build.workbook({"a": [[v] for v in values]}))
    assert [float(line) for line in read_sheets(path)[0].text.split()] == values


def test_limits_are_those_of_the_format() -> None:
    assert (sheet_text.MOST_ROWS, sheet_text.MOST_COLUMNS) == (2**20, 2**14)


@pytest.mark.parametrize(("unit", "per_s"), [("ms", 1e3), ("us", 1e6)])
def test_a_time_without_a_unit_is_read_in_the_one_that_the_declared_rate_has(
    unit: str, per_s: float, tmp_path: Path
) -> None:
    rows = "".join(f"{k},{k * per_s / 2000:.1f},{100 + k},{k}\n" for k in range(60))
    recording = opened(tmp_path, f"Frame,Time,X (px),Y (px)\n{rows}", 2000.0)
    assert recording.time_base("X").rate_hz == pytest.approx(2000.0)
    assert any(f"it was read in {unit}, as the declared 2000 Hz has it" in note for note in recording.notes)
    alone = opened(tmp_path, f"Frame,Time,X (px),Y (px)\n{rows}")
    assert any("the time column states no unit: it was read in seconds" in note for note in alone.notes)


def test_columns_of_time_that_differ_are_refused(tmp_path: Path) -> None:
    def rows(step_s: float) -> str:
        return "".join(f"{k},{k * 5e-4:.4f},{100 + k},{k},{k * step_s:.4f}\n" for k in range(60))

    head = "Frame,Time (s),X (px),Y (px),Time (s)\n"
    with pytest.raises(ReadError, match="several columns of time differ, and which one the positions were seen at"):
        opened(tmp_path, head + rows(1e-3))
    assert opened(tmp_path, head + rows(5e-4)).time_base("X").rate_hz == pytest.approx(2000.0)


def test_a_frame_number_that_no_camera_counts_is_refused(tmp_path: Path) -> None:
    rows = "".join(f"{k + 10**15},{k * 5e-4:.4f},{100 + k},{k}\n" for k in range(60))
    with pytest.raises(CorruptFileError, match="the frame number is larger than any camera counts"):
        opened(tmp_path, f"Frame,Time (s),X (px),Y (px)\n{rows}")
