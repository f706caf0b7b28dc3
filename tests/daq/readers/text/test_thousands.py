from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.text import text_table, thousands
from recoil_acquisition.readers.text.rows import read_rows
from recoil_acquisition.readers.text.text_table import find_block
from recoil_acquisition.readers.text_file import TextFile
from tests.builders import track_files
from tests.builders.opened_files import open_table

COUNTS = tuple(range(980, 1040))
FLOAT_LAYOUT = {"separator": ";", "header_row": 1, "first_row": 2, "time_column": 1, "time_unit": "ms"}


def grouped(mark: str) -> Callable[[int], str]:
    return lambda number: f"{number:,}".replace(",", mark)


def indian(number: int) -> str:
    digits = f"{number:03d}"
    head, tail = digits[:-3], digits[-3:]
    pairs = [head[max(i - 2, 0) : i] for i in range(len(head), 0, -2)][::-1]
    return ",".join([*pairs, tail])


def table(write: Callable[[int], str], separator: str = ";", numbers: tuple[int, ...] = COUNTS) -> str:
    rows = [f"{i}{separator}{write(number)}" for i, number in enumerate(numbers)]
    return "\n".join([f"Time (ms){separator}p (mbar)", *rows, ""])


@pytest.mark.parametrize(
    ("mark", "separator"),
    [(".", ";"), (",", ";"), (".", "\t"), (",", "\t"), (".", ",")],
)
def test_a_mark_that_may_set_thousands_apart_is_refused_with_line_and_cell(mark, separator, tmp_path):
    recording = open_table(tmp_path, table(grouped(mark), separator))
    with pytest.raises(ReadError, match="decimal mark, or sets thousands apart") as caught:
        recording.read("p")
    assert caught.value.place == "line 22, column 'p (mbar)'"
    assert caught.value.found == f"'1{mark}000' beside 999"
    assert f'`thousands = "{mark}"`' in (caught.value.remedy or "")


@pytest.mark.parametrize("mark", ["'", "\u2019", " ", "\u00a0", "\u202f", "\u2009"])
def test_any_other_mark_between_thousands_is_no_number(mark, tmp_path):
    recording = open_table(tmp_path, table(grouped(mark)))
    with pytest.raises(CorruptFileError, match="declare `thousands`") as caught:
        recording.read("p")
    assert caught.value.place == "line 22, column 'p (mbar)'"


def test_lakhs_and_crores_are_no_number_and_are_named(tmp_path):
    recording = open_table(tmp_path, table(indian, numbers=(99_998, 99_999, 100_000, 100_001)))
    with pytest.raises(CorruptFileError, match=r"found '1,00,000'.*declare `thousands`"):
        recording.read("p")


def test_thousands_in_the_time_column_are_not_called_a_time_that_does_not_increase(tmp_path):
    rows = "".join(f"{grouped('.')(i)};{i}.5\n" for i in range(990, 1010))
    with pytest.raises(ReadError, match="sets thousands apart") as caught:
        open_table(tmp_path, "Time (ms);a (V)\n" + rows).time_base("a")
    assert caught.value.place == "line 12, column 'Time (ms)'"


@pytest.mark.parametrize(
    "text",
    [
        "Time [ms];AI 1/1 [mbar]\n{rows}",
        "Measurement time[ms];p [mbar]\n{rows}",
    ],
)
def test_every_recorders_table_asks(text, tmp_path):
    rows = "".join(f"{i};{grouped('.')(number)}\n" for i, number in enumerate(COUNTS))
    recording = open_table(tmp_path, text.format(rows=rows))
    with pytest.raises(ReadError, match="sets thousands apart"):
        recording.read(recording.signals[0].name)


@pytest.mark.parametrize(
    "text",
    [
        "Frame;tip - X;tip - Y\n{rows}",
        "cm_A\nt;x;y\n{rows}",
        "frame_idx;tip.x;tip.y\n{rows}",
        "scorer;net;net\nbodyparts;tip;tip\ncoords;x;y\n{rows}",
    ],
)
def test_every_table_of_tracks_asks(text, tmp_path):
    rows = "".join(f"{i};{grouped('.')(number)};{i}.5\n" for i, number in enumerate(COUNTS))
    with pytest.raises(ReadError, match="sets thousands apart") as caught:
        open_table(tmp_path, text.format(rows=rows), "camera", frame_rate_hz=1000.0)
    assert "'1.000'" in str(caught.value)


