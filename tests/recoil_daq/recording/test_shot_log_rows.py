"""The shot log at work: rows that `ingest` adds, cells that `log` sets, and what `identify` makes of them."""

import json
import math
import shutil
from pathlib import Path

import pytest

from recoil_acquisition.errors import StoreError
from recoil_acquisition.store.shot_log import ShotLog
from recoil_daq import identify_file, ingest_files, load_rig
from recoil_daq.recording.shot_log_rows import add_row, as_fired, log_row
from recoil_daq.reports.stored_shot import read_stored
from recoil_rigs.rig import parse_rig
from recoil_rigs.twin import TwinShot
from tests.builders.page_elements import PageElements
from tests.builders.saved_logs import saved

HEADER = "shot,time,configuration,added_mass_kg,u_added_mass_kg,charge,charge_temperature_c,elevation_deg,exclude,notes"


@pytest.fixture
def shots(stored: Path, tmp_path: Path) -> Path:
    """A folder with one shot and its log, to be changed."""
    folder = tmp_path / "shots"
    folder.mkdir()
    for file in (stored, stored.parent / "shotlog.csv"):
        shutil.copy(file, folder)
    return folder


def written(folder: Path, text: str) -> Path:
    return saved(folder / "shotlog.csv", text)


def test_ingest_adds_the_shots_row(stored: Path) -> None:
    assert (stored.parent / "shotlog.csv").read_text(encoding="utf-8") == f"{HEADER}\n0001,,,,,,,,,\n"


def test_ingest_fills_an_empty_time_and_leaves_every_other_cell(tmp_path: Path) -> None:
    text = "shot;time;Mannschaft;notes\r\n1;;B;früher\r\n2;gestern;;\r\n"
    log = written(tmp_path, text)
    (tmp_path / "0001.h5").touch()
    (tmp_path / "0002.h5").touch()
    for shot in ("0001", "0002"):
        assert add_row(tmp_path / f"{shot}.h5", shot, "2026-11-20T09:12:44+01:00") == ""
    assert log.read_bytes().decode() == text.replace("1;;", "1;2026-11-20T09:12:44+01:00;")


def test_ingest_adds_no_row_of_another_shot(tmp_path: Path) -> None:
    for name in ("0001.h5", "0002.h5", "0003.h5"):
        (tmp_path / name).touch()
    log = written(tmp_path, "shot,notes\n3,planned\n")
    assert add_row(tmp_path / "0002.h5", "0002", "2026-11-20") == ""
    assert log.read_text(encoding="utf-8") == "shot,notes\n3,planned\n0002,\n"


def test_a_log_that_is_open_in_a_spreadsheet_is_left_and_named(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "0001.h5").touch()
    log = written(tmp_path, "shot,notes\n")

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")  # as Windows says

    with monkeypatch.context() as patch:
        patch.setattr("recoil_acquisition.store.shared_file._name", refuse)
        said = add_row(tmp_path / "0001.h5", "0001", "2026-11-20")
    assert said == (
        f"the row of shot 0001 is not added: {log}: cannot be written: Permission denied; close it in other programs, "
        "or give permission there"
    )
    assert not [path for path in tmp_path.iterdir() if path.name.endswith(".partial")]
    assert log.read_text(encoding="utf-8") == "shot,notes\n"
    assert add_row(tmp_path / "0001.h5", "0001", "") == ""
    assert log.read_text(encoding="utf-8") == "shot,notes\n0001,\n"


@pytest.mark.whole_way
def test_a_faulty_log_keeps_no_shot_from_being_written(run, field_shot: TwinShot, tmp_path: Path) -> None:
    text = "shot,added_mass_kg\n0001,heavy\n"
    log = written(tmp_path, text)
    result = run("ingest", "field-2013", *field_shot.files, "--shot", "0001", "--out", tmp_path)
    assert result.exit_code == 0
    said = "shot log: the row of shot 0001 is not added: "
    assert [line for line in result.output.splitlines() if line.startswith(said)] == [
        f"{said}{log}: line 2, column added_mass_kg: no number; expected a number, or nothing, found 'heavy'"
    ]
    assert log.read_text(encoding="utf-8") == text
    assert (tmp_path / "0001.h5").exists()
    result = run("identify", "--verbose", tmp_path / "0001.h5", "--out", tmp_path / "reports")
    assert result.exit_code == 3
    assert "line 2, column added_mass_kg: no number" in result.output
    assert not (tmp_path / "reports").exists()


