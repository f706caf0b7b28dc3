"""A CAN bus through any interface of python-can.

The bus is read by ``recv`` in the caller's own thread. python-can's Notifier is not used: a listener that
raises ends its thread without a word, and stopping it leaves what is queued unread. Every frame is
packed as it comes, with the interface's stamp and the host's, and decoded after the shot.

A bus itself repeats what was damaged, but an adapter's own line to the host may have no checksum (``slcan`` has
none): what a damaged line turns into a wrong but well-formed frame, nobody can see.

What python-can and the system know of a bus beside its frames stands first: flags of messages, the queue, losses,
neighbours.
"""

from __future__ import annotations

import contextlib
import os
import socket
import stat
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.device import CAN, Block, Counters, EmptyLook
from recoil_acquisition.devices.hardware_stamps import StampedSocket, stamp_by_hardware
from recoil_acquisition.devices.kernel_drops import GrowingCount, dropped_by_can_link, dropped_by_udp_socket
from recoil_acquisition.devices.open_fault import open_fault
from recoil_acquisition.devices.reopening import GRACE_S, ReopenedDevice
from recoil_acquisition.devices.stream_check import StreamCheck, can_counter_check
from recoil_acquisition.errors import DeviceError, nearest_first
from recoil_acquisition.frames import can_rows
from recoil_acquisition.packages.can_library import load_can_library
from recoil_acquisition.readers.can.buses import BusName, bus_number

RECEIVE_BUFFER = 16 << 20
"""Bytes asked for as a socket's queue: the kernel's default holds a few hundred frames, this some seconds."""

_FORCED = 33
"""Option SO_RCVBUFFORCE of Linux (asm-generic/socket.h): beyond the system's limit, for who may."""


def enlarge_queue(bus: Any) -> None:
    """Ask for a longer queue where the interface is a socket; a refusal is no fault."""
    with contextlib.suppress(Exception):  # many interfaces have no descriptor, each says so in its own way
        descriptor = bus.fileno()
        if descriptor >= 0 and stat.S_ISSOCK(os.fstat(descriptor).st_mode):
            # a second handle of the same socket: python-can's own is private
            with socket.socket(fileno=os.dup(descriptor)) as twin:
                twin.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
                if sys.platform == "linux":
                    twin.setsockopt(socket.SOL_SOCKET, _FORCED, RECEIVE_BUFFER)


def kernel_drops(bus: Any, interface: str, channel: str) -> int | None:
    """Return what the kernel dropped of an open bus so far; None where it does not say."""
    if interface == "socketcan":
        return dropped_by_can_link(channel)
    if interface == "udp_multicast":
        return dropped_by_udp_socket(bus.fileno())
    return None


def flags_of(message: Any) -> int:
    """Return the flags of a message of python-can, as `frames.can_rows` has them, but for its stamp's."""
    flags = can_rows.EXTENDED if message.is_extended_id else 0
    if message.is_error_frame:
        flags |= can_rows.ERROR
    if message.is_remote_frame:
        flags |= can_rows.REMOTE
    if message.is_fd:
        flags |= can_rows.FD
        flags |= can_rows.BIT_RATE_SWITCH if message.bitrate_switch else 0
        flags |= can_rows.ERROR_STATE if message.error_state_indicator else 0
    return flags if message.is_rx else flags | can_rows.SENT


def delivers_several_buses(table: Mapping[str, Any] | None) -> bool:
    """Return whether the device of a rig's table hands over frames of more than one bus, by the channels it names."""
    if table is None or "interface" not in table:
        return False
    channel = table.get("channel", "" if table["interface"] == "socketcan" else None)
    if isinstance(channel, str):
        return "," in channel or channel.strip() in ("", "any")
    return isinstance(channel, list | tuple) and len(channel) > 1


def can_links() -> list[str]:
    """Return the CAN network devices of this system."""
    try:
        return sorted(name for _, name in socket.if_nameindex() if "can" in name)
    except (OSError, AttributeError):
        return []


HOST_STAMPED = ("slcan", "iscan", "robotell")
"""Interfaces whose driver stamps a frame with the wall clock when it reads it: no clock of the device."""

KERNEL_STAMPED = ("socketcan", "udp_multicast")
"""Interfaces whose frames the kernel stamps when they arrive, before the driver reads them, if no hardware does."""

BLOCK_S = 0.01
"""Longest time over which frames are gathered into one block."""

BLOCK_FRAMES = 1024
"""Most frames in a block."""

