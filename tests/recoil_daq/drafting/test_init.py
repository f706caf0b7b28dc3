"""The draft of a rig file: what is taken from files, certificates and another rig, and what is asked."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest
import typer

from recoil_acquisition.errors import RigError
from recoil_acquisition.files.bounded_toml import toml_value
from recoil_acquisition.store import write_shot
from recoil_daq.drafting.draft import file_pattern
from recoil_daq.drafting.init import draft_rig
from recoil_daq.drafting.rig_draft import Entry, Question, RigDraft, Table
from recoil_rigs.rig import Rig, find_rig, load_rig, parse_rig
from recoil_rigs.tables.rig_tables import RedundantAlignment
from recoil_rigs.twin import TwinShot
from tests.builders.digital_certificates import CERTIFICATE as DIGITAL
from tests.builders.digital_certificates import laboratory
from tests.builders.filled_drafts import WEIGHT, filled, mechanism_of, write_certificates
from tests.builders.shared_data import shared_file
from tests.builders.shots import make_shot

MAT_HEAD = b"MATLAB 5.0 MAT-file, made by nobody".ljust(124) + b"\0\x01IM" + b"\x0e\0\0\0\xff\xff\0\0"
"""Head of a MATLAB file, and of a variable that is cut off."""
CERTIFICATE = "serial,signal,quantity,unit,sensitivity,sensitivity_unit,range_low,range_high,U_percent,k,calibrated,due"


def channel(text: str, signal: str) -> dict:
    return next(row for row in tomllib.loads(text)["channel"] if row["signal"] == signal)


def recorder_of(fired: TwinShot) -> Path:
    return next(file for file in fired.files if "dewetron" in file.name)


@pytest.fixture
def recorded(field_shot: TwinShot, tmp_path: Path) -> list[Path]:
    copies = [tmp_path / file.name for file in field_shot.files]
    for copy, file in zip(copies, field_shot.files, strict=True):
        copy.write_bytes(file.read_bytes())
    return copies


@pytest.mark.whole_way
def test_nothing_is_overwritten(run, recorded: list[Path], tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("somebody's own", encoding="utf-8")
    refused = run("init", *recorded, "--out", rig)
    assert refused.exit_code == 3
    assert "exists already" in refused.output
    assert rig.read_text(encoding="utf-8") == "somebody's own"
    assert run("init", *recorded, "--out", rig, "--overwrite").exit_code == 0
    assert "schema" in rig.read_text(encoding="utf-8")
    assert [one.name for one in tmp_path.iterdir() if ".partial" in one.name] == []


@pytest.mark.whole_way
def test_a_shot_file_among_recorded_ones_is_left_out_with_the_command_that_takes_it(
    run, recorded: list[Path], tmp_path: Path
) -> None:
    shot = tmp_path / "0001.h5"
    write_shot(make_shot(), shot)
    document = json.loads(run("init", shot, *recorded, "--out", tmp_path / "rig.toml", "--json").stdout)
    (left_out,) = document["left_out"]
    assert left_out["file"] == "0001.h5"
    assert "`recoil-daq identify SHOTS...` takes it" in left_out["text"]
    alone = json.loads(run("init", *recorded, "--out", tmp_path / "other.toml", "--json").stdout)
    assert document["channels"] == alone["channels"]
    assert (document["open"], document["stated"]) == (alone["open"], alone["stated"])
    assert "0001.h5" not in (tmp_path / "rig.toml").read_text("utf-8")
    refused = run("init", shot, "--out", tmp_path / "third.toml")
    assert refused.exit_code == 3
    assert "`recoil-daq identify SHOTS...` takes it" in " ".join(refused.output.split())


def test_the_document_has_what_the_file_has(run, recorded: list[Path], tmp_path: Path) -> None:
    document = json.loads(run("init", *recorded, "--out", tmp_path / "rig.toml", "--json").stdout)
    with pytest.raises(RigError) as refused:
        load_rig(tmp_path / "rig.toml")
    assert document["schema"] == "recoil-daq/init/1"
    assert [one["key"] for one in document["open"]] == [fault.key for fault in refused.value.faults]
    assert document["stated"] == refused.value.stated
    assert {one["role"] for one in document["roles"]} == {one["role"] for one in document["channels"] if one["role"]}
    assert document["model"] == "gun"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("notes.xyz", b"\x01\x02nothing of ours" * 9, "no reader recognises"),
        ("a.raw", b"|CF,2,1,1;|CK,1,3,1,1;", "this is an imc FAMOS file, which is not read; export it as MATLAB"),
        ("cut.mat", MAT_HEAD + bytes(9), "cut.mat"),
    ],
    ids=["unknown", "foreign", "damaged"],
)
def test_one_file_that_cannot_be_read_leaves_the_others_drafted(
    run, recorded: list[Path], tmp_path: Path, name: str, content: bytes, said: str
) -> None:
    (tmp_path / name).write_bytes(content)
    drafted = run("init", *recorded, tmp_path / name, "--out", tmp_path / "rig.toml")
    assert drafted.exit_code == 0, drafted.output
    (line,) = [one for one in drafted.stdout.splitlines() if one.startswith("left out: ")]
    assert name in line
    assert said in line
    text = (tmp_path / "rig.toml").read_text(encoding="utf-8")
    assert f"# TODO source of {name}, which is left out: " in text
    assert len(tomllib.loads(text)["source"]) == len(recorded)
    # alone, nothing is drafted and its own error is the answer
    alone = run("init", tmp_path / name, "--out", tmp_path / "alone.toml")
    assert alone.exit_code == 3
    assert name in alone.output
    assert not (tmp_path / "alone.toml").exists()


@pytest.mark.whole_way
def test_what_is_no_file_of_one_shot_is_said(run, recorded: list[Path], tmp_path: Path) -> None:
    table = write_certificates("field-2013", tmp_path, {})
    for words, text in (
        ((recorded[0], recorded[0]), "is given twice"),
        ((recorded[0], table), "name it behind --sensors"),
        ((recorded[0], find_rig("field-2013")), "behind --from"),
        ((find_rig("mixed").with_suffix(".dbc"),), "no recorded file is given"),
        ((recorded[0], "--sensors", tmp_path / "none.csv"), "no such file"),
        ((recorded[0], tmp_path / "none.csv"), "no such file"),
    ):
        refused = run("init", *words, "--out", tmp_path / "rig.toml")
        assert (refused.exit_code, text in refused.output) == (3, True), refused.output
    second = recorded[0].with_name(recorded[0].name.replace("0001", "0002"))
    second.write_bytes(recorded[0].read_bytes())
    assert any("differ in a number alone" in note for note in draft_rig([recorded[0], second]).notes)


def test_a_terminal_is_asked_and_enter_takes_what_is_proposed(
    run, recorded: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("recoil_daq.terminal.session.Session.asks", True)
    answers = iter(["782.0", "", "1500", "."])
    monkeypatch.setattr("typer.prompt", lambda *_, **more: next(answers) or more["default"])
    asked = run("init", *recorded, "--out", tmp_path / "rig.toml")
    assert asked.exit_code == 0, asked.output
    mechanism = tomllib.loads((tmp_path / "rig.toml").read_text(encoding="utf-8"))["mechanism"]
    assert (mechanism["m3"], mechanism["friction"]) == (782.0, 1500)
    assert mechanism["phi20"].startswith("TODO angle")
    assert mechanism["XA"].startswith("TODO ")


def test_the_weighed_mass_and_how_the_breech_gauge_was_calibrated_are_asked_for(
    run, recorded: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drafted = draft_rig(recorded, out=tmp_path / "rig.toml").to_json()
    asked = {one["key"]: one["proposal"] for one in drafted["open"]}
    assert {"knowledge.weighed_mass_kg", "knowledge.u_weighed_mass_kg"} <= asked.keys()
    assert {key[-25:]: one for key, one in asked.items() if key.endswith("calibration")} == {
        "'p_breech'.sensor.calibration"[-25:]: "static"
    }
    monkeypatch.setattr("recoil_daq.terminal.session.Session.asks", True)
    key = ""

    def typed(_: str, **more: str) -> str:
        answers = {"knowledge.weighed_mass_kg": "310,5 kg", "knowledge.u_weighed_mass_kg": "50 g"}
        return answers.get(key, more["default"])

    def echo(text: str = "", **_: object) -> None:
        nonlocal key
        key = next(iter(re.findall(r"^\[\d+ of \d+\] (.*?): ", str(text))), key)

    monkeypatch.setattr("typer.prompt", typed)
    monkeypatch.setattr("typer.echo", echo)
    assert run("init", *recorded, "--out", tmp_path / "rig.toml").exit_code == 0
    tables = tomllib.loads((tmp_path / "rig.toml").read_text(encoding="utf-8"))
    assert tables["knowledge"] == {"weighed_mass_kg": 310.5, "u_weighed_mass_kg": 0.05}
    (gauge,) = [one for one in tables["channel"] if one.get("role") == "breech_pressure"]
    assert gauge["sensor"]["calibration"] == "static"  # what is proposed is taken


def test_a_mass_that_nobody_has_is_left_out_and_is_not_asked_for_again(recorded: list[Path], tmp_path: Path) -> None:
    first = draft_rig(recorded, out=tmp_path / "rig.toml")
    answers = {one.parts: one.question.read("-") for one in first.draft.questions() if one.parts[0] == "knowledge"}
    text = first.with_answers(answers).draft.text()
    assert "weighed_mass_kg" not in text
    again = {True: first.draft.text(), False: text}
    for is_asked, of in again.items():
        other = tmp_path / f"{is_asked}.toml"
        other.write_text(of, encoding="utf-8")
        second = draft_rig(recorded, other=other, out=tmp_path / "rig.toml")
        assert any(one.parts[0] == "knowledge" for one in second.draft.questions()) is is_asked


def test_whoever_is_asked_may_end_it(
    run, recorded: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def aborted(*_: object, **__: object) -> str:
        raise typer.Abort

    monkeypatch.setattr("recoil_daq.terminal.session.Session.asks", True)
    monkeypatch.setattr("typer.prompt", aborted)
    assert run("init", *recorded, "--out", tmp_path / "rig.toml").exit_code == 130
    assert not (tmp_path / "rig.toml").exists()


def recorded_in_volts(field_shot: TwinShot, folder: Path) -> Path:
    """The recorder's file with the breech pressure as the volts of its sensor, 40 mV/MPa."""
    head, *rows = recorder_of(field_shot).read_text(encoding="utf-8").splitlines()
    columns = head.split(",")
    at = next(k for k, cell in enumerate(columns) if "p_breech" in cell)
    columns[at] = "AI 6/breech (V)"
    lines = [",".join(columns)]
    for row in rows:
        cells = row.split(",")
        cells[at] = f"{0.040 * float(cells[at]):.6f}"
        lines.append(",".join(cells))
    path = folder / "0001_daq.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_volts_are_what_their_certificate_says(field_shot: TwinShot, tmp_path: Path) -> None:
    recorded_in_volts(field_shot, tmp_path)
    row = "V301,AI 6/breech,pressure,MPa,40,mV/MPa,0,250,1,2,2026-03-01,2027-03-01"
    (tmp_path / "sensors.csv").write_text(f"{CERTIFICATE}\n{row}\n", encoding="utf-8")
    drafted = draft_rig([tmp_path / "0001_daq.csv"], sensors=tmp_path / "sensors.csv", out=tmp_path / "rig.toml")
    found = channel(drafted.draft.text(), "AI 6/breech")
    assert (found["quantity"], found["unit"], found["role"]) == ("pressure", "V", "breech_pressure")
    assert found["sensor"]["sensitivity"] == "40 mV/MPa"
    assert found["sensor"]["range"] == [0.0, 250.0]


