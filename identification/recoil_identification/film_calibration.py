"""The mass by a camera together with the scales of the gauges, restricted by their calibrations.

A shot sees every force in another mixture, first the breech, then brake and recuperator; the displacement tells them
apart as far as their double integrals differ. So the mass, an error of every gauge, the friction, the velocity of the
release and the clocks' offset are solved for at once, each restricted by what is known of it
(`estimators.double_impulse`): what `calibration` does with an accelerometer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_identification.budget import BudgetRow
from recoil_identification.mass import FRICTION, GAUGES, RANDOM, MassEstimate, correlation_factor, independent_rows
from recoil_identification.sensor_priors import CAMERA_SCALE, RELEASE
from recoil_processing.shot.clocks.double_impulse import DoubleImpulseMass
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty

Array = NDArray[np.float64]

LEAST_REDUNDANCY = 1e-6
"""Below this share of its variance the film says nothing about a calibration."""
UNITS = ("1", "1", "1", "N")
"""Of the errors: three gauges and the friction."""
OWN_UNKNOWNS = 4
"""1/m, x0, v0 and tau: what the frames are fitted with besides the errors, whose calibrations are rows of their own."""


@dataclass(frozen=True, eq=False)
class FilmCalibration(ReadOnlyArrays):
    """Mass and gauge errors as this shot's film and the calibrations together say.

    Attributes
    ----------
    estimate
        With the rows of noise, gauges, friction, release and the camera's scale; its residual is that of the
        acceleration by the camera, NaN before `with_residual`.
    gauge_errors : ndarray, shape (3,)
        Relative errors of breech, brake and recuperator force.
    friction_error_n
        By how much the declared friction is too large, N.
    release_m_s
        Velocity that stop and packing gave the part while they let it go.
    covariance : ndarray, shape (4, 4)
        Of gauge and friction errors.
    u_camera
        Relative standard uncertainty of the camera's scale.
    pulls, normalised_residuals
        As of `recoil_identification.calibration.Calibration`.
    """

    estimate: MassEstimate
    gauge_errors: Array
    friction_error_n: float
    release_m_s: float
    covariance: Array
    u_camera: float
    pulls: dict[str, float]
    normalised_residuals: dict[str, float]

    @classmethod
    def of(
        cls, found: DoubleImpulseMass, u_random_kg: float, scales: ScaleUncertainty, u_camera: float
    ) -> FilmCalibration:
        """State what a film found.

        Parameters
        ----------
        found
            With three gauges and the friction as the first errors of the force.
        u_random_kg
            Standard uncertainty of the mass by noise alone; it is widened by what correlation the residuals have left.
        u_camera
            Relative, of the camera's scale.
        """
        u = np.array([*scales.gauges, scales.friction_n])
        random = BudgetRow(
            RANDOM,
            u_random_kg * correlation_factor(found.residuals),
            "A",
            degrees_of_freedom=independent_rows(found.residuals, OWN_UNKNOWNS),
        )
        budget, pulls, normalised_residuals = [random], {}, {}
        for j, (source, unit) in enumerate(zip((*GAUGES, FRICTION), UNITS, strict=True)):
            if not u[j] > 0:
                continue
            answer = float(found.force_sensitivities_kg[j])
            budget.append(BudgetRow(source, abs(answer), "B", answer / float(u[j]), unit))
            off = float(found.force_errors[j] / u[j])
            redundancy = 1.0 - float(found.force_error_covariance[j, j]) / float(u[j]) ** 2
            pulls[source] = off
            normalised_residuals[source] = off / math.sqrt(redundancy) if redundancy > LEAST_REDUNDANCY else 0.0
        budget.append(BudgetRow(RELEASE, found.u_zero_kg, "B"))
        answer = found.scale_sensitivity_kg
        budget.append(BudgetRow(CAMERA_SCALE, abs(answer) * u_camera, "B", answer))
        return cls(
            MassEstimate("camera", found.mass_kg, tuple(budget), found.frames, math.nan),
            found.force_errors[:3].copy(),
            float(found.force_errors[3]),
            found.velocity_m_s,
            found.force_error_covariance[: u.size, : u.size].copy(),
            u_camera,
            pulls,
            normalised_residuals,
        )

    def with_residual(self, regression: Regression) -> FilmCalibration:
        """State the residual of a filtered regression, so that estimates by other methods compare."""
        rows = spaced_rows(regression)
        acceleration, force = self.correct(regression)
        residual = acceleration[rows] - force[rows] / self.estimate.mass_kg
        deviation = math.sqrt(float(residual @ residual) / max(rows.size - 1, 1))
        return replace(self, estimate=replace(self.estimate, residual_m_s2=deviation))

    def correct(self, regression: Regression) -> tuple[Array, Array]:
        """Return a' and F' with the gauges' errors and the release taken off, shape (n,) each."""
        a = regression.acceleration_m_s2 - self.release_m_s * regression.release_per_s
        gauges = regression.forces_n[:, :3] @ (1.0 / (1.0 + self.gauge_errors))
        return a, np.asarray(gauges + regression.forces_n[:, 3] - self.friction_error_n * regression.friction_direction)

    def errors_left(self, regression: Regression) -> Array:
        """Return what the gauges' errors, the friction's and the camera's scale may still do to a', shape (n, 5).

        Each column is one standard uncertainty of an error that is independent of the others.
        """
        m = self.estimate.mass_kg
        columns = -np.column_stack([regression.forces_n[:, :3], regression.friction_direction]) / m
        variances, directions = np.linalg.eigh(self.covariance)
        by_force = columns @ (directions * np.sqrt(np.maximum(variances, 0.0)))
        return np.column_stack([by_force, self.u_camera * regression.force_n / m])
