"""Blocks, events, the host's two clocks, and the kernel's counts."""

from __future__ import annotations

import errno
import os
import socket
import struct
import sys
import time
from pathlib import Path

import pytest

from recoil_acquisition.clocks.host_clock import Anchor, anchor
from recoil_acquisition.devices.device import CAN, EVENT, LONGEST_DETAIL, Block, event_block, event_of
from recoil_acquisition.devices.kernel_drops import (
    GrowingCount,
    LineErrors,
    dropped_by_can_link,
    dropped_by_udp_socket,
    line_errors,
    line_errors_of,
)
from recoil_acquisition.devices.open_fault import error_number, open_fault
from recoil_acquisition.devices.reopening import LONGEST_PAUSE_S, BackOff
from recoil_acquisition.errors import ErrorCode
from recoil_acquisition.log.record import LONGEST_PAYLOAD
from tests.builders.played_clock import PlayedClock


def test_an_event_survives_as_bytes_in_one_line() -> None:
    block = event_block("bus", 5, "lost", "über\nUSB")
    assert block.kind == EVENT
    assert event_of(block).name == "lost"
    assert event_of(block).detail == "über USB"
    with pytest.raises(ValueError, match="records no event"):
        event_of(Block("bus", 5, b"x", CAN))
    with pytest.raises(ValueError, match="records no event"):
        event_of(Block("bus", 5, b"[1]", EVENT))


def test_the_anchor_relates_both_clocks_closely() -> None:
    one = anchor()
    assert 0 <= one.within_ns < 1_000_000
    before_ns, monotonic_ns, after_ns = time.time_ns(), time.monotonic_ns(), time.time_ns()
    assert before_ns - 10_000_000 < one.wall_of(monotonic_ns) < after_ns + 10_000_000
    assert Anchor(1000, 400, 1).wall_of(450) == 1050


def test_the_drops_of_a_can_link_are_summed(tmp_path: Path) -> None:
    folder = tmp_path / "can0" / "statistics"
    folder.mkdir(parents=True)
    for i, name in enumerate(("rx_dropped", "rx_over_errors", "rx_fifo_errors", "rx_missed_errors")):
        (folder / name).write_text(f"{10**i}\n")
    assert dropped_by_can_link("can0", tmp_path) == 1111
    (folder / "rx_dropped").write_text("none")
    assert dropped_by_can_link("can0", tmp_path) is None
    assert dropped_by_can_link("can1", tmp_path) is None


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc is Linux's")
def test_the_drops_of_a_udp_socket_are_counted() -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        receiver.bind(("127.0.0.1", 0))
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        before = dropped_by_udp_socket(receiver.fileno())
        assert before == 0
        for _ in range(300):
            sender.sendto(bytes(500), receiver.getsockname())
        held = 0
        receiver.setblocking(False)
        while True:
            try:
                receiver.recv(1000)
            except BlockingIOError:
                break
            held += 1
        assert dropped_by_udp_socket(receiver.fileno()) == 300 - held > 0
        assert dropped_by_udp_socket(receiver.fileno(), (Path("/nowhere"),)) is None
    assert dropped_by_udp_socket(10**6) is None


def test_the_kernels_answer_on_a_serial_port_is_read_as_linux_lays_it_out() -> None:
    # cts dsr rng dcd rx tx frame overrun parity brk buf_overrun, then reserved
    answer = struct.pack("20i", 0, 0, 0, 0, 900, 0, 3, 20, 4, 7, 100, *[0] * 9)
    assert line_errors_of(answer) == LineErrors(damaged=7, dropped=120)
    with Path(os.devnull).open("rb") as file:
        assert line_errors(file.fileno()) is None


def test_what_a_count_grew_by_is_summed_over_all_openings() -> None:
    count = GrowingCount()
    count.see(None)
    assert count.total is None
    for look in (100, 100, 103):
        count.see(look)
    assert count.total == 3
    count.restart()
    for look in (50, 54, 2):  # the last one of a system that began anew
        count.see(look)
    assert count.total == 7


def test_the_systems_number_is_found_through_any_wrapping() -> None:
    outer = RuntimeError("driver failed")
    outer.__cause__ = OSError(errno.EACCES, "Permission denied")
    assert error_number(outer) == errno.EACCES
    fault = open_fault("bus", "slcan COM3", outer)
    assert "permission is missing" in str(fault)
    assert error_number(ValueError("[Errno 19] No such device")) == errno.ENODEV
    windows = "could not open port 'COM9': FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)"
    assert error_number(ValueError(windows)) == errno.ENOENT
    assert (
        error_number(ValueError("could not open port 'COM9': PermissionError(13, 'Access is denied.')")) == errno.EBUSY
    )
    assert error_number(ValueError("odd")) is None
    lacking = open_fault("bus", "udp_multicast", NotImplementedError("msgpack not installed"))
    assert (lacking.code, lacking.remedy) == (ErrorCode.NOT_INSTALLED, "pip install msgpack")
    maker = open_fault("bus", "vector 0", NotImplementedError("only supported on Windows"))
    assert (maker.remedy or "").startswith("install the library or the maker's driver")
    assert "the driver says: odd" in str(open_fault("bus", "pcan 1", ValueError("odd\n")))
    assert "found /dev/ttyUSB1, /dev/ttyS0" in str(
        open_fault("imu", "/dev/ttyUSB0", FileNotFoundError(2, "x"), available=["/dev/ttyS0", "/dev/ttyUSB1"])
    )


@pytest.mark.parametrize("character", ["x", "ü", "\x1b", "\U0001f600", '"'])
def test_an_event_with_all_that_a_device_sent_is_cut_with_its_length_said(character: str) -> None:
    block = event_block("bus", 5, "lost", character * (2 << 20))
    assert len(block.payload) < LONGEST_PAYLOAD
    assert event_of(block).detail == f"{character * LONGEST_DETAIL} ... (cut, {2 << 20} characters)"


def test_pauses_between_tries_grow_to_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = PlayedClock()
    monkeypatch.setattr("recoil_acquisition.devices.reopening.time", clock)
    pauses = BackOff()
    pauses.lost()
    assert not pauses.wait(0.0)
    assert pauses.wait(1.0)
    for _ in range(40):
        pauses.failed()
    before_s = clock.monotonic()
    assert not pauses.wait(0.02)
    assert pauses.wait(LONGEST_PAUSE_S + 0.1)
    assert clock.monotonic() - before_s > 0.5
    assert pauses.tries == 2
