"""A report leaves for the GUM Tree Calculator: the same u, the same degrees of freedom, and what two shots share."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from recoil_daq import StoreError
from recoil_daq.reports.gtc_export import export_report
from recoil_identification.report.document.document import sealed
from recoil_identification.report.document.gtc_archive import gtc_archive
from tests.recoil_daq.conftest import Identified

gtc = pytest.importorskip("GTC", reason="GTC, which opens the archive, is not installed")
persistence = pytest.importorskip("GTC.persistence", reason="GTC, which opens the archive, is not installed")


def opened(report: dict[str, Any]) -> Any:
    """The mass of a report as GTC restores it."""
    return persistence.load_json(io.StringIO(json.dumps(gtc_archive(report)))).extract("mass")


def another_shot(report: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """A report of another shot: half of each sensitivity's size is another one's, some turn their sign."""
    rows = [
        {**row, "u_kg": row["u_kg"] * (0.5 + 0.1 * k), "sensitivity_kg": -(row["sensitivity_kg"] or 0.0) or None}
        if k % 3 == 0
        else row
        for k, row in enumerate(report["budget"])
    ]
    inputs = [{**report["provenance"]["inputs"][0], "sha256": 64 * "0"}]
    other = {**report, "shot": "0002", "budget": rows, "provenance": {**report["provenance"], "inputs": inputs}}
    return sealed({**other, **changes})


def test_gtc_opens_the_mass_with_the_u_and_the_degrees_of_freedom_of_the_report(identified: Identified) -> None:
    report = identified.report
    mass = opened(report)
    assert gtc.value(mass) == report["mass"]["value"]
    assert gtc.uncertainty(mass) == pytest.approx(report["mass"]["u"], rel=1e-12)
    assert gtc.dof(mass) == pytest.approx(report["uncertainty"]["degrees_of_freedom"], rel=1e-9)
    listed = {one.label.partition(",")[0]: one.u for one in gtc.rp.budget(mass, trim=0.0)}
    assert listed == pytest.approx({row["source"]: row["u_kg"] for row in report["budget"]}, rel=1e-12)


def test_masses_of_two_shots_correlate_by_what_they_share(identified: Identified) -> None:
    one, other = identified.report, another_shot(identified.report)
    masses = opened(one), opened(other)
    signed = [
        [math.copysign(row["u_kg"], row["sensitivity_kg"] or 1.0) for row in report["budget"]]
        for report in (one, other)
    ]
    shared = [a * b for row, a, b in zip(one["budget"], *signed, strict=True) if row["scope"] != "shot"]
    expected = math.fsum(shared) / math.hypot(*signed[0]) / math.hypot(*signed[1])
    assert 0.1 < abs(expected) < 0.99
    assert gtc.get_correlation(*masses) == pytest.approx(expected, rel=1e-9)


def test_nothing_is_shared_with_another_rig_or_after_another_calibration(identified: Identified) -> None:
    report = identified.report
    channels = [{**one, "calibrated": "2031-01-01"} for one in report["channels"]]
    other = another_shot(report, rig="another", channels=channels)
    assert gtc.get_correlation(opened(report), opened(other)) == 0.0


def test_the_command_writes_a_file_once(identified: Identified, run: Callable[..., Any], tmp_path: Path) -> None:
    done = run("export", identified.reports / "0001", "--format", "gtc", "--out", tmp_path)
    assert done.exit_code == 0
    with (tmp_path / "0001.gtc.json").open(encoding="utf-8") as file:
        assert gtc.value(persistence.load_json(file).extract("mass")) == identified.report["mass"]["value"]
    with pytest.raises(StoreError, match="--overwrite"):
        export_report(identified.reports / "0001", out=tmp_path)
    assert run("export", identified.reports / "0001", "--format", "gtc", "--rate", "10 Hz").exit_code == 2
