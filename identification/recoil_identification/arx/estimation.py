"""Estimation of ARX models, equations (32) to (35), by least squares over a whole record.

A row of the regression exists where all its samples were measured: a lost sample (NaN) leaves out every
row that needs it and is never bridged. `recoil_identification.arx.response` simulates and judges a model,
`recoil_identification.arx.orders` chooses its orders, `recoil_identification.arx.recursive` follows parameters that
change.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_identification.arx.model import ArxModel, ArxOrders
from recoil_identification.memory.least_squares import LeastSquaresFit, least_squares

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def checked_record(input_: ArrayLike, output: ArrayLike) -> tuple[Array, Array]:
    """Check input and output of a system, and take them as float64.

    Raises
    ------
    ValueError
        If they differ in length, have more than one axis, or hold infinite samples.
    TypeError
        If they are complex.
    """
    if np.iscomplexobj(input_) or np.iscomplexobj(output):
        raise TypeError("input and output must be real")
    u, y = np.asarray(input_, dtype=np.float64), np.asarray(output, dtype=np.float64)
    if u.ndim != 1 or u.shape != y.shape:
        raise ValueError(f"input and output must be of one length, found the shapes {u.shape} and {y.shape}")
    if np.isinf(u).any() or np.isinf(y).any():
        raise ValueError("input and output must be finite; a missing sample is NaN")
    return u, y


def arx_regressors(input_: ArrayLike, output: ArrayLike, orders: ArxOrders) -> Array:
    """Set up the rows phi(k) of equation (35).

    Parameters
    ----------
    input_, output : array_like, shape (n_samples,)
        Evenly sampled; NaN for a lost sample. Never modified.

    Returns
    -------
    ndarray, shape (n_samples, n_parameters)
        Row k is ``[-y(k-1) .. -y(k-na), u(k-d) .. u(k-d-nb)]``; NaN where a sample was lost or the
        record had not begun.

    Raises
    ------
    ValueError, TypeError
        As `checked_record`.
    """
    u, y = checked_record(input_, output)
    rows = np.full((u.size, orders.n_parameters), np.nan)
    for i in range(1, orders.na + 1):
        rows[i:, i - 1] = -y[: max(u.size - i, 0)]
    for j in range(orders.nb + 1):
        lag = orders.delay + j
        rows[lag:, orders.na + j] = u[: max(u.size - lag, 0)]
    return rows


def estimate_arx(
    input_: ArrayLike, output: ArrayLike, orders: ArxOrders, *, step_s: float = 1.0, rows: Flags | None = None
) -> ArxModel:
    """Estimate a model from a whole record by orthogonal factorisation.

    Parameters
    ----------
    input_, output : array_like, shape (n_samples,)
        Evenly sampled; NaN for a lost sample. Never modified.
    step_s
        Time between samples.
    rows : ndarray of bool, shape (n_samples,), optional
        Instants whose equations are fitted; their past may lie outside. All if left out.

    Raises
    ------
    ValueError, TypeError
        As `checked_record`; a step that is not positive; flags of another shape.
    IdentificationError
        If there is no number to give: too few rows, an input without signal, or regressors that cannot
        be told apart.
    """
    _, y = checked_record(input_, output)
    if not (math.isfinite(step_s) and step_s > 0.0):
        raise ValueError(f"step_s must be positive, found {step_s}")
    fit = fitted(arx_regressors(input_, y, orders), y, rows)
    return ArxModel(
        orders, fit.parameters, fit.variance * fit.covariance_factor, fit.residual_sum_of_squares, fit.count, step_s
    )


def fitted(regressors: Array, output: Array, rows: Flags | None) -> LeastSquaresFit:
    """Fit the chosen rows.

    Raises
    ------
    ValueError
        For flags of another shape.
    IdentificationError
        As `recoil_identification.memory.least_squares.least_squares`.
    """
    if rows is None:
        return least_squares(regressors, output)
    chosen = np.asarray(rows, dtype=np.bool_)
    if chosen.shape != output.shape:
        raise ValueError(f"rows must have the shape {output.shape}, found {chosen.shape}")
    return least_squares(regressors[chosen], output[chosen])


def residuals(model: ArxModel, input_: ArrayLike, output: ArrayLike) -> Array:
    """Return e(k), the errors of predicting one sample ahead, shape (n_samples,); NaN where a row lacks samples.

    Raises
    ------
    ValueError, TypeError
        As `checked_record`.
    """
    _, y = checked_record(input_, output)
    return np.asarray(y - arx_regressors(input_, y, model.orders) @ model.parameters)


def robust_covariance(
    model: ArxModel, input_: ArrayLike, output: ArrayLike, *, rows: Flags | None = None, lags: int | None = None
) -> Array:
    """Return the parameters' covariance for residuals that are correlated in time and of changing size.

    Bartlett's kernel (W. K. Newey and K. D. West, Econometrica 55, 1987, 703-708), with the factor
    ``N / (N - p)`` for the parameters that were fitted.

    Parameters
    ----------
    input_, output : array_like, shape (n_samples,)
        What it was estimated from.
    rows : ndarray of bool, shape (n_samples,), optional
        As for `estimate_arx`.
    lags
        Samples over which residuals may be correlated; ``4 (N / 100)^(2/9)`` if left out. Lags
        count samples of the record, also across a gap.

    Returns
    -------
    ndarray, shape (n_parameters, n_parameters)

    Raises
    ------
    ValueError
        For negative lags, or as `estimate_arx`.
    """
    _, y = checked_record(input_, output)
    regressors = arx_regressors(input_, y, model.orders)
    factor = fitted(regressors, y, rows).covariance_factor
    scores = regressors * (y - regressors @ model.parameters)[:, np.newaxis]
    present = np.isfinite(scores).all(axis=1)
    if rows is not None:
        present &= rows
    scores[~present] = 0.0
    count = int(present.sum())
    most = int(4.0 * (count / 100.0) ** (2.0 / 9.0)) if lags is None else lags
    if most < 0:
        raise ValueError(f"lags must not be negative, found {most}")
    meat = scores.T @ scores
    for lag in range(1, min(most, y.size - 1) + 1):
        shifted = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (most + 1.0)) * (shifted + shifted.T)
    return np.asarray(factor @ meat @ factor * count / (count - model.orders.n_parameters))
