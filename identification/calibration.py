"""The mass together with the scales of the sensors, restricted by their calibrations.

A shot sees every force in another mixture: first the breech, then brake and recuperator. If the
breech gauge reads 0.7 % low, the mass that its phase gives disagrees with the mass that the brake's
phase gives. So the equation of motion is solved for the mass and for an error of every sensor at once;
each error is restricted by its standard uncertainty, the accelerometer's also by the camera, which
measured the same motion in another scale. This is Bayesian regression with normal priors, or
generalized least squares with the calibrations as further observations.

The accelerometer reads ``a = (1 + da) a' + b`` while the part is free, gauge j reads
``F_j = (1 + dj) F_j,true``, and the friction is declared by ``df`` too large, so that

    a = (1 + da) [sum_j F_j / (1 + dj) + (R - df) s] / (m0 (1 + dm)) + b,        m = m0 (1 + dm),

with the friction's direction s and a first estimate m0. Where the zero shifted at the shot, columns of
the shapes that a shift may have are added, each with a coefficient that nothing restricts. It is solved by
Gauss and Newton's iteration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.mass import (
    ACCELERATION,
    FRICTION,
    GAUGES,
    RANDOM,
    BudgetRow,
    MassEstimate,
    ScaleUncertainty,
    correlation_factor,
    reverse_mass,
)
from identification.regression import Regression, spaced_rows

Array = NDArray[np.float64]

ZERO = "recoil_acceleration zero"
CAMERA_SCALE = "camera scale"
CAMERA_ZERO = "camera zero of the acceleration"
CAMERA_SHIFT = "camera shift of the acceleration's zero"
"""Names of the further budget rows."""

_MASS, _GAUGES, _FRICTION, _ACCELERATION, _BIAS = 0, slice(1, 4), 4, 5, 6
_UNKNOWNS = 7

LARGEST_RESIDUAL = 0.01
"""Share of the acceleration's peak that may be noise; for what is beyond, the sensors must answer."""
LARGEST_SIGNIFICANCE = 3.29
"""Of a sensor's departure from its calibration; by chance one of 1000 goes beyond, as in Baarda's w-test."""
LARGEST_STEP = 0.3
"""Of a scale in one iteration: a shot that no calibration fits would otherwise throw a scale beyond zero."""
SMALLEST_U = 1e-9
"""In the place of a standard uncertainty of zero: what is exactly known must not divide by it."""
SMALLEST_SIGMA_M_S2 = 1e-9
"""In the place of the residual of a record without noise."""
LEAST_REDUNDANCY = 1e-6
"""Below this share of its variance the other data say nothing about an observation."""


