"""The same recording is one shot, whatever its files and its shot file are called."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from recoil_acquisition.channel import Step
from recoil_acquisition.shot.recorded_file import RecordedFile, doubles
from recoil_acquisition.shot.shot import InputFile
from recoil_acquisition.store import read_shot, recorded_files, write_shot
from recoil_acquisition.store.shot_log import ShotLog
from recoil_daq import ingest_folder, load_rig
from recoil_daq.recording.doubles import made_of
from recoil_daq.reports.identify_folder import identify_folder
from recoil_rigs.twin import TwinShot
from tests.builders.campaigns import ring_campaign


def files_of(shot: TwinShot, folder: Path, number: str = "0001") -> list[Path]:
    """Copy a shot's files under another number."""
    folder.mkdir(parents=True, exist_ok=True)
    return [Path(shutil.copy(file, folder / file.name.replace("0001", number))) for file in shot.files]


def of_another_shot(file: Path) -> Path:
    """Change the last digit of a file, so that it is another one."""
    content = file.read_bytes().rstrip()
    file.write_bytes(content[:-1] + (b"1" if content[-1:] != b"1" else b"2") + b"\n")
    return file


@pytest.fixture
def day(field_shot: TwinShot, tmp_path: Path) -> tuple[list[Path], Path]:
    """A shot's files, and the folder that they were ingested into as a folder of shots."""
    files = files_of(field_shot, tmp_path / "day")
    done = ingest_folder(load_rig("field-2013"), tmp_path / "day", out=tmp_path / "shots", workers=1)
    assert [one.shot for one in done.shots] == ["0001"]
    return files, tmp_path / "shots"


@pytest.mark.whole_way
def test_files_that_were_ingested_as_a_folder_are_not_another_shot(run, day: tuple[list[Path], Path]) -> None:
    files, out = day
    before = (out / "0001.h5").read_bytes()
    for more in ((), ("--shot", "0007"), ("--shot", "0007", "--overwrite")):
        result = run("ingest", "field-2013", *files, "--out", out, *more)
        assert result.exit_code == 3, result.output
        assert f"error: these files are in {out / '0001.h5'} already; found 0001_dewetron.csv, 0001_camera.csv" in (
            result.stderr
        )
        assert "--shot 0001 --overwrite" in result.stderr
    assert [path.name for path in out.glob("*.h5")] == ["0001.h5"]
    assert (out / "0001.h5").read_bytes() == before
    assert [row.shot for row in ShotLog.read(out / "shotlog.csv").rows] == ["0001"]


@pytest.mark.whole_way
def test_its_own_shot_file_is_made_anew_and_another_folder_is_no_matter(run, day: tuple[list[Path], Path]) -> None:
    files, out = day
    assert run("ingest", "field-2013", *files, "--out", out, "--overwrite").exit_code == 0
    assert run("ingest", "field-2013", *files, "--out", out / "probe", "--shot", "probe").exit_code == 0


@pytest.mark.whole_way
def test_a_shot_is_named_by_the_number_that_all_its_files_share(run, field_shot: TwinShot, tmp_path: Path) -> None:
    out = tmp_path / "shots"
    assert run("ingest", "field-2013", *files_of(field_shot, tmp_path, "7"), "--out", out).exit_code == 0
    recorder, camera = (of_another_shot(file) for file in files_of(field_shot, tmp_path, "0008"))
    other = camera.rename(tmp_path / "0009_camera.csv")
    assert run("ingest", "field-2013", recorder, other, "--out", out).exit_code == 0
    assert [path.name for path in sorted(out.glob("*.h5"))] == ["0007.h5", "0008_dewetron.h5"]


