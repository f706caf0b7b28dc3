"""Units by choice, and groups of digits: the same figures and peaks in what a reader knows, documents in SI."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.errors import Fault
from recoil_acquisition.measured import beside, measured, worded
from recoil_acquisition.quantities.declaration import declared
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode, findings_of
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_identification.campaign.combination import combine
from recoil_identification.estimate.rounding import MINUS, THIN, fixed, grouped
from recoil_identification.report.content.chosen_units import ChosenUnits
from recoil_identification.report.content.section import parts_of
from recoil_identification.report.content.tables import peak_rows, peaks
from recoil_identification.report.document.campaign_document import campaign_document
from recoil_identification.report.figure.figure import Figure, HorizontalLine, Panel, Trace
from recoil_identification.report.figure.figures import report_figures
from recoil_identification.report.page.html import render_page
from recoil_identification.report.sections import sections_of
from recoil_rigs.tables.issue import Issue
from tests.builders.campaign_summaries import campaign_of
from tests.builders.virtual_shots import identified
from tests.identification.report.page.test_report_html import a_report

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


def test_a_peak_with_its_uncertainty_is_rounded_to_it_in_every_unit() -> None:
    report = a_report(
        peaks={"breech_pressure_pa": 128.43e6, "impulse_n_s": 7604.0},
        peaks_u={"breech_pressure_pa": 0.5e6, "impulse_n_s": None},
        peaks_U95={"breech_pressure_pa": [127.45e6, 129.41e6], "impulse_n_s": None},
        peaks_ruled_by={"breech_pressure_pa": "breech_pressure dynamic scale", "impulse_n_s": None},
    )
    assert dict(peaks(report)) == {
        "peak breech pressure": "128.43 ± 0.98 MPa", "impulse of the driving force": "7.60 kN s",
    }  # fmt: skip
    (row,) = peak_rows(report)
    assert row == {
        "quantity": "peak breech pressure", "value": "128.43", "u": "0.50", "interval": "127.45 to 129.41",
        "unit": "MPa", "ruled_by": "breech_pressure dynamic scale",
    }  # fmt: skip
    other = dict(peaks(report | {"issued": {"units": ["bar"]}}))
    assert other["peak breech pressure"] == "1284.3 ± 9.8 bar"


def test_a_page_without_a_choice_is_in_si() -> None:
    assert "MPa" in render_page(a_report(), report_figures(identified("mixed"))[:1])


@pytest.mark.parametrize(
    ("units", "words"),
    [(["kg"], "must be units of"), (["degC"], "must be units of"), (["furlong"], "'furlong'"),
     (["bar", "psi"], "of pressure there are 'bar' and 'psi'")],
)  # fmt: skip
def test_a_unit_that_no_page_can_have_is_a_fault_of_the_rig(units: list[str], words: str) -> None:
    faults: list[Fault] = []
    declared(Issue, {"units": units}, ("report",), faults)
    assert len(faults) == 1
    assert words in str(faults[0])


def test_digits_of_numbers_alone_are_grouped() -> None:
    written = grouped("29560 to 1234567.8, SN 12345a, 00123456, 9999, 0.123456, s12345").replace(THIN, "_")
    assert written == "29_560 to 1_234_567.8, SN 12345a, 00123456, 9999, 0.123456, s12345"


@pytest.mark.parametrize(
    ("pieces", "units", "again"),
    [
        (("the force peaks at ", measured(1290.4, "kN", ".1f"), "."), ["lbf"], "the force peaks at 290090 lbf."),
        ((measured(0.3, "MPa", ".2f", unit_follows=True), " to ", measured(0.5, "MPa", ".2f"), ", 12 N s"),
         ["bar", "lbf"], "3.0 to 5.0 bar, 12 N s"),
        (("declared ", measured(1500, "N", ".0f"), " (u ", measured(150, "N", ".0f"), ")"), ["lbf"],
         "declared 337.2 lbf (u 33.7 lbf)"),
        (("by ", measured(-0.5, "m/s^2", lambda found: fixed(found, 2)), ", ", measured(3.1, "m/s", "+.2g")), ["g"],
         f"by {MINUS}0.051 g, +3.1 m/s"),
        (("rises by ", measured(12.5, "kN m", ".3g"), ", ", measured(math.nan, "MPa", ".3g")), ["lbf", "bar"],
         "rises by 12.5 kN m, nan MPa"),
        (("peak ", measured(128.4, "MPa", ".4g")), [], "peak 128.4 MPa"),
    ],
)  # fmt: skip
def test_the_figures_of_a_sentence_go_along_with_as_many_digits(
    pieces: tuple[str, ...], units: list[str], again: str
) -> None:
    assert chosen(*units).text(worded(*pieces)) == again


@pytest.mark.parametrize(
    "text",
    ["gauge Kistler 6215 (600 MPa) is off", "'AI 1 m'", "file 'shot 3 m.csv'", "10 000 Pa", "p_brake 20 MPa", "1 N"],
)
def test_what_looks_like_a_figure_in_a_name_is_none(text: str) -> None:
    assert chosen("bar", "mm", "lbf").text(text) == text


NUMBERS = st.floats(-1e6, 1e6).map(lambda number: f"{number:.4g}")
NAMES = st.builds(
    lambda *parts: "".join(parts),
    st.text(max_size=8), NUMBERS, st.sampled_from([" ", ""]), st.sampled_from(["MPa", "kN", "m", "m/s^2", "bar"]),
    st.text(max_size=8),
)  # fmt: skip


@given(st.lists(st.tuples(NAMES, st.floats(0.1, 1e4)), min_size=1, max_size=4))
def test_a_name_with_a_number_and_a_unit_stays_beside_figures_that_change(said: list[tuple[str, float]]) -> None:
    """The same through a document: a remark's figures go by their places, whatever stands between them."""
    pieces, others = list[str](), list[str]()
    for name, value in said:
        figure = measured(value, "MPa", ".3e")
        pieces += [name, figure]
        others += [name, chosen("psi").text(figure)]
    told = Note(NoteCode.READER, "p", worded(*pieces)).to_json()
    read = json.loads(json.dumps({"issued": {"units": ["psi"]}, "findings": [told]}))
    again = ChosenUnits.of(read).text(read["findings"][0]["text"])
    assert again == "".join(others)
    assert again != read["findings"][0]["text"]