@dataclass(frozen=True, eq=False)
class CameraScale:
    """What the camera says of the accelerometer.

    Attributes
    ----------
    gain : float
        Camera's scale over the accelerometer's.
    zeros_m_s2 : ndarray, shape (1 + n_shifts,)
        By how much the accelerometer reads too high throughout, and the size of each shape in which its zero
        shifted, in its own scale.
    covariance : ndarray, shape (2 + n_shifts, 2 + n_shifts)
        Of these estimates, the gain's first, by the fit of the displacement alone.
    u_rel : float
        Relative standard uncertainty of the camera's own scale.
    kick : int or None
        Which of the shapes, if any, is an impulse: its size is in m/s.
    """

    gain: float
    zeros_m_s2: Array
    covariance: Array
    u_rel: float
    kick: int | None = None

    @classmethod
    def of_constant(
        cls, gain: float, u_gain: float, constant_m_s2: float, u_constant_m_s2: float, correlation: float, u_rel: float
    ) -> CameraScale:
        """Take gain and constant of an alignment by motion: the constant is the gain times what the zero lacks.

        Parameters
        ----------
        gain, u_gain : float
        constant_m_s2, u_constant_m_s2 : float
            Constant acceleration in the camera's scale that the accelerometer lacks.
        correlation : float
            Of these two estimates.
        u_rel : float
        """
        own = correlation * u_gain * u_constant_m_s2
        change = np.array([[1.0, 0.0], [constant_m_s2 / gain**2, -1.0 / gain]])
        covariance = change @ np.array([[u_gain**2, own], [own, u_constant_m_s2**2]]) @ change.T
        return cls(gain, np.array([-constant_m_s2 / gain]), covariance, u_rel)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Mass and sensor errors as this shot and the calibrations together say.

    Attributes
    ----------
    estimate : MassEstimate
    gauge_errors : ndarray, shape (3,)
        Relative errors of breech, brake and recuperator force.
    friction_error_n : float
        By how much the declared friction is too large, N.
    acceleration_error : float
        Relative error of the accelerometer's sensitivity.
    bias_m_s2 : float
        Error of its zero.
    shifts_m_s2, u_shifts_m_s2 : ndarray, shape (n_shifts,)
        Size of each shape of the regression's `shifts`, and its standard uncertainty.
    departures : dict of str to float
        By how many of its standard uncertainties each sensor is off; those known exactly are left out.
    significances : dict of str to float
        The same over the departure's own standard deviation (Baarda's w-test of one observation among
        the others): standard normal if all calibrations hold. It exceeds the departure where the shot
        can tell little of a sensor; 0 where it can tell nothing.
    largest_residual_m_s2 : float
        `LARGEST_RESIDUAL` of this shot's acceleration; a residual beyond it is no noise.
    noise_m_s2 : float
        Standard deviation of the residual, widened by its correlation.
    misfit : float
        What was minimised: squares of residuals over the noise, and of departures over their uncertainties.
    """

    estimate: MassEstimate
    gauge_errors: Array
    friction_error_n: float
    acceleration_error: float
    bias_m_s2: float
    shifts_m_s2: Array
    u_shifts_m_s2: Array
    departures: dict[str, float]
    significances: dict[str, float]
    largest_residual_m_s2: float
    noise_m_s2: float
    misfit: float

    def correct(self, regression: Regression) -> tuple[Array, Array]:
        """Return a' and F' with the sensors' errors taken off, shape (n,) each."""
        zero = self.bias_m_s2 * regression.released
        if regression.shifts is not None:
            zero = zero + regression.shifts @ self.shifts_m_s2
        a = (regression.acceleration_m_s2 - zero) / (1.0 + self.acceleration_error)
        gauges = regression.forces_n[:, :3] @ (1.0 / (1.0 + self.gauge_errors))
        return a, np.asarray(gauges + regression.forces_n[:, 3] - self.friction_error_n * regression.sliding)


class _Observation(NamedTuple):
    """What is known besides the shot's rows.

    The unknowns weighted by ``row`` were seen as ``value`` with standard uncertainty ``u``. If the source
    reads high by one ``unit``, the value is by that much below what the unknowns then are: the value of
    a calibration stays 0 while the sensor's error is 1.
    """

    source: str
    row: Array
    value: float
    u: float
    unit: str


class _Solution(NamedTuple):
    """Weighted least squares: the unknowns, their covariance, and the mass's answer to rows and observations."""

    unknowns: Array
    covariance: Array
    by_rows: Array
    by_observations: Array


