"""A source that was declared and delivered nothing: what the shot is good for is what its mass needs."""

import json
from pathlib import Path

import pytest

from recoil_daq.terminal.verdict_line import VerdictLine
from recoil_rigs.twin import TwinShot


def files_without(shot: TwinShot, *words: str) -> list[Path]:
    return [file for file in shot.files if not any(word in file.name for word in words)]


@pytest.mark.whole_way
def test_a_camera_that_did_not_fire_leaves_a_usable_shot_and_a_valid_mass(
    run, mixed_shot: TwinShot, tmp_path: Path
) -> None:
    given = files_without(mixed_shot, "camera")
    result = run("ingest", mixed_shot.rig_file, *given, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    assert "USABLE WITHOUT CAMERA, " in result.stdout
    shown = run("show", tmp_path / "0001.h5", "--json")
    document = json.loads(shown.stdout)
    assert (document["state"], document["usable"], document["reasons"]) == ("usable", True, [])
    assert str(VerdictLine.of(document)).startswith("usable without camera, ")
    identified = run("identify", tmp_path, "--out", tmp_path / "reports", "--json")
    assert identified.exit_code == 0, identified.output
    report = json.loads((tmp_path / "reports" / "0001" / "report.json").read_text("utf-8"))
    assert (report["valid"], report["reasons"]) == (True, [])
    aside = [one["text"] for one in report["findings"] if one["code"] == "set aside"]
    assert any(text.startswith("camera is set aside: no file of source camera") for text in aside)


@pytest.mark.whole_way
def test_a_bus_with_the_forces_must_be_there_and_is_one_reason(run, mixed_shot: TwinShot, tmp_path: Path) -> None:
    result = run("ingest", mixed_shot.rig_file, *files_without(mixed_shot, "_can"), "--out", tmp_path, "--json")
    assert result.exit_code == 1, result.output
    document = json.loads(result.stdout)
    assert document["state"] == "not usable"
    (reason,) = document["reasons"]
    assert reason.startswith("can: no file of source can was given: p_brake, p_recuperator, acc_recoil_can missing")
