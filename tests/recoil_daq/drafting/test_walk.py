"""From the files of a stand that no rig explains to a valid mass: how much somebody has to type."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from recoil_daq.drafting.init import draft_rig
from recoil_rigs.twin import TwinShot
from tests.builders.filled_drafts import WEIGHT, filled, mechanism_of, write_certificates
from tests.builders.real_records import EMPS_COULOMB_N, EMPS_KG, EMPS_VISCOUS_N_S_M
from tests.builders.shared_data import shared_file

MOST_TYPED = 12
"""Values beside certificates and mechanism that anybody may have to type."""
FIELDS = {"gyro_carriage": "f32_at_8", "gyro_tipping": "f32_at_12", "acc_x": "f32_at_16"}
"""Fields of the inertial sensor's frames, by their places: nothing in the bytes has their names."""
TYPED = {
    "knowledge": WEIGHT,
    "acc_recoil": {"position": [-0.30, 0.06]},
    "acc_carriage_x": {"position": [0.05, -0.10]},
    "acc_carriage_y": {"position": [0.05, -0.10]},
    "imu_f32_at_8": {"unit": "rad/s", "role": "carriage_rate"},
    "imu_f32_at_12": {"unit": "rad/s", "role": "tipping_rate", "polarity": 1},
}


MET = {
    ("check", "assumption", None),
    ("ingest", "reader", "camera"), ("ingest", "reader", "can"), ("ingest", "reader", "imu"),
    ("ingest", "pictures", "camera"), ("ingest", "missing frames", "imu"), ("ingest", "stream", "imu"),
    ("ingest", "baseline", "imu_f32_at_8"),
    ("identify", "pictures", "camera"), ("identify", "missing frames", "imu"), ("identify", "stream", "imu"),
    ("identify", "baseline", "imu_f32_at_8"), ("identify", "not identified", None),
}  # fmt: skip
"""Messages on the way, by command, code and what they are about: of what the virtual instruments lose, and nothing of
the rig file."""

MET_ON_A_LINE = {
    ("check", "assumption", None),
    ("ingest", "reader", "recorder"),
    ("identify", "filter", None), ("identify", "motion noise", "shot"), ("identify", "not identified", None),
    ("identify", "sensor", "skew of acceleration and force"), ("ingest", "skew", "qm"), ("identify", "skew", "qm"),
}  # fmt: skip
"""The same of a real drive, whose force jumps, whose motion is noisier than its rest, and whose encoder is half a
millisecond late; nothing of the rig file."""


def count(typed: dict) -> int:
    return sum(len(values) for values in typed.values())


@pytest.fixture
def stand(mixed_shot: TwinShot, tmp_path: Path) -> Path:
    """Return a folder with a shot's four files, the bus's database and the certificates, and no rig."""
    for file in (*mixed_shot.files, mixed_shot.rig_file.with_name("mixed.dbc")):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    write_certificates("mixed", tmp_path, FIELDS)
    return tmp_path


def files(folder: Path) -> list[str]:
    return sorted(str(one) for one in folder.glob("0001_*"))


@pytest.mark.indispensable("init")
def test_four_files_become_a_valid_mass_with_a_dozen_values(run, stand: Path, monkeypatch) -> None:
    monkeypatch.chdir(stand)
    recorded = [Path(one).name for one in files(stand)]
    done = run("init", *recorded, "--database", "mixed.dbc", "--sensors", "sensors.csv", "--json")
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert [note.partition(":")[0] for note in document["notes"]] == [
        "0001_can.blf",
        "0001_imu.rdlog",
        "0001_imu.rdlog",
    ]
    assert document["differences"] == []
    refused = run("check", "rig.toml", "--json")
    assert refused.exit_code == 3
    asked = [one["key"] for one in json.loads(refused.stdout)["faults"]]
    assert asked == [one["key"] for one in document["open"]]
    assert len(asked) == count({"mechanism": mechanism_of("mixed"), **TYPED})
    text = (stand / "rig.toml").read_text(encoding="utf-8")
    typed = {"mechanism": mechanism_of("mixed"), **TYPED}
    (stand / "rig.toml").write_text(filled(text, typed), encoding="utf-8")
    assert count(TYPED) <= MOST_TYPED
    checked = run("check", "rig.toml", *recorded, "--json")
    assert checked.exit_code == 0, checked.output
    met = {("check", one["code"], None) for one in json.loads(checked.stdout)["findings"]}
    ingested = json.loads(run("ingest", "rig.toml", *recorded, "--json").stdout)
    assert ingested["usable"], ingested["findings"]
    met |= {("ingest", one["code"], one["about"]) for one in ingested["findings"]}
    identified = run("identify", "shots", "--workers", "1")
    assert identified.exit_code == 0, identified.output
    report = json.loads((stand / "reports" / "0001" / "report.json").read_text(encoding="utf-8"))
    met |= {("identify", one["code"], one["about"]) for one in report["findings"]}
    assert abs(report["mass"]["value"] - 782.0) < 3 * report["mass"]["u"]
    assert met == MET


