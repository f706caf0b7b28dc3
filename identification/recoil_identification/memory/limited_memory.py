"""Limited-memory least squares: at every sample a fresh estimate from the last `window` samples alone.

Limited memory (finite history, rectangular sliding window) lets parameters vary while a shot runs. The textbook forms
subtract the row that leaves the window; after a shot of thousands of m/s^2 that leaves round-off which buries the
quiet part that follows. Here nothing is subtracted. The record is cut into blocks as long as the window, so that a
window is the end of one block and the beginning of the next, and running sums of both directions give all windows
(M. van Herk, Pattern Recognition Letters 13, 1992, 517-521, for maxima; any associative operator will do).

Sums of products lose twice the digits that the regressors' condition costs. Windows in which that matters are
factorised from their own rows instead, by orthogonal reflections.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

GUARDED_PIVOT = 1e-4
"""Sums of products serve above this smallest pivot: their relative error, about 30 eps / pivot, is below 1e-10."""
GUARDED_RESIDUAL = 1e-10
"""Sums of products serve above this share of the response's energy left over: it is then right to 1e-5 of itself."""
COLLINEAR_PIVOT = 1e-12
"""Smallest pivot below which the regressors are the same but for round-off in the data themselves."""
NO_ENERGY = 2.0**-300
"""Sum of squares of a regressor or the response, its largest sample scaled to one, below which it is not there."""
NUMBERS_AT_ONCE = 2**21
"""Number of products or rows: what is worked on at a time stays within some tens of megabytes."""


class WindowStatus(IntEnum):
    """Status of a window: identified, or the reason why not."""

    IDENTIFIED = 0
    WINDOW_NOT_FULL = 1
    TOO_FEW_SAMPLES = 2
    NO_EXCITATION = 3
    COLLINEAR = 4


@dataclass(frozen=True, eq=False)
class WindowedEstimates(ReadOnlyArrays):
    """Least-squares estimates of every window of a record; row k belongs to samples ``k - window + 1`` to k.

    Attributes
    ----------
    parameters : ndarray, shape (n_samples, n_parameters)
        Parameters in units of the response per unit of the regressor; NaN where not identified.
    standard_errors : ndarray, shape (n_samples, n_parameters)
        Standard errors of ordinary least squares, ``sqrt(RSS / degrees of freedom * diag((X'WX)^-1))``. They hold for
        errors that are independent from sample to sample: after a low-pass filter they are too small.
    residual_sum_of_squares : ndarray, shape (n_samples,)
        Weighted; NaN where not identified.
    status : ndarray of uint8, shape (n_samples,)
        `WindowStatus`.
    count : ndarray of int64, shape (n_samples,)
        Samples present in the window.
    smallest_pivot : ndarray, shape (n_samples,)
        Least share of a regressor's energy that the regressors before it do not explain, which is one over the
        (uncentred) variance inflation factor; NaN where the window was not tried.
    factorised : ndarray of bool, shape (n_samples,)
        Samples of which the window's own rows were factorised.
    """

    parameters: Array
    standard_errors: Array
    residual_sum_of_squares: Array
    status: NDArray[np.uint8]
    count: NDArray[np.int64]
    smallest_pivot: Array
    factorised: Flags

    @property
    def identified(self) -> Flags:
        """Where there is a number, shape (n_samples,)."""
        return np.equal(self.status, WindowStatus.IDENTIFIED)

    @property
    def degrees_of_freedom(self) -> NDArray[np.int64]:
        """Samples present less parameters, not below zero, shape (n_samples,)."""
        return np.asarray(np.maximum(self.count - self.parameters.shape[1], 0))


@dataclass(frozen=True, eq=False)
class LeastSquaresFit(ReadOnlyArrays):
    """One least-squares estimate.

    Attributes
    ----------
    parameters : ndarray, shape (n_parameters,)
        Parameters in units of the response per unit of the regressor.
    covariance_factor : ndarray, shape (n_parameters, n_parameters)
        ``(X'WX)^-1``: times the variance of a response of weight one, the parameters' covariance.
    residual_sum_of_squares
        Weighted.
    count
        Samples present.
    smallest_pivot
        Smallest pivot, see `WindowedEstimates`.
    """

    parameters: Array
    covariance_factor: Array
    residual_sum_of_squares: float
    count: int
    smallest_pivot: float

    @property
    def variance(self) -> float:
        """Variance of a response of weight one, from the residuals."""
        return self.residual_sum_of_squares / (self.count - self.parameters.size)


