"""Stamps of a CAN controller: taken where the kernel hands them over, and told apart from the kernel's own."""

from __future__ import annotations

import socket
import struct
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import can.interfaces.socketcan.socketcan as library
import pytest

from recoil_acquisition.capture.live_source import signals_of
from recoil_acquisition.devices.device import CAN, Block
from recoil_acquisition.devices.hardware_stamps import SO_TIMESTAMPING, StampedSocket, stamp_by_hardware
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.frames import can_rows
from tests.builders.can_rows import pack_row
from tests.builders.live_sources import bus

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="such stamps are of Linux alone")

STAMPS_NS = (5_000_000_123, 5_001_950_128, 5_003_900_119)
"""Of a periodic message on a controller that was switched on 5 s before."""


class ControllerSocket(socket.socket):
    """A socket of datagrams, each of which a controller stamped, as the kernel says it."""

    stamps_ns: tuple[int, ...] = ()

    def recvmsg(self, *args: Any) -> Any:
        data, ancillary, *rest = super().recvmsg(*args)
        read = self.__dict__.setdefault("read", [])
        read.append(data)
        stamp_ns = self.stamps_ns[len(read) - 1] if len(read) <= len(self.stamps_ns) else 0
        message = struct.pack("@6l", 0, 0, 0, 0, *divmod(stamp_ns, 1_000_000_000))
        return (data, [*ancillary, (socket.SOL_SOCKET, SO_TIMESTAMPING, message)], *rest)


Wire = Callable[[tuple[int, ...]], tuple[Any, Callable[[int], None]]]


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Iterator[Wire]:
    """python-can's own bus of sockets, over datagrams of this computer: it has no controller area network."""
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def plugged(stamps_ns: tuple[int, ...]) -> tuple[Any, Callable[[int], None]]:
        inner = ControllerSocket(socket.AF_INET, socket.SOCK_DGRAM)
        inner.stamps_ns = stamps_ns
        inner.bind(("127.0.0.1", 0))
        address = inner.getsockname()
        monkeypatch.setattr(library, "create_socket", lambda: inner)
        monkeypatch.setattr(library, "bind_socket", lambda *_: None)
        device = open_device("bus", "can", {"interface": "socketcan", "channel": "can9"})

        def send(number: int) -> None:
            sender.sendto(struct.pack("=IB3x8s", 0x100, 8, bytes([number])), address)

        return device, send

    yield plugged
    sender.close()


def rows_of(device: Any, frames: int) -> Any:
    rows, ends = can_rows.parse_rows(b""), time.monotonic() + 5.0
    while rows.size < frames and time.monotonic() < ends:
        block = device.read(0.1)
        if block is not None and block.kind == CAN:
            rows = can_rows.parse_rows(rows.tobytes() + block.payload)
    device.close()
    return rows


def test_a_controllers_stamp_is_kept_to_the_nanosecond(wire: Wire) -> None:
    device, send = wire(STAMPS_NS)
    for number in range(3):
        send(number)
    rows = rows_of(device, 3)
    assert rows["device_ns"].tolist() == list(STAMPS_NS)
    assert rows["flags"].tolist() == [can_rows.DEVICE_TIME | can_rows.HARDWARE_TIME] * 3
    assert can_rows.clock_of(rows["flags"]) == can_rows.DEVICE_TIME | can_rows.HARDWARE_TIME
    assert rows["data"][:, 0].tolist() == [0, 1, 2]


def test_without_one_the_kernels_stamp_stays_and_is_never_taken_for_the_controllers(wire: Wire) -> None:
    device, send = wire(STAMPS_NS[:2])
    before_ns = time.time_ns()
    for number in range(3):
        send(number)
    rows = rows_of(device, 3)
    assert rows["device_ns"][:2].tolist() == list(STAMPS_NS[:2])
    assert rows["flags"][2] == can_rows.DEVICE_TIME
    assert before_ns - 1000 <= rows["device_ns"][2] <= time.time_ns()
    assert can_rows.clock_of(rows["flags"]) is None


def test_the_kernels_own_message_of_a_stamp_is_laid_out_as_it_is_read() -> None:
    software = 1 << 3 | 1 << 4  # the kernel's own stamp in the first instant: no hardware is here
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as reader,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        reader.bind(("127.0.0.1", 0))
        reader.setsockopt(socket.SOL_SOCKET, library.constants.SO_TIMESTAMPNS, 1)
        reader.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPING, software)
        sender.sendto(b"frame", reader.getsockname())
        _, ancillary, *_ = reader.recvmsg(64, 256)
        by_kind = {kind: content for _, kind, content in ancillary}
        assert struct.unpack("@6l", by_kind[SO_TIMESTAMPING])[:2] == struct.unpack(
            "@2l", by_kind[library.constants.SO_TIMESTAMPNS]
        )
        sender.sendto(b"frame", reader.getsockname())
        stamped = StampedSocket(reader)
        data, kept, *_ = stamped.recvmsg(64, library.RECEIVED_ANCILLARY_BUFFER_SIZE)
        assert (data, stamped.hardware_ns) == (b"frame", 0)
        assert [kind for _, kind, _ in kept] == [library.constants.SO_TIMESTAMPNS]


def test_a_bus_without_a_socket_is_left_as_it_is() -> None:
    assert stamp_by_hardware(object()) is None


def test_a_change_from_the_kernels_clock_to_the_controllers_moves_no_sample() -> None:
    source = replace(bus(), device={"interface": "socketcan", "channel": "can9"})
    signals = signals_of(source, source.channels)
    hardware = can_rows.DEVICE_TIME | can_rows.HARDWARE_TIME
    found, blocks = [], []
    for k in range(400):
        at_ns = round(1e7) * k
        flags, zero_ns = (can_rows.DEVICE_TIME, 10**18) if k < 200 else (hardware, 10**18 - 10**8)
        row = pack_row(device_ns=at_ns + zero_ns, host_ns=at_ns, identifier=291, flags=flags, data=bytes(4))
        blocks.append(Block("bus", at_ns, row, CAN))
        found += signals.feed(blocks[-1])
    times_s = [float(one.times_s[0]) for one in found]
    assert times_s == [k / 100 for k in range(400)]
    assert signals.stamped_by(blocks[:200]) == "kernel"
    assert signals.stamped_by(blocks[200:]) == "hardware"
    assert signals.stamped_by(blocks) == "host"
