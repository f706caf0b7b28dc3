"""Weighted least squares over all rows at once, by orthogonal reflections: one estimate for a whole shot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from recoil_acquisition.errors import IdentificationError
from recoil_identification.memory.rotations import largest_first
from recoil_identification.memory.samples import checked_samples
from recoil_identification.memory.window_factors import FloatArray
from recoil_identification.memory.windowed_estimates import COLLINEAR_PIVOT


@dataclass(frozen=True, eq=False)
class LeastSquaresFit:
    """One least-squares estimate.

    Attributes
    ----------
    parameters : ndarray, shape (n_parameters,)
        In units of the response per unit of the regressor.
    covariance_factor : ndarray, shape (n_parameters, n_parameters)
        (X'WX)^-1: times the variance of a response of weight one, the parameters' covariance.
    residual_sum_of_squares
        Weighted.
    degrees_of_freedom
        Samples present less parameters, at least 1.
    count
        Samples present.
    smallest_pivot
        Least share of a regressor's energy that the regressors before it do not explain.
    """

    parameters: FloatArray
    covariance_factor: FloatArray
    residual_sum_of_squares: float
    degrees_of_freedom: int
    count: int
    smallest_pivot: float

    @property
    def variance(self) -> float:
        """Variance of a response of weight one, from the residuals."""
        return self.residual_sum_of_squares / self.degrees_of_freedom

    @property
    def standard_errors(self) -> FloatArray:
        """Ordinary least squares' own, shape (n_parameters,): too small where errors are correlated in time."""
        return np.asarray(np.sqrt(self.variance * np.diag(self.covariance_factor)))


def least_squares(regressors: ArrayLike, response: ArrayLike, weights: ArrayLike | None = None) -> LeastSquaresFit:
    """Estimate the parameters of ``response = regressors @ parameters`` from all rows.

    Parameters
    ----------
    regressors : array_like, shape (n_samples, n_parameters)
        In any units. A row with a NaN is a missing sample. Never modified.
    response : array_like, shape (n_samples,)
        In any unit; NaN is a missing sample. Never modified.
    weights : array_like, shape (n_samples,), optional
        Proportional to one over the variance of the response; zero is a missing sample.

    Raises
    ------
    ValueError
        For shapes that do not fit, infinite samples, weights that are not finite or negative.
    TypeError
        For complex samples.
    IdentificationError
        If there is no number to give: too few samples, a regressor that is zero, or regressors that
        cannot be told apart.
    """
    columns, response_column, weight = checked_samples(regressors, response, weights)
    n_parameters = columns.shape[1]
    rows = np.column_stack([columns, response_column])
    present = ~np.isnan(rows).any(axis=1)
    if weight is not None:
        present &= weight > 0.0
        rows = rows[present] * np.sqrt(weight[present])[:, np.newaxis]
    else:
        rows = rows[present]
    count = rows.shape[0]
    if count <= n_parameters:
        raise IdentificationError(
            "too few samples for a regression", expected=f"{n_parameters + 1} or more present", found=str(count)
        )
    exponents = np.frexp(np.abs(rows).max(axis=0))[1]
    triangle = np.asarray(np.linalg.qr(largest_first(np.ldexp(rows, -exponents)), mode="r"))
    energies = (triangle[:, :-1] ** 2).sum(axis=0)
    if not energies.all():
        idle = ", ".join(str(j) for j in np.flatnonzero(energies == 0.0))
        raise IdentificationError(
            "a regressor carries no signal", expected="a signal in every one", found=f"number {idle} zero throughout"
        )
    smallest_pivot = float((np.diag(triangle)[:-1] ** 2 / energies).min())
    if smallest_pivot < COLLINEAR_PIVOT:
        raise IdentificationError(
            "the regressors cannot be told apart",
            expected=f"a smallest pivot of {COLLINEAR_PIVOT:g} or more",
            found=f"{smallest_pivot:.1e}",
            remedy="leave one out, or take an interval in which they differ",
        )
    scale = np.ldexp(1.0, -exponents[:-1])
    inverse = scale[:, np.newaxis] * np.linalg.solve(triangle[:-1, :-1], np.eye(n_parameters))
    parameters = np.linalg.solve(triangle[:-1, :-1], triangle[:-1, -1])
    return LeastSquaresFit(
        parameters=np.ldexp(parameters, exponents[-1] - exponents[:-1]),
        covariance_factor=inverse @ inverse.T,
        residual_sum_of_squares=float(np.ldexp(triangle[-1, -1] ** 2, 2 * exponents[-1])),
        degrees_of_freedom=count - n_parameters,
        count=count,
        smallest_pivot=smallest_pivot,
    )
