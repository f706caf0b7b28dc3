"""The library's own device, 8 channels at 200 kHz, for as long as asked; and kills of it and of what reads it."""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from statistics import median

import pytest

from recoil_acquisition.devices.opendaq_device import OpendaqDevice
from recoil_acquisition.devices.reader_thread import DeviceReader
from tests.benchmarks.test_live_benchmark import MOST_GROWTH_MB, SECONDS, cpu_s, resident_mb
from tests.builders.opendaq_servers import needs_opendaq, reference_server, tick_server
from tests.builders.stream_books import StreamBook

CHANNELS, RATE_HZ = 8, 200_000
MOST_SHARE = 0.10
"""Share of a core that this process may take: to read, and to decode every sample."""
KILLS = 10
_LOOK_S = 5.0

pytestmark = [pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc"), needs_opendaq]


@pytest.mark.parametrize("protocol", ["native", "websocket"])
def test_eight_fast_channels_of_the_reference_device_are_read_without_a_loss(capsys, protocol):
    book = StreamBook()
    with reference_server(channels=CHANNELS, rate_hz=RATE_HZ) as server:
        address = server.address if protocol == "native" else server.websocket_address
        device = OpendaqDevice("daq", {"opendaq": address})
        device.open()
        pids = {"session": os.getpid(), "process": device._child.pid, "server": server.process.pid}
        with DeviceReader(device, book.take) as reader:
            time.sleep(min(10.0, SECONDS / 4))
            before = {name: cpu_s(pid) for name, pid in pids.items()}
            began_s, memory, oldest_s = time.monotonic(), [], 0.0
            while time.monotonic() < began_s + SECONDS:
                time.sleep(min(_LOOK_S, SECONDS / 4))
                memory.append({name: resident_mb(pid) for name, pid in pids.items()})
                oldest_s = max(oldest_s, reader.data_age_s or 0.0)
            lasted_s = time.monotonic() - began_s
            shares = {name: (cpu_s(pid) - before[name]) / lasted_s for name, pid in pids.items()}
    quarter = max(len(memory) // 4, 1)
    growth = {
        name: median(one[name] for one in memory[-quarter:]) - median(one[name] for one in memory[:quarter])
        for name in pids
    }
    waited_mb = device.counters.queue_high_water / 1e6
    most = {name: max(one[name] for one in memory) for name in pids}
    with capsys.disabled():
        print(f"\n{protocol}: {CHANNELS} channels at {RATE_HZ / 1e3:g} kHz for {lasted_s:.0f} s")
        print(f"  {sum(book.samples.values()):,} samples; gaps {dict(book.gaps)}, faults {book.faults}")
        print(f"  events {[(one.name, one.detail) for one in book.events]}")
        print("  of a core: " + ", ".join(f"{name} {share:.3f}" for name, share in shares.items()))
        print(
            "  memory, MB: "
            + ", ".join(f"{name} {most[name]:.0f} at most, grew by {growth[name]:.1f}" for name in pids)
        )
        print(f"  oldest data {oldest_s:.3f} s; at most {waited_mb:.1f} MB waited at once")
    assert reader.error is None
    assert device.counters.reopened == 0
    assert not book.gaps
    assert not book.faults
    # a machine that other programs keep busy stands still now and then, and nothing is lost by it
    assert [name for name in book.names if name != "stalled"] == ["opened", "closed"]
    assert min(book.samples.values()) > 0.99 * RATE_HZ * lasted_s
    assert shares["session"] < MOST_SHARE
    # what waited while the machine stood still stays with the C library's allocator
    assert growth["session"] < MOST_GROWTH_MB + 2 * waited_mb
    assert growth["process"] < MOST_GROWTH_MB


def test_kills_of_server_and_process_leave_every_tick_accounted_for(capsys):
    choice = random.Random()  # noqa: S311 - a test's choice of moments, no secret
    book = StreamBook()
    with tick_server(types=("f64",) * 4) as server:
        device = OpendaqDevice("daq", {"opendaq": server.address})
        device.open()
        with DeviceReader(device, book.take) as reader:
            for i in range(KILLS):
                time.sleep(choice.uniform(0.5, 2.0))
                if i % 2:
                    os.kill(device._child.pid, signal.SIGKILL)
                else:
                    server.kill()
                    time.sleep(choice.uniform(0.1, 2.0))
                    server.off_grid = choice.randrange(50)
                    server.start()
                ends = time.monotonic() + 15.0
                while book.names.count("reopened") <= i and time.monotonic() < ends:
                    time.sleep(0.05)
            time.sleep(1.0)
    gaps = {name: [gap / 1e6 for gap in these] for name, these in book.gaps.items()}
    with capsys.disabled():
        print(f"\n{KILLS} kills, every second one of the process that reads: {sum(book.samples.values()):,} samples")
        print(f"  {book.wrong} with another tick than their own; gaps, s: {gaps}; faults {book.faults}")
    assert reader.error is None
    assert book.wrong == 0
    assert not book.faults
    assert book.names.count("reopened") == book.names.count("lost") == KILLS
    assert all(len(these) == KILLS and min(these) > 0 for these in book.gaps.values())
