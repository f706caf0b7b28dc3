"""A real openDAQ server in a process of its own, each of whose samples is the number of its tick."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
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
                    "place": i, "name": f"c{i}", "unit": units[i % len(units)], "type": kind,
                    "own_ticks": f"c{i}" in own_ticks, "factor": line[0], "offset": line[1], "range": [-10.0, 10.0],
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
                self.child.ask(SEND, SAMPLES_HEAD.pack(tick, count, -1) + made)
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


_REFERENCE = """
import os, sys
import opendaq as daq
builder = daq.InstanceBuilder()
builder.global_log_level = daq.LogLevel.Off
builder.set_root_device("daqref://device0")
instance = builder.build()
instance.root_device.set_property_value("NumberOfChannels", int(sys.argv[2]))
instance.root_device.set_property_value("GlobalSampleRate", int(sys.argv[3]))
def serve(kind, **ports):
    made = daq.IComponentType.cast_from(instance.available_server_types[kind]).create_default_config()
    config = daq.IPropertyObject.cast_from(made)
    for name, port in ports.items():
        config.set_property_value(name, port)
    instance.add_server(kind, config)
port = int(sys.argv[1])
serve("OpenDAQNativeStreaming", NativeStreamingPort=port)
if len(sys.argv) > 4:
    serve("OpenDAQLTStreaming", WebsocketStreamingPort=int(sys.argv[4]), WebsocketControlPort=int(sys.argv[5]))
os.write(1, b"listens")
os.read(0, 1)
os._exit(0)
"""


class ReferenceServer:
    """The library's own reference device, served by both of its protocols."""

    def __init__(self, channels=8, rate_hz=200_000):
        self.port, self._websocket, self._control = free_port(), free_port(), free_port()
        self._asked = [str(one) for one in (self.port, channels, rate_hz, self._websocket, self._control)]

    @property
    def address(self):
        return f"daq.nd://127.0.0.1:{self.port}"

    @property
    def websocket_address(self):
        return f"daq.lt://127.0.0.1:{self._websocket}"

    def start(self):
        self.process = subprocess.Popen(
            [sys.executable, "-c", _REFERENCE, *self._asked],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        assert self.process.stdout.read(7) == b"listens"

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()


@contextmanager
def reference_server(**options) -> Iterator[ReferenceServer]:
    server = ReferenceServer(**options)
    server.start()
    try:
        yield server
    finally:
        server.kill()
