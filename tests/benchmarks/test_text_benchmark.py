"""A long text export: megabytes per second beside pandas' C parser on the same file, and the memory it takes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

MEGABYTES = float(os.environ.get("RECOIL_DAQ_TEXT_MB", "1000"))
"""Size of the export."""

CHANNELS = 8
ROUNDS = 3
MOST_MB = 600.0

PEAK = """
import json, time
def peak_mb():
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024
"""

OURS = """
import sys
from pathlib import Path
import pandas  # a library's import is no part of the reading, here or there; the whole process is timed as well
from recoil_acquisition.readers.text.dewesoft import DewesoftTextReader
from recoil_acquisition.readers.reader import Declarations
before = time.perf_counter()
recording = DewesoftTextReader().open(Path(sys.argv[1]), Declarations("dewetron"))
last = [recording.read(signal.name)[-1] for signal in recording.signals]
step_s = recording.time_base(recording.signals[0].name).step_s
print(json.dumps([time.perf_counter() - before, peak_mb(), last, step_s]))
"""

PANDAS = """
import sys
import pandas
before = time.perf_counter()
table = pandas.read_csv(sys.argv[1], engine="c")
print(json.dumps([time.perf_counter() - before, peak_mb(), table.iloc[-1, 1:].tolist(), 2e-5]))
"""

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is read from /proc")


def write_export(path: Path, megabytes: float) -> float:
    """Write an export of about this size in the recorder's own digits; return its megabytes."""
    random = np.random.default_rng(1)
    samples = random.normal(size=(20000, CHANNELS)) * 10.0 ** np.arange(-3, CHANNELS - 3)
    cells = [",".join(f"{value:.15G}" for value in row) + "\r\n" for row in samples]
    names = ",".join(["Time (s)", *(f"AI {i}/AI {i} (m/s2)" for i in range(1, CHANNELS + 1))])
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(names + "\r\n")
        at = 0
        while file.tell() < megabytes * 1e6:
            file.write("".join(f"{(at + i) * 2e-5:.6f},{row}" for i, row in enumerate(cells)))
            at += len(cells)
    return path.stat().st_size / 1e6


def measured(code: str, path: Path) -> tuple[float, float, list[float], float, float]:
    """Run a reading in a process of its own: seconds, peak memory in MB, last samples, step, whole process' seconds."""
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", PEAK + code, str(path)], capture_output=True, text=True, check=True)
    seconds, peak_mb, last, step_s = json.loads(done.stdout.splitlines()[-1])
    return seconds, peak_mb, last, step_s, time.perf_counter() - begin


class Read(NamedTuple):
    """What reading took, the best of some rounds."""

    seconds: float
    peak_mb: float
    whole_s: float


def beside_pandas(path: Path, rounds: int) -> tuple[Read, Read]:
    """Read a file in processes of their own, in turns, and check that both find the same; return ours and pandas'."""
    both = [(measured(OURS, path), measured(PANDAS, path)) for _ in range(rounds)]
    for ours, theirs in both:
        assert ours[2:4] == theirs[2:4]
    return tuple(
        Read(min(one[side][0] for one in both), max(one[side][1] for one in both), min(one[side][4] for one in both))
        for side in (0, 1)
    )


def test_a_long_export_is_read_in_twice_the_time_of_pandas_and_in_little_memory(tmp_path, capsys):
    path = tmp_path / "long.csv"
    megabytes = write_export(path, MEGABYTES)
    ours, pandas = beside_pandas(path, ROUNDS)
    path.unlink()
    with capsys.disabled():
        print(f"\n{megabytes:.0f} MB of text, {CHANNELS} channels and time, best of {ROUNDS}:")
        for name, took in (("ours", ours), ("pandas", pandas)):
            speed, mb = megabytes / took.seconds, took.peak_mb
            print(f"  {name:6} {speed:6.0f} MB/s, whole process {took.whole_s:5.2f} s, peak {mb:6.0f} MB")
    assert ours.peak_mb <= MOST_MB
    assert ours.seconds <= 2.0 * pandas.seconds
