"""ARX models whose parameters change while a record runs: finite history, and forgetting.

Finite history is the limited-memory least squares of `recoil_identification.memory.limited_memory` on the rows of the
model. Forgetting weighs a row by how long ago it was taken: ``lambda`` to the power of the rows since.
The textbook recursion carries the covariance and subtracts from it at every sample; it drifts, and
while the input is silent the covariance grows without bound until the next noise sample blows the
parameters up (wind-up). Here the triangular factor of the weighted rows is carried: nothing is subtracted,
and forgetting stops where the memory would otherwise keep less than a given excitation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_identification.arx.estimation import arx_regressors, checked_record
from recoil_identification.arx.model import ArxOrders
from recoil_identification.memory.limited_memory import WindowedEstimates, limited_memory_least_squares
from recoil_identification.memory.samples import ScaledRecord
from recoil_identification.memory.windowed_estimates import COLLINEAR_PIVOT, WindowStatus
from recoil_identification.memory.windows import empty_factor, merge_factors, packed_rows, qr_of_runs, solve_qr

Array = NDArray[np.float64]

BLOCK = 128
"""Rows of a block at most; blocks are factorised side by side."""
LARGEST_WEIGHT_RATIO = 1e12
"""Of the weights within a block: beyond it the block is made shorter."""


@dataclass(frozen=True, eq=False)
class ForgettingEstimates:
    """Estimates at every sample, from all samples up to it with fading weights.

    Attributes
    ----------
    parameters, standard_errors : ndarray, shape (n_samples, n_parameters)
        NaN where not identified. The standard errors hold for white residuals.
    covariance : ndarray, shape (n_samples, n_parameters, n_parameters)
        Of the parameters.
    noise_variance : ndarray, shape (n_samples,)
        Of the residuals, squared units of the output.
    effective_samples : ndarray, shape (n_samples,)
        ``(sum w)^2 / sum w^2`` of the weights.
    forgot : ndarray of bool, shape (n_samples,)
        False where forgetting stood still for want of excitation, or for want of a row.
    status : ndarray of uint8, shape (n_samples,)
        `WindowStatus`.
    """

    orders: ArxOrders
    parameters: Array
    covariance: Array
    noise_variance: Array
    effective_samples: Array
    forgot: NDArray[np.bool_]
    status: NDArray[np.uint8]

    @property
    def standard_errors(self) -> Array:
        """Square roots of the covariance's diagonal, shape (n_samples, n_parameters)."""
        return np.asarray(np.sqrt(np.einsum("kii->ki", self.covariance)))

    @property
    def identified(self) -> NDArray[np.bool_]:
        """Where there is a number, shape (n_samples,)."""
        return np.equal(self.status, WindowStatus.IDENTIFIED)


def finite_history_arx(
    input_: ArrayLike,
    output: ArrayLike,
    orders: ArxOrders,
    window: int,
    *,
    min_excitation: float | ArrayLike | None = None,
    max_relative_error: float | None = None,
    partial: bool = False,
) -> WindowedEstimates:
    """Estimate a model at every sample from the last `window` rows alone.

    Parameters
    ----------
    input_, output : array_like, shape (n_samples,)
        Evenly sampled; NaN for a lost sample. Never modified.
    window
        Samples, at least ``n_parameters + 1``.
    min_excitation, max_relative_error, partial
        As for `limited_memory_least_squares`.

    Returns
    -------
    WindowedEstimates
        Row k from the equations of samples ``k - window + 1`` to k.

    Raises
    ------
    ValueError, TypeError
        As `recoil_identification.arx.estimation.checked_record` and `limited_memory_least_squares`.
    """
    _, y = checked_record(input_, output)
    rows = arx_regressors(input_, y, orders)
    return limited_memory_least_squares(
        rows, y, window, min_excitation=min_excitation, max_relative_error=max_relative_error, partial=partial
    )


