"""Units by choice, and groups of digits: the same figures and peaks in what a reader knows, documents in SI."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_acquisition.errors import Fault
from recoil_identification.estimate.rounding import THIN, grouped
from recoil_identification.report.chosen_units import ChosenUnits
from recoil_identification.report.figure import Figure, HorizontalLine, Panel, Trace
from recoil_identification.report.figures import report_figures
from recoil_identification.report.html import render_page
from recoil_identification.report.tables import peaks
from recoil_rigs.issue import Issue, checked_issue
from tests.builders.virtual_shots import identified
from tests.identification.report.test_report_html import a_report

CHOSEN = ["psi", "lbf", "g", "in"]
PSI_PER_MPA, M_S2_PER_G, N_PER_LBF = 145.0377377, 9.80665, 4.4482216152605
"""NIST SP 811, appendix B.8."""


def chosen(*units: str) -> ChosenUnits:
    return ChosenUnits.of({"issued": Issue(units=tuple(units)).to_json()})


def test_every_figure_of_a_shot_is_in_the_units_that_were_chosen() -> None:
    plain = {one.key: one for one in report_figures(identified("mixed"))}
    other = {one.key: one for one in chosen(*CHOSEN).figures(report_figures(identified("mixed")))}
    assert list(other) == list(plain)
    factors = {"pressure": PSI_PER_MPA, "force": 1e3 / N_PER_LBF, "carriage": 1 / M_S2_PER_G}
    for key, factor in factors.items():
        for before, after in zip(plain[key].panels, other[key].panels, strict=True):
            for one, two in zip(before.traces, after.traces, strict=True):
                np.testing.assert_allclose(np.asarray(two.y), factor * np.asarray(one.y), rtol=1e-6)
                assert two.unit in CHOSEN
            assert after.y_label.endswith(after.traces[0].unit)
    # the mass is what is handed over: it stays in kg
    assert all(one.unit == "kg" for one in other["mass"].panels[0].traces)


def test_lines_bands_and_what_is_shown_go_along() -> None:
    band = Trace("a", [0.0, 1.0], [2.0, 4.0], "band", "bar", [1.0, 3.0], [3.0, 5.0])
    level = HorizontalLine("limit", 3.0, y_low=2.0, y_high=4.0)
    figure = Figure("k", "T", "C", "x", (Panel("p, bar", (band,), (level,), y_shown=(0.0, 10.0)),))
    (one,) = chosen("kPa").figures([figure])
    panel = one.panels[0]
    assert (panel.y_label, panel.y_shown) == ("p, kPa", (0.0, 1000.0))
    np.testing.assert_allclose(np.asarray(panel.traces[0].y_low), [100.0, 300.0])
    np.testing.assert_allclose(np.asarray(panel.traces[0].y_high), [300.0, 500.0])
    assert (panel.lines[0].y, panel.lines[0].y_low, panel.lines[0].y_high) == (300.0, 200.0, 400.0)


def test_peaks_have_as_many_digits_in_other_units() -> None:
    report = a_report(peaks={"breech_pressure_pa": 128.4e6, "recoil_travel_m": 0.8098})
    assert dict(peaks(report)) == {"peak breech pressure": "128.4 MPa", "recoil length": "809.8 mm"}
    other = dict(peaks(report | {"issued": {"units": CHOSEN}}))
    assert other["recoil length"] == "31.88 in"
    assert other["peak breech pressure"].startswith("1862")


def test_a_page_without_a_choice_is_in_si() -> None:
    assert "MPa" in render_page(a_report(), report_figures(identified("mixed"))[:1])


@pytest.mark.parametrize(
    ("units", "words"),
    [(["kg"], "must be units of"), (["degC"], "must be units of"), (["furlong"], "'furlong'"),
     (["bar", "psi"], "of pressure there are 'bar' and 'psi'")],
)  # fmt: skip
def test_a_unit_that_no_page_can_have_is_a_fault_of_the_rig(units: list[str], words: str) -> None:
    faults: list[Fault] = []
    checked_issue({"report": {"units": units}}, faults)
    assert len(faults) == 1
    assert words in str(faults[0])


def test_digits_of_numbers_alone_are_grouped() -> None:
    written = grouped("29560 to 1234567.8, SN 12345a, 00123456, 9999, 0.123456, s12345").replace(THIN, "_")
    assert written == "29_560 to 1_234_567.8, SN 12345a, 00123456, 9999, 0.123456, s12345"
