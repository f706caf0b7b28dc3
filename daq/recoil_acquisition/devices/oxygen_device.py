"""An OXYGEN recorder over the network: its commands, and the stream of its samples as it came.

The stream is read, checked and handed on; the recorder goes on by itself whatever happens here. A connection that ends
is made again, and goes on in the same group: what is missing meanwhile, the ticks of the samples tell.
"""

from __future__ import annotations

import select
import socket
import time
from collections import Counter, deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.described import REPEATED_S, changes, described_events
from recoil_acquisition.devices.device import CHANGED, LARGEST_PIECE, STREAM, Block, Counters, EmptyLook
from recoil_acquisition.devices.oxygen_control import PORT, STREAM_PORT, OxygenControl, OxygenSettings, RecorderError
from recoil_acquisition.devices.reopening import GRACE_S, ReopenedDevice
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.streams.oxygen_stream import LAST, OxygenDecoder, TickSpan
from recoil_acquisition.streams.tick_stream import StreamDescription, StreamFault, TickChannel

FIRST_SAMPLES_S = 5.0
"""Longest time from the start of the stream to its first samples, with what it says of them."""
SILENT_S = 2.0
"""Time without any data after which the recorder is asked whether it streams still."""
RECEIVE_BUFFER = 8 << 20
"""Bytes asked for as the connection's queue: half a second of 16 channels of 200 kHz, and more."""
_LARGEST_BUFFER = Path("/proc/sys/net/core/rmem_max")
"""Largest size of such a queue that Linux lets be set, bytes: 212992 on most machines, and it takes 6 MB by itself."""
_KEYS = ("oxygen", "stream_port", "group", "acquisition", "storing")
_TOLD_EVERY_S = 1.0
_REST_S = 0.005
"""Least time between two reads of a stream: what comes meanwhile waits, and fewer, larger reads cost less."""
_OVERHEAD = 1.1
"""Bytes of the stream over those of its samples, at most, in packets of 10 ms."""


