"""Tables for spreadsheets: numbers stay numbers, and no text is a formula or hides a character."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import openpyxl
import pandas as pd
import pytest

from recoil_acquisition.errors import StoreError
from recoil_identification.report.document.spreadsheet import csv_text, plain_cell, write_workbook


@pytest.mark.parametrize(
    ("value", "cell"),
    [
        ("=1+1", "'=1+1"), ("-x", "'-x"), ("+x", "'+x"), ("@x", "'@x"), ("\t=1", "\\t=1"), ("a", "a"), (-1.5, -1.5),
        (7, 7), (None, None), ([1], "[1]"), ("a\x07b", "a\\x07b"),
    ],
)  # fmt: skip
def test_no_cell_is_a_formula(value: object, cell: object) -> None:
    assert plain_cell(value) == cell


def test_a_table_as_text_keeps_every_digit_and_every_row_on_its_line() -> None:
    text = csv_text(("shot", "mass"), [("a\n=b", 1 / 3), ("=c", None), ("d", True)])
    assert list(csv.reader(io.StringIO(text))) == [
        ["shot", "mass"], ["a\\n=b", repr(1 / 3)], ["'=c", ""], ["d", "true"],
    ]  # fmt: skip
    assert len(text.splitlines()) == 4


def test_a_workbook_has_no_formula_and_is_not_replaced_unasked(tmp_path: Path) -> None:
    path = tmp_path / "book.xlsx"
    table = pd.DataFrame({"shot": ["=1+1", "x\x07"], "mass": [-1.5, None]})
    write_workbook(path, {"shots": table})
    sheet = openpyxl.load_workbook(path)["shots"]
    cells = [cell for row in sheet.iter_rows() for cell in row]
    assert all(cell.data_type != "f" for cell in cells)
    assert [sheet.cell(2, 1).value, sheet.cell(3, 1).value, sheet.cell(2, 2).value] == ["'=1+1", "x\\x07", -1.5]
    with pytest.raises(StoreError, match="exists already"):
        write_workbook(path, {"shots": table})
