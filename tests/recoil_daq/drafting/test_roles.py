"""Roles by name and shot: right without names, none on files that are of no mechanism, asked where both disagree."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import RecoilDaqError
from recoil_daq.drafting import recorded_source
from recoil_daq.drafting.init import DraftedRig, draft_rig
from recoil_daq.drafting.role_proposal import polarity_of
from recoil_daq.drafting.role_words import GUN_ROLES, LINE_ROLES, score
from recoil_processing.swing import swing_of
from recoil_rigs.mechanism.mechanism_parameters import MechanismModel
from recoil_rigs.rig import Rig, load_rig
from recoil_rigs.tables.rig_tables import ROLES
from recoil_rigs.twin import TwinShot, simulate_shot
from tests.builders.shared_data import shared_file
from tests.builders.virtual_shots import SHORTER, with_twin

NOT_ROLES = {"", "trigger"}
FIELDS = {"gyro_carriage": "f32_at_8", "gyro_tipping": "f32_at_12"}
"""Fields of the inertial sensor, by their places in its frames: its bytes have no names at all."""


def anonymous(rig: Rig, folder: Path, seed: int) -> tuple[list[Path], dict[str, str]]:
    """Fire a shot and take the names out of its files; return these, and the role of each signal that has one."""
    fired = simulate_shot(rig, folder, seed=seed, shot="0001")
    names = {spec.signal: f"CH {n}" for n, spec in enumerate(rig.channels, 1)}
    files = [*fired.files, *folder.glob("*.dbc")]
    for file in files:
        if file.suffix in (".csv", ".dbc"):
            text = file.read_text(encoding="utf-8")
            for signal, name in names.items():
                known = signal.split(".")[-1] if file.suffix == ".dbc" else signal
                new = name.replace(" ", "_") if file.suffix == ".dbc" else name
                text = re.sub(rf"\b{re.escape(known)}(?= [(:])", new, text)
            file.write_text(text, encoding="utf-8")
    roles = {}
    for spec in rig.channels:
        name, kind = names[spec.signal], rig.source(spec.source).kind
        if spec.role not in NOT_ROLES and kind == "serial":
            roles[FIELDS[spec.signal]] = spec.role
        elif spec.role not in NOT_ROLES:
            roles[f"RecoilNode.{name.replace(' ', '_')}" if kind == "can" else name] = spec.role
    return files, roles


SHOTS = [
    ("field-2013", 11, {**SHORTER}),
    ("field-2013", 12, {**SHORTER, "peak_pressure_pa": 75e6}),
    ("field-2013", 13, {**SHORTER, "peak_pressure_pa": 200e6, "ringing": 1.5}),
    ("mixed", 14, {**SHORTER}),
    ("mixed", 15, {**SHORTER, "peak_pressure_pa": 90e6, "kind": False}),
    ("sled", 16, {}),
]


@pytest.mark.whole_way
@pytest.mark.parametrize(("name", "seed", "settings"), SHOTS)
def test_roles_are_right_where_no_name_tells_them(name: str, seed: int, settings: dict, tmp_path: Path) -> None:
    rig = load_rig(name) if name == "sled" else with_twin(name, **settings)
    files, roles = anonymous(rig, tmp_path, seed)
    found = draft_rig(files).roles
    assert found.model is (MechanismModel.LINE if name == "sled" else MechanismModel.GUN)
    by_signal = {key.partition(": ")[2]: one for key, one in found.by_signal.items()}
    assert {signal: one.role for signal, one in by_signal.items()} == roles
    # nothing is taken that no name agrees with
    assert not any(one.certain for one in found.by_signal.values())


@pytest.mark.whole_way
def test_a_name_alone_gives_no_role_to_what_does_not_move(tmp_path: Path) -> None:
    fired = simulate_shot(with_twin("field-2013", **SHORTER), tmp_path, seed=11, shot="0001")
    file = next(one for one in fired.files if one.name.endswith("dewetron.csv"))
    lines = file.read_text(encoding="utf-8").splitlines()
    head = next(n for n, line in enumerate(lines) if "p_recuperator" in line)
    at = next(i for i, cell in enumerate(lines[head].split(",")) if "p_recuperator" in cell)

    def dead(line: str) -> str:
        cells = line.split(",")
        return ",".join([*cells[:at], "0.1", *cells[at + 1 :]]) if re.match(r"-?\d", line) else line

    found = {key.partition(": ")[2]: one for key, one in draft_rig(fired.files).roles.by_signal.items()}
    assert found["AI 8/p_recuperator"].role == "recuperator_pressure"
    file.write_text("\n".join([*lines[: head + 1], *map(dead, lines[head + 1 :]), ""]), encoding="utf-8")
    found = {key.partition(": ")[2]: one for key, one in draft_rig(fired.files).roles.by_signal.items()}
    assert not (proposal := found.get("AI 8/p_recuperator")) or not proposal.role


FOREIGN = [
    "dewetron/Example_Drive01.d7d", "dewetron/oxy711.dmd", "dewetron/syncasync.dmd", "containers/test_metadata.mf4",
    "containers/raw1.tdms", "containers/Digital_Input.tdms", "containers/Sample_UFF58b_bin.uff",
    "can/rig_shot/rig_shot.blf", "can/00000170.MF4", "can/63BEFDF9.MF4", "real/emps/DATA_EMPS.mat",
    "tracks/SYNTHETIC_accel_20kHz.csv", "tracks/SYNTHETIC_proanalyst_like_2000fps.csv",
    "tracks/proanalyst_paws_jones2020_008_129_DB.csv", "serial/mip_data.bin", "serial/output1.bin",
    "serial/vn100_F00379.bin", "reports/mat_v4.mat", "reports/hms.csv", "reports/tdms_xunit.tdms",
]  # fmt: skip


@pytest.mark.whole_way
@pytest.mark.parametrize("name", FOREIGN)
def test_no_role_is_proposed_of_files_that_are_of_no_mechanism(name: str) -> None:
    file = shared_file(name)
    databases = sorted(file.parent.glob("*.dbc"))
    try:
        drafted = draft_rig([file], databases=databases)
    except RecoilDaqError:
        pytest.skip("no library here reads this file")
    assert drafted.roles.by_signal == {}
    assert drafted.roles.model is None


def test_foreign_files_together_are_of_no_mechanism_either() -> None:
    names = ("dewetron/syncasync.dmd", "tracks/SYNTHETIC_proanalyst_like_2000fps.csv", "serial/output1.bin")
    assert draft_rig([shared_file(name) for name in names]).roles.by_signal == {}


@pytest.mark.whole_way
@pytest.mark.parametrize("shot", ["plain", "ringing", "gains"])
def test_names_and_an_independent_simulation_agree(shot: str) -> None:
    files = [shared_file(f"shots/{shot}/{name}") for name in ("dewetron.csv", "camera.csv")]
    roles = draft_rig(files).roles.by_signal
    wanted = {"acc_recoil": "recoil_acceleration", "p_breech": "breech_pressure", "p_brake": "brake_pressure"}
    assert {wanted[part]: one.role for key, one in roles.items() for part in wanted if key.endswith(part)} == {
        role: role for role in wanted.values()
    }
    assert all(one.certain for one in roles.values())
    assert {one.role for one in roles.values()} == set(GUN_ROLES)


@pytest.mark.whole_way
@pytest.mark.parametrize("shot", ["plain", "ringing", "gains"])
def test_polarities_of_an_independent_simulation_are_right_or_asked(shot: str) -> None:
    # its sensors are mounted along their axes; ringing begins on the other side, and is the largest swing of a gyro
    files = [shared_file(f"shots/{shot}/{name}") for name in ("dewetron.csv", "camera.csv")]
    rows = [row for row in tomllib.loads(draft_rig(files).draft.text())["channel"] if "polarity" in row]
    assert len(rows) == len(GUN_ROLES)
    given = {row["role"]: row["polarity"] for row in rows}
    assert str(given.pop("tipping_rate")).startswith("TODO 1? if the muzzle rises first, as it does where d is above 0")
    assert set(given.values()) == {1}


@pytest.mark.whole_way
def test_the_tipping_part_turns_as_the_stated_mechanism_says(tmp_path: Path) -> None:
    rig = load_rig("field-2013")
    fired = simulate_shot(with_twin("field-2013", **SHORTER), tmp_path, seed=3, shot="0001")
    for d, polarity in ((0.04, 1), (-0.04, -1)):
        stated = tmp_path / "stated.toml"
        stated.write_text(f'schema = "recoil-daq/rig/1"\n[mechanism]\nd = {d}\n', encoding="utf-8")
        rows = tomllib.loads(draft_rig(fired.files, other=stated).draft.text())["channel"]
        assert next(row["polarity"] for row in rows if row.get("role") == "tipping_rate") == polarity
    assert rig.mechanism.d > 0, "of which the twin makes a muzzle that rises"


def test_a_swing_that_goes_to_and_fro_has_no_side() -> None:
    times_s = np.arange(4000) / 1e4
    ringing = np.where(times_s > 0.1, np.sin(2 * np.pi * 200.0 * times_s), 0.0)
    pushed = ringing + np.where(times_s > 0.1, 0.9, 0.0)
    alone, beside = (swing_of(one, 1e4) for one in (ringing, pushed))
    assert alone is not None
    assert beside is not None
    assert polarity_of("carriage_rate", alone, MechanismModel.GUN).value is None
    assert polarity_of("carriage_acceleration_x", beside, MechanismModel.GUN).value == -1
    assert polarity_of("carriage_acceleration_y", beside, MechanismModel.GUN).value is None


@pytest.mark.whole_way
def test_a_shot_late_in_a_long_record_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fired = simulate_shot(with_twin("field-2013", **SHORTER), tmp_path, seed=3, shot="0001")
    recorder = next(file for file in fired.files if "dewetron" in file.name)
    whole = draft_rig(fired.files)
    head, *rows = recorder.read_text(encoding="utf-8").splitlines()
    times = [float(row.partition(",")[0]) for row in rows[:2]]
    rest = [row.partition(",")[2] for row in rows[:800]]
    cells = rest * 60 + [row.partition(",")[2] for row in rows] + rest * 5
    step_s = times[1] - times[0]
    lines = [head, *(f"{k * step_s:.6f},{row}" for k, row in enumerate(cells))]
    recorder.write_text("\n".join(lines) + "\n", encoding="utf-8")
    monkeypatch.setattr(recorded_source, "MOST_SAMPLES", 10_000)
    monkeypatch.setattr(recorded_source, "_BLOCK", 3000)
    late = draft_rig(fired.files)
    assert {key: one.role for key, one in late.roles.by_signal.items()} == {
        key: one.role for key, one in whole.roles.by_signal.items()
    }
    note = next(note for note in late.notes if "samples" in note)
    assert re.search(r"of 60,750 samples the 10,000 about 1\.\d+ s, where it goes farthest, were compared", note), note
    clocks = [row.get("align") for row in tomllib.loads(late.draft.text())["source"]]
    assert clocks == [row.get("align") for row in tomllib.loads(whole.draft.text())["source"]]


def drafted_with(folder: Path, *changes: tuple[str, str]) -> DraftedRig:
    fired = simulate_shot(with_twin("field-2013", **SHORTER), folder, seed=3, shot="0001")
    recorder = next(file for file in fired.files if "dewetron" in file.name)
    text = recorder.read_text(encoding="utf-8")
    head, body = text.split("\n", 1)
    for old, new in changes:
        assert old in head
        head = head.replace(old, new)
    recorder.write_text(f"{head}\n{body}", encoding="utf-8")
    return draft_rig(fired.files, out=folder / "drafted.toml")


def test_a_name_that_the_shot_contradicts_is_a_question(tmp_path: Path) -> None:
    drafted = drafted_with(tmp_path, ("p_brake", "p_x"), ("p_breech", "p_brake"), ("p_x", "p_breech"))
    found = {key: one for key, one in drafted.roles.by_signal.items() if key.endswith(("p_breech", "p_brake"))}
    assert [(one.role, one.certain) for one in found.values()] == [("", False)] * 2
    assert all("by its name" in one.reason and "by the shot" in one.reason for one in found.values())
    questions = {str(one.parts[0]): one.question for one in drafted.draft.questions() if one.parts[-1] == "role"}
    assert all(question.proposal is None for question in questions.values())
    assert any("p_breech" in key for key in questions)


def test_a_second_gauge_of_one_pressure_gets_its_role(tmp_path: Path) -> None:
    fired = simulate_shot(with_twin("field-2013", **SHORTER), tmp_path, seed=3, shot="0001")
    recorder = next(file for file in fired.files if "dewetron" in file.name)
    head, *rows = recorder.read_text(encoding="utf-8").splitlines()
    column = head.split(",").index(next(cell for cell in head.split(",") if "p_breech" in cell))
    lines = [f"{head},AI 9/second (MPa)", *(f"{row},{1.01 * float(row.split(',')[column]):.5f}" for row in rows)]
    recorder.write_text("\n".join(lines) + "\n", encoding="utf-8")
    roles = {key.rpartition("/")[2]: one for key, one in draft_rig(fired.files).roles.by_signal.items()}
    assert roles["second"].role == roles["p_breech"].role == "breech_pressure"
    assert roles["p_brake"].role == "brake_pressure"


@pytest.mark.parametrize(
    ("signal", "role"),
    [
        ("AI 1/Rohr Beschl", "recoil_acceleration"),
        ("Lafette acc X", "carriage_acceleration_x"),
        ("Wiege gyro", "tipping_rate"),
        ("AI 4/Gasdruck Verschluss", "breech_pressure"),
        ("Bremse Druck", "brake_pressure"),
        ("p_vorholer", "recuperator_pressure"),
        ("Rücklauf Weg", "recoil_displacement"),
        ("AI 3/f_push", "driving_force"),
        ("brake force", "resisting_force"),
    ],
)
def test_a_name_speaks_most_for_the_role_of_its_words(signal: str, role: str) -> None:
    roles = LINE_ROLES if ROLES[role] == "force" else GUN_ROLES
    points = {one: score(signal, one, ROLES[role]) for one in roles}
    assert max(points, key=lambda one: points[one]) == role
    assert sorted(points.values())[-1] > sorted(points.values())[-2]
    assert score(signal, role, "temperature") == 0


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("Lafette längs", "carriage_acceleration_x"), ("Lafette quer", "carriage_acceleration_y"),
        ("acc carriage vertical", "carriage_acceleration_y"), ("cradle_x", "carriage_acceleration_x"),
    ],
)  # fmt: skip
def test_words_for_along_and_across_tell_the_axes_apart(name: str, role: str) -> None:
    roles = ("carriage_acceleration_x", "carriage_acceleration_y")
    assert max(roles, key=lambda one: score(name, one, "acceleration")) == role
    assert len({score(name, one, "acceleration") for one in roles}) == 2


def test_a_name_without_an_axis_agrees_with_what_gravity_tells(field_shot: TwinShot, tmp_path: Path) -> None:
    text = next(one for one in field_shot.files if "dewetron" in one.name).read_text(encoding="utf-8")
    text = text.replace("acc_carriage_x", "Lafette 1", 1).replace("acc_carriage_y", "Lafette 2", 1)
    (tmp_path / "0001.csv").write_text(text, encoding="utf-8")
    roles = draft_rig([tmp_path / "0001.csv"]).roles.by_signal
    found = {key.rpartition("/")[2]: (one.role, one.certain) for key, one in roles.items() if "Lafette" in key}
    assert found == {"Lafette 1": ("carriage_acceleration_x", True), "Lafette 2": ("carriage_acceleration_y", True)}


def blow(times_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return force, N, acceleration, m/s2, and travel, m, of 40 kg."""
    rng = np.random.default_rng(3)
    force = 3000.0 * np.exp(-(((times_s - 0.3) / 0.02) ** 2))
    step_s = times_s[1] - times_s[0]
    travel = np.cumsum(np.cumsum(force / 40.0)) * step_s**2
    return force + rng.normal(0.0, 3.0, force.size), force / 40.0 + rng.normal(0.0, 0.1, force.size), travel


