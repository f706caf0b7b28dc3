from __future__ import annotations

from typing import Any

import pytest

from recoil_acquisition.readers.tracks.layout import DeclaredFeature, LayoutError, TrackLayout

FEATURE = {"name": "Muzzle", "x": "X", "y": "Y"}


def layout(**keys: Any) -> TrackLayout:
    return TrackLayout.from_mapping({"header_row": 1, "features": [FEATURE], **keys})


def test_a_layout_is_read_with_its_defaults() -> None:
    assert layout() == TrackLayout((DeclaredFeature("Muzzle", "X", "Y"),), header_row=1, first_row=2)


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
    assert full == TrackLayout(
        (DeclaredFeature("Muzzle", "X", "Y", 7),), "\t", ",", 3, 5, "Bild", 2, "ms", "mm", "deg",
        ("n/a", "9999,5"), (-1.0, 9999.5),
    )  # fmt: skip


def test_columns_by_number_need_no_headings() -> None:
    plain = TrackLayout.from_mapping({"features": [{"name": "a", "x": 2}]})
    assert (plain.header_row, plain.first_row) == (None, 1)


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        ({"seperator": ";"}, "seperator: unknown key, did you mean 'separator'?"),
        ({"zebra": 1}, "zebra: unknown key, known are separator, decimal"),
        ({"features": [{**FEATURE, "angel": 3}]}, "features[0].angel: unknown key, did you mean 'angle'?"),
        ({"features": [{"x": "X"}]}, "features[0].name: a text is needed"),
        ({"features": [{"name": "a"}]}, "features[0]: names no column"),
        ({"features": [FEATURE, FEATURE]}, "features: the name 'Muzzle' is there twice"),
        ({"features": []}, "features: a list such as"),
        ({"features": ["X"]}, "features[0]: is no table"),
        ({"features": [{"name": "a", "x": 0}]}, "features[0].x: 0 is neither a heading nor the number of a column"),
        ({"separator": "::"}, "separator: '::' is no separator"),
        ({"separator": "5"}, "separator: '5' is no separator"),
        ({"decimal": ","}, "decimal: is the separator too"),
        ({"decimal": "'"}, 'decimal: "\'" is neither'),
        ({"header_row": 0}, "header_row: 0 is no number of a line"),
        ({"header_row": True}, "header_row: True is no number of a line"),
        ({"first_row": 1}, "first_row: 1 is not below header_row 1"),
        ({"header_row": None}, "features[0].x: names a heading, so `header_row` is needed"),
        ({"time_unit": "fields"}, "time_unit: 'fields' is none of s"),
        ({"unit": "bar"}, "unit: 'bar' is no unit of displacement: px, mm"),
        ({"angle_unit": "mm"}, "angle_unit: 'mm' is no unit of angle: deg, rad"),
        ({"unit": 3}, "unit: 3 is no text"),
        ({"lost": [None]}, "lost: None is neither a text nor a number"),
        ({"frame_column": 1.5}, "frame_column: 1.5 is neither a heading"),
    ],
)
def test_a_fault_names_its_key_and_the_near_miss(keys: dict[str, Any], fault: str) -> None:
    with pytest.raises(LayoutError) as caught:
        layout(**keys)
    assert any(one.startswith(fault) for one in caught.value.faults), caught.value.faults


def test_all_faults_are_told_at_once() -> None:
    with pytest.raises(LayoutError) as caught:
        layout(seperator=";", unit="bar", time_unit="x")
    assert len(caught.value.faults) == 3
