"""Many damaged shot files, and all crafted ones: no crash, no foreign exception, nothing of another file, no excess.

`RECOIL_DAQ_DAMAGES` sets how many are made by chance (500 by default).
"""

from __future__ import annotations

import io
import os
import random
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import pytest

from recoil_acquisition.errors import StoreError
from recoil_acquisition.processes.reader_process import READER, cpu_s, most_bytes
from recoil_acquisition.shot.shot import Shot
from recoil_acquisition.store import is_shot_file, read_shot, reading, shot_summary, write_shot
from recoil_daq.live.tables import print_acquisition
from recoil_daq.terminal.file import print_summary
from tests.builders.hostile_shot_files import CRAFTED, SECRET, craft, replace_item, wrong_types
from tests.builders.shots import make_shot

resource = pytest.importorskip("resource", reason="Windows tells neither memory nor processor time of a child")

DAMAGES = int(os.environ.get("RECOIL_DAQ_DAMAGES", "500"))
MEASURED = 300
PAGE = 4096
_READ = reading._read


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> list[Path]:
    """A shot with everything, of some samples and of many, and one with hardly anything."""
    folder = tmp_path_factory.mktemp("sound")
    plain = make_shot()
    few = Shot("1", "r", "", "dewetron", {"acc_recoil": plain.channels["acc_recoil"]})
    for name, shot in (("a", few), ("b", plain), ("c", make_shot(21_000, 2_000))):
        write_shot(shot, folder / f"{name}.h5")
    return sorted(folder.iterdir())


def bits(content: bytearray, choice: random.Random) -> None:
    for _ in range(choice.choice((1, 2, 8))):
        content[choice.randrange(len(content))] ^= 1 << choice.randrange(8)


def random_bytes(content: bytearray, choice: random.Random) -> None:
    for _ in range(20):
        content[choice.randrange(len(content))] = choice.randrange(256)


def zeros(content: bytearray, choice: random.Random) -> None:
    at, count = choice.randrange(len(content)), choice.choice((16, 512, PAGE))
    content[at : at + count] = bytes(len(content[at : at + count]))


def cut(content: bytearray, choice: random.Random) -> None:
    del content[choice.randrange(len(content)) :]


def swapped_pages(content: bytearray, choice: random.Random) -> None:
    size = choice.choice((64, 512, PAGE))
    a, b = (size * choice.randrange(len(content) // size) for _ in range(2))
    content[a : a + size], content[b : b + size] = content[b : b + size], content[a : a + size]


KINDS = (bits, random_bytes, zeros, cut, swapped_pages)


def outcome(path: Path, every: bool) -> str:
    """Read a file in all ways, or in one; return what came of it. Any other exception ends the test."""
    try:
        shot = read_shot(path)
    except StoreError as error:
        said = str(error)
        assert "\n" not in said
        assert SECRET.decode() not in said
        found = "refused: the process that read it ended" if "HDF5 library ended" in said else "refused"
    else:
        found = "read"
        assert SECRET.decode() not in repr(shot)
        assert all(SECRET not in c.samples.tobytes() for c in shot.channels.values())
    if every:
        assert is_shot_file(path) or found != "read"
        try:
            summary = shot_summary(path)
        except StoreError:
            return found
        print_summary(summary)
        print_acquisition(summary)
    return found


def test_damaged_and_crafted_shot_files(sound, tmp_path, capsys):
    choice = random.Random(20261122)  # noqa: S311 - places of damage, no secret
    begin_s, counts, longest_s = time.perf_counter(), Counter(), 0.0
    contents = [path.read_bytes() for path in sound]
    path = tmp_path / "x.h5"
    first = READER.start().pid
    excess = cpu = 0.0
    for k in range(DAMAGES):
        damage = KINDS[k % len(KINDS)]
        content = bytearray(choice.choices(contents, (6, 3, 1))[0])
        damage(content, choice)
        path.write_bytes(content)
        one_s = time.perf_counter()
        counts[damage.__name__, outcome(path, every=k % 10 == 0)] += 1
        longest_s = max(longest_s, time.perf_counter() - one_s)
        if k % max(DAMAGES // MEASURED, 1) == 0:
            excess, cpu = _measured(path, excess, cpu)
    crafted: Counter[str] = Counter()
    rich = sound[1]
    for how in CRAFTED.values():
        crafted[outcome(craft(rich, path, how), every=True)] += 1
        excess, cpu = _measured(path, excess, cpu)
    with h5py.File(rich) as file:
        cases = wrong_types(file)
    for name, value in cases:
        crafted[outcome(replace_item(rich, path, name, value), every=True)] += 1
    with capsys.disabled():
        print(f"\n{DAMAGES} damages, {sum(crafted.values())} crafted files in {time.perf_counter() - begin_s:.0f} s")
        for (damage, found), count in sorted(counts.items()):
            print(f"  {damage:14} {found:40} {count}")
        print(f"  crafted: {dict(crafted)}")
        print(f"  the longest took {longest_s:.2f} s; processor time at most {cpu:.2f} s")
        print(f"  memory beyond the baseline at most {excess:.2f} of what a file of that size may take")
        print(f"  the reading process was {'never' if READER.start().pid == first else 'once or more'} started anew")
    assert excess <= 1.0
    assert cpu < cpu_s(0)


def _measured(path: Path, excess: float, cpu: float) -> tuple[float, float]:
    """Read a file in a copy of this process; return the largest share of the memory and the processor time so far."""
    size = path.stat().st_size
    peak = path.with_suffix(".peak")

    def read(request: dict[str, Any], put: Callable[[bytes], object]) -> None:
        # address space, and not what is resident: a copy comes by its libraries' pages only as it touches them
        before_kb = _status_kb("VmSize:")
        try:
            _READ(request, put)
        finally:
            peak.write_text(str(_status_kb("VmPeak:") - before_kb))

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    request = {"path": str(path), "what": "all", "cpu_s": cpu_s(size), "most": most_bytes(size)}
    reading._read = read
    try:
        reading._in_a_copy(request, io.BytesIO())
    finally:
        reading._read = _READ
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    share = 1024 * int(peak.read_text()) / most_bytes(size) if peak.exists() else 0.0  # the library may end the copy
    peak.unlink(missing_ok=True)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return max(excess, share), max(cpu, used)


def _status_kb(name: str) -> int:
    return int(Path("/proc/self/status").read_text(encoding="utf-8").partition(name)[2].split()[0])
