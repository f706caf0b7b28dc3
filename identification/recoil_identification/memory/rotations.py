"""Triangular factors of runs of rows by square-root-free Givens rotations, and their merging.

The error grows with the condition number of the regressors, not with its square as that of sums of products does
(W. M. Gentleman, J. Inst. Maths Applics 12, 1973, 329-336). The factors are those that `window_factors` describes.
"""

from __future__ import annotations

import numpy as np

from recoil_identification.memory.window_factors import FloatArray, Packing, Solution, lift, solve_factors

EMPTY_PIVOT = 1e-300
"""Pivot of a factor that has seen nothing: no division needs a guard, and it weighs nothing."""


def qr_of_runs(rows: FloatArray, packing: Packing) -> FloatArray:
    """Factorise every beginning of every run of rows.

    Parameters
    ----------
    rows : ndarray, shape (n_columns, n_runs, length)
        Columns of [X | Y].

    Returns
    -------
    ndarray, shape (length + 1, n_entries, n_runs)
        Entry r is the factor of the first r rows.
    """
    _, n_runs, length = rows.shape
    factors = np.empty((length + 1, packing.n_entries, n_runs))
    factors[0] = empty_factor(packing, n_runs)
    by_position = np.ascontiguousarray(np.moveaxis(rows, -1, 0))
    for position in range(length):
        factors[position + 1] = factors[position]
        _absorb(factors[position + 1], np.ones(n_runs), by_position[position], 0, packing)
    return factors


def empty_factor(packing: Packing, n_windows: int) -> FloatArray:
    """Build factors that have seen no row.

    Returns
    -------
    ndarray, shape (n_entries, n_windows)
    """
    factor = np.zeros((packing.n_entries, n_windows))
    factor[packing.pivots] = EMPTY_PIVOT
    return factor


def merge_factors(factor: FloatArray, other: FloatArray, packing: Packing) -> None:
    """Take the rows behind other factors into factors, in place.

    Parameters
    ----------
    factor, other : ndarray, shape (n_entries, n_windows)
        The first is overwritten by the factor of the rows of both.
    """
    for j, row in enumerate(packing.rows):
        unit_row = other[row].copy()
        unit_row[0] = 1.0
        _absorb(factor, other[row.start].copy(), unit_row, j, packing)
    factor[packing.outputs] += other[packing.outputs]


def solve_qr(factor: FloatArray, packing: Packing) -> Solution:
    """Solve from packed factors, in place.

    Parameters
    ----------
    factor : ndarray, shape (n_entries, n_windows)
        Overwritten.
    """
    n_parameters = packing.n_parameters
    energies = np.zeros((packing.n_columns, factor.shape[1]))
    for j, row in enumerate(packing.rows):
        pivot, right = factor[row.start], factor[row.start + 1 : row.stop]
        energies[j] += pivot
        energies[j + 1 :] += right * right * pivot
        lift(factor[row.start], energies[j])
    response_energy = energies[n_parameters:] + factor[packing.outputs]
    return solve_factors(factor, packing, energies[:n_parameters], response_energy)


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


def triangle_of_rows(rows: FloatArray, packing: Packing) -> FloatArray:
    """Factorise one set of rows by Householder reflections.

    Parameters
    ----------
    rows : ndarray, shape (n_rows, n_columns)
        In any order.

    Returns
    -------
    ndarray, shape (n_entries, 1)
    """
    n_parameters, n_columns = packing.n_parameters, packing.n_columns
    reflected = np.asarray(np.linalg.qr(largest_first(rows), mode="r"))
    upper = np.zeros((n_columns, n_columns))
    upper[: reflected.shape[0]] = reflected
    factor = empty_factor(packing, 1)
    for j, row in enumerate(packing.rows):
        if upper[j, j] ** 2 > EMPTY_PIVOT:
            factor[row, 0] = upper[j, j:] / upper[j, j]
            factor[row.start, 0] = upper[j, j] ** 2
    factor[packing.outputs, 0] = (upper[n_parameters:, n_parameters:] ** 2).sum(axis=0)
    return factor


def _absorb(factor: FloatArray, weight: FloatArray, row: FloatArray, first: int, packing: Packing) -> None:
    """Rotate one row, whose columns begin at `first`, into every factor; all arguments are consumed."""
    for j, place in enumerate(packing.rows[first:]):
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
    left = row[-packing.n_outputs :]
    factor[packing.outputs] += weight * left * left
