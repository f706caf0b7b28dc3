"""Calibrations put together by hand, with the sensor errors that a test wants."""

from __future__ import annotations

import numpy as np

from recoil_identification.calibrated_draws import CalibratedProblem
from recoil_identification.calibration import Calibration
from recoil_identification.mass import MassEstimate
from recoil_identification.sensor_observations import UNKNOWNS


def a_calibration(
    estimate: MassEstimate,
    *,
    gauges: tuple[float, float, float] = (0.0, 0.0, 0.0),
    friction_n: float = 0.0,
    acceleration: float = 0.0,
    bias_m_s2: float = 0.0,
) -> Calibration:
    """Say that these are the errors of the sensors; what was minimised is empty."""
    none, unknowns = np.zeros(0), np.zeros(UNKNOWNS)
    triangle = np.zeros((UNKNOWNS - 1, UNKNOWNS - 1))
    problem = CalibratedProblem(
        estimate.mass_kg, unknowns, triangle, 1.0, 1.0, 1.0, np.eye(UNKNOWNS), np.ones(UNKNOWNS)
    )
    return Calibration(
        estimate,
        np.array(gauges),
        friction_n,
        acceleration,
        bias_m_s2,
        0.0,
        none,
        none,
        {},
        {},
        1.0,
        1.0,
        0.0,
        np.zeros((UNKNOWNS, UNKNOWNS)),
        problem,
    )
