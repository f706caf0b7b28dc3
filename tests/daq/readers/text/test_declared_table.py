from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, Fault, ReadError
from recoil_acquisition.quantities.declaration import declared
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.declared_table import DeclaredTextReader
from recoil_acquisition.readers.text.layout import TextLayout
from tests.builders import text_tables as build
from tests.builders.opened_files import open_bytes

READER = DeclaredTextReader()


def layout_faults(table: dict[str, Any]) -> list[tuple[str, str]]:
    faults: list[Fault] = []
    assert (declared(TextLayout, table, ("layout",), faults) is None) == bool(faults)
    return [(fault.key.removeprefix("layout."), fault.problem) for fault in faults]


def opened(folder: Path, content: bytes, layout: dict[str, Any] | None) -> Recording:
    return open_bytes(READER, "a.txt", folder, content, Declarations("dewetron", layout=layout))


def test_names_units_and_time_are_where_the_rig_says(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.DECLARED, build.DECLARED_LAYOUT)
    assert [(s.name, s.unit) for s in recording.signals] == [("u", "bar"), ("v", "")]
    np.testing.assert_array_equal(recording.read("u"), [row[0] for row in build.rows()])
    assert recording.time_base("u").step_s == 5e-4
    assert recording.notes == ()


TABLE = {"separator": ",", "time_column": "Time", "time_unit": "s"}
ROWS = "".join(f"{1e-3 * k:.3f},{k % 7}\n" for k in range(40))


@pytest.mark.parametrize(
    ("head", "layout", "said"),
    [
        ("Time,acc\nms,mm/s2\n", {"header_row": 1, "first_row": 3}, "declare `unit_row = 2`"),
        ("Time,acc\n[s],[g]\n", {"header_row": 1, "first_row": 3, "unit_row": 2}, ""),
        ("Time,acc\none,two\n", {"header_row": 1, "first_row": 3}, ""),
        ("# Sample rate: 500 Hz\nTime,acc\n", {"header_row": 2, "first_row": 3}, "500 Hz, the column of time has 1000"),
        ("# Sample rate: 1 kHz\nTime,acc\n", {"header_row": 2, "first_row": 3}, ""),
    ],
)
def test_units_and_a_rate_that_the_layout_passes_over_are_named(
    head: str, layout: dict[str, Any], said: str, tmp_path: Path
) -> None:
    recording = opened(tmp_path, f"{head}{ROWS}".encode(), TABLE | layout)
    assert recording.time_base("acc").step_s == 1e-3
    assert [said in note for note in recording.notes] == [True] * bool(said)


def test_what_is_no_text_is_named_and_not_the_layout_to_blame(tmp_path: Path) -> None:
    book = io.BytesIO()
    with zipfile.ZipFile(book, "w") as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
    for content, name in (
        (book.getvalue(), "a packed archive"),
        (b"SQLite format 3\0" + bytes(99), "an SQLite database"),
    ):
        with pytest.raises(ReadError, match=f"this is {name}, and its source declares a layout"):
            opened(tmp_path, content, TABLE | {"header_row": 1, "first_row": 2})


def test_another_rate_than_the_declared_one_is_named(tmp_path: Path) -> None:
    layout = {"separator": ",", "header_row": 2, "first_row": 3, "rate_hz": 1e3}
    recording = opened(tmp_path, f"# Interval: 2 ms\nn,acc\n{ROWS}".encode(), layout)
    assert "line 1 states 500 Hz, the rig declares 1000 Hz: that counts" in recording.notes


def test_missing_texts_are_lost_and_comments_are_no_rows(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.BARE, build.BARE_LAYOUT)
    samples = recording.read("p")
    assert samples.size == 40
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(samples)), [7])
    assert recording.time_base("p").step_s == 1e-3
    assert any("1 of 40 cells" in note for note in recording.notes)
    assert any("row number over 1000 Hz, declared by the rig" in note for note in recording.notes)


def test_a_fault_behind_comments_is_named_by_its_own_line(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match="line 27, column 'p'"):
        opened(tmp_path, build.BARE.replace(b"24,48", b"24,x"), build.BARE_LAYOUT).read("p")


def test_a_declared_rate_that_the_time_column_contradicts_is_refused(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.DECLARED, {**build.DECLARED_LAYOUT, "rate_hz": 1000})
    with pytest.raises(CorruptFileError, match="contradicts the sample rate; expected 1000 Hz, declared by the rig"):
        recording.time_base("u")


