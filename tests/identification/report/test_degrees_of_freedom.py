"""Degrees of freedom: of each zero the samples of its rest less one, in budget and page, and what follows of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.shot import InputFile
from recoil_identification.report.document import report_document
from recoil_identification.report.formulas import formula_of
from recoil_identification.report.tables import budget
from recoil_processing.noise import welch_satterthwaite
from tests.builders.virtual_shots import identified, virtual_shot

SHOT_FILE = InputFile("s1.h5", "ab" * 32, 123, "", "shot file")
ZEROS = {
    "recoil_acceleration zero": "recoil_acceleration",
    "breech_pressure zero": "breech_pressure",
    "brake_pressure zero": "brake_pressure",
}


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    return report_document(virtual_shot("mixed").shot, identified("mixed"), version="1", shot_file=SHOT_FILE)


def test_a_zero_has_the_samples_of_the_rest_less_one(report: dict[str, Any]) -> None:
    signals = identified("mixed").route.signals
    times_s = signals.start_s + signals.step_s * np.arange(signals.series["breech_pressure"].size)
    first, last = signals.baseline_s
    rows = {row["source"]: row for row in report["budget"]}
    for source, role in ZEROS.items():
        resting = np.isfinite(signals.series[role][(times_s >= first) & (times_s <= last)])
        assert rows[source]["degrees_of_freedom"] == pytest.approx(np.count_nonzero(resting) - 1, abs=2)
        assert rows[source]["type"] == "A"


def test_what_a_certificate_states_is_taken_as_known(report: dict[str, Any]) -> None:
    known = [row for row in report["budget"] if row["type"] == "B"]
    assert known
    assert all(row["degrees_of_freedom"] is None for row in known)
    assert all(row["degrees_of_freedom"] is not None for row in report["budget"] if row["type"] == "A")


def test_the_effective_ones_follow_from_the_rows_that_are_stated(report: dict[str, Any]) -> None:
    rows = report["budget"]
    fourth = sum(row["u_kg"] ** 4 / row["degrees_of_freedom"] for row in rows if row["degrees_of_freedom"])
    expected = sum(row["u_kg"] ** 2 for row in rows) ** 2 / fourth
    assert report["uncertainty"]["degrees_of_freedom"] == pytest.approx(expected, rel=1e-12)


def test_the_page_has_them_in_the_table(report: dict[str, Any]) -> None:
    written = {row["source"]: row["freedom"] for row in budget(report)}
    of_zero = next(row for row in report["budget"] if row["source"] == "breech_pressure zero")
    assert written["breech_pressure zero"].replace("\N{NARROW NO-BREAK SPACE}", "") == str(
        int(of_zero["degrees_of_freedom"])
    )
    assert written["packing friction"] == "∞"


def test_a_zero_explains_where_they_come_from(report: dict[str, Any]) -> None:
    formula = formula_of("budget.breech_pressure zero.degrees_of_freedom", report)
    assert formula is not None
    assert "n - 1" in formula.text


def test_two_equal_means_of_ten_have_eighteen_together() -> None:
    """JCGM 100:2008, H.3 and G.4.1: equal contributions add up their degrees of freedom."""
    assert welch_satterthwaite([(0.3, 9.0), (0.3, 9.0)]) == pytest.approx(18.0)
    # G.4.1, note 1: what is known adds to u alone
    assert welch_satterthwaite([(1.0, 9.0), (1.0, math.inf)]) == pytest.approx(36.0)
    assert math.isinf(welch_satterthwaite([(1.0, math.inf)]))
    assert math.isinf(welch_satterthwaite([(0.0, 3.0), (math.inf, 5.0)]))
