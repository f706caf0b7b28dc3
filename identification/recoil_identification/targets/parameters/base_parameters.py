"""Which combinations of parameters a linear model can tell, by rank-revealing QR factorisation.

Columns of a regressor that others explain cannot be told from them: their parameters count towards those of the
others. With the columns parted into independent ones and the rest,

    Y theta = Y1 theta1 + Y2 theta2,    Y2 = Y1 K    =>    Y theta = Y1 (theta1 + K theta2)

and ``theta1 + K theta2`` are the base parameters. K is read off the triangle of the factorisation, ``R1^-1 R2``.
Where the rest is not quite explained, least squares still estimates ``theta1 + K theta2`` without bias, whatever
theta2 is: the remainder of Y2 is orthogonal to Y1.

M. Gautier, "Numerical calculation of the base inertial parameters of robots", J. Robotic Systems 8, 1991;
G. H. Golub, C. F. Van Loan, Matrix Computations, 4th edition, 5.4.2 (column pivoting).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

STRUCTURAL_TOLERANCE = 1e-9
"""Share of a column's length below which what others leave of it is rounding."""


@dataclass(frozen=True, eq=False)
class BaseParameters(ReadOnlyArrays):
    """Combinations of p standard parameters.

    Attributes
    ----------
    leading
        The standard parameter that each combination has with factor 1.
    combinations : ndarray, shape (r, p)
        ``base = combinations @ theta``.
    """

    leading: tuple[int, ...]
    combinations: Array


def structural_base(design: Array, preferred: Sequence[int] | None = None) -> BaseParameters:
    """Find what a model can tell at all, from motions that excite it fully.

    Parameters
    ----------
    design : ndarray, shape (n, p)
        Regressor of random motions, n well above p.
    preferred
        All columns, those first that shall lead a combination where there is a choice.

    Returns
    -------
    BaseParameters
        Combinations, as many as the design has independent columns.

    Raises
    ------
    ValueError
        If `preferred` does not name every column once, or there are fewer rows than columns.
    """
    p = design.shape[1]
    order = list(range(p)) if preferred is None else list(preferred)
    if sorted(order) != list(range(p)):
        raise ValueError(f"preferred must name each of {p} columns once, found {order}")
    if design.shape[0] < p:
        raise ValueError(f"{design.shape[0]} rows cannot tell {p} columns apart")
    lengths = np.linalg.norm(design, axis=0)
    scaled = design / np.where(lengths > 0, lengths, 1.0)
    leading: list[int] = []
    basis = np.zeros((design.shape[0], 0))
    for j in order:
        left = scaled[:, j]
        for _ in range(2):  # twice is enough to be orthogonal to rounding
            left = left - basis @ (basis.T @ left)
        size = float(np.linalg.norm(left))
        if size > STRUCTURAL_TOLERANCE:
            leading.append(j)
            basis = np.column_stack([basis, left / size])
    triangle = basis.T @ design
    combinations = np.asarray(np.linalg.solve(triangle[:, leading], triangle), dtype=np.float64)
    combinations[np.abs(combinations) * lengths[leading, np.newaxis] <= 1e2 * STRUCTURAL_TOLERANCE * lengths] = 0.0
    return BaseParameters(tuple(leading), combinations)


@dataclass(frozen=True, eq=False)
class IdentifiablePart(ReadOnlyArrays):
    """The combinations that one shot tells, the best determined first.

    Attributes
    ----------
    values, u : ndarray, shape (r,)
        Estimates and standard uncertainties.
    covariance : ndarray, shape (r, r)
    pivots : ndarray, shape (p,)
        Standard uncertainty of each further combination relative to the leading parameter's natural scale, in
        the order of the factorisation; those behind the r-th are too large. Infinite where nothing is told.
    """

    base: BaseParameters
    values: Array
    u: Array
    covariance: Array
    pivots: Array


def identifiable_part(
    triangle: Array, response: Array, scales: Array, largest_u: float, doubt: Array | None = None
) -> IdentifiablePart:
    """Find the combinations that a whitened regression tells, by column-pivoted QR.

    Parameters
    ----------
    triangle : ndarray, shape (m, p)
        Whitened: rows have errors of variance one. Other unknowns have been eliminated.
    response : ndarray, shape (m,)
    scales : ndarray, shape (p,)
        Natural size of each parameter.
    largest_u
        Largest standard uncertainty of a combination, relative to its leading parameter's natural scale: where
        the noise leaves more, the numerical rank ends.
    doubt : ndarray, shape (m, m), optional
        Covariance of the response beyond that of whitened errors.
    """
    from scipy.linalg import qr

    q, r, order = qr(triangle * scales, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(r))
    with np.errstate(divide="ignore"):
        pivots = np.where(diagonal > 0, 1.0 / diagonal, np.inf)
    rank = int(np.argmax(pivots > largest_u)) if np.any(pivots > largest_u) else pivots.size
    p = scales.size
    scaled = np.zeros((rank, p))
    if rank:
        scaled[:, order] = np.linalg.solve(r[:rank, :rank], r[:rank])
    inverse = np.linalg.inv(r[:rank, :rank]) if rank else np.zeros((0, 0))
    leading = tuple(int(j) for j in order[:rank])
    size = scales[list(leading)]
    seen = q.T[:rank] if doubt is None else q.T[:rank] @ (np.eye(response.size) + doubt)
    covariance = (inverse @ (seen @ q[:, :rank]) @ inverse.T) * np.outer(size, size)
    combinations = scaled * size[:, np.newaxis] / scales
    values = size * (inverse @ (q.T @ response)[:rank])
    base = BaseParameters(leading, combinations)
    return IdentifiablePart(base, values, np.sqrt(np.diag(covariance)), covariance, pivots)
