"""Transports of a play to the host: python-can's virtual bus and multicast bus, and pseudo-terminals.

A transport gives the rig's ``device`` table under which the host opens it. Over a pseudo-terminal
python-can's own ``slcan`` driver reads a bus from a device that speaks the LAWICEL commands (CAN232 manual,
LAWICEL AB: ``S`` bit rate, ``O`` and ``L`` open, ``C`` close, ``t``, ``T``, ``r``, ``R`` frames, CR, BEL).
"""

from __future__ import annotations

import os
import select
import socket
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import DeviceError
from recoil_acquisition.files.temporary_folder import temporary_folder
from recoil_rigs.twin.can_replay import CanItem

_GROUP = "239.74.163.2"
"""python-can's own multicast group for IPv4, of the range for private use."""

_DRAIN_LIMIT_S = 0.25
_LOOK_S = 0.05
_PATIENCE_S = 3.0


class VirtualBus:
    """python-can's bus within one process; its stamps are those of the virtual interface.

    Unplugged, it is silent: nobody on it notices.
    """

    def __init__(self, channel: str) -> None:
        self._options: dict[str, Any] = {"interface": "virtual", "channel": channel}
        self._bus: Any = None

    @property
    def device(self) -> Mapping[str, Any]:
        """The rig's ``device`` table under which the host opens it."""
        return dict(self._options)

    def plug(self) -> None:
        """Join the bus."""
        import can

        self._bus = can.Bus(**self._options, preserve_timestamps=True, ignore_config=True)

    def unplug(self) -> int:
        """Leave the bus; the host keeps what it has queued."""
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.shutdown()
        return 0

    def ready(self, timeout_s: float) -> bool:  # noqa: ARG002 - nobody can see who listens
        """Return True."""
        return True

    def send(self, item: CanItem, base_s: float) -> bool:
        """Send a frame, its stamp counted from a base; return whether it went out."""
        self._bus.send(_message(item, base_s))
        return True


class MulticastBus(VirtualBus):
    """python-can's bus over UDP, kept on this computer by a time to live of 0; stamps are the kernel's."""

    def __init__(self) -> None:
        super().__init__(_GROUP)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("", 0))
            port = probe.getsockname()[1]
        self._options = {"interface": "udp_multicast", "channel": _GROUP, "port": port, "hop_limit": 0}

    def plug(self) -> None:
        """Join the group; DeviceError if this computer lacks msgpack or refuses the socket."""
        import can

        try:
            self._bus = can.Bus(**self._options, ignore_config=True)
        except (can.CanError, OSError) as error:
            raise DeviceError(
                f"the virtual bus over udp_multicast cannot be opened: {error}",
                remedy="use another transport, such as `virtual`",
            ) from error


class PseudoTerminal:
    """A serial port without hardware, under a link that stays the same when it is plugged in again.

    A pseudo-terminal holds up to 20 KiB and then makes the sender wait, where a real port would lose bytes; here
    too they are lost if nobody reads for three seconds.
    """

    def __init__(self, name: str) -> None:
        self._folder = temporary_folder()
        self.path = Path(self._folder.name) / name
        self._master = self._slave = -1
        self._flows = True
        self._stop = threading.Event()

    @property
    def device(self) -> Mapping[str, Any]:
        """The rig's ``device`` table under which the host opens it."""
        return {"port": str(self.path), "baudrate": 921600}

    def plug(self) -> None:
        """Make the port; DeviceError where there are no pseudo-terminals."""
        if not hasattr(os, "openpty"):
            raise DeviceError(
                f"a virtual serial port needs pseudo-terminals, which {sys.platform} has not",
                remedy="use a CAN source with the transport `virtual`, or Linux",
            )
        import tty

        self._stop.clear()
        self._master, self._slave = os.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> int:
        """Take the port away, after a short time for the host to read it empty.

        The kernel counts only what a reader may take at once, 4,095 bytes at most: as much again, and more, may wait
        behind that and goes with the port uncounted.
        """
        if self._master < 0:
            return 0
        ends = time.monotonic() + _DRAIN_LIMIT_S
        while (left := self._unread()) and time.monotonic() < ends:
            time.sleep(0.002)
        self._remove()
        return left

    def close(self) -> None:
        """Take everything away for good, at once."""
        self._remove()
        self._folder.cleanup()

    def _remove(self) -> None:
        self._stop.set()
        if self._master < 0:
            return
        self.path.unlink(missing_ok=True)
        master, slave, self._master, self._slave = self._master, self._slave, -1, -1
        os.close(master)
        os.close(slave)

    def ready(self, timeout_s: float) -> bool:  # noqa: ARG002 - the kernel does not say
        """Return True."""
        return True

    def write(self, data: bytes) -> bool:
        """Write bytes, waiting while the port is full; False if nobody reads it, or it was taken away meanwhile."""
        at = 0
        # nobody has read it for long: what comes is lost, as on a line, until there is room again
        patient_until = time.monotonic() + (_PATIENCE_S if self._flows else 0.0)
        while at < len(data):
            if self._stop.is_set() or self._master < 0:
                return False
            try:
                at += os.write(self._master, data[at:])
            except BlockingIOError:
                if time.monotonic() > patient_until:
                    self._flows = False
                    return False
                select.select([], [self._master], [], _LOOK_S)
            except OSError:
                return False
        self._flows = True
        return True

    def _unread(self) -> int:
        import fcntl
        import struct
        import termios

        answer = fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4))
        return int(struct.unpack("i", answer)[0])

    def abort(self) -> None:
        """Let a write that waits give up."""
        self._stop.set()


