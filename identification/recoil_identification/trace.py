"""The identified mass over time: one parameter by limited memory least squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_identification.mass import correlation_factor
from recoil_identification.memory.limited_memory import limited_memory_least_squares, window_sums
from recoil_processing.shot.regression import Regression, spaced_rows

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LARGEST_RELATIVE_U = 0.02
"""A window whose random standard uncertainty exceeds this share of its mass carries too little information."""


@dataclass(frozen=True, eq=False)
class MassTrace(ReadOnlyArrays):
    """The mass that the last `window_s` of samples give, at every sample of the identification interval.

    Attributes
    ----------
    times_s, mass_kg, u_kg : ndarray, shape (n,)
        NaN where nothing was identified; the uncertainty is random and systematic together.
    identified : ndarray of bool, shape (n,)
    reasons
        Why samples were not identified, and how many.
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
        Gives the grid, the interval, the filter, and which samples can be trusted.
    acceleration_m_s2, force_n : ndarray, shape (n,)
        Both sides of the equation of motion, corrected or not.
    window_s
        Length of the memory.
    direction
        ``reverse``: acceleration on force; ``forward``: force on acceleration.
    systematic_rel
        Relative standard uncertainty common to all windows.
    errors_m_s2 : ndarray, shape (n, n_errors), optional
        What one standard uncertainty of each of several independent errors adds to the acceleration: where the
        breech drives and where the brake holds, windows answer differently to them. For ``reverse`` only.
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
    x, y = np.where(regression.trusted, x, np.nan), np.where(regression.trusted, y, np.nan)
    windows = limited_memory_least_squares(x[:, None], y, window, partial=True)
    slope, error = windows.parameters[:, 0], windows.standard_errors[:, 0]
    error = error * _error_factor(regression, y - slope * x)
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = np.abs(error / slope)
        mass = 1.0 / slope if direction == "reverse" else slope
    sound = windows.identified & np.isfinite(mass) & ~(relative > largest_relative_u)
    inside = regression.inside
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
        regression.times_s[inside],
        np.where(sound, mass, np.nan)[inside],
        np.where(sound, u, np.nan)[inside],
        sound[inside],
        window / regression.rate_hz,
        reasons,
    )


def _error_factor(regression: Regression, residual: Array) -> float:
    """How much the errors' correlation widens a standard error that took all samples for independent.

    A low-passed record has far fewer independent samples than samples: the factor is the root of the
    spacing of independent rows, times what first-order correlation is left between those.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Of each window's last sample, NaN where there is none: a mass that changes is no correlated error.
    """
    rows = spaced_rows(regression)
    rows = rows[np.isfinite(residual[rows])]
    if rows.size < 10:
        return 1.0
    stride = float(np.median(np.diff(rows)))
    return float(np.sqrt(stride)) * correlation_factor(residual[rows])
