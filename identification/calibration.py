"""The mass together with the scales of the sensors, restricted by their calibrations.

A shot sees every force in another mixture: first the breech, then brake and recuperator. If the
breech gauge reads 0.7 % low, the mass that its phase gives disagrees with the mass that the brake's
phase gives. So the equation of motion is solved for the mass and for a relative error of every
sensor's scale at once; each error is restricted by its standard uncertainty, the accelerometer's also
by the camera, which measured the same motion in another scale. This is Bayesian linear regression with
normal priors, or generalized least squares with the calibrations as further observations.

With ``a = (1 + da) a_true + b`` and ``F_j = (1 + dj) F_j,true``, to first order around a mass m0,

    a - F/m0 = (F/m0)(da - dm) - sum_j (F_j/m0) dj + b,        m = m0 (1 + dm).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.mass import RANDOM, BudgetRow, MassEstimate, ScaleUncertainty, correlation_factor, reverse_mass
from identification.regression import FORCES, Regression, spaced_rows

Array = NDArray[np.float64]

_UNKNOWNS = ("mass", *FORCES, "acceleration", "bias")
_MASS, _ACCELERATION, _BIAS = 0, 5, 6


@dataclass(frozen=True)
class CameraScale:
    """What the camera says of the accelerometer.

    Attributes
    ----------
    gain, u_gain : float
        Camera's scale over the accelerometer's, from the fit of the displacement.
    bias_m_s2, u_bias_m_s2 : float
        Constant acceleration that the accelerometer lacks, in the camera's scale, and its standard
        uncertainty from the fit.
    correlation : float
        Of these two estimates.
    u_rel : float
        Relative standard uncertainty of the camera's own scale.
    """

    gain: float
    u_gain: float
    bias_m_s2: float
    u_bias_m_s2: float
    correlation: float
    u_rel: float


@dataclass(frozen=True, eq=False)
class Calibration:
    """Mass and sensor errors as this shot and the calibrations together say.

    Attributes
    ----------
    estimate : MassEstimate
    force_errors : ndarray, shape (4,)
        Relative errors of the forces in the order of `FORCES`.
    acceleration_error : float
        Relative error of the accelerometer's sensitivity.
    bias_m_s2 : float
        Error of its zero.
    departures : dict of str to float
        By how many of its standard uncertainties each sensor would have to be off.
    """

    estimate: MassEstimate
    force_errors: Array
    acceleration_error: float
    bias_m_s2: float
    departures: dict[str, float]

    def correct(self, regression: Regression) -> tuple[Array, Array]:
        """Return a' and F' with the sensors' errors taken off, shape (n,) each."""
        a = (regression.acceleration_m_s2 - self.bias_m_s2 * regression.released) / (1 + self.acceleration_error)
        return a, np.asarray(regression.forces_n @ (1.0 / (1.0 + self.force_errors)))


def calibrated_mass(
    regression: Regression, scales: ScaleUncertainty, u_bias_m_s2: float, camera: CameraScale | None
) -> Calibration:
    """Estimate the mass with the sensors' scales as restricted unknowns.

    Parameters
    ----------
    regression : Regression
        Filtered.
    scales : ScaleUncertainty
    u_bias_m_s2 : float
        Standard uncertainty of the accelerometer's zero from the silence before the shot; infinite if
        there was none.
    camera : CameraScale or None

    Raises
    ------
    IdentificationError
        If the interval has too few rows.
    """
    first = reverse_mass(regression, scales)
    rows = spaced_rows(regression)
    a, parts = regression.acceleration_m_s2[rows], regression.forces_n[rows]
    m0 = first.mass_kg
    f = parts.sum(axis=1)
    design = np.column_stack([-f / m0, -parts / m0, f / m0, regression.released[rows]])
    target = a - f / m0
    observations = _prior_observations(scales, u_bias_m_s2, camera)
    variance = max(first.residual_m_s2**2, 1e-18)
    for _ in range(8):
        solution, gain = _solve(design, target, variance, observations)
        residual = target - design @ solution
        before, variance = variance, max(float(residual @ residual) / max(rows.size - 2, 1), 1e-18)
        if abs(variance / before - 1) < 1e-6:
            break
    solution, gain = _solve(design, target, variance * correlation_factor(residual) ** 2, observations)
    mass = m0 * (1 + float(solution[_MASS]))
    random = mass * math.sqrt(variance) * correlation_factor(residual) * float(np.linalg.norm(gain[0][_MASS]))
    budget = [BudgetRow(RANDOM, random, "A")]
    for column, (name, _, _, u) in enumerate(observations):
        # each prior is an observation with its own error; its column of the gain is the sensitivity
        sensitivity = mass * float(gain[1][_MASS, column])
        budget.append(BudgetRow(name, abs(sensitivity) * u, "B", sensitivity))
    departures = {
        name: float((value - row @ solution) / u) for name, row, value, u in observations if u > 0 and math.isfinite(u)
    }
    estimate = MassEstimate("calibrated", mass, _merged(budget), int(rows.size), math.sqrt(variance), first.notes)
    return Calibration(
        estimate, solution[1:5].copy(), float(solution[_ACCELERATION]), float(solution[_BIAS]), departures
    )


