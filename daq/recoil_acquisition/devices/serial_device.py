"""A serial port through pyserial.

One read returns what waits, or the first byte that comes. The bytes are kept as they are: they are
framed and dated back to their place on the line after the shot. A device that vanishes while it is
read shows itself to pyserial by being ready and having no data.
"""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

from recoil_acquisition.devices.back_off import BackOff
from recoil_acquisition.devices.device import SERIAL, Block, Counters, EmptyLook, StreamCheck, event_block
from recoil_acquisition.devices.kernel_drops import GrowingCount, line_errors
from recoil_acquisition.devices.open_fault import error_number, open_fault
from recoil_acquisition.devices.serial_commands import PollClock, SerialCommands
from recoil_acquisition.devices.serial_port import PortIdentity, checked_options, find, identity_of, learn, port_names
from recoil_acquisition.frames.framing import Command

_SLICE_S = 0.02
"""Longest wait inside pyserial: the device looks up this often for the time and the next request."""
_PIECE = 2048
"""Bytes taken from the port at once: what pyserial holds when the port fails is gone, so it holds little."""
_MOST = 1 << 16
"""Most bytes in a block."""
_WRITE_TIMEOUT_S = 1.0
_REST_S = 0.002
"""A port that never falls silent is read this often at most: what comes meanwhile waits in the kernel's buffer, and
fewer, larger reads leave the processor to the other sources."""
_GRACE_S = 0.03
"""What was sent before the closing is read for so long: an adapter may hold bytes back for 16 ms."""


