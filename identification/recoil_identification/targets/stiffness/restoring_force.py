"""Stiffness and damping of one support from its load and its deflection: ``load = k deflection + c rate``.

Both sides pass one and the same band-pass: the low-pass takes off stress waves, the high-pass the drift
of a deflection that was integrated from accelerometers or gyros. What drift is left enters as columns of its own,
powers of the time since the shot, so that it cannot pass for a force. While a foot is off the ground its load is
zero whatever it does: there every column is zero, before the filter, so that lift-off does not bias the slope.

The load is the response: its noise, that of derivatives, does not bias. Noise of the deflection would draw the slope
towards zero; the high-pass leaves little of it, because what was integrated is noisy where it is slow. How much it does
is tried out in `recoil_identification.targets.stiffness.stiffness_budget` by adding the sensors' noise once more (J. R.
Cook, L. A. Stefanski, "Simulation-extrapolation estimation in parametric measurement error models", JASA 89, 1994).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.estimate.mass import correlation_factor
from recoil_identification.memory.limited_memory import WindowStatus, limited_memory_least_squares
from recoil_identification.targets.stiffness.support_filter import FilteredSupport, Rows
from recoil_processing.filters import ROWS_PER_CUTOFF

LAGS_S = 0.03
"""Over which the residual's autocorrelation counts: longer than the memory of filter and structure."""
LARGEST_LEVERAGE = 0.9
"""Largest leverage of one row that the residual is corrected for."""
LEAST_ROWS_PER_PARAMETER = 3
"""Fewer say nothing about the errors."""
SMALLEST_SINGULAR_VALUE = 0.05
"""Least singular value of columns of unit length; below it the columns cannot be told apart with any certainty."""


@dataclass(frozen=True, eq=False)
class RestoringFit(ReadOnlyArrays):
    """Parameters of one support.

    Attributes
    ----------
    parameters : ndarray, shape (wanted,)
    drift : ndarray, shape (n_columns - wanted,)
        Coefficients of the drift columns.
    covariance : ndarray, shape (wanted, wanted)
        Covariance of the parameters, by the residual with its autocorrelation.
    residual_share
        Standard deviation of the residual over that of the load, behind the band-pass.
    singular_values : ndarray, shape (n_columns,)
        Singular values of the columns scaled to unit length, drift included, descending.
    weakest
        The combination of columns that the data tell least of.
    """

    parameters: Array
    drift: Array
    covariance: Array
    residual_share: float
    singular_values: Array
    weakest: Mapping[str, float]
    rows: int

    def residual(self, support: FilteredSupport) -> Array:
        """Return the load less the fit, at any rows behind the same band-pass, shape (n,)."""
        return np.asarray(support.load - support.columns @ np.concatenate([self.parameters, self.drift]))

    @property
    def identifiable(self) -> bool:
        """True if there are rows enough, and all columns can be told apart."""
        enough = self.rows >= LEAST_ROWS_PER_PARAMETER * self.singular_values.size
        return bool(enough and self.singular_values[-1] >= SMALLEST_SINGULAR_VALUE)