@pytest.mark.whole_way
def test_digital_certificates_fill_the_sensors_of_the_table(run, field_shot: TwinShot, tmp_path: Path) -> None:
    recorded, digital, table = recorded_in_volts(field_shot, tmp_path), tmp_path / "v301.xml", tmp_path / "sensors.csv"
    digital.write_text(DIGITAL, encoding="utf-8")
    table.write_text("serial,signal,unit,range_low,range_high,dcc\nV301,AI 6/breech,MPa,0,250,v301.xml\n", "utf-8")
    done = run("init", recorded, digital, "--sensors", table, "--out", tmp_path / "rig.toml")
    assert done.exit_code == 0, done.output
    assert "D-K-15055-2026-04711 is not signed" in " ".join(done.output.split())
    sensor = channel((tmp_path / "rig.toml").read_text(encoding="utf-8"), "AI 6/breech")["sensor"]
    assert (sensor["sensitivity"], sensor["U_rel"], sensor["k"]) == ("40.2 mV/MPa", 0.01, 2.5)
    assert sensor["range"] == [0.0, 250.0]
    assert (sensor["certificate"], sensor["serial"]) == ("D-K-15055-2026-04711", "V301")
    digital.write_bytes(laboratory().signed().replace(b"40.2<", b"41.2<"))
    refused = run("init", recorded, "--sensors", digital, "--out", tmp_path / "other.toml")
    assert (refused.exit_code, (tmp_path / "other.toml").exists()) == (3, False)
    assert "it was changed after it was signed" in refused.output