def limited_memory_least_squares(
    regressors: ArrayLike,
    response: ArrayLike,
    window: int,
    *,
    weights: ArrayLike | None = None,
    minimum_count: int | None = None,
    partial: bool = False,
) -> WindowedEstimates:
    """Estimate the parameters of ``response = regressors @ parameters`` in every window of a record.

    A row with a NaN, or with weight zero, is a missing sample: it is counted out of the windows that cover it and has
    no effect on any other.

    Parameters
    ----------
    regressors : array_like, shape (n_samples, n_parameters)
        Regressors in any units. Never modified.
    response : array_like, shape (n_samples,)
        Response in any unit. Never modified.
    window
        Samples of a window, at least ``n_parameters + 1``.
    weights : array_like, shape (n_samples,), optional
        Proportional to one over the variance of the response; finite, not negative.
    minimum_count
        Least number of samples present in a window, ``n_parameters + 1`` if omitted.
    partial
        Whether the first ``window - 1`` rows are estimated from the samples that there are.

    Raises
    ------
    ValueError
        For shapes that do not fit, infinite samples, weights that are not finite or negative, or a window or a
        count that is too small.
    TypeError
        For complex samples or a window that is not an integer.

    Notes
    -----
    Samples below 2^-150 of the largest in the record count as zero. Where a regressor is nearly
    constant beside its mean, take the mean off before: the smallest pivot is uncentred.
    """
    rows, present, exponents = _scaled_rows(regressors, response, weights)
    n_parameters, n_samples = rows.shape[0] - 1, rows.shape[1]
    if isinstance(window, bool) or not isinstance(window, int | np.integer):
        raise TypeError(f"window must be an integer number of samples, found {window!r}")
    least = n_parameters + 1
    if window < least:
        raise ValueError(f"the window of {n_parameters} parameters must be at least {least}, found {window}")
    needed = least if minimum_count is None else minimum_count
    if not least <= needed <= window:
        raise ValueError(f"minimum_count must lie between {least} and the window {window}, found {minimum_count}")
    total = np.concatenate([[0], np.cumsum(present, dtype=np.int64)])
    count = total[1:] - total[np.maximum(np.arange(1, n_samples + 1) - window, 0)]
    status = np.where(count < needed, WindowStatus.TOO_FEW_SAMPLES, WindowStatus.IDENTIFIED).astype(np.uint8)
    if not partial:
        status[: window - 1] = WindowStatus.WINDOW_NOT_FULL
    tried = np.equal(status, WindowStatus.IDENTIFIED)
    found = _Solution(
        np.full((n_parameters, n_samples), np.nan),
        np.full((n_parameters, n_samples), np.nan),
        np.full(n_samples, np.nan),
        np.full(n_samples, np.nan),
        np.zeros((n_parameters, n_samples)),
        np.zeros(n_samples),
    )
    # a product too small for float64 is as good as zero in every sum; what overflows is refused below
    with np.errstate(all="ignore"):
        for part, triangles in _by_products(rows, int(window)):
            found.put(part, _solved(triangles))
        there = (found.energies > NO_ENERGY).all(axis=0)
        residual_share = found.residual_sum_of_squares / np.maximum(found.response_energy, np.finfo(float).tiny)
        # where there is no response, nothing is left over: sums of products say so exactly
        precise = (residual_share >= GUARDED_RESIDUAL) | (found.response_energy <= NO_ENERGY)
        sound = (found.smallest_pivot >= GUARDED_PIVOT) & precise
        factorised = np.asarray(tried & there & ~sound)
        for some, triangles in _by_rows(rows, int(window), np.flatnonzero(factorised)):
            found.put(some, _solved(triangles))
        # over the degrees of freedom of at least one: those without are not tried
        variance = found.residual_sum_of_squares / np.maximum(count - n_parameters, 1)
        errors = np.sqrt(variance * found.variance_factors)
        status[tried & ~(found.smallest_pivot >= COLLINEAR_PIVOT)] = WindowStatus.COLLINEAR
        status[tried & ~there] = WindowStatus.NO_EXCITATION
        parameters = _ldexp(found.parameters, exponents[-1] - exponents[:-1, np.newaxis])
        errors = _ldexp(errors, exponents[-1] - exponents[:-1, np.newaxis])
        residual = _ldexp(found.residual_sum_of_squares, 2 * exponents[-1])
    status[np.equal(status, WindowStatus.IDENTIFIED) & ~np.isfinite(parameters + errors).all(axis=0)] = (
        WindowStatus.COLLINEAR
    )
    lost = ~np.equal(status, WindowStatus.IDENTIFIED)
    for values in (parameters, errors, residual):
        values[..., lost] = np.nan
    pivots = np.where(tried, np.where(there, found.smallest_pivot, 0.0), np.nan)
    return WindowedEstimates(parameters.T, errors.T, residual, status, count, pivots, factorised)


