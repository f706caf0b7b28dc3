"""Calibrations put together by hand, with the sensor errors that a test wants."""

from __future__ import annotations

import numpy as np

from identification.calibrated_draws import CalibratedProblem
from identification.calibration import Calibration
from identification.mass import MassEstimate


def a_calibration(
    estimate: MassEstimate,
    *,
    gauges: tuple[float, float, float] = (0.0, 0.0, 0.0),
    friction_n: float = 0.0,
    acceleration: float = 0.0,
    bias_m_s2: float = 0.0,
) -> Calibration:
    """Say that these are the errors of the sensors; what was minimised is empty."""
    none, unknowns = np.zeros(0), np.zeros(7)
    problem = CalibratedProblem(estimate.mass_kg, unknowns, np.zeros((6, 6)), 1.0, 1.0, 1.0, np.eye(7), np.ones(7))
    return Calibration(
        estimate, np.array(gauges), friction_n, acceleration, bias_m_s2, none, none, {}, {}, 1.0, 1.0, 0.0, problem
    )
