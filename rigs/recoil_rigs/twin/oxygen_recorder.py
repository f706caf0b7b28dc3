"""A virtual OXYGEN recorder on this computer: a port for commands, and one for the stream of its samples.

It acquires from the moment it is made: ticks count from there, and whoever streams before the play begins gets its
noise at rest. It listens on 127.0.0.1 alone.
"""

from __future__ import annotations

import select
import socket
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from recoil_acquisition.errors import DeviceError
from recoil_rigs.twin.faults import ChangeKind
from recoil_rigs.twin.oxygen_packets import (
    FIRST,
    LAST,
    WELCOME,
    Raw,
    ValueForm,
    WireChannel,
    acquisition_info,
    channel_info,
    data_part,
    packet,
    xml_part,
)
from recoil_rigs.twin.oxygen_scpi import OxygenScpi, ScpiChannel

HOST = "127.0.0.1"
_LOOK_S = 0.05
_PATIENCE_S = 3.0
_LONGEST_LINE = 1 << 16
_CUT_PAUSE_S = 2e-4


@dataclass(frozen=True)
class RecorderContent:
    """Channels of a virtual recorder, and their samples at rest.

    Attributes
    ----------
    channels
        Channels in the order of the recorder.
    properties
        Properties of each, in the form in which they are replied.
    form
        Form of the numbers on the wire.
    rest : ndarray of uint8, shape (n_channels, n_samples, n_bytes)
        Samples at rest, from which stretches are drawn.
    packet_s
        Time that a packet holds.
    """

    channels: tuple[WireChannel, ...]
    properties: tuple[Mapping[str, str], ...]
    rate_hz: float
    form: ValueForm
    rest: Raw
    packet_s: float

    @property
    def packet_ticks(self) -> int:
        """Number of samples of a channel in a packet."""
        return max(round(self.packet_s * self.rate_hz), 1)


@dataclass
class _Streaming:
    """Stream of one start of the group: its channels by their places, and the number of packets so far."""

    seed: int
    channels: dict[int, WireChannel]
    sequence: int = 0
    told: bool = False


@dataclass(frozen=True)
class Handling:
    """Handling of a packet that does not go out as it should.

    Attributes
    ----------
    lost
        Counted, and not sent.
    copies
        Number of times it is sent.
    without
        Place of a streamed channel that it lacks; None if none.
    cuts
        Places at which its bytes are cut into several writes, as shares of its length.
    """

    lost: bool = False
    copies: int = 1
    without: int | None = None
    cuts: Sequence[float] = ()


GOOD = Handling()


