"""Whether a mass is constant: sensor errors are excused, a part that lets go is not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.calibration import calibrated_mass
from recoil_identification.constancy.mass_constancy import MassConstancy, constancy_of, mass_constancy, sensor_columns
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from tests.builders.bench_shots import MASS_KG, bench_regression

SCALES = ScaleUncertainty(0.005, (0.005, 0.004, 0.004), 150.0)
U_ZERO = 0.14
SIGMA = 8.0
"""Of the acceleration as recorded, m/s^2."""
CUTOFF = LowPass(500.0)


def disturbed(seed: int, *, lost: float = 0.0, after_s: float = 0.03, errors: float = 1.0) -> Regression:
    """A bench shot with errors drawn from the calibrations, ringing that dies down, and a part that lets go."""
    plain = bench_regression()
    rng = np.random.default_rng(seed)
    since = plain.times_s - plain.interval_s[0]
    mass = np.where(since >= after_s, 1 - lost, 1.0)
    ringing = np.where(since > 0, 150 * np.exp(-since / 0.006) * np.sin(2 * np.pi * 1100 * since), 0.0)
    noise = rng.normal(0.0, SIGMA, since.size) + rng.uniform(0.5, 1.5) * ringing
    zero, friction = errors * rng.standard_normal(2) * (U_ZERO, SCALES.friction_n)
    gauges = 1 + errors * rng.standard_normal(3) * SCALES.gauges
    forces = plain.forces_n * np.append(gauges, 1.0)
    forces[:, 3] += friction * plain.friction_direction
    acceleration = plain.acceleration_m_s2 / mass + zero * plain.released + noise
    return replace(plain, acceleration_m_s2=acceleration, forces_n=forces).filtered(CUTOFF)


def judged(regression: Regression, scales: ScaleUncertainty = SCALES, u_zero: float = U_ZERO) -> MassConstancy:
    return constancy_of(regression, calibrated_mass(regression, scales, u_zero, None), scales, u_zero)


def test_a_constant_mass_seen_by_sensors_within_their_calibrations_is_rarely_doubted() -> None:
    found = [judged(disturbed(seed)) for seed in range(40)]
    doubted = np.mean([not f.constant() for f in found])
    assert doubted <= 0.1
    assert np.mean([f.constant(0.01) for f in found]) > 0.95


def test_sensors_beyond_what_they_are_allowed_are_taken_for_a_mass_that_varies() -> None:
    trusted = ScaleUncertainty(0.005, (1e-6, 1e-6, 1e-6), 1e-3)
    doubted = [not judged(disturbed(seed, errors=3.0), trusted, 1e-3).constant() for seed in range(10)]
    assert np.mean(doubted) >= 0.7


def test_a_part_that_lets_go_is_found_with_its_size_and_its_instant() -> None:
    found = [judged(disturbed(seed, lost=0.05)) for seed in range(20)]
    assert all(not f.constant(0.01) for f in found)
    sizes = np.array([f.change_kg for f in found])
    z = (sizes + 0.05 * MASS_KG) / np.array([f.u_change_kg for f in found])
    assert abs(z.mean()) < 1.0
    assert np.abs(z).max() < 4.0
    start = bench_regression().interval_s[0]
    held = [f.step.interval_s[0] - 1e-3 <= start + 0.03 <= f.step.interval_s[1] + 1e-3 for f in found]
    assert np.mean(held) >= 0.8
    assert "No constant mass explains the shot" in str(found[0])
    assert "a step of -" in str(found[0])


def test_power_grows_with_the_part() -> None:
    p = [np.median([judged(disturbed(s, lost=lost)).p_value for s in range(8)]) for lost in (0.0, 0.02, 0.05)]
    assert p[0] > 0.1 > p[1] > p[2]


def test_a_constant_mass_says_so() -> None:
    found = judged(disturbed(3))
    assert found.constant()
    assert str(found).startswith("One constant mass explains the shot (p = ")
    assert found.mass_kg == pytest.approx(MASS_KG, rel=0.03)
    assert found.times_s.size == found.sigma_m_s2.size == found.step.residual.size


def test_each_row_is_weighted_by_the_scatter_around_it() -> None:
    found = judged(disturbed(5))
    early, late = found.sigma_m_s2[:20], found.sigma_m_s2[-40:]
    assert early.max() > 2 * np.median(late)
    assert np.std(found.step.residual) < 1.2


def test_shapes_that_nothing_restricts_explain_what_they_can() -> None:
    plain = disturbed(6, errors=0.0)
    ramp = np.where(plain.released > 0.5, 3.0, 0.0)
    moved = replace(plain, acceleration_m_s2=plain.acceleration_m_s2 + ramp)
    assert not judged(moved, u_zero=1e-3).constant()
    free = constancy_of(moved, calibrated_mass(plain, SCALES, U_ZERO, None), SCALES, math.inf)
    assert free.constant()
    shifted = replace(moved, shifts=ramp[:, None])
    assert constancy_of(shifted, calibrated_mass(plain, SCALES, U_ZERO, None), SCALES, 1e-3).constant()


def test_a_late_gauge_is_excused_by_the_uncertainty_of_its_delay() -> None:
    plain = disturbed(7, errors=0.0)
    late = plain.forces_n.copy()
    late[:, 0] = np.interp(plain.times_s - 3e-4, plain.times_s, late[:, 0])
    moved = replace(plain, forces_n=late)
    calibration = calibrated_mass(plain, SCALES, U_ZERO, None)
    blamed = constancy_of(moved, calibration, SCALES, U_ZERO)
    excused = constancy_of(moved, calibration, SCALES, U_ZERO, u_delays_s=(3e-4, 0.0, 0.0))
    # unexcused it would pass for noise, and hide what else there is
    assert excused.sigma_m_s2[0] < 0.5 * blamed.sigma_m_s2[0]


def test_only_what_has_an_uncertainty_has_a_column() -> None:
    forces, ones = np.ones((12, 4)), np.ones(12)
    both = sensor_columns(forces, -ones, ones, 782.0, SCALES, U_ZERO)
    assert both.shape == (12, 5)
    np.testing.assert_allclose(both[0], [0.005 / 782, 0.004 / 782, 0.004 / 782, -150 / 782, 0.14])
    exact = ScaleUncertainty(0.0, (0.0, 0.0, 0.0), 0.0)
    assert sensor_columns(forces, ones, ones, 782.0, exact, math.inf).shape == (12, 0)
    delayed = sensor_columns(forces, ones, ones, 782.0, exact, 0.0, 1e6 * np.ones((12, 3)), (0.0, 1e-4, 0.0))
    np.testing.assert_allclose(delayed[:, 0], 100 / 782)


def test_the_noise_may_be_given() -> None:
    regression = disturbed(8)
    rows = np.flatnonzero(regression.used)[::20]
    known = sensor_columns(
        regression.forces_n[rows],
        regression.friction_direction[rows],
        regression.released[rows],
        MASS_KG,
        SCALES,
        U_ZERO,
    )
    columns = (regression.times_s[rows], regression.acceleration_m_s2[rows], regression.force_n[rows], MASS_KG, known)
    found = mass_constancy(*columns, noise_m_s2=5.0)
    assert (found.sigma_m_s2 == 5.0).all()


def test_too_few_rows_and_senseless_ones_are_refused() -> None:
    few = np.arange(1.0, 10.0)
    with pytest.raises(IdentificationError, match="only 9 rows to test the constancy"):
        mass_constancy(few, few, few, 1.0, np.zeros((9, 0)))
    many = np.arange(1.0, 40.0)
    with pytest.raises(ValueError, match="every row finite"):
        mass_constancy(many, many * np.nan, many, 1.0, np.zeros((39, 0)))
    with pytest.raises(IdentificationError, match="cannot be tested: the other regressors explain"):
        mass_constancy(many, many, many, 1.0, 1e12 * np.eye(39), noise_m_s2=1.0)
