"""The rows in which an accelerometer's zero shift is looked for: least squares over mass, level and shapes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.shifted_zero import DECAYING, LEVEL, PARAMETERS, STEP, TAU

Array = NDArray[np.float64]
Shape = tuple[int, ...]
"""Columns in which the zero shifts: none, 0 for the step, 1 and more for the decays, or a step and a decay."""


@dataclass(frozen=True, eq=False)
class ShiftRows:
    """Rows of the regression.

    Attributes
    ----------
    target : ndarray, shape (n_rows,)
        Acceleration.
    fixed : ndarray, shape (n_rows, 2)
        Force, and 1 for the level.
    shapes : ndarray, shape (n_rows, 1 + n_time_constants)
    """

    target: Array
    fixed: Array
    shapes: Array

    def design(self, shape: Shape) -> Array:
        """Return the columns for a shape of shift, shape (n_rows, 2 + its columns)."""
        return np.column_stack([self.fixed, self.shapes[:, shape]])

    def residual(self, shape: Shape) -> Array:
        """Return what a shape leaves unexplained, shape (n_rows,)."""
        q, _ = np.linalg.qr(_scaled(self.design(shape))[0])
        return np.asarray(self.target - q @ (q.T @ self.target))

    def squares(self, shape: Shape) -> float:
        """Return the sum of squares of that."""
        residual = self.residual(shape)
        return float(residual @ residual)

    def effective_rows(self, shape: Shape) -> float:
        """Rows over the sum of the residual's autocorrelations, with Bartlett's weights; never more than there are."""
        residual = self.residual(shape)
        energy = float(residual @ residual)
        if energy == 0:
            return float(residual.size)
        lags = max(1, round(4 * (residual.size / 100) ** (2 / 9)))
        total = 1.0
        for lag in range(1, lags + 1):
            total += 2 * (1 - lag / (lags + 1)) * float(residual[lag:] @ residual[:-lag]) / energy
        return residual.size / max(1.0, total)

    def solve(
        self, shape: Shape, taus: Sequence[float], since_s: Array, effective: float
    ) -> tuple[Array, Array, float]:
        """Return the parameters in the order of `PARAMETERS`, their covariance, and the residual per row."""
        design, scale = _scaled(self.design(shape))
        found = np.linalg.lstsq(design, self.target, rcond=None)[0] / scale
        places = [0, LEVEL, *(STEP if j == 0 else DECAYING for j in shape)]
        values = np.zeros(len(PARAMETERS))
        values[places] = found
        values[TAU] = next((taus[j - 1] for j in shape if j), math.inf)
        jacobian = design * scale
        if math.isfinite(values[TAU]):
            # the decay's derivative by its time constant, d t / tau^2 exp(-t / tau): the filter's share in it is small
            t = np.maximum(since_s, 0.0)
            column = values[DECAYING] * t / values[TAU] ** 2 * np.exp(-t / values[TAU])
            jacobian, places = np.column_stack([jacobian, column]), [*places, TAU]
        residual = self.residual(shape)
        variance = float(residual @ residual) / max(residual.size - jacobian.shape[1], 1)
        unit, size = _scaled(jacobian)
        inverse = np.linalg.pinv(unit.T @ unit) / np.outer(size, size)
        covariance = np.zeros((len(PARAMETERS), len(PARAMETERS)))
        covariance[np.ix_(places, places)] = variance * residual.size / effective * inverse
        return values, covariance, math.sqrt(variance)


def _scaled(design: Array) -> tuple[Array, Array]:
    """Return the columns scaled to one, and their sizes; newtons and steps differ by six orders."""
    scale = np.sqrt((design**2).sum(axis=0))
    scale[scale == 0] = 1.0
    return design / scale, scale


def cost(shape: Shape) -> int:
    """Parameters of a shape: a decay has its time constant too."""
    return len(shape) + any(j > 0 for j in shape)


def f_test(without: float, within: float, numerator: int, denominator: float) -> tuple[float, float]:
    """Return the F-statistic of two sums of squares, and how probable chance makes one as high.

    Parameters
    ----------
    without, within : float
        Sums of squares without the further columns and with them.
    numerator : int
        Further parameters.
    denominator : float
        Degrees of freedom with them.
    """
    from scipy.stats import f

    if not (within > 0 and denominator > 0):
        return math.inf if without > within else 0.0, 0.0 if without > within else 1.0
    statistic = max(without - within, 0.0) / numerator / (within / denominator)
    return statistic, float(f.sf(statistic, numerator, denominator))
