"""Residuals of the equation of motion, and their distribution."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_identification.calibration.calibration import Calibration
from recoil_processing.shot.regression import Regression

Array = NDArray[np.float64]

LEAST_SAMPLES = 20
"""Count at and below which a distribution says nothing."""
BINS = 40
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