def written(path: Path, head: str, *columns: np.ndarray) -> Path:
    rows = (",".join(f"{one:.5f}" for one in row) for row in np.column_stack(columns).tolist())
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def test_a_force_and_a_camera_of_unknown_unit_are_one_body_on_a_line(tmp_path: Path) -> None:
    times_s = np.arange(4000) / 4000.0
    force, _, travel = blow(times_s)
    files = [
        written(tmp_path / "kraft_0001.csv", "Zeit (s),Kraft (N)", times_s, force),
        written(tmp_path / "weg_0001.csv", "t,x,y", times_s[::4], 1e3 * travel[::4], 0.01 * np.sin(9.0 * times_s[::4])),
    ]
    drafted = draft_rig(files, out=tmp_path / "rig.toml")
    assert drafted.roles.model is MechanismModel.LINE
    assert {key: one.role for key, one in drafted.roles.by_signal.items()} == {
        "recorder: Kraft": "driving_force", "camera: x": "recoil_displacement",
    }  # fmt: skip
    asked = {one.parts[-1]: one.question for one in drafted.draft.questions() if "'x'" in str(one.parts[0])}
    assert asked["quantity"].proposal == "displacement"
    assert "unit" in asked


def test_words_of_quantities_are_taken_for_what_they_say(tmp_path: Path) -> None:
    times_s = np.arange(4000) / 4000.0
    force, acceleration, _ = blow(times_s)
    drafted = draft_rig([written(tmp_path / "a.csv", "Time (s),Load,Acceleration", times_s, force, acceleration)])
    assert drafted.roles.model is MechanismModel.LINE
    proposals = {str(one.parts[0]).split("'")[1]: one.question for one in drafted.draft.questions()
                 if one.parts[-1] == "quantity"}  # fmt: skip
    assert {name: one.proposal for name, one in proposals.items()} == {"Load": "force", "Acceleration": "acceleration"}
    assert all(one.reason.endswith("its name says the quantity alone") for one in drafted.roles.by_signal.values())
    assert not any(one.certain for one in drafted.roles.by_signal.values())


def test_files_without_a_shot_and_without_a_pressure_ask_for_a_line(tmp_path: Path) -> None:
    times_s = np.arange(400) / 400.0
    still = written(tmp_path / "a.csv", "Time (s),a (m/s2),F (N)", times_s, 0.0 * times_s, 0.0 * times_s)
    mechanism = tomllib.loads(draft_rig([still]).draft.text())["mechanism"]
    assert {*mechanism} == {"model", "m3", "phi20", "friction", "u_friction"}
    still = written(tmp_path / "b.csv", "Time (s),a (m/s2),p (bar)", times_s, 0.0 * times_s, 0.0 * times_s)
    assert "bore_area" in tomllib.loads(draft_rig([still]).draft.text())["mechanism"]
