"""The process that reads an openDAQ device: it alone loads the library, and hands on packets.

    python -m recoil_acquisition.devices.opendaq_process ADDRESS FIRST_EPOCH once|again [SIGNAL ...]

It prints packets of `recoil_acquisition.streams.opendaq_packets`, and beside those that are recorded: ``h``, each
tenth of a second, with its state; ``l``, what is left out of the device's signals; ``r``, why there is no connection
and what else was found, after which it ends; ``e`` before it ends as asked. It ends with its parent, whose requests it
reads: any is to read what waits and to end. With ``again`` it goes on trying to connect. Without signals all are read.

The library has sixteen threads, and where the network does not reach its multicast group it logs two thousand lines a
second: whatever it prints goes nowhere, and what its connection's status says is handed on.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Collection
from importlib import import_module
from typing import Any

from recoil_acquisition.devices.opendaq_signals import (
    Changed,
    DeviceSignals,
    SignalsChangedError,
    signal_ids,
    signals_of_device,
    time_source,
)
from recoil_acquisition.streams.opendaq_packets import (
    FAULT,
    LARGEST_CONTENT,
    description_packet,
    packet,
    samples_packet,
)
from recoil_acquisition.streams.tick_stream import StreamDescription

HEARTBEAT, LEFT_OUT, REFUSED, END = b"h", b"l", b"r", b"e"
CONNECTING, CONNECTED, RECONNECTING = "connecting", "connected", "reconnecting"
POLL_S = 0.02
"""Time between two looks at what waits: the library itself sends each 20 ms."""
HEARTBEAT_S = 0.1
DESCRIBED_WITHIN_S = 5.0
"""Time after connecting within which a device describes its signals."""
SETTLED_S, SETTLED_STREAM_S = 0.3, 1.0
"""Time for which no more signals appear; a websocket stream shows them one after another."""
_WEBSOCKET = "daq.lt:"
MOST_WAITING = 256 << 20
"""Bytes that wait for the parent; what comes beyond is not kept, and its ticks are missing."""
_LOOK_AGAIN_S = 2.0
_ON_THE_NETWORK = ("daq.nd:", "daq.ns:", "daq.lt:", "daq.opcua:")
_PIPE_BYTES = 1 << 20
MOST_TRIES = 100
"""Tries to connect before the process makes way for another: each leaves 80 kB in the library, for good."""
_FIRST_PAUSE_S, _LONGEST_PAUSE_S, _GROWTH = 0.2, 2.0, 1.5


class _Out:
    """Packets on their way to the parent, written by a thread: a parent that does not read holds nothing up."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._waiting: deque[bytes] = deque()
        self._bytes = 0
        self._dropped = 0
        self._changed = threading.Condition()
        self._over = False
        self._thread = threading.Thread(target=self._write, daemon=True)
        self._thread.start()

    def put(self, packed: bytes) -> None:
        """Hand a packet over, unless too much waits."""
        with self._changed:
            if self._bytes > MOST_WAITING:
                self._dropped += 1
                return
            if self._dropped:
                said = f"{self._dropped} packets were not kept: nobody took them for long"
                self._dropped = 0
                self._add(packet(FAULT, said.encode()))
            self._add(packed)

    def _add(self, packed: bytes) -> None:
        self._waiting.append(packed)
        self._bytes += len(packed)
        self._changed.notify()

    def finish(self) -> None:
        """Wait until everything is written."""
        with self._changed:
            self._over = True
            self._changed.notify()
        self._thread.join()

    def _write(self) -> None:
        while True:
            with self._changed:
                while not self._waiting and not self._over:
                    self._changed.wait()
                data = b"".join(self._waiting)
                self._waiting.clear()
                if not data:
                    return
            try:
                left = memoryview(data)
                while left:
                    left = left[os.write(self._descriptor, left) :]
            except OSError:
                os._exit(0)  # nobody is there any more
            with self._changed:
                self._bytes -= len(data)


