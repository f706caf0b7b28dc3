"""Time printed with few decimals: the constant step that it agrees with.

Rounding alone makes neighbouring steps differ: 1/6000 s prints as 0.000167, then 0.000166. Such a
column is a uniform time base whose step is known much better than any two printed numbers tell.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SLACK_S = 1e-9
"""Allowance beside half the last printed digit, for the arithmetic of whoever printed."""


def uniform_from_printed(
    times_s: NDArray[np.float64], resolution_s: float, numbers: NDArray[np.int64] | None = None
) -> tuple[float, float] | None:
    """Find the constant step that printed times agree with, as round as the print allows.

    A start and a step agree if every printed time lies within half its last digit of
    ``start + step * number``. Of the steps that agree the roundest is taken: the rate or the step
    with the fewest significant digits, else the least-squares step.

    Parameters
    ----------
    times_s : ndarray of float64, shape (n_rows,)
    resolution_s : float
        The last printed digit.
    numbers : ndarray of int64, shape (n_rows,), optional
        Increasing numbers of the rows; 0, 1, 2 ... if left out.

    Returns
    -------
    tuple of float or None
        Start, which is the time of number 0, and step, in seconds; None if no constant step agrees.
    """
    if times_s.size < 2:
        return None
    counts = np.arange(times_s.size) if numbers is None else numbers
    centred = counts - counts.mean()
    fitted = float(centred @ (times_s - times_s.mean()) / (centred @ centred))
    if not fitted > 0:
        return None
    for step in _round_steps(fitted):
        start = start_agreeing(times_s, step, resolution_s, counts)
        if start is not None:
            return start, step
    return None


def start_agreeing(
    times_s: NDArray[np.float64], step_s: float, resolution_s: float, numbers: NDArray[np.int64]
) -> float | None:
    """Return the start with which printed times agree with a step, or None if there is none.

    Parameters
    ----------
    times_s : ndarray of float64, shape (n_rows,)
    step_s, resolution_s : float
    numbers : ndarray of int64, shape (n_rows,)

    Returns
    -------
    float or None
        Zero or the first printed time where these agree, else the middle of what agrees.
    """
    residuals = times_s - step_s * numbers
    half = 0.5 * resolution_s + SLACK_S
    low, high = float(residuals.max() - half), float(residuals.min() + half)
    if low > high:
        return None
    for start in (0.0, float(residuals[0])):
        if low <= start <= high:
            return start
    return 0.5 * (low + high)


def _round_steps(fitted_s: float) -> list[float]:
    """Return steps near a fitted one, those of the roundest rate or step first, the fitted one last."""
    steps = []
    for digits in range(1, 13):
        steps.append(1.0 / float(f"{1.0 / fitted_s:.{digits - 1}e}"))
        steps.append(float(f"{fitted_s:.{digits - 1}e}"))
    return [*steps, fitted_s]
