"""The correlation of rows: filtered noise, what follows it, and what the motion adds to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays


@dataclass(frozen=True, eq=False)
class Correlation(ReadOnlyArrays):
    """Cholesky's factor of a correlation.

    Attributes
    ----------
    factor : ndarray, shape (n_rows, n_rows)
        Lower factor L, with ``L L'`` the correlation.
    """

    factor: Array

    @classmethod
    def of(cls, matrix: Array) -> Correlation:
        """Factorise a correlation, shape (n_rows, n_rows).

        Raises
        ------
        numpy.linalg.LinAlgError
            If it is not positive definite.
        """
        return cls(np.asarray(np.linalg.cholesky(matrix)))

    def whitened(self, rows: Array) -> Array:
        """Turn correlated rows into independent ones, shape (n_rows, n_columns) as given."""
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self.factor, rows, lower=True, check_finite=False))
