"""How often the stated intervals hold the true mass on a line, and what three lengths of a record cost.

`RECOIL_DAQ_LINE_SHOTS` sets how many shots are taken (20 by default; the published figure is of 100). Two processes
share them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from recoil_rigs.rig import Rig
from recoil_rigs.twin import simulate_shot, with_settings
from tests.builders.line_shots import SLED, STROKE, STROKES, hammer, sled_outcome, sled_without_camera

SHOTS = int(os.environ.get("RECOIL_DAQ_LINE_SHOTS", "20"))
FIRST_SEED = 9001
LENGTHS: dict[str, tuple[Callable[[], Rig], dict[str, Any]]] = {
    "a blow of 1 ms": (hammer, {}),
    "a stroke of 1 s": (sled_without_camera, STROKE),
    "25 s of strokes": (sled_without_camera, STROKES),
}

# In a process of its own: the peak of memory is that of a process's whole life
IDENTIFY = """
import json, sys, time
from pathlib import Path
from recoil_rigs.rig import load_rig
from tests.builders.line_shots import identified

begun = time.perf_counter()
rig = load_rig(sys.argv[1])
found = identified(rig, [Path(one) for one in sys.argv[3:]], Path(sys.argv[2]))
took = time.perf_counter() - begun
peak = int(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1]) / 1024
e = found.chosen.estimate
print(json.dumps({"took_s": took, "peak_mb": peak, "mass_kg": e.mass_kg, "u_kg": e.u_kg,
                  "interval_kg": list(e.interval_kg), "valid": found.valid, "reasons": list(found.reasons)}))
"""


def one(seed: int) -> tuple[float, float, bool, bool, tuple[str, ...]]:
    """Error and u of a shot, relative, whether it is covered and valid, and what speaks against it."""
    done = sled_outcome(seed, SLED)
    e = done.found.chosen.estimate
    return done.error_rel, e.u_kg / e.mass_kg, done.covers, done.found.valid, tuple(done.found.reasons)


def all_shots() -> list[tuple[float, float, bool, bool, tuple[str, ...]]]:
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return list(pool.map(one, range(FIRST_SEED, FIRST_SEED + SHOTS), chunksize=2))


def test_the_stated_interval_holds_the_true_mass_of_a_sled(benchmark, capsys):
    done = benchmark.pedantic(all_shots, rounds=1, warmup_rounds=0)
    error, u = (np.array([row[n] for row in done]) for n in (0, 1))
    covered, valid = sum(row[2] for row in done), sum(row[3] for row in done)
    low, high = stats.binomtest(covered, SHOTS).proportion_ci(method="exact")
    with capsys.disabled():
        print(f"\nsled, {SHOTS} shots, {valid} valid, {benchmark.stats.stats.min / SHOTS:.2f} s each")
        print(
            f"bias {100 * error.mean():+.3f} %, sd {100 * error.std(ddof=1):.3f} %, mean u {100 * u.mean():.3f} %, "
            f"{covered} of {SHOTS} intervals hold the truth (exact 95 % interval of the share {low:.3f} to "
            f"{high:.3f}), root mean square of error over u {np.sqrt(np.mean((error / u) ** 2)):.3f}"
        )
        for reason in sorted({reason[:110] for row in done for reason in row[4]}):
            print("not valid:", reason)
    assert low <= 0.95 <= high
    assert valid >= 0.9 * SHOTS
    assert abs(error.mean()) < 3 * error.std(ddof=1) / np.sqrt(SHOTS) + 1e-3


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the peak of memory is read from /proc")
@pytest.mark.parametrize("name", LENGTHS)
def test_three_lengths_of_a_record(benchmark, capsys, name):
    make, settings = LENGTHS[name]
    with tempfile.TemporaryDirectory() as folder:
        rig = with_settings(make(), settings)
        shot = simulate_shot(rig, Path(folder) / "files", seed=3, shot="1")
        command = [sys.executable, "-c", IDENTIFY, shot.rig_file, Path(folder) / "shots", *shot.files]
        ran = benchmark.pedantic(
            lambda: subprocess.run(command, capture_output=True, text=True, check=True), rounds=1, warmup_rounds=0
        )
    found, truth_kg = json.loads(ran.stdout), shot.truth["m3"] + shot.truth["carried_mass"]
    with capsys.disabled():
        print(
            f"\n{name}: {found['took_s']:.1f} s, {found['peak_mb']:.0f} MB, {found['mass_kg']:.2f} kg, u "
            f"{100 * found['u_kg'] / found['mass_kg']:.2f} %, truth {truth_kg:.2f} kg, valid {found['valid']}"
        )
        for reason in found["reasons"]:
            print("not valid:", reason)
    low, high = found["interval_kg"]
    assert low <= truth_kg <= high or not found["valid"]
    assert found["peak_mb"] < 800
