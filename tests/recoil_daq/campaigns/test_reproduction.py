"""`explain --check` of a campaign: it comes again from its shots' reports, and a changed digit shows."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.errors import ReadError
from recoil_daq import check_reports, explain
from recoil_daq.campaigns.campaign import campaign
from tests.builders.campaign_reports import write_reports
from tests.builders.campaign_summaries import campaign_of

ALTERNATING = (0.0, 120.0) * 4
CAMPAIGNS: list[dict[str, Any]] = [
    {"seed": 1}, {"seed": 2, "step_kg": {4: -6.0}}, {"seed": 3, "moved": {(2, "ln breech_pressure"): -0.02}},
    {"seed": 4, "moved": {(k, "ln breech_pressure"): 0.02 * k / 7 for k in range(8)}}, {"seed": 5, "step_kg": {1: 9.0}},
]  # fmt: skip
"""What was planted in each: nothing, a step, a shot apart, a drift, a first shot apart."""
CHANNEL = {
    "channel": "p", "role": "breech_pressure", "quantity": "pressure", "unit": "Pa", "signal": "AI 1", "clock": "daq",
    "recorder": "dewetron", "model": "piezo", "serial": "4711", "certificate": "C-1", "calibrated": "2026-01-15",
    "due": None, "range": [0.0, 2.5e8], "u": 0.005, "known_by": {}, "chain": {"amplifier": 2.0},
}  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign in ``campaign`` of reports in ``reports``, with an identity of its own; not to be changed."""
    folder = tmp_path_factory.mktemp("made")
    issued = {"laboratory": "North", "number": "1", "tolerance_kg": [-4.0, 4.0]}
    shots = campaign_of(ALTERNATING, seed=4).shots
    write_reports(folder / "reports", shots, issued=issued, channels=[CHANNEL])
    (folder / "header.toml").write_text('number = "7"\nconcession = "accepted by N"\n', encoding="utf-8")
    campaign(folder / "reports", out=folder / "campaign", header=folder / "header.toml")
    return folder


@pytest.fixture
def done(made: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(made, tmp_path / "done"))


@pytest.mark.whole_way
@pytest.mark.parametrize("planted", CAMPAIGNS, ids=lambda one: f"seed {one['seed']}")
def test_a_campaign_comes_again_to_the_last_bit_whatever_was_planted(tmp_path: Path, planted: dict[str, Any]) -> None:
    write_reports(tmp_path / "reports", campaign_of(ALTERNATING, **planted).shots)
    answer = campaign(tmp_path / "reports", out=tmp_path / "campaign")
    checked = check_reports(tmp_path / "campaign", workers=1)
    (one,) = checked.reports
    assert checked.again
    assert one.exact
    assert one.comparison is not None
    assert one.comparison.numbers > 200
    budget = sum(row["u_kg"] ** 2 for row in answer.document["budget"])
    assert budget == pytest.approx(answer.u_kg**2, rel=1e-9)


@pytest.mark.whole_way
def test_what_is_one_document_s_is_not_taken_over_and_a_campaign_has_a_number_of_its_own(tmp_path: Path) -> None:
    issued = {
        "laboratory": "North", "number": "1", "issue": "2", "date": "2026-11-28", "approval": "A", "concession": "B",
        "replaces": "0", "tolerance_kg": [None, 4.0], "decision_rule": "simple",
    }  # fmt: skip
    write_reports(tmp_path / "reports", campaign_of(ALTERNATING, seed=4).shots, issued=issued)
    bare = campaign(tmp_path / "reports", out=tmp_path / "bare").document
    assert bare["issued"] == {"laboratory": "North", "tolerance_kg": [None, 4.0], "decision_rule": "simple"}
    assert bare["conformity"]["word"] == ("conforms" if bare["mass"]["deviation_kg"] <= 4.0 else "does not conform")
    (tmp_path / "header.toml").write_text('number = "C-{campaign}"\n', encoding="utf-8")
    named = campaign(tmp_path / "reports", out=tmp_path / "spring", header=tmp_path / "header.toml")
    assert named.document["issued"]["number"] == "C-spring"
    assert check_reports(tmp_path / "spring", workers=1).again
    (tmp_path / "header.toml").write_text('number = "C-{shot}"\n', encoding="utf-8")
    with pytest.raises(ReadError, match="this document is of a campaign"):
        campaign(tmp_path / "reports", out=tmp_path / "other", header=tmp_path / "header.toml")
    assert not (tmp_path / "other").exists()


