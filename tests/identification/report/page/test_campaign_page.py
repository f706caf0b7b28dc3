"""The page of a campaign: what it says, that nothing in it breaks out or reaches outside, and how large it gets."""

import datetime as dt
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.remark import Note, NoteCode
from recoil_identification.campaign.combination import combine
from recoil_identification.campaign.overlay import MOST_SINGLE, overlay
from recoil_identification.report.content.glossary import notation
from recoil_identification.report.document.campaign_document import campaign_document
from recoil_identification.report.document.report_files import CURVES_FILE, curves_text, read_curves, write_files
from recoil_identification.report.figure.campaign_figures import campaign_figures, group_name
from recoil_identification.report.page.html import CAMPAIGN_PAGE, render_campaign_page
from recoil_identification.report.page.page_files import write_page
from recoil_identification.shot.baseline import Baseline
from recoil_identification.shot.firing_record import CURVES, Curves
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from tests.builders.campaign_summaries import campaign_of
from tests.builders.page_elements import PageElements

HOSTILE = '</script><img src=x onerror=alert(1)>\u2028\'" onload="x%{y}{{7*7}}'
ALTERNATING = (0.0, 120.0) * 4


def shots_of(added=ALTERNATING, **planted):
    """Shots with all that a page shows of them."""
    rng = np.random.default_rng(1)
    return tuple(
        replace(
            shot,
            started=f"2026-03-02T08:{k % 60:02d}:00.000",
            calibration_day=CalibrationDay(dt.date(2026, 3, 2), DayOf.START),
            peaks={"breech_pressure_pa": 1.2e8 + k, "recoil_velocity_m_s": 8.125, "recoil_travel_m": 0.82},
            log={"charge": "full", "notes": "warm-up"} if k == 0 else {"charge": "full"},
            baseline=(Baseline("p", "breech_pressure", "4711", rng.standard_normal(), 50.0, "Pa", 0.0),),
            assumptions=({"quantity": "bore_area", "taken": "taken as exact", "detail": "nothing says otherwise"},),
        )
        for k, shot in enumerate(campaign_of(added, seed=4, **planted).shots)
    )


@pytest.mark.whole_way
def test_a_calibration_that_does_not_cover_the_day_of_a_shot_stands_in_the_head():
    texts = ("role", "quantity", "unit", "signal", "clock", "recorder", "model", "serial", "certificate", "range", "u")
    dates = {**dict.fromkeys(texts), "calibrated": "2026-01-15", "due": "2026-03-01", "channel": "p"}
    dates |= {"known_by": {}, "chain": {}, "clock": "dewetron"}
    shots = [replace(shot, channels=(dates,)) for shot in shots_of()]
    document, page = page_of(shots)
    said = "p: calibration was due 2026-03-01, 1 day before the shot of 2026-03-02"
    (told,) = (one for one in document["findings"] if one["code"] == "calibration" and one["about"] == "p")
    assert (told["severity"], told["text"]) == ("warn", said)
    assert f"A calibration does not cover the day of the shot: {said}." in PageElements(page).text
    for other in ({**dates, "due": "2026-03-02"}, {**dates, "due": "1"}, {**dates, "due": None}):
        document, _ = page_of([replace(shot, channels=(other,)) for shot in shots])
        assert not any(one["about"] == "p" and one["severity"] == "warn" for one in document["findings"])
    # a shot without a start is judged by the day of its ingest, and that is said
    ingested = CalibrationDay(dt.date(2026, 11, 28), DayOf.INGEST)
    document, page = page_of([replace(one, started=None, calibration_day=ingested) for one in shots])
    (told,) = (one["text"] for one in document["findings"] if one["code"] == "calibration" and one["about"] == "p")
    assert told == f"p: calibration was due 2026-03-01, 272 days before {ingested}"
    assert f"A calibration does not cover the day of the ingest: {told}" in PageElements(page).text


def curves_of(k):
    times_s = np.linspace(-0.01, 0.2 + 1e-4 * k, 300)
    return Curves(times_s, {name: np.sin(30 * times_s) + k for name in CURVES})


def page_of(shots, *, curves=None, pages=None, notes=()):
    campaign = combine(shots)
    campaign = replace(campaign, notes=(*campaign.notes, *notes))
    document = campaign_document(
        campaign,
        version="1.2.3",
        inputs=[{"file": f"{shot.name}/report.json", "sha256": "0123456789abcdef" * 4} for shot in shots],
        parameters={},
        pages=pages,
    )
    return document, render_campaign_page(document, campaign_figures(campaign, curves))


