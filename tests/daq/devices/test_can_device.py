"""CAN buses read live, over python-can's virtual bus and its slcan driver on a pseudo-terminal."""

from __future__ import annotations

import itertools
import os
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import can
import numpy as np
import pytest

from recoil_acquisition.devices.can_device import CanDevice
from recoil_acquisition.devices.device import CAN, Block, event_of
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.frames import can_rows as capture
from recoil_rigs.twin.can_replay import CanItem
from recoil_rigs.twin.transports import SlcanAdapter

needs_pty = pytest.mark.skipif(not hasattr(os, "openpty"), reason="this system has no pseudo-terminals")
NUMBERS = itertools.count()


@pytest.fixture
def channel() -> str:
    return f"test-{os.getpid()}-{next(NUMBERS)}"


@pytest.fixture
def sender(channel: str) -> Iterator[can.BusABC]:
    bus = can.Bus(interface="virtual", channel=channel, preserve_timestamps=True, ignore_config=True)
    yield bus
    bus.shutdown()


@pytest.fixture
def adapter() -> Iterator[SlcanAdapter]:
    adapter = SlcanAdapter("bus")
    adapter.plug()
    yield adapter
    adapter.close()


def frames_of(blocks: list[Block]) -> np.ndarray[Any, Any]:
    return capture.parse_rows(b"".join(block.payload for block in blocks if block.kind == CAN))


def events_of(blocks: list[Block]) -> list[str]:
    return [event_of(block).name for block in blocks if block.kind == "event"]


def read_until(device: Any, frames: int, limit_s: float = 20.0) -> list[Block]:
    blocks: list[Block] = []
    ends = time.monotonic() + limit_s
    while len(frames_of(blocks)) < frames and time.monotonic() < ends:
        block = device.read(0.05)
        if block is not None:
            blocks.append(block)
    return blocks


def message(number: int, stamp_s: float = 1.0) -> can.Message:
    return can.Message(
        timestamp=stamp_s, arbitration_id=0x100 + number % 8, is_extended_id=False, data=number.to_bytes(8, "little")
    )


@pytest.mark.real_time
def test_all_of_20000_frames_arrive_in_order_with_both_stamps(channel: str, sender: can.BusABC) -> None:
    device = open_device("bus", "can", {"interface": "virtual", "channel": channel})
    before_ns = time.monotonic_ns()
    feeder = threading.Thread(target=lambda: [sender.send(message(n, 100 + n * 1e-4)) for n in range(20_000)])
    feeder.start()
    blocks = read_until(device, 20_000)
    feeder.join()
    blocks += device.close()
    records = frames_of(blocks)
    np.testing.assert_array_equal(records["data"][:, :8].copy().view("<u8").ravel(), np.arange(20_000))
    np.testing.assert_array_equal(records["device_ns"], np.round((100 + np.arange(20_000) * 1e-4) * 1e9))
    assert (np.diff(records["host_ns"]) >= 0).all()
    assert records["host_ns"][0] >= before_ns
    assert blocks[-2].host_ns == records["host_ns"][-1]
    assert (records["flags"] == capture.DEVICE_TIME).all()
    counters = device.counters
    assert (counters.received, counters.bad, counters.error_frames, counters.reopened) == (20_000, 0, 0, 0)
    assert counters.kernel_drops is None
    assert counters.queue_high_water > 0
    assert events_of(blocks) == ["opened", "closed"]