def test_points_without_headings_of_numbers_ask_too(tmp_path):
    rows = "".join(f"{grouped('.')(number)},{i}.5\n" for i, number in enumerate(COUNTS))
    with pytest.raises(ReadError, match="sets thousands apart"):
        open_table(tmp_path, "pt1_cam1_X,pt1_cam1_Y\n" + rows, "camera", frame_rate_hz=1000.0)


def test_a_cell_of_text_in_a_workbook_is_asked_about_and_a_number_is_not(tmp_path):
    numbers: list[object] = [1.125, 2.0, 3.0, 2.5 - 0.125, 998.0, 999.0, 7.0, 8.0]
    rows: list[list[object]] = [["Frame", "tip - X (mm)", "tip - Y (mm)"]]
    content = track_files.workbook({"s": [*rows, *([i, x, 0.5] for i, x in enumerate(numbers))]})
    recording = open_table(tmp_path, content, "camera", frame_rate_hz=1000.0)
    np.testing.assert_array_equal(recording.read("tip - X"), np.array(numbers, dtype=float))
    numbers[-2:] = ["1.000", "1.001"]
    numbers[:6] = [994, 995, 996, 997, 998, 999]
    content = track_files.workbook({"s": [*rows, *([i, x, 0.5] for i, x in enumerate(numbers))]})
    with pytest.raises(ReadError, match="sets thousands apart"):
        open_table(tmp_path, content, "camera", frame_rate_hz=1000.0)


def test_a_layout_of_thousands_leaves_the_numbers_of_a_workbook_as_they_are(tmp_path):
    rows: list[list[object]] = [["n", "x"], *([i, x] for i, x in enumerate([1.125, "1.250", 2.5, 3, "999", "12.000"]))]
    layout = {
        "header_row": 1,
        "frame_column": 1,
        "features": [{"name": "tip", "x": 2}],
        "decimal": ",",
        "thousands": ".",
    }
    layout |= {"separator": ";"}
    content = track_files.workbook({"s": rows})
    recording = open_table(tmp_path, content, "camera", layout=layout, frame_rate_hz=1000.0)
    np.testing.assert_array_equal(recording.read("tip x"), [1.125, 1250.0, 2.5, 3.0, 999.0, 12000.0])


# ---- what a rig declares


@pytest.mark.parametrize(
    ("write", "mark", "decimal"),
    [
        (grouped("."), ".", ","),
        (grouped(","), ",", "."),
        (grouped("'"), "'", "."),
        (grouped("\u2019"), "'", ","),
        (grouped("\u202f"), " ", ","),
        (grouped(" "), " ", "."),
        (indian, ",", "."),
    ],
)
def test_declared_thousands_are_read(write, mark, decimal, tmp_path):
    numbers = (7, 980, 999, 1000, 1001, 99_999, 100_000, 12_345_678)
    layout = FLOAT_LAYOUT | {"thousands": mark, "decimal": decimal}
    text = table(lambda n: write(n) + f"{decimal}25", numbers=numbers)
    recording = open_table(tmp_path, text, layout=layout)
    np.testing.assert_array_equal(recording.read("p"), np.array(numbers) + 0.25)
    np.testing.assert_array_equal(open_table(tmp_path, table(write), layout=layout).read("p"), COUNTS)


def test_a_decimal_mark_that_is_declared_as_such_is_not_asked_about(tmp_path):
    recording = open_table(tmp_path, table(grouped(".")), layout=FLOAT_LAYOUT | {"thousands": ""})
    assert recording.read("p")[19:22].tolist() == [999.0, 1.0, 1.001]
    with pytest.raises(ReadError, match="sets thousands apart"):
        open_table(tmp_path, table(grouped(".")), layout=FLOAT_LAYOUT).read("p")