def drawn(page):
    return {figure["key"]: figure for figure in PageElements(page).carried("figures")}


def trace(figure, name):
    return next(one for one in figure["data"] if one["name"] == name)


@pytest.mark.whole_way
def test_the_page_says_the_mass_its_interval_and_that_nothing_changed():
    document, page = page_of(shots_of())
    text = PageElements(page).text
    low, high = document["mass"]["U95"]
    assert f"{document['mass']['value']:.1f} ± {(high - low) / 2:.1f}" in text
    assert f"{low:.1f} to {high:.1f} kg" in text
    for said in ("VALID", "8 shots", "Nothing changed among the shots.", "taken as exact: bore_area", "warm-up"):
        assert said in text
    assert "NOT VALID" not in text
    assert not re.search(r"\b(None|nan|null|Undefined)\b", text.replace('"cutoff_hz": null', ""))


@pytest.mark.whole_way
def test_a_mass_step_is_said_once_and_drawn():
    document, page = page_of(shots_of(step_kg={4: -6.0}))
    (change,) = [one for one in document["signals"] if one["kind"] == "mass step"]
    text = PageElements(page).text
    assert "NOT VALID" in text
    assert text.count(notation(change["detail"])) == 1
    assert "Nothing changed" not in text
    levels = trace(drawn(page)["mass"], "with what changed")["y"]
    # shots 1, 3, then 5, 7, and again with the added mass
    levels = levels[np.isfinite(levels)]
    np.testing.assert_allclose(levels[[2, 3, 6, 7]] - levels[[0, 1, 4, 5]], change["size"], rtol=0.02)


def test_where_two_shots_do_not_agree_nothing_is_said_to_be_as_it_was():
    first, second = shots_of((0.0, 120.0))
    document, page = page_of((first, replace(second, added_mass_kg=0.0)))
    assert not document["valid"]
    assert not document["signals"]
    text = PageElements(page).text
    assert "No change among the shots is found." in text
    assert "Nothing changed" not in text


@pytest.mark.whole_way
def test_a_drift_is_said_although_the_mass_is_valid():
    moved = {(k, "ln breech_pressure"): 0.02 * k / 7 for k in range(8)}
    document, page = page_of(shots_of(moved=moved))
    assert document["valid"]
    (change,) = [one for one in document["signals"] if one["kind"] == "sensor drift"]
    assert notation(change["detail"]) in PageElements(page).text


@pytest.mark.whole_way
def test_what_a_chart_fires_is_a_signal_and_a_ring_and_no_reason():
    shots = [
        replace(one, baseline=(replace(one.baseline[0], offset=100.0 * k + k % 2),)) for k, one in enumerate(shots_of())
    ]
    document, page = page_of(shots)
    before, _ = page_of(shots_of())
    assert document["valid"] is before["valid"] is True
    assert document["mass"] == before["mass"]
    charts = [one for one in document["signals"] if one["kind"] == "chart"]
    # the peaks of these shots rise, too
    assert {one["influence"] for one in charts} == {"p, sensor 4711", "peak breech pressure"}
    signals = [one for one in charts if one["influence"] == "p, sensor 4711"]
    (slope,) = [one for one in signals if one["rule"] == "trend"]
    assert (slope["unit"], slope["shots"]) == ("Pa", ["0001", "0008"])
    assert slope["size"] == pytest.approx(700.0, rel=0.05)
    text = PageElements(page).text
    assert all(notation(one["detail"]) in text for one in signals)
    assert "Nothing changed among the shots." in text
    sensor = drawn(page)["sensor-0"]
    rings = {shot for one in signals if one["rule"] != "trend" for shot in one["shots"]}
    assert set(trace(sensor, "fired")["text"]) == rings


def test_the_charts_of_the_document_are_those_of_the_shots():
    document, _ = page_of(shots_of())
    residual, *peaks, zero, noise = document["charts"]["series"]
    assert {one["quantity"] for one in peaks} == {"off the mean of shots fired alike"}
    assert residual["values"] == [one["normalised_residual"] for one in document["shots"]]
    assert zero["shots"] == [one["shot"] for one in document["shots"]]
    assert noise["values"] == pytest.approx([np.log(50.0)] * 8)
    assert document["charts"]["rules"].startswith("ISO 7870-2:2023")
    json.dumps(document, allow_nan=False)


