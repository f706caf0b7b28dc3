"""A counter beside the rows of a table that a rate dates: where it jumps, rows are missing.

It is known by what it holds, not by its name: whole numbers that go on by one step from nearly every row to the next,
and else by several of it, or begin anew as a counter of some bits or digits does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.remark import Note, NoteCode

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
    if counts.size < FEWEST_ROWS or not whole(counts).all():
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


def over_gaps(
    name: str, counted: CountedRows, uniform: Callable[[int], TimeBase], path: Path, place: Callable[[int], str]
) -> tuple[TimeBase, Note]:
    """Return instants that leave the gaps which a counter shows, and what is to say about them.

    Parameters
    ----------
    name
        Name of the counter.
    uniform
        Function that returns the instants of so many rows by their rate alone.
    path
        File, for messages.
    place
        Function that names the place of a row, counted from 0.

    Raises
    ------
    CorruptFileError
        If the counter was set back.
    """
    if counted.back is not None:
        raise CorruptFileError(
            f"{name!r}, which counts the rows, begins anew: a second recording begins, or it was set back",
            path=path, place=place(counted.back), expected="one recording, which its rate dates",
            remedy="take the recordings apart there, or export with a column of time",
        )  # fmt: skip
    whole = uniform(int(counted.numbers[-1]) + 1)
    jumps = counted.jumps
    places = "1 place" if jumps.size == 1 else f"{jumps.size} places"
    text = (
        f"{name} counts the rows and jumps in {places}, first behind {place(int(jumps[0]))}: "
        f"{counted.missing} rows are missing, and instants follow it"
    )
    times_s = whole.start_s + (whole.step_s or 0.0) * counted.numbers.astype(np.float64)
    return TimeBase.stamped(whole.clock, times_s, whole.absolute_start), Note(NoteCode.LOST, name, text)


def first_counter(
    columns: Mapping[str, Callable[[int, int], NDArray[np.float64]]], count: int
) -> tuple[str, CountedRows] | None:
    """Return the first column that counts the rows and does not always go on by one, by its name.

    Parameters
    ----------
    columns
        Functions that read the numbers of rows from one to before another.
    count
        Number of rows.
    """
    for name, read in columns.items():
        if counted_rows(read(0, min(count, 4 * FEWEST_ROWS))) is None:
            continue
        counted = counted_rows(read(0, count))
        if counted is not None and (counted.back is not None or counted.missing):
            return name, counted
    return None


def whole(numbers: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which numbers are whole and below 2**53, shape as given."""
    return np.asarray(np.isfinite(numbers) & (numbers == np.round(numbers)) & (np.abs(numbers) < 2.0**53))


def _modulo(counts: NDArray[np.float64], back: NDArray[np.int64]) -> int:
    """Return how many values a counter has that goes back by some steps, those below 0; 0 if no usual one fits."""
    if back.size > 1 and (back == back[0]).all():
        return int(np.ptp(counts)) + 1
    return next((modulo for modulo in _MODULI if modulo > counts.max()), 0) if back.size else 0
