"""Sources of absolute time that a recorder's clock may be locked to, and how far two locked clocks may be apart."""

from __future__ import annotations

import math
import re
from enum import StrEnum

_DENIALS = r"free|intern|unlock|unsync|not[ _-]|\bno\b|none|lost|wait|hold|local|invalid|fail"
_UNLOCKED = re.compile(_DENIALS, re.IGNORECASE)
_WORDS = (
    ("ptp", re.compile(r"ptp|1588|802\.1as", re.IGNORECASE)),
    ("gps", re.compile(r"gps|gnss|glonass|galileo", re.IGNORECASE)),
    ("irig-b", re.compile(r"irig", re.IGNORECASE)),
)


class TimeLock(StrEnum):
    """Source of absolute time of a clock; of one that runs free nothing is known."""

    PTP = "ptp"
    GPS = "gps"
    IRIG_B = "irig-b"
    FREE = "free"

    @classmethod
    def of_words(cls, words: str) -> TimeLock | None:
        """Return what a recorder says of its lock in words of its own; None where it says nothing that is known.

        Words that deny a lock count, whatever else is named: ``PTP, not locked`` is free.
        """
        if _UNLOCKED.search(words):
            return cls.FREE
        return next((cls(name) for name, pattern in _WORDS if pattern.search(words)), None)

    @property
    def u_s(self) -> float:
        """Standard uncertainty of the time of one clock, s; infinite where it runs free."""
        return _BETWEEN_TWO_S.get(self, math.inf) / math.sqrt(2.0)


_BETWEEN_TWO_S = {TimeLock.PTP: 150e-9, TimeLock.GPS: 1e-6, TimeLock.IRIG_B: 10e-6}
"""What two mainframes may be apart, each with such a lock: HBM GEN3i data sheet, time synchronisation between
mainframes. Either has its half of the variance."""