class SlcanAdapter(PseudoTerminal):
    """A CAN adapter on a serial port, for python-can's real ``slcan`` driver: without a clock, without error frames."""

    def __init__(self, name: str, bitrate_hz: int = 1_000_000) -> None:
        super().__init__(name)
        self._bitrate_hz = bitrate_hz
        self._open = threading.Event()
        self._lock = threading.Lock()
        self._listener: threading.Thread | None = None

    @property
    def device(self) -> Mapping[str, Any]:
        """The rig's ``device`` table under which the host opens it."""
        return {
            "interface": "slcan",
            "channel": str(self.path),
            "bitrate": self._bitrate_hz,
            "sleep_after_open": 0.0,
        }

    def plug(self) -> None:
        """Make the port and listen to commands."""
        super().plug()
        self._open.clear()
        self._listener = threading.Thread(target=self._listen, name=f"slcan {self.path.name}", daemon=True)
        self._listener.start()

    def _remove(self) -> None:
        self._stop.set()
        if self._listener is not None:
            self._listener.join()
            self._listener = None
        self._open.clear()
        super()._remove()

    def ready(self, timeout_s: float) -> bool:
        """Wait until the host has opened the channel."""
        return self._open.wait(timeout_s)

    def send(self, item: CanItem, base_s: float) -> bool:  # noqa: ARG002 - it sends no stamps
        """Send a frame; False if the channel is not open, or the frame is an error frame."""
        if item.error or not self._open.is_set():
            return False
        name = f"T{item.identifier:08X}" if item.extended else f"t{item.identifier:03X}"
        return self._say(f"{name}{len(item.data)}{item.data.hex().upper()}\r".encode())

    def _say(self, line: bytes) -> bool:
        with self._lock:
            return self.write(line)

    def _listen(self) -> None:
        """Answer the host's commands until the port is taken away."""
        held = b""
        while not self._stop.is_set():
            ready, _, _ = select.select([self._master], [], [], _LOOK_S)
            if not ready:
                continue
            try:
                held += os.read(self._master, 4096)
            except BlockingIOError:
                continue
            except OSError:
                return
            *commands, held = held.split(b"\r")
            for command in commands:
                if command[:1] in (b"O", b"L"):
                    self._say(b"\r")
                    self._open.set()
                    continue
                if command[:1] == b"C":
                    self._open.clear()
                self._say(b"\r" if command[:1] in b"CSsYZ" else b"\a")


def _message(item: CanItem, base_s: float) -> Any:
    import can

    return can.Message(
        timestamp=base_s + item.stamp_s,
        arbitration_id=item.identifier,
        is_extended_id=item.extended,
        is_error_frame=item.error,
        data=item.data,
        is_fd=len(item.data) > 8,
    )