def test_without_certificates_nothing_of_a_sensor_is_invented(recorded: list[Path]) -> None:
    drafted = draft_rig(recorded)
    rows = [row for row in tomllib.loads(drafted.draft.text())["channel"] if "role" in row]
    assert len(rows) == 9
    for row in rows:
        assert all(str(value).startswith("TODO ") for value in row["sensor"].values())
        assert {"serial", "u_rel"} <= row["sensor"].keys()


@pytest.mark.whole_way
def test_an_overdue_certificate_is_a_fault_of_check(run, mixed_shot: TwinShot, tmp_path: Path) -> None:
    fields = {"gyro_carriage": "f32_at_8", "gyro_tipping": "f32_at_12", "acc_x": "f32_at_16"}
    table = write_certificates("mixed", tmp_path, fields)
    table.write_text(table.read_text(encoding="utf-8").replace("2099-12-31", "2026-02-01", 1), encoding="utf-8")
    database = mixed_shot.rig_file.with_name("mixed.dbc")
    drafted = draft_rig(mixed_shot.files, databases=[database], sensors=table, out=tmp_path / "rig.toml")
    places = {"position": [0.0, 0.0]}
    typed = {
        "mechanism": mechanism_of("mixed"), "knowledge": WEIGHT,
        "acc_recoil": places, "acc_carriage_x": places, "acc_carriage_y": places,
        "imu_f32_at_8": {"unit": "rad/s", "role": "carriage_rate"},
        "imu_f32_at_12": {"unit": "rad/s", "role": "tipping_rate", "polarity": 1},
    }  # fmt: skip
    (tmp_path / "rig.toml").write_text(filled(drafted.draft.text(), typed), encoding="utf-8")
    refused = run("check", tmp_path / "rig.toml")
    assert refused.exit_code == 3
    assert "'acc_recoil'.sensor.due: calibration was due 2026-02-01" in refused.output


