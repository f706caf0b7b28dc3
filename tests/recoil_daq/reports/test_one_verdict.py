"""One verdict, from range to desk: what `identify` would refuse of a record `ingest` says first, with its remedy."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from recoil_daq.live.range_state import RangeShot
from recoil_daq.live.shot import LiveOutcome, LiveShot, ShotState
from recoil_daq.live.tables import print_session
from recoil_daq.terminal.verdict_line import VerdictLine
from recoil_rigs.rig import find_rig
from recoil_rigs.twin import TwinShot

ACCELEROMETER = "u_rel = 0.005, range = [-5000.0, 5000.0]"


@pytest.fixture
def unknown_filter(tmp_path: Path) -> Path:
    """The bundled rig, whose accelerometer has an anti-alias filter of which nothing but the corner is declared."""
    text = find_rig("field-2013").read_text(encoding="utf-8")
    assert ACCELEROMETER in text
    rig = tmp_path / "rig.toml"
    rig.write_text(text.replace(ACCELEROMETER, f"{ACCELEROMETER}, filter_hz = 1000.0", 1), encoding="utf-8")
    return rig


@pytest.mark.whole_way
def test_a_clock_that_is_hardly_known_is_said_at_the_range_first_and_at_the_desk_the_same(
    run, field_shot: TwinShot, unknown_filter: Path, tmp_path: Path
) -> None:
    shots = tmp_path / "shots"
    done = run("ingest", unknown_filter, *field_shot.files, "--shot", "0001", "--out", shots, "--json")
    verdict = json.loads(done.stdout)
    assert done.exit_code == 1
    assert (verdict["state"], verdict["usable"]) == ("record only", False)
    (reason,) = verdict["reasons"]
    assert reason.startswith("clock camera: alignment ambiguous: the offset is known to 0.4")
    assert "declare `delay_s`, or the `filter_type`, of acc_recoil's sensor" in reason
    assert verdict["findings"][0] == {"code": "clock", "about": "camera", "severity": "fatal", "text": reason}
    told = run("ingest", unknown_filter, *field_shot.files, "--shot", "0001", "--out", shots, "--overwrite")
    (line,) = [line for line in told.output.splitlines() if line.startswith("FOR THE RECORD ONLY")]
    assert f": {reason}" in line
    shown = run("show", shots / "0001.h5")
    assert any(line.startswith("record only") and line.endswith(f": {reason}") for line in shown.output.splitlines())
    summary = json.loads(run("show", shots / "0001.h5", "--json").stdout)
    assert (summary["state"], summary["findings"]) == ("record only", verdict["findings"])
    report = json.loads(run("identify", shots / "0001.h5", "--out", tmp_path / "r", "--json").stdout)["reports"][0]
    assert report["valid"] is False
    assert report["reasons"][0] == reason


@pytest.mark.whole_way
def test_a_declared_delay_makes_the_same_shot_usable_and_valid(
    run, field_shot: TwinShot, unknown_filter: Path, tmp_path: Path
) -> None:
    text = unknown_filter.read_text(encoding="utf-8")
    unknown_filter.write_text(text.replace("filter_hz = 1000.0", "filter_hz = 1000.0, delay_s = 0.0"), encoding="utf-8")
    done = run("ingest", unknown_filter, *field_shot.files, "--shot", "0001", "--out", tmp_path / "s")
    assert done.exit_code == 0, done.output
    assert run("identify", tmp_path / "s", "--out", tmp_path / "r").exit_code == 0


@pytest.mark.whole_way
def test_a_folder_of_shots_tells_worst_verdict_warnings_and_the_first_reason(
    run, field_shot: TwinShot, unknown_filter: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "day" / "0001"
    folder.mkdir(parents=True)
    for file in field_shot.files:
        (folder / file.name).write_bytes(file.read_bytes())
    done = run("ingest", unknown_filter, folder.parent, "--batch", "--out", tmp_path / "s", "--json")
    (one,) = json.loads(done.stdout)["shots"]
    assert done.exit_code == 1
    assert (one["state"], one["verdict"]) == ("record only", "warn")
    # the check that warns of the clock is the reason itself
    assert one["warnings"] == []
    assert one["reasons"][0].startswith("clock camera")
    table = run("ingest", unknown_filter, folder.parent, "--batch", "--out", tmp_path / "s", "--overwrite").output
    assert "record only" in table
    assert "first reason" in table


def document(**changed: object) -> dict[str, object]:
    checks = [
        {"channel": "p_brake", "check": "noise", "verdict": "warn", "detail": "loud; check its cable"},
        {"channel": "acc", "check": "range", "verdict": "fail", "detail": "clipped; raise the range"},
    ]
    reasons = ["acc: clipped; raise the range", "clock imu: ambiguous"]
    found = {"shot": "1", "file": "1.h5", "usable": False, "state": "not usable", "reasons": reasons, "quality": checks}
    return found | changed


def test_a_verdict_is_its_state_its_warnings_and_the_first_reason() -> None:
    failed = VerdictLine.of(document())
    assert (failed.worst, str(failed)) == ("fail", "not usable, 1 warning: acc: clipped; raise the range")
    warned = VerdictLine.of(document(usable=True, state="usable", reasons=[]))
    assert (warned.worst, str(warned)) == ("warn", "usable, 1 warning: p_brake: loud; check its cable")
    sound = VerdictLine.of(document(usable=True, state="usable", reasons=[], quality=[]))
    assert (sound.worst, str(sound)) == ("ok", "usable")
    before = document()
    del before["state"]
    assert VerdictLine.of(before).state == "not usable"


def test_a_live_shot_shows_its_state_its_warnings_and_its_first_reason(capsys: pytest.CaptureFixture[str]) -> None:
    reasons = ["clock imu: ambiguous; declare `delay_s`", "another"]
    doubtful = document(state="record only", reasons=reasons)
    shot = LiveShot("0003", state=ShotState.RECORD_ONLY, document=doubtful)
    assert shot.settled
    assert RangeShot.of(shot).why == reasons[0]
    outcome = LiveOutcome("mixed", [shot])
    assert not outcome.usable
    print_session(outcome.to_json())
    printed = " ".join(capsys.readouterr().out.split())
    assert "record only" in printed
    assert "warnings" in printed
