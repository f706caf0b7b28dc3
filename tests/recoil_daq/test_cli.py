"""The commands: what they print, what they leave behind, and how they end."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest
from typer.testing import CliRunner, Result

from recoil_daq import demo
from recoil_daq.cli import COMMANDS, app
from recoil_daq.demo import Demonstration
from recoil_daq.live import device_check
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.terminal import console
from recoil_rigs.rig import load_rig, parse_rig
from recoil_rigs.twin import TwinShot
from tests.builders.all_commands import all_commands
from tests.builders.long_recordings import triggered_rig
from tests.builders.machine_stalls import MachineStalls
from tests.builders.page_elements import PageElements
from tests.builders.virtual_shots import SHORTER, with_twin


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(run, command):
    result = run(command, "--help")
    assert result.exit_code == 0
    assert f"Example: recoil-daq {command}" in result.output
    assert "--json" in result.output


@pytest.mark.parametrize("command", COMMANDS)
def test_the_list_of_commands_says_of_each_what_its_own_help_says(command):
    assert all_commands()[command].help.partition("\n")[0] == COMMANDS[command].does


def test_help_lists_every_command_and_a_name_of_none_is_refused(run):
    listed = re.findall(r"^  (\w+)  ", run("--help").output.partition("Commands:")[2], re.MULTILINE)
    assert listed == [*COMMANDS]
    assert run("identity").exit_code == 2
    assert "'identify'" in run("identity").stderr


def text_of(page: Path) -> str:
    return PageElements(page.read_text(encoding="utf-8")).text


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from recoil_daq.cli import app; "
        "print(sorted({'numpy', 'scipy', 'h5py', 'pandas', 'can', 'pydantic', 'plotly', 'jinja2'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.indispensable("start")
def test_help_is_there_at_once():
    def seconds() -> float:
        before, start = os.times(), time.perf_counter()
        subprocess.run([sys.executable, "-m", "recoil_daq.cli", "--help"], capture_output=True, check=True)
        passed, after = time.perf_counter() - start, os.times()
        # its own processor time: other processes of the test run share the machine; Windows does not tell it
        spent = after.children_user + after.children_system - before.children_user - before.children_system
        return spent or passed

    assert any(seconds() < 0.25 for _ in range(8))


def test_version_is_printed(run):
    result = run("--version")
    assert result.exit_code == 0
    assert result.output.startswith("recoil-daq ")


def test_an_unknown_command_is_wrong_usage(run):
    assert run("ingset").exit_code == 2
    assert run("ingest", "field-2013").exit_code == 2
    assert run("identify", "x.h5", "--method", "magic").exit_code == 2
    for window in ("soon", "0", "-0.01", "inf", "nan"):
        assert run("identify", "x.h5", "--window-s", window).exit_code == 2


@pytest.mark.whole_way
def test_ingest_prints_a_verdict_per_channel_and_a_last_line(run, field_shot: TwinShot, tmp_path):
    result = run("ingest", "field-2013", *field_shot.files, "--shot", "7", "--out", tmp_path)
    assert result.exit_code == 0
    for channel in ("acc_recoil", "p_breech", "x_camera"):
        assert any(line.startswith(channel) and " ok " in line for line in result.output.splitlines())
    assert "USABLE" in result.output
    assert (tmp_path / "7.h5").exists()


@pytest.mark.whole_way
def test_ingest_names_the_shot_by_the_number_that_its_files_share(run, field_shot: TwinShot, tmp_path):
    result = run("ingest", "field-2013", *field_shot.files, "--out", tmp_path, "--json")
    assert json.loads(result.stdout)["shot"] == "0001"


@pytest.mark.whole_way
def test_ingest_as_json_is_one_document(run, field_shot: TwinShot, tmp_path):
    result = run("ingest", "field-2013", *field_shot.files, "--shot", "8", "--out", tmp_path, "--json")
    document = json.loads(result.stdout)
    assert document["usable"] is True
    assert document["channels"][0]["name"] == "acc_recoil"
    assert document["alignment"][0]["clock"] == "camera"


@pytest.mark.indispensable("identify")
def test_identify_writes_a_complete_report(identified):
    folder, report = identified.reports / "0001", identified.report
    names = ["curves.csv", "mass.csv", "report.html", "report.json"]
    assert sorted(f.name for f in folder.iterdir()) == names
    assert sorted(f.name for f in folder.parent.iterdir()) == ["0001", "plotly.min.js"]
    assert report["valid"] is True
    assert "VALID" in identified.result.output
    assert f"{report['mass']['value']:.2f} kg" in identified.result.output
    lines = (folder / "mass.csv").read_text().splitlines()
    assert lines[0] == "time_s,mass_kg,u_kg,identified"
    assert len(lines) > 4000


@pytest.mark.indispensable("a folder of shots")
def test_identify_takes_a_folder_of_shots(run, stored: Path, tmp_path):
    result = run("identify", stored.parent, "--out", tmp_path, "--json")
    assert [r["shot"] for r in json.loads(result.stdout)["reports"]] == ["0001"]


@pytest.mark.whole_way
def test_identify_takes_the_memory_from_the_shot_if_asked(run, stored: Path, tmp_path):
    given, chosen = (
        json.loads(run("identify", stored, "--out", tmp_path / name, "--window-s", name, "--json").stdout)["reports"][0]
        for name in ("0.01", "auto")
    )
    assert given["window_s"] == pytest.approx(0.01, rel=0.01)
    assert given["window_reason"] == "given"
    assert "predicts" in chosen["window_reason"]
    assert given["mass"] == chosen["mass"]


@pytest.mark.whole_way
def test_a_memory_longer_than_the_interval_is_refused(run, stored: Path, tmp_path):
    result = run("identify", stored, "--out", tmp_path, "--window-s", "5")
    assert result.exit_code == 3
    assert "longer than the identification interval; expected at most 0.1" in result.stderr
    assert "found --window-s 5; give a shorter --window-s, or auto" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_what_the_memory_cannot_be_is_said_before_that_a_report_is_there(run, stored: Path, tmp_path):
    (tmp_path / "0001").mkdir()
    (tmp_path / "0001" / "report.json").write_text("{}", encoding="utf-8")
    result = run("identify", stored, "--out", tmp_path, "--window-s", "5")
    assert result.exit_code == 3
    assert "longer than the identification interval; expected less than the shot's record, 0.35 s" in result.stderr
    assert "exists" in run("identify", stored, "--out", tmp_path, "--window-s", "0.01").stderr


def test_the_terminal_says_what_speaks_for_and_against_the_mass(identified):
    lines, report = identified.result.stdout.splitlines(), identified.report
    assert any(f"E_n {report['E_n']:+.2f}, RPE" in line for line in lines)
    assert report["rpe_percent"]["meaning"] in lines
    assert report["notes"]
    assert {f"note: {note}" for note in report["notes"]} <= set(lines)


@pytest.mark.whole_way
def test_a_valid_mass_that_deviates_says_so(run, field_shot: TwinShot, tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text(field_shot.rig_file.read_text(encoding="utf-8").replace("m3 = 782.0", "m3 = 762.0"))
    run("ingest", rig, *field_shot.files, "--shot", "1", "--out", tmp_path)
    result = run("identify", tmp_path / "1.h5", "--out", tmp_path)
    assert result.exit_code == 0
    report = json.loads((tmp_path / "1" / "report.json").read_text(encoding="utf-8"))
    assert report["valid"]
    assert report["deviation"].startswith("deviates from the specification (E_n +")
    assert f"VALID, {report['deviation']}" in result.stdout
    # the page sets the index below the line
    assert f"Valid, {report['deviation']}".replace("E_n", "En") in text_of(tmp_path / "1" / "report.html")


@pytest.mark.whole_way
def test_the_date_of_a_shot_goes_from_its_files_into_report_and_page(run, mixed_shot: TwinShot, tmp_path):
    run("ingest", "mixed", *mixed_shot.files, "--shot", "1", "--out", tmp_path)
    shown = json.loads(run("show", tmp_path / "1.h5", "--json").stdout)
    assert shown["started_source"].startswith("0001_can.blf, ")
    assert f"started {shown['started']} (0001_can.blf, " in run("show", tmp_path / "1.h5").stdout
    run("identify", tmp_path / "1.h5", "--out", tmp_path)
    report = json.loads((tmp_path / "1" / "report.json").read_text(encoding="utf-8"))
    assert {key: report[key] for key in ("started", "started_source")} == {
        key: shown[key] for key in ("started", "started_source")
    }
    assert f"{shown['started']} (0001_can.blf" in text_of(tmp_path / "1" / "report.html")


@pytest.mark.whole_way
def test_identify_reports_the_method_that_was_asked_for(run, stored: Path, identified, tmp_path, field_shot: TwinShot):
    paper = run("identify", stored, "--out", tmp_path, "--method", "paper", "--json")
    default_report = identified.report
    paper_report = json.loads(paper.stdout)["reports"][0]
    truth = field_shot.truth["m3"]
    assert abs(default_report["mass"]["value"] / truth - 1) < 0.012
    assert default_report["rpe_percent"]["value"] < 2
    assert paper_report["mass"]["method"] == "paper"
    # attenuation by errors in variables: several percent low
    assert paper_report["mass"]["value"] / truth - 1 < -0.02
    assert {m["name"] for m in default_report["methods"]} == {"calibrated", "reverse", "forward", "paper", "kinematic"}


@pytest.mark.whole_way
def test_a_report_is_not_overwritten_unless_asked(run, stored: Path, identified, tmp_path):
    shutil.copytree(identified.reports, tmp_path, dirs_exist_ok=True)
    (tmp_path / "0001" / "notes.txt").write_text("mine")
    (tmp_path / "0001" / "plotly.min.js").write_text("each report had its own once")
    before = (tmp_path / "0001" / "report.json").read_bytes()
    again = run("identify", stored, "--out", tmp_path)
    assert again.exit_code == 3
    assert "--overwrite" in again.stderr
    assert (tmp_path / "0001" / "report.json").read_bytes() == before
    assert run("identify", stored, "--out", tmp_path, "--overwrite", "--standalone").exit_code == 0
    assert (tmp_path / "0001" / "notes.txt").read_text() == "mine"
    assert not (tmp_path / "0001" / "plotly.min.js").exists()
    page = (tmp_path / "0001" / "report.html").read_text(encoding="utf-8")
    assert len(page.encode()) < 3_000_000
    assert not [attributes["src"] for _, attributes in PageElements(page).elements if "src" in attributes]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["0001", "plotly.min.js"]


def test_show_lists_channels_clocks_and_files(run, stored: Path):
    result = run("show", stored)
    assert result.exit_code == 0
    for word in ("acc_recoil", "recoil_acceleration", "camera", "motion", "0001_dewetron.csv"):
        assert word in result.output
    assert json.loads(run("show", stored, "--json").stdout)["shot"] == "0001"


def test_check_passes_the_bundled_rigs(run):
    for rig in ("field-2013", "mixed"):
        result = run("check", rig)
        assert result.exit_code == 0
        assert "no fault" in result.output


def test_check_reports_every_fault_on_a_line_of_its_own(run, tmp_path, field_shot: TwinShot):
    rig = tmp_path / "rig.toml"
    text = field_shot.rig_file.read_text()
    rig.write_text(text.replace("u_rel = 0.005", "urel = 0.005").replace("phi10 =", "phi_10 ="))
    result = run("check", rig)
    assert result.exit_code == 3
    lines = result.stderr.splitlines()
    assert "faults" in lines[0]
    assert any("did you mean `u_rel`" in line for line in lines)
    assert any("did you mean `phi10`" in line for line in lines)
    document = json.loads(run("check", rig, "--json").stdout)
    assert len(document["faults"]) == len(lines) - 1


def without_uncertainty(rig: Path, field_shot: TwinShot) -> Path:
    """Write the rig without the uncertainties of the two most important sensors."""
    text = field_shot.rig_file.read_text(encoding="utf-8")
    assert text.count(", u_rel = 0.005") == 2
    rig.write_text(text.replace(", u_rel = 0.005", ""), encoding="utf-8")
    return rig


def test_a_role_without_a_stated_uncertainty_is_refused_before_the_day(run, field_shot: TwinShot, tmp_path):
    rig = without_uncertainty(tmp_path / "rig.toml", field_shot)
    for command in (("check", rig), ("ingest", rig, *field_shot.files, "--out", tmp_path / "shots")):
        result = run(*command)
        assert result.exit_code == 3
        for channel in ("acc_recoil", "p_breech"):
            assert f"'{channel}'.sensor.u_rel: is missing" in result.stderr
    assert not (tmp_path / "shots").exists()


@pytest.mark.whole_way
def test_a_shot_that_was_recorded_without_uncertainties_is_identified_and_not_valid(
    run, field_shot: TwinShot, tmp_path
):
    rig = load_rig(field_shot.rig_file)
    less = parse_rig(rig.text.replace(", u_rel = 0.005", ""), rig.path, refuse_doubts=False)
    path = ingest_files(less, field_shot.files, shot="old", out=tmp_path).path
    assert run("show", path).exit_code == 0
    result = run("identify", path, "--out", tmp_path / "reports", "--json")
    assert result.exit_code == 1, result.output
    report = json.loads(result.stdout)["reports"][0]
    assert abs(report["mass"]["value"] / field_shot.truth["m3"] - 1) < 0.05
    assert [reason.split(":")[1].strip() for reason in report["reasons"] if "u_rel" in reason] == [
        "channel[0] 'acc_recoil'.sensor.u_rel",
        "channel[5] 'p_breech'.sensor.u_rel",
    ]


@pytest.mark.whole_way
def test_what_is_taken_as_exact_is_said_in_check_verdict_and_report(run, field_shot: TwinShot, identified, tmp_path):
    said = [
        "taken as exact: bore_area, brake_area, recuperator_area",
        "1 +- 0.6 % of the breech force: bore_friction",
        "0 +- 1 % of the resistance: unread_share",
        "none is taken, 0 kg: carried_mass",
        "0 +- 0.2 % of the peak resistance: unread_force",
        "nothing that the breech chain does is taken until stated: muzzle_brake, tube_axial_hz, p_breech",
        "scale in a pulse known to 0.5 % only: p_breech",
        "delay of 0 +- 2 ms: p_recuperator",
        "no calibration standard in common (1 % of one would be 1 % of the mass): p_breech, p_brake, p_recuperator",
    ]
    ingest = ("ingest", "field-2013", *field_shot.files, "--shot", "9", "--out", tmp_path)
    for result in (run("check", "field-2013"), run(*ingest), identified.result):
        assert result.exit_code == 0
        lines = result.stdout.splitlines()
        assert [line for line in lines if line in said] == said
    for command in (("check", "field-2013"), (*ingest, "--overwrite")):
        rows = json.loads(run(*command, "--json").stdout)["assumptions"]
        assert (rows[0]["quantity"], rows[0]["taken"]) == ("bore_area", "taken as exact")
    assert identified.report["assumptions"] == rows
    assert f"Assumed: {'; '.join(said)}." in text_of(identified.reports / "0001" / "report.html")


def test_check_reports_an_overdue_calibration(run, tmp_path, field_shot: TwinShot):
    rig = tmp_path / "rig.toml"
    text = field_shot.rig_file.read_text()
    assert "due = 2099-12-31" in text
    rig.write_text(
        text.replace("calibrated = 2026-01-15, due = 2099-12-31", "calibrated = 2019-01-15, due = 2020-01-15", 1)
    )
    result = run("check", rig)
    assert result.exit_code == 3
    assert "calibration was due 2020-01-15" in result.stderr


@pytest.mark.whole_way
def test_simulate_gives_each_shot_a_folder(run, tmp_path):
    rig, out = tmp_path / "rig.toml", tmp_path / "out"
    rig.write_text(with_twin("field-2013", **SHORTER).text, encoding="utf-8")
    result = run("simulate", rig, "--seed", "3", "--shots", "2", "--out", out)
    assert result.exit_code == 0, result.output
    assert "each shot has sensors of its own; with --campaign-seed N they share them" in " ".join(result.output.split())
    assert [json.loads((out / n / "truth.json").read_text())["m3"] for n in ("0001", "0002")] == [782.0, 782.0]
    assert sorted(p.name for p in out.iterdir()) == ["0001", "0002"]
    again = run("simulate", rig, "--seed", "3", "--out", out)
    assert again.exit_code == 3


def test_simulate_with_another_setting_tells_it_in_the_truth_and_not_in_the_rig_file(run, tmp_path):
    rig, out = tmp_path / "rig.toml", tmp_path / "out"
    rig.write_text(with_twin("field-2013", **SHORTER).text, encoding="utf-8")
    given = ("--with", "unread.packing_share=0.02", "--with", "readings.camera_on_ground=true")
    result = run("simulate", rig, *given, "--out", out, "--json")
    assert result.exit_code == 0, result.output
    (shot,) = json.loads(result.stdout)["shots"]
    assert shot["truth"]["settings"] == {"unread.packing_share": 0.02, "readings.camera_on_ground": True}
    assert shot["truth"]["unread"]["impulse_share"] == pytest.approx(0.02, rel=0.01)
    assert (out / "0001" / "rig.toml").read_text(encoding="utf-8") == rig.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("given", "code", "said"),
    [
        ("unread.packing_shar=0.02", 3, "twin.unread.packing_shar: unknown key; did you mean `packing_share`?"),
        ("unread.packing_share=much", 3, "twin.unread.packing_share: must be a valid number"),
        ("peak_pressure_pa.x=1", 3, "twin.peak_pressure_pa.x: peak_pressure_pa is no table"),
        ("unread.packing_share", 2, "is not KEY=VALUE"),
    ],
)
def test_simulate_refuses_a_setting_that_is_none_in_one_line(run, tmp_path, given: str, code: int, said: str):
    result = run("simulate", "field-2013", "--with", given, "--out", tmp_path / "out")
    assert result.exit_code == code
    assert said in result.stderr
    assert not (tmp_path / "out").exists()


class Demonstrated(NamedTuple):
    """What `demo` printed, what it made, and its folder; not to be changed."""

    result: Result
    done: Demonstration
    folder: Path


@pytest.fixture(scope="module")
def demonstrated(tmp_path_factory):
    folder, kept = tmp_path_factory.mktemp("demonstrated") / "demo", []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo, "run_demo", keeping(demo.run_demo, kept))
        patch.setattr(demo, "load_rig", lambda name: with_twin(name, **SHORTER))
        result = CliRunner().invoke(app, ["demo", "--out", str(folder)])
    assert result.exit_code == 0, result.output
    return Demonstrated(result, kept[0], folder)


def keeping(function, kept):
    """Run a function at its first call, and return its answer at every call."""

    def once(*arguments, **options):
        kept[:] = kept or [function(*arguments, **options)]
        return kept[0]

    return once


@pytest.mark.indispensable("demo")
def test_demo_goes_the_whole_way_through_all_four_readers(run, monkeypatch, demonstrated):
    assert run("demo", "--out", demonstrated.folder).exit_code == 3
    monkeypatch.setattr(demo, "run_demo", lambda *_, **__: demonstrated.done)
    document = json.loads(run("demo", "--json").stdout)
    report = document["report"]
    assert abs(report["truth"]["error_percent"]) < 0.5
    assert report["rpe_percent"]["value"] < 2.0
    readers = {f["reader"] for f in report["provenance"]["inputs"]}
    assert {"Dewesoft text export", "ProAnalyst text", "Vector BLF log", "recoil-daq capture"} <= readers
    paper = next(m for m in report["methods"] if m["name"] == "paper")
    assert paper["mass_kg"] / report["truth"]["mass_kg"] - 1 < -0.02
    assert (Path(document["folder"]) / "report.html").exists()


def test_demo_prints_verdict_mass_truth_and_the_reports_path_in_twelve_lines(demonstrated):
    report = demonstrated.folder / "reports" / "0001" / "report.html"
    for word in ("USABLE", " kg (95 %)", "the specification of 782 kg", "truth 782.00 kg", str(report), "--verbose"):
        assert word in demonstrated.result.output
    assert len(demonstrated.result.output.strip().splitlines()) <= 12
    whole = console.shown(lambda: demonstrated.done.show(whole=True)).export_text()
    for word in ("mass 78", "RPE", "truth 782.00 kg", "11 checks passed"):
        assert word in whole


def test_an_error_as_json_is_a_document_too(run, tmp_path):
    result = run("show", tmp_path / "nothing.h5", "--json")
    assert result.exit_code == 3
    document = json.loads(result.stdout)
    assert (document["schema"], document["code"]) == ("recoil-daq/error/1", "read")
    assert document["path"].endswith("nothing.h5")


def test_debug_shows_the_traceback(run, tmp_path):
    assert "Traceback" in run("show", tmp_path / "nothing.h5", "--debug").stderr
    assert "Traceback" not in run("show", tmp_path / "nothing.h5").stderr


def test_ctrl_c_ends_with_130(run, monkeypatch, stored: Path, tmp_path):
    import recoil_daq.reports.identify

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(recoil_daq.reports.identify, "identify_shot", interrupted)
    result = run("identify", stored, "--out", tmp_path)
    assert result.exit_code == 130
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--live", "a.csv"), "either FILES or --live"),
        (("--live", "--overwrite"), "go with FILES"),
        (("--live", "--at", "1"), "go with FILES"),
        (("--live", "--shot", "first"), "number of the first shot"),
        (("--live", "--shot", "²"), "number of the first shot"),
        ((), "FILES, or --live"),
        (("a.csv", "--shots", "2"), "go with --live"),
        (("a.csv", "--watch", "in"), "go with --live"),
    ],
)
def test_live_and_files_do_not_mix(run, arguments, says):
    result = run("ingest", "mixed", *arguments)
    assert result.exit_code == 2
    assert says in " ".join(result.output.split())


@pytest.mark.whole_way
def test_the_shot_at_a_given_time_is_taken_out_of_a_recording(run, field_shot, tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text(triggered_rig().text, encoding="utf-8")
    result = run("ingest", rig, *field_shot.files, "--shot", "1", "--out", tmp_path, "--at", "0.06", "--json")
    assert result.exit_code == 0, result.output
    channels = {c["name"]: c for c in json.loads(run("show", tmp_path / "1.h5", "--json").stdout)["channels"]}
    assert channels["p_breech"]["start_s"] == pytest.approx(0.01, abs=3e-5)
    outside = run("ingest", rig, *field_shot.files, "--shot", "2", "--out", tmp_path, "--at", "99")
    assert outside.exit_code == 3
    assert "--at 99 s is not within this recording" in " ".join(outside.stderr.split())
    assert not (tmp_path / "2.h5").exists()


def test_a_rig_without_devices_is_no_rig_for_live(run, tmp_path):
    result = run("ingest", "field-2013", "--live", "--out", tmp_path / "out", "--no-screen")
    assert result.exit_code == 3
    assert "error: " in result.stderr
    assert not (tmp_path / "out").exists()


SHORTER_RANGE_DAY = f"""
import sys
from functools import partial
from recoil_daq import cli, demo
from recoil_daq.live import acquisition
from recoil_rigs.twin import range_day
sys.path.append({str(Path(__file__).parents[2])!r})
from tests.builders.shared_motions import share_motions
from tests.builders.virtual_shots import SHORTER, settling_soon, with_twin

