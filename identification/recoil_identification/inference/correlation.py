"""The correlation of rows of which most are correlated with near ones only: filtered noise, and what follows it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Correlation(ReadOnlyArrays):
    """Cholesky's factor of a correlation, banded but for its last rows.

    Its memory and its time go with the number of rows, where those of a whole triangle go with its square and cube.

    Attributes
    ----------
    near : ndarray, shape (n_band, n_rows)
        Factor L of the rows that are correlated with near ones, each diagonal in a row of its own (LAPACK's lower
        band storage).
    across : ndarray, shape (n_rows, n_last)
        L^-1 times the correlation of these rows with the last ones.
    last : ndarray, shape (n_last, n_last)
        Lower factor of what the last rows have besides.
    """

    near: Array
    across: Array
    last: Array

    @classmethod
    def of(cls, near: Array, across: Array | None = None, last: Array | None = None) -> Correlation:
        """Factorise a correlation.

        Parameters
        ----------
        near : ndarray, shape (n_band, n_rows)
            Correlation of rows with themselves, and with the one, two ... rows after them.
        across : ndarray, shape (n_rows, n_last), optional
            Correlation of these rows with the last ones.
        last : ndarray, shape (n_last, n_last), optional
            Correlation of the last rows.

        Raises
        ------
        numpy.linalg.LinAlgError
            If it is not positive definite.
        """
        from scipy.linalg import cholesky_banded

        factor = np.asarray(cholesky_banded(near, lower=True))
        if across is None or last is None:
            return cls(factor, np.zeros((near.shape[1], 0)), np.zeros((0, 0)))
        first = _solved(factor, across)
        return cls(factor, first, np.asarray(np.linalg.cholesky(last - first.T @ first)))

    @classmethod
    def whole(cls, matrix: Array) -> Correlation:
        """Factorise a correlation of which nothing is zero, shape (n_rows, n_rows)."""
        return cls.of(
            np.array([np.append(np.diagonal(matrix, later), np.zeros(later)) for later in range(len(matrix))])
        )

    def whitened(self, rows: Array) -> Array:
        """Turn correlated rows into independent ones, shape (n_rows + n_last, n_columns) as given."""
        from scipy.linalg import solve_triangular

        n = self.near.shape[1]
        first = _solved(self.near, rows[:n])
        if not self.last.size:
            return first
        return np.vstack([first, solve_triangular(self.last, rows[n:] - self.across.T @ first, lower=True)])


def _solved(factor: Array, rows: Array) -> Array:
    """Return L^-1 times rows, for a banded lower factor L."""
    from scipy.linalg.lapack import dtbtrs

    solution, _ = dtbtrs(factor, rows, uplo="L")
    return np.asarray(solution)
