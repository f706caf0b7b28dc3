"""A real openDAQ server in a process of its own, each of whose samples is the number of its tick."""

from __future__ import annotations

import json
import os
import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from recoil_acquisition.packages.extras import OPENDAQ
from recoil_acquisition.processes.child_process import ChildProcess
from recoil_rigs.twin.opendaq_server import CONFIGURE, LISTENS, SAMPLES_HEAD, SEND, TYPES

needs_opendaq = pytest.mark.skipif(not OPENDAQ.is_installed, reason="the extra `opendaq` is not installed")
TICK_RATE = 1_000_000
_EVERY_S = 0.02


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class TickServer:
    """A server of channels `c0`, `c1`.. with `step` millionths of a second from sample to sample."""

    def __init__(
        self, types=("f64", "f64"), step=50, own_ticks=(), units=("MPa", "V"), start_utc_ns=0, line=(1.0, 0.0)
    ):
        self.port, self.step = free_port(), step
        self.types = types
        self._stated = {
            "port": self.port, "step": step, "tick_rate": TICK_RATE, "start_utc_ns": start_utc_ns,
            "channels": [
                {
                    "name": f"c{i}", "unit": units[i % len(units)], "type": kind, "own_ticks": f"c{i}" in own_ticks,
                    "factor": line[0], "offset": line[1], "range": [-10.0, 10.0],
                }
                for i, kind in enumerate(types)
            ],
        }  # fmt: skip
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self.child: ChildProcess | None = None
        self.off_grid = 0

    @property
    def address(self) -> str:
        return f"daq.nd://127.0.0.1:{self.port}"

    def state(self, **changed):
        """Change what it states of itself at its next start."""
        for one in self._stated["channels"]:
            one.update(changed)

    def start(self):
        self._stop.clear()
        self.child = ChildProcess("recoil_rigs.twin.opendaq_server")
        self.child.ask(CONFIGURE, json.dumps(self._stated).encode())
        assert self.child.answer()[0] == LISTENS
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def kill(self):
        """End it as kill -9 does."""
        self._stop.set()
        self.child.kill()
        self._thread.join()
        self.child.end()

    def freeze(self, seconds):
        os.kill(self.child.pid, signal.SIGSTOP)
        time.sleep(seconds)
        os.kill(self.child.pid, signal.SIGCONT)

    def _send(self):
        tick = time.time_ns() // 1000 // self.step * self.step + self.off_grid
        while not self._stop.wait(_EVERY_S):
            count = (time.time_ns() // 1000 - tick) // self.step
            if count <= 0:
                continue
            ticks = tick + self.step * np.arange(count)
            made = b"".join(ticks.astype(TYPES[kind][0]).tobytes() for kind in self.types)
            try:
                self.child.ask(SEND, SAMPLES_HEAD.pack(tick, count) + made)
            except (OSError, ValueError):
                return
            tick += int(count) * self.step


@contextmanager
def tick_server(**options) -> Iterator[TickServer]:
    server = TickServer(**options)
    server.start()
    try:
        yield server
    finally:
        server.kill()
