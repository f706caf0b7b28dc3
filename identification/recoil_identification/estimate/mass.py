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
    `recoil_identification.calibration.calibration`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.estimate.budget import BudgetRow, combined_u, coverage_factor, effective_degrees_of_freedom
from recoil_identification.estimate.rounding import in_kg, rounded
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import PRESSURE_ROLES, Regression, telling_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty

MEASURAND = "the mass that the forces move: oil and rods that go along, and what was added for the shot, included"
MEASURAND_OF_SHOTS = "the mass that the forces move: oil and rods that go along included, what was added left out"
"""What mass a shot's report, and a campaign's, is about."""
LOGARITHMIC = ("calibrated", "camera")
"""Methods whose unknown is the logarithm of the mass, beside those of the scales."""
LARGEST_LOGARITHM = 700.0
"""Logarithm of the largest factor that is a number."""
RANDOM = ErrorSource(SourceKind.RANDOM)
"""Source of the budget row that statistics of the regression's residual give."""
ACCELERATION = ErrorSource(SourceKind.SENSITIVITY, "recoil_acceleration")
FRICTION = ErrorSource(SourceKind.FRICTION)
"""Sources of the budget rows of the accelerometer's scale and of the friction."""


def force_scale(force: str) -> ErrorSource:
    """Return the source that is the scale of a measured force, by its name: a pressure's is that of its area, too."""
    return ErrorSource(SourceKind.FORCE_SCALE if force in PRESSURE_ROLES else SourceKind.SENSITIVITY, force)


def motion_scale(role: str) -> ErrorSource:
    """Return the source that is the scale of what measured the motion, by its role."""
    return ErrorSource(SourceKind.SENSITIVITY, role)


GAUGES = tuple(map(force_scale, PRESSURE_ROLES))
"""Those of a gun's forces."""


@dataclass(frozen=True)
class MassEstimate:
    """A mass with its uncertainty and where that comes from.

    Attributes
    ----------
    budget
        Independent contributions; their root sum of squares is `u_kg`.
    rows
        Rows with errors of their own.
    residual_m_s2
        Standard deviation of the residual of the acceleration.
    """

    method: str
    mass_kg: float
    budget: tuple[BudgetRow, ...]
    rows: int
    residual_m_s2: float

    @property
    def u_kg(self) -> float:
        """Combined standard uncertainty."""
        return combined_u(self.budget)

    @property
    def degrees_of_freedom(self) -> float:
        """Effective degrees of freedom of it."""
        return effective_degrees_of_freedom(self.budget)

    @property
    def coverage_factor(self) -> float:
        """Factor on it for 95 %; that of one degree of freedom is the largest that is stated."""
        return coverage_factor(max(self.degrees_of_freedom, 1.0))

    @property
    def interval_kg(self) -> tuple[float, float]:
        """95 % coverage interval: symmetric in ln m where that is the unknown, for there the fit is linear."""
        half = self.coverage_factor * self.u_kg
        if self.method in LOGARITHMIC:
            by = math.exp(min(half / self.mass_kg, LARGEST_LOGARITHM))
            return self.mass_kg / by, self.mass_kg * by
        return self.mass_kg - half, self.mass_kg + half

    def __str__(self) -> str:
        low, high = (rounded(end, self.u_kg)[0] for end in self.interval_kg)
        rows = sorted(self.budget, key=lambda row: -row.u_kg)
        return "\n".join(
            [
                f"{in_kg(self.mass_kg, self.u_kg)}, 95 % {low} kg to {high} kg, by {self.method}",
                *(f"  {row.source:<50}{row.u_kg:>10.3g} kg" for row in rows),
            ]
        )


def forward_mass(regression: Regression, scales: ScaleUncertainty) -> MassEstimate:
    """Estimate by least squares of force on acceleration.

    Raises
    ------
    IdentificationError
        If the interval has too few rows, or force and acceleration have nothing in common.
    """
    rows = telling_rows(regression)
    a, f = regression.acceleration_m_s2[rows], regression.force_n[rows]
    mass = float(a @ f / (a @ a))
    residual = f - mass * a
    u = _standard_error(residual, a)
    # m = a.F / a.a  is linear in every force
    changes = _regressors(regression, rows).T @ a / (a @ a)
    return _estimate("forward", mass, u, changes, scales, _deviation(residual, 1) / mass, rows.size, residual)


