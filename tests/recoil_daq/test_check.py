"""What `check` finds before the day: in the rig, in its database, and against recorded files."""

import json
from pathlib import Path

import pytest

from recoil_rigs.twin import TwinShot


@pytest.fixture
def rig(mixed_shot: TwinShot, tmp_path: Path) -> Path:
    """Return a copy of the rig with its database that a test may change."""
    folder = mixed_shot.rig_file.parent
    for name in ("rig.toml", "mixed.dbc"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    return tmp_path / "rig.toml"


def change(rig: Path, *changes: tuple[str, str]) -> None:
    text = rig.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    rig.write_text(text, encoding="utf-8")


def faults(run, *words: object) -> list[str]:
    """Return the faults that the terminal shows, which must be those of the document."""
    result = run("check", *words)
    assert result.exit_code == 3, result.output
    document = json.loads(run("check", *words, "--json").stdout)
    told = [f"{one['key']}: {one['problem']}" for one in document["faults"]]
    lines = [line.strip() for line in result.stderr.splitlines()[1:]]
    assert lines == told or len(told) == 1
    return told


def test_a_signal_that_the_database_does_not_have_is_named_with_the_nearest(run, rig: Path) -> None:
    change(rig, ('"RecoilNode.p_brake"', '"RecoilNode.p_break"'), ('"RecoilNode.acc_recoil"', '"Recoil.acc_recoil"'))
    first, second = faults(run, rig)
    assert first.startswith(
        "channel 'p_brake'.signal: mixed.dbc has no signal 'RecoilNode.p_break'; nearest: 'RecoilNode.p_br"
    )
    assert second.startswith("channel 'acc_recoil_can'.signal: mixed.dbc has no signal 'Recoil.acc_recoil'; nearest: ")


def test_doubts_overdue_calibrations_and_unknown_signals_are_told_at_once(run, rig: Path) -> None:
    change(
        rig,
        ("phi10 = 0.02", "phi10 = 1.0"),
        (", u_rel = 0.005", ""),
        ("due = 2099-12-31", "due = 2026-02-01"),
        ('"RecoilNode.p_brake"', '"RecoilNode.p_break"'),
    )
    assert [line.split(":")[0] for line in faults(run, rig)] == [
        "channel[0] 'acc_recoil'.sensor.u_rel",
        "mechanism.phi10",
        "channel 'acc_recoil'.sensor.due",
        "channel 'p_brake'.signal",
    ]


def test_a_rig_that_fits_the_files_says_what_they_have_of_it(run, rig: Path, mixed_shot: TwinShot) -> None:
    result = run("check", rig, *mixed_shot.files)
    assert result.exit_code == 0, result.output
    assert "Recorded files" in result.stdout
    document = json.loads(run("check", rig, *mixed_shot.files, "--json").stdout)
    assert {row["file"]: row["source"] for row in document["files"]} == {
        "0001_dewetron.csv": "dewetron",
        "0001_can.blf": "can",
        "0001_imu.rdlog": "imu",
        "0001_camera.csv": "camera",
    }
    channels = {one["name"]: one for row in document["files"] for one in row["channels"]}
    assert list(channels) != []
    assert (channels["p_breech"]["unit"], channels["p_breech"]["rate_hz"]) == ("MPa", pytest.approx(25e3))
    assert channels["p_breech"]["samples"] > 8_000


def test_every_fault_of_every_file_is_told_at_once(run, rig: Path, mixed_shot: TwinShot, tmp_path: Path) -> None:
    change(
        rig,
        ('"AI 1/acc_recoil"', '"AI 1/acc_recoi"'),
        ('"AI 2/acc_carriage_x"', '"AI 2/acc_x"'),
        ('"Feature #1 - X"', '"Feature #7 - X"'),
        ('unit = "MPa"', 'unit = "bar"'),
    )
    stranger = tmp_path / "notes.txt"
    stranger.write_text("what the weather was\n", encoding="utf-8")
    given = [file for file in mixed_shot.files if "imu" not in file.name]
    told = faults(run, rig, *given, stranger)
    expected = (
        "channel 'acc_recoil'.signal: 0001_dewetron.csv: no signal 'AI 1/acc_recoi' in this file; found 'AI 1/acc",
        "channel 'acc_carriage_x'.signal: 0001_dewetron.csv: no signal 'AI 2/acc_x'",
        "channel 'p_breech'.unit: the rig says 'bar', 0001_dewetron.csv says 'MPa'",
        "channel 'x_camera'.signal: 0001_camera.csv: no signal 'Feature #7 - X'",
        "notes.txt: no reader recognises this file's content",
        "source 'imu': none of the files is of this serial source",
    )
    assert len(told) == len(expected)
    for text in expected:
        assert any(line.startswith(text) for line in told), text


def test_two_files_of_one_source_and_a_cut_file_are_told_too(
    run, rig: Path, mixed_shot: TwinShot, tmp_path: Path
) -> None:
    recorder = next(file for file in mixed_shot.files if "dewetron" in file.name)
    again, bus = tmp_path / "again_dewetron.csv", tmp_path / "0001_can.blf"
    again.write_bytes(recorder.read_bytes())
    whole = next(file for file in mixed_shot.files if file.suffix == ".blf").read_bytes()
    bus.write_bytes(whole[: len(whole) // 2])
    others = [file for file in mixed_shot.files if "can" not in file.name]
    told = faults(run, rig, *others, again, bus)
    assert told[0] == "again_dewetron.csv: source 'dewetron' already has 0001_dewetron.csv; give one file per source"
    assert told[1].startswith("0001_can.blf: ")
    assert len(told) == 2


def test_what_is_unusual_is_a_warning(run, rig: Path) -> None:
    change(rig, ("phi10 = 0.02", "phi10 = 0.5"))
    result = run("check", rig)
    assert result.exit_code == 0
    assert "warning: mechanism.phi10: 0.5 rad is unusual; most lie between -0.3 and 0.3" in result.stdout.splitlines()
    assert [one["key"] for one in json.loads(run("check", rig, "--json").stdout)["warnings"]] == ["mechanism.phi10"]


def test_files_and_devices_are_checked_apart(run) -> None:
    assert run("check", "mixed", "a.csv", "--devices").exit_code == 2
