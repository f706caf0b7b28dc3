"""A virtual openDAQ recorder on this computer: a real server of the library, in a process of its own.

It is a transport of a play as `recoil_rigs.twin.oxygen_recorder.OxygenRecorder` is, and acquires from the moment it is
made. The library's server listens on all interfaces of the computer, and has no setting for fewer.
"""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from recoil_acquisition.errors import DeviceError, ErrorCode
from recoil_acquisition.packages.extras import OPENDAQ
from recoil_acquisition.processes.child_process import ChildProcess
from recoil_rigs.twin.faults import ChangeKind
from recoil_rigs.twin.opendaq_server import (
    CHANGE,
    CLIENTS,
    CONFIGURE,
    LISTENS,
    SAMPLES_HEAD,
    SEND,
)
from recoil_rigs.twin.oxygen_packets import Raw, WireChannel
from recoil_rigs.twin.oxygen_recorder import GOOD, HOST, Handling, RecorderContent

_LOOK_S = 0.02
_NOBODY = -1


class OpendaqRecorder:
    """A recorder as a transport of a play.

    Parameters
    ----------
    asked
        Keys of its ``device`` table beside its address.

    Attributes
    ----------
    acquired_s
        Instant of tick 0 on the host's monotonic clock, s.

    Raises
    ------
    ValueError
        If its rate is no whole number: a tick of the library is a fraction of whole numbers.
    """

    def __init__(self, name: str, content: RecorderContent, seed: int, asked: Mapping[str, Any]) -> None:
        if content.rate_hz != round(content.rate_hz):
            raise ValueError(
                f"a virtual openDAQ recorder has a whole number of ticks per second, not {content.rate_hz}"
            )
        self.name, self.content, self._asked = name, content, dict(asked)
        self._rng = np.random.default_rng([seed, 13])
        self._lock = threading.RLock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._server: ChildProcess | None = None
        self._channels: dict[int, WireChannel] = {}
        with socket.socket() as probe:
            probe.bind((HOST, 0))
            self._port = int(probe.getsockname()[1])
        self._rests_to: int | None = None
        self._fresh()

    @property
    def device(self) -> Mapping[str, Any]:
        """The rig's ``device`` table under which the host opens it."""
        return {**self._asked, "opendaq": f"daq.nd://{HOST}:{self._port}"}

    @property
    def streamed(self) -> tuple[str, ...]:
        """Names of the channels that are streamed now."""
        with self._lock:
            return tuple(one.name for one in self._channels.values())

    def _fresh(self) -> None:
        """Switch it on: ticks count anew."""
        self._channels = dict(enumerate(self.content.channels))
        self.acquired_s, self._start_utc_ns = time.monotonic(), time.time_ns()
        self._rested = 0

    def tick_at(self, at_s: float) -> int:
        """Return the first tick that is due after an instant of the host's monotonic clock."""
        return max(math.ceil((at_s - self.acquired_s) * self.content.rate_hz), 0)

    def plug(self) -> None:
        """Start the server; DeviceError if this computer cannot."""
        if not OPENDAQ.is_installed:
            raise DeviceError(
                f"the virtual openDAQ recorder needs the extra `{OPENDAQ.name}`, which is not installed",
                code=ErrorCode.NOT_INSTALLED, remedy=OPENDAQ.remedy,
            )  # fmt: skip
        self._stop.clear()
        self._server = ChildProcess("recoil_rigs.twin.opendaq_server")
        self._server.ask(CONFIGURE, self._stated())
        try:
            kind, said = self._server.answer()
        except EOFError:
            kind, said = b"", b"its process ended"
        if kind != LISTENS:
            self.unplug()
            raise DeviceError(f"the virtual openDAQ recorder cannot be started: {said.decode(errors='replace')}")
        self._rested = self.tick_at(time.monotonic())
        self._thread = threading.Thread(target=self._rest, name=f"recorder {self.name}", daemon=True)
        self._thread.start()

    def unplug(self) -> int:
        """End the server; the recorder goes on acquiring."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        with self._lock:
            server, self._server = self._server, None
        if server is not None:
            server.end()
        return 0

    def restart(self) -> None:
        """Be switched off and on again, while it is unplugged: ticks begin at 0."""
        self._fresh()
        self._rests_to = 0

    def ready(self, timeout_s: float) -> bool:
        """Wait until the host is connected."""
        ends_s = time.monotonic() + timeout_s
        while time.monotonic() < ends_s and not self._stop.is_set():
            with self._lock:
                if self._server is None:
                    return False
                self._server.ask(CLIENTS)
                if int(self._server.answer()[1]) > 0:
                    return True
            time.sleep(_LOOK_S)
        return False

    def begin_play(self, began_s: float) -> int:
        """Rest up to an instant of the host's clock, and no longer; return the tick with which the play begins."""
        with self._lock:
            self._rests_to = self.tick_at(began_s)
            return self._rests_to

    def change(self, what: ChangeKind) -> None:
        """Change what is streamed; what follows says so."""
        with self._lock:
            first, last = min(self._channels), max(self._channels)
            one = self._channels[first]
            if what == "channels":
                if last != first:
                    del self._channels[last]
            elif what == "unit":
                self._channels[first] = replace(one, unit="V")
            else:
                self._channels[first] = replace(one, factor=2 * one.factor, offset=2 * one.offset)
            if self._server is not None:
                self._server.ask(CHANGE, self._stated())

    def end_licence(self) -> None:
        """Know of no licence: all that a client sees is that nothing comes."""

    def send(self, first: int, raw: Raw, handling: Handling = GOOD) -> bool:
        """Send the samples of all channels from a tick on; False if there is no server.

        Parameters
        ----------
        raw : ndarray of uint8, shape (n_channels, n_samples, n_bytes)
        handling
            Way in which it goes out; the library cuts the bytes as it likes.
        """
        with self._lock:
            if self._rests_to is not None:
                self._rest_until(self._rests_to)
            return self._put(first, raw, handling)

    def _put(self, first: int, raw: Raw, handling: Handling = GOOD) -> bool:
        with self._lock:
            if self._server is None:
                return False
            places = list(self._channels)
            without = _NOBODY if handling.without is None else places[handling.without]
            content = SAMPLES_HEAD.pack(first, raw.shape[1], without) + b"".join(_wide(raw[place]) for place in places)
            try:
                for _ in range(0 if handling.lost else handling.copies):
                    self._server.ask(SEND, content)
            except OSError:
                return False
            return True

    def _stated(self) -> bytes:
        kind = "f32" if self.content.form == "f32" else "i32"
        stated = {
            "port": self._port, "step": 1, "tick_rate": int(self.content.rate_hz), "start_utc_ns": self._start_utc_ns,
            "channels": [
                {
                    "place": place, "name": one.name, "unit": one.unit, "type": kind, "own_ticks": one.own_ticks,
                    "factor": one.factor, "offset": one.offset, "range": None,
                }
                for place, one in self._channels.items()
            ],
        }  # fmt: skip
        return json.dumps(stated).encode()

    def _rest(self) -> None:
        """Send what is due of the time before the play."""
        while not self._stop.wait(_LOOK_S):
            with self._lock:
                due = self.tick_at(time.monotonic())
                self._rest_until(due if self._rests_to is None else min(due, self._rests_to))

    def _rest_until(self, ends: int) -> None:
        while self._rested < ends:
            behind = min(self._rested + self.content.packet_ticks, ends)
            self._put(self._rested, self.at_rest(self._rested, behind - self._rested))
            self._rested = behind

    def at_rest(self, first: int, count: int) -> Raw:  # noqa: ARG002 - rest is the same at all times
        """Return samples of all channels at rest from a tick on."""
        rest = self.content.rest
        start = int(self._rng.integers(rest.shape[1]))
        return rest[:, (start + np.arange(count)) % rest.shape[1]]


def _wide(raw: Raw) -> bytes:
    """Return the numbers of a channel as the library takes them: it has no whole numbers of three bytes."""
    if raw.shape[1] == np.dtype("<f4").itemsize:
        return raw.tobytes()
    wide = np.zeros((len(raw), 4), dtype=np.uint8)
    wide[:, 1:] = raw
    return (wide.view("<i4")[:, 0] >> 8).tobytes()
