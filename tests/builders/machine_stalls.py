"""For how long the machine under the tests did nothing: what plays in real time is late by as much."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType

import pytest

LARGEST_S = pytest.StashKey[dict[str, float]]()
"""Of a module: by how much the machine was late while each fixture of it played."""

_WATCH = """
import os, sys, threading, time
writer, reader = os.openpty() if hasattr(os, "openpty") else os.pipe()[::-1]
nap_s, largest_s = 0.002, 0.0
over = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
ended_s = time.monotonic() - time.process_time()
print(flush=True)
while not over.is_set():
    began_s = ended_s  # not read anew: a stop between two rounds belongs to one of them
    time.sleep(nap_s)
    os.write(writer, b"\\n")
    os.read(reader, 1)
    ended_s = time.monotonic() - time.process_time()
    largest_s = max(largest_s, ended_s - began_s - nap_s)
print(max(largest_s, time.monotonic() - time.process_time() - ended_s))
"""


class MachineStalls:
    """Measures, while its block runs, by how much a process of its own was late at most.

    It does next to nothing: it naps, and sends itself a byte through a pseudo-terminal, which a worker of the kernel
    hands on. Its own processor time is no lateness, and what holds the interpreter of the tests does not hold it.

    Attributes
    ----------
    process : Popen
    largest_s : float
        Largest lateness; 0 until the block has ended.
    """

    def __init__(self) -> None:
        self.largest_s = 0.0

    def __enter__(self) -> MachineStalls:
        command = [sys.executable, "-I", "-S", "-c", _WATCH]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.process.stdout.readline()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        said, _ = self.process.communicate()
        self.largest_s = float(said or 0.0)


@contextmanager
def stalls_kept(request: pytest.FixtureRequest) -> Iterator[None]:
    """Measure while a fixture plays what several tests share, and keep the lateness for each of them."""
    machine = MachineStalls()
    try:
        with machine:
            yield
    finally:
        kept = request.node.stash.setdefault(LARGEST_S, {})
        kept[request.fixturename] = machine.largest_s


def shared_stall_s(item: pytest.Item) -> float:
    """Return by how much the machine was late while anything was played that a test shares with others."""
    kept = [node.stash.get(LARGEST_S, {}) for node in item.listchain()]
    names = set(getattr(item, "fixturenames", ()))
    return max((late_s for one in kept for name, late_s in one.items() if name in names), default=0.0)
