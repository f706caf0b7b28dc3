"""A counter beside the rows of a table that a rate dates: where it jumps, rows are missing.

It is known by what it holds, not by its name: whole numbers that go on by one step from nearly every row to the next,
and else by several of it, or begin anew as a counter of some bits or digits does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FEWEST_ROWS = 16
"""Rows from which on numbers are seen to count."""
_NEARLY_ALL = 0.9
_MODULI = (16, 100, 256, 1000, 4096, 10**4, 1 << 16, 10**5, 10**6, 1 << 24, 1 << 32)
"""Numbers of values that counters have before they begin anew."""
_NEAR_END = 8
"""Share of them, as a divisor, by which a counter may jump over its end: one that jumps by more was set back."""


@dataclass(frozen=True)
class CountedRows:
    """Rows as a counter numbers them.

    Attributes
    ----------
    numbers : ndarray of int64, shape (n_rows,)
        Number of each row, 0 the first.
    back
        Row before which the counter was set back, so that nobody knows how many are missing; None if it never was.
    """

    numbers: NDArray[np.int64]
    back: int | None

    @property
    def jumps(self) -> NDArray[np.intp]:
        """Rows behind which others are missing."""
        return np.flatnonzero(np.diff(self.numbers) > 1)

    @property
    def missing(self) -> int:
        """Number of rows that are missing."""
        return int(self.numbers[-1]) + 1 - self.numbers.size


def counted_rows(counts: NDArray[np.float64]) -> CountedRows | None:
    """Return the rows as a column numbers them.

    Parameters
    ----------
    counts : ndarray of float64, shape (n_rows,)

    Returns
    -------
    CountedRows or None
        None if the column is no counter.
    """
    if counts.size < FEWEST_ROWS or not _whole(counts).all():
        return None
    steps: NDArray[np.int64] = np.diff(counts.astype(np.int64)).astype(np.int64)
    usual = int(np.median(steps))
    if usual < 1 or (steps == 0).any() or np.mean(steps == usual) < _NEARLY_ALL:
        return None
    anew = np.flatnonzero(steps < 0)
    modulo = _modulo(counts, steps[anew])
    steps[anew] += modulo
    back = anew[(steps[anew] < usual) | (steps[anew] > max(usual, modulo // _NEAR_END))]
    if back.size:
        return CountedRows(np.arange(counts.size), int(back[0]) + 1)
    if (steps % usual).any():
        return None
    return CountedRows(np.concatenate(([0], np.cumsum(steps // usual))), None)


def _whole(numbers: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(numbers) & (numbers == np.round(numbers)) & (np.abs(numbers) < 2.0**53))


def _modulo(counts: NDArray[np.float64], back: NDArray[np.int64]) -> int:
    """Return how many values a counter has that goes back by some steps, those below 0; 0 if no usual one fits."""
    if back.size > 1 and (back == back[0]).all():
        return int(np.ptp(counts)) + 1
    return next((modulo for modulo in _MODULI if modulo > counts.max()), 0) if back.size else 0
