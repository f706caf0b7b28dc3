"""The notices of a session: what happened, line by line, each with its number and its time."""

from __future__ import annotations

import datetime as dt
import threading
from collections import deque
from collections.abc import Hashable
from dataclasses import dataclass, replace

KEPT = 100
"""Number of notices that are kept: more than come between two pictures of the screen."""


@dataclass(frozen=True)
class Notice:
    """One line on what happened.

    Attributes
    ----------
    number
        Number of the notice, from 1.
    utc
        Time at which it was given, of the last if it stands for several, ISO 8601, UTC.
    count
        Number of notices for which it stands.
    """

    number: int
    utc: str
    text: str
    count: int = 1

    @property
    def line(self) -> str:
        """The text behind its time of day, with how often it was given."""
        times = f", {self.count} times" if self.count > 1 else ""
        return f"{self.utc[11:19]}Z  {self.text}{times}"


class NoticeBoard:
    """Keeps the newest notices; what is the same but for its numbers is one, with a count. Several threads may give."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._notices: deque[Notice] = deque(maxlen=KEPT)
        self._same: dict[Hashable, int] = {}
        self._count = self._final = 0

    def take(self, text: str, same: Hashable = None) -> None:
        """Keep a line, its white space as single blanks.

        Parameters
        ----------
        same
            Key of lines that are the same but for their numbers: it takes the place of the last of them that is not
            final, and is counted with it.
        """
        with self._lock:
            utc = dt.datetime.now(dt.UTC).isoformat(timespec="milliseconds")
            text = " ".join(text.split())
            before = None if same is None else self._same.get(same)
            place = -1 if before is None else before - self._count + len(self._notices) - 1
            if before is not None and before > self._final and place >= 0:
                self._notices[place] = replace(
                    self._notices[place], utc=utc, text=text, count=self._notices[place].count + 1
                )
                return
            self._count += 1
            self._notices.append(Notice(self._count, utc, text))
            if same is not None:
                self._same[same] = self._count

    def finish(self, number: float) -> tuple[Notice, ...]:
        """Return the notices before a number that were not final yet, and make them so: they do not change any more."""
        with self._lock:
            done = tuple(one for one in self._notices if self._final < one.number < number)
            if done:
                self._final = done[-1].number
            return done

    @property
    def final(self) -> int:
        """Number of the newest notice that is final; 0 if none is."""
        with self._lock:
            return self._final

    @property
    def newest(self) -> tuple[Notice, ...]:
        """The notices that are kept, the oldest first."""
        with self._lock:
            return tuple(self._notices)
