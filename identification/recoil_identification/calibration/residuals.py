"""Residuals of the equation of motion, and their distribution."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_processing.shot.regression import Regression

LEAST_SAMPLES = 20
"""Count at and below which a distribution says nothing."""
BINS = 40
MOST_LAGS = 40
"""Lags at most of an autocorrelation."""
KOLMOGOROV = 1.358
"""95 % quantile of Kolmogorov's distribution."""
REACH = 4.0
"""Standard deviations to either side, over which samples are counted."""


@dataclass(frozen=True, eq=False)
class Histogram(ReadOnlyArrays):
    """The density of residuals beside the normal one of the same standard deviation.

    Attributes
    ----------
    spread_m_s2
        Standard deviation of the residuals.
    middles_m_s2, density, normal : ndarray, shape (n_bins,)
    """

    spread_m_s2: float
    middles_m_s2: Array
    density: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class Whiteness(ReadOnlyArrays):
    """Remainder of the rows of the fit, their known correlation taken off, beside white noise.

    The cumulative periodogram is that of M. S. Bartlett, *An Introduction to Stochastic Processes*, 1955, with
    Kolmogorov's limits; the limits of the autocorrelation are those of white noise, 1.96 / sqrt(n).

    Attributes
    ----------
    lags : ndarray, shape (n_lags,)
        Rows apart, from 1 on.
    autocorrelation : ndarray, shape (n_lags,)
    limit
        Magnitude that the autocorrelation of white noise exceeds at one lag of twenty.
    frequency : ndarray, shape (n_frequencies,)
        Frequency as a share of half the rows' rate.
    cumulative : ndarray, shape (n_frequencies,)
        Share of the power up to each of them; that of white noise rises evenly from 0 to 1.
    cumulative_limit
        Distance from that line that white noise exceeds in one shot of twenty.
    """

    lags: Array
    autocorrelation: Array
    limit: float
    frequency: Array
    cumulative: Array
    cumulative_limit: float

    @property
    def furthest(self) -> float:
        """Largest distance of the cumulative periodogram from the line of white noise."""
        return float(np.max(np.abs(self.cumulative - self.frequency)))

    @property
    def is_white(self) -> bool:
        """Whether it stays within its limit."""
        return self.furthest <= self.cumulative_limit


def whiteness(left: Array) -> Whiteness | None:
    """Compare a series with white noise; None where it is too short, or all the same.

    Parameters
    ----------
    left : ndarray, shape (n_rows,)
        Series in order of time.
    """
    n = left.size
    if n <= LEAST_SAMPLES or not (energy := float((left - left.mean()) @ (left - left.mean()))) > 0:
        return None
    centred = left - left.mean()
    lags = np.arange(1, min(MOST_LAGS, n // 4) + 1)
    autocorrelation = np.array([float(centred[k:] @ centred[:-k]) for k in lags]) / energy
    power = np.abs(np.fft.rfft(centred))[1 : (n - 1) // 2 + 1] ** 2
    cumulative = np.cumsum(power) / power.sum()
    frequency = np.arange(1, power.size + 1) / power.size
    return Whiteness(
        lags.astype(np.float64), autocorrelation, COVERAGE_FACTOR / math.sqrt(n), frequency, cumulative,
        KOLMOGOROV / math.sqrt(power.size),
    )  # fmt: skip


def rows_left(calibration: Calibration) -> Array:
    """Return what the fit leaves of the motion's rows, their correlation taken off and over their noise, shape (n,).

    Of a mass by a camera they are its frames.
    """
    left, _ = calibration.rows.linearised(calibration.values)
    return left if calibration.is_by_camera else left[: calibration.block.rows.size]


def residuals_of(regression: Regression, calibration: Calibration) -> Array:
    """Return a' - F'/m with the sensors' errors taken off, shape (n,); NaN where samples are lost."""
    acceleration, force = calibration.correct(regression)
    return np.where(regression.trusted, acceleration - force / calibration.estimate.mass_kg, np.nan)


def histogram(residuals_m_s2: Array) -> Histogram | None:
    """Count residuals, shape (n,); None where they are too few, or all the same."""
    if residuals_m_s2.size <= LEAST_SAMPLES or not (spread := float(np.std(residuals_m_s2))) > 0:
        return None
    bins = np.linspace(-REACH * spread, REACH * spread, BINS + 1)
    counts, edges = np.histogram(residuals_m_s2, bins=bins, density=True)
    middles = 0.5 * (edges[1:] + edges[:-1])
    normal = np.exp(-0.5 * (middles / spread) ** 2) / (spread * math.sqrt(2 * math.pi))
    return Histogram(spread, middles, counts, normal)
