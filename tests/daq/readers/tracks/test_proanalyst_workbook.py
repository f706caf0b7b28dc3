from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text import sheet_text
from recoil_acquisition.readers.text.sheet_text import read_sheets
from recoil_acquisition.readers.tracks.proanalyst_text import ProAnalystTextReader, ProAnalystWorkbookReader
from tests.builders import track_files as build

READER = ProAnalystWorkbookReader()
CAMERA = Declarations("camera")


def opened(tmp_path: Path, content: bytes, declared: Declarations = CAMERA) -> Recording:
    path = tmp_path / "a.xlsx"
    path.write_bytes(content)
    return READER.open(path, declared)


def test_a_workbook_gives_what_the_same_text_gives(tmp_path: Path) -> None:
    rows = build.workbook_rows(lost=[5])
    recording = opened(tmp_path, build.workbook({"Tracks": rows}))
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
    recording = READER.open(tmp_path / "b.xlsx", CAMERA)
    assert [(t.name, int(t.lost.sum())) for t in recording.tracks()] == [("Muzzle", 0), ("Cradle", 1)]
    assert recording.metadata["frame_rate_hz"] == 2000.0
    assert "sheet 'Sheet' was read, the others were not: Remarks" in recording.notes


def test_an_angle_is_a_signal_of_its_feature_and_lost_with_it(tmp_path: Path) -> None:
    rows: list[list[object]] = [["Frame", "HIP_X", "HIP_Y", "HIP_ANG (deg)", "HIP_ANG_VEL (deg/s)"]]
    rows += [[i, *([-1, -1, -1] if i == 4 else [i + 0.5, 2.5, 0.25 * i - 1.0]), 3.5] for i in range(10)]
    recording = opened(tmp_path, build.workbook({"a": rows}), Declarations("camera", frame_rate_hz=100.0))
    header = next(s for s in recording.signals if s.name == "HIP_ANG")
    assert (header.unit, header.metadata["kind"]) == ("deg", "angle")
    assert np.flatnonzero(np.isnan(recording.read("HIP_ANG"))).tolist() == [4]
    assert recording.read("HIP_ANG")[0] == -1.0
    assert any(note.endswith("its own filter: HIP_ANG_VEL") for note in recording.notes)


def test_an_unknown_unit_is_refused_with_what_to_declare(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="column 'Muzzle X'") as caught:
        opened(tmp_path, build.workbook({"a": build.workbook_rows(unit="furlong")}))
    assert "'furlong'" in str(caught.value)
    assert "declare the columns and their `unit` in `layout`" in str(caught.value)
    with pytest.raises(ReadError, match="not known as that of displacement"):
        opened(tmp_path, build.workbook({"a": build.workbook_rows(unit="bar")}))


def test_a_workbook_without_numbers_or_values_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match="no sheet holds a block of numbers"):
        opened(tmp_path, build.workbook({"a": [["x", "y"], [1, 2]]}))
    with pytest.raises(CorruptFileError, match="holds no values"):
        opened(tmp_path, build.workbook({"a": []}))


def test_entities_are_refused(tmp_path: Path) -> None:
    bomb = b'<!DOCTYPE z [<!ENTITY a "aaaaaaaaaa">]>'
    with pytest.raises(ReadError, match="declares entities"):
        opened(tmp_path, build.workbook({"a": build.workbook_rows()}, extra=bomb))


def test_a_part_that_inflates_without_bound_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="inflates beyond what is read"):
        opened(tmp_path, build.workbook({"a": build.workbook_rows()}, extra=b" " * (2 << 20)))


def test_a_row_far_below_and_a_cell_far_to_the_right_do_not_fill_memory(tmp_path: Path) -> None:
    content = build.workbook({"a": build.workbook_rows()}, dimension="A1:XFD1048576")
    assert opened(tmp_path, content).signals[0].sample_count == build.COUNT
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "xl/s0.xml":
                far = b"".join(b'<row r="%d"><c r="XFD%d"><v>1</v></c></row>' % (i, i) for i in range(100, 200))
                data = data.replace(b"</sheetData>", far + b"</sheetData>")
            new.writestr(name, data)
    with pytest.raises(ReadError, match="more cells than its file can hold"):
        opened(tmp_path, buffer.getvalue())
    deep = content_with(content, b'<row r="1048577"><c r="A1048577"><v>1</v></c></row>')
    with pytest.raises(ReadError, match="more cells than its file can hold"):
        opened(tmp_path, deep)


def content_with(content: bytes, row: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            data = old.read(name)
            new.writestr(name, data.replace(b"</sheetData>", row + b"</sheetData>") if name == "xl/s0.xml" else data)
    return buffer.getvalue()


def test_an_archive_that_is_no_workbook_is_refused(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("a.txt", "1,2,3\n")
    assert not READER.claims(Head(buffer.getvalue()))
    with pytest.raises(CorruptFileError, match="not a readable workbook"):
        opened(tmp_path, buffer.getvalue())


@settings(max_examples=30, deadline=None)
@given(values=st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20))
def test_numbers_read_back_exactly(values: list[float], tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("sheet") / "a.xlsx"
    path.write_bytes(build.workbook({"a": [[v] for v in values]}))
    assert [float(line) for line in read_sheets(path)[0].text.split()] == values


def test_limits_are_those_of_the_format() -> None:
    assert (sheet_text.MOST_ROWS, sheet_text.MOST_COLUMNS) == (2**20, 2**14)