@pytest.mark.whole_way
def test_the_draft_is_the_same_whatever_the_order_of_the_files(stand: Path) -> None:
    given = {"databases": [stand / "mixed.dbc"], "out": stand / "rig.toml"}
    one, other = (draft_rig(order, **given).roles.by_signal for order in (files(stand), files(stand)[::-1]))
    assert one == other


@pytest.mark.whole_way
def test_a_record_of_one_body_on_a_line_becomes_a_valid_mass(run, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("drive_0001.mat").write_bytes(shared_file("real/emps/DATA_EMPS.mat").read_bytes())
    Path("sensors.csv").write_text(
        "serial;model;signal;quantity;unit;sensitivity;sensitivity_unit;range_low;range_high;U_percent;k;zero_percent;"
        "distortion_mm\n"
        "D1;drive;vir;force;N;0,02844950;V/N;-351;351;2;2;1;\n"
        "E1;encoder;qm;displacement;m;;;;;0,02;2;;0,001\n",
        encoding="utf-8",
    )
    done = run("init", "drive_0001.mat", "--sensors", "sensors.csv", "--json")
    assert done.exit_code == 0, done.output
    # the file states no unit: what its certificates say is proposed, and what moves is one body on a line
    document = json.loads(done.stdout)
    assert document["model"] == "line"
    proposals = {one["key"]: one["proposal"] for one in document["open"]}
    wanted = {"'vir'.unit": "V", "'vir'.role": "driving_force", "'qm'.unit": "m", "'qm'.role": "recoil_displacement"}
    assert {key.partition(" ")[2]: one for key, one in proposals.items() if key.partition(" ")[2] in wanted} == wanted
    rig = Path("rig.toml")
    units = {"vir": {"unit": "V"}, "qm": {"unit": "m"}}
    roles = {"vir": {"role": "driving_force"}, "qm": {"role": "recoil_displacement"}}
    mechanism = {"m3": 95.1, "phi20": 0.0, "friction": EMPS_COULOMB_N, "u_friction": 5.1}
    typed = {"mechanism": mechanism, **{name: {**units[name], **roles[name]} for name in units}}
    text = filled(rig.read_text(encoding="utf-8"), typed)
    # viscous friction is none until somebody states it
    viscous = f"slide_friction = {EMPS_VISCOUS_N_S_M}\nu_slide_friction = {EMPS_VISCOUS_N_S_M / 4}\n"
    rig.write_text(text.replace("u_friction = 5.1\n", f"u_friction = 5.1\n{viscous}"), encoding="utf-8")
    assert count(units) + count(roles) <= MOST_TYPED
    checked = run("check", "rig.toml", "drive_0001.mat", "--json")
    assert checked.exit_code == 0, checked.output
    met = {("check", one["code"], None) for one in json.loads(checked.stdout)["findings"]}
    ingested = json.loads(run("ingest", "rig.toml", "drive_0001.mat", "--json").stdout)
    assert ingested["usable"]
    met |= {("ingest", one["code"], one["about"]) for one in ingested["findings"]}
    identified = run("identify", "shots", "--workers", "1")
    assert identified.exit_code == 0, identified.output
    report = json.loads(Path("reports/0001/report.json").read_text(encoding="utf-8"))
    met |= {("identify", one["code"], one["about"]) for one in report["findings"]}
    assert met == MET_ON_A_LINE
    mass = report["mass"]
    assert mass["U95"][0] < EMPS_KG < mass["U95"][1]
