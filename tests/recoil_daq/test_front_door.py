"""`import recoil_daq`: what a script or a notebook finds, and how results show themselves."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import venv
import zipfile
from pathlib import Path

import pytest

import recoil_daq
from recoil_daq import (
    Ingested,
    Options,
    Reported,
    export,
    identify_file,
    identify_folder,
    ingest_files,
    load_rig,
    open_recording,
    read_shot,
    simulate,
    write_shot,
)
from tests.builders.other_firings import fired_again

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Ingested, Reported]:
    folder = tmp_path_factory.mktemp("door")
    rig = load_rig("field-2013")
    # the motion of this folder's other tests
    fired = simulate(rig, folder / "simulated", seed=1)
    ingested = ingest_files(rig, fired.shots[0].files, shot="0001", out=folder / "shots")
    return ingested, identify_file(ingested.path, out=folder / "reports")


def test_every_public_name_is_there_and_nothing_else_is_promised() -> None:
    for name in recoil_daq.__all__:
        assert getattr(recoil_daq, name) is not None
    assert dir(recoil_daq) == sorted(recoil_daq.__all__)
    with pytest.raises(AttributeError, match="no attribute 'identify_all'"):
        recoil_daq.identify_all  # noqa: B018 - asking is the test


@pytest.mark.whole_way
def test_a_result_is_one_line_all_lines_or_a_page(done: tuple[Ingested, Reported], run) -> None:
    ingested, report = done
    acceleration = ingested.shot.channels["acc_recoil"]
    recording = open_recording(next((report.folder.parents[1] / "simulated").rglob("*dewetron.csv")))
    for result in (ingested, report, ingested.shot, ingested.rig, acceleration, recording):
        assert "\n" not in repr(result)
        assert len(repr(result)) < 250
    assert repr(report).startswith("Reported('0001': ")
    assert repr(acceleration) == "Channel('acc_recoil': acceleration in m/s^2, 25000 at 50000 Hz on 'dewetron')"
    assert repr(recording) == "Recording('0001_dewetron.csv': 8 signals, Dewesoft text export)"
    assert "USABLE" in str(ingested)
    assert (
        str(report) in run("identify", "--verbose", ingested.path, "--out", report.folder.parent, "--overwrite").output
    )
    page = report._repr_html_()
    assert page.startswith("<pre")
    assert "VALID" in page


@pytest.mark.whole_way
def test_a_report_has_its_figures_as_numbers(done: tuple[Ingested, Reported]) -> None:
    report = done[1]
    low, high = report.interval_kg
    assert low < report.mass_kg < high
    assert report.u_kg == pytest.approx((high - low) / 4, rel=0.1)
    assert report.rpe_percent is not None
    assert (report.valid, report.reasons) == (True, ())
    assert report.to_json()["mass"]["value"] == report.mass_kg


@pytest.mark.whole_way
def test_a_folder_of_shots_is_identified_with_one_cutoff(done: tuple[Ingested, Reported], tmp_path: Path) -> None:
    shots = tmp_path / "shots"
    shots.mkdir()
    for name in ("a", "b"):
        write_shot(fired_again(read_shot(done[0].path), name), shots / f"{name}.h5")
    first, second = identify_folder(shots, out=tmp_path / "again", options=Options(), overwrite=True)
    assert first.mass_kg == second.mass_kg
    assert first.document["filter"]["basis"] == "campaign"


@pytest.mark.whole_way
def test_shots_are_exported_and_any_file_opened(done: tuple[Ingested, Reported], tmp_path: Path) -> None:
    exported = export(done[0].path, "parquet", out=tmp_path)
    assert str(exported).startswith("Shot 0001 on rig field-2013 as parquet")
    recording = open_recording(next(file.path for file in exported.files if "dewetron" in file.path.name))
    assert "acc_recoil" in [signal.name for signal in recording.signals]
    assert read_shot(done[0].path).name == "0001"


@pytest.mark.whole_way
def test_a_users_script_and_the_analyst_s_are_type_checked_against_the_installed_wheel(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    made = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stdout + made.stderr
    venv.create(tmp_path / "user", with_pip=False)
    (packages,) = (tmp_path / "user").glob("[Ll]ib/**/site-packages")
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        names = wheel.namelist()
        wheel.extractall(packages)
    assert {name.split("/")[0] for name in names if not name.endswith(("METADATA", "WHEEL", "RECORD"))} >= {
        "recoil_daq", "recoil_identification", "recoil_processing", "recoil_rigs", "recoil_acquisition",
    }  # fmt: skip
    assert not [name for name in names if name.startswith(("daq/", "tests/"))]
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent("""
            from recoil_daq import identify_file, ingest_files, load_rig

            done = ingest_files(load_rig("rig.toml"), ["a.csv"])
            mass: float = identify_file(done.path).mass_kg
            wrong: str = identify_file(done.path).u_kg
            done.shot.nonsense
        """),
        encoding="utf-8",
    )
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    analyst = page.partition("<!-- example: analyst -->\n```python\n")[2].partition("```\n")[0]
    (tmp_path / "analyst.py").write_text(analyst, encoding="utf-8")
    scripts = [str(script), str(tmp_path / "analyst.py")]
    python = next((tmp_path / "user").glob("[bS]*/python*"))
    options = ["--strict", "--python-executable", str(python), "--ignore-missing-imports"]
    check = [sys.executable, "-m", "mypy", *options, *scripts]
    checked = subprocess.run(check, cwd=tmp_path, capture_output=True, text=True, check=False)
    found = [line.split(": error: ")[1] for line in checked.stdout.splitlines() if ": error: " in line]
    assert found == [
        'Incompatible types in assignment (expression has type "float", variable has type "str")  [assignment]',
        '"Shot" has no attribute "nonsense"  [attr-defined]',
    ], checked.stdout + checked.stderr
