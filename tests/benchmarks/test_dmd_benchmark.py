"""How fast a recording of OXYGEN is opened and read, and how much memory that takes.

``DMD_BENCHMARK_MB`` sets the size of the file, 200 MB if it is not set; half of it where it is compressed.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.builders.oxygen_dmd import Stored, oxygen_chunks

MEGABYTES = int(os.environ.get("DMD_BENCHMARK_MB", "200"))
CHANNELS = 8
PER_BLOCK = 10_000
MOST_MEMORY_MB = 600

# In a process of its own: the peak of memory is that of a process's whole life
READ = """
import json, sys, time
from pathlib import Path
import numpy as np
from recoil_acquisition.readers.oxygen.dmd import OxygenReader
from recoil_acquisition.readers.reader import Declarations

def peak_mb():
    # not ru_maxrss, which a child inherits from the process that started it
    return int(next(l for l in open("/proc/self/status") if l.startswith("VmHWM")).split()[1]) / 1024

path, before, begin = Path(sys.argv[1]), peak_mb(), time.perf_counter()
recording = OxygenReader().open(path, Declarations("dewetron"))
opened, count, right = time.perf_counter(), recording.signals[0].sample_count, True
at = count // 2
part = recording.read("c3", at, at + 1000)
parted = time.perf_counter()
right = bool((part == (np.arange(at, at + 1000) % 8191 + 3) * 0.5).all())
for c in range(len(recording.signals)):
    step = 5_000_000
    for start in range(0, count, step):
        samples = recording.read(f"c{c}", start, start + step)
        right = right and samples[-1] == ((min(start + step, count) - 1) % 8191 + c) * 0.5
read = time.perf_counter()
print(json.dumps({"count": count, "right": bool(right), "open_s": opened - begin, "part_s": parted - opened,
                  "read_s": read - parted, "peak_mb": peak_mb(), "before_mb": before}))
"""


@pytest.fixture(autouse=True)
def _only_where_the_peak_of_memory_is_read():
    if not Path("/proc/self/status").exists():
        pytest.skip("the peak of memory is read from /proc")


def ramp(channel: int):
    return lambda low, high: np.arange(low, high) % 8191 + channel


@pytest.mark.parametrize("compression", ["", "lz4"])
def test_a_long_recording_is_read_within_bounded_memory(benchmark, capsys, compression, tmp_path: Path):
    ticks = MEGABYTES * 10**6 // (3 * CHANNELS) // PER_BLOCK * PER_BLOCK
    blocks = [(tick, PER_BLOCK) for tick in range(0, ticks, PER_BLOCK)]
    path = tmp_path / "a.dmd"
    with path.open("wb") as file:
        for chunk in oxygen_chunks(
            [Stored(f"c{c}", ramp(c)) for c in range(CHANNELS)],
            windows=((0, ticks),), blocks=blocks, frequency_hz=200_000.0, compression=compression,
        ):  # fmt: skip
            file.write(chunk)
    size_mb = path.stat().st_size / 1e6

    def run():
        done = subprocess.run([sys.executable, "-c", READ, str(path)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    told = benchmark.pedantic(run, rounds=1, warmup_rounds=0)
    with capsys.disabled():
        rate = told["count"] * CHANNELS / told["read_s"] / 1e6
        print(
            f"\n{size_mb:.0f} MB {compression or 'plain'}, {len(blocks)} blocks, {CHANNELS} x {told['count']} samples:"
            f" open {told['open_s']:.3f} s, 1000 samples from the middle {1e3 * told['part_s']:.1f} ms,"
            f" all {told['read_s']:.2f} s = {rate:.0f} million samples/s,"
            f" peak {told['peak_mb']:.0f} MB ({told['before_mb']:.0f} MB before)"
        )
    assert told["right"]
    assert told["count"] == ticks
    assert told["peak_mb"] < MOST_MEMORY_MB
