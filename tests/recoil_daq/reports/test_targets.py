"""`identify --target` and `--compare`: what they write, print and refuse."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from recoil_daq.cli import app
from recoil_daq.reports.report_folder import publish
from recoil_identification.calibration.methods import FURTHER
from recoil_rigs.twin import TwinShot


@pytest.fixture(scope="module")
def written(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """Two targets of the stored shot, and what the command said."""
    out = tmp_path_factory.mktemp("targets")
    words = ["identify", str(stored), "--target", "inertia-force", "--target", "resistance", "--out", str(out)]
    return out, CliRunner().invoke(app, words)


@pytest.mark.indispensable("targets")
def test_targets_are_written_beside_one_another_and_printed(written: tuple[Path, Result], field_shot: TwinShot) -> None:
    out, result = written
    assert result.exit_code in (0, 1), result.output
    names = {"json", "html", "csv"}
    files = {p.name for p in (out / "0001").iterdir()}
    assert files == {f"{t}.{n}" for t in ("inertia-force", "resistance") for n in names}
    assert (out / "plotly.min.js").is_file()
    document = json.loads((out / "0001" / "resistance.json").read_text("utf-8"))
    assert (result.exit_code == 0) <= document["valid"]
    friction = next(q for q in document["quantities"] if q["symbol"].startswith("friction"))
    low, high = friction["U95"]
    assert low < field_shot.truth["friction"] < high
    assert "packing friction" in result.output
    page = (out / "0001" / "resistance.html").read_text("utf-8")
    assert document["title"] in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert (out / "0001" / "resistance.csv").read_text("utf-8").startswith("time_s,")


@pytest.mark.whole_way
def test_a_target_is_not_overwritten_and_the_mass_may_join_it(
    run, stored: Path, written: tuple[Path, Result], tmp_path: Path
) -> None:
    out = Path(shutil.copytree(written[0], tmp_path / "out"))
    before = (out / "0001" / "resistance.json").read_bytes()
    refused = run("identify", stored, "--target", "resistance", "--out", out)
    assert refused.exit_code == 3
    assert "--overwrite" in refused.output
    assert (out / "0001" / "resistance.json").read_bytes() == before
    assert run("identify", stored, "--out", out).exit_code == 0
    assert {"report.json", "mass.csv", "resistance.json"} <= {p.name for p in (out / "0001").iterdir()}


@pytest.mark.whole_way
def test_json_is_one_document_with_masses_and_targets(run, stored: Path, tmp_path: Path) -> None:
    result = run("identify", stored, "--target", "mass", "--target", "inertia-force", "--json", "--out", tmp_path)
    document = json.loads(result.stdout)
    assert [r["mass"]["unit"] for r in document["reports"]] == ["kg"]
    (target,) = document["targets"]
    assert target["target"] == "inertia-force"
    assert target["schema"] == "recoil-daq/target/1"
    assert {f["file"] for f in target["provenance"]["inputs"]} >= {"0001.h5"}


@pytest.mark.whole_way
def test_compare_adds_the_further_estimators_and_any_of_them_can_be_reported(
    run, stored: Path, field_shot: TwinShot, tmp_path: Path
) -> None:
    result = run("identify", stored, "--compare", "--method", "tls", "--json", "--out", tmp_path)
    (report,) = json.loads(result.stdout)["reports"]
    assert {*FURTHER, "camera"} <= {m["name"] for m in report["methods"]}
    assert report["mass"]["method"] == "tls"
    low, high = report["mass"]["U95"]
    assert low < field_shot.truth["m3"] < high
    # the Monte Carlo method draws from what the calibrated estimate minimises, not from another's
    assert report["uncertainty"]["monte_carlo"] is None


def test_an_unknown_target_is_wrong_usage(run, stored: Path) -> None:
    result = run("identify", stored, "--target", "colour")
    assert result.exit_code == 2
    assert "stiffness" in result.output


@pytest.mark.whole_way
def test_a_method_that_needs_a_camera_says_so_where_there_is_none(run, field_shot: TwinShot, tmp_path: Path) -> None:
    daq = [f for f in field_shot.files if "camera" not in f.name]
    run("ingest", "field-2013", *daq, "--shot", "0002", "--out", tmp_path)
    result = run("identify", tmp_path / "0002.h5", "--method", "camera", "--out", tmp_path / "r")
    assert result.exit_code == 3
    assert "no channel of role recoil_displacement" in result.output
    assert not (tmp_path / "r" / "0002").exists()


def test_what_fails_while_it_is_written_leaves_nothing(tmp_path: Path) -> None:
    def write(folder: Path) -> None:
        (folder / "half.json").write_text("{", encoding="utf-8")
        raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        publish(tmp_path / "0001", write)
    assert list(tmp_path.iterdir()) == []