@pytest.mark.whole_way
def test_a_shot_that_was_planned_is_checked_with_its_added_mass(field_shot: TwinShot, tmp_path: Path) -> None:
    written(tmp_path, "shot,added_mass_kg,u_added_mass_kg\n1,250,\n")
    done = ingest_files(load_rig("field-2013"), field_shot.files, shot="0001", out=tmp_path)
    assert done.log_fault == ""
    impulse = next(one for one in done.shot.quality if one.check == "impulse")
    assert (impulse.verdict, "1032 kg" in impulse.detail) == ("fail", True)
    assert any(one["quantity"] == "added mass" for one in done.to_json()["assumptions"])
    # it was fired without that mass after all
    written(tmp_path, "shot,added_mass_kg,u_added_mass_kg\n1,,\n")
    assert read_stored(done.path).shot.usable
    assert read_stored(done.path).rig.mechanism.m3 == 782.0


@pytest.mark.whole_way
def test_a_plan_that_leaves_no_recoiling_part_is_named(field_shot: TwinShot, tmp_path: Path) -> None:
    written(tmp_path, "shot,added_mass_kg\n0001,-782\n")
    done = ingest_files(load_rig("field-2013"), field_shot.files, shot="0001", out=tmp_path)
    assert done.log_fault.startswith("what it says of shot 0001 is not used: ")
    assert "782 kg with -782 kg added, as the shot log has it, are no mass" in done.log_fault


def test_log_shows_and_sets_cells(run, shots: Path) -> None:
    result = run("log", "0001", "configuration=ring", "added_mass_kg=120,5", "--dir", shots)
    assert result.exit_code == 0
    lines = [line.split() for line in result.output.splitlines()]
    assert ["configuration", "ring", "(empty)"] in lines
    assert ["added_mass_kg", "120.5", "(empty)"] in lines
    assert "taken as exact: added mass, 120.5 kg: no u_added_mass_kg is stated" in result.output
    assert (shots / "shotlog.csv").read_text(encoding="utf-8") == f"{HEADER}\n0001,,ring,120.5,,,,,,\n"
    document = json.loads(run("log", shots / "0001.h5", "--json").stdout)
    assert document["row"] == {"shot": "0001", "configuration": "ring", "added_mass_kg": 120.5}
    assert (document["schema"], document["before"]) == ("recoil-daq/log/1", {})
    document = json.loads(run("log", "0001", "configuration=", "added_mass_kg=0", "--dir", shots, "--json").stdout)
    assert document["before"] == {"configuration": "ring", "added_mass_kg": "120.5"}
    shown = [line.split() for line in run("log", "0001", "--dir", shots).output.splitlines()]
    assert ["configuration"] in shown
    assert ["added_mass_kg", "0"] in shown


def test_log_doubts_an_added_mass_whose_sign_may_be_wrong(run, shots: Path) -> None:
    result = run("log", "0001", "added_mass_kg=-120", "--dir", shots)
    doubt = "added_mass_kg -120 says that 120 kg were taken off the recoiling part; if they were added, it is 120"
    assert (result.exit_code, f"doubtful: {doubt}" in result.output) == (0, True)
    assert json.loads(run("log", "0001", "--dir", shots, "--json").stdout)["doubts"] == [doubt]


