"""The mass together with the scales of the sensors, restricted by their calibrations.

A shot sees every force in another mixture: first the breech, then brake and recuperator. If the
breech gauge reads 0.7 % low, the mass that its phase gives disagrees with the mass that the brake's
phase gives. So the equation of motion is solved for the mass and for an error of every sensor at once;
each error is restricted by its standard uncertainty, the accelerometer's also by the camera, which
measured the same motion in another scale. This is Bayesian regression with normal priors, or
generalized least squares with the calibrations as further observations.

The accelerometer reads ``a = (1 + da) a' + b`` while the part is free, gauge j reads
``F_j = (1 + dj) F_j,true``, and the friction is declared by ``df`` too large, so that

    a = (1 + da) [sum_j F_j / (1 + dj) + (R - df) s] / (m0 (1 + dm)) + b + v d,        m = m0 (1 + dm),

with the friction's direction s and a first estimate m0. While the part is let go, battery stop and packing
push it on with what no gauge reads: an impulse d at the release, that gives it the velocity v. Where the zero
shifted at the shot, columns of the shapes that a shift may have are added, each with a coefficient that nothing
restricts. It is solved by Gauss and Newton's iteration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recoil_identification.budget import BudgetRow
from recoil_identification.calibrated_draws import CalibratedProblem
from recoil_identification.mass import RANDOM, MassEstimate, correlation_factor, independent_rows, reverse_mass
from recoil_identification.sensor_observations import (
    BIAS,
    FRICTION_ERROR,
    GAUGE,
    MASS,
    RELEASE_VELOCITY,
    SENSITIVITY,
    SMALLEST_U,
    UNKNOWNS,
    CameraScale,
    Observation,
    observations_of,
)
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty

Array = NDArray[np.float64]

LARGEST_RESIDUAL = 0.01
"""Share of the acceleration's peak that may be noise; for what is beyond, the sensors must answer."""
LARGEST_SIGNIFICANCE = 3.29
"""Of a sensor's departure from its calibration; by chance one of 1000 goes beyond, as in Baarda's w-test."""
LARGEST_STEP = 0.3
"""Of a scale in one iteration: a shot that no calibration fits would otherwise throw a scale beyond zero."""
SMALLEST_RESIDUAL = 3e-4
"""Share of the acceleration's peak that rows are never taken to be better than: neither is a gauge's straightness
better, nor what a rigid part that slides and strikes is written down as."""
LEAST_REDUNDANCY = 1e-6
"""Below this share of its variance the other data say nothing about an observation."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Mass and sensor errors as this shot and the calibrations together say.

    Attributes
    ----------
    gauge_errors : ndarray, shape (3,)
        Relative errors of breech, brake and recuperator force.
    friction_error_n
        By how much the declared friction is too large, N.
    acceleration_error
        Relative error of the accelerometer's sensitivity.
    bias_m_s2
        Error of its zero.
    release_m_s
        Velocity that stop and packing gave the part while they let it go.
    shifts_m_s2, u_shifts_m_s2 : ndarray, shape (n_shifts,)
        Size of each shape of the regression's `shifts`, and its standard uncertainty.
    departures
        By how many of its standard uncertainties each sensor is off; those known exactly are left out.
    significances
        The same over the departure's own standard deviation (Baarda's w-test of one observation among
        the others): standard normal if all calibrations hold. It exceeds the departure where the shot
        can tell little of a sensor; 0 where it can tell nothing.
    largest_residual_m_s2
        `LARGEST_RESIDUAL` of this shot's acceleration; a residual beyond it is no noise.
    noise_m_s2
        Standard deviation of the residual, widened by its correlation.
    misfit
        What was minimised: squares of residuals over the noise, and of departures over their uncertainties.
    covariance : ndarray, shape (n_unknowns, n_unknowns)
        Of mass, gauges, friction, accelerometer, zero, release and shifts.
    problem
        The same for draws of its inputs.
    """

    estimate: MassEstimate
    gauge_errors: Array
    friction_error_n: float
    acceleration_error: float
    bias_m_s2: float
    release_m_s: float
    shifts_m_s2: Array
    u_shifts_m_s2: Array
    departures: dict[str, float]
    significances: dict[str, float]
    largest_residual_m_s2: float
    noise_m_s2: float
    misfit: float
    covariance: Array
    problem: CalibratedProblem

    def correct(self, regression: Regression) -> tuple[Array, Array]:
        """Return a' and F' with the sensors' errors and the release taken off, shape (n,) each."""
        zero = self.bias_m_s2 * regression.released + self.release_m_s * regression.release_per_s
        if regression.shifts is not None:
            zero = zero + regression.shifts @ self.shifts_m_s2
        a = (regression.acceleration_m_s2 - zero) / (1.0 + self.acceleration_error)
        gauges = regression.forces_n[:, :3] @ (1.0 / (1.0 + self.gauge_errors))
        return a, np.asarray(gauges + regression.forces_n[:, 3] - self.friction_error_n * regression.friction_direction)

    def errors_left(self, regression: Regression) -> Array:
        """Return what may be left of the sensors' errors in a', shape (n, n_errors).

        Each column is one standard uncertainty of an error that is independent of the others.
        """
        shifts = np.zeros((regression.times_s.size, 0)) if regression.shifts is None else regression.shifts
        added = np.column_stack([regression.released, regression.release_per_s, shifts])
        _, design = _linearised(
            self.problem.unknowns, self.problem.m0_kg, regression.forces_n, regression.friction_direction, added
        )
        variances, directions = np.linalg.eigh(self.covariance[1:, 1:])
        return np.asarray(design[:, 1:] @ (directions * np.sqrt(np.maximum(variances, 0.0))))


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
    regression
        Filtered.
    u_bias_m_s2
        Standard uncertainty of the accelerometer's zero from the silence before the shot; infinite if
        there was none.
    noise_m_s2
        Of a row; found from the residuals if left out.

    Raises
    ------
    IdentificationError
        If the interval has too few rows, or force and acceleration have nothing in common.
    """
    first = reverse_mass(regression, scales)
    rows = spaced_rows(regression)
    a, forces = regression.acceleration_m_s2[rows], regression.forces_n[rows]
    sliding = regression.friction_direction[rows]
    shifts = np.zeros((rows.size, 0)) if regression.shifts is None else regression.shifts[rows]
    # what is added to the acceleration as it is: zero, release, shifts of the zero
    added = np.column_stack([regression.released[rows], regression.release_per_s[rows], shifts])
    u_release_m_s = regression.u_release_n_s / first.mass_kg
    observations = observations_of(scales, u_bias_m_s2, u_release_m_s, camera, shifts.shape[1])
    # of the whole motion, lost samples and all: what is left of a pulse that was lost does not tell the noise's size
    peak = float(np.max(np.abs(regression.acceleration_m_s2[regression.inside])))
    sigma = _plausible(first.residual_m_s2 if noise_m_s2 is None else noise_m_s2, peak)
    unknowns = np.zeros(UNKNOWNS + shifts.shape[1])
    for _ in range(50):
        model, design = _linearised(unknowns, first.mass_kg, forces, sliding, added)
        target = a - model + design @ unknowns
        solution = _solve(design, target, sigma, observations)
        residual = target - design @ solution.unknowns
        step = solution.unknowns - unknowns
        scales_moved = float(np.max(np.abs(step[[MASS, *range(*GAUGE.indices(UNKNOWNS)), SENSITIVITY]])))
        step *= min(1.0, LARGEST_STEP / max(scales_moved, LARGEST_STEP))
        moved = float(np.max(np.abs(design @ step)))
        # of the unknowns the mass and the shifts are not restricted, and zero and release hardly
        deviation = math.sqrt(float(residual @ residual) / max(rows.size - 3 - shifts.shape[1], 1))
        noise = deviation * correlation_factor(residual)
        before, sigma = sigma, _plausible(noise if noise_m_s2 is None else noise_m_s2, peak)
        unknowns = unknowns + step
        if moved < 1e-9 * peak and abs(sigma / before - 1.0) < 1e-6:
            break
    mass = first.mass_kg * (1.0 + float(unknowns[MASS]))
    degrees_of_freedom = independent_rows(residual, 3 + shifts.shape[1])
    random_kg = first.mass_kg * noise * float(np.linalg.norm(solution.by_rows))
    budget = [BudgetRow(RANDOM, random_kg, "A", degrees_of_freedom=degrees_of_freedom)]
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
        unknowns[GAUGE].copy(),
        float(unknowns[FRICTION_ERROR]),
        float(unknowns[SENSITIVITY]),
        float(unknowns[BIAS]),
        float(unknowns[RELEASE_VELOCITY]),
        unknowns[UNKNOWNS:].copy(),
        np.sqrt(np.diag(solution.covariance)[UNKNOWNS:]),
        departures,
        significances,
        LARGEST_RESIDUAL * peak,
        noise,
        misfit,
        solution.covariance,
        CalibratedProblem.of(
            first.mass_kg,
            unknowns,
            np.column_stack([forces, sliding, added]),
            sigma,
            noise,
            degrees_of_freedom,
            np.array([o.row for o in observations]),
            np.array([o.u for o in observations]),
        ),
    )


def _plausible(noise_m_s2: float, peak_m_s2: float) -> float:
    """Return the noise that rows are weighted with.

    What is too large for noise shall not excuse the sensors, and what is too small not accuse them.
    """
    return min(max(noise_m_s2, SMALLEST_RESIDUAL * peak_m_s2), LARGEST_RESIDUAL * peak_m_s2)


def _linearised(unknowns: Array, m0: float, forces: Array, sliding: Array, added: Array) -> tuple[Array, Array]:
    """Return the modelled acceleration, shape (n_rows,), and its derivatives by the unknowns, (n_rows, n_unknowns)."""
    mass, gain = m0 * (1.0 + unknowns[MASS]), 1.0 + unknowns[SENSITIVITY]
    scales = 1.0 / (1.0 + unknowns[GAUGE])
    force = forces[:, :3] @ scales + forces[:, 3] - unknowns[FRICTION_ERROR] * sliding
    rigid = force / mass
    design = np.column_stack(
        [
            -gain * rigid / (1.0 + unknowns[MASS]),
            -gain * forces[:, :3] * scales**2 / mass,
            -gain * sliding / mass,
            rigid,
            added,
        ]
    )
    return gain * rigid + added @ unknowns[BIAS:], design


def _solve(design: Array, target: Array, sigma: float, observations: list[Observation]) -> _Solution:
    """Solve by weighted least squares, every column scaled to one."""
    u = np.array([o.u for o in observations])
    full = np.vstack([design / sigma, np.array([o.row for o in observations]) / u[:, None]])
    values = np.concatenate([target / sigma, np.array([o.value for o in observations]) / u])
    scale = np.sqrt((full**2).sum(axis=0))
    scale[scale == 0] = 1.0
    inverse = np.linalg.pinv(full / scale) / scale[:, None]
    n = design.shape[0]
    return _Solution(inverse @ values, inverse @ inverse.T, inverse[MASS, :n] / sigma, inverse[MASS, n:] / u)
