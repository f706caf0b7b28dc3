"""A season: the masses of several campaigns with what they share, and whether they differ by more than that allows.

Two campaigns share a sensor's certificate and what is known of the rig, so that both masses are off by the same error
in so far: their covariance makes the uncertainty of their difference smaller than that of independent masses. With the
covariance matrix V of the masses m the mean is the generalised least squares one, 1'V^-1 m / 1'V^-1 1, of variance
1 / 1'V^-1 1, and (m - mean)' V^-1 (m - mean) is a chi square of one degree of freedom less than there are masses if
they are of one mechanism (Cox, Metrologia 39 (2002) 589, procedure A, extended to correlated results).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc  # scipy.stats has it too, but takes half a second to import

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

SIGNIFICANCE = 0.05
"""Probability below which masses are said to differ."""


@dataclass(frozen=True, eq=False)
class Season(ReadOnlyArrays):
    """Masses of campaigns compared with one another.

    Attributes
    ----------
    mean_kg, u_kg
        Mean of all masses by generalised least squares, and its standard uncertainty.
    chi_square, degrees_of_freedom, p
        Squared distance of the masses from their mean, its degrees of freedom, and the probability of more.
    differences_kg, u_differences_kg : ndarray, shape (n,)
        Differences of the masses from the last one, and their standard uncertainties.
    """

    mean_kg: float
    u_kg: float
    chi_square: float
    degrees_of_freedom: int
    p: float
    differences_kg: Array
    u_differences_kg: Array

    @property
    def agrees(self) -> bool:
        """Whether the masses differ by no more than their uncertainties and what they share allow."""
        return self.p >= SIGNIFICANCE


def season(masses_kg: Array, covariance_kg2: Array) -> Season:
    """Compare the masses of campaigns.

    Parameters
    ----------
    masses_kg : ndarray, shape (n,)
        Masses, two at least.
    covariance_kg2 : ndarray, shape (n, n)
        Their covariance: the squares of their uncertainties on the diagonal.

    Raises
    ------
    ValueError
        If there are fewer than two, or the matrix is no covariance that can be inverted.
    """
    if masses_kg.size < 2:
        raise ValueError("a season has two campaigns at least")
    try:
        weights = np.linalg.inv(np.linalg.cholesky(covariance_kg2))
    except np.linalg.LinAlgError as error:
        raise ValueError("the masses' covariance is not positive definite") from error
    ones, whitened = weights @ np.ones(masses_kg.size), weights @ masses_kg
    information = float(ones @ ones)
    mean_kg = float(ones @ whitened) / information
    chi_square = float(np.sum((whitened - mean_kg * ones) ** 2))
    freedom = masses_kg.size - 1
    variances = np.diag(covariance_kg2)
    of_differences = variances + variances[-1] - 2.0 * covariance_kg2[:, -1]
    return Season(
        mean_kg, information**-0.5, chi_square, freedom, float(chdtrc(freedom, chi_square)),
        masses_kg - masses_kg[-1], np.sqrt(np.maximum(of_differences, 0.0)),
    )  # fmt: skip