def test_log_asks_somebody_whether_a_doubtful_cell_is_meant(shots: Path) -> None:
    asked: list[str] = []

    def no(doubts) -> bool:
        asked.extend(doubts)
        return False

    before = (shots / "shotlog.csv").read_bytes()
    with pytest.raises(StoreError, match="nothing is set; correct what is in doubt"):
        log_row("0001", {"added_mass_kg": "-120"}, folder=shots, sure=no)
    assert asked[0].startswith("added_mass_kg -120 says that 120 kg were taken off")
    assert (shots / "shotlog.csv").read_bytes() == before
    log_row("0001", {"added_mass_kg": "120"}, folder=shots, sure=no)


def test_log_adds_a_column_only_if_asked_to(run, shots: Path) -> None:
    before = (shots / "shotlog.csv").read_bytes()
    result = run("log", "0001", "charge_temprature_c=21", "--dir", shots)
    assert result.exit_code == 3
    assert "has no column 'charge_temprature_c'; found charge_temperature_c, " in result.output
    assert (shots / "shotlog.csv").read_bytes() == before
    assert run("log", "0001", "crew=B", "--new-column", "--dir", shots).exit_code == 0
    assert run("log", "0001", "crew=A; C", "--dir", shots).exit_code == 0
    assert ShotLog.beside(shots / "0001.h5").rows[0].own == {"crew": "A; C"}


def test_log_adds_a_column_with_a_meaning_that_somebody_took_away(run, shots: Path) -> None:
    written(shots, "shot;notes\r\n1;a\r\n")
    assert run("log", "0001", "added_mass_kg=12.5", "--dir", shots).exit_code == 0
    assert (shots / "shotlog.csv").read_bytes() == b"shot;notes;added_mass_kg\r\n1;a;12,5\r\n"


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("0001", "ring"), 2, "'ring' is not KEY=VALUE"),
        (("0001", "notes=a", "notes=b"), 2, "notes is given twice"),
        (("0001", "elevation_deg=steep"), 3, "shot 0001, column elevation_deg: no number"),
        (("0001", "shot=0002"), 3, "'shot' is no column whose cell can be set"),
        (("0002",), 3, "no shot '0002' in this folder, and no row of it in the shot log; found 0001"),
    ],
)
def test_log_refuses_what_it_cannot_set(run, shots: Path, words, code, said) -> None:
    before = (shots / "shotlog.csv").read_bytes()
    result = run("log", *words, "--dir", shots)
    assert result.exit_code == code
    assert said in " ".join(result.output.replace("│", " ").split())
    assert (shots / "shotlog.csv").read_bytes() == before


@pytest.mark.whole_way
def test_the_specification_is_what_was_fired(run, shots: Path, identified, tmp_path: Path) -> None:
    written(shots, "shot;configuration;added_mass_kg;u_added_mass_kg;exclude;crew\r\n1;ring;-12,5;0,3;warm-up;B\r\n")
    result = run("identify", "--verbose", shots / "0001.h5", "--out", tmp_path)
    document = json.loads((tmp_path / "0001" / "report.json").read_text(encoding="utf-8"))
    plain = identified.report
    assert document["shot_log"] == {
        "shot": "0001", "configuration": "ring", "added_mass_kg": -12.5, "u_added_mass_kg": 0.3, "exclude": "warm-up",
        "crew": "B",
    }  # fmt: skip
    assert plain["shot_log"] == {"shot": "0001"}
    # the specification moves, the mass as fired does not: neither the report's nor the campaign's
    assert document["mass"]["specification"] == plain["mass"]["specification"] - 12.5
    assert document["mass"]["value"] == pytest.approx(plain["mass"]["value"], rel=1e-5)
    # the mass is the mean over what no rig states
    averaged = math.log1p(document["campaign"]["averaged_rel"])
    of_reference = document["campaign"]["reference"][0] + averaged
    assert of_reference == pytest.approx(math.log(document["mass"]["value"]), abs=1e-9)
    assert document["campaign"]["reference"][0] == pytest.approx(plain["campaign"]["reference"][0], abs=1e-5)
    expanded = 2 * math.hypot(document["mass"]["u"], 0.3)
    assert document["E_n"] == pytest.approx((document["mass"]["value"] - 769.5) / expanded)
    assert "excluded in the shot log: warm-up" in document["notes"]
    doubt = "added_mass_kg -12.5 says that 12.5 kg were taken off the recoiling part; if they were added, it is 12.5"
    assert f"the shot log of shot 0001: {doubt}" in document["notes"]
    assert any("769.5 kg times the largest velocity" in one["detail"] for one in document["quality"])
    (log,) = (one for one in document["provenance"]["inputs"] if one["source"] == "shot log")
    assert (log["file"], log["sha256"]) == ("shotlog.csv", ShotLog.beside(shots / "0001.h5").sha256)
    assert "configuration: ring; added mass, in the specification: −12.5 kg (u 0.3 kg)" in result.output
    assert "note: excluded in the shot log: warm-up" in result.output
    page = PageElements((tmp_path / "0001" / "report.html").read_text(encoding="utf-8")).text
    assert "added mass, in the specification" in page
    assert "excluded in the shot log: warm-up" in page


