"""Calibrations put together by hand, with the sensor errors that a test wants."""

from __future__ import annotations

import math

import numpy as np

from recoil_identification.calibration import Calibration
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.mass import MassEstimate
from recoil_identification.row_noise import RowNoise


def a_calibration(
    estimate: MassEstimate,
    *,
    gauges: tuple[float, float, float] = (0.0, 0.0, 0.0),
    friction_n: float = 0.0,
    acceleration: float = 0.0,
    bias_m_s2: float = 0.0,
    u_ln_mass: float = 1.0,
) -> Calibration:
    """Say that these are the errors of the sensors; nothing was solved for."""
    none = np.zeros(0)
    nothing = solve([Unknown("ln mass")], [], [Prior.of("stated", "ln mass", u_ln_mass)])
    return Calibration(
        estimate=estimate,
        gauge_errors=np.array(gauges),
        friction_error_n=friction_n,
        acceleration_error=acceleration,
        bias_m_s2=bias_m_s2,
        release_m_s=0.0,
        shifts_m_s2=none,
        u_shifts_m_s2=none,
        pulls={},
        normalised_residuals={},
        noise=RowNoise(np.ones(1), 1.0, math.inf),
        misfit=0.0,
        m0_kg=estimate.mass_kg,
        inferred=nothing,
        own=(),
    )
