"""Serial ports read live, over pseudo-terminals."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from serial.tools.list_ports_common import ListPortInfo

from recoil_acquisition.devices import serial_device
from recoil_acquisition.devices.device import SERIAL, Block, event_of
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.devices.serial_commands import PollClock, SerialCommands
from recoil_acquisition.devices.serial_device import SerialDevice
from recoil_acquisition.devices.serial_port import PortIdentity, find, identity_of, learn
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.frames.framing import Command, Poll
from recoil_rigs.twin.transports import PseudoTerminal

needs_pty = pytest.mark.skipif(not hasattr(os, "openpty"), reason="this system has no pseudo-terminals")


@pytest.fixture
def port() -> Iterator[PseudoTerminal]:
    port = PseudoTerminal("imu")
    port.plug()
    yield port
    port.close()


def stream_of(blocks: list[Block]) -> bytes:
    return b"".join(block.payload for block in blocks if block.kind == SERIAL)


def events_of(blocks: list[Block]) -> list[str]:
    return [event_of(block).name for block in blocks if block.kind == "event"]


def read_until(device: Any, size: int, limit_s: float = 10.0) -> list[Block]:
    blocks: list[Block] = []
    ends = time.monotonic() + limit_s
    while len(stream_of(blocks)) < size and time.monotonic() < ends:
        blocks += [block for block in [device.read(0.05)] if block is not None]
    return blocks


def heard_by_device(port: PseudoTerminal, size: int) -> bytes:
    data, ends = b"", time.monotonic() + 20.0
    while len(data) < size and time.monotonic() < ends:
        try:
            data += os.read(port._master, 4096)  # the other end of the line, which the transport keeps to itself
        except BlockingIOError:
            time.sleep(0.005)
    return data


@needs_pty
def test_every_byte_arrives_as_it_was_sent(port: PseudoTerminal) -> None:
    device = open_device("imu", "serial", port.device)
    sent = np.random.default_rng(1).integers(0, 256, 1_000_000, dtype=np.uint8).tobytes()
    feeder = threading.Thread(target=lambda: port.write(sent))
    feeder.start()
    blocks = read_until(device, len(sent))
    feeder.join()
    blocks += device.close()
    assert stream_of(blocks) == sent
    times = [block.host_ns for block in blocks]
    assert times == sorted(times)
    counters = device.counters
    assert (counters.received, counters.bad, counters.reopened) == (1_000_000, 0, 0)
    assert counters.queue_high_water > 1000
    assert counters.kernel_drops is None  # a pseudo-terminal counts nothing
    assert counters.skipped_bytes is None
    assert events_of(blocks) == ["opened", "closed"]


@needs_pty
def test_closing_reads_what_still_waits(port: PseudoTerminal) -> None:
    device = open_device("imu", "serial", port.device)
    port.write(b"0123456789" * 200)
    assert stream_of(list(device.close())) == b"0123456789" * 200
    assert device.close() == ()
    with pytest.raises(ValueError, match="is not open"):
        device.read(0.0)


@needs_pty
def test_a_host_that_is_late_when_it_closes_reads_what_waits_all_the_same(port: PseudoTerminal, monkeypatch) -> None:
    monkeypatch.setattr(serial_device, "GRACE_S", -1.0)
    device = open_device("imu", "serial", port.device)
    port.write(b"0123456789" * 200)
    time.sleep(0.05)
    assert stream_of(list(device.close())) == b"0123456789" * 200


@needs_pty
def test_an_unplugged_port_is_told_and_found_again_by_its_link(port: PseudoTerminal) -> None:
    device = open_device("imu", "serial", port.device)
    port.write(b"before")
    blocks = read_until(device, 6)
    assert port.unplug() == 0
    ends = time.monotonic() + 20.0
    while "lost" not in events_of(blocks) and time.monotonic() < ends:
        blocks += [block for block in [device.read(0.05)] if block is not None]
    holder = os.openpty()  # takes the number that the old port had
    port.plug()
    while "reopened" not in events_of(blocks) and time.monotonic() < ends:
        blocks += [block for block in [device.read(0.05)] if block is not None]
    port.write(b"after")
    blocks += read_until(device, 5)
    blocks += device.close()
    for descriptor in holder:
        os.close(descriptor)
    assert stream_of(blocks) == b"beforeafter"
    assert events_of(blocks) == ["opened", "lost", "reopened", "closed"]
    assert device.counters.reopened == 1


@needs_pty
def test_a_port_that_another_program_uses_is_refused(port: PseudoTerminal) -> None:
    device = open_device("imu", "serial", port.device)
    with pytest.raises(DeviceError, match="another program uses it; close that program"):
        open_device("other", "serial", port.device)
    device.close()


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        ({"port": "/dev/no_such_port", "baudrate": 9600}, "no_such_port cannot be opened: there is no such port"),
        ({"port": "usb:ffff:fffe", "baudrate": 9600}, "there is no such port"),
        ({"port": "/dev/null", "baudrate": 9600}, "this is no serial port|the driver says"),
        ({"port": "/dev/ttyS0", "baud": 9600}, "no key 'baud'; expected baudrate"),
        ({"port": "/dev/ttyS0"}, "needs a baud rate"),
        ({"port": "/dev/ttyS0", "baudrate": True}, "needs a baud rate.*found True"),
        ({"baudrate": 9600}, "needs a port"),
        (None, "declares no device.*baudrate"),
    ],
)
def test_a_port_that_cannot_be_opened_says_why_in_one_line(table: dict[str, Any] | None, problem: str) -> None:
    with pytest.raises(DeviceError, match=problem) as caught:
        open_device("imu", "serial", table)
    assert str(caught.value).startswith("source 'imu'")
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may open everything")
@needs_pty
def test_a_port_without_permission_says_which_group(port: PseudoTerminal) -> None:
    port.path.resolve().chmod(0)
    with pytest.raises(DeviceError, match=r"permission.*dialout"):
        open_device("imu", "serial", port.device)


def test_a_source_of_another_kind_cannot_be_read_live() -> None:
    with pytest.raises(DeviceError, match="a camera source cannot be read live"):
        open_device("camera", "camera", {"port": "x"})


@needs_pty
def test_start_and_stop_commands_are_sent(port: PseudoTerminal) -> None:
    commands = SerialCommands(start=(Command(b"mode 1\r"), Command(b"go\r", 0.01)), stop=(Command(b"halt\r"),))
    device = SerialDevice("imu", port.device, commands=commands)
    device.open()
    assert heard_by_device(port, 10) == b"mode 1\rgo\r"
    device.close()
    assert heard_by_device(port, 5) == b"halt\r"


@pytest.mark.real_time
@needs_pty
def test_requests_are_sent_from_read_and_a_missing_answer_is_counted(port: PseudoTerminal) -> None:
    commands = SerialCommands(poll=(Poll(b"P1?", 0.02, 0.8), Poll(b"T1?", 0.02, 0.8)))
    device = SerialDevice("gauge", port.device, commands=commands)
    device.open()
    stop = threading.Event()
    asked: list[bytes] = []

    def answer() -> None:
        while not stop.is_set():
            try:
                asked.append(os.read(port._master, 64))  # the other end of the line
            except BlockingIOError:
                time.sleep(0.001)
                continue
            if len(asked) <= 10:
                port.write(b"<" + asked[-1] + b">")

    gauge = threading.Thread(target=answer)
    gauge.start()
    blocks = read_until(device, 50)
    ends = time.monotonic() + 20.0
    while "unanswered" not in events_of(blocks) and time.monotonic() < ends:
        blocks += [block for block in [device.read(0.05)] if block is not None]
    stop.set()
    gauge.join()
    blocks += device.close()
    replies = [stream_of(blocks)[at : at + 5] for at in range(0, len(stream_of(blocks)), 5)]
    assert len(replies) == 10
    assert min(replies.count(b"<P1?>"), replies.count(b"<T1?>")) >= 3
    assert device.counters.bad >= 1


def test_requests_keep_their_pace_and_wait_for_answers() -> None:
    clock = PollClock((Poll(b"a", 0.1, 0.05), Poll(b"b", 0.3, 0.05)))
    sent = []
    for k in range(1000):
        now = k * 1e-3
        request = clock.request(now)
        if request:
            sent.append((now, request))
        elif sent and now - sent[-1][0] >= 0.004:
            clock.answered()
    assert clock.unanswered == 0
    assert [r for _, r in sent].count(b"a") == 10
    assert [r for _, r in sent].count(b"b") == 4
    late = PollClock((Poll(b"a", 0.1, 0.05),))
    assert late.request(0.0) == b"a"
    assert late.request(0.04) is None
    assert late.request(10.0) == b"a"
    assert late.unanswered == 1
    late.answered()
    assert late.request(10.05) is None  # what was missed is not caught up


def plugged(device: str, serial_number: str | None, location: str | None = None) -> ListPortInfo:
    """Return a USB port as the system lists it."""
    info = ListPortInfo(device, skip_link_detection=True)
    info.vid, info.pid, info.serial_number, info.location = 0x0403, 0x6001, serial_number, location
    return info


def test_of_two_adapters_that_are_alike_none_is_taken_until_somebody_says_which(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from serial.tools import list_ports

    ports = [plugged("/dev/ttyUSB3", None, "1-1.2"), plugged("/dev/ttyUSB4", None, "1-1.3")]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)
    device = SerialDevice("imu", {"port": "usb:0403:6001", "baudrate": 115200})
    with pytest.raises(DeviceError, match="source 'imu': 2 USB devices 0403:6001 are plugged in") as refused:
        device.open()
    assert "/dev/ttyUSB4 (no serial number, at 1-1.3)" in str(refused.value)
    assert "/dev/serial/by-path" in str(refused.value)
    del ports[0]
    assert find(identity_of("usb:0403:6001")) == "/dev/ttyUSB4"


def test_adapters_without_serial_numbers_that_come_back_under_each_others_names_are_not_exchanged(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from serial.tools import list_ports

    first, second = (str(tmp_path / name) for name in ("ttyUSB0", "ttyUSB1"))
    ports = [plugged(first, None, "1-1.2"), plugged(second, None, "1-1.3")]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)
    known = learn(identity_of(first))
    ports[:] = [plugged(first, None, "1-1.3"), plugged(second, None, "1-1.2")]
    Path(first).touch()
    assert find(known) == second
    Path(first).unlink()
    ports[:] = [plugged("/dev/ttyUSB7", None, "1-1.7")]  # plugged in elsewhere, and the only one
    assert find(known) == "/dev/ttyUSB7"


def test_a_port_is_named_by_its_path_or_its_usb_identifiers(monkeypatch: pytest.MonkeyPatch) -> None:
    from serial.tools import list_ports

    monkeypatch.setattr(list_ports, "comports", lambda: [plugged("/dev/ttyUSB3", "A1"), plugged("/dev/ttyUSB4", "B2")])
    assert find(identity_of("usb:0403:6001:B2")) == "/dev/ttyUSB4"
    assert identity_of("/dev/ttyUSB0") == PortIdentity("/dev/ttyUSB0")
    known = learn(identity_of("/dev/ttyUSB4"))
    assert known == PortIdentity("/dev/ttyUSB4", 0x0403, 0x6001, "B2")
    monkeypatch.setattr(list_ports, "comports", lambda: [plugged("/dev/ttyUSB0", "B2")])
    assert find(known) == "/dev/ttyUSB0"
    with pytest.raises(FileNotFoundError, match="0403:6001 A1"):
        find(identity_of("usb:0403:6001:A1"))
