"""Triangular factors of every sliding window, by aggregation in two stacks and never by subtraction.

The record is cut into blocks as long as the window. A window is then a suffix of one block and a
prefix of the next, so two running aggregates per block and one merge per window give all windows
(M. van Herk, Pattern Recognition Letters 13, 1992, 517-521, for maxima; any associative operator will
do). A row that has left the window has left no round-off behind, which downdating cannot promise.

Two operators: sums of products (Gram), quick, whose error grows with the square of the condition
number; and square-root-free Givens rotations (W. M. Gentleman, J. Inst. Maths Applics 12, 1973,
329-336), whose error grows with the condition number itself. Both end in the factor

    Z'Z = U' D U,  Z = [X | y],  U unit upper triangular,  D diagonal,

stored packed by rows, ``D_0, U_01, .. U_0p, D_1, U_12, ..``, one column for each window. Its last
pivot is the residual sum of squares, without the cancellation of y'y - theta'X'y.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

EMPTY_PIVOT = 1e-300
"""Pivot of a factor that has seen nothing: no division needs a guard, and it weighs nothing."""
NO_ENERGY = 1e-200
"""Energy of a regressor, scaled to one at its largest, below which it is not there."""
PIVOT_FLOOR = 1e-18
"""Least share of a pivot in its column's energy in the back-substitution; far below any accepted one."""