@pytest.mark.whole_way
def test_another_rig_is_taken_over_whole(mixed_shot: TwinShot, tmp_path: Path) -> None:
    rig = mixed_shot.rig_file
    drafted = draft_rig(mixed_shot.files, other=rig, out=tmp_path / "rig.toml")
    assert drafted.differences == ()
    assert drafted.draft.questions() == ()
    made, was = _parsed(drafted.draft.text(), rig, tmp_path), load_rig(rig)
    assert made.mechanism == was.mechanism
    assert {one.name: one for one in made.channels} == {one.name: one for one in was.channels}
    assert {one.name: one.align for one in made.sources} == {one.name: one.align for one in was.sources}
    assert made.trigger == was.trigger


def _parsed(text: str, rig: Path, folder: Path) -> Rig:
    name = next(row["database"] for row in tomllib.loads(text)["source"] if "database" in row)
    return parse_rig(text, folder / "rig.toml", {name: rig.with_name("mixed.dbc").read_text(encoding="utf-8")})


@pytest.mark.whole_way
def test_what_a_finished_rig_leaves_out_is_not_asked_for(field_shot: TwinShot, tmp_path: Path) -> None:
    text = find_rig("field-2013").read_text(encoding="utf-8").replace("u_friction = 150.0", "")
    other = tmp_path / "old.toml"
    other.write_text(text.replace(", range = [-5000.0, 5000.0]", ""), encoding="utf-8")
    assert draft_rig(field_shot.files, other=other, out=tmp_path / "rig.toml").draft.questions() == ()
    # a value that it leaves open is asked for again
    other.write_text(text.replace("range = [-5000.0, 5000.0]", 'range = "TODO"', 1), encoding="utf-8")
    (one,) = draft_rig(field_shot.files, other=other, out=tmp_path / "rig.toml").draft.questions()
    assert one.parts[1:] == ("sensor", "range")


