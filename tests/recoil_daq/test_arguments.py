"""What people name on a command line: shots by their names, and one thing in another's place."""

import json
import shutil
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError
from recoil_daq.arguments import FileKind, kind_of, named_report, named_shot


@pytest.fixture
def day(stored: Path, identified, files, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a rig, an instrument's file, a shot and its report, in which the command is called."""
    folder = tmp_path / "day"
    (folder / "shots").mkdir(parents=True)
    shutil.copy(stored, folder / "shots" / "0001.h5")
    shutil.copytree(identified.reports / "0001", folder / "reports" / "0001")
    shutil.copy(files["dewetron"], folder / "daq.csv")
    (folder / "rig.toml").write_text('schema = "recoil-daq/rig/1"\n', encoding="utf-8")
    (folder / "rig.dbc").write_text('VERSION ""\n', encoding="utf-8")
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.parametrize(
    ("path", "kind", "maker"),
    [
        ("shots", FileKind.FOLDER, ""), ("rig.toml", FileKind.RIG, ""), ("shots/0001.h5", FileKind.SHOT, ""),
        ("reports/0001/report.json", FileKind.REPORT, ""), ("rig.dbc", FileKind.DATABASE, ""),
        ("reports/0001/mass.csv", FileKind.OTHER, ""),
    ],
)  # fmt: skip
def test_a_file_is_known_for_what_it_is(day, path, kind, maker):
    assert kind_of(day / path) == (kind, maker)


def test_an_instruments_file_is_known_with_its_maker(day):
    kind, maker = kind_of(day / "daq.csv")
    assert (kind, bool(maker)) == (FileKind.RECORDING, True)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("ingest daq.csv rig.toml", ("daq.csv: this is an instrument's file (", "the order is `recoil-daq ingest RIG")),
        ("ingest shots rig.toml --batch", ("shots: this is a folder", "`recoil-daq ingest RIG FOLDER --batch`")),
        ("ingest shots/0001.h5 rig.toml", ("shots/0001.h5: this is a shot file", "expected a rig file (TOML)")),
        ("ingest reports/0001/report.json daq.csv", ("this is a report", "expected a rig file (TOML)")),
        ("ingest rig.dbc daq.csv", ("rig.dbc: this is a CAN database", "expected a rig file (TOML)")),
        ("ingest daq.csv --live", ("daq.csv: this is an instrument's file (", "`recoil-daq ingest RIG --live`")),
        ("ingest field-2013 daq.csv rig.toml", ("rig.toml: this is a rig file", "`recoil-daq ingest RIG FILES...`")),
        ("ingest field-2013 shots", ("shots: this is a folder", "takes one folder of many shots' files with --batch")),
        ("ingest field-2013 shots/0001.h5", ("this is a shot file", "`recoil-daq identify SHOTS...` takes it")),
        ("check daq.csv rig.toml", ("daq.csv: this is an instrument's file (", "`recoil-daq check RIG [FILES...]`")),
        ("check field-2013 rig.toml", ("rig.toml: this is a rig file", "`recoil-daq check RIG [FILES...]`")),
        ("predict shots/0001.h5", ("this is a shot file", "`recoil-daq predict RIG [--from SHOT]`")),
        ("simulate daq.csv", ("daq.csv: this is an instrument's file (", "`recoil-daq simulate RIG`")),
        ("identify daq.csv", ("this is an instrument's file (", "`recoil-daq ingest RIG FILES...` makes a shot file")),
        ("identify rig.toml", ("rig.toml: this is a rig file; expected a shot file; a rig comes first, or behind",)),
        ("identify reports/0001/report.json", ("this is a report", "`recoil-daq explain REPORT` takes it")),
        ("campaign daq.csv shots", ("daq.csv: this is an instrument's file (", "expected a shot file")),
        ("export daq.csv --format csv", ("daq.csv: this is an instrument's file (", "expected a shot file")),
        ("predict field-2013 --from daq.csv", ("daq.csv: this is an instrument's file (", "expected a shot file")),
        ("identify 0001 --rig daq.csv", ("daq.csv: this is an instrument's file (", "identify SHOTS... --rig RIG`")),
        ("campaign 0001 --rig shots", ("shots: this is a folder", "campaign SHOTS... --rig RIG`")),
        ("identify 0002", ("0002: no such file, and no shot of this name; found 0001",)),
        ("show 0002", ("0002: no such file, and no shot of this name; found 0001",)),
    ],
)
@pytest.mark.usefixtures("day")
def test_one_thing_in_anothers_place_is_called_what_it_is(run, words, told):
    result = run(*words.split(), *([] if words.split()[0] in ("check", "predict", "show") else ["--out", "out"]))
    assert result.exit_code == 3, result.output
    (line,) = result.stderr.splitlines()
    for part in told:
        assert part in line
    assert not Path("out").exists()


@pytest.mark.whole_way
@pytest.mark.usefixtures("day")
def test_a_shot_is_known_by_its_name_everywhere(run):
    for name in ("0001", "1", "0001.h5", "shots/0001", "shots/1"):
        assert named_shot(Path(name)) == Path("shots/0001.h5")
    assert json.loads(run("show", "1", "--json").stdout)["shot"] == "0001"
    assert run("export", "0001", "--format", "csv", "--out", "out").exit_code == 0
    assert run("identify", "0001", "--out", "out").exit_code == 0
    assert json.loads(run("log", "1", "notes=a", "--json").stdout)["shot"] == "0001"
    assert named_report(Path("1")) == Path("reports/0001")
    assert run("explain", "1", "mass", "--json").exit_code == 0


def test_a_name_that_could_be_two_shots_is_none(day):
    shutil.copy(day / "shots" / "0001.h5", day / "shots" / "001.h5")
    with pytest.raises(ReadError, match="no shot of this name; found 001, 0001"):
        named_shot(Path("1"))
    assert named_shot(Path("001")) == Path("shots/001.h5")


def test_log_without_a_shot_lists_all_rows(run, day):
    assert "no row; `recoil-daq log SHOT KEY=VALUE` adds one" in run("log").output
    run("log", "1", "notes=a", "added_mass_kg=-120")
    shutil.copy(day / "shots" / "0001.h5", day / "shots" / "0002.h5")
    result = run("log")
    assert result.exit_code == 0
    assert ["0001", "-120", "a"] in [line.split() for line in result.output.splitlines()]
    assert "no row: 0002" in result.output
    assert "doubtful, 0001: added_mass_kg -120 says" in result.output
    document = json.loads(run("log", "--json").stdout)
    assert document["rows"] == [{"shot": "0001", "added_mass_kg": -120.0, "notes": "a"}]
    assert run("log", "--dir", "nowhere").exit_code == 3