def fit_restoring_force(support: FilteredSupport) -> RestoringFit:
    """Fit by least squares; the covariance allows for autocorrelated residuals.

    Parameters
    ----------
    support
        Support at rows that carry about independent errors, see `rows_of`.

    Returns
    -------
    RestoringFit
        Not `identifiable`, with NaN parameters, where a column is zero throughout or rows are too few.

    Notes
    -----
    Covariance ``(X'X)^-1 S (X'X)^-1`` with S the products of ``x_t r_t`` up to `LAGS_S` apart, weighted by
    Bartlett's triangle (W. K. Newey, K. D. West, Econometrica 55, 1987). Each residual is first divided by one less
    its row's leverage, because the fit is drawn towards rows that weigh much (HC3; J. G. MacKinnon, H. White,
    J. Econometrics 29, 1985); and the sum by ``1 - b + b^2 / 3``, what a triangle that covers the share b of the
    record leaves (the mean of the fixed-b limit, N. M. Kiefer, T. J. Vogelsang, Econometric Theory 21, 2005).
    """
    names, wanted = support.names, support.wanted
    X, y = support.columns, support.load
    length = np.linalg.norm(X, axis=0)
    n, p = X.shape
    if n <= p or not np.all(length > 0):
        unknown = np.full((wanted, wanted), np.nan)
        return RestoringFit(np.full(wanted, np.nan), np.full(p - wanted, np.nan), unknown, np.nan, np.zeros(p), {}, n)
    left, singular, right = np.linalg.svd(X / length, full_matrices=False)
    weakest = dict(zip(names, (float(v) for v in right[-1]), strict=True))
    kept = singular > 1e-9 * singular[0]
    inverse = (right[kept].T / singular[kept]) @ left[:, kept].T / length[:, np.newaxis]
    parameters = inverse @ y
    residual = y - X @ parameters
    spread = float(np.std(y))
    share = float(np.std(residual)) / spread if spread > 0 else np.inf
    leverage = np.minimum((left[:, kept] ** 2).sum(axis=1), LARGEST_LEVERAGE)
    score = inverse * (residual / (1.0 - leverage))
    covariance = score @ score.T
    lags = min(int(LAGS_S / support.step_s), n - 1)
    for lag in range(1, lags + 1):
        product = score[:, lag:] @ score[:, :-lag].T
        covariance += (1.0 - lag / (lags + 1)) * (product + product.T)
    white = inverse @ inverse.T * float(residual @ residual) / (n - p)
    # an estimate by few rows may come out below that of independent errors, which is the least there can be
    b = (lags + 1) / n
    larger = covariance / (1.0 - b + b**2 / 3.0)
    factor = np.sqrt(np.maximum(np.diag(white) / np.maximum(np.diag(larger), 1e-300), 1.0))
    covariance = larger * np.outer(factor, factor)
    return RestoringFit(
        parameters[:wanted], parameters[wanted:], covariance[:wanted, :wanted], share, singular, weakest, n
    )


def rows_of(times_s: Array, interval_s: tuple[float, float], trusted: Flags, low_pass_hz: float) -> Rows:
    """Return evenly spaced rows of an interval, as many as carry errors of their own; shape (n_rows,)."""
    step = float(times_s[1] - times_s[0])
    stride = max(1, int(1.0 / (step * ROWS_PER_CUTOFF * low_pass_hz)))
    first = int(np.searchsorted(times_s, interval_s[0]))
    rows = np.arange(first, int(np.searchsorted(times_s, interval_s[1], side="right")), stride)
    return rows[trusted[rows]]


@dataclass(frozen=True, eq=False)
class RestoringTrace(ReadOnlyArrays):
    """Parameters over time by limited memory.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
        End of each window.
    parameters, u : ndarray, shape (n, wanted)
        NaN where the window says too little, or the support had lifted off; u by the residual's scatter.
    """

    times_s: Array
    parameters: Array
    u: Array
    window_s: float


def trace_restoring_force(support: FilteredSupport, window_s: float) -> RestoringTrace:
    """Fit the last `window_s` alone, at every row.

    Parameters
    ----------
    support
        Support without a high-pass: in a short window a constant takes the drift's place. Rows where the support has
        lifted off are left out.
    """
    X = np.column_stack([support.columns[:, : support.wanted], np.ones(support.load.size)])
    y, step = support.load, support.step_s
    window = max(round(window_s / step), 2 * X.shape[1])
    scale = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    weights = (support.contact > 0.5).astype(np.float64)
    found = limited_memory_least_squares(X / scale, y, window, weights=weights, minimum_count=2 * X.shape[1])
    parameters = found.parameters[:, : support.wanted] / scale[: support.wanted]
    errors = found.standard_errors[:, : support.wanted] / scale[: support.wanted]
    whole = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    u = errors * correlation_factor(whole[weights > 0])
    lost = (found.status != WindowStatus.IDENTIFIED) | (weights == 0)
    parameters[lost], u[lost] = np.nan, np.nan
    return RestoringTrace(support.times_s, parameters, u, window * step)
