"""Waiting times between tries to open a device that was lost."""

from __future__ import annotations

import time

FIRST_PAUSE_S = 0.02
LONGEST_PAUSE_S = 1.0
_GROWTH = 1.3


class BackOff:
    """Pauses that grow from try to try: a device that is plugged in again is found soon, a missing one costs little.

    Attributes
    ----------
    tries
        Tries since the device was lost.
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
