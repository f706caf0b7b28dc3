"""Recursive residuals of a regression with calibrated errors, and what they say of its constancy.

A recursive residual is by how much a row differs from what the rows before it predict, over the standard
deviation of that difference. If one set of parameters holds throughout, they are independent with mean zero and
variance one; after a change their sum drifts away. R. L. Brown, J. Durbin, J. M. Evans, "Techniques for testing
the constancy of regression relationships over time", J. R. Statist. Soc. B 37(2), 1975.

Errors of sensors that calibrations restrict are further parameters with a normal prior. The prediction then
carries their uncertainty, so that what they can explain is no residual. Plain arrays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays

Array = NDArray[np.float64]

_CUSUM_BOUNDS = {0.05: 0.948, 0.01: 1.143}
"""Brown, Durbin and Evans (1975), section 2.3: the lines that CUSUM crosses with this probability."""
_SQUARES_BOUNDS = {0.05: (1.3581015, -0.6701218, -0.8858694), 0.01: (1.6276236, -0.6703724, -1.2365861)}
"""Coefficients of D. Edgerton and C. Wells, Oxford Bull. Econ. Stat. 56(3), 1994, for both sides together."""
LARGEST_FACTOR = 6.0
"""Of the long-run over the plain standard deviation: what is more correlated is a trend and no noise."""


@dataclass(frozen=True, eq=False)
class Cusum(ReadOnlyArrays):
    """A cumulative sum of recursive residuals, or of their squares, and its bounds.

    Attributes
    ----------
    rows : ndarray of int64, shape (n,)
        Of the regression.
    values : ndarray, shape (n,)
    bounds_5, bounds_1 : ndarray, shape (n, 2)
        Lower and upper bound that a constant regression crosses anywhere with a probability of 5 and 1 %.
    p_value
        Probability that a constant regression goes as far beyond, by the limit of many rows.
    factor
        By how much the residuals' correlation widened the bounds.
    """

    rows: NDArray[np.int64]
    values: Array
    bounds_5: Array
    bounds_1: Array
    p_value: float
    factor: float

    @property
    def crosses_5(self) -> bool:
        """Whether the sum leaves the bounds of 5 %."""
        return _leaves(self.values, self.bounds_5)

    @property
    def crosses_1(self) -> bool:
        """Whether the sum leaves the bounds of 1 %."""
        return _leaves(self.values, self.bounds_1)


def _leaves(values: Array, bounds: Array) -> bool:
    return bool(np.any((values < bounds[:, 0]) | (values > bounds[:, 1])))


def recursive_residuals(response: Array, regressors: Array, prior_u: Array, sigma: Array) -> Array:
    """Return the standardised one-step prediction errors.

    Parameters
    ----------
    response : ndarray, shape (n,)
    regressors : ndarray, shape (n, k)
    prior_u : ndarray, shape (k,)
        Standard uncertainty of each parameter about zero before the first row; infinite for a parameter that
        nothing restricts.
    sigma : ndarray, shape (n,)
        Standard deviation of each row's error.

    Returns
    -------
    ndarray, shape (n,)
        NaN for the rows that are used up to find the parameters without a prior.

    Raises
    ------
    ValueError
        If shapes do not fit, a standard deviation is not positive, or no row is left.

    Notes
    -----
    Cholesky's factor L of the covariance of the rows, taken forward in time, gives them all at once: the
    parameters with a prior are integrated out, row i of ``L^-1 y`` is the innovation given the rows before, and
    the rest is Brown, Durbin and Evans' recursion (their equations 2 to 5) for the free parameters, with
    square roots by orthogonal rotation in the place of their update of an inverse.
    """
    y, X = np.asarray(response, dtype=np.float64), np.asarray(regressors, dtype=np.float64)
    if X.shape != (y.size, np.size(prior_u)) or np.shape(sigma) != y.shape:
        raise ValueError(f"shapes do not fit: {y.shape}, {X.shape}, {np.shape(prior_u)}, {np.shape(sigma)}")
    if not (np.asarray(sigma) > 0).all():
        raise ValueError("every row needs a positive standard deviation")
    free = np.isinf(prior_u)
    count = int(free.sum())
    if y.size <= count:
        raise ValueError(f"{y.size} rows leave no residual for {count} free parameters")
    known = X[:, ~free] * np.asarray(prior_u)[~free]
    factor = np.linalg.cholesky(np.diag(np.asarray(sigma, dtype=np.float64) ** 2) + known @ known.T)
    white = np.linalg.solve(factor, np.column_stack([X[:, free], y]))
    return _innovations(white, count)


def _innovations(rows: Array, count: int) -> Array:
    """Take rows of [regressors | response] in one by one; return their residuals before each is taken in."""
    found = np.full(rows.shape[0], np.nan)
    triangle = np.zeros((count, count + 1))
    for i, row in enumerate(rows):
        left = row.copy()
        scale = 1.0
        for j in range(count):
            r = math.hypot(triangle[j, j], left[j])
            if r == 0.0:
                continue
            c, s = triangle[j, j] / r, left[j] / r
            upper = triangle[j].copy()
            triangle[j] = c * upper + s * left
            left = c * left - s * upper
            scale *= c
        # rotated into the triangle, the response's rest is the prediction error over its standard deviation
        if scale > 0.0:
            found[i] = left[count]
    found[:count] = np.nan
    return found


def long_run_factor(residual: Array) -> float:
    """Return the long-run over the plain standard deviation of a series, at least 1, at most `LARGEST_FACTOR`.

    Bartlett's kernel on what a first-order autoregression leaves, W. K. Newey and K. D. West, Rev. Econ. Stud.
    61(4), 1994, with its automatic bandwidth; prewhitening by D. W. K. Andrews and J. C. Monahan, Econometrica
    60(4), 1992, with their bound of 0.97 on the root.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        In order of time; its mean is taken off.
    """
    e = residual - np.mean(residual)
    energy = float(e @ e)
    if e.size < 10 or energy == 0.0:
        return 1.0
    r = float(np.clip(e[1:] @ e[:-1] / energy, -0.97, 0.97))
    v = e[1:] - r * e[:-1]
    n = v.size
    lags = max(1, int(4 * (n / 100.0) ** (2.0 / 9.0)))
    moments = np.array([float(v[h:] @ v[: n - h]) / n for h in range(lags + 1)])
    zeroth, first = moments[0] + 2 * moments[1:].sum(), 2 * float(np.arange(1, lags + 1) @ moments[1:])
    bandwidth = n - 1
    if abs(zeroth) > 1e-12 * moments[0]:
        bandwidth = min(n - 1, int(1.1447 * ((first / zeroth) ** 2 * n) ** (1.0 / 3.0)))
    long_run = moments[0]
    for h in range(1, bandwidth + 1):
        long_run += 2 * (1 - h / (bandwidth + 1)) * float(v[h:] @ v[: n - h]) / n
    variance = long_run / (1 - r) ** 2
    return math.sqrt(min(max(variance / (energy / e.size), 1.0), LARGEST_FACTOR**2))


def cusum(residuals: Array, factor: float | None = None) -> Cusum:
    """Return the cumulative sum of recursive residuals over their standard deviation.

    Parameters
    ----------
    residuals : ndarray, shape (n,)
        From `recursive_residuals`; NaN are left out.
    factor
        By which correlation widens the bounds; `long_run_factor` if left out.

    Raises
    ------
    ValueError
        If there are fewer than three residuals.
    """
    rows, w = _present(residuals)
    n = w.size
    factor = long_run_factor(w) if factor is None else factor
    values = np.cumsum(w) / np.std(w, ddof=1)
    # the line through (0, a sqrt n) and (n, 3 a sqrt n), equation (7)
    line = math.sqrt(n) * (1 + 2 * np.arange(1, n + 1) / n) * factor
    bounds = {level: np.outer(line, [-a, a]) for level, a in _CUSUM_BOUNDS.items()}
    p = _cusum_probability(float(np.max(np.abs(values) / line)))
    return Cusum(rows, values, bounds[0.05], bounds[0.01], p, factor)


def _cusum_probability(a: float) -> float:
    """Return the probability that Brownian motion on [0, 1] leaves ``a (1 + 2 t)`` on either side.

    Twice that of one side, which Brown, Durbin and Evans (1975) give as ``Q(3 a) + exp(-4 a^2) Phi(a)``, less
    both sides crossed, of which the leading term is kept.
    """
    if a < 0.2:
        return 1.0

    def normal(x: float) -> float:
        return 0.5 * math.erfc(-x / math.sqrt(2))

    one = 1 - normal(3 * a) + math.exp(-4 * a * a) * (normal(a) + normal(5 * a) - 1)
    return min(max(2 * (one - math.exp(-16 * a * a) * (1 - normal(a))), 0.0), 1.0)


def cusum_of_squares(residuals: Array, factor: float | None = None) -> Cusum:
    """Return the share of the squares' sum that has come up to each row: it tells a change of the scatter.

    Parameters
    ----------
    residuals : ndarray, shape (n,)
        From `recursive_residuals`; NaN are left out.
    factor
        By which correlated squares, or heavier tails than the normal distribution's, widen the bounds; found from
        the squares if left out, as in A. Sansó, V. Aragó, J. L. Carrion, Rev. Econ. Fin. 4, 2004.

    Raises
    ------
    ValueError
        If there are fewer than six residuals.
    """
    rows, w = _present(residuals)
    n = w.size
    if n < 6:
        raise ValueError(f"{n} residuals say nothing about their scatter; at least 6 are needed")
    squares = w**2 / np.mean(w**2)
    if factor is None:
        factor = max(1.0, math.sqrt(float(np.var(squares)) / 2) * long_run_factor(squares))
    values = np.cumsum(squares) / n
    half = 0.5 * n - 1
    mean = np.arange(1, n + 1) / n

    def bounds(level: float) -> Array:
        c = sum(k / half ** (0.5 * (j + 1)) for j, k in enumerate(_SQUARES_BOUNDS[level]))
        return np.column_stack([mean - c * factor, mean + c * factor])

    largest = float(np.max(np.abs(values - mean))) / factor * math.sqrt(half)
    # the limit is the largest distance of a Brownian bridge from zero, Kolmogorov's distribution
    p = 2 * sum((-1) ** (j - 1) * math.exp(-2 * (j * largest) ** 2) for j in range(1, 101)) if largest > 0.2 else 1.0
    return Cusum(rows, values, bounds(0.05), bounds(0.01), min(max(p, 0.0), 1.0), factor)


def _present(residuals: Array) -> tuple[NDArray[np.int64], Array]:
    rows = np.flatnonzero(np.isfinite(residuals))
    if rows.size < 3:
        raise ValueError(f"{rows.size} residuals are too few for a cumulative sum; at least 3 are needed")
    return rows, np.asarray(residuals, dtype=np.float64)[rows]
