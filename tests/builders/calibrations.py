"""Calibrations put together by hand, with the sensor errors that a test wants."""

from __future__ import annotations

import math

import numpy as np

from recoil_identification.calibration.calibration import Calibration
from recoil_identification.estimate.mass import MassEstimate
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows.equation_of_motion import (
    ACCELERATION,
    FRICTION,
    MASS,
    RELEASE,
    ZERO,
    EquationOfMotion,
    gauge,
)
from recoil_identification.rows.row_noise import RowNoise
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_rigs.tables.rig_tables import GAUGE_ROLES
from tests.builders.bench_shots import bench_regression


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
    errors = {
        MASS.name: None,
        **dict(zip((gauge(role).name for role in GAUGE_ROLES), np.log1p(gauges).tolist(), strict=True)),
        FRICTION.name: friction_n,
        ACCELERATION.name: math.log1p(acceleration),
        ZERO.name: bias_m_s2,
        RELEASE.name: 0.0,
    }
    stated = [
        Prior.of(ErrorSource(SourceKind.DECLARED, "stated"), name, u_ln_mass)
        if value is None
        else Prior.of(name, name, 0.0, value)
        for name, value in errors.items()
    ]
    return Calibration(
        estimate=estimate,
        noise=RowNoise(np.ones(1), 1.0, math.inf),
        block=EquationOfMotion(bench_regression(), np.arange(0), estimate.mass_kg, np.zeros(0)),
        inferred=solve([Unknown(name) for name in errors], [], stated),
        common=(),
        own=(),
    )
