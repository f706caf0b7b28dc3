"""Shot files or their reports to one answer, by the command."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from recoil_daq.campaigns.campaign import campaign
from recoil_daq.demo import run_campaign_demo
from recoil_rigs.rig import find_rig
from tests.builders.campaigns import FiredCampaign, ring_campaign
from tests.builders.virtual_shots import SHORTER, with_twin


@pytest.fixture(scope="module")
def fired() -> FiredCampaign:
    return ring_campaign().fired


@pytest.fixture(scope="module")
def answered() -> Path:
    return ring_campaign().answer


@pytest.fixture
def reports(answered: Path, tmp_path: Path) -> Path:
    """The campaign's reports, to be changed."""
    return Path(shutil.copytree(answered / "reports", tmp_path / "reports"))


def document_in(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "campaign.json").read_text()))


@pytest.mark.indispensable("campaign")
def test_the_answer_is_the_mass_without_what_was_added(fired: FiredCampaign, answered: Path) -> None:
    document = document_in(answered)
    assert document["schema"] == "recoil-daq/campaign/1"
    mass = document["mass"]
    truth = fired.truths[0]["m3"]
    assert abs(mass["value"] - truth) < 3 * mass["u"]
    assert mass["u"] < 0.004 * truth
    assert [one["added_mass_kg"] for one in document["shots"]] == [0.0, 120.0, 0.0, 120.0]
    assert {one["influence"] for one in document["common"]} >= {"packing friction", "release from the battery stop"}
    assert document["valid"] == (document["reasons"] == [])
    assert any(one["file"] == "shotlog.csv" for one in document["provenance"]["inputs"])


@pytest.mark.whole_way
def test_reports_alone_give_the_same_mass_and_no_shot_is_identified_again(
    run, answered: Path, reports: Path, tmp_path
) -> None:
    result = run("campaign", reports, "--out", tmp_path / "again", "--json")
    assert result.exit_code == 0, result.output
    again = json.loads(result.stdout)
    assert again["mass"] == document_in(answered)["mass"]
    assert not (tmp_path / "again" / "reports").exists()


@pytest.mark.whole_way
def test_an_answer_is_not_overwritten_unless_asked_and_keeps_its_cutoff(
    run, fired: FiredCampaign, answered: Path, tmp_path
) -> None:
    out = Path(shutil.copytree(answered, tmp_path / "campaign"))
    before = (out / "campaign.json").read_bytes()
    refused = run("campaign", fired.shots, "--out", out)
    assert refused.exit_code == 3
    assert "exists already" in refused.stderr
    assert (out / "campaign.json").read_bytes() == before
    done = run("campaign", fired.shots, "--out", out, "--overwrite")
    assert done.exit_code == 0
    assert (out / "campaign.json").read_bytes() == before


@pytest.mark.whole_way
def test_what_the_log_says_now_counts_and_not_what_it_said(run, reports: Path, tmp_path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("shot;added_mass_kg;exclude;configuration\n0001;0;wet powder;\n0002;120,5;;\n0003;;;\n0009;;;\n")
    result = run("campaign", reports, "--log", log, "--out", tmp_path / "other", "--json")
    document = json.loads(result.stdout)
    by_name = {one["shot"]: one for one in document["shots"]}
    assert by_name["0001"]["excluded"] == "excluded in the shot log: wet powder"
    assert by_name["0002"]["added_mass_kg"] == 120.5
    assert by_name["0004"]["added_mass_kg"] == 0.0  # no row: nothing was added
    assert any("shot 0009 is in the shot log, but there is no such shot" in note for note in document["notes"])
    # 120 kg that the log does not know are noticed
    (signal,) = document["signals"]
    assert (signal["kind"], signal["influence"], signal["shots"]) == ("outlier", "mass", ["0004"])
    assert abs(signal["size"] - 120.0) < 4 * signal["u"]


@pytest.mark.whole_way
def test_a_report_of_another_shot_file_is_not_taken(
    fired: FiredCampaign, answered: Path, reports: Path, tmp_path
) -> None:
    document = json.loads((reports / "0003" / "report.json").read_text())
    document["provenance"]["inputs"][0]["sha256"] = "0" * 64
    (reports / "0003" / "report.json").write_text(json.dumps(document))
    done = campaign(fired.shots, reports=reports, out=tmp_path / "out")
    assert any(
        "0003" in note and "is of another shot file: the shot was identified anew" in note
        for note in done.document["notes"]
    )
    assert [one.name for one in (tmp_path / "out" / "reports").iterdir() if one.is_dir()] == ["0003"]
    assert done.mass_kg == pytest.approx(document_in(answered)["mass"]["value"], rel=1e-12)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "this is no report of a shot"),
        ('{"schema": "recoil-daq/campaign/1"}', "this is no report of a shot"),
        ("[" * 100_000, "this is no report of a shot"),
        ('{"schema": "recoil-daq/report/1", "mass": {"value": 1}, "mass": {"value": 2}}', "the key 'mass' twice"),
        ('{"schema": "recoil-daq/report/1", "provenance": []}', "no report of a shot"),
        ('{"schema": "recoil-daq/report/1", "provenance": {"inputs": 3, "version": null}}', "no report of a shot"),
    ],
)
def test_a_file_that_is_no_report_is_refused_in_one_line(run, tmp_path, content: str, said: str) -> None:
    path = tmp_path / "report.json"
    path.write_text(content)
    result = run("campaign", path, "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert said in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_what_cannot_be_combined_is_refused_in_one_line_and_leaves_nothing(
    run, fired: FiredCampaign, reports: Path, tmp_path
) -> None:
    (tmp_path / "empty").mkdir()
    for arguments, said in (
        ((tmp_path / "empty",), "neither shot files nor reports in this folder"),
        ((tmp_path / "nothing",), "no such file"),
        ((reports / "0001",), "at least two shots"),
        ((sorted(fired.shots.glob("*.h5"))[0],), "at least two shots"),
        ((reports, "--log", tmp_path / "none.csv"), "no such file"),
        ((reports, "--cutoff-hz", "77"), "its shot file is not given"),
    ):
        result = run("campaign", *arguments, "--out", tmp_path / "out")
        assert result.exit_code == 3, arguments
        assert said in result.stderr
        assert not (tmp_path / "out").exists()


