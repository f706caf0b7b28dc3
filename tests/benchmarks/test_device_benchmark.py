"""A full CAN bus and two serial ports read live for a minute: nothing lost, and what it costs."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable

import can
import numpy as np
import pytest

from recoil_acquisition.devices.device import CAN, Block
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.devices.reader_thread import DeviceReader
from recoil_acquisition.frames.can_rows import parse_rows
from recoil_rigs.twin.transports import PseudoTerminal

resource = pytest.importorskip("resource", reason="this system does not tell a process's memory")

FRAMES_PER_S = 8000
SECONDS = 60
PORT_BYTES_PER_S = 92_160
FRAME_BYTES = 40


class Tally:
    """A sink that keeps no block: it counts, and checks that numbers go up by one."""

    def __init__(self, kind: str) -> None:
        self.kind, self.count, self.faults, self.next = kind, 0, 0, 0
        self.stream_bytes = 0
        self.cpu_s = 0.0

    def __call__(self, block: Block) -> None:
        self.cpu_s = time.thread_time()
        if block.kind == CAN:
            numbers = parse_rows(block.payload)["data"][:, :8].copy().view("<u8").ravel().astype(np.int64)
            self.faults += int((np.diff(numbers, prepend=self.next - 1) != 1).sum())
            self.next = int(numbers[-1]) + 1
            self.count += numbers.size
        elif block.kind == self.kind:
            self.stream_bytes += len(block.payload)


def paced(send: Callable[[int], object], per_s: float, seconds: float, tick_s: float = 0.001) -> int:
    """Call with 0, 1, 2, ... at a mean rate, in bursts of a tick."""
    began, sent, total = time.monotonic(), 0, int(per_s * seconds)
    while sent < total:
        due = min(int((time.monotonic() - began) * per_s), total)
        while sent < due:
            send(sent)
            sent += 1
        time.sleep(tick_s)
    return sent


def megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs pseudo-terminals and processor clocks")
def test_a_full_bus_and_two_fast_ports_lose_nothing_for_a_minute(capsys: pytest.CaptureFixture[str]) -> None:
    channel = f"benchmark-{os.getpid()}"
    ports = [PseudoTerminal(f"port{i}") for i in range(2)]
    for port in ports:
        port.plug()
    tallies = [Tally("can"), Tally("serial"), Tally("serial")]
    with can.Bus(interface="virtual", channel=channel, ignore_config=True) as bus:
        devices = [open_device("bus", "can", {"interface": "virtual", "channel": channel})]
        devices += [open_device(port.path.name, "serial", port.device) for port in ports]
        readers = [DeviceReader(device, tally) for device, tally in zip(devices, tallies, strict=True)]
        for reader in readers:
            reader.start()

        def send(n: int) -> None:
            bus.send(can.Message(arbitration_id=n % 2000, is_extended_id=False, data=n.to_bytes(8, "little")))

        body = bytes(FRAME_BYTES)
        threads = [threading.Thread(target=paced, args=(send, FRAMES_PER_S, SECONDS))]
        threads += [
            threading.Thread(
                target=paced, args=(lambda _, p=port: p.write(body), PORT_BYTES_PER_S / FRAME_BYTES, SECONDS)
            )
            for port in ports
        ]
        before_mb, began, began_cpu = megabytes(), time.monotonic(), time.process_time()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        passed_s, cpu_s = time.monotonic() - began, time.process_time() - began_cpu
        for reader in readers:
            reader.stop()
    for port in ports:
        port.close()
    readers_cpu_s = [tally.cpu_s for tally in tallies]
    with capsys.disabled():
        print(
            f"\n{tallies[0].count} frames in {passed_s:.1f} s, {tallies[0].count / passed_s:.0f}/s, out of order or"
            f" lost {tallies[0].faults}; serial {[t.stream_bytes for t in tallies[1:]]} bytes;"
            f" processor share: bus reader {readers_cpu_s[0] / passed_s:.2f}, port readers"
            f" {readers_cpu_s[1] / passed_s:.2f} and {readers_cpu_s[2] / passed_s:.2f},"
            f" process with senders {cpu_s / passed_s:.2f}; memory grew by {megabytes() - before_mb:.0f} MB"
        )
    assert tallies[0].count == FRAMES_PER_S * SECONDS
    assert tallies[0].faults == 0
    expected = int(PORT_BYTES_PER_S / FRAME_BYTES * SECONDS) * FRAME_BYTES
    assert [tally.stream_bytes for tally in tallies[1:]] == [expected, expected]
    assert sum(readers_cpu_s) / passed_s < 1.0
    assert megabytes() - before_mb < 100


def test_reading_a_bus_flat_out(benchmark) -> None:
    """How fast queued frames are received and packed, without the sender."""
    channel = f"flat-out-{os.getpid()}"
    frames = 20_000

    def feed():
        device = open_device("bus", "can", {"interface": "virtual", "channel": channel})
        with can.Bus(interface="virtual", channel=channel, ignore_config=True) as bus:
            for n in range(frames):
                bus.send(can.Message(arbitration_id=n % 2000, is_extended_id=False, data=bytes(8)))
        return (device,), {}

    def read(device) -> None:
        while device.counters.received < frames:
            device.read(0.1)

    benchmark.pedantic(read, setup=feed, rounds=5)