def test_a_cell_whose_marks_do_not_part_thousands_is_no_number_though_they_are_declared(tmp_path):
    layout = FLOAT_LAYOUT | {"thousands": ".", "decimal": ","}
    for cell in ("1.5", "1.00", "1.000.5", "0.125", "1,000.0"):
        with pytest.raises(CorruptFileError, match="line 3"):
            open_table(tmp_path, f"Time;p\n0;2\n1;{cell}\n2;3\n", layout=layout).read("p")


def test_one_mark_cannot_be_both(tmp_path):
    for layout in (FLOAT_LAYOUT | {"thousands": "."}, FLOAT_LAYOUT | {"thousands": ",", "decimal": ","}):
        with pytest.raises(ReadError, match="cannot both mark decimals and set thousands apart"):
            open_table(tmp_path, table(str), layout=layout)


def test_declared_tracks_ask_and_obey(tmp_path):
    layout = {"separator": ";", "header_row": 1, "features": [{"name": "tip", "x": 2}], "time_column": 1}
    layout |= {"time_unit": "ms", "decimal": ","}
    with pytest.raises(ReadError, match=r"found '1,000' beside 999.*`thousands = \",\"`"):
        open_table(tmp_path, table(grouped(",")), "camera", layout=layout)
    layout |= {"thousands": "."}
    recording = open_table(tmp_path, table(grouped(".")), "camera", layout=layout)
    np.testing.assert_array_equal(recording.read("tip x"), COUNTS)
    with pytest.raises(ReadError, match=r"thousands.*is the decimal mark too"):
        open_table(tmp_path, table(str), "camera", layout=layout | {"decimal": "."})


# ---- sound files


@pytest.mark.parametrize(
    "cells",
    [
        ["1.234", "1.500", "2.000", "999.125"],  # three decimals everywhere
        ["999", "1.000", "1.5", "2"],  # zeros left out, and a cell shows it
        ["998", "999", "1000", "1.001"],
        ["0", "0.125", "1.125", "2"],
        ["12", "999", "1.250", "1e3"],
        ["-1", "512.345", "-1", "513.111"],
        ["999", "512.345", "999", "513.111"],  # a marker of lost samples, far from the others
        ["", "1.125", "NaN", "1.250"],
        ["998", "999", "0999.000", "3"],
    ],
)
@pytest.mark.parametrize("comma", [False, True])
def test_sound_columns_are_read_as_before(cells, comma):
    text = "".join(f"{i};{cell}\n" for i, cell in enumerate(cells))
    block = find_block(text_of(text.replace(".", ",") if comma else text), 0, ";", ["t", "a"], decimal_comma=comma)
    expected = [float(cell) if cell else np.nan for cell in cells]
    np.testing.assert_array_equal(read_rows(block)[:, 1], expected)


def text_of(text: str) -> TextFile:
    return TextFile(Path("a.csv"), text.encode(), "utf-8")


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=200)
@given(
    numbers=st.lists(st.integers(-20_000, 20_000), min_size=2, max_size=60),
    separator=st.sampled_from(";\t,"),
    quoted=st.booleans(),
    piece=st.sampled_from([40, 1 << 20]),
)
def test_grouped_numbers_are_never_read_as_decimals_beside_smaller_ones(numbers, separator, quoted, piece):
    """Whatever is read of whole numbers that a program groups is what they were, or all have three decimals."""
    cells = [f'"{n:,}"'.replace(",", ".") if quoted else f"{n:,}".replace(",", ".") for n in numbers]
    text = "".join(f"{i}{separator}{cell}\n" for i, cell in enumerate(cells))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text_table, "PIECE_BYTES", piece)
        patch.setattr(thousands, "PART_BYTES", piece // 4)
        block = find_block(text_of(text), 0, separator, ["t", "a"], decimal_comma=False)
        try:
            values = read_rows(block)[:, 1]
        except ReadError:
            return
    small = [n for n in numbers if abs(n) < 1000]
    if len(set(small)) > 1 or small == [0]:
        np.testing.assert_array_equal(values, numbers)


def test_the_piece_in_which_it_shows_may_be_far_from_the_first(tmp_path, monkeypatch):
    monkeypatch.setattr(text_table, "PIECE_BYTES", 200)
    numbers = tuple(range(500, 1100))
    with pytest.raises(ReadError, match="line 502, column 'p"):
        open_table(tmp_path, table(grouped("."), numbers=numbers)).read("p")
