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
PER_OCTAVE = 2
"""Memories that are tried for each doubling."""
ROWS_PER_CUTOFF = 10.0
"""Rows per period of the cut-off that predictions are made for: more of them say the same."""


def trace_window(
    asked_s: float | None, regression: Regression, acceleration_m_s2: Array, force_n: Array
) -> tuple[float, WindowChoice | None]:
    """Return the memory that was asked for, or choose it; parameters otherwise as of `choose_trace_window`.

    Raises
    ------
    IdentificationError
        If it is longer than the identification interval: there would be no such memory.
    """
    if asked_s is None:
        return choose_trace_window(regression, acceleration_m_s2, force_n)
    start_s, end_s = regression.interval_s
    if asked_s > end_s - start_s:
        raise IdentificationError(
            "the memory of the trace is longer than the identification interval",
            expected=f"at most {end_s - start_s:.3g} s",
            found=f"--window-s {asked_s:g}",
            remedy="give a shorter --window-s, or auto",
        )
    return asked_s, None


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