@pytest.mark.whole_way
def test_the_shots_identity_the_header_and_the_conformity_are_in_the_answer(done: Path) -> None:
    document = json.loads((done / "campaign" / "campaign.json").read_text("utf-8"))
    assert document["issued"] == {
        "laboratory": "North", "number": "7", "concession": "accepted by N", "tolerance_kg": [-4.0, 4.0],
    }  # fmt: skip
    conformity = document["conformity"]
    assert conformity["limits_kg"] == [896.0, 904.0]
    assert conformity["deviation_kg"] == pytest.approx(document["mass"]["deviation_kg"])
    assert 0.0 < conformity["probability"] < 1.0
    assert document["channels"] == [{**CHANNEL, "shots": [one["shot"] for one in document["shots"]]}]
    page = (done / "campaign" / "campaign.html").read_text("utf-8")
    for text in ("accepted by N", "North", "decision rule", f"{100 * conformity['probability']:.1f} %"):
        assert text in page
    assert check_reports(done / "campaign", workers=1).again


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["campaign.json", "campaign.csv"])
def test_a_changed_digit_gives_exit_code_1(done: Path, run: Callable[..., Any], name: str) -> None:
    path = done / "campaign" / name
    text = path.read_text("utf-8")
    mass = json.loads((done / "campaign" / "campaign.json").read_text("utf-8"))["shots"][0]["mass"]["value"]
    digits = str(mass)
    other = digits[:-1] + ("1" if digits[-1] != "1" else "2")
    assert digits in text
    path.write_text(text.replace(digits, other), encoding="utf-8")
    result = run("explain", done / "campaign", "--check", "--workers", 1, "--json")
    assert result.exit_code == 1
    (row,) = json.loads(result.stdout)["reports"]
    assert row["differing"] >= 1


def told_of_a_changed_byte(answer: Path, name: str) -> list[str]:
    """What is said of an answer in which the last byte of a file beside it was changed."""
    path = answer / name
    path.write_bytes(path.read_bytes()[:-1] + b" ")
    (one,) = check_reports(answer, workers=1).reports
    assert not one.again
    assert one.comparison is not None
    return [str(difference) for difference in one.comparison.differences]


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["campaign.html", "plotly.min.js", "campaign.csv"])
def test_a_changed_byte_of_what_is_beside_an_answer_is_one_line(done: Path, name: str) -> None:
    (told,) = told_of_a_changed_byte(done / "campaign", name)
    assert name in told


@pytest.mark.whole_way
def test_a_changed_byte_of_a_paper_copy_is_one_line(tmp_path: Path) -> None:
    write_reports(tmp_path / "reports", campaign_of(ALTERNATING[:4], seed=4).shots)
    campaign(tmp_path / "reports", out=tmp_path / "campaign", pdf=True)
    (whole,) = check_reports(tmp_path / "campaign", workers=1).reports
    assert whole.again
    (told,) = told_of_a_changed_byte(tmp_path / "campaign", "campaign.pdf")
    assert "campaign.pdf" in told


@pytest.mark.whole_way
def test_a_changed_report_in_the_folder_that_was_named_is_told(done: Path) -> None:
    other = shutil.copytree(done / "reports", done / "other")
    report = other / "0002" / "report.json"
    report.write_text(report.read_text("utf-8") + " ", encoding="utf-8")
    (one,) = check_reports(done / "campaign", shots=other, workers=1).reports
    assert one.comparison is not None
    (difference,) = one.comparison.differences
    assert str(report) in str(difference)


@pytest.mark.whole_way
def test_an_answer_whose_reports_are_others_or_are_gone_says_so(done: Path, run: Callable[..., Any]) -> None:
    shutil.move(done / "reports", done / "elsewhere")
    result = run("explain", done / "campaign", "--check", "--workers", 1)
    assert result.exit_code == 3
    assert "the report of shot 0001 that this answer was made of is not found" in " ".join(result.output.split())
    with_place = ("explain", done / "campaign", "--check", "--workers", 1, "--shots", done / "elsewhere")
    assert run(*with_place).exit_code == 0
    report = done / "elsewhere" / "0002" / "report.json"
    report.write_text(report.read_text("utf-8").replace("full", "half"), encoding="utf-8")
    assert run(*with_place).exit_code == 3


@pytest.mark.whole_way
def test_a_folder_that_holds_a_campaign_has_it_checked_too(done: Path) -> None:
    checked = check_reports(done, workers=1)
    assert [one.report.name for one in checked.reports if not one.fault] == ["campaign.json"]