_Observation = tuple[str, Array, float, float]


def _prior_observations(scales: ScaleUncertainty, u_bias_m_s2: float, camera: CameraScale | None) -> list[_Observation]:
    """Return what is known besides the shot's rows: (name, row over the unknowns, value, standard uncertainty)."""
    observations: list[_Observation] = []

    def observe(name: str, value: float, u: float, **weights: float) -> None:
        row = np.zeros(len(_UNKNOWNS))
        for unknown, weight in weights.items():
            row[_UNKNOWNS.index(unknown)] = weight
        observations.append((name, row, value, max(u, 1e-9)))

    for force, u in zip(FORCES, scales.forces, strict=True):
        name = "packing friction" if force == "friction" else f"{force}_pressure sensitivity and area"
        observe(name, 0.0, u, **{force: 1.0})
    observe("recoil_acceleration sensitivity", 0.0, scales.acceleration, acceleration=1.0)
    if math.isfinite(u_bias_m_s2):
        observe("recoil_acceleration zero", 0.0, u_bias_m_s2, bias=1.0)
    if camera is not None:
        # gain = (1 + dc)/(1 + da) and bias = -c2/gain; the second is made independent of the first
        u_gain = math.hypot(camera.u_gain, camera.u_rel)
        observe("camera scale", camera.gain - 1.0, u_gain, acceleration=-1.0)
        slope = camera.correlation * camera.u_bias_m_s2 / camera.u_gain if camera.u_gain > 0 else 0.0
        share = (camera.u_gain / u_gain) ** 2
        u_given = camera.u_bias_m_s2 * math.sqrt(max(1.0 - camera.correlation**2 * share, 1e-6))
        value = -(camera.bias_m_s2 - slope * share * (camera.gain - 1.0))
        observe("camera zero of the acceleration", value, u_given, bias=1.0, acceleration=-slope * share)
    return observations


def _solve(
    design: Array, target: Array, variance: float, observations: list[_Observation]
) -> tuple[Array, tuple[Array, Array]]:
    """Weighted least squares; also the gain that maps errors of rows and observations to the solution."""
    prior_rows = np.array([row / u for _, row, _, u in observations])
    prior_values = np.array([value / u for _, _, value, u in observations])
    sigma = math.sqrt(variance)
    full = np.vstack([design / sigma, prior_rows])
    values = np.concatenate([target / sigma, prior_values])
    scale = np.sqrt((full**2).sum(axis=0))
    scale[scale == 0] = 1.0
    inverse = np.linalg.pinv(full / scale) / scale[:, None]
    n = design.shape[0]
    u = np.array([u for *_, u in observations])
    return inverse @ values, (inverse[:, :n] / sigma, inverse[:, n:] / u)


def _merged(budget: list[BudgetRow]) -> tuple[BudgetRow, ...]:
    return tuple(row for row in budget if row.u_kg > 0)
