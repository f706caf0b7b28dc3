"""The thread that reads a device: nothing is left behind, and no failure is silent."""

from __future__ import annotations

import itertools
import os
import threading
import time

import can
import pytest

from recoil_acquisition.devices import reader_thread
from recoil_acquisition.devices.device import (
    CAN,
    IDLE,
    LARGEST_PIECE,
    SERIAL,
    STREAM,
    Block,
    Counters,
    Device,
    event_block,
    event_of,
)  # fmt: skip
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.devices.reader_thread import DeviceReader
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.frames import can_rows


class Scripted:
    """A device that gives numbered blocks, some of them only when it is closed."""

    name = "scripted"
    kind = SERIAL
    counters = Counters()
    bytes_per_s = 1e3

    def __init__(self, blocks: int, held: int = 0, fails_at: int | None = None) -> None:
        self._left, self._held, self._fails_at = blocks, held, fails_at
        self._given = 0
        self.closed = 0

    def open(self) -> None: ...

    def _next(self) -> Block:
        self._given += 1
        return Block(self.name, time.monotonic_ns(), str(self._given - 1).encode(), SERIAL)

    def read(self, timeout_s: float) -> Block | None:
        if self._fails_at is not None and self._given == self._fails_at:
            raise RuntimeError("the driver broke")
        if self._given < self._left:
            return self._next()
        time.sleep(min(timeout_s, 0.01))
        return None

    def close(self) -> tuple[Block, ...]:
        self.closed += 1
        if self.closed > 1:
            return ()
        rest = tuple(self._next() for _ in range(self._held))
        return (*rest, event_block(self.name, time.monotonic_ns(), "closed", ""))


def numbers(blocks: list[Block]) -> list[int]:
    return [int(block.payload) for block in blocks if block.kind == SERIAL]


def wait_for(condition, limit_s: float = 30.0) -> None:
    ends = time.monotonic() + limit_s
    while not condition() and time.monotonic() < ends:
        time.sleep(0.005)
    assert condition()


def test_stopping_hands_on_everything_that_the_device_still_holds() -> None:
    device: Device = Scripted(50, held=30)
    blocks: list[Block] = []
    reader = DeviceReader(device, blocks.append)
    reader.start()
    wait_for(lambda: len(blocks) >= 50)
    assert device.closed == 0
    reader.stop()
    assert numbers(blocks) == list(range(80))
    assert (reader.error, len(blocks)) == (None, 81)
    assert reader.data_age_s is not None
    reader.stop()
    assert device.closed == 1


def test_a_bus_that_was_fed_before_the_stop_is_read_empty() -> None:
    channel = f"reader-{os.getpid()}"
    with can.Bus(interface="virtual", channel=channel, ignore_config=True) as sender:
        device = open_device("bus", "can", {"interface": "virtual", "channel": channel})
        with DeviceReader(device, lambda _: time.sleep(0.001)):
            for n in range(5000):
                sender.send(can.Message(arbitration_id=n % 2000, is_extended_id=False, data=bytes(8)))
    assert device.counters.received == 5000


def test_a_sink_that_fails_stops_the_reading_and_is_seen() -> None:
    device = Scripted(1000, held=5)
    blocks: list[Block] = []

    def sink(block: Block) -> None:
        if len(blocks) == 10:
            raise OSError(28, "No space left on device")
        blocks.append(block)

    reader = DeviceReader(device, sink)
    reader.start()
    wait_for(lambda: device.closed == 1)
    assert isinstance(reader.error, OSError)
    assert numbers(blocks) == list(range(10))
    reader.stop()


def test_a_sink_that_fails_at_the_very_end_is_seen_too() -> None:
    blocks: list[Block] = []

    def sink(block: Block) -> None:
        if block.payload == b"5":
            raise ValueError("no")
        blocks.append(block)

    reader = DeviceReader(Scripted(3, held=4), sink)
    reader.start()
    wait_for(lambda: len(blocks) == 3)
    reader.stop()
    assert isinstance(reader.error, ValueError)
    assert numbers(blocks) == list(range(5))


def test_a_device_that_fails_is_seen_and_closed() -> None:
    device = Scripted(1000, fails_at=7)
    blocks: list[Block] = []
    reader = DeviceReader(device, blocks.append)
    reader.start()
    wait_for(lambda: device.closed == 1)
    assert isinstance(reader.error, RuntimeError)
    assert numbers(blocks) == list(range(7))


