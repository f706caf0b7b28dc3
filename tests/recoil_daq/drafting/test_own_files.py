"""Files of a stand that nobody made for this program, from nothing to a valid mass: what is asked, and how often."""

from __future__ import annotations

import json
import re
import tomllib
import unicodedata
from pathlib import Path
from shutil import copytree

import pytest

from recoil_daq.drafting.init import DraftedRig, draft_rig
from recoil_daq.recording.ingest import ingest_files
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import TwinShot
from tests.builders.filled_drafts import WEIGHT, filled, mechanism_of
from tests.builders.own_files import RATE_PER_COUNT, write_own_files

RECORDED = ("Messung_0001.csv", "Bus1_0001.log", "Bus2_0001.log", "Kreisel_0001.bin", "Kamera_0001.csv")


@pytest.fixture(scope="module")
def own(mixed_shot: TwinShot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the files of one shot, two databases and the certificates, and no rig."""
    folder, shots = tmp_path_factory.mktemp("own"), tmp_path_factory.mktemp("shots")
    shot = ingest_files(load_rig(mixed_shot.rig_file), mixed_shot.files, shot="0001", out=shots).shot
    write_own_files(shot, next(one for one in mixed_shot.files if "camera" in one.name), folder)
    return folder


@pytest.fixture
def stand(own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    copied = Path(copytree(own, tmp_path / "stand"))
    monkeypatch.chdir(copied)
    return copied


def drafted(*databases: str, **more: object) -> DraftedRig:
    return draft_rig(RECORDED, databases=databases, sensors="sensoren.csv", **more)


def tables(draft: DraftedRig) -> dict:
    return tomllib.loads(draft.draft.text())


def sources(draft: DraftedRig) -> dict[str, dict]:
    return {row["name"]: row for row in tables(draft)["source"]}


@pytest.mark.whole_way
@pytest.mark.usefixtures("stand")
def test_databases_that_explain_a_bus_equally_well_are_asked_for_and_kept() -> None:
    first = drafted("bus1.dbc", "bus2.dbc", out="rig.toml")
    asked = [sources(first)[name]["database"] for name in ("can", "can_2")]
    assert all(
        one.startswith("TODO ") and "bus1.dbc and bus2.dbc explain Bus" in one and "equally well" in one
        for one in asked
    )
    # without the buses nothing has a role that its name does not have
    assert not any("its name says nothing" in one.reason and one.role for one in first.roles.by_signal.values())
    text = filled(first.draft.text(), {"can": {"database": "bus1.dbc"}, "can_2": {"database": "bus2.dbc"}})
    Path("rig.toml").write_text(text, encoding="utf-8")
    # `bus1.dbc` explains as much of the second bus: what is stated counts
    for databases in ((), ("bus1.dbc", "bus2.dbc")):
        second = drafted(*databases, other="rig.toml", out="next.toml")
        assert [sources(second)[name]["database"] for name in ("can", "can_2")] == ["bus1.dbc", "bus2.dbc"]
        roles = {key: (one.role, one.certain) for key, one in second.roles.by_signal.items()}
        assert roles["can: Knoten.p_Bremse"] == ("brake_pressure", True)
        assert roles["can_2: Knoten.p_Vorholer"] == ("recuperator_pressure", True)
    assert not any("of which no file is given" in one for one in second.differences)


@pytest.mark.whole_way
@pytest.mark.usefixtures("stand")
def test_a_database_with_more_signals_of_the_same_frames_is_no_better() -> None:
    more = ' SG_ Temperatur : 40|8@1+ (1,0) [0|255] "" Rekorder\n'
    Path("bus2.dbc").write_text(Path("bus2.dbc").read_text(encoding="utf-8") + more, encoding="utf-8")
    found = draft_rig(["Messung_0001.csv", "Bus1_0001.log"], databases=["bus1.dbc", "bus2.dbc"], out="rig.toml")
    assert sources(found)["can"]["database"].startswith("TODO bus1.dbc and bus2.dbc explain")


@pytest.mark.whole_way
@pytest.mark.usefixtures("stand")
def test_answers_by_which_a_file_is_not_read_are_kept_and_said(run, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("notes.txt").write_text("no database\n", encoding="utf-8")
    answers = iter(["notes.txt", "782 kg", "."])
    monkeypatch.setattr("recoil_daq.terminal.session.Session.asks", True)
    monkeypatch.setattr("recoil_daq.drafting.asking.typer.prompt", lambda *_, **__: next(answers))
    done = run("init", "Messung_0001.csv", "Bus1_0001.log", "--sensors", "sensoren.csv")
    assert done.exit_code == 1
    last = " ".join(done.stdout.split("lacks: ")[-1].split())
    assert last.startswith("by the answers the files are not read: ")
    assert "notes.txt: this is no CAN database" in last
    rig = tomllib.loads(Path("rig.toml").read_text(encoding="utf-8"))
    assert (rig["source"][1]["database"], rig["mechanism"]["m3"]) == ("notes.txt", 782.0)


@pytest.mark.whole_way
@pytest.mark.usefixtures("stand")
def test_names_are_found_however_their_signs_over_letters_are_spelled(run) -> None:
    table = Path("sensoren.csv").read_text("utf-8")
    Path("sensoren.csv").write_text(unicodedata.normalize("NFD", table), "utf-8")
    assert run("init", "Messung_0001.csv", "--sensors", "sensoren.csv").exit_code == 0
    rig = Path("rig.toml").read_text("utf-8")
    assert (
        next(row for row in tomllib.loads(rig)["channel"] if row["signal"] == "Lafette längs")["sensor"]["serial"]
        == "V102"
    )
    Path("rig.toml").write_text(
        rig.replace('"Lafette längs"', unicodedata.normalize("NFD", '"Lafette längs"')), "utf-8"
    )
    assert "no signal" not in run("check", "rig.toml", "Messung_0001.csv").output
    again = run("init", "Messung_0001.csv", "--from", "rig.toml", "--out", "new.toml", "--json")
    assert json.loads(again.stdout)["differences"] == []


@pytest.mark.whole_way
@pytest.mark.usefixtures("stand")
def test_a_counter_on_two_buses_of_one_log_is_drafted_as_check_takes_it(run) -> None:
    logs = (Path(name).read_text("utf-8") for name in ("Bus1_0001.log", "Bus2_0001.log"))
    lines = [line for log in logs for line in log.splitlines()]
    buses = {line.split()[1] for line in lines}
    assert len(buses) == 2
    Path("Bus_0001.log").write_text("\n".join(sorted(lines)) + "\n", "utf-8")
    assert run("init", "Messung_0001.csv", "Bus_0001.log", "--database", "bus1.dbc").exit_code == 0
    rig = Path("rig.toml").read_text(encoding="utf-8")
    counters = next(row["counters"] for row in tomllib.loads(rig)["source"] if row["kind"] == "can")
    assert len(counters) == 1
    assert "@" not in counters[0]
    assert "could count messages" not in run("check", "rig.toml", "Bus_0001.log").output


@pytest.mark.whole_way
@pytest.mark.usefixtures("stand")
def test_databases_that_say_the_same_of_a_bus_are_no_question() -> None:
    Path("copy.dbc").write_bytes(Path("bus1.dbc").read_bytes())
    found = draft_rig(["Messung_0001.csv", "Bus1_0001.log"], databases=["bus1.dbc", "copy.dbc"], out="rig.toml")
    assert sources(found)["can"]["database"] == "bus1.dbc"


@pytest.mark.whole_way
@pytest.mark.usefixtures("stand")
def test_a_port_of_whole_numbers_is_read_when_its_clocks_tick_is_known() -> None:
    files = ["Messung_0001.csv", "Kreisel_0001.bin"]
    first = draft_rig(files, sensors="sensoren.csv", out="rig.toml")
    framing = sources(first)["serial"]["framing"]
    assert framing["endian"] == "big"
    assert {one["name"]: one["type"] for one in framing["fields"]} == {
        "counter": "u8", "device_time": "u32", "i16_at_8": "i16", "i16_at_10": "i16", "i16_at_12": "i16",
    }  # fmt: skip
    tick = next(one.question for one in first.draft.questions() if one.parts[-1] == "device_time")
    assert tick.proposal == {"field": "device_time", "tick_s": 1e-6, "modulo": 1 << 32}
    assert "goes up by 1000 from frame to frame" in tick.meaning
    Path("rig.toml").write_text(
        filled(first.draft.text(), {"serial": {"device_time": tick.proposal}}), encoding="utf-8"
    )
    second = draft_rig(files, sensors="sensoren.csv", other="rig.toml", out="next.toml")
    assert sources(second)["serial"]["align"] == {
        "method": "redundant", "channel": "serial_i16_at_12", "against": "Lafette_längs",
    }  # fmt: skip
    channels = {row["signal"]: row for row in tables(second)["channel"]}
    assert channels["i16_at_12"]["unit"] == "g"
    assert channels["i16_at_12"]["sensor"]["gain"] == pytest.approx(1e-3, rel=0.03)
    assert channels["i16_at_8"]["sensor"]["gain"].startswith("TODO value of one count")


MECHANISM = mechanism_of("mixed")
FIRST = {
    "knowledge": WEIGHT,
    "can": {"database": "bus1.dbc"}, "can_2": {"database": "bus2.dbc"},
    "serial": {"device_time": {"field": "device_time", "tick_s": 1e-6, "modulo": 1 << 32}},
}  # fmt: skip
"""Values that the first draft asks for, without which the files are not read."""
SECOND = {
    "Rohr": {"position": [-0.30, 0.06]}, "Lafette_längs": {"position": [0.05, -0.10]},
    "Lafette_quer": {"position": [0.05, -0.10]},
    "serial_i16_at_8": {"gain": RATE_PER_COUNT, "role": "carriage_rate"},
    "serial_i16_at_10": {"gain": RATE_PER_COUNT, "role": "tipping_rate"},
}  # fmt: skip
"""Values beside the mechanism's that the second one asks for; no others."""
MOST_EDITS = 12
"""Edits of drafts, beside the mechanism's values, from files that nobody made for this program to a valid mass."""


@pytest.mark.whole_way
@pytest.mark.usefixtures("stand")
@pytest.mark.parametrize("camera", [True, False], ids=["all", "without camera"])
def test_own_files_become_a_valid_mass_in_two_drafts(run, *, camera: bool) -> None:
    recorded = [name for name in RECORDED if camera or not name.startswith("Kamera")]
    given = [*recorded, "--database", "bus1.dbc", "--database", "bus2.dbc", "--sensors", "sensoren.csv"]
    assert run("init", *given).exit_code == 0
    text = filled(Path("rig.toml").read_text(encoding="utf-8"), {"mechanism": MECHANISM, **FIRST})
    Path("rig.toml").write_text(text, encoding="utf-8")
    done = run("init", *given, "--from", "rig.toml", "--overwrite", "--json")
    assert done.exit_code == 0, done.output
    asked = {tuple(re.findall(r"'(.*)'.*\.(\w+)", one["key"])[0]) for one in json.loads(done.stdout)["open"]}
    assert len(asked) + sum(map(len, FIRST.values())) <= MOST_EDITS
    assert asked == {(name, key) for name, values in SECOND.items() for key in values}
    text = filled(Path("rig.toml").read_text(encoding="utf-8"), SECOND)
    Path("rig.toml").write_text(text, encoding="utf-8")
    checked = run("check", "rig.toml", *recorded)
    assert checked.exit_code == 0, checked.output
    ingested = run("ingest", "rig.toml", *recorded, "--shot", "0001", "--json")
    assert ingested.exit_code == 0, ingested.output
    identified = run("identify", "shots", "--workers", "1")
    assert identified.exit_code == 0, identified.output
    mass = json.loads(Path("reports/0001/report.json").read_text(encoding="utf-8"))["mass"]
    assert abs(mass["value"] - 782.0) < 3 * mass["u"]


@pytest.mark.whole_way
@pytest.mark.usefixtures("stand")
def test_a_terminal_is_asked_first_for_what_opens_files_and_then_for_what_they_tell(
    run, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    answers = {
        "source[1] 'can'.database": "bus1.dbc", "source[2] 'can_2'.database": "bus2.dbc",
        "source[3] 'serial'.framing.device_time": "1 µs",
        "channel[8] 'serial_i16_at_8'.sensor.gain": "0,0000305175 rad/s", "mechanism.phi20": "9,74 deg",
    }  # fmt: skip

    def typed(*_: object, default: str, **__: object) -> str:
        return answers.get(asked[-1], default)

    def echo(text: str = "", **_: object) -> None:
        asked.extend(re.findall(r"^\[\d+ of \d+\] (.*?): ", str(text)))

    monkeypatch.setattr("recoil_daq.terminal.session.Session.asks", True)
    monkeypatch.setattr("recoil_daq.drafting.asking.typer.prompt", typed)
    monkeypatch.setattr("recoil_daq.drafting.asking.typer.echo", echo)
    done = run("init", *RECORDED, "--database", "bus1.dbc", "--database", "bus2.dbc", "--sensors", "sensoren.csv")
    assert done.exit_code == 0, done.output
    assert asked[:3] == [*list(answers)[:2], "source[3] 'serial'.framing.device_time"]
    assert len(asked) == len(set(asked))
    assert set(answers) <= set(asked)
    # each clock is found by then, and is no question any more
    assert not any(key.endswith("align") for key in asked)
    rig = tomllib.loads(Path("rig.toml").read_text(encoding="utf-8"))
    assert {row["name"]: row["database"] for row in rig["source"] if "database" in row} == {
        "can": "bus1.dbc", "can_2": "bus2.dbc",
    }  # fmt: skip
    assert rig["mechanism"]["phi20"] == pytest.approx(0.16999, rel=1e-4)
    assert next(row for row in rig["channel"] if row["signal"] == "i16_at_8")["sensor"]["gain"] == 3.05175e-5


@pytest.mark.whole_way
@pytest.mark.usefixtures("stand")
def test_a_sensor_without_certificate_is_answered_in_the_unit_that_was_answered_before(
    run, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = Path("sensoren.csv").read_text(encoding="utf-8")
    Path("sensoren.csv").write_text("".join(row for row in table.splitlines(True) if "V501" not in row), "utf-8")
    asked: list[str] = []
    answers = {"unit": "deg/s", "range": "-60 .. 60 deg/s", "gain": "0,0017 deg/s"}
    again: list[str] = []

    def typed(*_: object, default: str, **__: object) -> str:
        # a refused answer is not typed for ever
        return (
            default
            if again
            else next((text for key, text in answers.items() if asked[-1].endswith(f".{key}")), default)
        )

    def echo(text: str = "", **_: object) -> None:
        again.extend(re.findall("once more", str(text)))
        asked.extend(re.findall(r"^\[\d+ of \d+\] (.*?): ", str(text)))

    monkeypatch.setattr("recoil_daq.terminal.session.Session.asks", True)
    monkeypatch.setattr("recoil_daq.drafting.asking.typer.prompt", typed)
    monkeypatch.setattr("recoil_daq.drafting.asking.typer.echo", echo)
    done = run("init", "Messung_0001.csv", "Kreisel_0001.bin", "--sensors", "sensoren.csv")
    assert done.exit_code == 0, done.output
    assert not again
    rows = tomllib.loads(Path("rig.toml").read_text(encoding="utf-8"))["channel"]
    (rate,) = (row for row in rows if row["signal"] == "i16_at_8")
    assert (rate["unit"], rate["sensor"]["range"], rate["sensor"]["gain"]) == ("deg/s", [-60.0, 60.0], 0.0017)
