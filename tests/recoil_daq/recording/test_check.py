"""What `check` finds before the day: in the rig, in its database, and against recorded files."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from recoil_rigs.twin import TwinShot
from tests.builders.line_rigs import line_text


@pytest.fixture
def rig(mixed_shot: TwinShot, tmp_path: Path) -> Path:
    """Return a copy of the rig with its database that a test may change."""
    folder = mixed_shot.rig_file.parent
    for name in ("rig.toml", "mixed.dbc"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    # the shot is of a kind rig, which states that nothing rubs unread: that alone would be doubted
    for key, u in (("u_bore_friction", 0.006), ("u_unread_share", 0.01), ("unread_force", 0.002)):
        change(tmp_path / "rig.toml", (f"\n{key} = 0.0", f"\n{key} = {u}"))
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
    assert [one["text"] for one in document["findings"]] == told
    assert [one["code"] for one in document["findings"]] == [one["code"] for one in document["faults"]]
    assert (document["code"], {one["severity"] for one in document["findings"]}) == ("rig", {"fatal"})
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


def test_open_values_are_counted_and_end_with_three(run, rig: Path) -> None:
    change(rig, ("m3 = 782.0", 'm3 = "TODO specification mass, kg"'), ("u_rel = 0.005", 'u_rel = "TODO"'))
    assert faults(run, rig)[0] == "mechanism.m3: is open: specification mass, kg"
    document = json.loads(run("check", rig, "--json").stdout)
    stated = document["stated"]
    assert (document["open"], stated > 50) == (2, True)
    assert f"{stated} of {stated + 2} values stated" in run("check", rig).stderr.splitlines()[0]


def test_a_newer_certificate_beside_the_rig_is_a_warning(run, rig: Path) -> None:
    table = rig.with_name("sensors.csv")
    table.write_text("serial,quantity,U_percent,k,calibrated,due\nV301,pressure,1,2,2026-01-15,2099-12-31\n", "utf-8")
    assert json.loads(run("check", rig, "--json").stdout)["warnings"] == []
    table.write_text("serial,quantity,U_percent,k,calibrated,due\nV301,pressure,1,2,2027-01-15,2099-12-31\n", "utf-8")
    (warning,) = json.loads(run("check", rig, "--json").stdout)["warnings"]
    assert (warning["key"], warning["code"]) == ("channel 'p_breech'.sensor", "contradiction")
    assert "row 2, has another certificate of V301: calibrated 2027-01-15 for 2026-01-15; take it" in warning["problem"]
    table.write_text("serial,k\nV301,two\n", "utf-8")
    (warning,) = json.loads(run("check", rig, "--json").stdout)["warnings"]
    assert warning["key"] == "sensors.csv"
    assert "row 2 'V301'.k: expected a number" in warning["problem"]


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
        "channel 'p_brake'.signal",
        "channel 'acc_recoil'.sensor.due",
    ]


@pytest.mark.parametrize(
    ("dates", "alone", "with_files"),
    [
        (("due = 2099-12-31", "due = 2026-03-20"), "calibration was due 2026-03-20, ", ""),
        (("due = 2099-12-31", "due = 2026-02-01"), "calibration was due 2026-02-01, ", "before the shot of 2026-03-02"),
        (("= 2026-01-15", "= 2026-03-04"), "", "calibrated 2026-03-04, 2 days after the shot of 2026-03-02"),
    ],
)
def test_calibrations_must_cover_the_day_of_the_files(run, rig: Path, mixed_shot, dates, alone, with_files) -> None:
    change(rig, dates)
    for said, files in ((alone, ()), (with_files, mixed_shot.files)):
        result = run("check", rig, *files, "--json")
        told = [one["problem"] for one in json.loads(result.stdout)["faults"]] if result.exit_code else []
        assert len(told) == bool(said), told
        assert all(said in problem for problem in told)


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
    document = json.loads(run("check", rig, "--json").stdout)
    assert [one["key"] for one in document["warnings"]] == ["mechanism.phi10"]
    warned, *notes = document["findings"]
    assert (warned["code"], warned["about"], warned["severity"]) == ("unusual", None, "warn")
    assert {(one["code"], one["severity"]) for one in notes} == {("assumption", "note")}
    assert [one["about"] for one in notes] == [one["quantity"] for one in document["assumptions"]]


def test_files_and_devices_are_checked_apart(run) -> None:
    assert run("check", "mixed", "a.csv", "--devices").exit_code == 2


# ---- what the numbers of the files come to


def in_volts(shot: TwinShot, folder: Path, signal: str, mv_per_unit: float) -> Path:
    """Write a recorder's file anew, with one signal in volts instead of what it measured."""
    text = next(file for file in shot.files if "dewetron" in file.name).read_text(encoding="utf-8")
    lines = text.splitlines()
    head = next(i for i, line in enumerate(lines) if signal in line)
    at = next(i for i, cell in enumerate(lines[head].split(",")) if signal in cell)
    cells = lines[head].split(",")
    cells[at] = cells[at].replace("MPa", "V")
    lines[head] = ",".join(cells)
    for i in range(head + 1, len(lines)):
        cells = lines[i].split(",")
        if len(cells) > at:
            cells[at] = f"{float(cells[at]) * mv_per_unit * 1e-3:.6f}"
            lines[i] = ",".join(cells)
    path = folder / "0001_dewetron.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


