"""Triangular factors of every sliding window, by aggregation in two stacks and never by subtraction.

The record is cut into blocks as long as the window. A window is then a suffix of one block and a
prefix of the next, so two running aggregates per block and one merge per window give all windows
(M. van Herk, Pattern Recognition Letters 13, 1992, 517-521, for maxima; any associative operator will
do). A row that has left the window has left no round-off behind, which downdating cannot promise.

Two operators: sums of products (Gram), quick, whose error grows with the square of the condition
number, here; and square-root-free Givens rotations, whose error grows with the condition number
itself, in `rotations`. Both end in a factor, see `window_factors`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recoil_identification.memory import rotations
from recoil_identification.memory.window_factors import NO_ENERGY, FloatArray, Packing, Solution, lift, solve_factors

__all__ = [
    "FloatArray",
    "Packing",
    "Solution",
    "empty_factor",
    "gram_of_windows",
    "merge_factors",
    "packed_rows",
    "products_of_rows",
    "qr_of_runs",
    "solve_gram",
    "solve_qr",
]


def products_of_rows(rows: FloatArray, packing: Packing) -> FloatArray:
    """Multiply the columns of each row with each other.

    Parameters
    ----------
    rows : ndarray, shape (n_columns, ...)
        Columns of [X | Y].

    Returns
    -------
    ndarray, shape (n_entries, ...)
    """
    products = np.empty((packing.n_entries, *rows.shape[1:]))
    for j, row in enumerate(packing.rows):
        np.multiply(rows[j], rows[j:], out=products[row])
    np.multiply(rows[packing.n_parameters :], rows[packing.n_parameters :], out=products[packing.outputs])
    return products


def gram_of_windows(rows: FloatArray, packing: Packing) -> FloatArray:
    """Sum products over every window that ends in a run of blocks.

    Parameters
    ----------
    rows : ndarray, shape (n_columns, n_blocks + 1, block)
        Columns of [X | Y] of the blocks and of the one before; zero where there is no sample.

    Returns
    -------
    ndarray, shape (n_entries, n_blocks * block)
        X'X, X'Y and the diagonal of Y'Y.
    """
    products = products_of_rows(rows, packing)
    windows = np.empty((packing.n_entries, rows.shape[1] - 1, rows.shape[2]))
    ending = np.empty((rows.shape[1] - 1, rows.shape[2]))
    for entry in range(packing.n_entries):
        np.cumsum(products[entry, 1:], axis=-1, out=windows[entry])
        np.cumsum(products[entry, :-1, :0:-1], axis=-1, out=ending[:, :0:-1])
        windows[entry, :, :-1] += ending[:, 1:]
    return windows.reshape(packing.n_entries, -1)


def solve_gram(gram: FloatArray, packing: Packing) -> Solution:
    """Factorise packed sums of products in place, and solve.

    Parameters
    ----------
    gram : ndarray, shape (n_entries, n_windows)
        Overwritten.
    """
    if packing.n_parameters == 1 and gram[0].min(initial=1.0) > NO_ENERGY:
        return _solve_single(gram)
    energies = gram[packing.pivots]
    response_energy = gram[packing.outputs].copy()
    scratch = np.empty((packing.n_columns, gram.shape[1]))
    for j, row in enumerate(packing.rows):
        right = gram[row.start + 1 : row.stop]
        lift(gram[row.start], energies[j])
        scaled = right * np.divide(1.0, gram[row.start], out=scratch[-1])
        for k, other in enumerate(packing.rows[j + 1 :]):
            part = scratch[: other.stop - other.start]
            gram[other] -= np.multiply(scaled[k], right[k:], out=part)
        of_outputs = slice(right.shape[0] - packing.n_outputs, None)
        gram[packing.outputs] -= scaled[of_outputs] * right[of_outputs]
        right[:] = scaled
    return solve_factors(gram, packing, energies, response_energy)


def _solve_single(gram: FloatArray) -> Solution:
    """Solve for one regressor that is there in every window: the same operations, without those that change nothing."""
    energies, products, squares = gram[:1], gram[1 : gram.shape[0] // 2 + 1], gram[gram.shape[0] // 2 + 1 :]
    factors = np.divide(1.0, energies)
    parameters = products * factors
    left = parameters * products
    np.subtract(squares, left, out=left)
    np.maximum(left, 0.0, out=left)
    return Solution(
        parameters=parameters[np.newaxis],
        variance_factors=factors,
        energies=energies,
        residual_sum_of_squares=left,
        response_energy=squares,
        smallest_pivot=np.ones(gram.shape[1]),
    )


def packed_rows(n_columns: int) -> list[slice]:
    """Place the rows of a packed factor of one output, pivot first; the last one is the residual sum of squares.

    Parameters
    ----------
    n_columns
        Parameters plus one.

    Returns
    -------
    list of slice
    """
    packing = Packing(n_columns - 1)
    return [*packing.rows, packing.outputs]


def qr_of_runs(rows: FloatArray) -> FloatArray:
    """Factorise every beginning of every run of rows of one output.

    Parameters
    ----------
    rows : ndarray, shape (n_columns, n_runs, length)
        Columns of [X | y].

    Returns
    -------
    ndarray, shape (length + 1, n_entries, n_runs)
    """
    return rotations.qr_of_runs(rows, Packing(rows.shape[0] - 1))


def empty_factor(n_columns: int, n_windows: int) -> FloatArray:
    """Build factors of one output that have seen no row.

    Returns
    -------
    ndarray, shape (n_entries, n_windows)
    """
    return rotations.empty_factor(Packing(n_columns - 1), n_windows)


def merge_factors(factor: FloatArray, other: FloatArray, n_columns: int) -> None:
    """Take the rows behind other factors of one output into factors, in place.

    Parameters
    ----------
    factor, other : ndarray, shape (n_entries, n_windows)
        The first is overwritten by the factor of the rows of both.
    """
    rotations.merge_factors(factor, other, Packing(n_columns - 1))


def solve_qr(factor: FloatArray, n_columns: int) -> Solution:
    """Solve from packed factors of one output, in place.

    Parameters
    ----------
    factor : ndarray, shape (n_entries, n_windows)
        Overwritten.
    n_columns
        Parameters plus one.

    Returns
    -------
    Solution
        Without the axis of outputs: parameters of shape (n_parameters, n_windows), sums of shape (n_windows,).
    """
    solution = rotations.solve_qr(factor, Packing(n_columns - 1))
    return replace(
        solution,
        parameters=solution.parameters[:, 0],
        residual_sum_of_squares=solution.residual_sum_of_squares[0],
        response_energy=solution.response_energy[0],
    )
