"""A campaign beside the earlier ones of its season, read from their answers."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from recoil_acquisition.errors import ReadError
from recoil_daq import __version__
from recoil_daq.campaigns.campaign import campaign
from recoil_daq.campaigns.reproduction import check_reports
from recoil_identification.report.document.report_files import json_bytes, sealed
from tests.builders.campaign_reports import write_report
from tests.builders.campaign_summaries import campaign_of

Run = Callable[..., Result]
SHOT_FILE = {"file": "a shot", "sha256": "0" * 64}


@pytest.fixture(scope="module")
def season(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Reports of three campaigns of one rig, and the answers of two of them below ``past``."""
    home = tmp_path_factory.mktemp("season")
    for number, name in enumerate(("spring", "summer", "autumn")):
        shots = campaign_of((0.0, 120.0) * 2, seed=number + 2).shots
        for place, shot in enumerate(shots):
            recorded = {"file": "daq.csv", "sha256": f"{number}{place}" * 32, "size": 1}
            write_report(
                home / name, shot, started=f"2026-0{3 + number}-02T08:00:0{place}",
                provenance={"version": __version__, "inputs": [SHOT_FILE, recorded], "parameters": {}},
            )  # fmt: skip
    for name in ("spring", "summer"):
        campaign(home / name, out=home / "past" / "2026" / name)
    return home


def copied(season: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(season / "past", tmp_path / "past"))


def changed(path: Path, **changes: Any) -> None:
    document = json.loads(path.read_text("utf-8"))
    path.write_bytes(json_bytes(sealed({**document, **changes})))


def remarks(document: dict[str, Any]) -> list[str | None]:
    return [one["remark"] for one in document["history"]["campaigns"]]


@pytest.mark.whole_way
def test_earlier_campaigns_stand_beside_the_mass_in_the_order_of_firing(season: Path, tmp_path: Path, run: Run) -> None:
    out = tmp_path / "now"
    result = run("campaign", season / "autumn", "--history", season / "past", "--out", out)
    document = json.loads((out / "campaign.json").read_text("utf-8"))
    history = document["history"]
    assert [one["campaign"] for one in history["campaigns"]] == ["2026/spring", "2026/summer", "this campaign"]
    for one in history["campaigns"][:-1]:
        past = json.loads((season / "past" / one["campaign"] / "campaign.json").read_text("utf-8"))
        assert one["mass"]["value"] == past["mass"]["value"]
        assert one["difference_kg"] == past["mass"]["value"] - document["mass"]["value"]
        assert (out / one["page"]).is_file()
    assert history["degrees_of_freedom"] == 2
    assert history["detail"] in " ".join(result.output.split())
    page = (out / "campaign.html").read_text("utf-8")
    assert "2026/spring" in page
    assert "The season" in page
    sources = [one.get("source") for one in document["provenance"]["inputs"]]
    assert sources.count("earlier campaign") == 2


@pytest.mark.whole_way
def test_its_numbers_come_again(season: Path, tmp_path: Path) -> None:
    done = campaign(season / "autumn", out=tmp_path / "now", history=season / "past")
    assert check_reports(done.folder, shots=season / "autumn").again
    document = json.loads((done.folder / "campaign.json").read_text("utf-8"))
    document["history"]["chi_square"] += 0.125
    (done.folder / "campaign.json").write_bytes(json_bytes(sealed(document)))
    assert not check_reports(done.folder, shots=season / "autumn").again


@pytest.mark.whole_way
def test_without_a_history_nothing_is_said_of_one(season: Path, tmp_path: Path) -> None:
    assert "history" not in campaign(season / "autumn", out=tmp_path / "now").document


@pytest.mark.whole_way
def test_campaigns_that_differ_are_a_note_and_make_no_mass_invalid(season: Path, tmp_path: Path) -> None:
    past = copied(season, tmp_path)
    path = past / "2026" / "spring" / "campaign.json"
    mass = json.loads(path.read_text("utf-8"))["mass"]
    changed(path, mass={**mass, "value": mass["value"] + 60.0})
    document = campaign(season / "autumn", out=tmp_path / "now", history=past).document
    assert document["history"]["agrees"] is False
    assert document["valid"] is True
    assert document["history"]["detail"] in document["notes"]
    assert ("comparison", "note") in [(one["code"], one["severity"]) for one in document["findings"]]
    assert check_reports(tmp_path / "now", shots=season / "autumn").again


