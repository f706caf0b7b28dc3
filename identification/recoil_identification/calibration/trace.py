"""The identified mass over time: one parameter by limited memory least squares, and how long its memory should be."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.estimate.mass import correlation_factor
from recoil_identification.memory.limited_memory import limited_memory_least_squares, window_sums
from recoil_identification.memory.window_length import WindowChoice, choose_window
from recoil_processing.shot.regression import LEAST_ROWS, LONGEST_SHARE, Regression, spaced_rows

SHORTEST_S = 2.5e-3
"""Shortest memory that is tried: below, the pulse alone tells enough, and nothing after it."""
PER_OCTAVE = 2
"""Memories that are tried for each doubling."""
ROWS_PER_CUTOFF = 10.0
"""Rows per period of the cut-off that predictions are made for: more of them say the same."""
LARGEST_RELATIVE_U = 0.02
"""Share of its mass that the random standard uncertainty of a window may reach; beyond it carries too little."""


@dataclass(frozen=True, eq=False)
class MassTrace(ReadOnlyArrays):
    """The mass that the last `window_s` of samples give, at every sample of the identification interval.

    Attributes
    ----------
    times_s, mass_kg, u_kg : ndarray, shape (n,)
        Instants, masses and standard uncertainties; NaN where nothing was identified; the uncertainty is random and
        systematic together.
    identified : ndarray of bool, shape (n,)
    reasons
        Reasons why samples were not identified, each with how many.
    """

    times_s: Array
    mass_kg: Array
    u_kg: Array
    identified: Flags
    window_s: float
    reasons: dict[str, int]

    @property
    def share(self) -> float:
        """Share of the interval's samples that were identified."""
        return float(self.identified.mean()) if self.identified.size else 0.0

    def __str__(self) -> str:
        return f"mass of the last {1e3 * self.window_s:g} ms, {100 * self.share:.0f} % of {self.times_s.size} samples"


def mass_trace(
    regression: Regression,
    acceleration_m_s2: Array,
    force_n: Array,
    window_s: float,
    *,
    direction: Literal["reverse", "forward"],
    systematic_rel: float,
    errors_m_s2: Array | None = None,
    largest_relative_u: float = LARGEST_RELATIVE_U,
) -> MassTrace:
    """Identify the mass in a sliding window.

    Parameters
    ----------
    regression
        Regression that gives the grid, the interval, the filter, and which samples can be trusted.
    acceleration_m_s2, force_n : ndarray, shape (n,)
        Sides of the equation of motion, corrected or not.
    window_s
        Length of the memory.
    direction
        ``reverse``: acceleration on force; ``forward``: force on acceleration.
    systematic_rel
        Relative standard uncertainty common to all windows.
    errors_m_s2 : ndarray, shape (n_reached, n_errors), optional
        Addition of one standard uncertainty of each of several independent errors to the acceleration, at the samples
        of `reached`: where the breech drives and where the brake holds, windows answer differently to them. For
        ``reverse`` only.
    largest_relative_u
        Random relative uncertainty beyond which a window carries too little information; infinite to
        take every window, as the paper did.

    Raises
    ------
    ValueError
        If the window is shorter than ten samples, or errors of the acceleration are given for ``forward``.
    """
    if errors_m_s2 is not None and direction != "reverse":
        raise ValueError("errors of the acceleration have no say where it is the regressor")
    window = round(window_s * regression.rate_hz)
    if window < 10:
        raise ValueError(f"a window of {window_s} s has {window} samples; at least 10 are needed")
    x, y = (force_n, acceleration_m_s2) if direction == "reverse" else (acceleration_m_s2, force_n)
    span = reached(regression, window_s)
    there = regression.trusted[span]
    x, y = np.where(there, x[span], np.nan), np.where(there, y[span], np.nan)
    windows = limited_memory_least_squares(x[:, None], y, window, partial=True)
    slope, error = windows.parameters[:, 0], windows.standard_errors[:, 0]
    residual = np.full(regression.times_s.size, np.nan)
    residual[span] = y - slope * x
    error = error * _error_factor(regression, residual)
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = np.abs(error / slope)
        mass = 1.0 / slope if direction == "reverse" else slope
    sound = windows.identified & np.isfinite(mass) & ~(relative > largest_relative_u)
    inside = regression.inside[span]
    systematic = np.full(mass.shape, systematic_rel)
    if errors_m_s2 is not None and errors_m_s2.shape[1]:
        known = np.isfinite(x) & np.isfinite(errors_m_s2).all(axis=1)
        force, errors = np.where(known, x, 0.0), np.where(known, errors_m_s2.T, 0.0)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):  # where next to no force tells anything
            sensitivities = window_sums(force * errors, window) / window_sums(force**2, window)
            systematic = np.hypot(systematic, np.sqrt((sensitivities**2).sum(axis=0)) * np.abs(mass))
    u = np.abs(mass) * np.hypot(relative, systematic)
    reasons: dict[str, int] = {}
    unsound = inside & ~sound
    if unsound.any():
        starved = unsound & ~windows.identified
        if starved.any():
            reasons["the window has no samples or no excitation"] = int(starved.sum())
        weak = int((unsound & windows.identified).sum())
        if weak:
            reasons[f"random uncertainty above {100 * largest_relative_u:g} % of the mass"] = weak
    return MassTrace(
        regression.times_s[span][inside],
        np.where(sound, mass, np.nan)[inside],
        np.where(sound, u, np.nan)[inside],
        sound[inside],
        window / regression.rate_hz,
        reasons,
    )