def test_a_declared_unit_of_time_that_differs_from_the_files_is_noted(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.DECLARED, {**build.DECLARED_LAYOUT, "time_unit": "s"})
    assert recording.time_base("u").step_s == 0.5
    assert any("states 'ms', the rig declares 's'" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("change", "key", "problem"),
    [
        ({"seperator": ";"}, "seperator", "unknown key; did you mean `separator`?"),
        ({"separator": "x"}, "separator", "must be one of"),
        ({"decimal": "·"}, "decimal", 'must be "." or ","'),
        ({"separator": ",", "decimal": ","}, "decimal", "cannot both"),
        ({"encoding": "utf-9"}, "encoding", "must be one of utf-8"),
        ({"header_row": 0}, "header_row", "from 1, found 0"),
        ({"header_row": True}, "header_row", "from 1, found True"),
        ({"header_row": 9}, "header_row", "must lie above `first_row`, 4, found 9"),
        ({"unit_row": 2}, "unit_row", "is the row of names as well"),
        ({"time_column": 0}, "time_column", "its number from 1"),
        ({"time_unit": "turns"}, "time_unit", "must be one of s, ms"),
        ({"rate_hz": -1.0}, "rate_hz", "must be a positive number"),
        ({"rate_hz": float("nan")}, "rate_hz", "must be a positive number"),
        ({"names": ["a", "a"]}, "names", "different texts"),
        ({"names": ["t", "a"]}, "names", "is declared twice"),
        ({"units": ["s"]}, "units", "is declared twice"),
        ({"missing": "-999"}, "missing", "must be a list of texts that mean a lost sample"),
        ({"comment": "1"}, "comment", "begins no number"),
    ],
)
def test_every_fault_of_a_layout_names_its_key(change: dict[str, Any], key: str, problem: str, tmp_path: Path) -> None:
    layout = {**build.DECLARED_LAYOUT, **change}
    faults = dict(layout_faults(layout))
    assert problem in faults[key]
    with pytest.raises(ReadError, match=r"\[source\].*layout\." + key):
        opened(tmp_path, build.DECLARED, layout)


def test_a_layout_needs_a_separator_a_first_row_names_and_time() -> None:
    assert [key for key, _ in layout_faults({})] == ["separator", "first_row"]
    assert [key for key, _ in layout_faults({"separator": ";", "first_row": 1})] == ["header_row", "time_column"]


def test_a_time_column_beside_the_names_names_the_nearest() -> None:
    table = {"separator": ";", "first_row": 1, "names": ["Zeit", "p"], "time_column": "zeit"}
    assert layout_faults(table) == [("time_column", "'zeit' is not among `names`; the nearest are 'Zeit', 'p'")]
    assert [key for key, _ in layout_faults({**table, "time_column": 3})] == ["time_column"]


def test_a_sound_layout_is_frozen_and_complete() -> None:
    layout = declared(TextLayout, build.BARE_LAYOUT, ("layout",), [])
    assert isinstance(layout, TextLayout)
    assert layout.names == ("count", "p")
    assert layout.decimal == "."


def test_what_the_file_does_not_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="declares no layout"):
        opened(tmp_path, build.DECLARED, None)
    with pytest.raises(CorruptFileError, match="shorter than its declared layout"):
        opened(tmp_path, b"a|b\n", build.DECLARED_LAYOUT)
    with pytest.raises(ReadError, match=r"time column is not in the file.*expected 'T'"):
        opened(tmp_path, build.DECLARED, {**build.DECLARED_LAYOUT, "time_column": "T"})
    with pytest.raises(ReadError, match=r"line 2: the declared row of names has one cell only; expected .*';'"):
        opened(tmp_path, build.DECLARED, {**build.DECLARED_LAYOUT, "separator": ";"})


SLASHED = {"separator": ";", "header_row": 1, "first_row": 2, "time_column": 1}


def american(date: str, half: str = " PM") -> bytes:
    return b"when;p\n" + b"".join(b"%s 2:23:05.%03d%s;%d\n" % (date.encode(), i, half.encode(), i) for i in range(100))


def test_a_date_whose_order_is_open_dates_rows_from_the_first_and_no_start_is_known(tmp_path: Path) -> None:
    recording = opened(tmp_path, american("03/04/2026"), SLASHED)
    assert recording.time_base("p").step_s == 1e-3
    assert recording.absolute_start is None
    (note,) = recording.notes[-1:]
    assert note == "whether the first date is 2026-03-04 or 2026-04-03 is not told: the start is not known"


def test_a_date_of_one_order_alone_is_the_start(tmp_path: Path) -> None:
    for date in ("03/14/2026", "14/03/2026", "14-3-2026"):
        start = opened(tmp_path, american(date), SLASHED).absolute_start
        assert start is not None
        assert start.text == "2026-03-14T14:23:05.000"


def test_a_date_that_changes_while_its_order_is_open_is_refused_with_its_line(tmp_path: Path) -> None:
    rows = american("03/04/2026") + b"03/05/2026 12:00:00.000 AM;7\n"
    with pytest.raises(CorruptFileError, match=r"line 102.*whether day or month is first"):
        opened(tmp_path, rows, SLASHED).read("p")