@pytest.mark.parametrize(
    "figures",
    ["MPa", {"a": 1}, [1], [{"value": 1.0, "unit": "MPa", "at": [0]}], [{"value": 1.0, "unit": "MPa", "at": [3, 99]}],
     [{"value": 1.0, "unit": "MPa", "at": [-3, 4]}], [{"value": "1", "unit": "MPa", "at": [0, 5]}],
     [{"value": 1.0, "unit": "MPa", "at": [0, 5]}, {"value": 1.0, "unit": "MPa", "at": [3, 5]}],
     [{"value": 10**400, "unit": "MPa", "at": [0, 5]}], [{"value": math.nan, "unit": "MPa", "at": [0, 5]}]],
)  # fmt: skip
def test_places_that_cannot_be_leave_a_text_as_it_is(figures: object) -> None:
    document = {"issued": {"units": ["psi"]}, "findings": [{"text": "1 MPa", "figures": figures}]}
    assert ChosenUnits.of(document).text("1 MPa") == "1 MPa"


def test_columns_of_one_unit_go_along_and_what_is_stated_of_a_sensor_stays() -> None:
    table = {"title": "T", "caption": "of 2 kN", "columns": ["cause", "peak, N"], "rows": [["noise of 10 N", "4450"]]}
    channel = {
        "channel": "p", "role": None, "model": "m", "serial": "s", "certificate": None, "calibrated": None, "due": None,
        "range": [-1.0, 25.0], "unit": "MPa", "u": 0.01, "chain": {"load": "of 10 MPa"}, "known_by": {}, "clock": "c",
    }  # fmt: skip
    document = {
        "target": "t", "quantities": [], "tables": [table], "channels": [channel], "provenance": {},
        "issued": {"units": ["lbf", "bar"]},
    }  # fmt: skip
    parts = {part.section.key: part for part in parts_of(sections_of(document), document, ())}
    of_table, sensors = parts["table-0"], parts["channels"]
    assert of_table.caption == "of 2 kN"
    assert [one.head for one in of_table.columns] == ["cause", "peak, lbf"]
    assert dict(of_table.rows[0]) == {"0": "noise of 10 N", "1": "1000"}
    assert sensors.rows[0]["range"] == f"{MINUS}1 to 25 MPa"
    assert "10 MPa" in sensors.rows[0]["chain"]


def test_peaks_of_a_campaigns_shots_go_along() -> None:
    campaign = combine(campaign_of((0.0, 120.0) * 2, seed=4).shots)
    document = campaign_document(
        campaign, version="1", inputs=[], parameters={}, issued=Issue(units=("psi", "in"))
    )  # fmt: skip
    document["shots"][0]["peaks"] = {"breech_pressure_pa": 128.4e6, "recoil_travel_m": 0.8098}
    (shots,) = (one for one in parts_of(sections_of(document), document, ()) if one.section.key == "shots")
    heads = {one.key: one.heading for one in shots.columns}
    assert (heads["breech_pressure_pa"], heads["recoil_travel_m"]) == ("Breech / psi", "Travel / in")
    assert float(shots.rows[0]["breech_pressure_pa"]) == pytest.approx(128.4 * PSI_PER_MPA, rel=1e-3)
    assert shots.rows[0]["recoil_travel_m"] == "31.88"
    assert "Mass / kg" in heads.values()


def test_a_page_words_figures_anew_and_keeps_the_names_beside_them() -> None:
    name, length = "p_brake 20 MPa", "AI 1 m"
    noise = QualityCheck(name, Check.BASELINE, "warn", worded("noise ", measured(0.5, "MPa", ".2f"), " as ", length))
    lost = Reason(ReasonCode.CHECK, name, worded(f"quality: {name}: rests at ", measured(-3.0, "MPa", "+.1f")))
    travel = worded(f"{length} moves by ", measured(0.12, "mm", ".2f"))
    taken = {"quantity": name, "taken": str(travel), "detail": "", **beside(travel)}
    report = a_report(
        reasons=[str(lost)], findings=findings_of([lost]), quality=[noise.to_json()], assumptions=[taken], valid=False
    )
    page = render_page(report | {"issued": {"units": ["bar", "in"]}}, ())
    for words in (
        f"quality: {name}: rests at {MINUS}30 bar",
        f"noise 5.0 bar as {length}",
        f"{length} moves by 0.0047 in",
    ):
        assert words.replace(MINUS, "-") in page.replace(MINUS, "-"), words
    assert "200 bar" not in page
    in_si = render_page(report, ())
    for words in (str(lost), noise.detail, str(travel)):
        assert words in in_si.replace(MINUS, "-"), words
