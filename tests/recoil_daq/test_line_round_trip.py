"""A body on a line from simulated files to report, campaign and prediction, by the commands that people type."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from recoil_daq.cli import app

SHOTS = 3
OF_A_GUN = re.compile(
    r"\b(breech|bore|recuperators?|carriage|trunnion|muzzle|projectile|tipping|in battery)\b", re.IGNORECASE
)
"""Words that mean nothing on a line."""


def run(*words: str | Path) -> tuple[int, str]:
    done = CliRunner().invoke(app, [str(word) for word in words])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.exit_code, done.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with shots of a campaign of the sled, ingested."""
    folder = tmp_path_factory.mktemp("sled")
    code, text = run(
        "simulate", "sled", "--shots", str(SHOTS), "--seed", "21", "--campaign-seed", "4", "--out", folder / "files"
    )
    assert code == 0, text
    for number in range(1, SHOTS + 1):
        files = folder / "files" / f"{number:04d}"
        code, text = run(
            "ingest", files / "rig.toml", *sorted(files.glob("*.csv")), "--shot", f"{number:04d}", "--out",
            folder / "shots",
        )  # fmt: skip
        assert code == 0, text
        assert "USABLE" in text
        assert not OF_A_GUN.findall(text)
    return folder


@pytest.fixture(scope="module")
def printed(folder: Path) -> str:
    """Return what `identify` prints of all of them."""
    code, text = run("identify", folder / "shots", "--out", folder / "reports")
    assert code == 0, text
    return text


def report(folder: Path, shot: str = "0001") -> dict[str, Any]:
    return dict(json.loads((folder / "reports" / shot / "report.json").read_text(encoding="utf-8")))


def truth_kg(folder: Path, shot: str) -> float:
    truth = json.loads((folder / "files" / shot / "truth.json").read_text(encoding="utf-8"))
    return float(truth["m3"]) + float(truth["carried_mass"])


@pytest.mark.indispensable("a body on a line")
@pytest.mark.usefixtures("printed")
def test_every_report_holds_the_true_mass(folder: Path) -> None:
    for number in range(1, SHOTS + 1):
        shot = f"{number:04d}"
        low, high = report(folder, shot)["mass"]["U95"]
        assert low <= truth_kg(folder, shot) <= high
        assert report(folder, shot)["valid"]


def test_nothing_that_is_printed_speaks_of_a_gun(printed: str) -> None:
    assert OF_A_GUN.findall(printed) == []


@pytest.mark.usefixtures("printed")
def test_the_report_has_its_keys_and_nulls_where_there_is_nothing(folder: Path) -> None:
    document = report(folder)
    assert {"schema", "shot", "rig", "mass", "budget", "alignment", "peaks", "constancy", "findings"} <= document.keys()
    assert document["mass"]["specification"] == pytest.approx(318.0 + 6.4)
    assert {document["peaks"].get(name) for name in ("breech_pressure_pa", "brake_pressure_pa")} == {None}
    assert document["peaks"]["recoil_velocity_m_s"] == pytest.approx(1.44, abs=0.05)
    assert document["peaks"]["recoil_travel_m"] == pytest.approx(0.29, abs=0.05)
    for row in document["budget"]:
        assert not OF_A_GUN.findall(row["source"]), row
    assert not OF_A_GUN.findall(document["measurand"])


@pytest.mark.usefixtures("printed")
def test_the_page_speaks_of_no_gun(folder: Path) -> None:
    page = (folder / "reports" / "0001" / "report.html").read_text(encoding="utf-8")
    text = re.sub(r"<(script|style)\b.*?</\1>|<[^>]+>", " ", page, flags=re.DOTALL)
    found = {text[max(match.start() - 60, 0) : match.end() + 40] for match in OF_A_GUN.finditer(text)}
    assert found == set()


@pytest.mark.whole_way
@pytest.mark.usefixtures("printed")
def test_a_campaign_holds_the_mass_that_its_shots_share(folder: Path) -> None:
    code, text = run("campaign", folder / "shots", "--out", folder / "campaign")
    assert code == 0, text
    document = json.loads((folder / "campaign" / "campaign.json").read_text(encoding="utf-8"))
    low, high = document["mass"]["U95"]
    assert low <= truth_kg(folder, "0001") <= high
    assert OF_A_GUN.findall(text) == []


@pytest.mark.whole_way
def test_a_prediction_says_what_one_shot_will_tell(folder: Path) -> None:
    code, text = run("predict", "sled", "--shots", "4", "--json")
    assert code == 0, text
    document = json.loads(text)
    assert 0.001 < document["u_rel"] < 0.02
    assert not OF_A_GUN.findall(json.dumps(document["what_if"]))
    code, text = run("predict", "sled", "--from", folder / "shots" / "0001.h5", "--shots", "4")
    assert code == 0, text
    assert not OF_A_GUN.findall(text)


@pytest.mark.whole_way
@pytest.mark.usefixtures("printed")
def test_a_report_explains_how_its_numbers_came_about_and_comes_about_again(folder: Path) -> None:
    code, text = run("explain", folder / "reports" / "0001")
    assert code == 0, text
    assert OF_A_GUN.findall(text) == []


def test_show_and_check_take_it(folder: Path) -> None:
    assert run("show", folder / "shots" / "0001.h5")[0] == 0
    files = sorted((folder / "files" / "0001").glob("*.csv"))
    code, text = run("check", "sled", *files)
    assert code == 0, text
    assert "no fault" in text
    assert not OF_A_GUN.findall(text)


@pytest.mark.parametrize("target", ["parameters", "stiffness", "breech-force", "inertia-force", "resistance"])
def test_a_target_of_a_gun_says_that_it_is_one(folder: Path, target: str) -> None:
    code, text = run("identify", folder / "shots" / "0001.h5", "--target", target, "--out", folder / target)
    assert code == 3
    assert "is found of a gun, and the rig is one of a body on a line" in " ".join(text.split())


@pytest.mark.whole_way
def test_the_transfer_function_is_found_on_a_line_too(folder: Path) -> None:
    code, text = run("identify", folder / "shots" / "0001.h5", "--target", "arx", "--out", folder / "arx")
    assert code in (0, 1), text
    assert "m_dc" in text
