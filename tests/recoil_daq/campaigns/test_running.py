"""The running campaign of a range day says after each shot what `campaign` says of the shots so far."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from recoil_daq.campaigns.running import running_campaign
from recoil_daq.campaigns.sources import CUTOFF_FILE, CampaignReport, Outdated
from recoil_daq.reports.identify import identify_file
from recoil_identification.report.document.report_files import REPORT_FILE
from recoil_identification.shot.identified import Options
from tests.builders.campaigns import FiredCampaign, ring_campaign


@pytest.fixture
def day(tmp_path: Path) -> Path:
    """A range's folder with four shots, identified each by itself; the campaign of all is not begun."""
    fired, answer = ring_campaign().fired, ring_campaign().answer
    out = tmp_path / "out"
    shutil.copytree(fired.shots, out)
    shutil.copytree(answer / "reports", out / "reports")
    return out


def names(fired: FiredCampaign) -> tuple[str, ...]:
    return tuple(path.stem for path in fired.files)


@pytest.mark.whole_way
def test_it_is_the_campaign_of_the_shots_and_says_what_more_of_them_would_give(day: Path) -> None:
    fired, answer = ring_campaign().fired, ring_campaign().answer
    (day / "campaign").mkdir()
    shutil.copy(answer / CUTOFF_FILE, day / "campaign" / CUTOFF_FILE)
    found = running_campaign((day, names(fired)))
    document = json.loads((answer / "campaign.json").read_text())
    assert found is not None
    assert (found["value"], found["u"], found["U95"]) == tuple(document["mass"][key] for key in ("value", "u", "U95"))
    assert found["shots"] == list(names(fired))
    assert len(found["changes"]) == len(document["signals"])
    assert found["expected"]["shots"] == 8
    assert 0.3 * found["u"] < found["expected"]["u"] < 1.5 * found["u"]
    assert not (day / "campaign" / "reports").exists()  # all were found with its cut-off


@pytest.mark.whole_way
def test_shots_that_were_identified_each_by_itself_are_brought_to_one_cutoff_once(day: Path) -> None:
    fired = ring_campaign().fired
    one, other = fired.files[:2]
    for path in (one, other):
        identify_file(day / path.name, out=day / "reports", overwrite=True)
    assert running_campaign((day, (one.stem,))) is None
    first = running_campaign((day, (one.stem, other.stem)))
    made = {path: path.stat().st_mtime_ns for path in (day / "campaign" / "reports").glob(f"*/{REPORT_FILE}")}
    assert first is not None
    assert {path.parent.name for path in made} == {one.stem, other.stem}
    assert running_campaign((day, (one.stem, other.stem))) == first
    assert {path: path.stat().st_mtime_ns for path in made} == made


def test_a_shot_that_is_excluded_leaves_none_to_combine(day: Path) -> None:
    fired = ring_campaign().fired
    one, other = names(fired)[:2]
    text = (day / "shotlog.csv").read_text().splitlines()
    at = text[0].split(",").index("exclude")
    rows = [line.split(",") for line in text]
    rows[1][at] = "misfire"
    (day / "shotlog.csv").write_text("\n".join(",".join(row) for row in rows) + "\n")
    (day / "campaign").mkdir()
    shutil.copy(ring_campaign().answer / CUTOFF_FILE, day / "campaign" / CUTOFF_FILE)
    assert running_campaign((day, (one, other))) is None


@pytest.mark.whole_way
def test_a_report_of_thinned_channels_is_taken_by_no_campaign(stored: Path, tmp_path: Path) -> None:
    folder = identify_file(stored, out=tmp_path, options=Options(thin=True)).folder
    report = CampaignReport.read(folder / REPORT_FILE)
    why = report.why_not(report.of_sha256, None)
    assert why is not None
    assert why.code is Outdated.THINNED
