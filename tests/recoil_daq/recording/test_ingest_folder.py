"""A folder of many shots' files: each file goes to its shot, or is named; a bad shot keeps no other from its file."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.store import read_shot
from recoil_acquisition.store.shot_log import ShotLog
from recoil_daq.recording import ingest_folder as shot_folder
from recoil_daq.recording.ingest_folder import IngestedFolder, ingest_folder
from recoil_rigs.rig import Rig, find_rig, load_rig, parse_rig
from recoil_rigs.twin import TwinShot

RIG = load_rig("field-2013")


@pytest.fixture
def no_ingest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only sort the files: no shot file is made."""

    def ingest_files(_: Rig, files: Sequence[Path], *, shot: str, out: Path, **__: Any) -> SimpleNamespace:
        return SimpleNamespace(
            path=out / f"{shot}.h5", shot=SimpleNamespace(started=""), log_fault="", files=files,
            to_json=lambda: {"usable": True, "reasons": [], "quality": []},
        )  # fmt: skip

    monkeypatch.setattr(shot_folder, "ingest_files", ingest_files)
    monkeypatch.setattr(shot_folder, "add_row", lambda *_: "")


def placed(shot: TwinShot, folder: Path, *names: str) -> None:
    """Copy a shot's two files, each as the names say whose ending it has."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (file,) = [one for one in shot.files if one.name.split("_")[-1] == name.split("_")[-1]]
        shutil.copy(file, folder / name)


def of_other_shots(folder: Path, *numbers: int) -> None:
    """Make the files of shots others than those that they are copies of: the last digit of each is another one."""
    for number in numbers:
        for file in folder.glob(f"{number}_*.csv"):
            file.write_bytes(file.read_bytes().rstrip()[:-1] + str(number + 3).encode() + b"\n")


def sorted_of(folder: Path, tmp_path: Path, rig: Rig = RIG) -> tuple[dict[str, list[str]], IngestedFolder]:
    done = ingest_folder(rig, folder, out=tmp_path / "out", workers=1)
    return {one.shot: [file.name for file in one.files] for one in done.shots}, done


@pytest.mark.usefixtures("no_ingest")
def test_files_go_to_the_shot_whose_number_they_bear(field_shot: TwinShot, tmp_path: Path) -> None:
    folder = tmp_path / "day"
    placed(field_shot, folder, "7_dewetron.csv", "0007_camera.csv", "2026-11-20_0012_camera.csv", "12_dewetron.csv")
    (folder / "notes_7.txt").write_text("it rained")
    placed(field_shot, folder, "last_camera.csv")
    shots, done = sorted_of(folder, tmp_path)
    assert shots == {
        "0007": ["0007_camera.csv", "7_dewetron.csv"],
        "0012": ["12_dewetron.csv", "2026-11-20_0012_camera.csv"],
    }
    assert {path.name: why.split(",")[0] for path, why in done.left_alone.items()} == {
        "last_camera.csv": "no number of a shot in its name",
        "notes_7.txt": "no reader recognises this file's content",
    }


@pytest.mark.usefixtures("no_ingest")
def test_a_folder_a_shot_is_as_simulate_writes_them(field_shot: TwinShot, tmp_path: Path) -> None:
    folder = tmp_path / "simulated"
    placed(field_shot, folder, "0001/0001_dewetron.csv", "0001/0001_camera.csv", "proof-A/some_dewetron.csv")
    placed(field_shot, folder, "1_camera.csv", "0001/deeper/x_camera.csv")
    (folder / "0001" / "truth.json").write_text("{}")
    # rig files are no instrument's, also where they are copies or of another name
    for name in ("0001/rig.toml", "as-fired.toml"):
        (folder / name).write_text('schema = "recoil-daq/rig/1"\n', encoding="utf-8")
    (folder / "0009").mkdir()
    (folder / ".hidden").mkdir()
    shots, done = sorted_of(folder, tmp_path)
    assert shots == {
        # what lies beside the folders may be of a shot that has one: two files of a camera are that shot's fault
        "0001": ["1_camera.csv", "0001_camera.csv", "0001_dewetron.csv"],
        "proof-A": ["some_dewetron.csv"],
    }
    assert {path.name for path in done.left_alone} == {"truth.json", "0009", "deeper"}


@pytest.mark.usefixtures("no_ingest")
def test_a_file_of_two_shots_is_a_fault_of_both(field_shot: TwinShot, tmp_path: Path) -> None:
    folder = tmp_path / "day"
    placed(field_shot, folder, "1_dewetron.csv", "2_dewetron.csv", "1_2_camera.csv", "3_dewetron.csv")
    _, done = sorted_of(folder, tmp_path)
    assert [(one.shot, one.state) for one in done.shots] == [
        ("0001", "failed"), ("0002", "failed"), ("0003", "usable"),
    ]  # fmt: skip
    assert "1_2_camera.csv: by its name this file is of the shots 0001 and 0002" in str(done.shots[0].error)
    (found,) = done.to_json()["shots"][0]["findings"]
    assert (found["code"], found["about"], found["severity"]) == ("read", "1_2_camera.csv", "fatal")


@pytest.mark.usefixtures("no_ingest")
def test_the_pattern_of_a_source_says_where_the_number_stands(field_shot: TwinShot, tmp_path: Path) -> None:
    path = find_rig("field-2013")
    text = path.read_text("utf-8").replace('match = "*_camera.csv"', 'match = "*_{shot}_camera.csv"')
    rig = parse_rig(text, path)
    folder = tmp_path / "day"
    placed(field_shot, folder, "1_dewetron.csv", "2_1_camera.csv", "2/2_2_camera.csv", "3/9_2_camera.csv")
    shots, done = sorted_of(folder, tmp_path, rig)
    assert shots == {
        "0001": ["1_dewetron.csv", "2_1_camera.csv"],
        "2": ["2_2_camera.csv", "9_2_camera.csv"],
        "3": ["9_2_camera.csv"],
    }
    assert [one.state for one in done.shots] == ["usable", "failed", "failed"]
    assert "of the shots 2 and 3" in str(done.shots[2].error)


@pytest.mark.usefixtures("no_ingest")
def test_a_damaged_file_that_a_source_claims_is_the_shot_s_fault(field_shot: TwinShot, tmp_path: Path) -> None:
    folder = tmp_path / "day"
    placed(field_shot, folder, "1_dewetron.csv")
    (folder / "1_camera.csv").write_bytes(b"")
    _, done = sorted_of(folder, tmp_path)
    assert [one.state for one in done.shots] == ["failed"]
    assert "1_camera.csv" in str(done.shots[0].error)


def test_a_folder_without_a_shot_or_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="no file of a shot of rig 'field-2013' in this folder; expected dewetron"):
        ingest_folder(RIG, tmp_path)
    with pytest.raises(ReadError, match="cannot be read: No such file"):
        ingest_folder(RIG, tmp_path / "none")


@pytest.mark.whole_way
def test_batch_goes_on_past_a_bad_shot_and_lists_it(run, field_shot: TwinShot, tmp_path: Path) -> None:
    folder, out = tmp_path / "day", tmp_path / "day" / "shots"
    placed(field_shot, folder, *(f"{k}_{kind}.csv" for k in (1, 2, 3) for kind in ("dewetron", "camera")))
    of_other_shots(folder, 2, 3)
    cut = (folder / "2_dewetron.csv").read_bytes()
    (folder / "2_dewetron.csv").write_bytes(cut[: len(cut) // 50])
    result = run("ingest", "field-2013", folder, "--batch", "--out", out, "--workers", 2)
    assert result.exit_code == 3, result.output
    assert result.output.splitlines()[-1].startswith("FAILED 0002: ")
    assert sorted(path.name for path in out.glob("*.h5")) == ["0001.h5", "0003.h5"]
    assert read_shot(out / "0003.h5").name == "0003"
    log = (out / "shotlog.csv").read_text("utf-8").splitlines()
    assert [line.split(",")[0] for line in log] == ["shot", "0001", "0003"]
    # as it is there: refused, and nothing is changed, by whichever executor
    again = run("ingest", "field-2013", folder, "--batch", "--out", out, "--workers", 1, "--json")
    document = json.loads(again.stdout)
    assert (again.exit_code, document["schema"]) == (3, "recoil-daq/ingest-folder/1")
    assert [one["state"] for one in document["shots"]] == ["failed"] * 3
    assert "these files are in" in document["shots"][0]["error"]
    with ThreadPoolExecutor(1) as threads:
        done = ingest_folder(RIG, folder, out=out, executor=threads)
    assert ["already" in str(one.error) for one in done.shots] == [True, False, True]
    assert str(done).splitlines()[-1].startswith("FAILED 0003")
    assert repr(done) == "IngestedFolder(3 shots, 3 failed)"


def logged_day(shot: TwinShot, folder: Path, rows: str) -> None:
    """Write two shots' files, and a shot log beside them."""
    placed(shot, folder, *(f"{k}_{kind}.csv" for k in (1, 2) for kind in ("dewetron", "camera")))
    of_other_shots(folder, 2)
    (folder / "shotlog.csv").write_text(rows, encoding="utf-8")


