"""What instruments write for a sample that they could not measure: lost, counted, and named."""

from __future__ import annotations

import io

import numpy as np
import pytest

from recoil_acquisition.readers.excerpt import excerpt
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import BY_LAYOUT, recognise
from recoil_acquisition.readers.text import text_table
from tests.builders import container_files as build
from tests.builders import exported_files, track_files
from tests.builders.opened_files import open_table
from tests.builders.shared_data import shared_file

MARKS = (9.9e37, -9.9e37, float(np.float32(9.9e37)), 1e38, -1e38, 9.91e37, float(np.float32(9.91e37)), -9.91e37)
OVERLOAD = "overload, beyond the range of the instrument, as it marked them"
WAVE = {"wf_increment": 1e-3, "wf_start_offset": 0.0, "wf_samples": 1, "unit_string": "V"}


def table(*cells: str, separator: str = ";") -> str:
    rows = [f"{1e-3 * i:.3f}{separator}{cell}{separator}{0.5 * i}" for i, cell in enumerate(cells)]
    return "\n".join([f"Time (s){separator}a (V){separator}b (V)", *rows, ""])


@pytest.mark.parametrize(
    "cell",
    [
        "9.9E+37",
        "-9.9E+37",
        "+9.900000e37",
        "9.90000000E+037",
        "1E+38",
        "9.91E+37",
        "+9.910000E+37",
        "1e999",
        "OL",
        "-OL",
        "OVLD",
        "ovl",
        "OVER",
        "Overload",
        "Over_Range",
        "OVERFLOW",
        "+Over",
        "Inf",
        "-INF",
        "Infinity",
        "1.#INF",
        "-1.#INF",
        "1.#INF00",
        "+1.#INF",
    ],
)
def test_an_overload_in_a_text_is_a_lost_sample_that_is_counted_and_named(cell, tmp_path):
    cell = cell.replace("_", " ")
    recording = open_table(tmp_path, table("1.5", cell, "2.5", "", cell, "3"))
    np.testing.assert_array_equal(recording.read("a"), [1.5, np.nan, 2.5, np.nan, np.nan, 3.0])
    assert recording.overloads("a") == 2
    assert recording.overloads("b") == 0
    assert recording.notes == (
        "a: 1 of 6 cells are empty: lost samples",
        f"a: 2 of 6 samples are lost: {OVERLOAD}",
    )


@pytest.mark.parametrize(
    "cell",
    [
        "1.#QNAN",
        "-1.#IND",
        "1.#IND00",
        "1.#SNAN",
        "1.#QNAN0",
        "nan(ind)",
        "-nan(ind)",
        "NoValue",
        "#N/A",
        "#NUM!",
        "#DIV/0!",
        "NaN",
        "-NAN",
    ],
)
def test_what_is_no_number_in_a_text_is_a_lost_sample_and_no_overload(cell, tmp_path):
    recording = open_table(tmp_path, table("1.5", cell, "2.5", cell))
    np.testing.assert_array_equal(recording.read("a"), [1.5, np.nan, 2.5, np.nan])
    assert recording.overloads("a") == 0
    assert recording.notes == ("a: 2 of 4 cells are empty: lost samples",)


def test_words_are_read_with_a_decimal_comma_quotes_and_in_long_texts(tmp_path, monkeypatch):
    text = table("1,5", '"OVLD"', "1,#QNAN", "2,5").replace("0.", "0,").replace("1.", "1,")
    recording = open_table(tmp_path, text)
    np.testing.assert_array_equal(recording.read("a"), [1.5, np.nan, np.nan, 2.5])
    assert recording.overloads("a") == 1
    monkeypatch.setattr(text_table, "PIECE_BYTES", 100)
    many = ["OL" if i % 7 == 3 else f"{i}.25" for i in range(200)]
    recording = open_table(tmp_path, table(*many))
    assert recording.overloads("a") == sum(cell == "OL" for cell in many)
    np.testing.assert_array_equal(np.isnan(recording.read("a")), [cell == "OL" for cell in many])


def test_marks_of_both_signs_do_not_hide_each_other(tmp_path):
    recording = open_table(tmp_path, table("9.9E+37", "1", "-9.9E+37", "2"))
    assert recording.overloads("a") == 2


def test_the_shared_table_of_a_windows_program_is_read():
    recording = recognise(shared_file("reports/qnan.csv")).open(
        shared_file("reports/qnan.csv"), Declarations("dewetron")
    )
    acc, p = recording.read("acc"), recording.read("p")
    assert np.flatnonzero(np.isnan(acc)).tolist() == [50]
    assert (p[50], p[0], p[1], acc.size, recording.time_base("acc").step_s) == (3.0, 1000.0, 1001.5, 200, 1e-3)
    assert acc[:3].tolist() == [0.0, 0.3326, 0.6612]


def test_an_overload_in_the_time_column_is_a_time_that_is_missing(tmp_path):
    text = "Time (s);a (V)\n0;1\n9.9E+37;2\n2;3\n"
    with pytest.raises(Exception, match="line 3, time column: the time is missing"):
        open_table(tmp_path, text).time_base("a")