@pytest.mark.whole_way
def test_what_cannot_be_compared_is_shown_with_its_reason(season: Path, tmp_path: Path) -> None:
    past = copied(season, tmp_path)
    spring, summer = (past / "2026" / name / "campaign.json" for name in ("spring", "summer"))
    changed(spring, rig="another")
    changed(summer, valid=False)
    document = campaign(season / "autumn", out=tmp_path / "now", history=past).document
    assert remarks(document) == ["it is of another rig, another", "it is not valid", None]
    assert document["history"]["p"] is None
    changed(spring, rig=document["rig"], mass={**document["mass"], "configuration": "ring"})
    summer.write_bytes(summer.read_bytes().replace(b'"valid": false', b'"valid":  true', 1))
    summer.write_bytes(summer.read_bytes().replace(b'"u_kg": ', b'"u_kg": 1', 1))
    document = campaign(season / "autumn", out=tmp_path / "now", history=past, overwrite=True).document
    first, second, _ = remarks(document)
    assert first == "its mass is of another configuration, ring"
    assert second is not None
    assert "changed after it was written" in second


@pytest.mark.whole_way
def test_a_campaign_with_the_same_shots_and_the_answer_that_is_replaced_are_no_earlier_ones(
    season: Path, tmp_path: Path
) -> None:
    past = copied(season, tmp_path)
    out = past / "2026" / "autumn"
    campaign(season / "autumn", out=out)
    shutil.copytree(past / "2026" / "summer", past / "a copy")
    document = campaign(season / "autumn", out=out, history=past, overwrite=True).document
    assert [one["campaign"] for one in document["history"]["campaigns"]] == [
        "2026/spring", "2026/summer", "this campaign",
    ]  # fmt: skip
    other = campaign(season / "autumn", out=tmp_path / "again", history=past).document
    assert [one["campaign"] for one in other["history"]["campaigns"]][2:] == ["2026/autumn", "this campaign"]
    assert remarks(other) == [None, None, "4 of its shots are in this campaign, too", None]


@pytest.mark.whole_way
@pytest.mark.parametrize(
    "content",
    [
        b"", b"{", b"[" * 100_000, b'{"schema": "recoil-daq/campaign/1"}', b'{"schema": "other"}',
        b'{"schema": "recoil-daq/campaign/1", "mass": {"value": 1, "u": 0, "U95": [1, 2]}, "shots": []}',
    ],
)  # fmt: skip
def test_a_hostile_answer_is_told_in_one_line_before_any_work(
    season: Path, tmp_path: Path, run: Run, content: bytes
) -> None:
    past = copied(season, tmp_path)
    hostile = past / "2026" / "hostile" / "campaign.json"
    hostile.parent.mkdir()
    hostile.write_bytes(content)
    result = run("campaign", season / "autumn", "--history", past, "--out", tmp_path / "now")
    assert result.exit_code == 3
    (line,) = result.stderr.splitlines()
    assert str(hostile) in line
    assert not (tmp_path / "now").exists()


@pytest.mark.whole_way
@pytest.mark.parametrize("key", ["budget", "channels", "shots", "mass", "provenance"])
def test_an_answer_that_lacks_or_garbles_a_part_is_told(season: Path, tmp_path: Path, key: str) -> None:
    past = copied(season, tmp_path)
    path = past / "2026" / "spring" / "campaign.json"
    document = json.loads(path.read_text("utf-8"))
    for other in ({name: one for name, one in document.items() if name != key}, {**document, key: "x"}):
        path.write_text(json.dumps(other), encoding="utf-8")
        with pytest.raises(ReadError, match="spring"):
            campaign(season / "autumn", out=tmp_path / "now", history=past)


@pytest.mark.whole_way
def test_a_folder_without_any_is_no_history(season: Path, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="no campaign's answer"):
        campaign(season / "autumn", out=tmp_path / "now", history=season / "autumn")
    with pytest.raises(ReadError, match="no such folder"):
        campaign(season / "autumn", out=tmp_path / "now", history=tmp_path / "nowhere")