@pytest.mark.whole_way
def test_a_file_of_another_shot_under_a_neutral_name_is_refused(
    run, day: tuple[list[Path], Path], field_shot: TwinShot, tmp_path: Path
) -> None:
    files, out = day
    recorder = of_another_shot(files_of(field_shot, tmp_path / "next", "0002")[0])
    camera = Path(shutil.copy(files[1], tmp_path / "next" / "track_camera.csv"))
    result = run("ingest", "field-2013", recorder, camera, "--shot", "0002", "--out", out, "--json")
    assert result.exit_code == 3, result.output
    said = f"track_camera.csv is in {out / '0001.h5'} already: shot 0001 was made of it; give this shot's own"
    assert said in json.loads(result.stdout)["message"]
    assert not (out / "0002.h5").exists()
    of_another_shot(camera)
    assert run("ingest", "field-2013", recorder, camera, "--shot", "0002", "--out", out).exit_code == 0


@pytest.mark.whole_way
def test_of_a_folder_the_second_shot_with_a_file_is_the_one_that_fails(
    run, field_shot: TwinShot, tmp_path: Path
) -> None:
    folder, out = tmp_path / "day", tmp_path / "shots"
    files_of(field_shot, folder)
    files_of(field_shot, folder, "0002")
    of_another_shot(files_of(field_shot, folder, "0003")[0])
    result = run("ingest", "field-2013", folder, "--batch", "--out", out, "--workers", 1, "--json")
    assert result.exit_code == 3
    first, second, third = json.loads(result.stdout)["shots"]
    assert (first["state"], first["error"]) == ("usable", None)
    assert second["error"].startswith(f"these files are in {out / '0001.h5'} already")
    assert third["error"].startswith(f"0003_camera.csv is in {out / '0001.h5'} already")
    assert [path.name for path in out.glob("*.h5")] == ["0001.h5"]


@pytest.mark.whole_way
def test_a_folder_that_is_ingested_again_knows_the_shots_that_are_there(run, day: tuple[list[Path], Path]) -> None:
    files, out = day
    (out / "0001.h5").rename(out / "first.h5")
    result = run("ingest", "field-2013", files[0].parent, "--batch", "--out", out, "--workers", 1)
    assert result.exit_code == 3
    assert f"these files are in {out / 'first.h5'} already" in result.output.replace("\n", " ")


@pytest.mark.whole_way
def test_what_is_recovered_twice_is_the_shot_file_that_was_made_of_it(day: tuple[list[Path], Path]) -> None:
    files, out = day
    assert made_of(files[0], out) == out / "0001.h5"
    assert made_of(of_another_shot(files[0]), out) is None


