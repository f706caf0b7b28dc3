"""The document and the page of a target."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.shot import InputFile
from recoil_identification.report.figure.figure import Figure, Panel, Trace
from recoil_identification.report.page.html import render_target_page
from recoil_identification.targets import TARGETS, target_function
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_document import SCHEMA, series_text, target_document, write_target_document
from recoil_identification.targets.target_result import Quantity, Series, Table, TargetResult
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.shots import make_shot


def a_finding(**changes: object) -> TargetResult:
    values: dict[str, object] = {
        "target": "stiffness",
        "title": "Stiffness of the elevating gear",
        "summary": "Moment on angle.",
        "quantities": (
            Quantity("stiffness", "k", 2.0123e6, 1.4e4, "N m/rad", "by moment on angle", 2.1e6, 2e4),
            Quantity("damping", "c", math.nan, math.nan, "N m s/rad", "too little motion"),
        ),
        "figures": (
            Figure("k", "Stiffness", "It is flat.", "t, s", (Panel("k", (Trace("k", [0, 1], [1, 2], "model"),)),)),
        ),
        "series": Series({"time_s": np.array([0.0, 0.5]), "k_n_m": np.array([1.5, math.nan])}),
        "tables": (Table("Loads", "What was taken.", ("load", "N"), (("ground <C>", "3"),)),),
    }
    return TargetResult(**(values | changes))  # type: ignore[arg-type]  # a builder takes any field


def a_document(found: TargetResult) -> dict[str, Any]:
    return target_document(make_shot(), found, version="1.2", shot_file=InputFile("0001.h5", "ab", 3, "", "shot file"))


def test_a_document_holds_numbers_intervals_and_the_comparison_with_the_rig() -> None:
    document = a_document(a_finding())
    stiffness, damping = document["quantities"]
    assert document["schema"] == SCHEMA
    assert stiffness["U95"] == pytest.approx([2.0123e6 - 1.959964 * 1.4e4, 2.0123e6 + 1.959964 * 1.4e4])
    assert stiffness["E_n"] == pytest.approx((2.0123e6 - 2.1e6) / (2 * math.hypot(1.4e4, 2e4)))
    assert damping["value"] is None
    assert damping["U95"] == [None, None]
    assert damping["E_n"] is None


def test_an_interval_of_its_own_stands_in_the_place_of_the_symmetric_one() -> None:
    assert Quantity("n", "n", 1.0, 0.1, "1", interval=(0.9, 1.4)).U95 == (0.9, 1.4)


def test_a_page_shows_quantities_tables_reasons_and_escapes_them() -> None:
    found = a_finding(reasons=(Reason(ReasonCode.NOT_IDENTIFIED, "k", "the excitation <is> small"),))
    page = render_target_page(a_document(found), found.figures)
    assert "NOT VALID" in page
    assert "the excitation &lt;is&gt; small" in page
    assert "ground &lt;C&gt;" in page
    assert ">2012<" in page
    assert ">kN m/rad<" in page
    assert "too little motion" in page


def test_a_series_leaves_blank_what_was_not_identified(tmp_path: Path) -> None:
    found = a_finding()
    assert found.series is not None
    assert series_text(found.series) == "time_s,k_n_m\n0,1.5\n0.5,\n"
    document = a_document(found)
    assert json.loads(write_target_document(tmp_path, document).read_text("utf-8")) == document


@pytest.mark.parametrize("columns", [{}, {"k": np.zeros(2)}, {"time_s": np.zeros(2), "k": np.zeros(3)}])
def test_a_series_without_time_or_of_unequal_columns_is_refused(columns: dict[str, np.ndarray]) -> None:
    with pytest.raises(ValueError, match=r"time_s|one length"):
        Series(columns)


@pytest.mark.parametrize("name", list(TARGETS))
def test_every_target_of_the_table_has_its_function(name: str) -> None:
    assert callable(target_function(name))


def test_an_unknown_target_is_refused() -> None:
    with pytest.raises(ValueError, match="must be one of"):
        target_function("colour")


def test_a_case_refuses_a_shot_without_the_channels() -> None:
    from recoil_acquisition.errors import IdentificationError
    from recoil_rigs.rig import load_rig

    case = Case(FiredShot(make_shot(), load_rig("field-2013")))
    with pytest.raises(IdentificationError, match="no channel of role ground_speed"):
        case.require_roles("ground_speed", purpose="a stiffness")
