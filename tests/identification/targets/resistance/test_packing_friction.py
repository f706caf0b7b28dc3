from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.calibration.methods import calibrated_mass
from recoil_identification.targets.resistance.packing_friction import Friction, packing_friction
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from tests.builders.bench_shots import MASS_KG, bench_regression


def shot(seed: int, friction_error_n: float) -> Regression:
    """A shot whose declared friction is too large, with white noise on its rows."""
    regression = bench_regression().filtered(LowPass(300.0))
    a = regression.force_n / MASS_KG
    a[spaced_rows(regression)] += 0.5 * np.random.default_rng(seed).normal(size=spaced_rows(regression).size)
    forces = regression.forces_n.copy()
    forces[:, 3] += friction_error_n * regression.friction_direction
    return replace(regression, forces_n=forces, acceleration_m_s2=a)


def found(seed: int, off_n: float, scales: ScaleUncertainty, u_further_n: float = 0.0) -> Friction:
    regression = shot(seed, off_n)
    calibration = calibrated_mass(regression, scales, 0.05)
    return packing_friction(
        calibration, declared_n=1500.0 + off_n, u_declared_n=scales.friction_n, u_further_n=u_further_n
    )


GOOD = ScaleUncertainty(1e-4, (1e-4, 1e-4, 1e-4), 500.0)
POOR = ScaleUncertainty(0.02, (0.02, 0.05, 0.05), 50.0)


@pytest.mark.whole_way
def test_good_gauges_tell_the_friction_themselves():
    off = np.array([found(seed, 400.0, GOOD).value_n - 1500.0 for seed in range(10)])
    u = found(0, 400.0, GOOD).u_n
    assert np.mean(np.abs(off) < 1.96 * u) >= 0.8
    told = found(1, 400.0, GOOD)
    assert told.gain_bits > 2.0
    assert told.u_n < 0.25 * told.u_declared_n
    assert "mainly by the shot" in told.basis


def test_poor_gauges_leave_it_to_the_declaration():
    told = found(1, 0.0, POOR)
    assert told.u_n == pytest.approx(50.0, rel=0.1)
    assert told.gain_bits < 0.15
    assert "mainly by the declaration" in told.basis
    assert told.u_by_shot_n > 5 * told.u_declared_n


def test_declaration_and_shot_combine_by_their_weights():
    told = found(2, 400.0, GOOD)
    weights = np.array([told.u_declared_n, told.u_by_shot_n]) ** -2.0
    together = np.average([told.declared_n, told.by_shot_n], weights=weights)
    assert told.value_n == pytest.approx(together, abs=0.3 * told.u_n)
    assert told.u_n == pytest.approx(weights.sum() ** -0.5, rel=0.1)


def test_a_further_force_that_acts_like_friction_widens_it():
    assert found(2, 400.0, GOOD, 200.0).u_n > 1.5 * found(2, 400.0, GOOD).u_n


def test_a_friction_declared_as_exact_stays_so():
    told = found(3, 0.0, replace(GOOD, friction_n=0.0))
    assert told.value_n == pytest.approx(1500.0, abs=1e-3)
    assert told.u_n == 0.0
    assert "taken as exact" in told.basis
    assert np.isfinite(told.u_by_shot_n)
