"""An openDAQ device over the network, read by a process of its own.

The library is native code with sixteen threads, which may stand still, die and print without end. All of it is in
`recoil_acquisition.devices.opendaq_process`; here are its packets, a watch over it, and its next start. The process
ends with this one, whatever ends that.
"""

from __future__ import annotations

import json
import math
import threading
import time
from collections import deque
from collections.abc import Collection, Mapping
from typing import Any

from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.described import REPEATED_S, changes, described_events
from recoil_acquisition.devices.device import CHANGED, STREAM, Block, Counters, EmptyLook, event_block
from recoil_acquisition.devices.opendaq_process import (
    CONNECTED,
    CONNECTING,
    END,
    HEARTBEAT,
    LEFT_OUT,
    RECONNECTING,
    REFUSED,
)
from recoil_acquisition.devices.reopening import BackOff
from recoil_acquisition.errors import DeviceError, ErrorCode, nearest_first, visible
from recoil_acquisition.packages.extras import OPENDAQ
from recoil_acquisition.processes.child_process import ChildProcess
from recoil_acquisition.streams.opendaq_packets import (
    DESCRIPTION,
    FAULT,
    RECORDED,
    SAMPLES,
    Packet,
    PacketScan,
    samples_of,
)
from recoil_acquisition.streams.packed_description import description_of
from recoil_acquisition.streams.tick_stream import StreamDescription, StreamFault, TickChannel

PREFIXES = ("daq.nd://", "daq.ns://", "daq.lt://", "daqref://")
"""Beginnings of an address: the device over the native protocol, its stream alone, its websocket stream, and the
reference device of the library itself."""
OPENED_WITHIN_S = 20.0
"""Time for the library to be loaded, to connect, and to look what else is on the network."""
STALLED_S, LOST_S = 0.5, 2.0
"""Age of the last sample from which on the stream stalls, and is lost."""
FROZEN_S = 3.0
"""Time without a sign of life after which the process is ended and started anew."""
GIVEN_UP_S = 30.0
"""Time for which the library may seek a lost connection by itself; then its process is started anew."""
_CLOSED_WITHIN_S = 1.0
_PIECE = 1 << 20
_MOST_WAITING = 64 << 20
"""Bytes that wait to be read here; then the process waits, which holds some seconds more itself."""
_BYTES_A_PACKET, _PACKETS_PER_S = 32, 50.0


class _Pump(threading.Thread):
    """Thread that takes what a process prints: the one way to wait for a pipe for a time on every system."""

    def __init__(self, child: ChildProcess) -> None:
        super().__init__(name="read openDAQ", daemon=True)
        self._child = child
        self._waiting: deque[tuple[bytes, int, int]] = deque()
        self._bytes = 0
        self._changed = threading.Condition()
        self._over = False
        self._look = EmptyLook()
        self.start()

    def run(self) -> None:
        """Take everything until the process ends."""
        while True:
            asked_ns = time.monotonic_ns()
            try:
                data = self._child.some(_PIECE)
            except (OSError, ValueError):
                data = b""
            now_ns = time.monotonic_ns()
            self._look.looked(asked_ns, empty=now_ns - asked_ns > _WAITED_NS)
            with self._changed:
                self._over = not data
                self._waiting.append((data, now_ns, self._look.empty_ns))
                self._bytes += len(data)
                self._changed.notify()
                while self._bytes > _MOST_WAITING and not self._over:
                    self._changed.wait()
            if not data:
                return

    def take(self, timeout_s: float) -> tuple[bytes, int, int] | None:
        """Return the next bytes, when they were read and when none waited before; none of an ended process.

        None if nothing comes in time.
        """
        with self._changed:
            if not self._waiting and not self._over:
                self._changed.wait(timeout_s)
            if not self._waiting:
                return (b"", time.monotonic_ns(), self._look.empty_ns) if self._over else None
            taken = self._waiting.popleft()
            self._bytes -= len(taken[0])
            self._changed.notify()
            return taken

    def leave(self) -> None:
        """Go on to the end of what the process prints, whatever waits."""
        with self._changed:
            self._waiting.clear()
            self._bytes = 0
            self._over = True
            self._changed.notify()