class _Reading:
    """One connection to a device, polled."""

    def __init__(self, daq: Any, address: str, epoch: int, wanted: Collection[str], out: _Out) -> None:
        self._daq, self._address, self._epoch, self._wanted, self._out = daq, address, epoch, wanted, out
        self.state = CONNECTING
        self._told_s = self._looked_s = 0.0
        self._time_by, self._was_lost = "", False
        self._described: StreamDescription | None = None
        self._device: Any = None
        self._signals = DeviceSignals()
        builder = daq.InstanceBuilder()
        builder.global_log_level = daq.LogLevel.Off
        self._instance = builder.build()

    def connect(self) -> None:
        """Connect and begin to read; RuntimeError if there is no connection, or nothing to read."""
        self.tell()
        try:
            self._device = self._instance.add_device(self._address, self._config())
        except RuntimeError as error:
            # of whatever it is the library says but "Failed to create device from connection string"
            raise RuntimeError("it cannot be connected to, and the library does not say why") from error
        signals = self._all_signals()
        if not signals.readers:
            raise RuntimeError("; ".join(["it has no signal that can be read", *signals.left_out]))
        self._signals = signals
        if signals.left_out:
            self._out.put(packet(LEFT_OUT, "; ".join(signals.left_out).encode()[:LARGEST_CONTENT]))
        self._describe(anew=True)
        self.state = CONNECTED

    def disconnect(self) -> None:
        """Let go of what it is connected to."""
        device, self._device, self._signals = self._device, None, DeviceSignals()
        if device is not None:
            with contextlib.suppress(RuntimeError):
                self._instance.remove_device(device)

    def _all_signals(self) -> DeviceSignals:
        """Wait until it shows its signals, and no more come."""
        ends_s = time.monotonic() + DESCRIBED_WITHIN_S
        settled_s = SETTLED_STREAM_S if self._address.startswith(_WEBSOCKET) else SETTLED_S
        shown, since_s = signal_ids(self._device), time.monotonic()
        while True:
            self.tell()
            time.sleep(POLL_S)
            now_s = time.monotonic()
            if (ids := signal_ids(self._device)) != shown:
                shown, since_s = ids, now_s
            found = None
            if now_s - since_s > settled_s:
                found = signals_of_device(self._daq, self._device, self._wanted)
            if found is not None:
                return found
            if now_s > ends_s:
                raise RuntimeError(f"it does not show its signals within {DESCRIBED_WITHIN_S:.0f} s")

    def _config(self) -> Any:
        """Return how to connect: data comes by the protocol of the address alone, not by whatever else is offered."""
        config = self._daq.IPropertyObject.cast_from(self._instance.create_default_add_device_config())
        if self._address.startswith("daq.nd:"):
            general = self._daq.IPropertyObject.cast_from(config.get_property_value("General"))
            allowed = self._daq.List()
            allowed.push_back("OpenDAQNativeStreaming")
            general.set_property_value("AllowedStreamingProtocols", allowed)
        return config

    def found(self) -> list[str]:
        """Return the addresses of the devices that answer on the network."""
        with contextlib.suppress(RuntimeError):
            return [
                f"{one.connection_string} ({one.name})"
                for one in self._instance.available_devices
                if str(one.connection_string).startswith(_ON_THE_NETWORK)
            ]
        return []

    def poll(self) -> None:
        """Hand on what came since the last look; SignalsChangedError if the device is to be connected anew."""
        self._look_at_connection()
        now_s = time.monotonic()
        if self.state == CONNECTED and now_s - self._looked_s > _LOOK_AGAIN_S:
            self._looked_s = now_s
            self._require_same_signals()
            self._describe()
        for place, reader in enumerate(self._signals.readers):
            for run in reader.read():
                if isinstance(run, Changed):
                    self._describe()
                    continue
                if run.is_of_another_grid or (run.is_apart and self._was_lost):
                    self._describe(anew=True)
                own = reader.channel.step == 0
                self._out.put(samples_packet(self._epoch, place, run.ticks, run.values, own_ticks=own))
        self.tell()

    def tell(self, *, at_once: bool = False) -> None:
        """Say how it is, if it is time to."""
        now_s = time.monotonic()
        if at_once or now_s - self._told_s >= HEARTBEAT_S:
            self._told_s = now_s
            self._out.put(packet(HEARTBEAT, self.state.encode()))

    def _look_at_connection(self) -> None:
        statuses = dict(self._device.connection_status_container.statuses)
        lost = any(str(one).rsplit(".", 1)[-1] != "Connected" for one in statuses.values())
        if lost and self.state == CONNECTED:
            self.state, self._was_lost = RECONNECTING, True
            self.tell(at_once=True)
        elif not lost and self.state == RECONNECTING:
            # the same identifiers, whatever the device is by now: everything is read again
            self._require_same_signals()
            self.state = CONNECTED
            self._describe(anew=self._was_lost)

    def _require_same_signals(self) -> None:
        if not self._signals.are_in(self._device):
            raise SignalsChangedError("it shows other signals than before")

    def _describe(self, *, anew: bool = False) -> None:
        """Describe the stream, in a new epoch if anything differs or the samples do not go on as before."""
        if self.state != RECONNECTING:  # whom it would ask for it is not there
            self._time_by = time_source(self._daq, self._device)
        try:
            described = self._signals.described(self._time_by)
        except ValueError as error:
            raise SignalsChangedError(str(error)) from error
        if not anew and described == self._described:
            return
        for one in self._signals.readers:
            one.forget_grid()
        self._described, self._was_lost = described, False
        self._epoch += 1
        self._out.put(description_packet(self._epoch, described))


