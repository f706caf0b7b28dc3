"""A kind of source of another package: an instrument that sends lines to a UDP port, read live.

A line is such as ``wind=3.25@1200``: a name, a value, and the tick of the instrument's own clock at which it was.
``device = { lines = 50005, rate_hz = 1000, units = { wind = "m/s" } }`` in the rig file chooses it; a channel's
``signal`` is the name.
"""

from __future__ import annotations

import socket
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.capture.live_source import LiveChannel, LiveSamples, LiveSource
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.device import STREAM, Block, Counters, EmptyLook, event_block
from recoil_acquisition.devices.tick_clock import TickClock, tick_anchors
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.live_kind import LiveKind
from recoil_acquisition.log.record import DATA
from recoil_acquisition.readers.captured import CapturedSource
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel

KIND = LiveKind(
    "lines", ("dewetron",), STREAM, f"{__name__}:LinesDevice", f"{__name__}:LinesSignals", f"{__name__}:opened",
    counted="bytes", example='{ lines = 50005, rate_hz = 1000, units = { wind = "m/s" } }', decodes_all=True,
    tells_signals=True,
)  # fmt: skip


class LinesDevice:
    """The UDP port that an instrument sends its lines to; 0 takes any that is free."""

    kind = STREAM

    def __init__(self, name: str, table: Mapping[str, Any], declared: DeviceDeclarations) -> None:
        del declared
        self.name, self.port = name, int(table["lines"])
        self.units: Mapping[str, str] = table["units"]  # one with a greeting would say so itself, once it is open
        self._received, self._look = 0, EmptyLook()
        self._ahead: list[Block] = []

    @property
    def counters(self) -> Counters:
        """Counts so far."""
        return Counters(received=self._received)

    @property
    def bytes_per_s(self) -> float:
        """Bytes per second that a thousand lines are at most."""
        return 64e3

    def open(self) -> None:
        """Open the port; DeviceError if it is taken."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("127.0.0.1", self.port))
        except OSError as error:
            self._socket.close()
            raise DeviceError(f"source '{self.name}': UDP port {self.port}: {error.strerror}") from error
        self.port = self._socket.getsockname()[1]
        self._ahead = [event_block(self.name, time.monotonic_ns(), "opened", f"UDP port {self.port}")]

    def read(self, timeout_s: float) -> Block | None:
        """Return the next datagram."""
        if self._ahead:
            return self._ahead.pop()
        self._socket.settimeout(timeout_s)
        try:
            data = self._socket.recv(1 << 16)
        except OSError:
            self._look.looked(time.monotonic_ns(), empty=True)
            return None
        self._received += len(data)
        return Block(self.name, time.monotonic_ns(), data, STREAM, self._look.empty_ns)

    def close(self) -> tuple[Block, ...]:
        """Close the port."""
        self._socket.close()
        return ()


class _Lines:
    """Values and their ticks by name, out of blocks that are cut anywhere."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> dict[str, list[tuple[float, int]]]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        values = defaultdict(list)
        for name, _, stated in (line.decode().partition("=") for line in lines):
            value, _, tick = stated.partition("@")
            values[name].append((float(value), int(tick)))
        return values

    def skip(self) -> None:
        self._rest = b""


class LinesSignals:
    """Channels of the lines, dated by their ticks."""

    def __init__(self, source: LiveSource, channels: Sequence[LiveChannel]) -> None:
        self._channels, self._lines = tuple(channels), _Lines()
        self._clock = TickClock(float(source.device["rate_hz"]))
        self.skip = self._lines.skip

    def feed(self, block: Block) -> list[LiveSamples]:
        """Take the next block."""
        values = self._lines.feed(block.payload) if block.kind == STREAM else {}
        ticks = [tick for these in values.values() for _, tick in these]
        times_s = self._clock.feed(min(ticks), max(ticks) - min(ticks) + 1, block.host_ns) if ticks else None
        if times_s is None:
            return []
        return [
            LiveSamples(
                c.name, times_s[[tick - min(ticks) for _, tick in these]],
                np.array([value for value, _ in these]) * c.factor + c.offset,
            )
            for c in self._channels
            if (these := values.get(c.signal))
        ]  # fmt: skip

    def stamped_by(self, blocks: Sequence[Block]) -> str:
        """Return the clock of the stamps."""
        del blocks
        return "sensor"

    def unheard(self, channel: LiveChannel, counters: Counters) -> str:
        """Say why nothing came."""
        return f"none of {counters.received} bytes is a line of {channel.signal}: check what the instrument sends"


def opened(path: Path, source: CapturedSource, declared: Declarations) -> Recording:
    """Open what a capture has of it; its clock is that of the ticks, in thousandths of a second."""
    lines, found, packets = _Lines(), defaultdict(list), []
    for record in source.records:
        values = lines.feed(record.payload if record.kind in DATA else b"")
        for name, these in values.items():
            found[name] += these
        if ticks := [tick for these in values.values() for _, tick in these]:
            packets.append((min(ticks), max(ticks) - min(ticks) + 1, record.host_ns))
    channels = []
    for name, these in found.items():
        values, ticks = np.array(these).T
        base = TimeBase.stamped(declared.clock, ticks / 1000.0)
        channels.append(StoredChannel(SignalHeader(name, "", len(values)), base, partial(_part, values)))
    metadata = {"clock_fit": tick_anchors(1000.0, packets)}
    return Recording(path, "lines", channels, metadata=metadata, incomplete=source.incomplete)


def _part(column: np.ndarray, start: int, stop: int) -> np.ndarray:
    return column[start:stop].copy()
