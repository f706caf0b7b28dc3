"""How much memory it takes to ingest a recording of minutes in which a second is the shot, and how long.

``LONG_RECORDING_MB`` sets the size of the file, 100 MB if it is not set; 2000 is an hour of eight channels.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from recoil_daq import read_shot
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from tests.builders.long_recordings import long_dmd, triggered_rig, write_long_text

MEGABYTES = float(os.environ.get("LONG_RECORDING_MB", "100"))
TEXT_BYTES_PER_ROW, DMD_BYTES_PER_ROW = 110.0, 24.0
MOST_MEMORY_MB = 600.0

# In a process of its own: the peak of memory is that of a process's whole life
INGEST = """
import json, sys, time
from pathlib import Path
import recoil_rigs.shots.long_recording
from recoil_daq.recording.ingest import ingest_files
from recoil_rigs.rig import load_rig

recoil_rigs.shots.long_recording.LONG_SAMPLES = min(recoil_rigs.shots.long_recording.LONG_SAMPLES, int(sys.argv[1]))
begin = time.perf_counter()
done = ingest_files(load_rig(sys.argv[2]), sys.argv[3:5], shot="long", out=sys.argv[5])
took = time.perf_counter() - begin
# not ru_maxrss, which a child inherits from the process that started it
peak = int(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1]) / 1024
print(json.dumps({"took_s": took, "peak_mb": peak, "usable": done.shot.usable, "path": str(done.path)}))
"""


@pytest.fixture(autouse=True)
def _only_where_the_peak_of_memory_is_read():
    if not Path("/proc/self/status").exists():
        pytest.skip("the peak of memory is read from /proc")


@pytest.mark.parametrize("kind", ["text", "dmd"])
def test_a_long_recording_is_ingested_within_bounded_memory(kind: str, tmp_path: Path, capsys):
    rig = triggered_rig()
    rig_file = tmp_path / "rig.toml"
    rig_file.write_text(rig.text, encoding="utf-8")
    simulated = simulate_shot(rig, tmp_path / "files", seed=5, shot="1").files
    files = {("camera" if "camera" in file.name else "dewetron"): file for file in simulated}
    if kind == "text":
        rows = int(MEGABYTES * 1e6 / TEXT_BYTES_PER_ROW)
        path = tmp_path / "long.csv"
        write_long_text(files["dewetron"], path, (rows // 2,), rows)
    else:
        rows = int(MEGABYTES * 1e6 / DMD_BYTES_PER_ROW)
        path = tmp_path / "long.dmd"
        with path.open("wb") as file:
            for chunk in long_dmd(files["dewetron"], (rows // 2,), rows):
                file.write(chunk)
    size_mb = path.stat().st_size / 1e6
    command = [sys.executable, "-c", INGEST, str(4 * rows), rig_file, path, files["camera"], tmp_path / "shots"]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    mass = identify_shot(FiredShot(read_shot(Path(result["path"])), rig), Options()).chosen.estimate
    with capsys.disabled():
        print(
            f"\n{kind}: {size_mb:.0f} MB, {rows / 5e4:.0f} s of 8 channels: ingested in {result['took_s']:.1f} s "
            f"({size_mb / result['took_s']:.0f} MB/s), peak {result['peak_mb']:.0f} MB; "
            f"mass {mass.mass_kg:.2f} kg, u {mass.u_kg:.2f}"
        )
    assert result["usable"]
    assert abs(mass.mass_kg - rig.mechanism.m3) < 3 * mass.u_kg
    assert result["peak_mb"] < MOST_MEMORY_MB