def test_every_kind_of_frame_keeps_what_it_says(channel: str, sender: can.BusABC) -> None:
    device = open_device("bus", "can", {"interface": "virtual", "channel": channel})
    sender.send(can.Message(timestamp=1.5, arbitration_id=0x18FF0100, is_extended_id=True, data=b"\x01\x02\x03"))
    sender.send(can.Message(timestamp=1.6, arbitration_id=0x7FF, is_extended_id=False, is_remote_frame=True, dlc=8))
    sender.send(can.Message(timestamp=1.7, arbitration_id=4, is_error_frame=True, is_extended_id=False, data=b"\0\1"))
    fast = can.Message(timestamp=1.8, arbitration_id=5, is_extended_id=False, is_fd=True, bitrate_switch=True)
    fast.data, fast.dlc = bytearray(range(64)), 64
    sender.send(fast)
    blocks = [*device.close()]
    records = frames_of(blocks)
    plain = [int(flags) & ~capture.DEVICE_TIME for flags in records["flags"]]
    assert plain == [capture.EXTENDED, capture.REMOTE, capture.ERROR, capture.FD | capture.BIT_RATE_SWITCH]
    assert records["id"].tolist() == [0x18FF0100, 0x7FF, 4, 5]
    assert records["length"].tolist() == [3, 8, 2, 64]
    assert bytes(records["data"][3]) == bytes(range(64))
    assert not records["data"][0, 3:].any()
    assert (device.counters.received, device.counters.error_frames) == (3, 1)


def test_closing_reads_what_still_waits(channel: str, sender: can.BusABC) -> None:
    device = open_device("bus", "can", {"interface": "virtual", "channel": channel})
    for number in range(3000):
        sender.send(message(number))
    blocks = device.close()
    assert len(frames_of(list(blocks))) == 3000
    assert events_of(list(blocks)) == ["opened", "closed"]
    assert device.close() == ()
    with pytest.raises(ValueError, match="is not open"):
        device.read(0.0)


def test_reading_a_silent_bus_takes_no_longer_than_asked(channel: str) -> None:
    device = open_device("bus", "can", {"interface": "virtual", "channel": channel})
    assert event_of(device.read(0.0)).name == "opened"
    before = time.monotonic()
    assert device.read(0.05) is None
    assert 0.04 < time.monotonic() - before < 5.0
    with pytest.raises(ValueError, match="open already"):
        device.open()
    device.close()


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        ({"interface": "soketcan", "channel": "can0"}, "no interface 'soketcan'.*socketcan"),
        ({"channel": "can0"}, "no interface None"),
        ({"interface": "slcan", "channel": "/dev/no_such_port", "sleep_after_open": 0.0}, "no such port.*plug it in"),
        (None, "declares no device.*socketcan"),
    ],
)
def test_a_bus_that_cannot_be_opened_says_why_in_one_line(table: dict[str, Any] | None, problem: str) -> None:
    with pytest.raises(DeviceError, match=problem) as caught:
        open_device("bus", "can", table)
    assert str(caught.value).startswith("source 'bus'")
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="SocketCAN is Linux's")
def test_a_missing_socketcan_link_says_what_to_do() -> None:
    with pytest.raises(DeviceError, match=r"socketcan nocan7 cannot be opened.*(kernel's CAN modules|plug it in)"):
        open_device("bus", "can", {"interface": "socketcan", "channel": "nocan7"})


@pytest.mark.real_time
@needs_pty
def test_slcan_over_a_pseudo_terminal_loses_nothing(adapter: SlcanAdapter) -> None:
    device = open_device("bus", "can", adapter.device)
    assert adapter.ready(2.0)

    def feed() -> None:
        for n in range(4000):
            assert adapter.send(CanItem(0.0, 0.0, 0x18FF0000 + n % 16, True, n.to_bytes(8, "big")), 0.0)

    feeder = threading.Thread(target=feed)
    feeder.start()
    blocks = read_until(device, 4000)
    feeder.join()
    blocks += device.close()
    records = frames_of(blocks)
    np.testing.assert_array_equal(records["data"][:, :8].copy().view(">u8").ravel(), np.arange(4000))
    # the driver stamps with its own look at the wall clock: that is no clock of a device
    assert (records["flags"] == capture.EXTENDED).all()
    assert device.counters.received == 4000
    assert device.counters.bad == 0


