"""Draws of the mass: what `recoil_identification.calibration` minimises, minimised again under drawn errors.

The modelled acceleration is a sum of fixed columns with coefficients that the unknowns give,

    a = (F_breech s_1 + F_brake s_2 + F_recuperator s_3 + F_friction - s df) g / m + r b + d v + S z,

so the shot's rows enter by the triangle of the columns' QR factorisation alone, and as many draws as one likes
cost no more than a handful of rows each. Each draw adds an error to the rows, one to every calibration, and
is minimised with the exact gradient and the curvature at the estimate; what is nonlinear is thus kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recoil_identification.budget import BudgetRow
from recoil_identification.monte_carlo import Draw
from recoil_identification.sensor_observations import BIAS, FRICTION_ERROR, GAUGE, MASS, SENSITIVITY

Array = NDArray[np.float64]

CHEAP_STEPS = 6
"""Of the minimisation by the curvature at the estimate; each leaves some hundredths of the error before it."""
MOST_STEPS = 30
"""Of the minimisation; those that are left take the curvature where they stand."""
RIDGE = 1e-14
"""On the scaled curvature's diagonal: what nothing restricts must not stop the rest."""
NEGLIGIBLE = 1e-4
"""Step over the mass's standard uncertainty, after which there is none."""
LONGEST_STEP = 0.3
"""Of a scale: further away the curvature at the estimate says nothing."""


@dataclass(frozen=True, eq=False)
class CalibratedProblem:
    """What was minimised, in as few rows as there are columns.

    Attributes
    ----------
    m0_kg
        First estimate, the unit of the mass's unknown.
    unknowns : ndarray, shape (n_unknowns,)
        The solution.
    triangle : ndarray, shape (n_columns, n_columns)
        Of forces (4), sliding, released, release and shifts.
    sigma_m_s2
        That the rows were weighted with.
    noise_m_s2
        Standard deviation of a row's error, with its correlation.
    degrees_of_freedom
        Of that standard deviation.
    rows : ndarray, shape (n_observations, n_unknowns)
    u : ndarray, shape (n_observations,)
        What the observations say of the unknowns, and their standard uncertainties.
    """

    m0_kg: float
    unknowns: Array
    triangle: Array
    sigma_m_s2: float
    noise_m_s2: float
    degrees_of_freedom: float
    rows: Array
    u: Array

    @classmethod
    def of(
        cls, m0_kg: float, unknowns: Array, columns: Array, sigma_m_s2: float, noise_m_s2: float,
        degrees_of_freedom: float, rows: Array, u: Array,
    ) -> CalibratedProblem:  # fmt: skip
        """Reduce the columns, shape (n_rows, n_columns), to their triangle; the rest as of the attributes."""
        triangle = np.asarray(np.linalg.qr(columns, mode="r"))
        return cls(m0_kg, unknowns.copy(), triangle, sigma_m_s2, noise_m_s2, degrees_of_freedom, rows, u)

    def draws(self, further: Sequence[BudgetRow]) -> Draw:
        """Return what draws masses.

        Parameters
        ----------
        further
            Contributions from outside of this problem; they are added as they stand, with their distribution.

        Returns
        -------
        callable
            A draw is NaN where the minimum was not found: the problem is then far from linear.
        """
        minimum = _Minimum.of(self)
        n_columns = self.triangle.shape[0]
        expected = minimum.gram @ _coefficients(self.unknowns[:, np.newaxis], self.m0_kg)
        told = (minimum.known @ self.unknowns)[:, np.newaxis]

        def draw(rng: np.random.Generator, count: int) -> Array:
            # the noise's size is itself known from so many rows only (6.4.9)
            size = np.sqrt(self.degrees_of_freedom / rng.chisquare(self.degrees_of_freedom, count))
            noise = self.noise_m_s2 * size * rng.standard_normal((n_columns, count))
            errors = rng.standard_normal((self.u.size, count)) / self.u[:, np.newaxis]
            masses = self.m0_kg * (
                1.0 + minimum.find(expected + self.triangle.T @ noise / self.sigma_m_s2**2, told + self.rows.T @ errors)
            )
            for row in further:
                if row.distribution == "rectangular":
                    masses = masses + row.u_kg * math.sqrt(3.0) * rng.uniform(-1.0, 1.0, count)
                else:
                    masses = masses + row.u_kg * rng.standard_normal(count)
            return np.asarray(masses)

        return draw


