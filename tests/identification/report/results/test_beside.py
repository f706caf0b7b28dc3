"""Reports laid beside one another: what is said to differ, and the page."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from recoil_identification.report.figure.appearance import dash_of
from recoil_identification.report.page.html import render_results_page
from recoil_identification.report.results.beside import Laid, beside_document, beside_figures, of_what
from recoil_identification.shot.firing_record import CURVES, Curves
from tests.builders.page_elements import PageElements

TIMES_S = np.linspace(0.1, 0.3, 50)
REPORT: dict[str, Any] = {
    "shot": "0001",
    "rig": "mixed",
    "started": None,
    "shot_log": None,
    "corrections": [],
    "mass": {"value": 782.55, "u": 2.65, "U95": [777.4, 787.7], "specification": 782.0, "method": "calibrated"},
    "rpe_percent": {"value": 0.307, "U95": [0.29, 0.71]},
    "E_n": 0.1,
    "interval_s": [0.1, 0.3],
    "window_s": 0.02,
    "identified_share": 0.999,
    "filter": {"cutoff_hz": 400.0, "half_order": 4, "basis": "shot", "mass_cutoff_hz": 283.0},
    "peaks": {"recoil_travel_m": 0.816},
    "valid": True,
    "reasons": [],
    "provenance": {
        "version": "0.1.0",
        "computer": {"system": "Linux", "numpy": "2.0.0"},
        "inputs": [{"file": "0001.h5", "sha256": "ab" * 32}],
    },
}


def laid(name: str, document: dict[str, Any] | None = None, **more: Any) -> Laid:
    curves = Curves(TIMES_S - 0.1, {curve: np.sin(TIMES_S) for curve in CURVES})
    mass = np.column_stack([TIMES_S, np.full(50, 780.0), np.full(50, 2.0)])
    mass[:3, 1:] = np.nan
    return Laid(name, copy.deepcopy(REPORT) if document is None else document, "cd" * 32, mass, curves, **more)


def another(**changes: Any) -> dict[str, Any]:
    document = copy.deepcopy(REPORT)
    for key, value in changes.items():
        document[key] = {**document[key], **value} if isinstance(value, dict) else value
    return document


def differing(*of: Laid) -> dict[str, list[str]]:
    document = beside_document(of, version="0.1.0")
    return {row["label"]: row["texts"] for key in ("results", "parameters") for row in document[key] if row["differs"]}


def test_reports_that_are_equal_differ_in_nothing() -> None:
    assert differing(laid("a"), laid("b")) == {}


def test_what_another_computer_rounds_otherwise_does_not_differ() -> None:
    rounded = {"value": 782.55 * (1 + 1e-12), "U95": [777.4, 787.7 * (1 - 1e-12)]}
    assert differing(laid("a"), laid("b", another(mass=rounded))) == {}


def test_what_differs_is_listed_with_the_digits_that_its_uncertainty_justifies() -> None:
    document = another(
        mass={"value": 777.7241, "u": 5.44, "U95": [767.05, 788.39], "method": "reverse"},
        filter={"cutoff_hz": 300.0, "basis": "given"}, window_s=0.01, valid=False, reasons=["too short"],
        corrections=[{"key": "mechanism.friction", "was": 1500.0, "is": 1600.0}],
    )  # fmt: skip
    assert differing(laid("a"), laid("b", document)) == {
        "verdict": ["valid", "not valid"],
        "reasons": ["none", "too short"],
        "mass / kg": ["782.5", "777.7"],
        "mass, from that of the first / kg": ["", "−4.83"],
        "u / kg": ["2.6", "5.4"],
        "95 % interval / kg": ["777.4 … 787.7", "767 … 788"],
        "corrected in the rig": ["nothing", "mechanism.friction 1500.0 -> 1600.0"],
        "method": ["calibrated", "reverse"],
        "low-pass / Hz": ["400", "300"],
        "chosen by": ["shot", "given"],
        "memory (window) / ms": ["20", "10"],
    }


def test_what_differs_below_the_digits_that_are_printed_is_printed_with_all_of_them() -> None:
    rows = differing(laid("a"), laid("b", another(window_s=0.0200001)))
    assert rows["memory (window) / ms"] == ["20", "20.0001"]


def test_peaks_bear_the_names_and_units_of_a_reports_head() -> None:
    peaks = {"breech_pressure_pa": 128.3e6, "recoil_travel_m": 0.8162, "of_another_version": 1.0}
    rows = differing(laid("a"), laid("b", another(peaks=peaks)))
    assert rows["peak breech pressure / MPa"] == ["–", "128.3"]
    assert rows["recoil length / mm"] == ["816", "816.2"]
    assert rows["peak: of_another_version"] == ["–", "1"]


@pytest.mark.parametrize(
    ("document", "words"),
    [
        (another(), "These reports are of one shot file, 0001"),
        (another(provenance={"inputs": [{"sha256": "ef" * 32}]}), "of shot 0001, but of different shot files"),
        (another(shot="0002"), "These reports are of different shots, 0001, 0002: "),
        (another(shot="0002", rig="other"), "different shots, 0001, 0002, on the rigs mixed, other: "),
    ],
)  # fmt: skip
def test_it_is_said_plainly_whether_the_reports_are_of_one_shot(document: dict[str, Any], words: str) -> None:
    assert words in of_what([REPORT, document])


def test_the_curves_lie_over_one_another_from_the_onset_on_each_report_in_one_colour() -> None:
    later = another(interval_s=[1.1, 1.3])
    other = laid("b", later)
    other = replace(other, trace=np.column_stack([TIMES_S + 1.0, *other.trace.T[1:]]))
    mass, curves = beside_figures([laid("a"), other])
    one, two = mass.panels[0].traces
    np.testing.assert_allclose(one.x, two.x, atol=1e-9)
    assert np.asarray(one.x)[0] == pytest.approx(0.0)
    assert [trace.hue for panel in (*mass.panels, *curves.panels) for trace in panel.traces] == [0, 1] * 4
    np.testing.assert_allclose(np.asarray(one.y_high)[3:] - 780.0, 1.96 * 2.0, rtol=1e-4)
    assert dash_of(one, 0) != dash_of(two, 0)


def test_what_a_poor_method_swings_to_does_not_flatten_the_masses_of_the_others() -> None:
    swinging = laid("b")
    trace = np.array(swinging.trace)
    trace[20:30, 1] = 60.0
    mass, _ = beside_figures([laid("a"), replace(swinging, trace=trace)])
    shown = mass.panels[0].y_shown
    assert shown is not None
    assert 700.0 < shown[0] < 777.4 < 787.7 < shown[1] < 850.0


def test_a_report_without_curves_is_in_the_tables_all_the_same() -> None:
    bare = replace(laid("b", another(window_s=0.01)), trace=None, curves=None)
    assert [len(panel.traces) for figure in beside_figures([laid("a"), bare]) for panel in figure.panels] == [1] * 4
    assert beside_figures([bare]) == []
    page = PageElements(render_results_page(beside_document([bare, bare], version="0.1.0"), []))
    assert "Nothing differs." in page.text


def test_the_page_shows_what_differs_and_folds_what_is_equal() -> None:
    both = [
        laid("new/0001", page="report.html"),
        laid("<i>old</i>/0001", another(window_s=0.01), page="../o d/report.html"),
    ]
    page = render_results_page(beside_document(both, version="0.1.0"), beside_figures(both))
    assert "<i>old" not in page.partition("<script")[0]
    assert 'href="../o%20d/report.html"' in page
    differs, _, equal = page.partition('id="parameters"')[2].partition("<details>")
    assert "memory (window)" in PageElements(differs).text
    assert "low-pass of the fit" not in PageElements(differs).text
    assert "low-pass of the fit" in PageElements(equal).text
