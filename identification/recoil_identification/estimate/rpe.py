"""The relative percentage error of an identified mass, equation (37)."""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.estimate.budget import COVERAGE

RPE_MEANING = "noise can only raise the RPE, so its interval may be one-sided and begin at the RPE itself"
"""Explanation of its interval for a reader."""
DRAWS = 4000
"""Draws of the Monte Carlo; the ends of the interval then scatter by some hundredths of its width."""
SEED = 0
"""Seed of the draws: the same report has the same interval."""


def relative_percentage_error(mass_kg: Array, specification_kg: float) -> float:
    """``RPE = sum |m_true - m(k)| / sum |m_true| * 100``, equation (37), in percent.

    Parameters
    ----------
    mass_kg : ndarray, shape (n,)
        Identified masses; NaN (not identified) are counted out of both sums.

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
    mass_kg: Array, specification_kg: float, systematic_rel: float, u_specification_kg: float, *, seed: int = SEED
) -> tuple[float, float]:
    """95 % coverage interval of the RPE, by Monte Carlo (JCGM 101:2008).

    The trace's random scatter is in the RPE already. What moves it as a whole is the systematic part of
    the mass and the tolerance of the specification: both are drawn, normal, and the RPE is evaluated
    for each draw. The RPE is an absolute value: near its least possible value its distribution is
    folded and one-sided, so the interval is the shortest one (JCGM 101:2008, 5.3.4), which then begins
    at that value where a symmetric one would leave it, and the RPE itself, out.

    Parameters
    ----------
    mass_kg : ndarray, shape (n,)
    specification_kg, u_specification_kg
        Specification mass and its standard uncertainty.
    systematic_rel
        Relative standard uncertainty common to the whole trace.

    Returns
    -------
    tuple of float
        Percent; it holds the RPE. NaN if nothing was identified.
    """
    present = mass_kg[np.isfinite(mass_kg)]
    if present.size == 0:
        return math.nan, math.nan
    thinned = present[:: max(1, present.size // 500)]
    rng = np.random.default_rng(seed)
    shift = 1.0 + systematic_rel * rng.standard_normal(DRAWS)
    specification = specification_kg + u_specification_kg * rng.standard_normal(DRAWS)
    draws = np.sort(100.0 * _mean_deviation(thinned, shift, specification) / np.abs(specification))
    inside = math.ceil(COVERAGE * DRAWS)
    first = int(np.argmin(draws[inside - 1 :] - draws[: DRAWS - inside + 1]))
    value = relative_percentage_error(mass_kg, specification_kg)
    return min(float(draws[first]), value), max(float(draws[first + inside - 1]), value)


def _mean_deviation(values: Array, factors: Array, centres: Array) -> Array:
    """Return the mean of ``abs(centre - factor * value)`` over the values, for each pair of factor and centre.

    Of sorted values it is known from how many lie below the centre, and from the sum of those.
    """
    signs = np.where(factors < 0, -1.0, 1.0)
    factors, centres = signs * factors, signs * centres
    ordered = np.sort(values)
    sums = np.concatenate([[0.0], np.cumsum(ordered)])
    with np.errstate(divide="ignore", invalid="ignore"):
        below = np.searchsorted(ordered, np.where(factors > 0, centres / factors, np.inf * centres))
    n = ordered.size
    return np.asarray((centres * (2 * below - n) + factors * (sums[n] - 2.0 * sums[below])) / n, dtype=np.float64)
