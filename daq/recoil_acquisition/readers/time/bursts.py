"""Stamps that come in bursts: many at once, then none for a while, again and again.

A host that stamps what its adapter hands over in packets dates all frames of a packet by the instant at which it was
read. Each stamp is late by up to a whole packet then, and steps between stamps say nothing of the sender's rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_LEAST_STAMPS = 32
_LEAST_BURSTS = 8
"""Bursts at least: fewer pauses are what they are, a sender that was silent now and then."""
_LEAST_IN_BURST = 3.0
"""Median stamps of a burst."""
_SHORT = 0.4
"""Share of the mean step below which steps within a burst lie: an even beat that jitters has few of these."""
_MOST_IN_BURSTS = 0.5
"""Share of the time that bursts take, at most."""
_ALIKE = 4.0
"""Ratio of a long pause (nine of ten are shorter) to a common one, at most: packets come as evenly as they fill."""


@dataclass(frozen=True)
class Bursts:
    """Bursts of stamps.

    Attributes
    ----------
    stamps
        Number of stamps of a burst, median.
    within_s
        Time from the first to the last stamp of a burst, median, s.
    pause_s
        Time from the last stamp of a burst to the first of the next, median, s.
    count
        Number of bursts.
    """

    stamps: int
    within_s: float
    pause_s: float
    count: int

    def __str__(self) -> str:
        return (
            f"stamps come in bursts, {self.stamps} within {1e3 * self.within_s:.3g} ms and then none for "
            f"{1e3 * self.pause_s:.3g} ms, as where a host stamps what its adapter held back"
        )


def find_bursts(times_s: NDArray[np.float64]) -> Bursts | None:
    """Return the bursts that stamps come in; None if they do not.

    Parameters
    ----------
    times_s : ndarray of float64, shape (n,)
        Stamps, increasing, s.
    """
    if times_s.size < _LEAST_STAMPS:
        return None
    steps = np.diff(times_s)
    mean_s = float(times_s[-1] - times_s[0]) / steps.size
    pause = np.flatnonzero(steps > mean_s)
    if pause.size + 1 < _LEAST_BURSTS:
        return None
    first, last = np.r_[0, pause + 1], np.r_[pause, steps.size]
    sizes, lasting_s = last - first + 1, times_s[last] - times_s[first]
    within = np.delete(steps, pause)
    pauses_s = steps[pause]
    common_s, long_s = (float(np.quantile(pauses_s, share)) for share in (0.5, 0.9))
    if (
        float(np.median(sizes)) < _LEAST_IN_BURST
        or float(np.median(within)) > _SHORT * mean_s
        or float(lasting_s.sum()) > _MOST_IN_BURSTS * float(times_s[-1] - times_s[0])
        or long_s > _ALIKE * common_s
    ):
        return None
    return Bursts(int(np.median(sizes)), float(np.median(lasting_s)), common_s, int(sizes.size))