def test_masses_are_grouped_by_what_was_added_and_stand_without_it():
    document, page = page_of(shots_of())
    mass = drawn(page)["mass"]
    assert mass["layout"]["xaxis"]["ticktext"] == ["0001", "0003", "0005", "0007", "0002", "0004", "0006", "0008"]
    labels = [one["label"]["text"] for one in mass["layout"]["shapes"] if one.get("label")]
    assert labels == ["as built", "120 kg added"]
    order = sorted(document["shots"], key=lambda one: (one["added_mass_kg"], one["shot"]))
    own = trace(mass, "without the sensors' errors, own scatter 95 %")
    expected = [one["own_mass_kg"] - one["added_mass_kg"] for one in order]
    np.testing.assert_allclose(own["y"], expected, rtol=1e-6)
    bars = [1.959964 * one["own_u_kg"] for one in order]
    np.testing.assert_allclose(own["error_y"]["array"], bars, rtol=1e-5)
    alone = trace(mass, "each shot by itself")
    np.testing.assert_allclose(alone["y"], [one["mass"]["value"] - one["added_mass_kg"] for one in order], rtol=1e-6)
    assert trace(mass, "common to all by themselves, 95 %")["y"].size == 1


def test_own_masses_scatter_about_the_joint_one_as_they_say():
    document, _ = page_of(shots_of((0.0, 120.0) * 20))
    off = [(one["own_mass_kg"] - one["joint_mass_kg"]) / one["own_u_kg"] for one in document["shots"]]
    assert np.std(off) == pytest.approx(1.0, abs=0.35)


@pytest.mark.whole_way
def test_a_shot_that_is_set_aside_is_listed_and_drawn_by_itself():
    shots = [replace(one, excluded="brake lost oil") if one.name == "0003" else one for one in shots_of()]
    _, page = page_of(shots)
    assert "set aside: excluded in the shot log: brake lost oil" in PageElements(page).text
    assert trace(drawn(page)["mass"], "set aside")["text"] == ["0003"]


@pytest.mark.whole_way
def test_shots_link_to_their_reports_by_relative_paths():
    _, page = page_of(shots_of(), pages={"0001": "reports/0001/report.html", "0002": "../other place/0002/report.html"})
    links = [a["href"] for tag, a in PageElements(page).elements if tag == "a" and "report.html" in a["href"]]
    assert links == ["./reports/0001/report.html", "./../other%20place/0002/report.html"]


@pytest.mark.whole_way
def test_the_page_refers_to_the_script_beside_it_and_to_nothing_else():
    shots = shots_of()
    curves = overlay((one.name, curves_of(k)) for k, one in enumerate(shots))
    _, page = page_of(shots, curves=curves)
    references = [
        value
        for _, attributes in PageElements(page).elements
        for name, value in attributes.items()
        if name in {"src", "href", "action", "data", "poster", "srcset", "background", "xlink:href"}
    ]
    assert [one for one in references if not one.startswith(("#", "./"))] == ["plotly.min.js"]
    assert "://" not in page
    assert not re.search(r"@import|url\(|@font-face|<link|<base|<iframe", page)
    assert "default-src 'none'" in page


@pytest.mark.whole_way
def test_hostile_names_neither_break_out_nor_get_lost():
    shots = tuple(
        replace(
            one,
            name=one.name + HOSTILE,
            rig=HOSTILE,
            configuration=HOSTILE,
            started=HOSTILE,
            excluded=HOSTILE if k == 7 else "",
            log={"charge": HOSTILE, "notes": HOSTILE, HOSTILE: HOSTILE},
            baseline=(replace(one.baseline[0], channel=HOSTILE, sensor=HOSTILE, unit=HOSTILE),),
            assumptions=({"quantity": HOSTILE, "taken": HOSTILE, "detail": HOSTILE},),
        )
        for k, one in enumerate(shots_of())
    )
    curves = overlay((one.name, curves_of(k)) for k, one in enumerate(shots))
    pages = {one.name: f"javascript:alert(1)//{HOSTILE}" for one in shots}
    _, page = page_of(shots, curves=curves, pages=pages, notes=(Note(NoteCode.ADDED_MASS, HOSTILE, HOSTILE),))
    parsed = PageElements(page)
    assert [tag for tag, _ in parsed.elements if tag in {"script", "img"}] == ["script"] * 3
    assert not [name for _, attributes in parsed.elements for name in attributes if name.startswith("on")]
    links = [a["href"] for _, a in parsed.elements if "href" in a]
    assert not [one for one in links if not one.startswith(("#", "./"))]
    assert parsed.text.count("{{7*7}}") >= 30
    texts = [text for figure in parsed.carried("figures") for one in figure["data"] for text in one.get("text", ())]
    assert texts
    assert not any("<" in text or "%{" in text for text in texts)
    for figure in parsed.carried("figures"):
        assert "<" not in json.dumps(figure["layout"])


