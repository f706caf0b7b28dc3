"""The mass of the whole shot, by named estimators.

``reverse``
    Acceleration on force: ``1/m = sum a F / sum F^2``. Noise of the accelerometer, the larger one, is
    then an error of the response and does not bias the slope.
``forward``
    Force on acceleration, the paper's form: ``m = sum a F / sum a^2``. Noise of the accelerometer
    enlarges the denominator: the mass comes out low (attenuation by errors in variables). With both
    filtered alike the two bracket the mass (Frisch's bracket).
``calibrated``
    Acceleration on all forces at once, with the scale of every sensor, the friction and the
    accelerometer's zero as further unknowns that their calibrations restrict: see
    `identification.calibration`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq.errors import IdentificationError
from identification.regression import FORCES, Regression, spaced_rows

Array = NDArray[np.float64]

RANDOM = "random errors of this shot"
"""Name of the budget row that statistics of the regression's residual give."""

COVERAGE_FACTOR = 1.959963984540054
"""97.5 % quantile of the normal distribution."""


@dataclass(frozen=True)
class BudgetRow:
    """One line of an uncertainty budget.

    Attributes
    ----------
    source : str
    u_kg : float
        Contribution to the standard uncertainty of the mass.
    kind : str
        ``A`` by statistics of this shot, ``B`` by other knowledge (JCGM 100:2008, 4.2 and 4.3).
    sensitivity : float or None
        Change of the mass in kg per unit of the source's relative error, where that is what it is.
    """

    source: str
    u_kg: float
    kind: str
    sensitivity: float | None = None


@dataclass(frozen=True)
class MassEstimate:
    """A mass with its uncertainty and where that comes from.

    Attributes
    ----------
    method : str
    mass_kg : float
    budget : tuple of BudgetRow
        Independent contributions; their root sum of squares is `u_kg`.
    rows : int
        Rows with errors of their own.
    residual_m_s2 : float
        Standard deviation of the residual of the acceleration.
    notes : tuple of str
    """

    method: str
    mass_kg: float
    budget: tuple[BudgetRow, ...]
    rows: int
    residual_m_s2: float
    notes: tuple[str, ...] = ()

    @property
    def u_kg(self) -> float:
        """Combined standard uncertainty."""
        return math.sqrt(sum(row.u_kg**2 for row in self.budget))

    @property
    def interval_kg(self) -> tuple[float, float]:
        """95 % coverage interval."""
        half = COVERAGE_FACTOR * self.u_kg
        return self.mass_kg - half, self.mass_kg + half


@dataclass(frozen=True)
class ScaleUncertainty:
    """Relative standard uncertainties of what the scale of the mass hangs on.

    Attributes
    ----------
    acceleration : float
        Of the accelerometer's sensitivity.
    forces : tuple of float
        Of each force in the order of `FORCES`: gauge and area together; of the friction itself last.
    """

    acceleration: float
    forces: tuple[float, float, float, float]


def forward_mass(regression: Regression, scales: ScaleUncertainty) -> MassEstimate:
    """Estimate by least squares of force on acceleration."""
    rows = _rows(regression)
    a, parts = regression.acceleration_m_s2[rows], regression.forces_n[rows]
    f = parts.sum(axis=1)
    mass = float(a @ f / (a @ a))
    residual = f - mass * a
    u = _standard_error(residual, a)
    shares = parts.T @ a / (a @ a) / mass
    return _estimate("forward", mass, u, shares, scales, rows.size, float(np.std(residual)) / mass)


def reverse_mass(regression: Regression, scales: ScaleUncertainty) -> MassEstimate:
    """Estimate by least squares of acceleration on force."""
    rows = _rows(regression)
    a, parts = regression.acceleration_m_s2[rows], regression.forces_n[rows]
    f = parts.sum(axis=1)
    inverse = float(a @ f / (f @ f))
    residual = a - inverse * f
    mass = 1.0 / inverse
    u = mass**2 * _standard_error(residual, f)
    # d ln m / d ln F_j of  m = F.F / a.F
    shares = 2 * (parts.T @ f) / (f @ f) - (parts.T @ a) / (a @ f)
    return _estimate("reverse", mass, u, shares, scales, rows.size, float(np.std(residual)))


def correlation_factor(residual: Array) -> float:
    """Factor on a standard error for first-order autoregressive errors, ``sqrt((1 + r) / (1 - r))``, at least 1.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        In order of time.
    """
    energy = float(residual @ residual)
    if residual.size < 3 or energy == 0:
        return 1.0
    r = min(max(float(residual[1:] @ residual[:-1]) / energy, 0.0), 0.95)
    return math.sqrt((1 + r) / (1 - r))


def _rows(regression: Regression) -> NDArray[np.int64]:
    rows = spaced_rows(regression)
    if rows.size < 10:
        raise IdentificationError(
            f"only {rows.size} independent rows in the identification interval",
            expected="at least 10",
            remedy="check for lost samples, or raise the cut-off",
        )
    return rows


def _standard_error(residual: Array, regressor: Array) -> float:
    variance = float(residual @ residual) / max(residual.size - 1, 1)
    return math.sqrt(variance / float(regressor @ regressor)) * correlation_factor(residual)


def _estimate(
    method: str, mass: float, u_random: float, shares: Array, scales: ScaleUncertainty, rows: int, residual: float
) -> MassEstimate:
    budget = [BudgetRow(RANDOM, u_random, "A")]
    budget.append(BudgetRow("recoil_acceleration sensitivity", mass * scales.acceleration, "B", -mass))
    for name, share, u in zip(FORCES, shares, scales.forces, strict=True):
        budget.append(BudgetRow(_source(name), abs(float(share)) * u * mass, "B", float(share) * mass))
    return MassEstimate(method, mass, tuple(budget), rows, residual)


def _source(force: str) -> str:
    return "packing friction" if force == "friction" else f"{force}_pressure sensitivity and area"
