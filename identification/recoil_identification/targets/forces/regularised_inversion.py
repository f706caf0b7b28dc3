"""Linear inverse problems by Tikhonov's regularisation, its weight by generalised cross-validation.

The unknowns are the smoothest that explain the rows: minimise ``|A c - d|^2 + lambda |D c|^2`` with rows that carry
white noise of unit variance (A. N. Tikhonov, 1963). The weight is where each row is predicted best by all the others:
``n |A c - d|^2 / (n - k tr H)^2`` is least, H being the matrix from the rows to their own predictions (G. H. Golub,
M. Heath, G. Wahba, Technometrics 21(2), 1979). With k = 1 one record in ten or so is followed into its noise; k = 1.4
prevents that at next to no cost (Y.-J. Kim, C. Gu, J. R. Stat. Soc. B 66(2), 2004). Of weights that the criterion
does not tell apart the largest may be taken, as a stiff first guess. The covariance is that of the unknowns given the
rows if D c were white a priori; intervals by it hold the truth on the average over the unknowns (G. Wahba, J. R. Stat.
Soc. B 45(1), 1983).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

DECADES = (-12.0, 12.0)
"""Powers of ten of the weight that are tried, over the ratio of the traces of A'A and D'D."""
PER_DECADE = 8
COST = 1.4
"""k, of a parameter in the cross-validation."""
RIDGE = 1e-13
"""Share of the largest entry of A'A + D'D that is added to its diagonal: nothing is told of some unknowns by either."""


@dataclass(frozen=True, eq=False)
class Inversion(ReadOnlyArrays):
    """The solution of one problem.

    Attributes
    ----------
    solution : ndarray, shape (n_unknowns,)
    covariance : ndarray, shape (n_unknowns, n_unknowns)
        Covariance for rows of the variance that the residuals show.
    weight
        lambda.
    freedom
        Rows less what the solution spends on them, n - tr H.
    variance
        Variance of a row by the residuals; 1 if rows are scaled rightly.
    spent : ndarray, shape (n_rows,)
        Diagonal of H.
    residual : ndarray, shape (n_rows,)
    at_bound
        Whether the criterion is still falling at the end of the weights that were tried.
    """

    solution: Array
    covariance: Array
    weight: float
    freedom: float
    variance: float
    spent: Array
    residual: Array
    at_bound: bool


def invert(
    rows: Array,
    data: Array,
    penalty: Array,
    *,
    fixed: Array | None = None,
    weight: float | None = None,
    stiff: bool = False,
) -> Inversion:
    """Solve a linear inverse problem.

    Parameters
    ----------
    rows : ndarray, shape (n_rows, n_unknowns)
        Scaled so that the data's noise is white, of unit variance.
    data : ndarray, shape (n_rows,)
    penalty : ndarray, shape (n_penalties, n_unknowns)
        D.
    fixed : ndarray, shape (n_unknowns,), optional
        Standard deviations of unknowns that are restricted by what is known of them beforehand, about zero; infinite
        where nothing is known. They are part of the model, not of the data that are predicted.
    weight
        lambda; chosen by cross-validation if left out.
    stiff
        Whether to take the largest weight whose criterion is within its standard error, ``sqrt(2 / n)``, of the least.

    Raises
    ------
    ValueError
        If the shapes do not fit, there are fewer than three rows, or something is not finite.
    """
    from scipy.linalg import cho_factor, cho_solve

    if rows.ndim != 2 or data.shape != rows.shape[:1] or penalty.ndim != 2 or penalty.shape[1] != rows.shape[1]:
        raise ValueError(f"rows {rows.shape}, data {data.shape} and penalty {penalty.shape} do not fit")
    if data.size < 3 or not all(np.all(np.isfinite(a)) for a in (rows, data, penalty)):
        raise ValueError("at least three finite rows are needed")
    known = np.zeros(rows.shape[1]) if fixed is None else np.asarray(1.0 / fixed**2)
    gram, moments, bend = rows.T @ rows, rows.T @ data, penalty.T @ penalty
    at_bound = False
    if weight is None:
        weight, at_bound = _cross_validated(rows, data, gram, bend, known, stiff)
    whole = gram + np.diag(known) + weight * bend
    whole += RIDGE * np.diag(np.diag(whole))
    own = 1.0 / np.sqrt(np.diag(whole))
    factor = cho_factor(whole * np.outer(own, own))
    inverse = np.outer(own, own) * cho_solve(factor, np.eye(own.size))
    solution = inverse @ moments
    residual = data - rows @ solution
    spent = np.einsum("ij,jk,ik->i", rows, inverse, rows)
    freedom = data.size - float(spent.sum())
    variance = float(residual @ residual) / max(freedom, 1.0)
    return Inversion(solution, variance * inverse, weight, freedom, variance, spent, residual, at_bound)


def _cross_validated(
    rows: Array, data: Array, gram: Array, bend: Array, known: Array, stiff: bool
) -> tuple[float, bool]:
    """Return the weight of least generalised cross-validation, and whether it is the first or last that was tried."""
    from scipy.linalg import eigh

    ratio = float(np.trace(gram) / np.trace(bend))
    # what is told by the rows and beforehand; a trace of the penalty keeps it regular and changes no figure
    information = gram + np.diag(known) + 10.0 ** DECADES[0] * ratio * bend
    information += RIDGE * np.diag(np.diag(information))
    scale = 1.0 / np.sqrt(np.diag(information))
    values, vectors = eigh(ratio * bend * np.outer(scale, scale), information * np.outer(scale, scale))
    vectors = scale[:, None] * vectors
    values = np.maximum(values, 0.0)
    seen, projected = np.einsum("ij,jk,ki->i", vectors.T, gram, vectors), vectors.T @ (rows.T @ data)
    predicted = rows @ vectors

    def criterion(decade: float) -> float:
        shrunk = 1.0 / (1.0 + 10.0**decade * values)
        left = data - predicted @ (shrunk * projected)
        freedom = data.size - COST * float(shrunk @ seen)
        return data.size * float(left @ left) / freedom**2 if freedom > 0 else math.inf

    grid = np.linspace(*DECADES, round((DECADES[1] - DECADES[0]) * PER_DECADE) + 1)
    criteria = [criterion(decade) for decade in grid]
    best = int(np.argmin(criteria))
    if stiff:
        best = int(np.flatnonzero(np.array(criteria) <= criteria[best] * (1.0 + math.sqrt(2.0 / data.size)))[-1])
    return 10.0 ** float(grid[best]) * ratio, best in (0, grid.size - 1)