def test_names_that_a_file_made_up_do_not_leave_their_place(tmp_path: Path) -> None:
    hostile = "AI '1' \\ #]\u202e\x1b[31m"
    rows = "".join(f"{k / 1e4:.4f},{9.0 * (k > 500):.1f},{2.0 * (k > 500):.1f}\n" for k in range(1000))
    (tmp_path / "a.csv").write_text(f"Time (s),{hostile} (m/s2),b (\u200fbar)\n{rows}", encoding="utf-8")
    drafted = draft_rig([tmp_path / "a.csv"], out=tmp_path / "rig.toml")
    text = drafted.draft.text()
    assert "\x1b" not in text
    assert "\u202e" not in text
    assert tomllib.loads(text)["source"][0]["name"] == "recorder"
    signals = {signal.name for source in drafted.sources for signal in source.signals}
    quoted = {toml_value(name) for name in signals}
    assert all(f"signal = {name}" in text for name in quoted)
    assert {tomllib.loads(f"x = {name}")["x"] for name in quoted} == signals


def test_a_table_of_text_gets_the_layout_that_it_seems_to_have(tmp_path: Path) -> None:
    rows = "".join(f"{k};{9.0 * (k > 500):.1f};{2.0 * (k > 500):.1f}\n" for k in range(1000))
    (tmp_path / "0001_daq.txt").write_text(f"made by hand\nn;acc;p\n-;m/s2;bar\n{rows}", encoding="utf-8")
    drafted = draft_rig([tmp_path / "0001_daq.txt"], out=tmp_path / "rig.toml")
    (source,) = tomllib.loads(drafted.draft.text())["source"]
    layout = {"separator": ";", "header_row": 2, "unit_row": 3, "first_row": 4}
    assert {key: source["layout"][key] for key in layout} == layout
    assert source["layout"]["rate_hz"].startswith("TODO samples per second")
    (tmp_path / "rig.toml").write_text(filled(drafted.draft.text(), {"recorder": {"rate_hz": 1e4}}), encoding="utf-8")
    again = draft_rig([tmp_path / "0001_daq.txt"], other=tmp_path / "rig.toml", out=tmp_path / "new.toml")
    assert again.sources[0].signals[1].rate_hz == 1e4
    assert [one.unit for one in again.sources[0].signals][1:] == ["m/s2", "bar"]


@pytest.mark.whole_way
def test_what_differs_from_another_rig_is_said(mixed_shot: TwinShot, tmp_path: Path) -> None:
    text = mixed_shot.rig_file.read_text(encoding="utf-8")
    for old, new in (
        ('signal = "AI 4/p_breech"', 'signal = "AI 9/p_breech"'),
        ('signal = "AI 2/acc_carriage_x"\nquantity = "acceleration"\nunit = "m/s2"',
         'signal = "AI 2/acc_carriage_x"\nquantity = "acceleration"\nunit = "g"'),
        ('role = "brake_pressure"', 'role = "other"'),
        ('role = "recuperator_pressure"', 'role = "brake_pressure"'),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new, 1)
    other = tmp_path / "old.toml"
    other.write_text(text, encoding="utf-8")
    (tmp_path / "mixed.dbc").write_bytes(mixed_shot.rig_file.with_name("mixed.dbc").read_bytes())
    found = "\n".join(draft_rig(mixed_shot.files[:3], other=other, out=tmp_path / "rig.toml").differences)
    given = {file.name for file in mixed_shot.files[:3]}
    assert ("has a source 'camera', of which no file is given" in found) == all("camera" not in one for one in given)
    assert "a channel 'p_breech' of the signal 'AI 9/p_breech', which the file of 'dewetron' does not have" in found
    assert "'AI 4/p_breech' is new" in found
    assert "acc_carriage_x: old.toml says 'g', the file 'm/s2'" in found
    assert "p_recuperator: old.toml says brake_pressure, but" in found