@pytest.mark.usefixtures("no_ingest")
def test_rows_of_a_log_beside_the_files_are_taken_where_a_shot_has_none(field_shot: TwinShot, tmp_path: Path) -> None:
    folder, out = tmp_path / "day", tmp_path / "out"
    logged_day(
        field_shot, folder,
        "shot;configuration;added_mass_kg;u_added_mass_kg;powder\n1;bare;;;\n2;ring;120,5;0,05;K7\n9;misfire;;;\n",
    )  # fmt: skip
    _, done = sorted_of(folder, tmp_path)
    log = ShotLog.read(out / "shotlog.csv", ["0001", "0002"])
    assert [row.shot for row in log.rows] == ["0001", "0002"]
    row = log.row("0002")
    assert row is not None
    assert (row.configuration, row.added_mass_kg, row.u_added_mass_kg, dict(row.own)) == (
        "ring", 120.5, 0.05, {"powder": "K7"},
    )  # fmt: skip
    assert done.to_json()["shot_log"] == {"file": str(folder / "shotlog.csv"), "taken": ["0001", "0002"], "kept": {}}
    before = (out / "shotlog.csv").read_bytes()
    _, again = sorted_of(folder, tmp_path)
    assert again.to_json()["shot_log"]["taken"] == []
    assert (out / "shotlog.csv").read_bytes() == before