@pytest.mark.whole_way
def test_an_added_mass_that_is_taken_as_exact_is_an_assumption(shots: Path, tmp_path: Path) -> None:
    written(shots, "shot,added_mass_kg\n0001,0.5\n")
    report = identify_file(shots / "0001.h5", out=tmp_path)
    assert report.document["assumptions"][0] == {
        "quantity": "added mass",
        "taken": "taken as exact",
        "detail": "the shot log has no u_added_mass_kg: 0.5 kg are taken as added",
    }
    assert "taken as exact: added mass, " in str(report)


def test_a_log_without_the_shots_row_is_a_note(shots: Path) -> None:
    written(shots, "shot,added_mass_kg\n01,5\n")
    fired = read_stored(shots / "0001.h5")
    assert fired.rig.mechanism.m3 == 782.0
    (note,) = fired.notes
    assert note == (
        "shotlog.csv has no row of shot 0001: nothing is taken as added to the recoiling part; its rows 01 are of no "
        "shot here"
    )
    (shots / "shotlog.csv").unlink()
    fired = read_stored(shots / "0001.h5")
    assert (fired.notes, fired.row, fired.log_file) == ((), None, None)


@pytest.mark.whole_way
def test_targets_take_the_specification_as_fired(run, shots: Path, tmp_path: Path) -> None:
    written(shots, "shot,added_mass_kg,u_added_mass_kg\n0001,10,0.1\n")
    assert run("identify", shots / "0001.h5", "--target", "breech-force", "--out", tmp_path).exit_code in (0, 1)
    document = json.loads((tmp_path / "0001" / "breech-force.json").read_text(encoding="utf-8"))
    assert "the specification mass of 792 kg" in json.dumps(document)
    assert document["shot_log"]["added_mass_kg"] == 10.0
    assert "shot log" in [one["source"] for one in document["provenance"]["inputs"]]
    assert any("specification is taken as uncertain by the added mass alone" in note for note in document["notes"])


def test_the_muzzle_velocity_of_a_shot_is_what_the_log_has_of_it(shots: Path) -> None:
    """A rig without a projectile keeps it as a column; one with a projectile compares with it."""
    written(shots, "shot,muzzle_velocity_m_s,u_muzzle_velocity_m_s\n0001,655.5,0.7\n")
    fired = read_stored(shots / "0001.h5")
    assert fired.row is not None
    assert fired.row.to_json() == {"shot": "0001", "muzzle_velocity_m_s": 655.5, "u_muzzle_velocity_m_s": 0.7}
    assert fired.rig.knowledge.projectile is None
    stated = "[knowledge.projectile]\nmass_kg = 15.0\nmuzzle_velocity_m_s = 640.0\nu_muzzle_velocity_m_s = 4.0\n"
    rig = parse_rig(fired.rig.text.replace("[twin]", f"{stated}\n[twin]"), fired.rig.path)
    projectile = as_fired(rig, fired.row).knowledge.projectile
    assert projectile is not None
    assert (projectile.impulse_n_s, projectile.u_rel) == (15.0 * 655.5, pytest.approx(0.7 / 655.5))