def test_a_sink_that_hangs_is_reported_by_stop() -> None:
    release = threading.Event()
    reader = DeviceReader(Scripted(5), lambda _: release.wait(10))
    reader.start()
    with pytest.raises(DeviceError, match="source 'scripted': its device hangs, and is not closed"):
        reader.stop(timeout_s=0.1)
    release.set()
    reader.stop()


def test_a_reader_that_was_never_started_closes_its_device_when_stopped() -> None:
    device = Scripted(0, held=2)
    blocks: list[Block] = []
    DeviceReader(device, blocks.append).stop()
    assert numbers(blocks) == [0, 1]


class Told:
    """A device that gives what it is told to, and nothing between."""

    name = "told"
    kind = SERIAL
    counters = Counters()

    def __init__(self) -> None:
        self.next: list[Block] = []

    def open(self) -> None: ...

    def read(self, timeout_s: float) -> Block | None:
        time.sleep(min(timeout_s, 0.002))
        return self.next.pop(0) if self.next else None

    def close(self) -> tuple[Block, ...]:
        return ()


def test_a_silent_device_is_recorded_as_silent_and_one_that_is_lost_is_not(monkeypatch) -> None:
    monkeypatch.setattr(reader_thread, "IDLE_EVERY_NS", 20_000_000)
    device = Told()
    blocks: list[Block] = []
    with DeviceReader(device, blocks.append):
        wait_for(lambda: len(blocks) >= 3)
        assert {block.kind for block in blocks} == {IDLE}
        assert all(block.payload == b"" and block.empty_ns <= block.host_ns for block in blocks)
        gaps_ns = [b.host_ns - a.host_ns for a, b in itertools.pairwise(blocks)]
        assert min(gaps_ns) >= 20_000_000
        device.next.append(event_block("told", time.monotonic_ns(), "lost", "pulled out"))
        wait_for(lambda: blocks[-1].kind != IDLE)
        until = len(blocks)
        time.sleep(0.1)
        assert len(blocks) == until
        device.next.append(event_block("told", time.monotonic_ns(), "reopened", ""))
        wait_for(lambda: blocks[-1].kind == IDLE)


def test_what_waited_because_nobody_read_is_announced_by_an_event() -> None:
    device = Told()
    blocks: list[Block] = []
    with DeviceReader(device, blocks.append):
        now_ns = time.monotonic_ns() + 10**9
        on_time = Block("told", now_ns, b"a", SERIAL, now_ns - 240_000_000)
        busy = Block("told", now_ns + 240_000_000, b"b", SERIAL, now_ns - 10**9)
        late = Block("told", now_ns + 900_000_000, b"c", SERIAL, now_ns + 500_000_000)
        device.next += [on_time, busy, late]
        wait_for(lambda: len(blocks) >= 4)
    assert [block.payload for block in blocks if block.kind == SERIAL] == [b"a", b"b", b"c"]
    (event,) = [block for block in blocks if block.kind != SERIAL]
    assert blocks.index(event) == 2
    assert (event_of(event).name, event_of(event).detail) == ("stalled", "nothing was read for 0.400 s")


@pytest.mark.parametrize(("kind", "whole"), [(STREAM, 1), (SERIAL, 1), (CAN, can_rows.ROW_SIZE)])
def test_a_block_that_is_too_large_for_a_record_comes_in_pieces(kind: str, whole: int) -> None:
    content = os.urandom(3 * LARGEST_PIECE // whole * whole)
    device, sent = Scripted(0), Block("scripted", time.monotonic_ns(), content, kind, 17)
    device.read = lambda _: given.pop() if given else None  # type: ignore[method-assign]
    given, blocks = [sent], []
    with DeviceReader(device, blocks.append) as reader:
        wait_for(lambda: not given)
    data = [block for block in blocks if block.kind == kind]
    assert reader.error is None
    assert len(data) >= 3
    assert b"".join(block.payload for block in data) == content
    assert {(block.host_ns, block.empty_ns) for block in data} == {(sent.host_ns, 17)}
    assert all(len(block.payload) <= LARGEST_PIECE and len(block.payload) % whole == 0 for block in data)
