"""The mass of a live shot, in the process that stays warm: what its page gets with it."""

from __future__ import annotations

import base64
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from recoil_daq.reports.shot_mass import shot_mass
from recoil_identification.report.document.report_files import read_curves


@pytest.mark.whole_way
def test_every_pressure_is_kept_behind_the_low_pass_for_the_page(stored: Path, tmp_path: Path) -> None:
    file = Path(shutil.copy(stored, tmp_path / "0001.h5"))
    mass = shot_mass((file, tmp_path / "reports", False))
    script = (tmp_path / "overviews/0001/filtered.js").read_text("ascii")
    told = json.loads(script.partition("] = ")[2].rstrip(";\n"))
    curves = {name: np.frombuffer(base64.b64decode(text), "<f4") for name, text in told["curves"].items()}
    of_report = read_curves(tmp_path / "reports/0001")
    assert of_report is not None
    np.testing.assert_allclose(curves["time_s"], of_report.times_s, atol=1e-6)
    for name, values in of_report.values.items():
        np.testing.assert_allclose(curves[name], values, rtol=1e-4, atol=1e-6 * np.nanmax(np.abs(values)))
    for role in ("brake_pressure_pa", "recuperator_pressure_pa"):
        assert np.nanmax(curves[role]) == pytest.approx(mass["peaks"][role], rel=0.05)
