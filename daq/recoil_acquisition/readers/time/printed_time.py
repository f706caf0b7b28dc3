"""Time printed with few decimals: the constant step that it agrees with.

Rounding alone makes neighbouring steps differ: 1/6000 s prints as 0.000167, then 0.000166. Such a
column is a uniform time base whose step is known much better than any two printed numbers give.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

PART_ROWS = 1 << 18
"""Rows that are gone through at a time."""

SLACK_S = 1e-9
"""Allowance beside half the last printed digit, for the arithmetic of whoever printed."""


class Times(Protocol):
    """Times in seconds, shape (n_rows,): an array, or what gives some of them at a time."""

    @property
    def size(self) -> int:
        """The number of instants."""
        ...

    def __getitem__(self, part: slice, /) -> NDArray[np.float64]:
        """Return some of them."""
        ...


def uniform_from_printed(
    times_s: Times, resolution_s: float, numbers: NDArray[np.int64] | None = None
) -> tuple[float, float] | None:
    """Find the constant step that printed times agree with, as round as the print allows.

    A start and a step agree if every printed time lies within half its last digit of
    ``start + step * number``. Of the steps that agree the roundest is taken: the rate or the step
    with the fewest significant digits, else the least-squares step.

    Parameters
    ----------
    resolution_s
        Last printed digit, s.
    numbers : ndarray of int64, shape (n_rows,), optional
        Increasing numbers of the rows; 0, 1, 2 ... if left out.

    Returns
    -------
    tuple of float or None
        Start, which is the time of number 0, and step, in seconds; None if no constant step agrees.
    """
    if times_s.size < 2:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        fitted = _fitted_step(times_s, numbers)
    if not 0 < fitted < np.inf:
        return None
    for step in _round_steps(fitted):
        start = start_agreeing(times_s, step, resolution_s, numbers)
        if start is not None:
            return start, step
    return None


def start_agreeing(
    times_s: Times, step_s: float, resolution_s: float, numbers: NDArray[np.int64] | None = None
) -> float | None:
    """Return the start with which printed times agree with a step, or None if there is none.

    Parameters
    ----------
    numbers : ndarray of int64, shape (n_rows,), optional
        Numbers of the rows, increasing; 0, 1, 2 ... if left out.

    Returns
    -------
    float or None
        Start, s: zero or the first printed time where these agree, else the middle of what agrees.
    """
    half = 0.5 * resolution_s + SLACK_S
    low, high, first = -np.inf, np.inf, 0.0
    for times, counts in _parts(times_s, numbers):
        residuals = times - step_s * counts
        if low == -np.inf:
            first = float(residuals[0])
        low, high = max(low, float(residuals.max() - half)), min(high, float(residuals.min() + half))
        if low > high:
            return None
    for start in (0.0, first):
        if low <= start <= high:
            return start
    return 0.5 * (low + high)


def _parts(
    times_s: Times, numbers: NDArray[np.int64] | None
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Go through times and numbers together, some at a time: long records are large beside the memory they may take."""
    for at in range(0, times_s.size, PART_ROWS):
        times = times_s[at : at + PART_ROWS]
        yield times, np.arange(at, at + times.size) if numbers is None else numbers[at : at + PART_ROWS]


def _fitted_step(times_s: Times, numbers: NDArray[np.int64] | None) -> float:
    """Return the least-squares step of times by their numbers."""
    middle = (times_s.size - 1) / 2 if numbers is None else float(numbers.mean())
    mean_s = sum(float(times.sum()) for times, _ in _parts(times_s, numbers)) / times_s.size
    product = square = 0.0
    for times, counts in _parts(times_s, numbers):
        centred = counts - middle
        product += float(np.multiply(centred, times - mean_s).sum())
        square += float(np.square(centred).sum())
    return product / square


def _round_steps(fitted_s: float) -> list[float]:
    """Return steps near a fitted one, those of the roundest rate or step first, the fitted one last."""
    steps = []
    for digits in range(1, 13):
        steps.append(1.0 / float(f"{1.0 / fitted_s:.{digits - 1}e}"))
        steps.append(float(f"{fitted_s:.{digits - 1}e}"))
    return [*steps, fitted_s]