def least_squares(regressors: ArrayLike, response: ArrayLike, weights: ArrayLike | None = None) -> LeastSquaresFit:
    """Estimate the parameters of ``response = regressors @ parameters`` from all rows, by orthogonal reflections.

    Parameters
    ----------
    regressors : array_like, shape (n_samples, n_parameters)
        Regressors in any units. A row with a NaN is a missing sample. Never modified.
    response : array_like, shape (n_samples,)
        Response in any unit; NaN is a missing sample. Never modified.
    weights : array_like, shape (n_samples,), optional
        Proportional to one over the variance of the response; zero is a missing sample.

    Raises
    ------
    ValueError, TypeError
        As `limited_memory_least_squares`.
    IdentificationError
        If there is no number to give: too few samples, a regressor that is zero, or regressors that
        cannot be told apart.
    """
    rows, present, exponents = _scaled_rows(regressors, response, weights)
    n_parameters, count = rows.shape[0] - 1, int(present.sum())
    if count <= n_parameters:
        raise IdentificationError(
            "too few samples for a regression", expected=f"{n_parameters + 1} or more present", found=str(count)
        )
    with np.errstate(under="ignore"):
        ((_, triangle),) = _by_rows(rows[:, present], count, np.array([count - 1]))
        one = _solved(triangle)
    if not (one.energies > 0.0).all():
        idle = ", ".join(str(j) for j in np.flatnonzero(one.energies[:, 0] == 0.0))
        raise IdentificationError(
            "a regressor carries no signal", expected="a signal in every one", found=f"number {idle} zero throughout"
        )
    if one.smallest_pivot[0] < COLLINEAR_PIVOT:
        raise IdentificationError(
            "the regressors cannot be told apart",
            expected=f"a smallest pivot of {COLLINEAR_PIVOT:g} or more",
            found=f"{one.smallest_pivot[0]:.1e}",
            remedy="leave one out, or take an interval in which they differ",
        )
    inverse = _ldexp(np.asarray(np.linalg.inv(triangle[:-1, :-1, 0]), dtype=np.float64), -exponents[:-1, np.newaxis])
    return LeastSquaresFit(
        parameters=_ldexp(one.parameters[:, 0], exponents[-1] - exponents[:-1]),
        covariance_factor=inverse @ inverse.T,
        residual_sum_of_squares=float(np.ldexp(one.residual_sum_of_squares[0], 2 * exponents[-1])),
        count=count,
        smallest_pivot=float(one.smallest_pivot[0]),
    )


