"""The page of a day: its shots with their masses, what they say together, the log, what was lost, what to copy."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from recoil_acquisition.errors import StoreError
from recoil_daq.handover import day as module
from recoil_daq.handover.day import DAY_FILE, make_day
from recoil_daq.reports.report_folder import publish
from tests.recoil_daq.conftest import Identified

Run = Callable[..., Result]


@pytest.fixture
def day(stored: Path, identified: Identified, tmp_path: Path) -> Path:
    """A day of one shot with its report and its log."""
    out = tmp_path / "day"
    out.mkdir()
    shutil.copy(stored, out / "0001.h5")
    shutil.copytree(identified.reports / "0001", out / "reports" / "0001")
    (out / "shotlog.csv").write_text("shot,charge,exclude,notes\n0001,full,,<b>wind</b> from the left\n")
    return out


@pytest.mark.whole_way
def test_the_page_has_the_shots_the_log_and_what_to_copy(day: Path, run: Run) -> None:
    done = run("day", day)
    assert done.exit_code == 0, done.output
    page = (day / "day.html").read_text("utf-8")
    assert 'href="./reports/0001/report.html"' in page
    assert "&lt;b&gt;wind&lt;/b&gt; from the left" in page
    assert "<script src" not in page
    assert "recoil-daq pack" in page
    document = json.loads((day / DAY_FILE).read_text("utf-8"))
    assert document["schema"] == "recoil-daq/day/1"
    assert [one["path"] for one in document["copy"]] == ["*.h5", "*shotlog.csv*", "reports"]
    assert document["log"]["rows"] == [["0001", "full", "", "<b>wind</b> from the left"]]


def lost(day: Path) -> list[tuple[str, str]]:
    return [(one["of"], one["text"]) for one in make_day(day).document["lost"]]


@pytest.mark.whole_way
def test_what_is_in_no_shot_file_is_named(day: Path) -> None:
    (day / "captures").mkdir()
    (day / "captures" / "0002.rdlog").write_bytes(b"")
    (day / "sessions").mkdir()
    session = {
        "error": "No space left",
        "shots": [{"shot": "0003", "state": "failed", "problem": "no room", "capture": None}],
    }
    (day / "sessions" / "20261126T090000.json").write_text(json.dumps(session))
    (day / "sessions" / "20261126T100000.json").write_text("{")
    named = dict(lost(day))
    assert named["0002"].startswith("captured, and no shot file of it")
    assert named["0003"] == "failed: no room"
    assert named["session 20261126T090000"] == "No space left"
    assert named["session 20261126T100000"].startswith("its log cannot be read")


@pytest.mark.whole_way
def test_a_page_that_is_there_is_replaced_when_that_is_asked_for_and_nothing_is_left_of_one_that_fails(
    day: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    (day / "day.html").write_text("mine")
    done = run("day", day)
    assert (done.exit_code, "exists already" in done.output) == (3, True)
    assert (day / "day.html").read_text() == "mine"

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as disk:
        disk.setattr(module, "give_name", fail)
        with pytest.raises(StoreError, match="No space left"):
            make_day(day, overwrite=True)
    assert not list(day.glob(".*partial"))
    assert (day / "day.html").read_text() == "mine"
    assert run("day", day, "--overwrite").exit_code == 0
    assert (day / "day.html").read_text("utf-8") != "mine"


@pytest.mark.whole_way
def test_an_answer_that_somebody_made_is_left_and_one_of_an_earlier_page_made_again(
    day: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(day / "0001.h5", day / "0002.h5")
    made: list[Path] = []

    def combine(_: Any, *, out: Path, **__: Any) -> Any:
        document = {
            "mass": {"value": 780.0, "u": 2.0, "U95": [776.0, 784.0]}, "shots": [1, 2], "valid": True, "reasons": [],
            "n": len(made),
        }  # fmt: skip
        made.append(out)
        publish(out, lambda to: (to / "campaign.json").write_text(json.dumps(document)) and None)
        return type("Made", (), {"document": document})

    monkeypatch.setattr(module, "campaign", combine)
    first = make_day(day)
    assert first.document["campaign"]["text"] == "2 shots together: 780.0 kg, 95 % 776.0 to 784.0 kg, valid"
    make_day(day, overwrite=True)
    assert len(made) == 2
    own = (day / "campaign" / "campaign.json").read_text().replace('"n": 1', '"n": 7')
    (day / "campaign" / "campaign.json").write_text(own)
    make_day(day, overwrite=True)
    assert len(made) == 2
    assert (day / "campaign" / "campaign.json").read_text() == own


def test_a_folder_without_shots_is_refused(tmp_path: Path, run: Run) -> None:
    done = run("day", tmp_path)
    assert (done.exit_code, "no shot file and no capture" in done.output) == (3, True)