def forgetting_arx(
    input_: ArrayLike,
    output: ArrayLike,
    orders: ArxOrders,
    forgetting: float,
    *,
    min_excitation: float | ArrayLike = 0.0,
) -> ForgettingEstimates:
    """Estimate a model at every sample from all rows up to it, each weighted by `forgetting` per row since.

    Parameters
    ----------
    input_, output : array_like, shape (n_samples,)
        Evenly sampled; NaN for a lost sample. A row with one is left out, and nothing is forgotten for it.
        Never modified.
    forgetting
        Above 0, at most 1; the memory is about ``1 / (1 - forgetting)`` rows, all of them for 1.
    min_excitation : float or array_like, shape (n_parameters,)
        Weighted sum of squares of each regressor that the memory keeps at least: where forgetting would go
        below one of them, it stands still, and the row is taken in.

    Raises
    ------
    ValueError
        For a forgetting factor or an excitation out of range, or as `arx.estimation.checked_record`.
    TypeError
        As `recoil_identification.arx.estimation.checked_record`.

    Notes
    -----
    The weights are no variances, so the covariance is ``s^2 P (X'W^2X) P`` with ``P = (X'WX)^-1``; the
    noise variance is ``RSS / (sum w - trace(P X'W^2X))``. Both are exact for white residuals and
    regressors that are known.
    """
    _, y = checked_record(input_, output)
    if not 0.0 < forgetting <= 1.0:
        raise ValueError(f"forgetting must be above 0 and at most 1, found {forgetting}")
    least = np.asarray(min_excitation, dtype=np.float64)
    if least.shape not in ((), (orders.n_parameters,)) or not (np.isfinite(least) & (least >= 0.0)).all():
        raise ValueError(f"min_excitation must be one number or {orders.n_parameters}, finite and not negative")
    rows = arx_regressors(input_, y, orders)
    steepest = -2.0 * math.log(forgetting)
    # as many rows one after the other as blocks: neither loop is long
    block = max(1, min(BLOCK, math.isqrt(y.size)))
    if steepest > 0.0:
        block = max(1, min(block, int(math.log(LARGEST_WEIGHT_RATIO) / steepest)))
    record = ScaledRecord.of(rows, y, None, block)
    factors = _faded(rows, record, forgetting, np.broadcast_to(least, (orders.n_parameters,)))
    return _estimates(orders, record, factors)


@dataclass(frozen=True, eq=False)
class _Faded:
    """Weights' logarithms, and the packed factors of the rows weighted once and twice, shape (n_packed, n)."""

    forgot: NDArray[np.bool_]
    weight_sum: Array
    square_sum: Array
    once: Array
    twice: Array


def _faded(rows: Array, record: ScaledRecord, forgetting: float, least: Array) -> _Faded:
    """Weigh and factorise.

    With L_k the sum of ln(lambda) up to sample k, row i has the weight ``exp(L_k - L_i)``. Within a block
    the rows are weighted by ``exp(L_first - L_i)``; a factor of them is brought up to date by its pivots
    alone, which are proportional to the weights.
    """
    n, n_columns, block = record.n_samples, record.n_columns, record.block
    forgot, weight_sum, square_sum = _memory(rows, record.present, forgetting, least)
    padding = record.n_blocks * block - n
    logs = np.cumsum(np.append(np.where(forgot, math.log(forgetting), 0.0), np.zeros(padding)))
    logs = logs.reshape(record.n_blocks, block)
    once, twice = (_factors(record.rows(0, record.n_blocks), power * logs, n_columns)[:, :n] for power in (1.0, 2.0))
    return _Faded(forgot, weight_sum, square_sum, once, twice)


def _factors(rows: Array, logs: Array, n_columns: int) -> Array:
    """Factorise every beginning of a record, shape (n_packed, n_blocks * block)."""
    n_blocks, block = logs.shape
    own = logs - logs[:, :1]
    beginnings = qr_of_runs(rows * np.exp(-0.5 * own))[1:]
    carried, carried_log = empty_factor(n_columns, 1), 0.0
    factors = np.empty((carried.shape[0], n_blocks * block))
    for k in range(n_blocks):
        factor = np.ascontiguousarray(beginnings[:, :, k].T)
        _rescale(factor, own[k], n_columns)
        before = np.repeat(carried, block, axis=1)
        _rescale(before, logs[k] - carried_log, n_columns)
        merge_factors(factor, before, n_columns)
        factors[:, k * block : (k + 1) * block] = factor
        carried, carried_log = factor[:, -1:].copy(), float(logs[k, -1])
    return factors