def reached(regression: Regression, window_s: float) -> slice:
    """Return the samples that windows reach which end inside the interval, or at a row that tells the errors.

    Whole windows from the record's first sample on, so that sums over windows have the digits of the whole record.
    """
    wanted = np.concatenate([np.flatnonzero(regression.inside), spaced_rows(regression)])
    if not wanted.size:
        return slice(0, regression.times_s.size)
    window = max(round(window_s * regression.rate_hz), 1)
    return slice(max(int(wanted.min()) // window - 1, 0) * window, int(wanted.max()) + 1)


def _error_factor(regression: Regression, residual: Array) -> float:
    """How much the errors' correlation widens a standard error that took all samples for independent.

    A low-passed record has far fewer independent samples than samples: the factor is the root of the
    spacing of independent rows, times what first-order correlation is left between those.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Residual of each window's last sample, NaN where there is none: a mass that changes is no correlated error.
    """
    rows = spaced_rows(regression)
    rows = rows[np.isfinite(residual[rows])]
    if rows.size < 10:
        return 1.0
    stride = float(np.median(np.diff(rows)))
    return float(np.sqrt(stride)) * correlation_factor(residual[rows])


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
        Memory that was asked for; None to choose it.
    default_s
        Memory that nobody asked for: where the interval is too short for it, or the samples too far apart, it is
        chosen.

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


def choose_trace_window(regression: Regression, acceleration_m_s2: Array, force_n: Array) -> tuple[float, WindowChoice]:
    """Choose the memory whose masses predict best what comes after them.

    Behind a low-pass the errors of neighbours are alike, so that what is predicted lies a period of the cut-off later.

    Parameters
    ----------
    regression
        Regression that gives the grid, the interval, the filter, and which samples can be trusted.
    acceleration_m_s2, force_n : ndarray, shape (n,)
        Sides of the equation of motion, corrected.

    Returns
    -------
    window_s : float
    choice : WindowChoice
        Choice with its windows in rows, thinned to `ROWS_PER_CUTOFF`.

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


def _share_of_interval(regression: Regression, why: str) -> tuple[float, WindowChoice]:
    """Return `LONGEST_SHARE` of an interval that is too short for memories to be compared."""
    start_s, end_s = regression.interval_s
    rows = max(LEAST_ROWS, round(LONGEST_SHARE * (end_s - start_s) / regression.step_s))
    reason = f"{why}: {rows} samples, {100 * LONGEST_SHARE:g} % of the interval or the fewest that are a memory"
    return rows * regression.step_s, WindowChoice(rows, (), 0, reason)
