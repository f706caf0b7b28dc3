"""Stamps of sources that sample evenly and are stamped late, by a varying wait."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_SCATTER = 0.25
"""Share of a step beyond which the stamps do not belong to even samples."""
FIRST_STAMPS = 16
"""Over which steps are counted one by one."""


def even_stamps(times_s: Array) -> tuple[Array, float]:
    """Lay a line through stamps of a source that samples evenly and is stamped with jitter.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Increasing; some steps may be multiples of the others where samples were lost.

    Returns
    -------
    times_s : ndarray, shape (n,)
        On the line; as given where the source does not sample evenly.
    scatter_s : float
        Standard deviation about the line, seconds; 0 where the source does not sample evenly.
    """
    n = times_s.size
    if n < 2:
        return times_s, 0.0
    steps = np.diff(times_s[:FIRST_STAMPS])
    index = np.concatenate([[0.0], np.cumsum(np.round(steps / np.median(np.diff(times_s))))])
    while not np.any(np.diff(index) < 1):
        seen = times_s[: index.size]
        middle = index.mean()
        slope = float((index - middle) @ seen / ((index - middle) @ (index - middle)))
        start = float(seen.mean()) - slope * middle
        if index.size == n:
            line = start + slope * index
            scatter = float(np.std(times_s - line))
            return (line, scatter) if scatter < MOST_SCATTER * slope else (times_s, 0.0)
        # the line so far counts the steps over half as many stamps again, whatever their jitter
        index = np.round((times_s[: index.size + (index.size + 1) // 2] - start) / slope)
    return times_s, 0.0
