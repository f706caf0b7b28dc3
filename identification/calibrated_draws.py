"""Draws of the mass: what `identification.calibration` minimises, minimised again under drawn errors.

The modelled acceleration is a sum of fixed columns with coefficients that the unknowns give,

    a = F_breech g s_1 / m + F_brake g s_2 / m + F_recuperator g s_3 / m + F_friction g / m - s g df / m + r b + S z,

so the shot's rows enter by the triangle of the columns' QR factorisation alone, and as many draws as one likes
cost no more than a handful of rows each. Each draw adds an error to the rows, one to every calibration, and
is minimised with the exact gradient and the curvature at the estimate; what is nonlinear is thus kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.budget import BudgetRow
from identification.monte_carlo import Draw
from identification.sensor_observations import BIAS, FRICTION_ERROR, GAUGE, MASS, SENSITIVITY

Array = NDArray[np.float64]

MOST_STEPS = 30
"""Of the minimisation; each leaves some hundredths of the error of the one before."""
NEGLIGIBLE = 1e-4
"""Step over the mass's standard uncertainty, after which there is none."""
LONGEST_STEP = 0.3
"""Of a scale: further away the curvature at the estimate says nothing."""


@dataclass(frozen=True, eq=False)
class CalibratedProblem:
    """What was minimised, in as few rows as there are columns.

    Attributes
    ----------
    m0_kg : float
        First estimate, the unit of the mass's unknown.
    unknowns : ndarray, shape (n_unknowns,)
        The solution.
    triangle : ndarray, shape (n_columns, n_columns)
        Of forces (4), sliding, released and shifts.
    sigma_m_s2 : float
        That the rows were weighted with.
    noise_m_s2 : float
        Standard deviation of a row's error, with its correlation.
    degrees_of_freedom : float
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
        further : sequence of BudgetRow
            Contributions from outside of this problem; they are added as they stand, with their distribution.

        Returns
        -------
        callable
            A draw is NaN where the minimum was not found: the problem is then far from linear.
        """
        n_columns = self.triangle.shape[0]
        # the gradient is linear in the columns' errors, so those of one column each give its derivatives
        here = np.repeat(self.unknowns[:, np.newaxis], n_columns, axis=1)
        slopes = _gradient(here, self.m0_kg, np.eye(n_columns)).T
        jacobian = np.vstack([self.triangle @ slopes / self.sigma_m_s2, self.rows / self.u[:, np.newaxis]])
        scale = np.sqrt((jacobian**2).sum(axis=0))
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv(jacobian / scale) / scale[:, np.newaxis]
        curvature = inverse @ inverse.T
        gram = self.triangle.T @ self.triangle / self.sigma_m_s2**2
        known = (self.rows / self.u[:, np.newaxis] ** 2).T @ self.rows
        expected = _coefficients(self.unknowns[:, np.newaxis], self.m0_kg)
        u_mass = math.sqrt(float(curvature[MASS, MASS]))
        longest = np.full((self.unknowns.size, 1), np.inf)
        longest[[MASS, *range(*GAUGE.indices(FRICTION_ERROR)), SENSITIVITY]] = LONGEST_STEP

        def draw(rng: np.random.Generator, count: int) -> Array:
            # the noise's size is itself known from so many rows only (6.4.9)
            size = np.sqrt(self.degrees_of_freedom / rng.chisquare(self.degrees_of_freedom, count))
            noise = self.noise_m_s2 * size * rng.standard_normal((n_columns, count))
            seen = gram @ expected + self.triangle.T @ noise / self.sigma_m_s2**2
            told = (known @ self.unknowns)[:, np.newaxis]
            told = told + self.rows.T @ (rng.standard_normal((self.u.size, count)) / self.u[:, np.newaxis])
            unknowns = np.repeat(self.unknowns[:, np.newaxis], count, axis=1)
            for _ in range(MOST_STEPS):
                apart = gram @ _coefficients(unknowns, self.m0_kg) - seen
                gradient = _gradient(unknowns, self.m0_kg, apart) + known @ unknowns - told
                step = np.clip(curvature @ gradient, -longest, longest)
                unknowns = unknowns - step
                left = np.abs(step[MASS])
                if not (left > NEGLIGIBLE * u_mass).any():
                    break
            masses = np.where(left <= NEGLIGIBLE * u_mass, self.m0_kg * (1.0 + unknowns[MASS]), np.nan)
            for row in further:
                if row.distribution == "rectangular":
                    masses = masses + row.u_kg * math.sqrt(3.0) * rng.uniform(-1.0, 1.0, count)
                else:
                    masses = masses + row.u_kg * rng.standard_normal(count)
            return np.asarray(masses)

        return draw


def _coefficients(unknowns: Array, m0_kg: float) -> Array:
    """Coefficients of the columns, shape (n_columns, n), under unknowns of shape (n_unknowns, n)."""
    per_force = (1.0 + unknowns[SENSITIVITY]) / (m0_kg * (1.0 + unknowns[MASS]))
    coefficients = np.empty((unknowns.shape[0] - 1, unknowns.shape[1]))
    coefficients[:3] = per_force / (1.0 + unknowns[GAUGE])
    coefficients[3] = per_force
    coefficients[4] = -unknowns[FRICTION_ERROR] * per_force
    coefficients[5:] = unknowns[BIAS:]
    return coefficients


def _gradient(unknowns: Array, m0_kg: float, by_coefficients: Array) -> Array:
    """Carry a gradient by the coefficients, shape (n_columns, n), to one by the unknowns, (n_unknowns, n)."""
    relative, gain = 1.0 + unknowns[MASS], 1.0 + unknowns[SENSITIVITY]
    coefficients = _coefficients(unknowns, m0_kg)
    parts = by_coefficients[:5] * coefficients[:5]
    gradient = np.empty_like(unknowns)
    total = parts.sum(axis=0)
    gradient[MASS] = -total / relative
    gradient[GAUGE] = -parts[:3] / (1.0 + unknowns[GAUGE])
    gradient[FRICTION_ERROR] = -by_coefficients[4] * coefficients[3]
    gradient[SENSITIVITY] = total / gain
    gradient[BIAS:] = by_coefficients[5:]
    return gradient