def reverse_mass(regression: Regression, scales: ScaleUncertainty) -> MassEstimate:
    """Estimate by least squares of acceleration on force.

    Raises
    ------
    IdentificationError
        If the interval has too few rows, or force and acceleration have nothing in common.
    """
    rows = telling_rows(regression)
    a, f = regression.acceleration_m_s2[rows], regression.force_n[rows]
    inverse = float(a @ f / (f @ f))
    residual = a - inverse * f
    mass = 1.0 / inverse
    u = mass**2 * _standard_error(residual, f)
    # derivatives of  m = F.F / a.F
    columns = _regressors(regression, rows)
    changes = mass * (2 * (columns.T @ f) / (f @ f) - (columns.T @ a) / (a @ f))
    return _estimate("reverse", mass, u, changes, scales, _deviation(residual, 1), rows.size, residual)


def correlation_factor(residual: Array) -> float:
    """Factor on a standard error for first-order autoregressive errors, ``sqrt((1 + r) / (1 - r))``, at least 1.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Residual in order of time.
    """
    energy = float(residual @ residual)
    if residual.size < 3 or energy == 0:
        return 1.0
    r = min(max(float(residual[1:] @ residual[:-1]) / energy, 0.0), 0.95)
    return math.sqrt((1 + r) / (1 - r))


def _regressors(regression: Regression, rows: NDArray[np.int64]) -> Array:
    """Return what a relative error of each gauge, and a newton of friction after them, add to the force."""
    return np.column_stack([regression.forces_n[rows, :-1], regression.friction_direction[rows]])


def _deviation(residual: Array, parameters: int) -> float:
    return math.sqrt(float(residual @ residual) / max(residual.size - parameters, 1))


def _standard_error(residual: Array, regressor: Array) -> float:
    return _deviation(residual, 1) / math.sqrt(float(regressor @ regressor)) * correlation_factor(residual)


def independent_rows(residual: Array, parameters: int) -> float:
    """Degrees of freedom of correlated residuals: rows over the square of `correlation_factor`, less parameters.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Residual in order of time.

    Returns
    -------
    float
        Factor, at least 1.
    """
    return max(residual.size / correlation_factor(residual) ** 2 - parameters, 1.0)


def _estimate(
    method: str,
    mass: float,
    u_random: float,
    changes: Array,
    scales: ScaleUncertainty,
    residual_m_s2: float,
    rows: int,
    residual: Array,
) -> MassEstimate:
    random = BudgetRow(RANDOM, u_random, "A", degrees_of_freedom=independent_rows(residual, 1))
    return MassEstimate(method, mass, (random, *rows_of_sensors(mass, changes, scales)), rows, residual_m_s2)


def rows_of_sensors(mass_kg: float, changes_kg: Array, scales: ScaleUncertainty) -> tuple[BudgetRow, ...]:
    """Weigh the answers of a mass to the scales and the friction with their uncertainties.

    Parameters
    ----------
    changes_kg : ndarray, shape (n_gauges + 1,)
        Amount by which the mass rises if a gauge reads high by its whole, and if the friction is declared a newton too
        large.
    """
    *gauges, friction = (float(change) for change in changes_kg)
    listed = [
        (motion_scale(scales.motion_role), -mass_kg, scales.acceleration, "1"),
        *(
            (force_scale(name), change, u, "1")
            for name, change, u in zip(scales.forces, gauges, scales.gauges, strict=True)
        ),
        (FRICTION, friction, scales.friction_n, "N"),
    ]
    return tuple(
        BudgetRow(name, abs(change) * u, "B", change, unit, scope="rig" if name == FRICTION else "sensor")
        for name, change, u, unit in listed
    )