@pytest.mark.whole_way
def test_an_unfinished_draft_goes_on(recorded: list[Path], tmp_path: Path) -> None:
    first = draft_rig(recorded, out=tmp_path / "rig.toml")
    started = filled(first.draft.text(), {"mechanism": {"m3": 782.0}, "p_brake": {"serial": "V302"}})
    (tmp_path / "rig.toml").write_text(started, encoding="utf-8")
    row = "V302,,pressure,MPa,,,-1.6,16,0.8,2,2026-03-01,2027-03-01"
    (tmp_path / "sensors.csv").write_text(f"{CERTIFICATE}\n{row}\n", encoding="utf-8")
    second = draft_rig(
        recorded, other=tmp_path / "rig.toml", sensors=tmp_path / "sensors.csv", out=tmp_path / "rig.toml"
    )
    assert len(second.draft.questions()) == len(first.draft.questions()) - 4
    sensor = channel(second.draft.text(), "AI 7/p_brake")["sensor"]
    assert (sensor["U_rel"], sensor["k"], "u_rel" in sensor) == (0.008, 2.0, False)


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("name", "framing"),
    [
        ("mip_data.bin", {"ready_made": "microstrain-mip"}),
        ("output1.bin", {"ready_made": "xsens-mti", "precision": "f32"}),
        ("vn100_F00379.bin", {"ready_made": "vectornav-vn100-binary", "header": "FA 14 3E 00 3A 00"}),
        ("generated/witmotion_8_dropped_bytes.bin", {"ready_made": "witmotion"}),
        ("generated/vn100_ascii_VNIMU.txt", {"ready_made": "vectornav-vn100-ascii"}),
        ("generated/cobs_crc16_u32_6f.bin", {"kind": "cobs"}),
    ],
)
def test_bytes_of_a_port_get_the_framing_that_fits_them(name: str, framing: dict) -> None:
    (source,) = tomllib.loads(draft_rig([shared_file(f"serial/{name}")]).draft.text())["source"]
    assert {key: source["framing"].get(key) for key in framing} == framing
    asked = {key for key, value in source["framing"].items() if str(value).startswith("TODO ")}
    assert asked <= {"rate_hz", "fields"}