@pytest.mark.usefixtures("no_ingest")
def test_a_row_that_people_wrote_stays_as_it_is_and_what_the_other_log_has_is_said(
    field_shot: TwinShot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = tmp_path / "day", tmp_path / "out"
    logged_day(field_shot, folder, "shot,configuration,added_mass_kg\n0001,bare,\n0002,ring,120\n")
    out.mkdir()
    own = "shot,configuration,added_mass_kg\n0002,ring,118\n0007,,\n"
    (out / "shotlog.csv").write_text(own, encoding="utf-8")
    _, done = sorted_of(folder, tmp_path)
    assert (out / "shotlog.csv").read_text(encoding="utf-8") == own + "0001,bare,\n"
    assert done.to_json()["shot_log"]["kept"] == {"0002": {"added_mass_kg": 120.0}}
    done.show()
    said = " ".join(capsys.readouterr().out.split())
    assert "row 0001 is taken from" in said
    assert "the row of 0002 stays as it is" in said
    assert "has added_mass_kg 120.0" in said


@pytest.mark.usefixtures("no_ingest")
def test_a_log_beside_the_files_that_is_at_fault_is_refused_and_the_folders_own_is_no_other(
    field_shot: TwinShot, tmp_path: Path
) -> None:
    folder = tmp_path / "day"
    logged_day(field_shot, folder, "shot,added_mass_kg\n0001,many\n")
    with pytest.raises(ReadError, match=r"shotlog\.csv"):
        sorted_of(folder, tmp_path)
    assert not (tmp_path / "out").exists()
    (folder / "shotlog.csv").write_text("shot,added_mass_kg\n0001,120\n")
    assert ingest_folder(RIG, folder, out=folder, workers=1).rows is None


@pytest.mark.whole_way
def test_the_added_mass_of_a_log_beside_the_files_counts_at_once(run, field_shot: TwinShot, tmp_path: Path) -> None:
    folder = tmp_path / "day"
    placed(field_shot, folder, "2_dewetron.csv", "2_camera.csv")
    (folder / "shotlog.csv").write_text("shot,added_mass_kg,u_added_mass_kg\n0002,120,0.05\n", encoding="utf-8")
    result = run("ingest", "field-2013", folder, "--batch", "--out", tmp_path / "out", "--workers", 1)
    assert f"shot log: row 0002 is taken from {folder / 'shotlog.csv'}" in result.output.replace("\n", " ")
    (step,) = [step for step in read_shot(tmp_path / "out" / "0002.h5").history if step.what == "ingest"]
    assert step.parameters["added_mass_kg"] == 120.0
    row = ShotLog.read(tmp_path / "out" / "shotlog.csv").row("0002")
    assert row is not None
    assert (row.added_mass_kg, row.u_added_mass_kg) == (120.0, 0.05)


def test_batch_says_what_goes_with_it(run) -> None:
    for words in (("a", "b", "--batch"), ("a", "--batch", "--shot", "1"), ("a", "--workers", "2")):
        assert run("ingest", "field-2013", *words).exit_code == 2
    assert run("ingest", "field-2013", "--live", "--batch").exit_code == 2
