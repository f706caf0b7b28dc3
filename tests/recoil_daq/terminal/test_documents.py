"""The tables print what ``--json`` prints, read back: nothing that they show is in a result alone."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from recoil_daq import export, ingest_files, load_rig
from recoil_daq.recording.check import check_rig
from recoil_daq.recording.shot_log_rows import log_row, log_rows
from recoil_daq.recording.simulate import Simulated
from recoil_daq.terminal.campaign import print_campaign
from recoil_daq.terminal.check import print_rig
from recoil_daq.terminal.console import shown
from recoil_daq.terminal.file import print_exported, print_simulated
from recoil_daq.terminal.ingest import print_log, print_logged, print_verdict
from recoil_daq.terminal.report import print_mass, print_masses, print_report
from recoil_identification.campaign.combination import combine
from recoil_identification.report.document.campaign_document import campaign_document
from recoil_identification.shot.baseline import Baseline
from recoil_rigs.twin import TwinShot
from tests.builders.campaign_summaries import campaign_of
from tests.recoil_daq.conftest import Identified


def printed(document: Mapping[str, Any], table: Callable[..., None], *folder: Path) -> str:
    """Return what a table prints of a document that has been a text."""
    read_back = json.loads(json.dumps(document, allow_nan=False))
    return shown(lambda: table(read_back, *folder)).export_text()


@pytest.mark.whole_way
def test_a_shot_and_its_row_of_the_log_print_as_their_documents_do(field_shot: TwinShot, tmp_path: Path) -> None:
    done = ingest_files(load_rig("field-2013"), field_shot.files, shot="0001", out=tmp_path)
    assert printed(done.to_json(), print_verdict) == shown(done.show).export_text()
    row = log_row("0001", {"added_mass_kg": "-7.0", "exclude": "a test"}, folder=tmp_path)
    text = printed(row.to_json(), print_logged)
    assert text == shown(row.show).export_text()
    # the cell as it stands, what is doubtful of it, and what is taken for granted
    assert "-7.0 " in text
    assert "doubtful: added_mass_kg -7 " in text
    assert "taken as exact: added mass, -7 kg" in text
    listed = log_rows(tmp_path)
    assert printed(listed.to_json(), print_log) == shown(listed.show).export_text()
    assert "doubtful, 0001: " in str(listed)


def test_a_rig_and_its_files_print_as_their_documents_do(mixed_shot: TwinShot) -> None:
    checked = check_rig("mixed", mixed_shot.files[:1])
    document = checked.to_json()
    assert printed(document, print_rig) == shown(checked.show).export_text()
    brake = next(channel for channel in document["channels"] if channel["role"] == "brake_pressure")
    assert brake["u_rel"] == next(c.sensor.u_scale_rel for c in checked.rig.channels if c.name == brake["name"])


@pytest.mark.parametrize("format_name", ["csv", "mat"])
def test_exported_files_print_as_their_document_does(stored: Path, tmp_path: Path, format_name: str) -> None:
    done = export(stored, format_name, out=tmp_path)
    assert printed(done.to_json(), print_exported) == shown(done.show).export_text()


def test_simulated_shots_print_as_their_document_does(field_shot: TwinShot) -> None:
    done = Simulated((field_shot,), field_shot.folder.parent / "shotlog.csv")
    assert printed(done.to_json(), print_simulated) == shown(done.show).export_text()


def test_a_report_prints_as_its_file_does(identified: Identified) -> None:
    text = printed(identified.report, print_report, identified.reports / "0001")
    assert text.rstrip() == identified.result.output.rstrip()


@pytest.mark.parametrize(
    ("valid", "reasons"), [(True, []), (False, ["the brake is dead", "so is the bus", "and more"])]
)
def test_a_shot_is_told_in_six_lines(identified: Identified, valid: bool, reasons: list[str]) -> None:
    report = {**identified.report, "valid": valid, "reasons": reasons}
    lines = printed(report, print_mass, Path("reports/0001")).splitlines()
    assert len(lines) <= 6
    assert re.match(r"Shot \w+ on rig [\w-]+: \d+\.\d+ ± \d+\.\d+ kg \(95 %\), \d+\.\d+ kg below the spec", lines[0])
    assert lines[-1].endswith(f"-> {Path('reports/0001/report.html')}")
    if valid:
        assert lines[-1].startswith("VALID -> ")
    else:
        assert lines[-3].startswith("2 more reasons, ")
        assert lines[-2] == "NOT VALID: the brake is dead"


def test_what_is_alike_in_the_reports_of_many_shots_is_printed_once(identified: Identified) -> None:
    told: set[str] = set()
    first, second = (printed(identified.report, print_report, None, told) for _ in range(2))
    assert first == printed(identified.report, print_report, None)
    alike = ("taken as exact: ", "it is the mass that", "noise can only raise the RPE")
    assert all(line in first and line not in second for line in alike)
    assert "95 % interval" in second
    assert "VALID" in second


def test_a_calibration_that_does_not_cover_the_day_stands_beside_the_result(identified: Identified) -> None:
    text = "p_brake: calibration was due 2026-03-01, 1 day before the shot of 2026-03-02"
    finding = {"code": "calibration", "about": "p_brake", "severity": "warn", "text": text}
    said = f"a calibration does not cover the day of the shot: {text}"
    for valid, word in ((True, "VALID, but"), (False, "and:")):
        reasons = [] if valid else ["a reason"]
        report = {**identified.report, "valid": valid, "reasons": reasons, "deviation": None, "findings": [finding]}
        report["calibration_day"] = {"on": "2026-03-02", "of": "start"}
        shot = printed(report, print_report, identified.reports / "0001")
        assert f"{word} {said}" in " ".join(shot.split())
    masses = printed([{**report, "valid": True, "reasons": []}] * 2, print_masses)
    assert " ".join(masses.split()).count("a calibration does not cover") == 2


def test_what_a_chart_fires_is_a_look_and_no_change_among_the_shots() -> None:
    shots = [
        replace(shot, baseline=(Baseline("p", "breech_pressure", "4711", 100.0 * k + k % 2, 50.0, "Pa", 0.0),))
        for k, shot in enumerate(campaign_of((0.0,) * 8, seed=4).shots)
    ]
    document = campaign_document(combine(shots), version="1.2.3", inputs=[], parameters={"cutoff_hz": None})
    fired = [one["detail"] for one in document["signals"] if one["kind"] == "chart"]
    lines = printed(document, print_campaign, Path("campaign")).splitlines()
    at = lines.index(f"Looks that the control charts ask for ({len(fired)}); they say nothing against the mass:")
    assert lines[at + 1 : at + 1 + len(fired)] == [f"chart: {detail}" for detail in fired]
    assert "Nothing changed among the shots." in lines