class SerialDevice:
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
        Looks at every block of bytes for the counters.

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
        self.name = name
        self._options = checked_options(name, table)
        self._low_latency = bool(self._options.pop("low_latency", True))
        self._identity: PortIdentity = identity_of(str(self._options.pop("port")))
        self._declared = str(table["port"])
        self._commands = commands or SerialCommands()
        self._poll = PollClock(self._commands.poll)
        self._check = check
        self._port: Any = None
        self._wanted = False
        self._back_off = BackOff()
        self._ahead: deque[Block] = deque()
        self._taken_s = 0.0
        self._look = EmptyLook()
        self._received = self._reopened = self._high_water = self._unanswered_told = 0
        self._damaged, self._dropped = GrowingCount(), GrowingCount()

    @property
    def counters(self) -> Counters:
        """What it met so far."""
        self._look_at_line()
        check = self._check
        return Counters(
            received=self._received,
            bad=(self._damaged.total or 0) + self._poll.unanswered + (check.bad if check else 0),
            skipped_bytes=check.skipped_bytes if check else None,
            counter_gaps=check.counter_gaps if check else None,
            kernel_drops=self._dropped.total,
            reopened=self._reopened,
            queue_high_water=self._high_water,
        )

    def open(self) -> None:
        """Open the port for this program alone; DeviceError if that fails, ValueError if it is open already."""
        if self._wanted:
            raise ValueError(f"source '{self.name}' is open already")
        try:
            self._connect()
        except Exception as error:  # pyserial raises OSError, ValueError and on some systems termios.error
            self._shut()
            raise open_fault(self.name, f"port {self._declared}", error, available=port_names()) from error
        self._identity = learn(self._identity)
        self._wanted = True
        self._ahead.append(event_block(self.name, time.monotonic_ns(), "opened", self._declared))

    def read(self, timeout_s: float) -> Block | None:
        """Return the next block: what one read of the port gave, or an event; ValueError if it is not open."""
        if self._ahead:
            return self._ahead.popleft()
        if not self._wanted:
            raise ValueError(f"source '{self.name}' is not open")
        block = None
        if self._port is not None or self._reconnect(timeout_s):
            block = self._take(timeout_s)
        if block is None and self._ahead:
            return self._ahead.popleft()
        return block

    def close(self) -> tuple[Block, ...]:
        """Send the device its stop command, read what still waits, close the port and return the last blocks."""
        if not self._wanted:
            return ()
        blocks = list(self._ahead)
        self._ahead.clear()
        ends, over = time.monotonic() + _GRACE_S, False
        # The last look is behind the end: a host that was late reads what waits all the same
        while self._port is not None and not over:
            left_s = ends - time.monotonic()
            over = left_s <= 0
            block = self._take(max(left_s, 0.0))
            blocks += [] if block is None else [block]
        if self._port is not None:
            with contextlib.suppress(Exception):  # it may be gone by now, and is closed all the same
                self._say(self._commands.stop)
        self._wanted = False
        self._shut()
        self._ahead.append(event_block(self.name, time.monotonic_ns(), "closed", f"{self._received} bytes received"))
        blocks += self._ahead
        self._ahead.clear()
        return tuple(blocks)

    def _connect(self) -> None:
        import serial

        self._look = EmptyLook()
        self._port = serial.Serial(
            port=find(self._identity),
            timeout=_SLICE_S,
            write_timeout=_WRITE_TIMEOUT_S,
            exclusive=True,
            **self._options,
        )
        if self._low_latency:
            # FTDI's adapters hold bytes back for 16 ms otherwise; not every driver can
            with contextlib.suppress(ValueError, NotImplementedError, AttributeError):
                self._port.set_low_latency_mode(True)
        self._damaged.restart()
        self._dropped.restart()
        self._look_at_line()
        self._poll.restart()
        self._say(self._commands.start)

    def _say(self, commands: tuple[Command, ...]) -> None:
        for command in commands:
            self._port.write(command.data)
            if command.wait_s:
                time.sleep(command.wait_s)

    def _shut(self) -> None:
        if self._port is None:
            return
        self._look_at_line()
        with contextlib.suppress(Exception):  # the port of a device that is gone may refuse to close
            self._port.close()
        self._port = None

    def _reconnect(self, timeout_s: float) -> bool:
        if not self._back_off.wait(timeout_s):
            return False
        try:
            self._connect()
        except Exception:  # still not there: tried again after a pause
            self._shut()
            self._back_off.failed()
            return False
        self._reopened += 1
        detail = f"{self._port.port} after {self._back_off.tries} tries"
        self._ahead.append(event_block(self.name, time.monotonic_ns(), "reopened", detail))
        return True

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
                    self._port.write(request)
                waiting = self._waiting()
                empty_ns = self._look.empty_ns
                if not waiting and now >= ends:
                    break
                self._take_waiting(waiting, pieces)
        except Exception as error:  # pyserial raises OSError, on some systems termios.error, at times TypeError
            lost = error
        host_ns = time.monotonic_ns()
        self._taken_s = host_ns / 1e9
        self._tell_unanswered(host_ns)
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
            self._lose(lost, host_ns)
        return block

    def _take_waiting(self, waiting: int, pieces: list[bytes]) -> None:
        """Read what waits, or the first byte that comes within a slice and what has come with it."""
        size = 0
        while size < _MOST:
            piece = self._port.read(min(waiting, _PIECE) or 1)
            if piece:
                pieces.append(piece)
                size += len(piece)
            if not piece or not (waiting := self._waiting()):
                break

    def _waiting(self) -> int:
        """Return how many bytes wait, and note when there are none."""
        looked_ns = time.monotonic_ns()
        waiting: int = self._port.in_waiting
        self._look.looked(looked_ns, empty=not waiting)
        return waiting

    def _lose(self, error: Exception, host_ns: int) -> None:
        number = error_number(error)
        detail = f"{self._declared}: {error}" + ("" if number is None else f" [{number}]")
        self._ahead.append(event_block(self.name, host_ns, "lost", detail))
        self._shut()
        self._back_off.lost()

    def _tell_unanswered(self, host_ns: int) -> None:
        """Record the first request without an answer, and then every tenfold."""
        if self._poll.unanswered >= max(1, 10 * self._unanswered_told):
            self._unanswered_told = self._poll.unanswered
            text = f"{self._poll.unanswered} requests so far had no answer"
            self._ahead.append(event_block(self.name, host_ns, "unanswered", text))

    def _look_at_line(self) -> None:
        port = self._port
        if port is None:
            return
        try:
            errors = line_errors(port.fileno())
        except (OSError, AttributeError, TypeError, ValueError):
            return  # closed meanwhile, or a port without a descriptor
        if errors is not None:
            self._damaged.see(errors.damaged)
            self._dropped.see(errors.dropped)