def main(address: str, first_epoch: int, wanted: Collection[str], *, again: bool) -> None:
    """Read a device until the parent asks for the end, or is gone."""
    out = _Out(_own_output())
    asked = threading.Event()
    threading.Thread(target=_listen, args=(asked,), daemon=True).start()
    pause_s, tries = _FIRST_PAUSE_S, 0
    try:
        reading = _Reading(import_module("opendaq"), address, first_epoch, wanted, out)
    except (ImportError, RuntimeError) as error:
        _refuse(out, error, [])
        asked.set()
    while not asked.is_set():
        try:
            reading.connect()
        except (RuntimeError, SignalsChangedError) as error:
            reading.disconnect()
            tries += 1
            if not again or tries > MOST_TRIES:
                _refuse(out, error, reading.found())
                break
            ends_s = time.monotonic() + pause_s
            while (left_s := ends_s - time.monotonic()) > 0 and not asked.wait(min(left_s, HEARTBEAT_S)):
                out.put(packet(HEARTBEAT, CONNECTING.encode()))
            pause_s = min(pause_s * _GROWTH, _LONGEST_PAUSE_S)
            continue
        _read_on(reading, asked, out)
        break
    out.finish()
    # the library's threads are not waited for: one that hangs would keep this process
    os._exit(0)


def _read_on(reading: _Reading, asked: threading.Event, out: _Out) -> None:
    try:
        while not asked.wait(POLL_S):
            reading.poll()
        reading.poll()  # what came in the meantime
        out.put(packet(END))
    except (SignalsChangedError, RuntimeError) as error:
        _refuse(out, error, [])


def _refuse(out: _Out, error: Exception, found: list[str]) -> None:
    said = {"problem": " ".join(str(error).split()), "found": found}
    out.put(packet(REFUSED, json.dumps(said).encode()))


def _own_output() -> int:
    """Keep the standard output for packets, and let whatever else is printed go nowhere."""
    own = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(nowhere, descriptor)
    if sys.platform == "win32":
        import msvcrt

        msvcrt.setmode(own, os.O_BINARY)
    if sys.platform == "linux":
        import fcntl

        with contextlib.suppress(OSError):
            fcntl.fcntl(own, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
    return own


def _listen(asked: threading.Event) -> None:
    """Wait for the request to end; go at once where the parent is gone."""
    if not os.read(0, 1):
        os._exit(0)
    asked.set()
    while os.read(0, 1 << 10):
        pass
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[4:], again=sys.argv[3] == "again")
