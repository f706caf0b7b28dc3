"""A shot whose recorder wrote MDF 3 has the mass that it has by the recorder's text."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders.container_files import mdf_file


@pytest.mark.whole_way
def test_a_shot_of_mdf_3_has_the_mass_that_it_has_by_text(
    files: dict[str, Path], identified: Any, tmp_path: Path, run: Callable[..., Result]
) -> None:
    asammdf = pytest.importorskip("asammdf")
    text = recognise(files["dewetron"]).open(files["dewetron"], Declarations("dewetron"))
    signals = [
        asammdf.Signal(text.read(one.name), text.time_base(one.name).times_s, name=one.name, unit=one.unit)
        for one in text.signals
    ]
    recorded = files["dewetron"].with_suffix(".dat")
    recorded.write_bytes(mdf_file(signals, version="3.30"))
    ingested = run("ingest", "field-2013", recorded, files["camera"], "--shot", "0001", "--out", tmp_path / "shots")
    assert ingested.exit_code == 0, ingested.output
    assert run("identify", tmp_path / "shots" / "0001.h5", "--out", tmp_path / "reports").exit_code == 0
    report = json.loads((tmp_path / "reports" / "0001" / "report.json").read_text(encoding="utf-8"))
    for key in ("value", "u"):
        assert report["mass"][key] == pytest.approx(identified.report["mass"][key], rel=1e-9)
