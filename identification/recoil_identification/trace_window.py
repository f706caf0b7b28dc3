"""How long the memory of the mass's trace should be, from the shot itself."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_identification.memory.window_length import WindowChoice, choose_window
from recoil_processing.shot.regression import Regression

Array = NDArray[np.float64]

SHORTEST_S = 2.5e-3
"""Shortest memory that is tried: below, the pulse alone tells enough, and nothing after it."""
LONGEST_SHARE = 0.25
"""Share of the interval that the longest one takes."""
LEAST_ROWS = 10
"""Samples that are a memory."""
PER_OCTAVE = 2
"""Memories that are tried for each doubling."""
ROWS_PER_CUTOFF = 10.0
"""Rows per period of the cut-off that predictions are made for: more of them say the same."""


def trace_window(
    asked_s: float | None,
    regression: Regression,
    acceleration_m_s2: Array,
    force_n: Array,
    *,
    default_s: float | None = None,
) -> tuple[float, WindowChoice | None]:
    """Return the memory that was asked for, or choose it; parameters otherwise as of `choose_trace_window`.

    Parameters
    ----------
    asked_s
        None to choose it.
    default_s
        What nobody asked for: where the interval is too short for it, or the samples too far apart, it is chosen.

    Raises
    ------
    IdentificationError
        If one that was asked for is longer than the identification interval or shorter than `LEAST_ROWS` samples: there
        would be no such memory.
    """
    start_s, end_s = regression.interval_s
    shortest_s = LEAST_ROWS * regression.step_s
    fits = asked_s is not None and shortest_s <= asked_s <= end_s - start_s
    if asked_s is None or (asked_s == default_s and not fits):
        try:
            return choose_trace_window(regression, acceleration_m_s2, force_n)
        except IdentificationError as error:
            return _share_of_interval(regression, error.problem)
    if asked_s < shortest_s:
        raise IdentificationError(
            f"the memory of the trace is shorter than {LEAST_ROWS} samples",
            expected=f"at least {shortest_s:.3g} s",
            found=f"--window-s {asked_s:g}",
            remedy="give a longer --window-s, or auto",
        )
    if not fits:
        raise IdentificationError(
            "the memory of the trace is longer than the identification interval",
            expected=f"at most {end_s - start_s:.3g} s",
            found=f"--window-s {asked_s:g}",
            remedy="give a shorter --window-s, or auto",
        )
    return asked_s, None


def _share_of_interval(regression: Regression, why: str) -> tuple[float, WindowChoice]:
    """Return `LONGEST_SHARE` of an interval that is too short for memories to be compared."""
    start_s, end_s = regression.interval_s
    rows = max(LEAST_ROWS, round(LONGEST_SHARE * (end_s - start_s) / regression.step_s))
    reason = f"{why}: {rows} samples, {100 * LONGEST_SHARE:g} % of the interval or the fewest that are a memory"
    return rows * regression.step_s, WindowChoice(rows, (), 0, reason)


def choose_trace_window(regression: Regression, acceleration_m_s2: Array, force_n: Array) -> tuple[float, WindowChoice]:
    """Choose the memory whose masses predict best what comes after them.

    Behind a low-pass the errors of neighbours are alike, so that what is predicted lies a period of the cut-off later.

    Parameters
    ----------
    regression
        Gives the grid, the interval, the filter, and which samples can be trusted.
    acceleration_m_s2, force_n : ndarray, shape (n,)
        Both sides of the equation of motion, corrected.

    Returns
    -------
    window_s : float
    choice : WindowChoice
        Its windows in rows, thinned to `ROWS_PER_CUTOFF`.

    Raises
    ------
    IdentificationError
        If the interval is too short, or too little of it can be trusted, to compare memories.
    """
    stride = 1
    if regression.low_pass is not None:
        stride = max(1, int(regression.rate_hz / (ROWS_PER_CUTOFF * regression.low_pass.cutoff_hz)))
    rows = np.flatnonzero(regression.inside)[::stride]
    step_s = stride * regression.step_s
    shortest = max(10, round(SHORTEST_S / step_s))
    longest = int(LONGEST_SHARE * rows.size)
    if longest < 2 * shortest:
        raise IdentificationError(
            "the shot is too short to choose the memory of the trace from",
            expected=f"an identification interval of {2 * shortest * step_s / LONGEST_SHARE:.2g} s or more",
            found=f"{rows.size * step_s:.2g} s",
            remedy="give the memory, by --window-s",
        )
    count = 1 + round(PER_OCTAVE * math.log2(longest / shortest))
    windows = sorted({round(length) for length in np.geomspace(shortest, longest, count)})
    trusted = regression.trusted[rows]
    ahead = 1 if regression.low_pass is None else round(ROWS_PER_CUTOFF)
    choice = choose_window(
        np.where(trusted, force_n[rows], np.nan)[:, np.newaxis],
        np.where(trusted, acceleration_m_s2[rows], np.nan),
        windows,
        ahead=ahead,
    )
    return choice.window * step_s, choice