def test_curves_come_back_from_their_file(tmp_path):
    curves = curves_of(3)
    lost = Curves(curves.times_s, {CURVES[0]: np.where(curves.times_s < 0, np.nan, 1.0)})
    write_files(tmp_path, {CURVES_FILE: curves_text(lost)})
    again = read_curves(tmp_path)
    np.testing.assert_allclose(again.times_s, lost.times_s, rtol=1e-5)
    assert list(again.values) == [CURVES[0]]
    np.testing.assert_array_equal(again.values[CURVES[0]], lost.values[CURVES[0]])
    assert read_curves(tmp_path / "elsewhere") is None


HEADER = "time_s,breech_pressure_pa,recoil_acceleration_m_s2,recoil_travel_m\n"


@pytest.mark.parametrize(
    "text", ["", "time_s\n1\n", HEADER + "0,1,2\n1,2,3\n", HEADER + "1,1,1,1\n0,1,1,1\n", HEADER + "a,1,1,1\n", HEADER]
)
def test_a_file_that_holds_no_curves_is_refused(tmp_path, text):
    (tmp_path / "curves.csv").write_text(text)
    with pytest.raises(ReadError, match=r"curves\.csv.*no curves of a shot"):
        read_curves(tmp_path)


@pytest.mark.whole_way
def test_each_of_a_few_shots_is_a_line_named_after_it_and_of_its_group():
    shots = shots_of()
    curves = overlay((one.name, curves_of(k)) for k, one in enumerate(shots[:6]))
    _, page = page_of(shots, curves=curves)
    figure = drawn(page)["curves"]
    assert len(figure["data"]) == 3 * 6
    assert [one["name"] for one in figure["data"] if one["showlegend"]] == ["as built", "120 kg added"]
    assert "<extra>shot 0002</extra>" in figure["data"][1]["hovertemplate"]
    np.testing.assert_allclose(figure["data"][5]["y"], 1e-6 * curves_of(5).values[CURVES[0]], atol=1e-10)
    assert "2 shots have no curves" in PageElements(page).text


def test_of_many_shots_all_lie_in_the_envelope_and_those_that_stand_out_are_lines():
    names = [f"{k:04d}" for k in range(200)]
    found = overlay(((name, curves_of(k)) for k, name in enumerate(names)), standing_out=["0123"])
    assert len(found.single) == MOST_SINGLE
    assert {"0000", "0123", "0199"} <= set(found.single)
    assert list(found.single) == sorted(found.single)
    envelope = found.envelopes[CURVES[2]]
    known = np.isfinite(envelope.median)
    middle = np.sin(30 * found.times_s[known])
    np.testing.assert_allclose(envelope.lowest[known][:-20], middle[:-20], atol=1e-3)
    np.testing.assert_allclose(envelope.highest[known][:-20], middle[:-20] + 199, atol=1e-3)
    np.testing.assert_allclose(envelope.median[known][:-20], middle[:-20] + 99.5, atol=1e-3)
    assert overlay(()) is None


@pytest.mark.parametrize(
    ("group", "name"),
    [
        (("", 0.0), "as built"), (("", 120.0), "120 kg added"), (("short", 0.0), "short"),
        (("short", -3.5), "short, 3.5 kg taken off"),
    ],
)  # fmt: skip
def test_groups_have_names(group, name):
    assert group_name(group) == name


@pytest.mark.whole_way
def test_the_page_of_a_thousand_shots_is_small_and_keeps_every_shot(tmp_path):
    shots = shots_of((0.0, 120.0) * 500)
    baseline = [replace(shots[0].baseline[0], channel=f"p{k}") for k in range(9)]
    rng = np.random.default_rng(3)
    shots = [
        replace(
            one, baseline=tuple(replace(b, offset=rng.standard_normal(), noise=rng.uniform(1, 2)) for b in baseline)
        )
        for one in shots
    ]
    curves = overlay((one.name, curves_of(k)) for k, one in enumerate(shots))
    _, page = page_of(shots, curves=curves, pages={one.name: f"reports/{one.name}/report.html" for one in shots})
    path = write_page(tmp_path, page, CAMPAIGN_PAGE)
    assert path.name == "campaign.html"
    assert path.stat().st_size < 3_000_000
    assert page.count('/report.html">') == 1000
    assert all(figure["height"] < 1000 for figure in drawn(page).values())
    assert len(drawn(page)["mass"]["layout"]["xaxis"]["ticktext"]) <= 24
