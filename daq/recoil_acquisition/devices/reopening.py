"""Buses and ports that are lost and opened again, after ever longer pauses, and say so in events among their blocks."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections import deque
from typing import Any

from recoil_acquisition.devices.device import Block, Counters, EmptyLook, event_block
from recoil_acquisition.devices.open_fault import error_number
from recoil_acquisition.devices.stream_check import StreamCheck
from recoil_acquisition.errors import DeviceError

FIRST_PAUSE_S = 0.02
LONGEST_PAUSE_S = 1.0
_GROWTH = 1.3
"""Factor from one pause between tries to the next."""


class BackOff:
    """Pauses that grow from try to try: a device that is plugged in again is found soon, a missing one costs little.

    Attributes
    ----------
    tries
        Number of tries since the device was lost.
    """

    def __init__(self) -> None:
        self.tries = 0
        self._pause_s = FIRST_PAUSE_S
        self._next_s = 0.0

    def lost(self) -> None:
        """Begin again: the device was lost just now."""
        self.tries = 0
        self._pause_s = FIRST_PAUSE_S
        self._next_s = time.monotonic() + self._pause_s

    def wait(self, timeout_s: float) -> bool:
        """Wait for the next try, at most for a time; return whether it is due."""
        left_s = self._next_s - time.monotonic()
        if left_s > 0:
            time.sleep(min(left_s, max(timeout_s, 0.0)))
        if time.monotonic() < self._next_s:
            return False
        self.tries += 1
        return True

    def failed(self) -> None:
        """Plan the next try after one that failed."""
        self._pause_s = min(self._pause_s * _GROWTH, LONGEST_PAUSE_S)
        self._next_s = time.monotonic() + self._pause_s


GRACE_S = 0.03
"""Time for which what was sent before the closing is waited for: an adapter may hold bytes back for 16 ms."""


class ReopenedDevice(ABC):
    """A device of a driver, which is opened again with growing pauses when it is lost.

    Parameters
    ----------
    name
        Name of the source.
    what
        Name of what is opened, for people.
    counted
        Name of what `Counters.received` counts.
    check
        Counter that looks at every block of data.
    """

    def __init__(self, name: str, what: str, counted: str, check: StreamCheck | None) -> None:
        self.name = name
        self._what, self._counted, self._check = what, counted, check
        self._driver: Any = None
        self._wanted = False
        self._back_off = BackOff()
        self._look = EmptyLook()
        self._ahead: deque[Block] = deque()
        self._received = self._reopened = self._high_water = 0

    def open(self) -> None:
        """Open it; DeviceError if that fails, ValueError if it is open already."""
        if self._wanted:
            raise ValueError(f"source '{self.name}' is open already")
        try:
            self._connect()
        except Exception as error:  # every driver has exceptions of its own
            self._disconnect()
            raise self._open_fault(error) from error
        self._wanted = True
        self._tell("opened", self._what)

    def read(self, timeout_s: float) -> Block | None:
        """Return the next block of data, or an event; ValueError if it is not open."""
        if self._ahead:
            return self._ahead.popleft()
        if not self._wanted:
            raise ValueError(f"source '{self.name}' is not open")
        if self._driver is None and self._reconnect(timeout_s):
            return self._ahead.popleft()  # before anything of the new connection
        block = None if self._driver is None else self._take(timeout_s)
        if block is None and self._ahead:
            return self._ahead.popleft()
        return block

    def close(self) -> tuple[Block, ...]:
        """Read what still waits, close it and return the last blocks."""
        if not self._wanted:
            return ()
        blocks = self._rest()
        self._wanted = False
        self._disconnect()
        self._tell("closed", f"{self._received} {self._counted} received")
        blocks += self._ahead
        self._ahead.clear()
        return tuple(blocks)

    @abstractmethod
    def _connect(self) -> None:
        """Open the driver; whatever that raises."""

    @abstractmethod
    def _disconnect(self) -> None:
        """Close the driver if it is open; nothing is raised."""

    @abstractmethod
    def _open_fault(self, error: Exception) -> DeviceError:
        """Say why it could not be opened."""

    @abstractmethod
    def _take(self, timeout_s: float) -> Block | None:
        """Wait for data and return a block of them."""

    @abstractmethod
    def _rest(self) -> list[Block]:
        """Return what still waits when it is closed."""

    def _opened_as(self) -> str:
        """Return under which name it was found again."""
        return self._what

    def _tell(self, event: str, detail: str) -> None:
        self._ahead.append(event_block(self.name, time.monotonic_ns(), event, detail))

    def _reconnect(self, timeout_s: float) -> bool:
        if not self._back_off.wait(timeout_s):
            return False
        try:
            self._connect()
        except Exception:  # still not there: tried again after a pause
            self._disconnect()
            self._back_off.failed()
            return False
        self._reopened += 1
        self._tell("reopened", f"{self._opened_as()} after {self._back_off.tries} tries")
        return True

    def _lose(self, error: BaseException) -> None:
        number = error_number(error)
        self._tell("lost", f"{self._what}: {error}" + ("" if number is None else f" [{number}]"))
        self._disconnect()
        self._back_off.lost()

    def _counters(self, *, bad: int, kernel_drops: int | None, error_frames: int = 0) -> Counters:
        """Return what it met so far, with what its check found."""
        check = self._check
        return Counters(
            received=self._received,
            bad=bad + (check.bad if check else 0),
            skipped_bytes=check.skipped_bytes if check else None,
            counter_gaps=check.counter_gaps if check else None,
            kernel_drops=kernel_drops,
            reopened=self._reopened,
            error_frames=error_frames,
            queue_high_water=self._high_water,
        )
