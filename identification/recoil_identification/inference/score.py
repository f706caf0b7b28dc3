"""Score tests of effects that an estimate has no unknown for, without a new fit.

C. R. Rao, Large sample tests of statistical hypotheses, Proc. Camb. Phil. Soc. 44, 1948.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.inference.estimate import LEAST_REDUNDANCY


@dataclass(frozen=True, eq=False)
class Scores(ReadOnlyArrays):
    """Score statistics of columns that no unknown stands for.

    Attributes
    ----------
    normalised : ndarray, shape (n_columns,)
        Standard normal each if nothing of the column is in the rows; 0 where it is not identifiable.
    correlation : ndarray, shape (n_columns, n_columns)
        0 with one that is not identifiable.
    identifiable : ndarray of bool, shape (n_columns,)
        False where the unknowns explain the column.
    information : ndarray, shape (n_columns,)
        Information on each column's size beside all unknowns: the inverse of the variance that it would have; 0 where
        it is not identifiable.
    moves : ndarray, shape (n_unknowns, n_columns)
        Amount by which each unknown's estimate moves if the rows hold a size of one of a column, and nothing says so.
    """

    normalised: Array
    correlation: Array
    identifiable: NDArray[np.bool_]
    information: Array
    moves: Array

    @classmethod
    def of(cls, left: Array, derivatives: Array, covariance: Array, columns: Array) -> Scores:
        """Score columns of rows whose errors are independent and of standard deviation one.

        Parameters
        ----------
        left : ndarray, shape (n_rows,)
        derivatives : ndarray, shape (n_rows, n_unknowns)
        covariance : ndarray, shape (n_unknowns, n_unknowns)
            Covariance of the estimate.
        columns : ndarray, shape (n_rows, n_columns)
        """
        shared = derivatives.T @ columns
        moves = covariance @ shared
        own = columns.T @ columns - shared.T @ moves
        variances, energy = np.diag(own), (columns**2).sum(axis=0)
        identifiable = variances > LEAST_REDUNDANCY * energy
        deviations = np.sqrt(np.where(identifiable, variances, np.inf))
        information = np.where(identifiable, variances, 0.0)
        normalised, correlation = columns.T @ left / deviations, own / np.outer(deviations, deviations)
        return cls(normalised, correlation, identifiable, information, moves)

    def ln_bayes_factors(self, sd: Array | float) -> Array:
        """Return the logarithm of the Bayes factor of each column's size being drawn, against being none.

        With s = sd^2 times the information it is ``z^2 s / (2 (1 + s)) - ln(1 + s) / 2`` (H. Jeffreys, Theory of
        Probability, 1961; the nested linear model in R. E. Kass, A. E. Raftery, J. Am. Stat. Assoc. 90, 1995).

        Parameters
        ----------
        sd : ndarray, shape (n_columns,), or float
            Standard deviation of the size, if there is one.

        Returns
        -------
        ndarray, shape (n_columns,)
        """
        s = np.asarray(sd) ** 2 * self.information
        return np.asarray(0.5 * self.normalised**2 * s / (1.0 + s) - 0.5 * np.log1p(s))

    def fall(self, chosen: Sequence[int]) -> float:
        """Return by how much the misfit would fall with an unknown for each of some columns."""
        at = [column for column in chosen if self.identifiable[column]]
        if not at:
            return 0.0
        z = self.normalised[at]
        return float(z @ np.linalg.lstsq(self.correlation[np.ix_(at, at)], z, rcond=None)[0])