def packed_rows(n_columns: int) -> list[slice]:
    """Place the rows of a packed upper triangle, diagonal first.

    Parameters
    ----------
    n_columns : int

    Returns
    -------
    list of slice
    """
    starts = [j * n_columns - j * (j - 1) // 2 for j in range(n_columns + 1)]
    return [slice(start, stop) for start, stop in pairwise(starts)]


@dataclass(frozen=True, eq=False)
class Solution:
    """Least-squares solution of many windows.

    Attributes
    ----------
    parameters, variance_factors : ndarray, shape (n_parameters, n_windows)
        Estimates, and the diagonal of (X'X)^-1.
    energies : ndarray, shape (n_parameters, n_windows)
        Sum of squares of each regressor.
    residual_sum_of_squares, response_energy : ndarray, shape (n_windows,)
    smallest_pivot : ndarray, shape (n_windows,)
        min_j D_j / energy_j; 0 where a regressor has no energy.
    """

    parameters: FloatArray
    variance_factors: FloatArray
    energies: FloatArray
    residual_sum_of_squares: FloatArray
    response_energy: FloatArray
    smallest_pivot: FloatArray


def gram_of_windows(rows: FloatArray) -> FloatArray:
    """Sum products over every window that ends in a run of blocks.

    Parameters
    ----------
    rows : ndarray, shape (n_columns, n_blocks + 1, block)
        Columns of [X | y] of the blocks and of the one before; zero where there is no sample.

    Returns
    -------
    ndarray, shape (n_packed, n_blocks * block)
        Upper triangle of Z'Z, packed by rows.
    """
    n_columns, n_blocks, block = rows.shape
    triangle = packed_rows(n_columns)
    products = np.empty((triangle[-1].stop, n_blocks, block))
    for j, row in enumerate(triangle):
        np.multiply(rows[j], rows[j:], out=products[row])
    windows = np.cumsum(products[:, 1:], axis=-1)
    windows[..., :-1] += np.cumsum(products[:, :-1, :0:-1], axis=-1)[..., ::-1]
    return windows.reshape(triangle[-1].stop, -1)


def solve_gram(gram: FloatArray, n_columns: int) -> Solution:
    """Factorise packed sums of products in place, and solve.

    Parameters
    ----------
    gram : ndarray, shape (n_packed, n_windows)
        Overwritten.
    n_columns : int
        Parameters plus one.

    Returns
    -------
    Solution
    """
    triangle = packed_rows(n_columns)
    energies = gram[[row.start for row in triangle]]
    for j, row in enumerate(triangle[:-1]):
        right = gram[row.start + 1 : row.stop]
        _lift(gram[row.start], energies[j])
        scaled = right / gram[row.start]
        for k in range(j + 1, n_columns):
            gram[triangle[k]] -= scaled[k - j - 1] * right[k - j - 1 :]
        right[:] = scaled
    return _solve(gram, energies)


def qr_of_runs(rows: FloatArray) -> FloatArray:
    """Factorise every beginning of every run of rows.

    Parameters
    ----------
    rows : ndarray, shape (n_columns, n_runs, length)
        Columns of [X | y].

    Returns
    -------
    ndarray, shape (length + 1, n_packed, n_runs)
        Entry r is the factor of the first r rows.
    """
    n_columns, n_runs, length = rows.shape
    factors = np.empty((length + 1, packed_rows(n_columns)[-1].stop, n_runs))
    factors[0] = empty_factor(n_columns, n_runs)
    by_position = np.ascontiguousarray(np.moveaxis(rows, -1, 0))
    for position in range(length):
        factors[position + 1] = factors[position]
        _absorb(factors[position + 1], np.ones(n_runs), by_position[position], 0)
    return factors


def empty_factor(n_columns: int, n_windows: int) -> FloatArray:
    """Build factors that have seen no row.

    Parameters
    ----------
    n_columns, n_windows : int

    Returns
    -------
    ndarray, shape (n_packed, n_windows)
    """
    triangle = packed_rows(n_columns)
    factor = np.zeros((triangle[-1].stop, n_windows))
    factor[[row.start for row in triangle]] = EMPTY_PIVOT
    return factor


def merge_factors(factor: FloatArray, other: FloatArray, n_columns: int) -> None:
    """Take the rows behind other factors into factors, in place.

    Parameters
    ----------
    factor, other : ndarray, shape (n_packed, n_windows)
        The first is overwritten by the factor of the rows of both.
    n_columns : int
    """
    for j, row in enumerate(packed_rows(n_columns)):
        unit_row = other[row].copy()
        unit_row[0] = 1.0
        _absorb(factor, other[row.start].copy(), unit_row, j)


def solve_qr(factor: FloatArray, n_columns: int) -> Solution:
    """Solve from packed factors, in place.

    Parameters
    ----------
    factor : ndarray, shape (n_packed, n_windows)
        Overwritten.
    n_columns : int
        Parameters plus one.

    Returns
    -------
    Solution
    """
    energies = np.zeros((n_columns, factor.shape[1]))
    for j, row in enumerate(packed_rows(n_columns)):
        pivot, right = factor[row.start], factor[row.start + 1 : row.stop]
        energies[j] += pivot
        energies[j + 1 :] += right * right * pivot
        if j < n_columns - 1:
            _lift(factor[row.start], energies[j])
    return _solve(factor, energies)


def largest_first(rows: FloatArray) -> FloatArray:
    """Sort rows by their largest magnitude, descending.

    Reflections of rows in this order leave small rows that share a window with large ones their own
    accuracy; the other way round they are left with the large rows' (A. J. Cox and N. J. Higham,
    "Stability of Householder QR factorization for weighted least squares problems", 1998).

    Parameters
    ----------
    rows : ndarray, shape (n_rows, n_columns)

    Returns
    -------
    ndarray, shape (n_rows, n_columns)
    """
    return np.asarray(rows[np.argsort(-np.abs(rows).max(axis=1), kind="stable")])


def triangle_of_rows(rows: FloatArray) -> FloatArray:
    """Factorise one set of rows by Householder reflections.

    Parameters
    ----------
    rows : ndarray, shape (n_rows, n_columns)
        In any order.

    Returns
    -------
    ndarray, shape (n_packed, 1)
    """
    n_columns = rows.shape[1]
    reflected = np.asarray(np.linalg.qr(largest_first(rows), mode="r"))
    upper = np.zeros((n_columns, n_columns))
    upper[: reflected.shape[0]] = reflected
    factor = empty_factor(n_columns, 1)
    for j, row in enumerate(packed_rows(n_columns)):
        if upper[j, j] ** 2 > EMPTY_PIVOT:
            factor[row, 0] = upper[j, j:] / upper[j, j]
            factor[row.start, 0] = upper[j, j] ** 2
    return factor


def _absorb(factor: FloatArray, weight: FloatArray, row: FloatArray, first: int) -> None:
    """Rotate one row, whose columns begin at `first`, into every factor; all arguments are consumed."""
    n_columns = first + row.shape[0]
    for j, place in enumerate(packed_rows(n_columns)[first:]):
        entry, rest = row[j], row[j + 1 :]
        pivot, right = factor[place.start], factor[place.start + 1 : place.stop]
        weighted = weight * entry
        total = weighted * entry
        total += pivot
        cosine, sine = pivot / total, weighted / total
        pivot[:] = total
        weight *= cosine
        # the form with three products: the cheaper one with two cancels when a large row meets a small pivot
        explained = entry * right
        right *= cosine
        right += sine * rest
        rest -= explained


def _lift(pivot: FloatArray, energy: FloatArray) -> None:
    """Lift the pivots of windows without a number off zero, in place, so that they can be divided by."""
    np.maximum(pivot, PIVOT_FLOOR * energy, out=pivot)
    pivot[energy <= NO_ENERGY] = 1.0


def _solve(factor: FloatArray, energies: FloatArray) -> Solution:
    """Solve from factors whose pivots are lifted.

    U is inverted in place to W: with y as the last column, that column of W is -theta, and the rows
    give diag((X'X)^-1)_j = sum_k W_jk^2 / D_k.
    """
    n_columns, n_windows = energies.shape
    n_parameters = n_columns - 1
    triangle = packed_rows(n_columns)
    smallest_pivot = np.ones(n_windows)
    precisions = np.empty((n_parameters, n_windows))
    parameters, variance_factors = np.empty_like(precisions), np.empty_like(precisions)
    for j in range(n_parameters - 1, -1, -1):
        pivot, inverse = factor[triangle[j].start], factor[triangle[j].start + 1 : triangle[j].stop]
        upper = inverse[:-1].copy()
        np.negative(inverse, out=inverse)
        for i in range(j + 1, n_parameters):
            inverse[i - j :] -= upper[i - j - 1] * factor[triangle[i].start + 1 : triangle[i].stop]
        np.negative(inverse[-1], out=parameters[j])
        np.divide(1.0, pivot, out=precisions[j])
        variance_factors[j] = precisions[j]
        for k in range(j + 1, n_parameters):
            variance_factors[j] += inverse[k - j - 1] ** 2 * precisions[k]
        share = np.where(energies[j] > NO_ENERGY, pivot, 0.0) / np.maximum(energies[j], NO_ENERGY)
        np.minimum(smallest_pivot, share, out=smallest_pivot)
    return Solution(
        parameters=parameters,
        variance_factors=variance_factors,
        energies=np.where(energies[:-1] > NO_ENERGY, energies[:-1], 0.0),
        residual_sum_of_squares=np.maximum(factor[-1], 0.0),
        response_energy=energies[-1],
        smallest_pivot=smallest_pivot,
    )
