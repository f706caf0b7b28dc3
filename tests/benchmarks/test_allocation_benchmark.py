"""The memory and time that a file makes its reader take: damaged by lengths, flips and cuts, or made for it."""

from __future__ import annotations

import os
import random
import sys
import time
import tracemalloc
from pathlib import Path

import pytest

from recoil_acquisition.conformance import Case
from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.head import HEAD_BYTES, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders.hostile_files import HOSTILE
from tests.builders.vendor_files import DBC
from tests.contracts.test_reader_rules import CASES

FILES_PER_CASE = 400
FILES_TO_WARM_UP = 50
BLOWN_UP = (b"\xff" * 4, b"\xff\xff\xff\x7f", b"\x7f" + b"\xff" * 7, b"\xff" * 8, b"9" * 8)
LARGEST_GROWTH = 10
OF_ITS_OWN_BYTES = 16e6
"""What a reader may take whatever the file's size: pieces, parsers, tables of a library."""
LONGEST_S = 5.0
"""Of the processor."""

HOSTILE_BYTES = 2_000_000
OF_HOSTILE_BYTES = 64e6
LONGEST_HOSTILE_S = 20.0


def damaged(content: bytes, draw: random.Random) -> bytes:
    """Cut a file off, flip bytes of it, or write a huge number over a few of them."""
    kind, at = draw.randrange(3), draw.randrange(len(content))
    if kind == 0:
        return content[: max(at, 1)]
    spoilt = bytearray(content)
    if kind == 1:
        for _ in range(draw.randrange(1, 6)):
            spoilt[draw.randrange(len(spoilt))] = draw.randrange(256)
    else:
        number = draw.choice(BLOWN_UP)
        spoilt[at : at + len(number)] = number
    return bytes(spoilt[: len(content)])


def read_all(case: Case, path: Path, content: bytes) -> None:
    path.write_bytes(content)
    if not case.reader.claims(Head(content[:HEAD_BYTES], path)):
        return
    try:
        recording = case.reader.open(path, case.declared)
        for signal in recording.signals:
            recording.read(signal.name)
            recording.time_base(signal.name)
        _ = recording.notes, recording.tracks()
    except ReadError:
        pass


def warm_up(case: Case, path: Path) -> None:
    """Let libraries be imported: some of them, such as codecs for names that are no UTF-8, come with damage only."""
    draw = random.Random(1)  # noqa: S311 - damage that can be repeated
    read_all(case, path, case.content)
    for _ in range(FILES_TO_WARM_UP):
        read_all(case, path, damaged(case.content, draw))


def test_a_damaged_file_takes_little_memory_and_time(tmp_path: Path, capsys):
    draw, worst = random.Random(3), []  # noqa: S311 - damage that can be repeated
    for case in CASES:
        path = tmp_path / "damaged"
        warm_up(case, path)
        peaks, longest_s = [0], 0.0
        tracemalloc.start()
        for _ in range(FILES_PER_CASE):
            content = damaged(case.content, draw)
            tracemalloc.reset_peak()
            held, begin = tracemalloc.get_traced_memory()[0], time.process_time()
            read_all(case, path, content)
            longest_s = max(longest_s, time.process_time() - begin)
            peaks.append(tracemalloc.get_traced_memory()[1] - held)
        tracemalloc.stop()
        worst.append((max(peaks), longest_s, case))
    worst.sort(key=lambda one: -one[0])
    with capsys.disabled():
        print(f"\n{FILES_PER_CASE * len(CASES)} damaged files; the largest peaks, MB, and the longest times, s:")
        for peak, longest_s, case in worst[:8]:
            print(f"  {peak / 1e6:6.2f} MB {longest_s:6.3f} s  {case.name} ({len(case.content)} bytes)")
    for peak, longest_s, case in worst:
        assert peak <= LARGEST_GROWTH * len(case.content) + OF_ITS_OWN_BYTES, case.name
        assert longest_s < LONGEST_S, case.name


def resident(field: str) -> int:
    """Return bytes of memory of this process: ``VmRSS`` now, or ``VmHWM`` at its peak."""
    with Path("/proc/self/status").open(encoding="ascii") as status:
        return next(1024 * int(line.split()[1]) for line in status if line.startswith(field))


def taken(path: Path) -> tuple[float, float, str]:
    """Read a file in a copy of this process; return its processor time in s, its peak of memory, what came of it."""
    import resource

    into, out_of = os.pipe()
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, (30, 30))
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        held, begin = resident("VmRSS"), time.process_time()
        declared = Declarations("c", database=DBC, frame_rate_hz=100.0, scale_mm_per_px=1.0)
        try:
            recording = recognise(path).open(path, declared)
            for signal in recording.signals:
                recording.read(signal.name)
                recording.time_base(signal.name)
            came = f"{len(recording.signals)} signals"
        except ReadError as error:
            came = error.problem
        except BaseException as error:
            came = f"foreign: {error!r}"
        os.write(out_of, f"{time.process_time() - begin} {resident('VmHWM') - held} {came[:100]}".encode())
        os._exit(0)
    os.close(out_of)
    os.waitpid(child, 0)
    with os.fdopen(into, encoding="utf-8") as told:
        seconds, peak, came = (told.read() or "30 0 foreign: died").split(" ", 2)
    return float(seconds), float(peak), came


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells the peak of a process by file")
def test_a_hostile_file_takes_little_memory_and_time(tmp_path: Path, capsys):
    lines, wrong = [], []
    for name, made in HOSTILE.items():
        path = tmp_path / name
        path.write_bytes(made(HOSTILE_BYTES))
        size = path.stat().st_size
        seconds, peak, came = taken(path)
        most = LARGEST_GROWTH * size + OF_HOSTILE_BYTES
        lines.append(f"  {size / 1e6:6.2f} MB: {peak / 1e6:6.1f} MB {seconds:6.2f} s  {name}: {came}")
        if peak > most or seconds > LONGEST_HOSTILE_S or came.startswith("foreign"):
            wrong.append(lines[-1])
        path.unlink()
    with capsys.disabled():
        print("\nhostile files; their size, the peak and the time that reading them took:", *lines, sep="\n")
    assert not wrong, "\n".join(wrong)
