"""A source that was declared and delivered nothing: what the shot is good for is what its mass needs."""

import json
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError, RigError
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.terminal.verdict_line import VerdictLine
from recoil_rigs.rig import load_rig, parse_rig
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
    (aside,) = [one for one in report["findings"] if one["code"] == "set aside"]
    assert (aside["about"], aside["severity"]) == ("camera", "warn")
    assert any(text.startswith("camera is set aside: no file of source camera") for text in report["notes"])


@pytest.mark.whole_way
def test_a_bus_with_the_forces_must_be_there_and_is_one_reason(run, mixed_shot: TwinShot, tmp_path: Path) -> None:
    result = run("ingest", mixed_shot.rig_file, *files_without(mixed_shot, "_can"), "--out", tmp_path, "--json")
    assert result.exit_code == 1, result.output
    document = json.loads(result.stdout)
    assert document["state"] == "not usable"
    (reason,) = document["reasons"]
    assert reason.startswith("can: no file of source can was given: p_brake, p_recuperator, acc_recoil_can missing")


def may_stay_away(rig_file: Path, name: str) -> str:
    head = f'[[source]]\nname = "{name}"\n'
    text = rig_file.read_text("utf-8")
    assert head in text
    return text.replace(head, f"{head}required = false\n")


@pytest.mark.whole_way
def test_what_may_stay_away_is_missed_without_a_remedy_and_is_taken_where_it_is_there(
    mixed_shot: TwinShot, tmp_path: Path
) -> None:
    rig = load_rig(mixed_shot.rig_file)
    rig = parse_rig(may_stay_away(mixed_shot.rig_file, "camera"), rig.path, dict(rig.databases))
    without = ingest_files(rig, files_without(mixed_shot, "camera"), out=tmp_path)
    assert without.shot.usable
    (aside,) = [c for c in without.shot.quality if c.check == "set aside"]
    assert aside.detail == (
        "nothing of source camera, which may stay away: x_camera missing; add its file to have it; "
        "the mass is found without it"
    )
    assert "x_camera" in ingest_files(rig, mixed_shot.files, out=tmp_path / "all").shot.channels


@pytest.mark.whole_way
def test_a_source_is_left_out_though_its_file_is_given_and_unreadable(
    run, mixed_shot: TwinShot, tmp_path: Path
) -> None:
    spoilt = tmp_path / "0001_camera.csv"
    spoilt.write_bytes(b"\x00\x01 of no format")
    given = [*files_without(mixed_shot, "camera"), spoilt]
    result = run("ingest", mixed_shot.rig_file, *given, "--without", "camera", "--out", tmp_path, "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert str(VerdictLine.of(document)).startswith("usable without camera, ")
    text = "source camera and its file 0001_camera.csv left out, as asked: x_camera missing"
    assert any(one["detail"].startswith(text) for one in document["quality"])
    assert "x_camera" not in [c["name"] for c in document["channels"]]


@pytest.mark.whole_way
@pytest.mark.parametrize(("source", "lacks"), [("can", "p_brake"), ("imu", "gyro_carriage")])
def test_a_bus_or_a_port_that_the_mass_needs_is_missed_though_it_was_left_out(
    mixed_shot: TwinShot, tmp_path: Path, source: str, lacks: str
) -> None:
    done = ingest_files(load_rig(mixed_shot.rig_file), mixed_shot.files, out=tmp_path, without=[source])
    assert done.shot.state == "not usable"
    (reason,) = done.shot.reasons
    assert reason.startswith(f"{source}: source {source} and its file 0001_{source}")
    assert lacks in reason
    assert "missing; add its file to have it" in reason


def test_what_cannot_be_left_out_is_refused_before_anything_is_read(mixed_shot: TwinShot, tmp_path: Path) -> None:
    rig = load_rig(mixed_shot.rig_file)
    with pytest.raises(ReadError, match="no source 'kamera' to leave out; did you mean 'camera'"):
        ingest_files(rig, [tmp_path / "none"], without=["kamera"])
    with pytest.raises(ReadError, match="'dewetron' cannot be left out: all other clocks are aligned to it"):
        ingest_files(rig, [tmp_path / "none"], without=["dewetron"])
    with pytest.raises(RigError, match="cannot stay away: all other clocks are aligned to it"):
        parse_rig(may_stay_away(mixed_shot.rig_file, "dewetron"), rig.path, dict(rig.databases))
