"""Stalls of a host, no stamp for a while, then all that came meanwhile at once; and what makes stamps late."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.time.bursts import find_bursts

_LEAST_STAMPS = 32
_LONG = 8.0
"""Usual steps that a stall lasts at least: what is shorter is a wait."""
_CAUGHT_UP = 0.25
"""Relative difference, at most, of the stamps behind a stall from those that should have come in it."""
_AT_ONCE = 0.25
"""Share of a stall's time within which they come."""


@dataclass(frozen=True)
class Stalls:
    """Stalls of a host.

    Attributes
    ----------
    count
        Number of stalls.
    stamps
        Number of stamps that came behind them at once, late.
    longest_s
        Time of the longest one, s.
    """

    count: int
    stamps: int
    longest_s: float

    def __str__(self) -> str:
        times = "once" if self.count == 1 else f"{self.count} times"
        return (
            f"the host stood still {times}, for up to {1e3 * self.longest_s:.3g} ms, and stamped"
            f" {self.stamps} frames late"
        )


def find_stalls(times_s: NDArray[np.float64]) -> Stalls | None:
    """Return the stalls that stamps of an even source show; None if they show none.

    A pause of the source leaves stamps out; a stall of the host only moves them, so that behind it as many come at once
    as it was long.

    Parameters
    ----------
    times_s : ndarray of float64, shape (n,)
        Stamps, increasing, s.
    """
    if times_s.size < _LEAST_STAMPS:
        return None
    steps = np.diff(times_s)
    usual_s = float(np.median(steps))
    at = np.flatnonzero(steps > _LONG * usual_s)
    due = steps[at] / usual_s if usual_s > 0 else np.full(at.size, np.inf)
    behind = np.searchsorted(times_s, times_s[at + 1] + _AT_ONCE * steps[at]) - at - 1
    # those that came in time while the late ones were stamped are among them
    late = np.abs(behind - due * (1.0 + 0.5 * _AT_ONCE)) <= (_CAUGHT_UP + 0.5 * _AT_ONCE) * due
    if not late.any():
        return None
    return Stalls(int(np.count_nonzero(late)), int(behind[late].sum()), float(steps[at][late].max()))


@dataclass(frozen=True)
class LateStamps:
    """Statement that stamps are late.

    Attributes
    ----------
    text
        Clause on the bursts or stalls.
    most_s
        Time by which they are late at most, s.
    """

    text: str
    most_s: float


def late_stamps(times_s: NDArray[np.float64]) -> LateStamps | None:
    """Say by how much stamps are late, where they come in bursts or behind stalls; None if neither shows."""
    bursts = find_bursts(times_s)
    if bursts is not None:
        return LateStamps(str(bursts), bursts.within_s + bursts.pause_s)
    stalls = find_stalls(times_s)
    return None if stalls is None else LateStamps(str(stalls), stalls.longest_s)