class OxygenRecorder:
    """A recorder as a transport of a play.

    Parameters
    ----------
    seed
        Seed of what is drawn at rest, and of the seeds of its streams.
    asked
        Further keys of its ``device`` table, which are the host's.

    Attributes
    ----------
    acquired_s
        Instant of tick 0 on the host's monotonic clock, s.
    scpi
        State that the commands have led to.
    """

    scpi: OxygenScpi
    acquired_s: float

    def __init__(
        self, name: str, content: RecorderContent, seed: int = 0, asked: Mapping[str, Any] = MappingProxyType({})
    ) -> None:
        self.name, self.content = name, content
        self._asked = asked
        self._rng = np.random.default_rng([seed, 11])
        self._lock = threading.RLock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._commands: socket.socket | None = None
        self._stream: socket.socket | None = None
        self._asking: socket.socket | None = None
        self._taking: socket.socket | None = None
        self._held = b""
        self._streaming: _Streaming | None = None
        self._rests_to: int | None = None
        self._rested = self._start_utc_ns = 0
        # where several recorders are on one computer, each needs its own
        with _bound(0) as one, _bound(0) as other:
            self._port, self._stream_port = (int(probe.getsockname()[1]) for probe in (one, other))
        self._fresh()

    @property
    def device(self) -> Mapping[str, Any]:
        """The rig's ``device`` table under which the host opens it."""
        return {"oxygen": f"{HOST}:{self._port}", "stream_port": self._stream_port, **self._asked}

    def _fresh(self) -> None:
        """Switch it on: nothing is configured, and ticks count anew."""
        rows = zip(self.content.channels, self.content.properties, strict=True)
        channels = [ScpiChannel(str(i), one.name, said) for i, (one, said) in enumerate(rows, 1)]
        self.scpi = OxygenScpi(channels, self)
        self._streaming = None
        self.acquired_s, self._start_utc_ns = time.monotonic(), time.time_ns()

    def tick_at(self, at_s: float) -> int:
        """Return the first tick that is due after an instant of the host's monotonic clock."""
        return max(int(np.ceil((at_s - self.acquired_s) * self.content.rate_hz)), 0)

    def plug(self) -> None:
        """Listen; DeviceError if this computer refuses the port."""
        self._stop.clear()
        try:
            self._commands = _bound(self._port)
            self._commands.listen()
            if self.scpi.state == "RUNNING":
                self.listen(self.scpi.port)
        except OSError as error:
            raise DeviceError(f"the virtual recorder cannot listen on port {self._port}: {error.strerror}") from error
        self._thread = threading.Thread(target=self._serve, name=f"recorder {self.name}", daemon=True)
        self._thread.start()

    def unplug(self) -> int:
        """Close all connections; it goes on acquiring."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        for one in (self._commands, self._asking, self._stream, self._taking):
            if one is not None:
                one.close()
        self._commands = self._asking = self._stream = self._taking = None
        return 0

    def restart(self) -> None:
        """Be switched off and on again, while it is unplugged: ticks begin at 0, nothing is configured."""
        self._fresh()
        self._rests_to = 0

    def ready(self, timeout_s: float) -> bool:
        """Wait until the host streams; where it never does, nothing of it is played to anybody."""
        ends_s = time.monotonic() + timeout_s
        while not (self.scpi.state == "RUNNING" and self._taking is not None):
            if time.monotonic() > ends_s or self._stop.wait(_LOOK_S / 5):
                return False
        return True

    def begin_play(self, began_s: float) -> int:
        """Rest up to an instant of the host's clock, and no longer; return the tick with which the play begins."""
        with self._lock:
            # on a busy computer the instant may be over already, and more than that sent
            self._rests_to = max(self.tick_at(began_s), self._rested)
            return self._rests_to

    def change(self, what: ChangeKind) -> None:
        """Change what is streamed; the next packet says so."""
        with self._lock:
            streaming = self._streaming
            if streaming is None or not streaming.channels:
                return
            first, *_, last = [next(iter(streaming.channels)), *streaming.channels]
            one = streaming.channels[first]
            if what == "channels":
                if last != first:
                    del streaming.channels[last]
            elif what == "unit":
                streaming.channels[first] = WireChannel(one.name, "V", one.factor, one.offset, one.own_ticks)
            else:
                doubled = WireChannel(one.name, one.unit, 2 * one.factor, 2 * one.offset, one.own_ticks)
                streaming.channels[first] = doubled
            streaming.told = False

    def end_licence(self) -> None:
        """Stop streaming, as without a licence after some time."""
        with self._lock:
            if self.scpi.state == "RUNNING":
                self.end()
                self.scpi.state = "Unlicensed"

    def send(self, first: int, raw: Raw, handling: Handling = GOOD) -> bool:
        """Send the samples of all channels from a tick on; False if nobody takes them.

        Parameters
        ----------
        raw : ndarray of uint8, shape (n_channels, n_samples, n_bytes)
        """
        with self._lock:
            streaming = self._streaming
            if streaming is None or self._taking is None or self.scpi.state != "RUNNING":
                return False
            if not streaming.told:
                self._tell(streaming, 0)
            rate_hz, form = self.content.rate_hz, self.content.form
            parts = [
                data_part(one, raw[place], first, rate_hz, form)
                for at, (place, one) in enumerate(streaming.channels.items())
                if at != handling.without
            ]
            data = packet(streaming.sequence, streaming.seed, parts)
            streaming.sequence += 1
            return handling.lost or all(self._write(data, handling.cuts) for _ in range(handling.copies))

    @property
    def streamed(self) -> tuple[str, ...]:
        """Names of the channels that are streamed now."""
        with self._lock:
            return () if self._streaming is None else tuple(one.name for one in self._streaming.channels.values())

    # ---- what the commands do

    def listen(self, port: int) -> bool:
        """Open the stream's port."""
        try:
            self._stream = _bound(port)
            self._stream.listen()
        except OSError:
            return False
        return True

    def begin(self) -> None:
        """Begin to send to whoever is connected."""
        with self._lock:
            places = {one.name: i for i, one in enumerate(self.content.channels)}
            chosen = {places[name]: self.content.channels[places[name]] for name in self.scpi.items}
            self._streaming = _Streaming(int(self._rng.integers(1 << 32)), chosen)
            self._rested = self.tick_at(time.monotonic())
            if self._taking is not None:
                self._tell(self._streaming, FIRST)

    def end(self) -> None:
        """Send the last packet."""
        with self._lock:
            if self._streaming is not None and self._taking is not None:
                self._write(packet(self._streaming.sequence, self._streaming.seed, [], LAST), ())
            self._streaming = None

    def shut(self) -> None:
        """Close the stream's port, and the connection."""
        with self._lock:
            self._streaming = None
            for one in (self._stream, self._taking):
                if one is not None:
                    one.close()
            self._stream = self._taking = None

    # ---- the thread that listens, and rests until the play begins

    def _serve(self) -> None:
        while not self._stop.is_set():
            known = [one for one in (self._commands, self._asking, self._stream, self._taking) if one is not None]
            try:
                ready, _, _ = select.select(known, [], [], self._rest())
            except (OSError, ValueError):
                continue  # one of them was closed by the thread that plays
            for one in ready:
                if one is self._commands:
                    self._close(self._asking)
                    self._asking, self._held = one.accept()[0], b""
                    self.scpi.heads = True
                elif one is self._asking:
                    self._hear(one)
                elif one is self._stream:
                    self._take(one)
                elif one is self._taking and not _says(one):
                    with self._lock:
                        self._close(one)
                        self._taking = None

    @staticmethod
    def _close(one: socket.socket | None) -> None:
        if one is not None:
            one.close()

    def _hear(self, one: socket.socket) -> None:
        data = _says(one)
        if not data or len(self._held) > _LONGEST_LINE:
            one.close()
            self._asking = None
            return
        *lines, self._held = (self._held + data).split(b"\n")
        for line in lines:
            reply = self.scpi.answer(line.decode("utf-8", errors="replace"))
            if reply is not None:
                with suppress(OSError):
                    one.sendall(reply.encode() + b"\n")

    def _take(self, listener: socket.socket) -> None:
        with self._lock:
            self._close(self._taking)
            self._taking = listener.accept()[0]
            self._taking.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._taking.settimeout(_PATIENCE_S)
            self._write(WELCOME, ())
            if self._streaming is not None:
                self._rested = self.tick_at(time.monotonic())
                self._tell(self._streaming, FIRST)

    def _rest(self) -> float:
        """Send what is due of the time before the play; return how long nothing is to be done."""
        with self._lock:
            if self._streaming is None or self._taking is None:
                return _LOOK_S
            count, ends = self.content.packet_ticks, self._rests_to
            while ends is None or self._rested < ends:
                behind = self._rested + count if ends is None else min(self._rested + count, ends)
                due_s = self.acquired_s + behind / self.content.rate_hz
                if (left_s := due_s - time.monotonic()) > 0:
                    return min(left_s, _LOOK_S)
                if not self.send(self._rested, self.at_rest(self._rested, behind - self._rested)):
                    return _LOOK_S
                self._rested = behind
            return _LOOK_S

    def at_rest(self, first: int, count: int) -> Raw:  # noqa: ARG002 - rest is the same at all times
        """Return samples of all channels at rest from a tick on, drawn as one stretch where the pool is long enough."""
        rest = self.content.rest
        start = int(self._rng.integers(rest.shape[1]))
        if start + count <= rest.shape[1]:
            return rest[:, start : start + count]
        return rest[:, (start + np.arange(count)) % rest.shape[1]]

    def _tell(self, streaming: _Streaming, status: int) -> None:
        """Send what the stream is, before any of its samples."""
        streaming.told = True
        parts = [xml_part(acquisition_info(self._start_utc_ns)), xml_part(channel_info([*streaming.channels.values()]))]
        self._write(packet(streaming.sequence, streaming.seed, parts, status), ())
        streaming.sequence += 1

    def _write(self, data: bytes, cuts: Sequence[float]) -> bool:
        """Write a packet whole; who takes none of it for long is let go, for half a packet is none."""
        taking = self._taking
        if taking is None:
            return False
        ends = [*sorted(int(share * len(data)) for share in cuts), len(data)]
        at = 0
        try:
            for end in ends:
                taking.sendall(data[at:end])
                at = end
                if cuts:
                    time.sleep(_CUT_PAUSE_S)
        except OSError:
            taking.close()
            self._taking = None
            return False
        return True


def _bound(port: int) -> socket.socket:
    one = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        one.bind((HOST, port))
    except OSError:
        one.close()
        raise
    return one


def _says(one: socket.socket) -> bytes:
    """Return what a peer sent; nothing if it is gone."""
    try:
        return one.recv(1 << 16)
    except OSError:
        return b""