@pytest.mark.whole_way
def test_frames_and_figures_are_at_hand_in_python(reports: Path, tmp_path) -> None:
    done = campaign([reports], out=tmp_path / "out")
    assert repr(done).startswith("Combined(")
    assert done.valid == (done.reasons == ())
    low, high = done.interval_kg
    assert low < done.mass_kg < high
    assert list(done.shots["shot"]) == ["0001", "0002", "0003", "0004"]
    assert set(done.common["influence"]) == {one["influence"] for one in done.document["common"]}
    assert "from 4 of 4 shots" in str(done)


@pytest.mark.whole_way
def test_a_campaign_is_demonstrated_beside_the_truth(run, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recoil_daq.demo.CAMPAIGN_DEMO_SHOTS", 2)
    # the bundled rig in shorter records
    shutil.copy(find_rig("mixed").parent / "mixed.dbc", tmp_path)
    (tmp_path / "rig.toml").write_text(with_twin("mixed", **SHORTER | {"duration_s": 0.45}).text, encoding="utf-8")
    monkeypatch.setattr("recoil_daq.demo.DEMO_RIG", str(tmp_path / "rig.toml"))
    result = run("demo", "--campaign", "--out", tmp_path, "--json")
    document = json.loads(result.stdout)
    assert abs(document["truth"]["error_percent"]) < 1.0
    assert document["campaign"]["mass"]["value"] == pytest.approx(document["truth"]["mass_kg"], rel=0.01)
    assert [one["added_mass_kg"] for one in document["campaign"]["shots"]] == [0.0, 310.0]
    again = run("demo", "--campaign", "--out", tmp_path)
    assert again.exit_code == 3
    assert "an earlier campaign is here" in again.stderr
    notes = tmp_path / "campaign" / "shots" / "notes.txt"
    notes.write_text("mine")
    refused = run("demo", "--campaign", "--out", tmp_path, "--overwrite")
    assert refused.exit_code == 3
    assert f"{notes}: this is of no demonstration" in refused.stderr
    assert (tmp_path / "campaign" / "answer" / "campaign.json").exists()
    notes.unlink()
    monkeypatch.setattr("recoil_daq.demo.CAMPAIGN_DEMO_SHOTS", 0)
    with pytest.raises(ValueError, match="shots must be at least 1"):
        run_campaign_demo(tmp_path, overwrite=True)
    assert not (tmp_path / "campaign").exists()


@pytest.mark.whole_way
def test_a_folder_that_no_demonstration_made_is_not_removed(run, stored: Path, tmp_path: Path) -> None:
    (tmp_path / "live").mkdir()
    shot = Path(shutil.copy(stored, tmp_path / "live" / "0001.h5"))
    refused = run("demo", "--live", "--no-screen", "--out", tmp_path, "--overwrite")
    assert refused.exit_code == 3
    assert f"{shot}: this is of no demonstration" in refused.stderr
    folder = tmp_path / "simulated" / "0001"
    folder.mkdir(parents=True)
    (folder / "notes.txt").write_text("mine")
    refused = run("demo", "--out", tmp_path, "--overwrite")
    assert refused.exit_code == 3
    assert f"{folder / 'notes.txt'}: this is of no demonstration" in refused.stderr
    assert (folder / "notes.txt").exists()


def test_a_demonstration_is_of_one_kind(run, tmp_path) -> None:
    assert run("demo", "--campaign", "--live", "--out", tmp_path).exit_code == 2


def test_a_faulty_shot_log_is_refused_before_any_shot_is_identified(run, fired: FiredCampaign, tmp_path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("shot,added_mass_kg\n0001,0\n0001,120\n")
    result = run("campaign", fired.shots, "--reports", tmp_path / "none", "--log", log, "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert "line 3, column shot: a second row of shot 0001" in result.stderr
    assert not (tmp_path / "out").exists()