class _Minimum(NamedTuple):
    """What finds the minima of many draws at once: the problem's matrices, and its curvature at the estimate."""

    problem: CalibratedProblem
    gram: Array
    known: Array
    curvature: Array
    scale: Array

    @classmethod
    def of(cls, problem: CalibratedProblem) -> _Minimum:
        slopes = _slopes(problem.unknowns[:, np.newaxis], problem.m0_kg)[0]
        jacobian = np.vstack([problem.triangle @ slopes / problem.sigma_m_s2, problem.rows / problem.u[:, np.newaxis]])
        scale = np.sqrt((jacobian**2).sum(axis=0))
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv(jacobian / scale) / scale[:, np.newaxis]
        weights = problem.rows / problem.u[:, np.newaxis] ** 2
        gram = problem.triangle.T @ problem.triangle / problem.sigma_m_s2**2
        return cls(problem, gram, weights.T @ problem.rows, inverse @ inverse.T, scale)

    def find(self, seen: Array, told: Array) -> Array:
        """Return the mass's unknown at the minimum of each draw, shape (n,); NaN where it is not found.

        Parameters
        ----------
        seen : ndarray, shape (n_columns, n)
            Products of the columns with the rows as drawn.
        told : ndarray, shape (n_unknowns, n)
            The same of the observations.
        """
        unknowns = np.repeat(self.problem.unknowns[:, np.newaxis], seen.shape[1], axis=1)
        left = np.full(seen.shape[1], np.inf)
        negligible = NEGLIGIBLE * math.sqrt(float(self.curvature[MASS, MASS]))
        for step in range(MOST_STEPS):
            # all of them by the curvature at the estimate, then those that need it by their own
            at = np.flatnonzero(left > negligible)
            if at.size == 0:
                break
            now = unknowns[:, at]
            coefficients = _coefficients(now, self.problem.m0_kg)
            apart = self.gram @ coefficients - seen[:, at]
            gradient = _gradient(now, coefficients, apart) + self.known @ now - told[:, at]
            moved = self.curvature @ gradient if step < CHEAP_STEPS else self._by_own_curvature(now, gradient)
            scales = np.abs(moved[[MASS, *range(*GAUGE.indices(FRICTION_ERROR)), SENSITIVITY]]).max(axis=0)
            moved *= np.minimum(1.0, LONGEST_STEP / np.maximum(scales, LONGEST_STEP))
            unknowns[:, at] = now - moved
            left[at] = np.abs(moved[MASS])
        return np.where(left <= negligible, unknowns[MASS], np.nan)

    def _by_own_curvature(self, unknowns: Array, gradient: Array) -> Array:
        slopes = _slopes(unknowns, self.problem.m0_kg)
        hessian = slopes.swapaxes(1, 2) @ self.gram @ slopes + self.known
        scaled = hessian / np.outer(self.scale, self.scale)
        scaled += RIDGE * np.eye(self.scale.size)
        right = (gradient / self.scale[:, np.newaxis]).T[..., np.newaxis]
        return np.asarray(np.linalg.solve(scaled, right)[..., 0].T / self.scale[:, np.newaxis])


def _slopes(unknowns: Array, m0_kg: float) -> Array:
    """Return the derivatives of the coefficients by the unknowns, shape (n, n_columns, n_unknowns)."""
    n_columns = unknowns.shape[0] - 1
    coefficients = _coefficients(unknowns, m0_kg)
    slopes = np.empty((unknowns.shape[1], n_columns, unknowns.shape[0]))
    for column in range(n_columns):
        # the gradient is linear in the coefficients', so that of one alone is its derivatives
        one = np.zeros((n_columns, unknowns.shape[1]))
        one[column] = 1.0
        slopes[:, column] = _gradient(unknowns, coefficients, one).T
    return slopes


def _coefficients(unknowns: Array, m0_kg: float) -> Array:
    """Coefficients of the columns, shape (n_columns, n), under unknowns of shape (n_unknowns, n)."""
    per_force = (1.0 + unknowns[SENSITIVITY]) / (m0_kg * (1.0 + unknowns[MASS]))
    coefficients = np.empty((unknowns.shape[0] - 1, unknowns.shape[1]))
    coefficients[:3] = per_force / (1.0 + unknowns[GAUGE])
    coefficients[3] = per_force
    coefficients[4] = -unknowns[FRICTION_ERROR] * per_force
    coefficients[5:] = unknowns[BIAS:]
    return coefficients


def _gradient(unknowns: Array, coefficients: Array, by_coefficients: Array) -> Array:
    """Carry a gradient by the coefficients, shape (n_columns, n), to one by the unknowns, (n_unknowns, n).

    The coefficients are those under the unknowns.
    """
    relative, gain = 1.0 + unknowns[MASS], 1.0 + unknowns[SENSITIVITY]
    parts = by_coefficients[:5] * coefficients[:5]
    gradient = np.empty_like(unknowns)
    total = parts.sum(axis=0)
    gradient[MASS] = -total / relative
    gradient[GAUGE] = -parts[:3] / (1.0 + unknowns[GAUGE])
    gradient[FRICTION_ERROR] = -by_coefficients[4] * coefficients[3]
    gradient[SENSITIVITY] = total / gain
    gradient[BIAS:] = by_coefficients[5:]
    return gradient