@pytest.mark.parametrize("mark", MARKS)
def test_a_mark_in_a_stored_channel_is_a_lost_sample(mark, tmp_path):
    samples = np.array([1.0, mark, 2.0, np.inf, mark, 3.0])
    for content in stored(samples):
        recording = open_table(tmp_path, content)
        name = recording.signals[0].name
        before = recording.notes
        np.testing.assert_array_equal(recording.read(name), [1.0, np.nan, 2.0, np.inf, np.nan, 3.0])
        assert recording.overloads(name) == 2
        assert recording.notes == (*before, f"{name}: 2 of 6 samples are lost: {OVERLOAD}")
        np.testing.assert_array_equal(recording.read(name, 2, 3), [2.0])
        assert recording.overloads(name) == 2


def stored(samples: np.ndarray) -> list[bytes]:
    """One channel ``acc`` in every container that stores floating point numbers, at 1 kHz."""
    from asammdf import Signal

    def fill(file) -> None:
        data = file.create_dataset("acc", data=samples)
        data.attrs["unit"] = "V"
        data.attrs["sample_rate"] = 1000.0

    times = np.arange(samples.size) / 1000.0
    wide = build.wave_format(3, 1, 1000, 64)
    return [
        build.tdms_file([("AI", "acc", samples, WAVE)]),
        build.uff_binary(samples, entity="acc"),
        build.uff_text(samples, entity="acc"),
        build.mdf_file([Signal(samples, times, name="acc", unit="V")]),
        build.mat_file({"acc": samples, "t": times}),
        build.hdf5_file(fill),
        build.wave_file(wide, samples.astype("<f8").tobytes()),
        build.tdms_file([("AI", "acc", samples.astype(np.float32), WAVE)]),
    ]


def test_an_export_of_this_project_is_no_exception(tmp_path):
    for content in (exported_files.csv_file(), exported_files.parquet_file()):
        recording = open_table(tmp_path, content)
        assert np.isinf(recording.read("acc, recoil")).sum() == 1
        assert recording.overloads("acc, recoil") == 0
    content = exported_files.csv_file().replace(b"101326.5", b"9.9e+37")
    assert open_table(tmp_path, content).read("p_breech")[0] == 101325.0
    assert np.isnan(open_table(tmp_path, content).read("p_breech")[1])


def test_an_excerpt_says_what_the_whole_would(tmp_path):
    recording = open_table(tmp_path, build.tdms_file([("AI", "acc", np.array([1.0, 9.9e37, 2.0, 3.0]), WAVE)]))
    (name,) = (s.name for s in recording.signals)
    part = excerpt(recording, 0.0005, 0.0035, "a part")
    np.testing.assert_array_equal(part.read(name), [np.nan, 2.0, 3.0])
    assert part.overloads(name) == 1
    assert any("1 of 3 samples are lost: overload" in note for note in part.notes)


def test_a_position_that_overflowed_is_lost(tmp_path):
    rows = "".join(f"{i},{x},{i}.5\n" for i, x in enumerate(["1.5", "9.9E+37", "OVERFLOW", "4.5", "5.5", "6.5"]))
    recording = open_table(tmp_path, f"Frame,tip - X,tip - Y\n{rows}", "camera")
    np.testing.assert_array_equal(recording.read("tip - X"), [1.5, np.nan, np.nan, 4.5, 5.5, 6.5])
    layout = {"header_row": 1, "frame_column": 1, "features": [{"name": "tip", "x": 2, "y": 3}]}
    path = tmp_path / "a.csv"
    declared = Declarations("camera", frame_rate_hz=1000.0, layout=layout)
    np.testing.assert_array_equal(
        BY_LAYOUT["camera"].open(path, declared).read("tip x"), [1.5, np.nan, np.nan, 4.5, 5.5, 6.5]
    )
    rows_of = [["Frame", "tip - X (mm)", "tip - Y (mm)"], *([i, 9.9e37 if i == 2 else i + 0.5, 0.5] for i in range(8))]
    recording = open_table(tmp_path, track_files.workbook({"s": rows_of}), "camera")
    assert np.flatnonzero(np.isnan(recording.read("tip - X"))).tolist() == [2]


def test_notes_do_not_read_samples_of_a_container(tmp_path):
    """What is stored is counted when it is read, not when it is listed."""
    recording = open_table(tmp_path, build.uff_binary(np.array([1.0, 9.9e37, 2.0]), entity="acc"))
    assert not any("overload" in note for note in recording.notes)
    assert io.StringIO(str(recording.listing())).read()


@pytest.mark.parametrize("number", [3.4028234663852886e38, 1.7976931348623157e308, 9.8999e37, 1e37, -9.9e34])
def test_other_large_numbers_are_what_they_are(number, tmp_path):
    recording = open_table(tmp_path, table("1.5", repr(number), "2.5"))
    assert recording.read("a")[1] == number
    assert recording.notes == ()
    recording = open_table(tmp_path, build.uff_binary(np.array([1.0, number]), entity="acc"))
    assert recording.read("acc")[1] == number
