"""Notices that come again and again, collapsed to a count: at the noise a trigger decides hundreds of times."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable

TELL_EVERY_S = 10.0
"""Time between two counts of what goes on, s."""


class RepeatedNotices:
    """Notice line by line, and of the same again only how often.

    Several threads may tell.

    Parameters
    ----------
    tell
        Function called with each line.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._lock = threading.Lock()
        self._same: Hashable = None
        self._last = ""
        self._count, self._since_s = 0, 0.0

    def notice(self, text: str, same: Hashable = None) -> None:
        """Give notice of a line; what it has in common with one that is the same but for its numbers is `same`."""
        key = text if same is None else same
        with self._lock:
            if key == self._same:
                self._count += 1
                self._last = text
                self._tell_due()
                return
            self._tell_count()
            self._same, self._since_s = key, time.monotonic()
            self._tell(text)

    def look(self) -> None:
        """Give the count of what goes on, if that is due."""
        with self._lock:
            self._tell_due()

    def end(self) -> None:
        """Give the count of what no notice was given of yet."""
        with self._lock:
            self._tell_count()

    def _tell_due(self) -> None:
        if time.monotonic() - self._since_s >= TELL_EVERY_S:
            self._tell_count()

    def _tell_count(self) -> None:
        if self._count:
            times = "once" if self._count == 1 else f"{self._count} times"
            self._tell(f"{times} more in {time.monotonic() - self._since_s:.1f} s, last: {self._last}")
        self._count, self._since_s = 0, time.monotonic()
