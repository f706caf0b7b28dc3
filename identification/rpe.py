"""The relative percentage error of an identified mass, equation (37)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def relative_percentage_error(mass_kg: Array, specification_kg: float) -> float:
    """``RPE = sum |m_true - m(k)| / sum |m_true| * 100``, equation (37), in percent.

    Parameters
    ----------
    mass_kg : ndarray, shape (n,)
        Identified masses; NaN (not identified) are counted out of both sums.
    specification_kg : float

    Returns
    -------
    float
        NaN if nothing was identified.
    """
    present = mass_kg[np.isfinite(mass_kg)]
    if present.size == 0:
        return math.nan
    return float(100.0 * np.mean(np.abs(specification_kg - present)) / abs(specification_kg))


def rpe_interval(
    mass_kg: Array, specification_kg: float, systematic_rel: float, u_specification_kg: float, *, seed: int = 0
) -> tuple[float, float]:
    """95 % coverage interval of the RPE, by Monte Carlo (JCGM 101:2008).

    The trace's random scatter is in the RPE already. What moves it as a whole is the systematic part of
    the mass and the tolerance of the specification: both are drawn, normal, and the RPE is evaluated
    for each draw.

    Parameters
    ----------
    mass_kg : ndarray, shape (n,)
    specification_kg, u_specification_kg : float
        Specification mass and its standard uncertainty.
    systematic_rel : float
        Relative standard uncertainty common to the whole trace.
    seed : int

    Returns
    -------
    tuple of float
        2.5 and 97.5 % points, percent; NaN if nothing was identified.
    """
    present = mass_kg[np.isfinite(mass_kg)]
    if present.size == 0:
        return math.nan, math.nan
    thinned = present[:: max(1, present.size // 500)]
    rng = np.random.default_rng(seed)
    shift = 1.0 + systematic_rel * rng.standard_normal((4000, 1))
    specification = specification_kg + u_specification_kg * rng.standard_normal((4000, 1))
    draws = 100.0 * np.mean(np.abs(specification - thinned * shift), axis=1) / np.abs(specification[:, 0])
    low, high = np.percentile(draws, [2.5, 97.5])
    return float(low), float(high)