def calibrated_mass(
    regression: Regression,
    scales: ScaleUncertainty,
    u_bias_m_s2: float,
    camera: CameraScale | None,
    *,
    noise_m_s2: float | None = None,
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
    noise_m_s2 : float, optional
        Of a row; found from the residuals if left out.

    Returns
    -------
    Calibration

    Raises
    ------
    IdentificationError
        If the interval has too few rows, or force and acceleration have nothing in common.
    """
    first = reverse_mass(regression, scales)
    rows = spaced_rows(regression)
    a, forces = regression.acceleration_m_s2[rows], regression.forces_n[rows]
    released, sliding = regression.released[rows], regression.sliding[rows]
    shifts = np.zeros((rows.size, 0)) if regression.shifts is None else regression.shifts[rows]
    observations = _observations(scales, u_bias_m_s2, camera, shifts.shape[1])
    # of the whole motion, lost samples and all: what is left of a pulse that was lost does not tell the noise's size
    peak = float(np.max(np.abs(regression.acceleration_m_s2[regression.inside])))
    sigma = _plausible(first.residual_m_s2 if noise_m_s2 is None else noise_m_s2, peak)
    unknowns = np.zeros(_UNKNOWNS + shifts.shape[1])
    for _ in range(50):
        model, design = _linearised(unknowns, first.mass_kg, forces, released, sliding, shifts)
        target = a - model + design @ unknowns
        solution = _solve(design, target, sigma, observations)
        residual = target - design @ solution.unknowns
        step = solution.unknowns - unknowns
        scales_moved = float(np.max(np.abs(step[[_MASS, *range(*_GAUGES.indices(_UNKNOWNS)), _ACCELERATION]])))
        step *= min(1.0, LARGEST_STEP / max(scales_moved, LARGEST_STEP))
        moved = float(np.max(np.abs(design @ step)))
        # of the unknowns the mass and the shifts are not restricted and the zero hardly
        deviation = math.sqrt(float(residual @ residual) / max(rows.size - 2 - shifts.shape[1], 1))
        noise = deviation * correlation_factor(residual)
        before, sigma = sigma, _plausible(noise if noise_m_s2 is None else noise_m_s2, peak)
        unknowns = unknowns + step
        if moved < 1e-9 * peak and abs(sigma / before - 1.0) < 1e-6:
            break
    mass = first.mass_kg * (1.0 + float(unknowns[_MASS]))
    budget = [BudgetRow(RANDOM, first.mass_kg * noise * float(np.linalg.norm(solution.by_rows)), "A")]
    misfit = float(residual @ residual) / sigma**2
    departures, significances = {}, {}
    for o, effect in zip(observations, solution.by_observations, strict=True):
        misfit += (float(o.row @ unknowns - o.value) / o.u) ** 2
        if o.u > SMALLEST_U:
            sensitivity = -first.mass_kg * float(effect)
            budget.append(BudgetRow(o.source, abs(sensitivity) * o.u, "B", sensitivity, o.unit))
            off = float(o.row @ unknowns - o.value) / o.u
            # the rest of its variance: what the others say of it
            redundancy = 1.0 - float(o.row @ solution.covariance @ o.row) / o.u**2
            departures[o.source] = off
            significances[o.source] = off / math.sqrt(redundancy) if redundancy > LEAST_REDUNDANCY else 0.0
    return Calibration(
        MassEstimate("calibrated", mass, tuple(budget), int(rows.size), deviation),
        unknowns[_GAUGES].copy(),
        float(unknowns[_FRICTION]),
        float(unknowns[_ACCELERATION]),
        float(unknowns[_BIAS]),
        unknowns[_UNKNOWNS:].copy(),
        np.sqrt(np.diag(solution.covariance)[_UNKNOWNS:]),
        departures,
        significances,
        LARGEST_RESIDUAL * peak,
        noise,
        misfit,
    )


def _plausible(noise_m_s2: float, peak_m_s2: float) -> float:
    """Return the noise that rows are weighted with: what is too large for noise shall not excuse the sensors."""
    return min(max(noise_m_s2, SMALLEST_SIGMA_M_S2), LARGEST_RESIDUAL * peak_m_s2)


def _linearised(
    unknowns: Array, m0: float, forces: Array, released: Array, sliding: Array, shifts: Array
) -> tuple[Array, Array]:
    """Return the modelled acceleration, shape (n_rows,), and its derivatives by the unknowns, (n_rows, n_unknowns)."""
    mass, gain = m0 * (1.0 + unknowns[_MASS]), 1.0 + unknowns[_ACCELERATION]
    scales = 1.0 / (1.0 + unknowns[_GAUGES])
    force = forces[:, :3] @ scales + forces[:, 3] - unknowns[_FRICTION] * sliding
    rigid = force / mass
    design = np.column_stack(
        [
            -gain * rigid / (1.0 + unknowns[_MASS]),
            -gain * forces[:, :3] * scales**2 / mass,
            -gain * sliding / mass,
            rigid,
            released,
            shifts,
        ]
    )
    return gain * rigid + unknowns[_BIAS] * released + shifts @ unknowns[_UNKNOWNS:], design


def _observations(
    scales: ScaleUncertainty, u_bias_m_s2: float, camera: CameraScale | None, shifts: int
) -> list[_Observation]:
    """Return the calibrations, the silence before the shot and the camera as observations of the unknowns."""
    only = np.eye(_UNKNOWNS + shifts)
    observations = [
        _Observation(source, only[1 + j], 0.0, max(u, SMALLEST_U), "1")
        for j, (source, u) in enumerate(zip(GAUGES, scales.gauges, strict=True))
    ]
    observations.append(_Observation(FRICTION, only[_FRICTION], 0.0, max(scales.friction_n, SMALLEST_U), "N"))
    u_acceleration = max(scales.acceleration, SMALLEST_U)
    observations.append(_Observation(ACCELERATION, only[_ACCELERATION], 0.0, u_acceleration, "1"))
    if math.isfinite(u_bias_m_s2):
        observations.append(_Observation(ZERO, only[_BIAS], 0.0, max(u_bias_m_s2, SMALLEST_U), "m/s^2"))
    if camera is not None:
        observations += _camera(camera, shifts)
    return observations


def _camera(camera: CameraScale, shifts: int) -> list[_Observation]:
    """Return the camera's observations, made independent of one another.

    With the camera's own scale error dc the fit finds ``gain = (1 + dc) / (1 + da)``, so that ``1 / gain - 1``
    is da less dc. The errors of the fit's estimates are correlated; from each observation the part is taken off
    that those before it tell of it.
    """
    values = np.append(1.0 / camera.gain - 1.0, camera.zeros_m_s2)
    covariance = np.array(camera.covariance)
    covariance[0, 0] += (camera.u_rel * camera.gain) ** 2
    covariance[0] /= -(camera.gain**2)
    covariance[:, 0] /= -(camera.gain**2)
    seen = np.zeros((values.size, _UNKNOWNS + shifts))
    seen[0, _ACCELERATION] = seen[1, _BIAS] = 1.0
    for j in range(2, values.size):
        seen[j, _UNKNOWNS + j - 2] = 1.0
    observations = []
    for i in range(values.size):
        told = np.linalg.lstsq(covariance[:i, :i], covariance[:i, i], rcond=None)[0] if i else np.zeros(0)
        variance = max(float(covariance[i, i] - told @ covariance[:i, i]), 1e-6 * float(covariance[i, i]))
        name = (CAMERA_SCALE, CAMERA_ZERO)[i] if i < 2 else f"{CAMERA_SHIFT} {i - 1}"
        row, value = seen[i] - told @ seen[:i], float(values[i] - told @ values[:i])
        unit = "1" if i == 0 else "m/s" if camera.kick is not None and i == 2 + camera.kick else "m/s^2"
        observations.append(_Observation(name, row, value, max(math.sqrt(variance), SMALLEST_U), unit))
    return observations


def _solve(design: Array, target: Array, sigma: float, observations: list[_Observation]) -> _Solution:
    """Solve by weighted least squares, every column scaled to one."""
    u = np.array([o.u for o in observations])
    full = np.vstack([design / sigma, np.array([o.row for o in observations]) / u[:, None]])
    values = np.concatenate([target / sigma, np.array([o.value for o in observations]) / u])
    scale = np.sqrt((full**2).sum(axis=0))
    scale[scale == 0] = 1.0
    inverse = np.linalg.pinv(full / scale) / scale[:, None]
    n = design.shape[0]
    return _Solution(inverse @ values, inverse @ inverse.T, inverse[_MASS, :n] / sigma, inverse[_MASS, n:] / u)