@needs_pty
def test_an_unplugged_adapter_is_told_and_opened_again(adapter: SlcanAdapter) -> None:
    device = open_device("bus", "can", adapter.device)
    assert adapter.ready(2.0)
    adapter.send(CanItem(0.0, 0.0, 0x1, False, b"\x01"), 0.0)
    blocks = read_until(device, 1)
    adapter.unplug()
    ends = time.monotonic() + 20.0
    while "lost" not in events_of(blocks) and time.monotonic() < ends:
        blocks += [block for block in [device.read(0.05)] if block is not None]
    assert device.read(0.01) is None
    adapter.plug()
    while "reopened" not in events_of(blocks) and time.monotonic() < ends:
        blocks += [block for block in [device.read(0.05)] if block is not None]
    assert adapter.ready(2.0)
    adapter.send(CanItem(0.0, 0.0, 0x2, False, b"\x02"), 0.0)
    blocks += read_until(device, 1)
    blocks += device.close()
    assert events_of(blocks) == ["opened", "lost", "reopened", "closed"]
    assert frames_of(blocks)["id"].tolist() == [1, 2]
    assert device.counters.reopened == 1


@needs_pty
def test_lines_that_the_driver_cannot_read_are_counted_and_the_next_are_read(adapter: SlcanAdapter) -> None:
    device = open_device("bus", "can", adapter.device)
    assert adapter.ready(2.0)
    lines = [
        b"t1002AABB\r",
        b"t100\xff2AABB\r",  # a byte that is no ASCII, which the driver would keep for ever
        b"t1004AABB\r",  # two of four bytes
        b"tZZZ2AABB\r",  # no number
        b"t\r",  # cut off
        b"t1012CCDD\r",
    ]
    adapter.write(b"".join(lines))
    blocks = read_until(device, 2)
    blocks += device.close()
    assert frames_of(blocks)["id"].tolist() == [0x100, 0x101]
    assert device.counters.bad == 4
    assert device.counters.reopened == 0
    assert "unreadable" in events_of(blocks)


@needs_pty
def test_a_bus_that_says_nothing_readable_is_taken_for_lost(adapter: SlcanAdapter) -> None:
    device = open_device("bus", "can", adapter.device)
    assert adapter.ready(2.0)
    adapter.write(b"tZZZ2AABB\r" * 70)
    blocks: list[Block] = []
    ends = time.monotonic() + 20.0
    while "reopened" not in events_of(blocks) and time.monotonic() < ends:
        blocks += [block for block in [device.read(0.05)] if block is not None]
    blocks += device.close()
    assert events_of(blocks)[:1] == ["opened"]
    assert {"lost", "reopened", "unreadable"} <= set(events_of(blocks))


def test_udp_multicast_on_this_computer_arrives_in_order() -> None:
    from recoil_rigs.twin.transports import MulticastBus

    bus = MulticastBus()
    try:
        bus.plug()
        device = open_device("bus", "can", bus.device)
    except (DeviceError, OSError) as error:
        bus.unplug()
        pytest.skip(f"no multicast here: {error}")
    try:
        bus.send(CanItem(0.0, 0.0, 0x100, False, bytes(8)), 0.0)
        if not len(frames_of(read_until(device, 1, limit_s=1.0))):
            pytest.skip("multicast is not delivered on this computer")

        def feed() -> None:
            for n in range(1000):
                bus.send(CanItem(0.0, 0.0, 0x101, False, n.to_bytes(8, "big")), 0.0)
                if n % 5 == 4:
                    time.sleep(0.001)

        feeder = threading.Thread(target=feed)
        feeder.start()
        blocks = read_until(device, 1000, limit_s=10.0)
        feeder.join()
        numbers = frames_of(blocks)["data"][:, :8].copy().view(">u8").ravel()
        drops = device.counters.kernel_drops
        assert (np.diff(numbers.astype(np.int64)) > 0).all()
        assert len(numbers) + (drops or 0) >= 1000
        if sys.platform.startswith("linux"):
            assert drops is not None
    finally:
        device.close()
        bus.unplug()


def test_the_rigs_table_alone_decides_what_is_opened(channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_CHANNEL", "elsewhere")
    monkeypatch.setenv("CAN_INTERFACE", "slcan")
    device = CanDevice("bus", {"interface": "virtual", "channel": channel})
    device.open()
    assert event_of(device.read(0.0)).detail == f"virtual {channel}"
    device.close()
