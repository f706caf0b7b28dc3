"""The mass by total least squares behind the low-pass, beside the regression's own, with a budget of the same rows.

The ratio of the noises is that in the pre-trigger baseline. What the estimate answers to a scale or a friction that is
off is told to first order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from recoil_identification.estimate.budget import BudgetRow
from recoil_identification.estimate.mass import RANDOM, MassEstimate, rows_of_sensors
from recoil_identification.estimators.errors_in_variables import deming_mass
from recoil_processing.shot.clocks.estimator_inputs import EstimatorInputs
from recoil_processing.shot.regression import spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty

LEAST_NOISE_M_S2 = 1e-12
"""Noise of an accelerometer, m/s^2, in the place of zero."""


def total_least_squares_mass(
    inputs: EstimatorInputs, scales: ScaleUncertainty, further: Sequence[BudgetRow]
) -> MassEstimate:
    """Estimate the mass by total least squares.

    Parameters
    ----------
    inputs
        Signals on both sides of the equation behind the low-pass, and the noise of the pre-trigger baseline.
    further
        Contributions of clocks, zeros, repairs, skew and cut-off to the route by the accelerometer.

    Raises
    ------
    IdentificationError
        If the shot has too few rows.
    """
    rows, f, baseline = spaced_rows(inputs.filtered), inputs.filtered, inputs.baseline_noise
    a, force = f.acceleration_m_s2[rows], f.force_n[rows]
    ratio = baseline.filtered_force / max(baseline.filtered_acceleration, LEAST_NOISE_M_S2)
    noise = math.hypot(baseline.filtered_acceleration, baseline.filtered_force / inputs.fired.rig.mechanism.m3)
    found = deming_mass(a, force, ratio, baseline_sigma_m_s2=noise)
    # with little noise it is the derivative of acceleration on force
    answers = (
        found.mass_kg
        / (force @ force)
        * (np.column_stack([f.forces_n[rows, :-1], f.friction_direction[rows]]).T @ force)
    )
    residual = a - force / found.mass_kg
    deviation = math.sqrt(float(residual @ residual) / max(rows.size - 1, 1))
    budget = (BudgetRow(RANDOM, found.u_kg, "A"), *rows_of_sensors(found.mass_kg, answers, scales), *further)
    return MassEstimate("tls", found.mass_kg, budget, found.rows, deviation)