@pytest.fixture(scope="module")
def doubled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three shots of one rig, the first of them under two names, and a second with a file of the first."""
    folder, fired = tmp_path_factory.mktemp("doubled"), ring_campaign().fired
    for file in fired.files[:3]:
        shutil.copy(file, folder)
    shutil.copy(fired.log, folder)
    first, third = read_shot(fired.files[0]), read_shot(fired.files[2])
    write_shot(replace(first, name="0001_dewetron"), folder / "0001_dewetron.h5")
    mixed = tuple(
        own if own.source != "camera" else other for own, other in zip(third.inputs, first.inputs, strict=True)
    )
    write_shot(replace(third, name="0007", inputs=mixed), folder / "0007.h5")
    return folder


@pytest.mark.whole_way
def test_identify_sets_doubles_of_a_folder_aside_and_says_so(run, doubled: Path, tmp_path: Path) -> None:
    result = run("identify", doubled, "--out", tmp_path, "--workers", 1)
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_dir()) == ["0001", "0002", "0003"]
    output = " ".join(result.output.split())
    assert f"{doubled / '0001_dewetron.h5'}: it is made of the same recorded files as {doubled / '0001.h5'}" in output
    assert f"{doubled / '0007.h5'}: 0001_camera.csv of it is of {doubled / '0001.h5'} too" in output


@pytest.mark.whole_way
def test_a_double_that_is_named_itself_is_identified(run, doubled: Path, tmp_path: Path) -> None:
    named = [doubled / "0001_dewetron.h5", doubled / "0001.h5"]
    result = run("identify", *named, "--out", tmp_path, "--workers", 1, "--json")
    document = json.loads(result.stdout)
    assert [one["shot"] for one in document["reports"]] == ["0001_dewetron", "0001"]
    assert document["set_aside"] == []


@pytest.mark.whole_way
def test_python_is_told_what_is_set_aside(doubled: Path, tmp_path: Path) -> None:
    told: list[str] = []
    found = identify_folder(doubled, out=tmp_path, workers=1, progress=told.append)
    assert [one.shot for one in found] == ["0001", "0002", "0003"]
    assert len([one for one in told if "is set aside" in one]) == 2


@pytest.mark.whole_way
def test_a_campaign_counts_a_recording_once_by_shot_files_and_by_reports(run, doubled: Path, tmp_path: Path) -> None:
    once = tmp_path / "once"
    once.mkdir()
    for name in ("0001.h5", "0002.h5", "0003.h5", "shotlog.csv"):
        shutil.copy(doubled / name, once)
    clean = run("campaign", once, "--out", tmp_path / "clean", "--workers", 1, "--json")
    result = run("campaign", doubled, "--out", tmp_path / "campaign", "--workers", 1, "--json")
    document = json.loads(result.stdout)
    assert document["mass"] == json.loads(clean.stdout)["mass"]
    assert [(one["shot"], one["of"], one["files"]) for one in document["set_aside"]] == [
        ("0001_dewetron", "0001", ["0001_dewetron.csv", "0001_camera.csv"]),
        ("0007", "0001", ["0001_camera.csv"]),
    ]
    assert [one["shot"] for one in document["shots"]] == ["0001", "0002", "0003"]
    assert any("0001_dewetron.h5 is set aside: it is made of the same" in note for note in document["notes"])
    page = (tmp_path / "campaign" / "campaign.html").read_text(encoding="utf-8")
    assert "0001_dewetron.h5 is set aside" in page
    reports = tmp_path / "reports"
    for path in [*sorted(doubled.glob("*.h5"))]:
        run("identify", path, "--out", reports, "--cutoff-hz", 300, "--workers", 1)
    by_reports = run("campaign", reports, "--out", tmp_path / "by-reports", "--json")
    assert by_reports.exit_code in (0, 1), by_reports.output
    assert [one["shot"] for one in json.loads(by_reports.stdout)["set_aside"]] == ["0001_dewetron", "0007"]


def test_a_campaign_of_one_shot_under_two_names_is_too_few(run, doubled: Path, tmp_path: Path) -> None:
    result = run("campaign", doubled / "0001.h5", doubled / "0001_dewetron.h5", "--out", tmp_path / "campaign")
    assert result.exit_code == 3
    assert "at least two shots" in result.stderr
    assert "0001_dewetron.h5 is set aside: it is made of the same recorded files as 0001" in result.stderr
    assert not (tmp_path / "campaign").exists()


def test_two_parts_of_a_long_recording_are_two_shots() -> None:
    whole = InputFile("hour.csv", "ab" * 32, 10**9, "recorder", "text")
    camera = InputFile("camera.csv", "cd" * 32, 10**6, "camera", "text")

    def part(start_s: float, stop_s: float, *inputs: InputFile) -> tuple[RecordedFile, ...]:
        spans = {"excerpts": {"recorder": {"start_s": start_s, "stop_s": stop_s}}}
        return RecordedFile.of_shot((whole, *inputs), (Step("ingest", "1", spans),))

    assert doubles([("1", part(10.0, 11.0)), ("2", part(60.0, 61.0)), ("3", part(11.0, 12.0))]) == {}
    assert set(doubles([("1", part(10.0, 11.0)), ("2", part(10.5, 11.5)), ("3", part(60.0, 61.0))])) == {1}
    assert set(doubles([("1", part(10.0, 11.0)), ("2", RecordedFile.of_shot((whole,), ()))])) == {1}
    (double,) = doubles([("1", part(10.0, 11.0, camera)), ("2", part(60.0, 61.0, camera))]).values()
    assert (double.of, double.files, double.whole) == ("1", ("camera.csv",), False)


def test_what_a_shot_file_was_made_of_is_read_alone(stored: Path) -> None:
    shot = read_shot(stored)
    assert [(one.name, one.sha256, one.size) for one in recorded_files(stored)] == [
        (one.name, one.sha256, one.size) for one in shot.inputs
    ]