_WAITED_NS = 200_000
"""Time of a read from which on it waited: nothing was there when it began."""


class OpendaqDevice:
    """An openDAQ device, as ``device = { opendaq = "daq.nd://HOST" }`` says.

    Parameters
    ----------
    name
        Name of the source.
    table
        Table ``device``.
    signals
        Names of its signals that are wanted; all are read where there is none.

    Raises
    ------
    DeviceError
        If the table is at fault.
    """

    kind = STREAM

    def __init__(self, name: str, table: Mapping[str, Any], signals: Collection[str] = ()) -> None:
        self.name = name
        if strange := sorted(set(table) - {"opendaq"}):
            raise DeviceError(
                f"source '{name}': device.{strange[0]} is no key of an openDAQ device", expected="opendaq alone"
            )
        address = table.get("opendaq")
        if not isinstance(address, str) or not address.startswith(PREFIXES) or address in PREFIXES:
            raise DeviceError(
                f"source '{name}': device.opendaq is no address of an openDAQ device",
                found=repr(address), expected=f"one that begins with {', '.join(PREFIXES)}",
                remedy='write such as `device = { opendaq = "daq.nd://192.0.2.20" }`',
            )  # fmt: skip
        self._address, self._wanted_signals = address, tuple(dict.fromkeys(signals))
        self._child: ChildProcess | None = None
        self._pump: _Pump | None = None
        self._scan = PacketScan()
        self._ahead: deque[Block] = deque()
        self._data: list[bytes] = []
        self._described: StreamDescription | None = None
        self._epoch = 0
        self._next: dict[int, int] = {}
        self._left_out = ""
        self._back_off = BackOff()
        self._wanted = self._is_lost = self._has_stalled = False
        self._state = CONNECTING
        self._alive_s = self._sampled_s = 0.0
        self._said_ns = 0
        self._received = self._bad = self._gaps = self._reopened = 0

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of each of its signals, as it spells it."""
        return {one.name: one.unit for one in self.channels}

    @property
    def channels(self) -> tuple[TickChannel, ...]:
        """Channels that are read, as it describes them; none before it is open."""
        return () if self._described is None else self._described.channels

    @property
    def _what(self) -> str:
        said = f"{self._address}: {len(self.channels)} channels"
        return f"{said}; {self._left_out}" if self._left_out else said

    @property
    def counters(self) -> Counters:
        """Counts of what it received, in samples, and of gaps, in places where ticks are missing."""
        return Counters(received=self._received, bad=self._bad, counter_gaps=self._gaps, reopened=self._reopened)

    @property
    def bytes_per_s(self) -> float:
        """Bytes per second of all channels at their rates, eight for each value at most."""
        rates = [float(one.tick_rate) / one.step if one.step else 2.0 * 1000.0 for one in self.channels]
        return sum(8.0 * rate + _BYTES_A_PACKET * _PACKETS_PER_S for rate in rates)

    def open(self) -> None:
        """Start the process and let it connect; DeviceError if that fails, ValueError if it is open already."""
        if self._wanted:
            raise ValueError(f"source '{self.name}' is open already")
        if not OPENDAQ.is_installed:
            raise DeviceError(
                f"source '{self.name}': an openDAQ device needs the extra `{OPENDAQ.name}`, which is not installed",
                code=ErrorCode.NOT_INSTALLED, remedy=OPENDAQ.remedy,
            )  # fmt: skip
        try:
            self._start(again=False)
            ends_s = time.monotonic() + OPENED_WITHIN_S
            while self._described is None:
                left_s = ends_s - time.monotonic()
                if left_s <= 0 or not self._take_some(left_s):
                    problem = (
                        f"it does not answer within {OPENED_WITHIN_S:.0f} s" if left_s <= 0 else "its process ended"
                    )
                    raise self._fault(problem, [])
        except BaseException:
            self._end()
            raise
        self._wanted = True
        self._ahead.appendleft(self._event("opened", self._what))

    def read(self, timeout_s: float) -> Block | None:
        """Return the next block of packets, or an event; ValueError if it is not open."""
        if not self._wanted:
            raise ValueError(f"source '{self.name}' is not open")
        if not self._ahead:
            if self._child is None:
                if not self._back_off.wait(timeout_s):
                    return None
                try:
                    self._start(again=True)
                except OSError:  # this computer has no room for one more process: later
                    self._back_off.failed()
            elif not self._take_some(timeout_s):
                self._lose("its process ended")
            self._watch()
        return self._ahead.popleft() if self._ahead else None

    def close(self) -> tuple[Block, ...]:
        """Read what still waits, end the process, and return the last blocks."""
        if not self._wanted:
            return ()
        self._wanted = False
        if self._child is not None:
            try:
                self._child.ask(b"q")
                ends_s = time.monotonic() + _CLOSED_WITHIN_S
                while (left_s := ends_s - time.monotonic()) > 0 and self._take_some(left_s):
                    pass
            except OSError:
                pass  # it is gone: what it had printed was taken
        self._end()
        self._ahead.append(self._event("closed", f"{self._received} samples received"))
        blocks = tuple(self._ahead)
        self._ahead.clear()
        return blocks

    def _start(self, *, again: bool) -> None:
        arguments = (self._address, str(self._epoch), "again" if again else "once", *self._wanted_signals)
        self._child = ChildProcess("recoil_acquisition.devices.opendaq_process", *arguments)
        self._pump = _Pump(self._child)
        self._scan.skip()
        self._state = CONNECTING
        # so much for loading the library and the first try; then it gives signs of life
        self._alive_s = time.monotonic() + OPENED_WITHIN_S - FROZEN_S

    def _end(self) -> None:
        child, self._child = self._child, None
        pump, self._pump = self._pump, None
        if child is not None and pump is not None:
            child.kill()
            pump.leave()
            pump.join()
            child.end()

    def _lose(self, why: str) -> None:
        """Say that it is lost, end its process, and plan the next."""
        self._end()
        if not self._is_lost:
            self._back_off.lost()
            self._tell_lost(why)
        else:
            self._back_off.failed()

    def _tell_lost(self, why: str) -> None:
        self._is_lost = True
        self._ahead.append(self._event("lost", f"{self._address}: {why}"))

    def _watch(self) -> None:
        """Look how old the last sample is, and whether the process lives."""
        now_s = time.monotonic()
        if self._child is None:
            return
        if now_s - self._alive_s > FROZEN_S:
            self._lose(f"its process has stood still for {FROZEN_S:.0f} s, and is started anew")
        elif self._is_lost:
            # what seeks the connection itself is left to it for a while
            patience_s = {CONNECTED: 2 * LOST_S, RECONNECTING: GIVEN_UP_S}.get(self._state, math.inf)
            if now_s - self._sampled_s > patience_s:
                self._lose("it is connected to anew")
        elif self._state == RECONNECTING and now_s - self._sampled_s > STALLED_S:
            self._tell_lost("the connection is lost, and sought again")
        elif now_s - self._sampled_s > LOST_S:
            self._tell_lost(f"no samples for {LOST_S:.0f} s")
        elif now_s - self._sampled_s > STALLED_S and not self._has_stalled:
            self._has_stalled = True
            self._ahead.append(self._event("stalled", f"no samples for {STALLED_S:.1f} s"))

    def _take_some(self, timeout_s: float) -> bool:
        """Take what the process printed, into blocks and events; False where it has ended."""
        if self._pump is None or (taken := self._pump.take(timeout_s)) is None:
            return self._pump is not None
        data, read_ns, empty_ns = taken
        if not data:
            return False
        self._alive_s = max(self._alive_s, read_ns / 1e9)
        goes_on = True
        for packet in self._scan.feed(data):
            if isinstance(packet, StreamFault):
                self._bad += 1
                self._ahead.append(self._event("unreadable", packet.problem))
            else:
                goes_on = self._sort(packet, read_ns, empty_ns) and goes_on
        self._close_block(read_ns, empty_ns)
        if self._described is not None and read_ns - self._said_ns >= REPEATED_S * 1e9 and not self._is_lost:
            self._say_description(read_ns)
        return goes_on

    def _sort(self, packet: Packet, read_ns: int, empty_ns: int) -> bool:
        """Take one packet; False if it says that the process ends."""
        if packet.kind == HEARTBEAT:
            self._state = packet.content.decode(errors="replace")
        elif packet.kind == LEFT_OUT:
            self._left_out = visible(packet.content.decode(errors="replace"))
        elif packet.kind == REFUSED:
            said = json.loads(packet.content)
            if not self._wanted and self._described is None:
                raise self._fault(said["problem"], said["found"])
            self._close_block(read_ns, empty_ns)
            self._lose(visible(said["problem"]))
            return True
        elif packet.kind == END:
            return False
        if packet.kind not in RECORDED:
            return True
        if packet.kind == FAULT:
            self._bad += 1
        elif packet.kind == DESCRIPTION:
            # before any event that says the same: what was sent before is of what was said before
            self._data.append(packet.packed)
            self._close_block(read_ns, empty_ns)
            self._describe(packet)
            return True
        elif packet.kind == SAMPLES:
            if self._is_lost:
                self._close_block(read_ns, empty_ns)
                self._tell_found()
            self._count(packet)
            self._has_stalled = False
            self._sampled_s = read_ns / 1e9
        self._data.append(packet.packed)
        return True

    def _describe(self, packet: Packet) -> None:
        before, self._described = self._described, description_of(packet.content)
        self._epoch = packet.epoch
        if self._is_lost:
            self._tell_found()
        if before is not None and (otherwise := changes(before, self._described)):
            self._next = {}
            self._ahead.append(self._event(CHANGED, otherwise))
        self._say_description(time.monotonic_ns())
        self._has_stalled = False
        self._alive_s = self._sampled_s = time.monotonic()

    def _say_description(self, host_ns: int) -> None:
        if self._described is not None:
            self._said_ns = host_ns
            self._ahead += described_events(self.name, host_ns, self._described)

    def _tell_found(self) -> None:
        self._is_lost = False
        self._reopened += 1
        self._ahead.append(self._event("reopened", self._what))

    def _count(self, packet: Packet) -> None:
        """Count samples, and the places where ticks are missing."""
        samples = samples_of(packet)
        self._received += len(samples.raw)
        step = self.channels[packet.channel].step
        if step:
            expected = self._next.get(packet.channel)
            self._gaps += expected is not None and samples.first_tick != expected
            self._next[packet.channel] = samples.first_tick + step * len(samples.raw)

    def _close_block(self, read_ns: int, empty_ns: int) -> None:
        if self._data:
            self._ahead.append(Block(self.name, read_ns, b"".join(self._data), STREAM, empty_ns))
            self._data = []

    def _event(self, name: str, detail: str) -> Block:
        return event_block(self.name, time.monotonic_ns(), name, detail)

    def _fault(self, problem: str, found: list[str]) -> DeviceError:
        there = ", ".join(nearest_first(self._address, found)[:6]) or "no openDAQ device that says it is there"
        return DeviceError(
            f"source '{self.name}': {self._address} cannot be read: {visible(problem)}",
            found=visible(there),
            remedy="start the recorder's openDAQ server, or correct `device.opendaq` in the rig file",
        )


def opendaq_device(source: str, table: Mapping[str, Any], declared: DeviceDeclarations) -> OpendaqDevice:
    """Return the openDAQ device of a source; errors as of it."""
    return OpendaqDevice(source, table, declared.signals)