_CLOSE_LIMIT_S = 1.0
_AT_ONCE_NS = 30_000
"""Time within which a frame that was waiting already is returned."""
_MOST_UNREADABLE_IN_A_ROW = 64
"""Number of unreadable entries in a row at which a bus is taken for lost."""
_LARGEST_NUMBER = 255
"""Largest number of a bus that a row of a log holds."""
_REPORT_EVERY_NS = 1_000_000_000


class CanDevice(ReopenedDevice):
    """One CAN bus.

    Parameters
    ----------
    name
        Name of the source.
    table
        The rig's ``device`` table: ``interface`` and whatever keywords that interface of python-can takes.
    check
        Counter that looks at every block of frames.
    bus
        Bus that is wanted, where the interface delivers several: all are recorded, and a name keeps the number at its
        end.

    Raises
    ------
    DeviceError
        If the table names no interface that python-can knows.
    """

    kind = CAN

    def __init__(
        self,
        name: str,
        table: Mapping[str, Any],
        *,
        check: StreamCheck | None = None,
        bus: BusName | None = None,
    ) -> None:
        load_can_library()
        import can

        options = dict(table)
        interface = options.pop("interface", None)
        if interface not in can.VALID_INTERFACES:
            known = nearest_first(str(interface), sorted(can.VALID_INTERFACES))
            raise DeviceError(
                f"source '{name}': python-can has no interface {interface!r}",
                found=", ".join(known[:8]),
                remedy="correct `device.interface` in the rig file, nearest names first, or install its plug-in",
            )
        where = options.get("channel")
        super().__init__(name, str(interface) if where is None else f"{interface} {where}", "frames", check)
        self._options, self._interface = options, str(interface)
        self._stamped_by_device = 0 if interface in HOST_STAMPED else can_rows.DEVICE_TIME
        self._buffer = bytearray(BLOCK_FRAMES * can_rows.ROW_SIZE)
        self._bad = self._error_frames = self._unreported = self._reported_ns = 0
        self._drops = GrowingCount()
        self._hardware: StampedSocket | None = None
        self._numbers: dict[object, int] | None = {} if delivers_several_buses(table) else None
        if self._numbers is not None and isinstance(bus, str):
            self._number(bus)

    @property
    def counters(self) -> Counters:
        """Counts of what it received and lost so far."""
        self._look_for_drops()
        return self._counters(bad=self._bad, kernel_drops=self._drops.total, error_frames=self._error_frames)

    @property
    def bytes_per_s(self) -> float:
        """Bytes per second of the rows of a full bus: at most 8,000 frames at 1 Mbit/s."""
        return float(self._options.get("bitrate", 1_000_000)) / 1_000_000 * 8000 * can_rows.ROW_SIZE

    def _open_fault(self, error: Exception) -> DeviceError:
        return open_fault(self.name, self._what, error, available=can_links())

    def _take(self, timeout_s: float) -> Block | None:
        return self._gather(timeout_s, BLOCK_S)

    def _rest(self) -> list[Block]:
        blocks = []
        began = time.monotonic()
        # A bus that never falls silent is cut off at the limit
        while self._driver is not None and (passed_s := time.monotonic() - began) < _CLOSE_LIMIT_S:
            block = self._ahead.popleft() if self._ahead else self._gather(max(GRACE_S - passed_s, 0.0), 0.0)
            if block is not None:
                blocks.append(block)
            elif not self._ahead and passed_s > GRACE_S:
                break
        self._report_unreadable(at_once=True)
        return blocks

    def _connect(self) -> None:
        import can

        # python-can would also read configuration files and the environment: the rig alone says what is opened
        self._look = EmptyLook()
        bus = can.Bus(interface=self._interface, ignore_config=True, **self._options)
        enlarge_queue(bus)
        self._hardware = stamp_by_hardware(bus) if self._interface == "socketcan" else None
        self._driver = bus
        self._drops.restart()
        self._look_for_drops()

    def _disconnect(self) -> None:
        bus = self._driver
        if bus is None:
            return
        self._look_for_drops()
        self._driver = None
        try:
            bus.shutdown()
        except Exception:
            # slcan writes a last command before it closes its port; without the device that fails
            port = getattr(bus, "serialPortOrig", None)
            if port is not None:
                with contextlib.suppress(Exception):
                    port.close()

    def _gather(self, timeout_s: float, block_s: float) -> Block | None:
        """Receive frames and pack them, until the time of a block is over or nothing waits."""
        bus, pack, buffer, now = self._driver, can_rows.ROW.pack_into, self._buffer, time.monotonic_ns
        if bus is None or self._ahead:
            return None
        count = errors = at_once = in_a_row = 0
        stamped, hardware = self._stamped_by_device, self._hardware
        # what waits already is asked for first: the bus is known to be empty only where nothing does
        ends_ns, wait_s, looking = 0, 0.0, True
        before_ns = host_ns = now()
        empty_ns = self._look.empty_ns
        while count < BLOCK_FRAMES:
            try:
                message = bus.recv(wait_s)
            except Exception as error:
                in_a_row += 1
                if self._is_unreadable(error) and in_a_row < _MOST_UNREADABLE_IN_A_ROW:
                    self._bad += 1
                    self._unreported += 1
                    continue
                self._lose(error)
                break
            self._look.looked(before_ns, empty=message is None)
            if message is None:
                if looking and timeout_s:
                    empty_ns, wait_s, looking, before_ns = self._look.empty_ns, timeout_s, False, now()
                    continue
                break
            host_ns, in_a_row, looking = now(), 0, False
            at_once = at_once + 1 if host_ns - before_ns < _AT_ONCE_NS else 0
            if at_once > self._high_water:
                self._high_water = at_once
            before_ns = host_ns
            flags, length, data = flags_of(message), message.dlc, bytes(message.data)
            if message.timestamp:
                flags |= stamped
            if flags & can_rows.ERROR:
                errors += 1
                length = len(data)
            elif len(data) != length and not flags & can_rows.REMOTE:
                # slcan takes a line that lost characters for a frame with less data than its length says
                self._bad += 1
                self._unreported += 1
                continue
            channel = self._number(message.channel)
            stamp_ns = round(message.timestamp * 1e9)
            if hardware is not None and hardware.hardware_ns:
                stamp_ns = hardware.hardware_ns
                flags |= can_rows.HARDWARE_TIME
            place = count * can_rows.ROW_SIZE
            pack(buffer, place, stamp_ns, host_ns, message.arbitration_id, flags, channel, length, data)
            count += 1
            if count == 1:
                ends_ns = host_ns + int(block_s * 1e9)
            wait_s = max(ends_ns - host_ns, 0) / 1e9
            if block_s and not wait_s:
                break
        self._report_unreadable()
        if not count:
            return None
        payload = bytes(memoryview(buffer)[: count * can_rows.ROW_SIZE])
        self._received += count - errors
        self._error_frames += errors
        block = Block(self.name, host_ns, payload, CAN, empty_ns)
        if self._check is not None:
            self._check.feed(block)
        return block

    def _number(self, channel: object) -> int:
        """Return the number of a frame's bus: its own, that at the end of its name, or one that no other bus has."""
        if isinstance(channel, int) and 0 <= channel <= _LARGEST_NUMBER:
            return channel
        if self._numbers is None:
            return 0
        if channel not in self._numbers:
            taken = set(self._numbers.values())
            wanted = bus_number(channel) if isinstance(channel, str) else None
            free = (number for number in range(_LARGEST_NUMBER, 0, -1) if number not in taken)
            is_free = wanted is not None and wanted <= _LARGEST_NUMBER and wanted not in taken
            self._numbers[channel] = wanted if wanted is not None and is_free else next(free, 0)
        return self._numbers[channel]

    def _is_unreadable(self, error: BaseException) -> bool:
        """Return whether one entry could not be read while the bus itself goes on."""
        if isinstance(error, UnicodeDecodeError) or isinstance(error.__cause__, UnicodeDecodeError):
            # slcan keeps a line with a byte that is no ASCII, and would fail with it again for ever
            held = getattr(self._driver, "_buffer", None)
            if isinstance(held, bytearray):
                held.clear()
            return True
        # udp_multicast says so of a datagram of another program
        return isinstance(error, ValueError | IndexError | KeyError) or "could not unpack" in str(error)

    def _report_unreadable(self, *, at_once: bool = False) -> None:
        """Record unreadable entries as an event, at most once a second."""
        now_ns = time.monotonic_ns()
        if self._unreported and (at_once or now_ns - self._reported_ns > _REPORT_EVERY_NS):
            self._tell("unreadable", f"{self._unreported} entries")
            self._unreported, self._reported_ns = 0, now_ns

    def _look_for_drops(self) -> None:
        bus = self._driver
        if bus is not None:
            self._drops.see(kernel_drops(bus, self._interface, str(self._options.get("channel", ""))))


def can_device(source: str, table: Mapping[str, Any], declared: DeviceDeclarations) -> CanDevice:
    """Return the device of a bus, whose declared counters are checked; DeviceError if the table is at fault."""
    check = None
    if declared.counters and declared.database is not None:
        check = can_counter_check(source, declared.counters, declared.database, Path(f"source {source}"), declared.bus)
    return CanDevice(source, table, check=check, bus=declared.bus)
