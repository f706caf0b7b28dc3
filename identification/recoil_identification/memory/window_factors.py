"""Triangular factors of least-squares windows: where their entries are, and the solution they give.

A factor of the regressors X beside the outputs Y is that of

    X'X = U' D U,  U^-T X'Y = D V,  U unit upper triangular,  D diagonal,

with the residual sum of squares of each output, without the cancellation of y'y - theta'X'y.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NO_ENERGY = 1e-200
"""Energy of a regressor, scaled to one at its largest, below which it is not there."""
PIVOT_FLOOR = 1e-18
"""Least share of a pivot in its column's energy in the back-substitution; far below any accepted one."""


@dataclass(frozen=True)
class Packing:
    """Where the entries of a window's factor are: ``D_0, U_01, .., V_00, .., D_1, U_12, .., RSS_0, ..``.

    Attributes
    ----------
    n_parameters
        Regressors.
    n_outputs
        Responses that share them.
    """

    n_parameters: int
    n_outputs: int = 1

    @property
    def n_columns(self) -> int:
        """Regressors and outputs."""
        return self.n_parameters + self.n_outputs

    @cached_property
    def rows(self) -> tuple[slice, ...]:
        """Places of each regressor's row, its pivot first, its outputs last."""
        starts = [j * self.n_columns - j * (j - 1) // 2 for j in range(self.n_parameters + 1)]
        return tuple(slice(starts[j], starts[j + 1]) for j in range(self.n_parameters))

    @cached_property
    def pivots(self) -> list[int]:
        """Place of each regressor's pivot."""
        return [row.start for row in self.rows]

    @property
    def outputs(self) -> slice:
        """Place of the sums of squares of the outputs."""
        return slice(self.n_entries - self.n_outputs, self.n_entries)

    @cached_property
    def n_entries(self) -> int:
        """Numbers of a factor."""
        return int(self.rows[-1].stop) + self.n_outputs


@dataclass(frozen=True, eq=False)
class Solution:
    """Least-squares solution of many windows.

    Attributes
    ----------
    parameters : ndarray, shape (n_parameters, n_outputs, n_windows)
    variance_factors : ndarray, shape (n_parameters, n_windows)
        The diagonal of (X'X)^-1.
    energies : ndarray, shape (n_parameters, n_windows)
        Sum of squares of each regressor.
    residual_sum_of_squares, response_energy : ndarray, shape (n_outputs, n_windows)
    smallest_pivot : ndarray, shape (n_windows,)
        min_j D_j / energy_j; 0 where a regressor has no energy.
    """

    parameters: FloatArray
    variance_factors: FloatArray
    energies: FloatArray
    residual_sum_of_squares: FloatArray
    response_energy: FloatArray
    smallest_pivot: FloatArray


def lift(pivot: FloatArray, energy: FloatArray) -> None:
    """Lift the pivots of windows without a number off zero, in place, so that they can be divided by.

    Parameters
    ----------
    pivot, energy : ndarray, shape (n_windows,)
        Of one regressor.
    """
    np.maximum(pivot, PIVOT_FLOOR * energy, out=pivot)
    pivot[energy <= NO_ENERGY] = 1.0


def solve_factors(factor: FloatArray, packing: Packing, energies: FloatArray, response_energy: FloatArray) -> Solution:
    """Solve from factors whose pivots are lifted.

    U is inverted in place to W: with the outputs as the last columns, those columns of W are -theta, and the
    rows give diag((X'X)^-1)_j = sum_k W_jk^2 / D_k.

    Parameters
    ----------
    factor : ndarray, shape (n_entries, n_windows)
        Overwritten.
    energies : ndarray, shape (n_parameters, n_windows)
    response_energy : ndarray, shape (n_outputs, n_windows)
    """
    n_parameters, n_outputs, rows = packing.n_parameters, packing.n_outputs, packing.rows
    n_windows = factor.shape[1]
    smallest_pivot = np.ones(n_windows)
    precisions = np.empty((n_parameters, n_windows))
    parameters = np.empty((n_parameters, n_outputs, n_windows))
    variance_factors = np.empty_like(precisions)
    scratch = np.empty((packing.n_columns, n_windows))
    for j in range(n_parameters - 1, -1, -1):
        pivot, inverse = factor[rows[j].start], factor[rows[j].start + 1 : rows[j].stop]
        upper = inverse[:-n_outputs].copy()
        np.negative(inverse, out=inverse)
        for i in range(j + 1, n_parameters):
            below = factor[rows[i].start + 1 : rows[i].stop]
            inverse[i - j :] -= np.multiply(upper[i - j - 1], below, out=scratch[: below.shape[0]])
        np.negative(inverse[-n_outputs:], out=parameters[j])
        np.divide(1.0, pivot, out=precisions[j])
        variance_factors[j] = precisions[j]
        for k in range(j + 1, n_parameters):
            square = np.multiply(inverse[k - j - 1], inverse[k - j - 1], out=scratch[0])
            variance_factors[j] += np.multiply(square, precisions[k], out=square)
        silent = energies[j] <= NO_ENERGY
        # the first regressor explains itself
        share = pivot / np.where(silent, 1.0, energies[j]) if j else np.ones(n_windows)
        if silent.any():
            share[silent] = 0.0
            energies[j][silent] = 0.0
        np.minimum(smallest_pivot, share, out=smallest_pivot)
    return Solution(
        parameters=parameters,
        variance_factors=variance_factors,
        energies=energies,
        residual_sum_of_squares=np.maximum(factor[packing.outputs], 0.0),
        response_energy=response_energy,
        smallest_pivot=smallest_pivot,
    )
