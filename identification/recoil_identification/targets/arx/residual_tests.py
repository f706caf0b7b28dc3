"""Tests of a model's residuals: for whiteness, and for independence of the input.

Residuals that are white and independent of past inputs leave nothing for a larger model to find
(L. Ljung, *System Identification*, 2nd edition, 16.6). Both tests take gaps (NaN) as they are: a
product with a lost sample does not count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

LEVEL = 0.99
"""Level of bands and verdicts; one lag of a hundred lies outside by chance."""


@dataclass(frozen=True, eq=False)
class ResidualTest(ReadOnlyArrays):
    """Correlation by lag with its band, and all lags together.

    Attributes
    ----------
    lags : ndarray of int64, shape (n_lags,)
        Lags in samples; a positive one of the cross-correlation means that the residual is late.
    correlation : ndarray, shape (n_lags,)
        Normalised: between -1 and 1.
    band : ndarray, shape (n_lags,)
        Half width within which it lies by chance at each lag, at `LEVEL`.
    statistic
        Chi-squared if nothing is left in the residuals.
    p_value
        Probability of so large a statistic by chance; NaN without a degree of freedom.
    count
        Residuals present.
    """

    lags: NDArray[np.int64]
    correlation: Array
    band: Array
    statistic: float
    degrees_of_freedom: int
    p_value: float
    count: int

    @property
    def passed(self) -> bool:
        """True if chance explains all lags together at the level; never without a degree of freedom."""
        return self.p_value >= 1.0 - LEVEL

    @property
    def outside(self) -> NDArray[np.int64]:
        """Lags whose correlation is beyond its band, lag 0 of an autocorrelation left out."""
        beyond = np.abs(self.correlation) > self.band
        return np.asarray(self.lags[beyond & ~((self.lags == 0) & (self.correlation == 1.0))])


def whiteness(residual: Array, lags: int, *, n_dynamic: int = 0) -> ResidualTest:
    """Test residuals for correlation in time by the statistic of Ljung and Box.

    Parameters
    ----------
    residual : ndarray, shape (n_samples,)
        Residual in order of time; NaN for a gap. The mean is not taken off.
    lags
        The largest; at least one more than `n_dynamic`.
    n_dynamic
        Coefficients of past outputs that were fitted, na: they cost degrees of freedom.

    Returns
    -------
    ResidualTest
        Lags 0 to `lags`.

    Raises
    ------
    ValueError
        If the residuals are fewer than two more than the lags, or all zero.

    Notes
    -----
    ``Q = N (N + 2) sum r_k^2 / (N - k)`` is chi-squared with ``lags - n_dynamic`` degrees of freedom
    (G. M. Ljung and G. E. P. Box, Biometrika 65, 1978, 297-303); each lag has the variance 1 / N. With
    gaps, N - k is the number of products at lag k, and its band widens accordingly.
    """
    e, present = _checked_residual(residual, lags)
    count = int(present.sum())
    power = float(e @ e) / count
    at = np.arange(lags + 1)
    products = np.array([int((present[k:] & present[: e.size - k]).sum()) for k in at])
    sums = np.array([float(e[k:] @ e[: e.size - k]) for k in at])
    # with gaps the sum has fewer products than N - k: it is raised to what N - k of them would give
    whole = count - at
    correlation = np.where(products > 0, sums / np.maximum(products, 1) * whole, 0.0) / (count * power)
    used = products[1:] > 0
    # of the variance of each lag: (N - k) / N^2 for a whole record
    weights = np.where(used, count * (count + 2.0) / whole[1:] * products[1:] / whole[1:], 0.0)
    statistic = float(np.sum(weights * correlation[1:] ** 2))
    band = np.full(lags + 1, _quantile() / math.sqrt(count))
    band[1:] *= np.where(used, np.sqrt(whole[1:] / np.maximum(products[1:], 1)), math.inf)
    degrees = int(used.sum()) - n_dynamic
    return ResidualTest(at, correlation, band, statistic, degrees, _exceedance(statistic, degrees), count)


def independence(residual: Array, input_: Array, lags: int, regressors: Array) -> ResidualTest:
    """Test residuals for what the input at other lags would explain.

    Parameters
    ----------
    residual, input_ : ndarray, shape (n_samples,)
        Residual in order of time; NaN for a gap.
    lags
        The largest, on both sides: at negative lags the residual leads the input, which tells of feedback
        or of an input that is late.
    regressors : ndarray, shape (n_samples, n_parameters)
        Regressors that were fitted: the bands are exact for white residuals, and narrower where the fit has made the
        correlation small.

    Returns
    -------
    ResidualTest
        Lags ``-lags`` to `lags`; a lag that the regressors contain has correlation 0 and no band of its
        own (infinite). The statistic is of the lags from 0 on.

    Raises
    ------
    ValueError
        As `whiteness`, or if the input is zero throughout.

    Notes
    -----
    With the input shifted by the lag as column z and the projection P on the regressors, ``z'e`` has the
    variance ``s^2 z'(I - P)z`` and ``e'Z (s^2 Z'(I - P)Z)^+ Z'e`` is chi-squared: the score test of the
    lags left out (T. S. Breusch and A. R. Pagan, Rev. Econ. Stud. 47, 1980, 239-253).
    """
    e, present = _checked_residual(residual, lags)
    at = np.arange(-lags, lags + 1)
    # the lags' own gaps count as zero: the product there is lost, the residual is not
    shifted = np.column_stack([_late(np.nan_to_num(input_), int(k)) for k in at])
    present &= np.isfinite(regressors).all(axis=1)
    e, shifted, fitted = e[present], shifted[present], regressors[present]
    energy = (shifted**2).sum(axis=0)
    if not energy.any():
        raise ValueError("the input is zero throughout")
    explained, _ = np.linalg.qr(fitted / np.maximum(np.linalg.norm(fitted, axis=0), 1e-300))
    own = shifted - explained @ (explained.T @ shifted)
    own -= explained @ (explained.T @ own)
    variance = float(e @ e) / max(e.size - fitted.shape[1], 1)
    own_energy = (own**2).sum(axis=0)
    known = own_energy > 1e-9 * np.maximum(energy, 1e-300)
    scale = np.sqrt(float(e @ e) * np.maximum(energy, 1e-300))
    correlation = np.where(known, (e @ own) / scale, 0.0)
    band = np.where(known, _quantile() * np.sqrt(variance * own_energy) / scale, math.inf)
    causal = known & (at >= 0)
    statistic, degrees = _score(e, own[:, causal], variance)
    return ResidualTest(at, correlation, band, statistic, degrees, _exceedance(statistic, degrees), int(e.size))


def _checked_residual(residual: Array, lags: int) -> tuple[Array, NDArray[np.bool_]]:
    """Return residuals with zeros in the gaps, and where they are present."""
    e = np.array(residual)
    present = np.isfinite(e)
    if int(present.sum()) < lags + 2:
        raise ValueError(f"{int(present.sum())} residuals are too few for {lags} lags; expected {lags + 2} or more")
    e[~present] = 0.0
    if not e.any():
        raise ValueError("the residuals are zero throughout: there is nothing to test")
    return e, present


def _late(series: Array, lag: int) -> Array:
    """Return a series that is late by a lag, with zeros beyond its ends."""
    moved = np.zeros_like(series)
    if lag >= 0:
        moved[lag:] = series[: series.size - lag]
    else:
        moved[:lag] = series[-lag:]
    return moved


def _score(e: Array, own: Array, variance: float) -> tuple[float, int]:
    """Sum the squares of the residuals along the directions that the columns span, and count these."""
    if own.shape[1] == 0:
        return 0.0, 0
    left, singular, _ = np.linalg.svd(own / np.linalg.norm(own, axis=0), full_matrices=False)
    kept = left[:, singular > 1e-6 * singular[0]]
    return float(np.sum((kept.T @ e) ** 2) / variance), kept.shape[1]


def _quantile() -> float:
    from scipy.special import ndtri

    return float(ndtri(0.5 + 0.5 * LEVEL))


def _exceedance(statistic: float, degrees_of_freedom: int) -> float:
    if degrees_of_freedom < 1:
        return math.nan
    from scipy.special import chdtrc

    return float(chdtrc(degrees_of_freedom, statistic))
