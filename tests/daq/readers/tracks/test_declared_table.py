from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition import conformance as rules
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import BY_LAYOUT, READERS
from recoil_acquisition.readers.tracks import declared_table
from tests.builders import track_files as build
from tests.builders.opened_files import open_bytes

READER = BY_LAYOUT["camera"]
LAYOUT: dict[str, Any] = {
    "separator": ";",
    "decimal": ",",
    "header_row": 2,
    "first_row": 4,
    "frame_column": "Bild",
    "time_column": "Zeit",
    "time_unit": "ms",
    "features": [{"name": "Muzzle", "x": "MX", "y": "MY", "angle": "Winkel"}, {"name": "Cradle", "x": 7}],
    "unit": "mm",
    "angle_unit": "deg",
    "lost": ["weg", 9999],
}


def table(count: int = 24, lost: dict[int, str] | None = None) -> str:
    lines = ["Aufnahme 7;;;;;;", "Bild;Zeit;MX;MY;Winkel;Bemerkung;CX", "-;ms;mm;mm;Grad;;mm"]
    for i in range(count):
        x = (lost or {}).get(i, f"{i}.5".replace(".", ","))
        remark = "gut; oder nicht".replace(";", "")
        lines.append(f"{i + 100};{0.5 * (i + 100):.1f}".replace(".", ",") + f";{x};-{i},25;0,5;{remark};{i * i},0")
    return "".join(line + "\n" for line in lines)


def opened(tmp_path: Path, content: str | bytes, layout: dict[str, Any] | None = None, rate_hz: float | None = None):
    declared = Declarations("camera", frame_rate_hz=rate_hz, layout=layout or LAYOUT)
    return open_bytes(READER, "a.csv", tmp_path, content, declared)


def test_the_declared_columns_are_read_and_the_others_named(tmp_path: Path) -> None:
    recording: Recording = opened(tmp_path, table())
    assert [(s.name, s.unit) for s in recording.signals] == [
        ("Muzzle x", "mm"), ("Muzzle y", "mm"), ("Muzzle angle", "deg"), ("Cradle x", "mm"),
    ]  # fmt: skip
    np.testing.assert_array_equal(recording.read("Muzzle x"), np.arange(24) + 0.5)
    np.testing.assert_array_equal(recording.read("Cradle x"), np.arange(24.0) ** 2)
    np.testing.assert_allclose(recording.time_base("Muzzle x").times_s, (np.arange(24) + 100) / 2000.0, atol=1e-12)
    assert [(t.name, t.axes) for t in recording.tracks()] == [("Muzzle", ("X", "Y")), ("Cradle", ("X",))]
    assert recording.tracks()[0].frame_numbers[0] == 100
    assert "columns that the layout does not declare were left out: Bemerkung" in recording.notes


def test_declared_texts_and_values_are_lost_and_minus_one_is_not(tmp_path: Path) -> None:
    recording = opened(tmp_path, table(lost={3: "weg", 4: "9999", 5: "", 6: "WEG", 7: "-1", 8: "NaN"}))
    assert np.flatnonzero(recording.tracks()[0].lost).tolist() == [3, 4, 5, 6, 8]
    assert recording.read("Muzzle x")[7] == -1.0


def test_a_cell_that_is_no_number_is_refused_with_its_line_and_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match=r"line 7, column 'Muzzle x': a cell is not a number") as caught:
        opened(tmp_path, table(lost={3: "fort"}))
    assert "correct `layout` of this source in the rig file" in str(caught.value)
    with pytest.raises(CorruptFileError, match="a number with decimal ','"):
        opened(tmp_path, table(lost={3: "3.5"}))


CELLS = st.sampled_from(
    ["1", "-2,5", "+3,25e1", " 4 ", ",5", "6.", "7.5", "9999", "weg", "", "nan", "8x", '"9"', "1e", "²"]
)