def window_sums(values: Array, window: int) -> Array:
    """Sum the last `window` samples at every sample, without subtracting any.

    Parameters
    ----------
    values : ndarray, shape (..., n_samples)

    Returns
    -------
    ndarray, shape (..., n_samples)
        Result of the samples that there are, where there are fewer.
    """
    *lead, n_samples = values.shape
    block = min(window, max(n_samples, 1))
    blocks = np.zeros((*lead, 1 - (-n_samples // block), block))
    blocks.reshape(*lead, -1)[..., block : block + n_samples] = values
    sums = np.cumsum(blocks[..., 1:, :], axis=-1)
    sums[..., :-1] += np.cumsum(blocks[..., :-1, :0:-1], axis=-1)[..., ::-1]
    return sums.reshape(*lead, -1)[..., :n_samples]


class _Solution(NamedTuple):
    """Least-squares solutions of many windows, these last: variance factors are the diagonal of ``(X'X)^-1``."""

    parameters: Array
    variance_factors: Array
    residual_sum_of_squares: Array
    response_energy: Array
    energies: Array
    smallest_pivot: Array

    def put(self, windows: slice | NDArray[np.intp], other: _Solution) -> None:
        """Overwrite some windows."""
        for mine, theirs in zip(self, other, strict=True):
            mine[..., windows] = theirs


def _scaled_rows(
    regressors: ArrayLike, response: ArrayLike, weights: ArrayLike | None
) -> tuple[Array, Flags, NDArray[np.int64]]:
    """Check samples, and return [X | y] weighted and scaled by powers of two, shape (n_parameters + 1, n_samples).

    Beside it which samples are present, the others being zero, and the exponents of the scales.
    """
    if any(np.iscomplexobj(values) for values in (regressors, response, weights) if values is not None):
        raise TypeError("regressors, response and weights must be real")
    columns, output = np.asarray(regressors, dtype=np.float64), np.asarray(response, dtype=np.float64)
    if columns.ndim != 2 or columns.shape[1] < 1:
        raise ValueError(f"regressors must have the shape (n_samples, n_parameters), found {columns.shape}")
    if output.shape != columns.shape[:1]:
        raise ValueError(f"response must have the shape {columns.shape[:1]}, found {output.shape}")
    rows = np.vstack([columns.T, output])
    present = ~np.isnan(rows).any(axis=0)
    weight = None if weights is None else np.asarray(weights, dtype=np.float64)
    if weight is not None:
        if weight.shape != output.shape:
            raise ValueError(f"weights must have the shape {output.shape}, found {weight.shape}")
        if not (np.isfinite(weight) & (weight >= 0.0)).all():
            raise ValueError("weights must be finite and not negative")
        present &= weight > 0.0
    rows[:, ~present] = 0.0
    if np.isinf(columns).any() or np.isinf(output).any():
        raise ValueError("regressors and response must be finite; a missing sample is NaN")
    # the weight's root before the scale: what is scaled is what is summed
    with np.errstate(under="ignore"):
        if weight is not None:
            rows *= np.sqrt(weight)
        exponents = np.frexp(np.abs(rows).max(axis=1, initial=0.0))[1].astype(np.int64)
        return _ldexp(rows, -exponents[:, np.newaxis]), np.asarray(present), exponents


def _ldexp(values: Array, exponents: NDArray[np.int64]) -> Array:
    """Multiply by powers of two, in two steps: one alone may leave float64 where the product does not."""
    half = exponents // 2
    return np.asarray(np.ldexp(np.ldexp(values, half), exponents - half))


def _by_products(rows: Array, window: int) -> Iterator[tuple[slice, Array]]:
    """Factorise every window from sums of products, some blocks at a time.

    Yields
    ------
    windows : slice
    triangles : ndarray, shape (n_columns, n_columns, n_windows)
        Cholesky's, upper; below their diagonals is nothing of use.
    """
    n_columns, n_samples = rows.shape
    block = min(window, max(n_samples, 1))
    at_once = block * max(1, NUMBERS_AT_ONCE // (n_columns**2 * block))
    for first in range(0, n_samples, at_once):
        lead = min(first, block)
        part = rows[:, first - lead : first + at_once]
        gram = window_sums(part[:, np.newaxis] * part, window)[..., lead:]
        for j in range(n_columns):
            pivot = np.sqrt(np.maximum(gram[j, j], 0.0))
            gram[j, j] = pivot
            gram[j, j + 1 :] *= np.divide(1.0, pivot, out=np.zeros_like(pivot), where=pivot > 0.0)
            for k in range(j + 1, n_columns):
                gram[k, k:] -= gram[j, k] * gram[j, k:]
        yield slice(first, first + gram.shape[-1]), gram


def _by_rows(rows: Array, window: int, windows: NDArray[np.intp]) -> Iterator[tuple[NDArray[np.intp], Array]]:
    """Factorise chosen windows from their own rows by reflections, some at a time; yields as `_by_products`.

    The rows of the largest magnitude come first. In this order small rows that share a window with large ones keep
    their own accuracy; the other way round they are left with the large rows' (A. J. Cox and N. J. Higham, "Stability
    of Householder QR factorization for weighted least squares problems", 1998). Binary orders of magnitude will do:
    in whatever order rows stand within one, it costs a factor of two at the most.
    """
    n_columns, n_samples = rows.shape
    block = min(window, n_samples)
    before = np.zeros((max(block - 1, 0) + n_samples, n_columns))
    before[before.shape[0] - n_samples :] = rows.T
    # 16-bit integers are sorted in two passes, floats take ten times as long; rows of zeros may stand anywhere
    smallness = -np.frexp(np.abs(before).max(axis=1))[1].astype(np.int16)
    at_once = max(1, NUMBERS_AT_ONCE // (n_columns * max(block, 1)))
    for start in range(0, windows.size, at_once):
        some = windows[start : start + at_once]
        order = np.argsort(np.lib.stride_tricks.sliding_window_view(smallness, block)[some], axis=1, kind="stable")
        order += some[:, np.newaxis]
        yield some, np.moveaxis(np.asarray(np.linalg.qr(before[order], mode="r")), 0, -1)


def _solved(triangles: Array) -> _Solution:
    """Solve from the triangular factors of [X | y].

    Parameters
    ----------
    triangles : ndarray, shape (n_columns, n_columns, n_windows)
        Upper; what stands below the diagonals does not count.
    """
    n = triangles.shape[0] - 1
    squares = triangles**2
    energies = np.array([squares[: j + 1, j].sum(axis=0) for j in range(n)])
    pivots = np.array([squares[j, j] for j in range(n)])
    share = np.divide(pivots, energies, out=np.zeros_like(pivots), where=energies > 0.0)
    # the unit vectors and y as right sides: they become the inverse and the parameters
    right = np.zeros((n, n + 1, triangles.shape[-1]))
    right[:, n] = triangles[:n, n]
    for j in reversed(range(n)):
        right[j, j] = 1.0
        for k in range(j + 1, n):
            right[j] -= triangles[j, k] * right[k]
        right[j] *= np.divide(1.0, triangles[j, j], out=np.zeros_like(pivots[j]), where=triangles[j, j] != 0.0)
    variance_factors = (right[:, :n] ** 2).sum(axis=1)
    return _Solution(
        right[:, n], variance_factors, squares[n, n], squares[:, n].sum(axis=0), energies, share.min(axis=0)
    )