@pytest.mark.whole_way
def test_a_twin_that_is_mounted_the_other_way_round_is_turned(mixed_shot: TwinShot, tmp_path: Path) -> None:
    head, *rows = recorder_of(mixed_shot).read_text(encoding="utf-8").splitlines()
    at = next(k for k, cell in enumerate(head.split(",")) if "acc_carriage_x" in cell)
    lines = [head]
    for row in rows:
        cells = row.split(",")
        cells[at] = f"{-float(cells[at]):.6f}"
        lines.append(",".join(cells))
    (tmp_path / "0001_dewetron.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    others = [file for file in mixed_shot.files if "dewetron" not in file.name]
    text = draft_rig([tmp_path / "0001_dewetron.csv", *others], out=tmp_path / "rig.toml").draft.text()
    assert channel(text, "AI 2/acc_carriage_x")["polarity"] == -1
    # the inertial sensor, which hangs as it did, repeats it upside down
    assert channel(text, "f32_at_16")["polarity"] == 1
    imu = next(row for row in tomllib.loads(text)["source"] if row["name"] == "imu")
    assert imu["align"] == {"method": "redundant", "channel": "imu_f32_at_16", "against": "acc_carriage_x"}


def test_a_bus_without_its_database_and_a_camera_without_times_are_asked_for(
    mixed_shot: TwinShot, tmp_path: Path
) -> None:
    camera = next(file for file in mixed_shot.files if "camera" in file.name)
    rows = [line.split(",") for line in camera.read_text(encoding="utf-8").splitlines()]
    (tmp_path / "0001_camera.csv").write_text(
        "\n".join(",".join([row[0], *row[2:]]) for row in rows) + "\n", encoding="utf-8"
    )
    bus = next(file for file in mixed_shot.files if "can" in file.name)
    drafted = draft_rig([recorder_of(mixed_shot), bus, tmp_path / "0001_camera.csv"], out=tmp_path / "rig.toml")
    keys = {str(one.parts[-1]): one.question.meaning for one in drafted.draft.questions() if len(one.parts) == 2}
    assert "0x120" in keys["database"]
    assert "has no times" in keys["frame_rate"]
    (tmp_path / "rig.toml").write_text(drafted.draft.text(), encoding="utf-8")
    with pytest.raises(RigError) as refused:
        load_rig(tmp_path / "rig.toml")
    assert refused.value.open == len(refused.value.faults)


@pytest.mark.parametrize(
    ("name", "others", "pattern"),
    [
        ("0001_daq.csv", ["0001_can.blf"], "{shot}_daq.csv"),
        ("shot_0017_daq.csv", ["bus_17.blf"], "shot_{shot}_daq.csv"),
        ("2026-11-26_0003_daq.csv", ["cam_0003.csv"], "*_{shot}_daq.csv"),
        ("DATA.mat", ["cam.csv"], "*.mat"),
        ("a.csv", ["b.csv"], "a.csv"),
        ("run_12.csv", [], "run_{shot}.csv"),
        ("Bus1_0001.log", ["Messung_0001.csv"], "Bus1_{shot}.log"),
        ("bus_1_0001.log", ["daq_0001.csv"], "bus_1_{shot}.log"),
    ],
)
def test_the_pattern_of_a_file_has_the_shots_number_as_a_place(name: str, others: list[str], pattern: str) -> None:
    assert file_pattern(Path(name), [Path(name), *map(Path, others)]) == pattern


def test_the_text_of_a_draft_reads_back() -> None:
    values = {
        "a": 1.5e-9, "b": 'a "text" with \\ and \u00fc\n', "c": [1, 2.5], "d": True, "e": {"f": "x", "g h": [1]},
        "h": [{"at": 1}, {"at": 2, "name": "n"}],
    }  # fmt: skip
    draft = RigDraft((Table("", tuple(Entry(key, value, "why # and how") for key, value in values.items())),))
    assert tomllib.loads(draft.text()) == values
    for value in values.values():
        assert tomllib.loads(f"x = {toml_value(value)}")["x"] == value


def test_answers_take_the_places_of_questions() -> None:
    inner = Table("[channel.sensor]", (Entry("serial", Question("number")),))
    draft = RigDraft(
        (
            Table("[mechanism]", (Entry("m3", Question("mass, kg")),)),
            Table("[[channel]]", (Entry("name", "a"),), tables=(inner,)),
            Table("[[channel]]", (Entry("name", "b"),), tables=(inner,), left_out=True),
            Table("[[channel]]", (Entry("name", "c"), Entry("role", Question("which", "trigger"))), tables=(inner,)),
        )
    )
    keys = [one.parts for one in draft.questions()]
    assert [str(key[-1]) for key in keys] == ["m3", "serial", "role", "serial"]
    answered = draft.answered(dict(zip(keys, (782.0, "S1", "trigger", "S2"), strict=True)))
    tables = tomllib.loads(answered.text())
    assert tables["mechanism"] == {"m3": 782.0}
    assert [row["sensor"]["serial"] for row in tables["channel"]] == ["S1", "S2"]
    assert draft.answered({}).text() == draft.text()


def test_a_bundled_rig_is_not_changed_by_a_draft(recorded: list[Path]) -> None:
    before = find_rig("field-2013").read_bytes()
    draft_rig(recorded, other=find_rig("field-2013"))
    assert find_rig("field-2013").read_bytes() == before


@pytest.mark.whole_way
def test_the_repeat_of_a_bus_is_its_clock(mixed_shot: TwinShot, tmp_path: Path) -> None:
    text = mixed_shot.rig_file.read_text(encoding="utf-8")
    assert 'against = "acc_recoil"' in text
    drafted = draft_rig(
        mixed_shot.files, databases=[mixed_shot.rig_file.with_name("mixed.dbc")], out=tmp_path / "rig.toml"
    )
    rows = {row["name"]: row.get("align", {}) for row in tomllib.loads(drafted.draft.text())["source"]}
    assert rows["can"] == RedundantAlignment(
        method="redundant", channel="acc_recoil_can", against="acc_recoil"
    ).model_dump(exclude_defaults=True)
    assert rows["camera"] == {"method": "motion", "against": "acc_recoil"}