share_motions()
demo.LIVE_DEMO_SHOTS, demo.LIVE_DEMO_SILENCE_S = 1, 0.7
demo.load_rig = lambda name: settling_soon(with_twin(name, **SHORTER))
acquisition.RangeDay = partial(acquisition.RangeDay, silence_after_s=0.9)
range_day.FILES_AFTER_S, range_day.PIECE_EVERY_S = 0.1, 0.03
cli.main()
"""
"""The command, of less and shorter shots than a person watches, with less silence between them."""


@pytest.mark.real_time
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals for the virtual port")
def test_a_demonstrated_range_day_identifies_the_mass_of_every_shot(run, tmp_path):
    # a process of its own: collecting the garbage of all tests before stops players and readers for longer than a shot
    command = [sys.executable, "-P", "-c", SHORTER_RANGE_DAY, "demo", "--live", "--json", "--out", tmp_path]
    with MachineStalls() as machine:
        result = subprocess.run(command, check=False, capture_output=True, text=True, timeout=600)
    document = json.loads(result.stdout)
    states = [shot["state"] for shot in document["session"]["shots"]]
    reasons = [shot["ingest"] and shot["ingest"]["reasons"] for shot in document["session"]["shots"]]
    # devices that play late, because the machine did nothing for so long, rightly cost a shot its verdict
    late = machine.largest_s > 0.1 and states == ["not usable"]
    assert states == ["usable"] or late, (machine.largest_s, reasons)
    assert document["session"]["journal"] is None
    assert len(document["reports"]) == 1 or late
    for report in document["reports"]:
        low, high = report["mass"]["U95"]
        assert abs(report["mass"]["value"] - 782.0) < high - low
        assert (tmp_path / "live" / "reports" / report["shot"] / "report.html").exists()
    # each was identified while the range was armed, without a second look at its shot file
    assert "identify shot" not in result.stderr
    assert len(re.findall(r"\d{4} mass \d+\.\d+ kg, 95 % ", result.stderr)) == len(document["reports"])
    assert "trigger (p_brake at" in result.stderr
    # its recorder was read live, and its file replaced that
    assert "preview" in result.stderr
    assert document["played"]["sources"]["dewetron"]["sent_ticks"]["stretches"]
    assert "was changed since it was armed" not in result.stderr
    assert "USABLE" in result.stderr
    again = run("demo", "--live", "--out", tmp_path)
    assert again.exit_code == 3
    assert "an earlier range day is here" in again.stderr
    demo._make_room(tmp_path / "live", "day", demo.LIVE_DEMO_FILES, overwrite=True)  # every file of it is known
    assert not (tmp_path / "live").exists()


@pytest.mark.real_time
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals for the virtual port")
def test_check_listens_to_devices(run, monkeypatch):
    listen = partial(device_check.check_devices, listen_s=0.5)
    monkeypatch.setattr(device_check, "check_devices", keeping(listen, []))
    result = run("check", "mixed", "--devices")
    assert result.exit_code == 0
    assert "Devices of rig mixed, VIRTUAL: played by this program; noise is" in result.stdout
    document = json.loads(run("check", "mixed", "--devices", "--json").stdout)
    assert {one["verdict"] for one in document["channels"]} == {"ok"}
    assert document["virtual"] is True


def test_recover_without_a_journal_says_so(run, tmp_path):
    result = run("recover", tmp_path)
    assert result.exit_code == 0
    assert "no journal was left over" in result.stdout
    assert json.loads(run("recover", tmp_path, "--json").stdout)["journals"] == []
    assert run("recover", tmp_path / "none").exit_code == 3