@pytest.mark.exhaustive
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.lists(st.lists(CELLS, min_size=1, max_size=4), min_size=1, max_size=5), ending=st.sampled_from(["", "\n"])
)
def test_rows_that_are_read_at_once_are_read_as_cell_by_cell(
    rows: list[list[str]], ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout = {"separator": ";", "decimal": ",", "features": [{"name": "a", "x": 2}], "lost": ["weg", "9999"]}
    content = "\n".join(";".join(row) for row in [["1", "2"], *rows]) + ending
    found = []
    for pattern in (declared_table._row_of_numbers, lambda *_: declared_table.NO_ROW):
        monkeypatch.setattr(declared_table, "_row_of_numbers", pattern)
        try:
            recording = opened(tmp_path, content, layout, 1000.0)
            found.append([repr(recording.read("a x").tolist()), *recording.notes])
        except (CorruptFileError, ReadError) as error:
            found.append([str(error)])
    monkeypatch.undo()
    assert found[0] == found[1]


def test_blank_lines_below_the_last_row_are_none_and_between_rows_an_error(tmp_path: Path) -> None:
    content = table()
    assert opened(tmp_path, content + "\n  \n\n").signals[0].sample_count == 24
    with pytest.raises(CorruptFileError, match=r"line 28: a row has too few cells"):
        opened(tmp_path, content + "\n" + content.splitlines()[-1] + "\n")


def test_a_last_row_of_too_few_cells_is_left_out_and_told(tmp_path: Path) -> None:
    recording = opened(tmp_path, table() + "124;62,0;1\n\n")
    assert recording.signals[0].sample_count == 24
    assert recording.incomplete == "the last row has fewer than 7 cells: it was left out"
    with pytest.raises(CorruptFileError, match=r"line 28: a row has too few cells"):
        opened(tmp_path, table() + "124;62,0;1\n124")


def test_a_heading_that_is_not_there_names_the_near_ones(tmp_path: Path) -> None:
    layout = {**LAYOUT, "frame_column": "Bilder"}
    with pytest.raises(
        ReadError, match=r"line 2, layout.frame_column: no column is headed 'Bilder'; expected one of 'Bild'"
    ):
        opened(tmp_path, table(), layout)


def test_a_heading_that_is_there_twice_needs_a_number(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="2 columns are headed 'MX'"):
        opened(tmp_path, table().replace(";MY;", ";MX;"), {**LAYOUT, "features": [{"name": "a", "x": "MX"}]})


@pytest.mark.parametrize("line", ["104;52,0;4,5\n", "\n"])
def test_a_row_with_too_few_cells_is_refused(line: str, tmp_path: Path) -> None:
    lines = table().splitlines(keepends=True)
    lines[7] = line
    with pytest.raises(CorruptFileError, match="line 8: a row has too few cells"):
        opened(tmp_path, "".join(lines))


def test_a_faulty_or_missing_layout_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=r"source 'camera'.layout.seperator: unknown key; did you mean `separator`\?"):
        opened(tmp_path, table(), {**LAYOUT, "seperator": ";"})
    with pytest.raises(ReadError, match="no layout is declared"):
        READER.open(tmp_path / "a.csv", Declarations("camera"))
    with pytest.raises(CorruptFileError, match="ends above the declared headings"):
        opened(tmp_path, table(), {**LAYOUT, "header_row": 90, "first_row": 91})


def test_frames_that_contradict_their_times_are_told(tmp_path: Path) -> None:
    text = table().replace("\n110;55,0;", "\n110;55,4;")
    assert any("printed time of 1 frames disagrees" in note for note in opened(tmp_path, text).notes)
    assert any("contradicts the declared 30 Hz" in note for note in opened(tmp_path, table(), rate_hz=30.0).notes)


@pytest.mark.parametrize(("separator", "text"), [("space", "  "), ("tab", "\t"), ("|", "|")])
def test_other_separators_are_read(separator: str, text: str, tmp_path: Path) -> None:
    rows = "".join(text.join([str(i), f"{i}.5", "2.25"]) + "\n" for i in range(8))
    layout = {"separator": separator, "frame_column": 1, "features": [{"name": "a", "x": 2, "y": 3}]}
    recording = opened(tmp_path, rows, layout, rate_hz=100.0)
    np.testing.assert_array_equal(recording.read("a x"), np.arange(8) + 0.5)
    assert recording.signals[0].unit == ""


def test_a_workbook_is_read_by_the_same_layout(tmp_path: Path) -> None:
    rows = build.workbook_rows(unit="furlong")
    layout = {"header_row": 2, "frame_column": "Frame", "time_column": 2, "unit": "cm",
              "features": [{"name": "M", "x": "Muzzle X (furlong)"}]}  # fmt: skip
    recording = opened(tmp_path, build.workbook({"a": rows}), layout)
    np.testing.assert_array_equal(recording.read("M x"), build.X)
    assert recording.signals[0].unit == "cm"


CASE = rules.Case(
    "declared-tracks",
    READER,
    table(lost={5: "weg"}).encode(),
    Declarations("camera", layout=LAYOUT),
    {"Muzzle x": (0.0, 30.0), "Cradle x": (0.0, 600.0)},
    lambda cut: cut.endswith(b"\n"),
)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "rule", [rule for rule in rules.RULES if rule is not rules.claims_its_own_file], ids=lambda rule: rule.__name__
)
def test_every_rule_of_a_reader_is_kept_but_that_of_claiming(
    rule: Callable[[rules.Case, Path], None], tmp_path: Path
) -> None:
    rule(CASE, tmp_path)


def test_it_claims_nothing_and_is_not_in_the_table() -> None:
    assert not READER.claims(Head(CASE.content))
    assert all(reader.name != READER.name for reader in READERS)


@pytest.mark.exhaustive
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flips=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=6))
def test_flipped_bytes_never_give_another_exception(tmp_path: Path, flips: list[tuple[float, int]]) -> None:
    rules.flipped_bytes_are_refused_or_read(CASE, tmp_path, [flips])
