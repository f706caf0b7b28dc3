"""A clock that passes while somebody waits for it, for what waits by the clock and is not about it."""

from __future__ import annotations

import time


class PlayedClock:
    """Stands in for the module `time`: who waits has waited at once."""

    def __init__(self) -> None:
        self._waited_s = 0.0

    def monotonic(self) -> float:
        return time.monotonic() + self._waited_s

    def time(self) -> float:
        return time.time()

    def sleep(self, wait_s: float) -> None:
        self._waited_s += wait_s
