"""Heads of one text format spoilt at random, each read in this process: what it costs, and how it ends.

Run by `test_fuzz_benchmark.py` in a process of its own: ``python -m tests.benchmarks.spoilt_heads READER COUNT``. It
prints a line of JSON: how many files were read (exit code 0 of a command) and refused (3), those that ended otherwise,
and the largest processor time and growth of memory.
"""

from __future__ import annotations

import contextlib
import json
import random
import re
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

from tests.contracts.test_hostile_numbers import HEAD_BYTES, HOSTILE, NUMBER, TEXTS, read_whole

FORMATS = tuple(dict.fromkeys(case.reader.name for case in TEXTS))
MOST_SPOILT, NUMBERS = 3, 0.6
"""Places of a head that are spoilt at most, and share of them that are a number."""
BYTES = b"\t;,|\"'=:.-+eE09\n\r\0 \xff#"


def spoilt(content: bytes, chance: random.Random) -> bytes:
    """Return a file whose head is spoilt: a number, or a line or a sign that is lost, doubled or another one."""
    head, rest = content[:HEAD_BYTES], content[HEAD_BYTES:]
    for _ in range(chance.randint(1, MOST_SPOILT)):
        numbers = list(NUMBER.finditer(head))
        if numbers and chance.random() < NUMBERS:
            place = chance.choice(numbers)
            head = head[: place.start()] + chance.choice(HOSTILE).encode() + head[place.end() :]
            continue
        lines = head.splitlines(keepends=True)
        at, byte = chance.randrange(len(lines)), chance.randrange(max(len(head), 1))
        other = chance.randrange(len(lines))
        kind = chance.randrange(5)
        if kind == 0:
            head = b"".join(lines[:at] + lines[at + 1 :])
        elif kind == 1:
            head = b"".join([*lines[:at], lines[at], *lines[at:]])
        elif kind == 2:
            lines[at], lines[other] = lines[other], lines[at]
            head = b"".join(lines)
        else:
            head = head[:byte] + bytes([chance.choice(BYTES)]) + head[byte + kind - 3 :]
        head = head or content[:HEAD_BYTES]
    return head + rest


def memory_mb(key: str) -> float:
    """Return a number of this process's memory as the kernel counts it; 0 where it does not.

    `getrusage` tells the largest memory of the process that started this one as well.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="utf-8")
    except OSError:
        return 0.0
    return float(re.search(rf"{key}:\s*(\d+) kB", status)[1]) / 1e3


def forget_largest() -> None:
    """Let the kernel count the largest memory from here on."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")


def spoil_and_read(name: str, count: int) -> dict[str, Any]:
    """Spoil and read so many heads of a format."""
    cases = [case for case in TEXTS if case.reader.name == name]
    chance = random.Random(name)  # noqa: S311
    ends, faults, longest_s = {0: 0, 3: 0}, [], 0.0
    with tempfile.TemporaryDirectory() as folder:
        for case in cases:
            read_whole(case, Path(folder), case.content)
        forget_largest()
        before_mb = memory_mb("VmRSS")
        for number in range(count):
            case = cases[number % len(cases)]
            content = spoilt(case.content, chance)
            begin = time.process_time()
            try:
                said = read_whole(case, Path(folder), content)
            except Exception:
                faults.append(f"{case.name} {number}: {traceback.format_exc()[-1500:]}")
            else:
                ends[3 if said else 0] += 1
                faults += [f"{case.name} {number}: more than one line: {said!r}"] if "\n" in said else []
            longest_s = max(longest_s, time.process_time() - begin)
    return {"ends": ends, "faults": faults, "longest_s": longest_s, "grown_mb": memory_mb("VmHWM") - before_mb}


if __name__ == "__main__":
    print(json.dumps(spoil_and_read(sys.argv[1], int(sys.argv[2]))))