OLD_CHAIN = "range = [-25.0, 250.0] }"


@pytest.mark.parametrize(
    ("sensitivity", "peak", "unit", "limits"),
    [
        ('"40 mV/MPa", range = [0, 250] }', 128e0, "MPa", [0, 250]),
        ('40, sensitivity_unit = "mV", range = [0, 250] }', 128.0, "Pa", [0, 250]),
        ('"40 mV/Pa", range = [0, 250] }', 128.0, "Pa", [0, 250]),
        ('"40 mV/kPa", range = [0, 250000] }', 128.0, "kPa", [0, 250000]),
    ],
)
def test_the_peak_that_a_certificate_leads_to_stands_beside_the_range(
    run, rig: Path, mixed_shot: TwinShot, tmp_path: Path, sensitivity: str, peak: float, unit: str, limits: list[float]
) -> None:
    file = in_volts(mixed_shot, tmp_path, "p_breech", 40.0)
    change(
        rig, ('unit = "MPa"\nrole = "breech', 'unit = "V"\nrole = "breech'), (OLD_CHAIN, f"sensitivity = {sensitivity}")
    )
    result = run("check", rig, file, "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    (row,) = (one for one in document["files"][0]["channels"] if one["name"] == "p_breech")
    assert (row["peak"], row["measured_in"], row["range"]) == (pytest.approx(peak, rel=0.05), unit, limits)
    told = [f"{one['key']}: {one['problem']}" for one in document["warnings"] if "p_breech" in one["key"]]
    shown = run("check", rig, file).stdout
    assert f" {unit}" in shown
    if unit == "MPa":
        assert told == []
        return
    assert len(told) == (1 if unit == "kPa" else 2)
    words = "its peak is 0.05" if unit == "kPa" else " Pa is unusual; most lie between 100000 and 2e+09: check unit"
    assert words in told[-1]
    assert all(f"warning: {line}" in shown for line in told)
    if "sensitivity_unit" in sensitivity:
        assert all('is 40 mV per Pa: write it as on the certificate, such as "40 mV/MPa"' in line for line in told)


def test_a_peak_below_a_hundredth_of_the_range_is_a_warning(run, rig: Path, mixed_shot: TwinShot) -> None:
    change(rig, (OLD_CHAIN, "range = [-25.0, 25000.0] }"))
    file = next(file for file in mixed_shot.files if "dewetron" in file.name)
    document = json.loads(run("check", rig, file, "--json").stdout)
    told = document["warnings"][-1]
    assert told["key"] == "channel 'p_breech'"
    assert "its peak is 0.51 % of its range: check unit, sensitivity and amplifier" in told["problem"]


def test_a_sensitivity_that_is_not_used_is_noted(run, rig: Path, mixed_shot: TwinShot) -> None:
    change(rig, (OLD_CHAIN, 'sensitivity = "40 mV/MPa", range = [-25.0, 250.0] }'))
    file = next(file for file in mixed_shot.files if "dewetron" in file.name)
    document = json.loads(run("check", rig, file, "--json").stdout)
    assert document["notes"][0] == "p_breech: `sensitivity` is not applied: 0001_dewetron.csv is in MPa already"
    (found,) = (one for one in document["findings"] if one["code"] == "sensitivity")
    assert (found["about"], found["severity"], found["text"]) == ("p_breech", "note", document["notes"][0])


def test_sources_whose_files_were_not_given_are_a_note(run, rig: Path, mixed_shot: TwinShot) -> None:
    file = next(file for file in mixed_shot.files if "dewetron" in file.name)
    result = run("check", rig, file)
    assert result.exit_code == 0
    assert "note: not checked, no file of it was given: can (can), imu (serial), camera (camera)" in result.stdout


@pytest.mark.parametrize("declared", [5000.0, 6030.0, 12000.0])
def test_a_frame_rate_that_the_files_times_contradict_is_a_fault(
    run, rig: Path, mixed_shot: TwinShot, declared: float
) -> None:
    change(rig, ("frame_rate = 6000.0", f"frame_rate = {declared}"))
    camera = next(file for file in mixed_shot.files if "camera" in file.name)
    (told,) = faults(run, rig, camera)
    assert told.startswith(
        f"source 'camera'.frame_rate: the rig says {declared:g} Hz, the times in 0001_camera.csv 6000"
    )


def test_a_database_that_knows_no_frame_of_the_file_is_named(run, rig: Path, mixed_shot: TwinShot) -> None:
    database = rig.parent / "mixed.dbc"
    lines = [
        line.replace(line.split()[1], str(int(line.split()[1]) + 1), 1) if line.startswith("BO_ ") else line
        for line in database.read_text(encoding="utf-8").splitlines()
    ]
    database.write_text("\n".join(lines) + "\n", encoding="utf-8")
    bus = next(file for file in mixed_shot.files if file.suffix == ".blf")
    (told,) = faults(run, rig, bus)
    assert told.startswith("source 'can'.database: mixed.dbc knows no frame of 0001_can.blf, whose identifiers are ")
    assert "`signal`" not in told


def test_ingest_says_too_that_the_database_knows_no_frame(run, rig: Path, mixed_shot: TwinShot, tmp_path: Path) -> None:
    database = rig.parent / "mixed.dbc"
    database.write_text(database.read_text(encoding="utf-8").replace("BO_ 288 ", "BO_ 289 "), encoding="utf-8")
    result = run("ingest", rig, *mixed_shot.files, "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert (
        "0001_can.blf: the database knows no frame of this log, so 'RecoilNode.p_brake' is not in it" in result.stderr
    )
    assert "found identifiers 0xc1, 0x120, " in result.stderr
    assert "correct `signal`" not in result.stderr


def test_an_absolute_unit_that_the_file_alone_states_is_among_what_is_assumed(
    run, rig: Path, mixed_shot: TwinShot, tmp_path: Path
) -> None:
    text = next(file for file in mixed_shot.files if "dewetron" in file.name).read_text(encoding="utf-8")
    head = next(line for line in text.splitlines() if "p_breech" in line)
    cells = [re.sub(r"MPa|bar", "bara", cell) if "p_breech" in cell else cell for cell in head.split(",")]
    file = tmp_path / "0001_dewetron.csv"
    file.write_text(text.replace(head, ",".join(cells), 1), encoding="utf-8")
    lines = rig.read_text(encoding="utf-8").splitlines(keepends=True)
    at = next(i for i, line in enumerate(lines) if line.startswith('name = "p_breech"'))
    own = next(i for i in range(at, len(lines)) if lines[i].startswith("unit = "))
    del lines[own]
    rig.write_text("".join(lines), encoding="utf-8")
    line = "absolute pressure less the standard atmosphere, 1.01325 bar"
    document = json.loads(run("check", rig, file, "--json").stdout)
    assert [one["quantity"] for one in document["assumptions"] if one["taken"] == line] == ["p_breech"]
    assert f"{line}: p_breech" in " ".join(run("check", rig, file).stdout.split())
    assert not any(one["taken"] == line for one in json.loads(run("check", rig, "--json").stdout)["assumptions"])


def test_what_identification_would_refuse_is_a_warning(run, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(line_text("driving_force", "recoil_acceleration"), encoding="utf-8")
    moving = tmp_path / "0001_daq.csv"
    times_s = np.arange(0.0, 2.0, 1e-3)
    force_n = 200.0 * np.sin(5.0 * times_s + 1.0)
    rows = [f"{t:.3f},{f:.4f},{f / 95.1:.5f}" for t, f in zip(times_s, force_n, strict=True)]
    head = "Time (s),driving_force (N),recoil_acceleration (m/s2)"
    moving.write_text("\n".join([head, *rows, ""]), encoding="utf-8")
    result = run("check", rig, moving, "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    (said,) = [one for one in document["findings"] if "identify would find" in one["text"]]
    assert said["severity"] == "warn"
    assert "the body moves when the record begins, and nothing tells how fast" in said["text"]


def test_a_unit_that_is_none_is_a_warning_and_the_rigs_counts(run, rig: Path, mixed_shot: TwinShot) -> None:
    recorder = next(file for file in mixed_shot.files if "dewetron" in file.name)
    heading = re.search(r"AI \d+/p_breech \((\w+)\)", recorder.read_text(encoding="utf-8").partition("\n")[0])
    assert heading
    spoilt = rig.parent / recorder.name
    renamed = heading[0].replace(heading[1], "furlong")
    spoilt.write_bytes(recorder.read_bytes().replace(heading[0].encode(), renamed.encode(), 1))
    result = run("check", rig, spoilt, "--json")
    assert result.exit_code == 0, result.output
    (told,) = (one for one in json.loads(result.stdout)["warnings"] if "no known unit" in one["problem"])
    assert told["key"] == "channel 'p_breech'.unit"
    assert "in 'furlong', which is no known unit: the rig's 'MPa' counts" in told["problem"]
    assert "declare the source's `layout`" in told["problem"]
    without = run("check", rig, recorder, "--json")
    assert not any("no known unit" in one["problem"] for one in json.loads(without.stdout)["warnings"])
