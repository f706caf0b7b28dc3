"""What a campaign of reports writes, and where its page points."""

import json

import numpy as np
import pytest

from recoil_acquisition.errors import ReadError, StoreError
from recoil_daq.campaigns.campaign import campaign
from recoil_identification.report.document.report_files import CURVES_FILE, curves_text, sealed, write_files
from recoil_identification.shot.firing_record import CURVES, Curves
from tests.builders.campaign_reports import write_report
from tests.builders.campaign_summaries import campaign_of

FILES = ["campaign.csv", "campaign.html", "campaign.json", "plotly.min.js"]


@pytest.fixture
def reports(tmp_path):
    """Reports of four shots, two of them with a page and curves beside them."""
    times_s = np.linspace(-0.01, 0.2, 300)
    for k, shot in enumerate(campaign_of((0.0, 120.0) * 2, seed=4).shots):
        folder = tmp_path / "my reports" / shot.name
        said = {"valid": False, "reasons": ["the breech gauge reads high"]} if k == 2 else {}
        write_report(folder.parent, shot, **said)
        if k < 2:
            (folder / "report.html").write_text("a page")
            write_files(folder, {CURVES_FILE: curves_text(Curves(times_s, {name: np.sin(times_s) for name in CURVES}))})
    return tmp_path / "my reports"


@pytest.mark.whole_way
def test_a_campaign_has_a_page_that_leads_to_the_shots_pages(reports, tmp_path):
    done = campaign(reports, out=tmp_path / "answer")
    assert sorted(one.name for one in done.folder.iterdir()) == FILES
    page = (done.folder / "campaign.html").read_text(encoding="utf-8")
    assert '<a href="./../my%20reports/0001/report.html">0001</a>' in page
    assert page.count("report.html") == 2
    assert [one["report"] for one in done.document["shots"][1:3]] == ["../my reports/0002/report.html", None]
    assert (done.folder / done.document["shots"][1]["report"]).exists()
    assert "2 shots have no curves" in page


@pytest.mark.whole_way
def test_the_specification_and_each_shots_own_verdict_stand_beside_the_mass(reports, tmp_path, run):
    result = run("campaign", reports, "--out", tmp_path / "answer")
    document = json.loads((tmp_path / "answer" / "campaign.json").read_text(encoding="utf-8"))
    mass, output = document["mass"], " ".join(result.output.split())
    assert mass["specification"] == 900.0
    deviation = f"deviation {mass['deviation_kg']:+.2f} kg, {mass['deviation_percent']:+.2f} %, E_n {mass['E_n']:+.2f}"
    assert f"specification 900 kg, nothing added: {deviation} with k = 2" in output
    assert "shot 0003 is not valid by itself (the breech gauge reads high); used: what speaks against it" in output
    page = (tmp_path / "answer" / "campaign.html").read_text(encoding="utf-8")
    head = page[: page.index("</section>")]
    for text in (
        f"<b>{'+' if mass['E_n'] > 0 else chr(0x2212)}{abs(mass['E_n']):.2f}</b>",
        "<b>900 kg</b>",
    ):
        assert text in head
    assert f"1.96 of the interval, U = {mass['U_kg']:.2f}" in page
    assert page.count(">not valid</span>") == 1
    assert page.count(">valid</span>") == 3


@pytest.mark.whole_way
def test_a_page_that_is_there_is_not_overwritten_unasked(reports, tmp_path):
    (tmp_path / "answer").mkdir()
    (tmp_path / "answer" / "campaign.html").write_text("mine")
    with pytest.raises(StoreError, match=r"campaign\.html.*exists already"):
        campaign(reports, out=tmp_path / "answer")
    assert (tmp_path / "answer" / "campaign.html").read_text() == "mine"
    done = campaign(reports, out=tmp_path / "answer", overwrite=True, standalone=True)
    page = (tmp_path / "answer" / "campaign.html").read_text(encoding="utf-8")
    assert "Campaign" in page
    assert 'src="plotly' not in page
    assert sorted(one.name for one in done.folder.iterdir()) == FILES[:-1]


@pytest.mark.whole_way
def test_curves_that_are_none_are_named_and_nothing_is_written(reports, tmp_path):
    (reports / "0002" / "curves.csv").write_text("nonsense\n")
    with pytest.raises(ReadError, match=r"0002.curves\.csv.*no curves of a shot"):
        campaign(reports, out=tmp_path / "answer")
    assert not (tmp_path / "answer").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda one: one["campaign"]["reference"].__setitem__(0, one["campaign"]["reference"][0] + 0.02),
            "was changed",
        ),
        (lambda one: one["mass"].update(value=1.05 * one["mass"]["value"]), "was changed after it was written"),
        (lambda one: one["provenance"].pop("digest"), "has no digest of its content"),
    ],
)
def test_a_report_that_is_not_what_was_written_is_refused(reports, tmp_path, change, said):
    path = reports / "0002" / "report.json"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(ReadError, match=f"this report {said}.*its shot file is not given") as raised:
        campaign(reports, out=tmp_path / "answer")
    assert raised.value.path == path
    assert not (tmp_path / "answer").exists()


def test_a_mass_that_is_not_the_one_of_its_summary_is_refused(reports, tmp_path):
    path = reports / "0002" / "report.json"
    document = json.loads(path.read_text())
    document["mass"] |= {"method": "calibrated", "value": 1.05 * document["mass"]["value"]}
    path.write_text(json.dumps(sealed(document)))
    with pytest.raises(ReadError, match=r"this report cannot be combined; found a mass of .* its summary says"):
        campaign(reports, out=tmp_path / "answer")


def test_curves_that_were_changed_are_refused(reports, tmp_path):
    path = reports / "0002" / "report.json"
    document = json.loads(path.read_text())
    document["provenance"]["outputs"] = [{"file": CURVES_FILE, "sha256": "0" * 64}]
    path.write_text(json.dumps(sealed(document)))
    with pytest.raises(ReadError, match=r"0002.curves\.csv: was changed after it was written"):
        campaign(reports, out=tmp_path / "answer")
    assert not (tmp_path / "answer").exists()