@pytest.mark.whole_way
def test_the_numbers_of_an_answer_and_of_its_budget_are_explained(done: Path, run: Callable[..., Any]) -> None:
    told = explain(done / "campaign")
    assert told.again
    assert [one.key for one in told.entries] == ["mass", "conformity", "budget"]
    result = run("explain", done / "campaign", "mass.E_n")
    assert result.exit_code == 0
    assert "ISO/IEC 17043" in result.output
    document = json.loads((done / "campaign" / "campaign.json").read_text("utf-8"))
    assert f"mass.specification: {document['mass']['specification']}" in result.output
    assert run("explain", done / "campaign", "mass.nothing").exit_code == 3


@pytest.mark.whole_way
@pytest.mark.parametrize(
    "place", [("budget", 0, "u_kg"), ("mass", "u"), ("common", 0, "influence"), ("shots", 0, "mass")]
)
def test_something_else_in_the_place_of_a_value_is_no_exception(
    done: Path, run: Callable[..., Any], place: tuple[str | int, ...]
) -> None:
    path = done / "campaign" / "campaign.json"
    document = json.loads(path.read_text("utf-8"))
    inside = document
    for key in place[:-1]:
        inside = inside[key]
    assert place[-1] in inside
    inside[place[-1]] = ["x"]
    path.write_text(json.dumps(document), encoding="utf-8")
    result = run("explain", path, place[0])
    # an exception that nothing caught would end with 1, too
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code in (1, 3)


@pytest.mark.whole_way
def test_an_answer_that_is_nested_too_deeply_is_told_in_a_line(done: Path, run: Callable[..., Any]) -> None:
    path = done / "campaign" / "campaign.json"
    document = json.loads(path.read_text("utf-8"))
    deep = "[" * 900 + "]" * 900
    path.write_text(json.dumps({**document, "deep": 7}).replace('"deep": 7', f'"deep": {deep}'), encoding="utf-8")
    result = run("explain", path)
    assert result.exit_code == 3, result.exception
    (line,) = result.stderr.splitlines()
    assert "more than 32 levels" in line


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of four shots with a shot log that nobody finds again, ``before/shotlog.csv``; not to be changed."""
    folder = tmp_path_factory.mktemp("logged")
    shots = campaign_of(ALTERNATING[:4], seed=4).shots
    write_reports(folder / "reports", shots)
    rows = (f"{one.name},{one.added_mass_kg:g},0.05,{k}\n" for k, one in enumerate(shots))
    log = folder / "before" / "shotlog.csv"
    log.parent.mkdir()
    log.write_text("shot,added_mass_kg,u_added_mass_kg,charge\n" + "".join(rows), encoding="utf-8")
    campaign(folder / "reports", log=log, out=folder / "campaign")
    return folder


def state_of_log(home: Path) -> dict[str, Any]:
    """What is said of the shot log of an answer."""
    (found,) = [one for one in explain(home / "campaign").files if one["file"].endswith("shotlog.csv")]
    return found


@pytest.mark.whole_way
@pytest.mark.parametrize("place", [".", "shots", "campaign"])
def test_a_campaign_finds_its_shot_log_beside_it(logged: Path, tmp_path: Path, place: str) -> None:
    home = shutil.copytree(logged, tmp_path / "home")
    moved = home / place / "shotlog.csv"
    moved.parent.mkdir(exist_ok=True)
    (home / "before" / "shotlog.csv").rename(moved)
    found = state_of_log(home)
    assert (Path(found["found"]), found["state"]) == (moved.resolve(), "as it was")
    assert found["sha256_now"] == found["sha256"]


@pytest.mark.whole_way
def test_what_became_of_the_shot_log_is_said_and_the_answer_comes_again_without_it(
    logged: Path, tmp_path: Path
) -> None:
    home = shutil.copytree(logged, tmp_path / "home")
    gone = state_of_log(home)
    assert (gone["found"], gone["state"]) == (None, "not here: what it said is in the answer")
    text = (home / "before" / "shotlog.csv").read_text("utf-8")
    moved = home / "shotlog.csv"
    moved.write_text(text + "another,0,0,9\n", encoding="utf-8")
    assert state_of_log(home)["state"] == "changed since, its rows of these shots are the same"
    moved.write_text(text.replace("0.05,1\n", "0.05,7\n"), encoding="utf-8")
    assert state_of_log(home)["state"] == "changed since, and so are its rows of 0002"
    assert check_reports(home / "campaign", workers=1).again
