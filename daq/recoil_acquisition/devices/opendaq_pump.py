"""A thread that takes what a process prints: the one way to wait for a pipe for some time on every system."""

from __future__ import annotations

import threading
import time
from collections import deque

from recoil_acquisition.devices.device import EmptyLook
from recoil_acquisition.processes.child_process import ChildProcess

_PIECE = 1 << 17
_MOST_WAITING = 64 << 20
"""Bytes that wait to be taken here; then the process waits, which holds some seconds more itself."""
_WAITED_NS = 200_000
"""Time of a read from which on it waited: nothing was there when it began."""


class Pump(threading.Thread):
    """Thread that takes what a process prints, from now on.

    Attributes
    ----------
    most_waiting
        Most bytes that waited to be taken here at once.
    """

    def __init__(self, child: ChildProcess) -> None:
        super().__init__(name="read openDAQ", daemon=True)
        self._child = child
        self._waiting: deque[tuple[bytes, int, int]] = deque()
        self._bytes = self.most_waiting = 0
        self._changed = threading.Condition()
        self._over = False
        self._look = EmptyLook()
        self.start()

    def run(self) -> None:
        """Take everything until the process ends."""
        while True:
            asked_ns = time.monotonic_ns()
            try:
                data = self._child.some(_PIECE)
            except (OSError, ValueError):
                data = b""
            now_ns = time.monotonic_ns()
            self._look.looked(asked_ns, empty=now_ns - asked_ns > _WAITED_NS)
            with self._changed:
                self._over = not data
                self._waiting.append((data, now_ns, self._look.empty_ns))
                self._bytes += len(data)
                self.most_waiting = max(self.most_waiting, self._bytes)
                self._changed.notify()
                while self._bytes > _MOST_WAITING and not self._over:
                    self._changed.wait()
            if not data:
                return

    def take(self, timeout_s: float) -> tuple[bytes, int, int] | None:
        """Return the next bytes, when they were read and when none waited before; none of an ended process.

        None if nothing comes in time.
        """
        with self._changed:
            if not self._waiting and not self._over:
                self._changed.wait(timeout_s)
            if not self._waiting:
                return (b"", time.monotonic_ns(), self._look.empty_ns) if self._over else None
            taken = self._waiting.popleft()
            self._bytes -= len(taken[0])
            self._changed.notify()
            return taken

    def leave(self) -> None:
        """Go on to the end of what the process prints, whatever waits."""
        with self._changed:
            self._waiting.clear()
            self._bytes = 0
            self._over = True
            self._changed.notify()
