"""Processor time and memory of one step on data of one size, each in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.twin import simulate_shot
from tests.builders.long_recordings import triggered_rig, write_long_text
from tests.builders.virtual_shots import with_twin

OWN_CHANNELS = 8
"""Of the recorder of `field-2013`."""
STEP = """
import json, resource, sys, time
{imports}
words = sys.argv[1:]
def cpu():
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
{before}
before, clock = cpu(), time.perf_counter()
{step}
took = cpu() - before, time.perf_counter() - clock
# not ru_maxrss, which a child inherits from the process that started it
peak = int(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1]) / 1024
print(json.dumps([*took, peak]))
"""
INGEST = STEP.format(
    imports="from recoil_daq import ingest_files, load_rig\nimport scipy.signal, pandas, h5py",
    before="rig = load_rig(words[0])",
    step="ingest_files(rig, words[3:], shot=words[2], out=words[1], overwrite=True)",
)
IDENTIFY = STEP.format(
    imports="from recoil_daq import identify_file\nimport scipy.signal, scipy.optimize, h5py, jinja2",
    before="",
    step="for path in words[1:]: identify_file(path, out=words[0])",
)
COMBINE = STEP.format(
    imports="from recoil_identification.campaign.combination import combine\n"
    "from tests.builders.campaign_summaries import campaign_of\nimport scipy.stats, scipy.linalg",
    before="combine(campaign_of([0.0, 120.0]).shots)\n"
    "drawn = campaign_of([120.0 * (i % 2) for i in range(int(words[0]))])",
    step="found = combine(drawn.shots)\nassert abs(found.mass.mass_kg - drawn.mass_kg) < 5 * found.mass.u_kg",
)


class Point(NamedTuple):
    """What a step took on data of a size: processor time and time on the clock, s, and the peak of memory, MB."""

    size: float
    cpu_s: float
    wall_s: float
    peak_mb: float


def run(size: float, code: str, *words: object, rounds: int = 1) -> Point:
    """Run a step in a process of its own; of several rounds the least of each figure counts."""
    found = []
    for _ in range(rounds):
        done = subprocess.run(
            [sys.executable, "-c", code, *map(str, words)], capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise RuntimeError(done.stderr)
        found.append(json.loads(done.stdout.splitlines()[-1]))
    return Point(size, *(min(column) for column in zip(*found, strict=True)))


def saved(rig: Rig, folder: Path) -> Path:
    path = folder / "rig.toml"
    path.write_text(rig.text, encoding="utf-8")
    return path


def split(files: Sequence[Path]) -> tuple[Path, Path]:
    """Return the recorder's file and the camera's."""
    camera = next(file for file in files if "camera" in file.name)
    return next(file for file in files if file != camera), camera


def ingest_of_samples(samples: int) -> Point:
    """Ingest a recorder's text of so many samples in 8 channels, all of which are kept."""
    with tempfile.TemporaryDirectory() as name:
        folder, rig = Path(name), triggered_rig()
        recorder, camera = split(simulate_shot(rig, folder / "files", seed=5, shot="1").files)
        rows = samples // OWN_CHANNELS
        long = folder / "long_dewetron.csv"
        if rows == 25_000:  # a shot of this rig
            long = recorder
        else:
            write_long_text(recorder, long, (rows // 2 if samples > 2**24 else 0,), rows)
        return run(
            samples, INGEST, saved(rig, folder), folder / "shots", "s", long, camera, rounds=1 if samples > 2**24 else 2
        )


def ingest_of_long_recording(samples: int) -> Point:
    """Ingest a recorder's text of more than 16.8 million samples in 8 channels, of which the trigger takes the shot."""
    return ingest_of_samples(samples)


def identify_of_samples(samples: int) -> Point:
    """Identify a shot whose 8 channels have so many samples, half a second or at 1 MHz: it may keep 16.8 million."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rate_hz = min(samples / OWN_CHANNELS / 0.5, 1e6)
        rig = with_twin("field-2013", sample_rate_hz=rate_hz, duration_s=samples / OWN_CHANNELS / rate_hz)
        path = saved(rig, folder)
        files = simulate_shot(rig, folder / "files", seed=5, shot="1").files
        run(samples, INGEST, path, folder / "shots", "s", *files)
        return run(samples, IDENTIFY, folder / "reports", folder / "shots/s.h5")


def ingest_of_channels(channels: int) -> Point:
    """Ingest a recorder's text of so many channels of 25 thousand samples."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rig = with_twin("field-2013")
        recorder, camera = split(simulate_shot(rig, folder / "files", seed=5, shot="1").files)
        more = range(channels - OWN_CHANNELS)
        head, _, tail = rig.text.partition("[twin]\n")
        table = (
            '\n[[channel]]\nname = "more_{0}"\nsource = "dewetron"\nsignal = "more {0}/more_{0}"\n'
            'quantity = "acceleration"\nsensor = {{ range = [-5000.0, 5000.0] }}\n'
        )
        rig = parse_rig(head + "".join(table.format(i) for i in more) + "\n[twin]\n" + tail, rig.path)
        names, *lines = recorder.read_text(encoding="utf-8").splitlines()
        wide = [names + "".join(f",more {i}/more_{i} (m/s2)" for i in more)]
        for line in lines:
            first = line.split(",")[1]
            wide.append(line + f",{first}" * len(more))
        recorder.write_text("\n".join(wide) + "\n", encoding="utf-8")
        return run(channels, INGEST, saved(rig, folder), folder / "shots", "s", recorder, camera, rounds=2)


def identify_of_shots(shots: int) -> Point:
    """Identify so many shots of 0.2 million samples, one after the other in one process."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rig = with_twin("field-2013")
        path = saved(rig, folder)
        stored = []
        for i in range(shots):
            files = simulate_shot(rig, folder / f"files{i}", seed=i + 1, shot="1").files
            run(1, INGEST, path, folder / "shots", f"{i:04d}", *files)
            stored.append(folder / f"shots/{i:04d}.h5")
        return run(shots, IDENTIFY, folder / "reports", *stored)


def campaign_of_shots(shots: int) -> Point:
    """Combine the summaries of so many shots to one mass, and look for changes among them."""
    return run(shots, COMBINE, shots, rounds=2)


class Series(NamedTuple):
    """A step, what its data grow by, the sizes, and how a point is measured."""

    title: str
    by: str
    sizes: tuple[int, ...]
    measure: Callable[[int], Point]


SERIES = {
    "ingest-samples": Series("ingest", "samples", (2 * 10**5, 10**6, 3 * 10**6, 10**7), ingest_of_samples),
    "long-samples": Series("ingest of a long recording", "samples", (3 * 10**7, 10**8), ingest_of_long_recording),
    "ingest-channels": Series("ingest", "channels", (8, 16, 32, 64), ingest_of_channels),
    "identify-samples": Series(
        "identify", "samples", (10**5, 10**6, 3 * 10**6, 10**7, 16 * 10**6), identify_of_samples
    ),
    "identify-shots": Series("identify", "shots", (1, 2, 4, 8), identify_of_shots),
    "campaign-shots": Series("campaign", "shots", (10, 30, 100, 300, 1000), campaign_of_shots),
}
