"""A serial port through pyserial.

One read returns what waits, or the first byte that comes. The bytes are kept as they are: they are
framed and dated back to their place on the line after the shot. A device that vanishes while it is
read shows itself to pyserial by being ready and having no data.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping
from typing import Any

from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.device import SERIAL, Block, Counters, EmptyLook
from recoil_acquisition.devices.kernel_drops import GrowingCount, line_errors
from recoil_acquisition.devices.open_fault import open_fault
from recoil_acquisition.devices.reopening import GRACE_S, ReopenedDevice
from recoil_acquisition.devices.serial_commands import PollClock, SerialCommands
from recoil_acquisition.devices.serial_port import PortIdentity, checked_options, find, identity_of, learn, port_names
from recoil_acquisition.devices.stream_check import FramingCheck, StreamCheck
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.frames.framing import Command

_SLICE_S = 0.02
"""Longest wait inside pyserial: the device looks up this often for the time and the next request."""
_PIECE = 2048
"""Bytes taken from the port at once: what pyserial holds when the port fails is gone, so it holds little."""
_MOST = 1 << 16
"""Most bytes in a block."""
_WRITE_TIMEOUT_S = 1.0
_REST_S = 0.002
"""Least time between two reads of a port that never falls silent: what comes meanwhile waits in the kernel's buffer,
and fewer, larger reads leave the processor to the other sources."""


class SerialDevice(ReopenedDevice):
    """One serial port.

    Parameters
    ----------
    name
        Name of the source.
    table
        The rig's ``device`` table: ``port`` (a path, a name, or ``usb:VID:PID[:SERIAL]``) and ``baudrate``; if they
        differ from 8N1 without handshake, ``bytesize``, ``parity``, ``stopbits``, ``xonxoff``, ``rtscts``,
        ``dsrdtr`` as pyserial has them; ``low_latency = false`` to leave the driver's latency as it is.
    check
        Counter that looks at every block of bytes.

    Raises
    ------
    DeviceError
        If the table is at fault.
    """

    kind = SERIAL

    def __init__(
        self,
        name: str,
        table: Mapping[str, Any],
        *,
        commands: SerialCommands | None = None,
        check: StreamCheck | None = None,
    ) -> None:
        self._options = checked_options(name, table)
        super().__init__(name, str(table["port"]), "bytes", check)
        self._low_latency = bool(self._options.pop("low_latency", True))
        self._identity: PortIdentity = identity_of(str(self._options.pop("port")))
        self._commands = commands or SerialCommands()
        self._poll = PollClock(self._commands.poll)
        self._taken_s = 0.0
        self._unanswered_told = 0
        self._damaged, self._dropped = GrowingCount(), GrowingCount()

    @property
    def bytes_per_s(self) -> float:
        """Bytes per second of a full line: ten bits each."""
        return float(self._options["baudrate"]) / 10.0

    @property
    def counters(self) -> Counters:
        """Counts of what it received and lost so far."""
        self._look_at_line()
        bad = (self._damaged.total or 0) + self._poll.unanswered
        return self._counters(bad=bad, kernel_drops=self._dropped.total)

    def open(self) -> None:
        """Open the port for this program alone; DeviceError if that fails, ValueError if it is open already."""
        super().open()
        self._identity = learn(self._identity, self._opened_as())

    def _open_fault(self, error: Exception) -> DeviceError:
        if isinstance(error, DeviceError):
            problem = f"source '{self.name}': {error.problem}"
            return DeviceError(problem, found=error.found, remedy=error.remedy)
        return open_fault(self.name, f"port {self._what}", error, available=port_names())

    def _rest(self) -> list[Block]:
        """Return what still waits, and send the device its stop command."""
        blocks = list(self._ahead)
        self._ahead.clear()
        ends, over = time.monotonic() + GRACE_S, False
        # The last look is behind the end: a host that was late reads what waits all the same
        while self._driver is not None and not over:
            left_s = ends - time.monotonic()
            over = left_s <= 0
            block = self._take(max(left_s, 0.0))
            blocks += [] if block is None else [block]
        if self._driver is not None:
            with contextlib.suppress(Exception):  # it may be gone by now, and is closed all the same
                self._say(self._commands.stop)
        return blocks

    def _opened_as(self) -> str:
        return str(self._driver.port)

    def _connect(self) -> None:
        import serial

        self._look = EmptyLook()
        self._driver = serial.Serial(
            port=find(self._identity),
            timeout=_SLICE_S,
            write_timeout=_WRITE_TIMEOUT_S,
            exclusive=True,
            **self._options,
        )
        if self._low_latency:
            # FTDI's adapters hold bytes back for 16 ms otherwise; not every driver can
            with contextlib.suppress(ValueError, NotImplementedError, AttributeError):
                self._driver.set_low_latency_mode(True)
        self._damaged.restart()
        self._dropped.restart()
        self._look_at_line()
        self._poll.restart()
        self._say(self._commands.start)

    def _say(self, commands: tuple[Command, ...]) -> None:
        for command in commands:
            self._driver.write(command.data)
            if command.wait_s:
                time.sleep(command.wait_s)

    def _disconnect(self) -> None:
        if self._driver is None:
            return
        self._look_at_line()
        with contextlib.suppress(Exception):  # the port of a device that is gone may refuse to close
            self._driver.close()
        self._driver = None

    def _take(self, timeout_s: float) -> Block | None:
        """Wait for the first byte and take everything that waits."""
        if self._ahead:
            return None
        if (rest_s := self._taken_s + _REST_S - time.monotonic()) > 0:
            time.sleep(rest_s)
        ends = time.monotonic() + timeout_s
        empty_ns = self._look.empty_ns
        pieces: list[bytes] = []
        lost: Exception | None = None
        try:
            while not pieces:
                now = time.monotonic()
                if (request := self._poll.request(now)) is not None:
                    self._driver.write(request)
                waiting = self._waiting()
                empty_ns = self._look.empty_ns
                if not waiting and now >= ends:
                    break
                self._take_waiting(waiting, pieces)
        except Exception as error:  # pyserial raises OSError, on some systems termios.error, at times TypeError
            lost = error
        host_ns = time.monotonic_ns()
        self._taken_s = host_ns / 1e9
        self._tell_unanswered()
        block = None
        if pieces:
            self._poll.answered()
            data = b"".join(pieces)
            self._received += len(data)
            self._high_water = max(self._high_water, len(data))
            block = Block(self.name, host_ns, data, SERIAL, empty_ns)
            if self._check is not None:
                self._check.feed(block)
        if lost is not None:
            self._lose(lost)
        return block

    def _take_waiting(self, waiting: int, pieces: list[bytes]) -> None:
        """Read what waits, or the first byte that comes within a slice and what has come with it."""
        size = 0
        while size < _MOST:
            piece = self._driver.read(min(waiting, _PIECE) or 1)
            if piece:
                pieces.append(piece)
                size += len(piece)
            if not piece or not (waiting := self._waiting()):
                break

    def _waiting(self) -> int:
        """Return how many bytes wait, and note when there are none."""
        looked_ns = time.monotonic_ns()
        waiting: int = self._driver.in_waiting
        self._look.looked(looked_ns, empty=not waiting)
        return waiting

    def _tell_unanswered(self) -> None:
        """Record the first request without an answer, and then every tenfold."""
        if self._poll.unanswered >= max(1, 10 * self._unanswered_told):
            self._unanswered_told = self._poll.unanswered
            self._tell("unanswered", f"{self._poll.unanswered} requests so far had no answer")

    def _look_at_line(self) -> None:
        port = self._driver
        if port is None:
            return
        try:
            errors = line_errors(port.fileno())
        except (OSError, AttributeError, TypeError, ValueError):
            return  # closed meanwhile, or a port without a descriptor
        if errors is not None:
            self._damaged.see(errors.damaged)
            self._dropped.see(errors.dropped)


def serial_device(source: str, table: Mapping[str, Any], declared: DeviceDeclarations) -> SerialDevice:
    """Return the device of a port: its framing's commands are sent, and its frames are counted; errors as of it."""
    framing = declared.framing
    if framing is None:
        return SerialDevice(source, table)
    return SerialDevice(source, table, commands=SerialCommands.of(framing), check=FramingCheck(framing))