class OxygenDevice(ReopenedDevice):
    """One recorder.

    Parameters
    ----------
    name
        Name of the source.
    table
        The rig's ``device`` table: ``oxygen``, host and, behind a colon, port of its commands; ``stream_port`` and
        ``group`` of its data stream; ``acquisition`` and ``storing``, whether these are started.
    declared
        Declarations, of which the signals are the recorder's channels that are wanted.

    Raises
    ------
    DeviceError
        If the table is at fault, or no channel is wanted.
    """

    kind = STREAM

    def __init__(self, name: str, table: Mapping[str, Any], declared: DeviceDeclarations) -> None:
        settings = settings_of(name, table)
        super().__init__(name, f"OXYGEN {settings.host}:{settings.port}", "bytes", None)
        if not declared.signals:
            raise DeviceError(
                f"source '{name}': no channel of the recorder is declared",
                remedy="declare the channels that it streams",
            )
        self._settings, self._signals = settings, tuple(dict.fromkeys(declared.signals))
        self._control = OxygenControl(settings)
        self._decoder = OxygenDecoder()
        self._next: dict[int, int] = {}
        self._description: StreamDescription | None = None
        self._unread: deque[tuple[bytes, int]] = deque()
        self._piece = bytearray(LARGEST_PIECE)
        self._said_ns = self._told_ns = self._asked_ns = 0
        self._bad = self._untold = self._lost_packets = 0
        self._gaps: Counter[int] = Counter()
        self._problem = ""
        self._finishing = False
        self._read_s = 0.0
        self._sample_bytes: dict[int, int] = {}
        self._heard = declared.heard
        if (heard := declared.heard) is not None:
            self._control.heard = partial(heard, "scpi")

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of each channel that it streams, as it spells it."""
        return {} if self._description is None else {one.name: one.unit for one in self._description.channels}

    @property
    def channels(self) -> tuple[TickChannel, ...]:
        """Channels that it streams, as it describes them."""
        return () if self._description is None else self._description.channels

    @property
    def bytes_per_s(self) -> float:
        """Bytes per second of its samples, with what is around them."""
        of = {number: float(one.tick_rate) for number, one in enumerate(self.channels)}
        return _OVERHEAD * sum(rate * self._sample_bytes.get(number, 8) for number, rate in of.items()) + 4096.0

    @property
    def counters(self) -> Counters:
        """Counts of what it received and lost so far."""
        found = self._counters(bad=self._bad, kernel_drops=None)
        # one packet that is lost is missing in the ticks of each channel, and by its own number
        lost_packets = self._lost_packets + self._decoder.lost_packets
        return replace(found, counter_gaps=max(lost_packets, *self._gaps.values(), 0))

    def _open_fault(self, error: Exception) -> DeviceError:
        said = " ".join(str(error).split())[:300] or type(error).__name__
        unreached = "check address and network, and that OXYGEN's remote control is on"
        remedy = None if isinstance(error, RecorderError) else unreached
        return DeviceError(f"source '{self.name}': {self._what}: {said}", remedy=remedy)

    def _opened_as(self) -> str:
        return f"{self._what}, {self._control.identity}"

    def _connect(self) -> None:
        control, self._finishing = self._control, False
        control.connect()
        control.prepare(self._signals)
        self._look = EmptyLook()
        address = self._settings.host, self._settings.stream_port
        try:
            self._driver = socket.create_connection(address, FIRST_SAMPLES_S)
        except OSError as error:
            why = error.strerror or str(error)
            raise RecorderError(f"its data stream at port {address[1]} is not there: {why}") from error
        _widen(self._driver)
        self._lost_packets += self._decoder.lost_packets
        self._decoder, self._unread = OxygenDecoder(), deque()
        control.start()
        self._await_samples()
        self._asked_ns = time.monotonic_ns()
        if not self._wanted:  # what was stopped since is not started again behind a lost connection
            control.store()

    def _await_samples(self) -> None:
        """Read until the stream has said what it holds; what was read is handed on later."""
        ends_s = time.monotonic() + FIRST_SAMPLES_S
        while self._decoder.description is None:
            left_s = ends_s - time.monotonic()
            if left_s <= 0:
                state = self._control.state()
                raise RecorderError(f"nothing came of its data stream within {FIRST_SAMPLES_S:g} s: it is {state}")
            data = self._receive(left_s)
            if data is not None:
                self._unread.append((data, time.monotonic_ns()))
                self._follow(data)

    def _disconnect(self) -> None:
        if self._driver is not None:
            with suppress(OSError):
                self._driver.close()
            self._driver = None
        self._control.close()

    def _rest(self) -> list[Block]:
        self._finishing = True
        if self._driver is not None:
            self._control.finish()
        blocks, ends_s = list(self._ahead), time.monotonic() + GRACE_S
        self._ahead.clear()
        while self._driver is not None and (left_s := ends_s - time.monotonic()) > 0:
            block = self._take(left_s)
            blocks += [] if block is None else [block]
        return blocks

    def _take(self, timeout_s: float) -> Block | None:
        if self._unread:
            read, read_ns = self._unread.popleft()
            self._received += len(read)
            return Block(self.name, read_ns, read, STREAM, None)
        if (rest_s := self._read_s + _REST_S - time.monotonic()) > 0 and not self._finishing:
            time.sleep(rest_s)
        looked_ns = time.monotonic_ns()
        waits = bool(select.select([self._driver], [], [], 0.0)[0])
        self._look.looked(looked_ns, empty=not waits)
        empty_ns = None if waits else self._look.empty_ns
        try:
            data = self._receive(timeout_s)
            if data is None:
                self._ask_why_silent()
        except OSError as error:
            if self._finishing:
                self._disconnect()
            else:
                self._lose(error)
            return None
        if data is None:
            return None
        host_ns = time.monotonic_ns()
        self._read_s = host_ns / 1e9
        self._received += len(data)
        self._asked_ns = host_ns
        self._high_water = max(self._high_water, len(data))
        block = Block(self.name, host_ns, data, STREAM, empty_ns)
        self._follow(data)
        self._say(host_ns)
        return block

    def _receive(self, timeout_s: float) -> bytes | None:
        """Return what came; None if nothing did in time, OSError if the connection has ended."""
        if not select.select([self._driver], [], [], max(timeout_s, 0.0))[0]:
            return None
        # into memory that is there: to ask for as much anew costs more than what is received
        data = bytes(memoryview(self._piece)[: self._driver.recv_into(self._piece)])
        if not data:
            raise ConnectionResetError(self._why_ended())
        if self._heard is not None:
            self._heard("stream", "recorder", data)
        return data

    def _ask_why_silent(self) -> None:
        """Ask a recorder of which nothing comes for long what it does; OSError if it does not stream."""
        if time.monotonic_ns() - self._asked_ns < 1e9 * SILENT_S or self._finishing:
            return
        if self._control.state() != "RUNNING":
            raise ConnectionResetError(self._why_ended())
        self._asked_ns = time.monotonic_ns()

    def _why_ended(self) -> str:
        try:
            state = self._control.state()
        except OSError:
            return "the recorder closed the data stream, and answers no more"
        if state == "Unlicensed":
            return "the recorder has ended the data stream: it has no licence for it (DST); ask DEWETRON for one"
        return f"the recorder closed the data stream, which is {state}"

    def _follow(self, data: bytes) -> None:
        """Follow what the stream says, and whether its ticks go on."""
        damaged = False
        for item in self._decoder.follow(data):
            if isinstance(item, TickSpan):
                self._sample_bytes.setdefault(item.channel, item.sample_bytes)
                expected = self._next.get(item.channel, item.first_tick)
                self._gaps[item.channel] += not item.has_ticks and item.first_tick > expected
                ends = item.first_tick + item.samples
                if ends >= expected or ends < expected - self._rate_of(item.channel):  # else they came late, or twice
                    self._next[item.channel] = ends
            elif isinstance(item, StreamFault):
                self._bad += 1
                self._untold, self._problem = self._untold + 1, item.problem
                damaged = damaged or item.is_out_of_step
            else:
                self._describe(item)
        info = self._decoder.info
        if self._finishing:
            return
        if self._driver is not None and info is not None and info.status & LAST and not self._unread:
            self._lose(ConnectionResetError(self._why_ended()))
        elif damaged and self._driver is not None and not self._unread:
            self._lose(ConnectionResetError(self._problem))

    def _rate_of(self, channel: int) -> float:
        return float(self.channels[channel].tick_rate) if channel < len(self.channels) else 0.0

    def _describe(self, found: StreamDescription) -> None:
        before = self._description
        self._description = replace(
            found, channels=tuple(replace(one, said=self._control.said.get(one.name, {})) for one in found.channels)
        )
        self._said_ns = 0
        if before is not None and before.channels != found.channels:
            self._next = {}
            self._tell(CHANGED, changes(before, found))

    def _say(self, host_ns: int) -> None:
        """Say among the blocks what the stream holds, and what of it could not be read."""
        if (
            self._decoder.description is not None
            and self._description is not None
            and host_ns - self._said_ns > 1e9 * REPEATED_S
        ):
            self._said_ns = host_ns
            self._ahead.extend(described_events(self.name, host_ns, self._description))
        if self._untold and host_ns - self._told_ns > 1e9 * _TOLD_EVERY_S:
            self._tell("unreadable", f"{self._untold} parts of the stream: {self._problem}")
            self._untold, self._told_ns = 0, host_ns


def _widen(one: socket.socket) -> None:
    """Have the system hold more of a stream that is not read for a while; nothing is raised.

    A buffer whose size is set is never widened by the system itself: one that allows less than it would take then is
    left to do so.
    """
    with suppress(OSError, ValueError):
        if not _LARGEST_BUFFER.exists() or int(_LARGEST_BUFFER.read_bytes()) >= RECEIVE_BUFFER // 4:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)


def settings_of(source: str, table: Mapping[str, Any]) -> OxygenSettings:
    """Return what a ``device`` table says; DeviceError if it says it wrongly."""
    unknown = [key for key in table if key not in _KEYS]
    host, colon, port = str(table["oxygen"]).rpartition(":")
    if not colon or "]" in port:
        host, port = str(table["oxygen"]), str(PORT)
    numbers = {"port": port, "stream_port": table.get("stream_port", STREAM_PORT), "group": table.get("group", 1)}
    wrong = [key for key, value in numbers.items() if not str(value).isdecimal() or not 0 < int(value) < 1 << 16]
    wrong += [key for key in ("acquisition", "storing") if not isinstance(table.get(key, False), bool)]
    if unknown or wrong or not host:
        raise DeviceError(
            f"source '{source}': `device` of an OXYGEN recorder",
            expected='oxygen = "HOST[:PORT]"; stream_port, group: numbers; acquisition, storing: true or false',
            found=", ".join([*unknown, *wrong]) or str(table["oxygen"]),
            remedy='write such as `device = { oxygen = "192.0.2.10" }`',
        )  # fmt: skip
    return OxygenSettings(
        host.strip("[]"), int(port), int(numbers["stream_port"]), int(numbers["group"]),
        bool(table.get("acquisition", False)), bool(table.get("storing", False)),
    )  # fmt: skip


def oxygen_device(source: str, table: Mapping[str, Any], declared: DeviceDeclarations) -> OxygenDevice:
    """Return the device of a recorder, which streams the declared channels; DeviceError if the table is at fault."""
    return OxygenDevice(source, table, declared)
