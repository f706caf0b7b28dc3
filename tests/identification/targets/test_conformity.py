"""Conformity of a target's mass with the tolerance that the rig states, and nothing of it where none is stated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from recoil_acquisition.shot.shot import InputFile
from recoil_identification.report.content.tables import quantities, tolerances
from recoil_identification.report.document.formulas import formula_of
from recoil_identification.report.page.html import render_target_page
from recoil_identification.targets.target_document import target_document
from recoil_identification.targets.target_result import Quantity, TargetResult
from recoil_rigs.tables.issue import Issue
from tests.builders.virtual_shots import virtual_shot

SHOT_FILE = InputFile("s1.h5", "ab" * 32, 123, "", "shot file")
MASS = Quantity("recoiling mass", "m3", 784.0, 3.0, "kg", "equation of motion", 782.0, 0.0, of_recoiling_part=True)
STIFFNESS = Quantity("stiffness of the ground", "k", 3.25e7, 4.0e5, "N/m", "load on deflection", 3.0e7)


def document(*found: Quantity, tolerance: tuple[float, float] | None = (-4.0, 4.0)) -> dict[str, Any]:
    virtual = virtual_shot("mixed")
    rig = virtual.rig.with_added_mass(0.0, 0.4)
    finding = TargetResult("parameters", "Masses", "By all equations.", found)
    return target_document(
        virtual.shot, finding, version="1", shot_file=SHOT_FILE, rig=rig, issued=Issue(tolerance_kg=tolerance)
    )


def test_probability_of_a_target_s_mass_is_that_of_drawn_masses() -> None:
    stated = document(MASS, STIFFNESS)["quantities"]
    drawn = 784.0 - 782.0 + np.hypot(3.0, 0.4) * np.random.default_rng(3).standard_normal(400_000)
    assert stated[0]["conformity"]["probability"] == pytest.approx(np.mean(np.abs(drawn) <= 4.0), abs=3e-3)
    assert stated[0]["conformity"]["limits_kg"] == [778.0, 786.0]
    assert "conformity" not in stated[1]
    formula = formula_of("quantities.m3.conformity.probability", document(MASS))
    assert formula is not None
    assert "JCGM 106" in formula.source


def test_the_page_says_how_probable_it_is_and_of_what_no_tolerance_is_stated() -> None:
    made = document(MASS, STIFFNESS)
    assert [row["conforms"] for row in quantities(made)] == ["72.2 %, NOT SHOWN", ""]
    (sentence,) = tolerances(made)
    assert "no tolerance is stated" in sentence
    page = render_target_page(made, ())
    assert "72.2 %, NOT SHOWN" in page


@pytest.mark.parametrize("made", [lambda: document(MASS, tolerance=None), lambda: document(STIFFNESS)])
def test_where_none_is_stated_the_page_says_so(made: Any) -> None:
    assert tolerances(made())[0].startswith("No conformity is stated")
    assert "No conformity is stated" in render_target_page(made(), ())