def _memory(
    rows: Array, present: NDArray[np.bool_], forgetting: float, least: Array
) -> tuple[NDArray[np.bool_], Array, Array]:
    """Decide sample by sample whether to forget; return that, and the sums of weights and of their squares."""
    n = present.size
    forgot, weight_sum, square_sum = np.zeros(n, dtype=np.bool_), np.zeros(n), np.zeros(n)
    energy, total, squares = np.zeros(least.size), 0.0, 0.0
    for k in np.flatnonzero(present):
        new = rows[k] ** 2
        faded = forgetting * energy + new
        forgot[k] = bool((faded >= least).all())
        factor = forgetting if forgot[k] else 1.0
        energy = faded if forgot[k] else energy + new
        total, squares = factor * total + 1.0, factor**2 * squares + 1.0
        weight_sum[k], square_sum[k] = total, squares
    # a missing row leaves the memory as it was
    last = np.maximum.accumulate(np.where(present, np.arange(n), -1)) if n else np.zeros(0, dtype=np.int64)
    seen = last >= 0
    for sums in (weight_sum, square_sum):
        sums[seen] = sums[last[seen]]
    return forgot, weight_sum, square_sum


def _rescale(factor: Array, log_weights: Array, n_columns: int) -> None:
    """Multiply the weights of all rows behind factors, in place: only their pivots change."""
    scale = np.exp(log_weights)
    for row in packed_rows(n_columns):
        factor[row.start] *= scale


def _estimates(orders: ArxOrders, record: ScaledRecord, faded: _Faded) -> ForgettingEstimates:
    """Solve at every sample, and put the numbers back into the caller's units."""
    n, p = record.n_samples, orders.n_parameters
    upper_once, pivots_once = _unpacked(faded.once, p + 1)
    upper_twice, pivots_twice = _unpacked(faded.twice, p + 1)
    solution = solve_qr(faded.once.copy(), p + 1)
    enough = np.cumsum(record.present) > p
    status = np.full(n, WindowStatus.TOO_FEW_SAMPLES, dtype=np.uint8)
    status[enough] = WindowStatus.IDENTIFIED
    status[enough & (solution.smallest_pivot < COLLINEAR_PIVOT)] = WindowStatus.COLLINEAR
    status[enough & ~(solution.energies > 0.0).all(axis=0)] = WindowStatus.NO_EXCITATION
    good = np.equal(status, WindowStatus.IDENTIFIED)
    # R'R = X'WX and S'S = X'W^2X:  P S'S P = (R^-1 R^-T S')(..)'
    R = np.sqrt(pivots_once[good, :p, np.newaxis]) * upper_once[good, :p, :p]
    S = np.sqrt(pivots_twice[good, :p, np.newaxis]) * upper_twice[good, :p, :p]
    spread = np.linalg.solve(R.swapaxes(1, 2), S.swapaxes(1, 2))
    fitted = (spread**2).sum(axis=(1, 2))
    spread = np.linalg.solve(R, spread)
    freedom = faded.weight_sum[good] - fitted
    noise = np.where(
        freedom > 0.0, solution.residual_sum_of_squares[good] / np.where(freedom > 0, freedom, 1.0), np.nan
    )
    unit = np.ldexp(1.0, record.exponents[-1] - record.exponents[:-1])
    parameters, covariance = np.full((n, p), np.nan), np.full((n, p, p), np.nan)
    variance = np.full(n, np.nan)
    parameters[good] = solution.parameters.T[good] * unit
    covariance[good] = noise[:, None, None] * (spread @ spread.swapaxes(1, 2)) * np.outer(unit, unit)
    variance[good] = np.ldexp(noise, 2 * int(record.exponents[-1]))
    seen = faded.square_sum > 0.0
    effective = np.where(seen, faded.weight_sum**2 / np.where(seen, faded.square_sum, 1.0), 0.0)
    return ForgettingEstimates(orders, parameters, covariance, variance, effective, faded.forgot, status)


def _unpacked(factor: Array, n_columns: int) -> tuple[Array, Array]:
    """Return U with its unit diagonal, shape (n, n_columns, n_columns), and D, shape (n, n_columns)."""
    upper = np.zeros((factor.shape[1], n_columns, n_columns))
    pivots = np.empty((factor.shape[1], n_columns))
    for j, row in enumerate(packed_rows(n_columns)):
        pivots[:, j] = factor[row.start]
        upper[:, j, j] = 1.0
        upper[:, j, j + 1 :] = factor[row.start + 1 : row.stop].T
    return upper, pivots
