"""A shot file without a recoil accelerometer, from the instruments' files to a complete report."""

from __future__ import annotations

import datetime as dt
import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from recoil_daq.cli import app
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.reports.identify_folder import repeatability, shared_options
from recoil_identification.shot.identified import Options
from recoil_rigs.twin import simulate_shot
from tests.builders.tracked_rigs import tracked_rig
from tests.builders.virtual_shots import SHORTER


@pytest.fixture(scope="module")
def shot_file(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("tracked")
    rig = tracked_rig("field-2013", **SHORTER)
    simulated = simulate_shot(rig, folder / "files", seed=7, shot="0001")
    return ingest_files(rig, simulated.files, shot="0001", out=folder / "shots", on=dt.date(2026, 6, 1)).path


@pytest.mark.whole_way
def test_the_report_has_every_key_and_a_page(shot_file, tmp_path):
    ran = CliRunner().invoke(app, ["identify", str(shot_file), "--out", str(tmp_path), "--json"])
    assert ran.exit_code == 0, ran.output
    report = json.loads((tmp_path / "0001" / "report.json").read_text(encoding="utf-8"))
    assert report["mass"]["method"] == report["provenance"]["parameters"]["method"] == "camera"
    low, high = report["mass"]["U95"]
    assert low < 782 < high
    assert report["mass"]["u"] > 0
    assert report["rpe_percent"]["value"] < 2
    assert {row["source"] for row in report["budget"]} > {"camera scale", "rate of clock camera"}
    assert [(a["clock"], a["method"], a["status"]) for a in report["alignment"]] == [("camera", "force", "ok")]
    assert any(c["check"] == "second sensor" and "cannot be checked" in c["detail"] for c in report["quality"])
    assert report["valid"] is True
    assert report["reasons"] == []
    assert [m["name"] for m in report["methods"]] == ["camera", "kinematic"]
    assert report["zero_shift"] is report["skew"] is report["uncertainty"]["frisch_bracket_kg"] is None
    assert report["filter"]["mass_cutoff_hz"] is None
    rows = (tmp_path / "0001" / "mass.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0] == "time_s,mass_kg,u_kg,identified"
    assert sum(row.endswith(",1") for row in rows) > 0.5 * len(rows)
    page = (tmp_path / "0001" / "report.html").read_text(encoding="utf-8")
    assert "no filter is in it" in page
    assert not re.search(r"\bnan\b", page.split("<script", 1)[0], re.IGNORECASE)


@pytest.mark.whole_way
def test_several_such_shots_need_no_cut_off_and_have_no_peaks_to_repeat(shot_file):
    (options,) = shared_options([shot_file, shot_file], Options()).values()
    assert options.campaign is None
    peaks = {"recorded_m_s2": None, "filtered_m_s2": None}
    assert repeatability([{"shot": name, "rig": "r", "peak_acceleration": peaks} for name in "ab"]) == {}


@pytest.mark.whole_way
def test_a_method_that_needs_the_accelerometer_says_so(shot_file, tmp_path):
    ran = CliRunner().invoke(app, ["identify", str(shot_file), "--out", str(tmp_path), "--method", "reverse"])
    assert ran.exit_code == 3
    assert "no channel of role recoil_acceleration" in " ".join(ran.output.split())
