from __future__ import annotations

from typing import Any

import pytest

from recoil_acquisition.errors import Fault
from recoil_acquisition.quantities.declaration import declared
from recoil_acquisition.readers.tracks.layout import TrackLayout

FEATURE = {"name": "Muzzle", "x": "X", "y": "Y"}


def faults_of(**keys: Any) -> list[str]:
    faults: list[Fault] = []
    table = {"header_row": 1, "features": [FEATURE], **keys}
    made = declared(TrackLayout, {key: value for key, value in table.items() if value is not None}, ("layout",), faults)
    assert (made is None) == bool(faults)
    return [str(fault).removeprefix("layout.") for fault in faults]


def layout(**keys: Any) -> TrackLayout:
    made = declared(TrackLayout, {"header_row": 1, "features": [FEATURE], **keys}, ("layout",), [])
    assert made is not None
    return made


def test_a_layout_is_read_with_its_defaults() -> None:
    plain = layout()
    assert [(f.name, f.x, f.y, f.angle) for f in plain.features] == [("Muzzle", "X", "Y", None)]
    assert (plain.separator, plain.decimal, plain.first_line, plain.time_unit, plain.unit) == (",", ".", 2, "s", "")


def test_every_key_is_taken() -> None:
    full = layout(
        separator="tab",
        decimal=",",
        header_row=3,
        first_row=5,
        frame_column="Bild",
        time_column=2,
        time_unit="ms",
        unit="mm",
        angle_unit="deg",
        lost=["n/a", -1, "9999,5"],
        features=[{**FEATURE, "angle": 7}],
    )
    assert [(f.name, f.x, f.y, f.angle) for f in full.features] == [("Muzzle", "X", "Y", 7)]
    assert (full.separator, full.decimal, full.header_row, full.first_line) == ("\t", ",", 3, 5)
    assert (full.frame_column, full.time_column, full.time_unit) == ("Bild", 2, "ms")
    assert (full.unit, full.angle_unit) == ("mm", "deg")
    assert (full.lost_texts, full.lost_values) == (("n/a", "9999,5"), (-1.0, 9999.5))


def test_columns_by_number_need_no_headings() -> None:
    plain = declared(TrackLayout, {"features": [{"name": "a", "x": 2}]}, ("layout",), [])
    assert plain is not None
    assert (plain.header_row, plain.first_line) == (None, 1)


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        ({"seperator": ";"}, "seperator: unknown key; did you mean `separator`?"),
        ({"zebra": 1}, "zebra: unknown key; there are angle_unit, decimal"),
        ({"features": [{**FEATURE, "angel": 3}]}, "features[0].angel: unknown key; did you mean `angle`?"),
        ({"features": [{"x": "X"}]}, "features[0].name: is missing: the feature's name"),
        ({"features": [{"name": "a"}]}, "features[0]: names no column"),
        ({"features": [FEATURE, FEATURE]}, "features: the name 'Muzzle' is there twice"),
        ({"features": []}, "features: must be a list such as"),
        ({"features": ["X"]}, "features[0]: must be a list such as"),
        (
            {"features": [{"name": "a", "x": 0}]},
            "features[0].x: must be a heading, or the number of a column",
        ),
        ({"separator": "::"}, "separator: must be one of tab, space"),
        ({"separator": "5"}, "separator: must be one of tab, space"),
        ({"decimal": ","}, "decimal: is the separator too"),
        ({"decimal": "'"}, "decimal: must be '.' or ','"),
        ({"header_row": 0}, "header_row: must be the number of a line, from 1 to 10000, found 0"),
        ({"header_row": True}, "header_row: must be the number of a line, from 1 to 10000, found True"),
        ({"first_row": 1}, "first_row: 1 is not below header_row 1"),
        ({"header_row": None}, "features[0].x: names a heading, so `header_row` is needed"),
        ({"time_unit": "fields"}, "time_unit: must be one of s"),
        ({"unit": "bar"}, "unit: must be a unit of displacement: px, mm"),
        ({"angle_unit": "mm"}, "angle_unit: must be a unit of angle: deg, rad"),
        ({"unit": 3}, "unit: must be a text, found 3"),
        ({"lost": [None]}, "lost[0]: must be texts and numbers that stand for a lost position, found None"),
        ({"frame_column": 1.5}, "frame_column: must be a heading, or the number"),
    ],
)
def test_a_fault_names_its_key_and_the_near_miss(keys: dict[str, Any], fault: str) -> None:
    assert any(one.startswith(fault) for one in faults_of(**keys)), faults_of(**keys)


def test_all_faults_are_told_at_once() -> None:
    assert len(faults_of(seperator=";", unit="bar", time_unit="x")) == 3
