"""Reports of both bundled rigs, made again from their shot files: here, and as on other kinds of computers.

`RECOIL_DAQ_REPORTS` sets how many shots there are of each rig (5 by default; the published figures are of 25).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from recoil_daq import check_reports, identify_folder, ingest_folder, load_rig, simulate

REPORTS = int(os.environ.get("RECOIL_DAQ_REPORTS", "5"))
RIGS = ("mixed", "field-2013")
SEED = 100
OTHERS = {
    "AVX2 only": {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR", "OPENBLAS_CORETYPE": "Haswell"},
    "SSE4 only": {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR", "OPENBLAS_CORETYPE": "Nehalem"},
    "two threads": {"OPENBLAS_NUM_THREADS": "2"},
}
"""Kinds of computers that this one can be made to be."""


@pytest.fixture(scope="module", params=RIGS)
def reports(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Reports of a rig beside the shots that they are of."""
    home, rig = tmp_path_factory.mktemp(request.param), load_rig(request.param)
    simulate(rig, home / "fired", seed=SEED, shots=REPORTS)
    ingest_folder(rig, home / "fired", out=home / "shots")
    shutil.rmtree(home / "fired")
    identify_folder(home / "shots", out=home / "reports")
    return home / "reports"


def test_every_number_of_every_report_comes_again_to_the_last_bit(reports: Path) -> None:
    since_s = time.perf_counter()
    checked = check_reports(reports)
    took_s = time.perf_counter() - since_s
    numbers = sum(one.comparison.numbers for one in checked.reports if one.comparison is not None)
    print(f"\n{reports.parent.name}: {len(checked.reports)} reports, {numbers} numbers, {took_s:.0f} s\n{checked}")
    assert checked.again
    assert len(checked.reports) == REPORTS


@pytest.mark.skipif(sys.platform != "linux", reason="the libraries are told by their environment what to use")
@pytest.mark.parametrize("kind", OTHERS)
def test_on_another_kind_of_computer_every_number_comes_again_within_1e_9(reports: Path, kind: str) -> None:
    command = [sys.executable, "-m", "recoil_daq.cli", "explain", str(reports), "--check", "--workers", "1"]
    done = subprocess.run(command, check=False, env={**os.environ, **OTHERS[kind]}, capture_output=True, text=True)
    if "cpu features" in done.stderr.lower():
        pytest.skip(f"this processor cannot be made one with {kind}")
    print(f"\n{reports.parent.name}, {kind}:\n{done.stdout}")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "comes again within 1e-09" in done.stdout
