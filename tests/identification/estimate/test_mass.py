from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from statsmodels.regression.linear_model import OLS

from recoil_acquisition.errors import IdentificationError
from recoil_identification.estimate.budget import BudgetRow
from recoil_identification.estimate.mass import (
    ACCELERATION,
    FRICTION,
    GAUGES,
    RANDOM,
    MassEstimate,
    correlation_factor,
    forward_mass,
    reverse_mass,
)
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import (
    MASS_KG,
    assembled_bench_shot,
    bench_motion,
    bench_regression,
    bench_rig,
    bench_shot,
)

SCALES = ScaleUncertainty(0.005, (0.005, 0.004, 0.003), 150.0)
METHODS = {"forward": forward_mass, "reverse": reverse_mass}


def noisy(sigma: float = 3.0, seed: int = 1) -> Regression:
    regression = bench_regression()
    noise = np.random.default_rng(seed).normal(0.0, sigma, regression.times_s.size)
    return replace(regression, acceleration_m_s2=regression.acceleration_m_s2 + noise).filtered(LowPass(300.0))


def row(estimate: MassEstimate, source: str) -> BudgetRow:
    return next(r for r in estimate.budget if r.source == source)


@pytest.mark.parametrize("method", METHODS)
def test_without_noise_the_mass_is_exact(method):
    regression = bench_regression(bench_shot(bench_motion(friction=0.0)), bench_rig(friction=0.0)).filtered(
        LowPass(300)
    )
    assert METHODS[method](regression, SCALES).mass_kg == pytest.approx(MASS_KG, rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("column", range(3))
def test_a_gauges_sensitivity_is_the_masses_derivative(method, column):
    estimate = METHODS[method](noisy(), SCALES)
    h = 1e-6
    masses = []
    for sign in (1, -1):
        forces = noisy().forces_n.copy()
        forces[:, column] *= 1 + sign * h
        masses.append(METHODS[method](replace(noisy(), forces_n=forces), SCALES).mass_kg)
    slope = (masses[0] - masses[1]) / (2 * h)
    found = row(estimate, GAUGES[column])
    assert found.sensitivity == pytest.approx(slope, rel=1e-6)
    assert found.u_kg == pytest.approx(abs(slope) * SCALES.gauges[column], rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_the_frictions_sensitivity_is_the_masses_derivative_per_newton(method):
    masses = []
    for sign in (1, -1):
        forces = noisy().forces_n.copy()
        forces[:, 3] += sign * 0.5 * noisy().friction_direction
        masses.append(METHODS[method](replace(noisy(), forces_n=forces), SCALES).mass_kg)
    found = row(METHODS[method](noisy(), SCALES), FRICTION)
    assert found.sensitivity == pytest.approx(masses[0] - masses[1], rel=1e-6)
    assert (found.u_kg, found.sensitivity_per) == (pytest.approx(150 * abs(masses[0] - masses[1]), rel=1e-6), "N")


@pytest.mark.parametrize("method", METHODS)
def test_the_accelerometers_sensitivity_is_the_mass_itself(method):
    estimate = METHODS[method](noisy(), SCALES)
    scaled = replace(noisy(), acceleration_m_s2=noisy().acceleration_m_s2 * (1 + 1e-6))
    slope = (METHODS[method](scaled, SCALES).mass_kg - estimate.mass_kg) / 1e-6
    assert row(estimate, ACCELERATION).sensitivity == pytest.approx(slope, rel=1e-4)
    assert row(estimate, ACCELERATION).u_kg == pytest.approx(0.005 * estimate.mass_kg)


def test_the_budget_adds_up_and_the_interval_is_that_of_a_normal_distribution():
    estimate = reverse_mass(noisy(), SCALES)
    assert estimate.u_kg == pytest.approx(math.sqrt(math.fsum(r.u_kg**2 for r in estimate.budget)))
    low, high = estimate.interval_kg
    assert (high - low) / 2 == pytest.approx(1.959964 * estimate.u_kg, rel=1e-6)
    assert [r.source for r in estimate.budget] == [RANDOM, ACCELERATION, *GAUGES, FRICTION]


@pytest.mark.parametrize("friction", [0.0, 1500.0])
@pytest.mark.parametrize("method", METHODS)
def test_a_friction_of_zero_may_be_uncertain_and_certainty_costs_nothing(method, friction):
    rig = bench_rig(friction=friction)
    regression = bench_regression(bench_shot(bench_motion(friction=friction)), rig).filtered(LowPass(300.0))
    uncertain = METHODS[method](regression, ScaleUncertainty(0.0, (0.0, 0.0, 0.0), 150.0))
    assert 0 < row(uncertain, FRICTION).u_kg < 1
    certain = METHODS[method](regression, ScaleUncertainty(0.0, (0.0, 0.0, 0.0), 0.0))
    assert certain.u_kg == row(certain, RANDOM).u_kg


def test_reverse_is_blind_to_noise_of_the_accelerometer_and_forward_is_attenuated_by_it():
    recorded = bench_regression()
    a = recorded.acceleration_m_s2[recorded.inside]
    sigma = 0.3 * math.sqrt(float(np.mean(a**2)))
    expected = -(0.3**2) / (1 + 0.3**2)
    loud = [replace(recorded, acceleration_m_s2=recorded.acceleration_m_s2 + noise)
            for noise in np.random.default_rng(5).normal(0.0, sigma, (40, recorded.times_s.size))]  # fmt: skip
    forward = np.mean([forward_mass(r, SCALES).mass_kg for r in loud]) / MASS_KG - 1
    reverse = np.mean([reverse_mass(r, SCALES).mass_kg for r in loud]) / MASS_KG - 1
    assert forward == pytest.approx(expected, abs=0.004)
    assert abs(reverse) < 0.004


@pytest.mark.exhaustive
def test_the_random_uncertainty_is_the_scatter_of_the_mass():
    masses, u = [], []
    for seed in range(80):
        estimate = reverse_mass(noisy(20.0, seed), SCALES)
        masses.append(estimate.mass_kg)
        u.append(row(estimate, RANDOM).u_kg)
    assert np.mean(u) == pytest.approx(np.std(masses), rel=0.25)
    assert np.mean(masses) == pytest.approx(MASS_KG, abs=4 * np.std(masses) / math.sqrt(80))


@pytest.mark.parametrize("method", METHODS)
def test_mass_random_uncertainty_and_residual_are_those_of_ordinary_least_squares(method):
    regression = noisy()
    rows = spaced_rows(regression)
    acceleration, force = regression.acceleration_m_s2[rows], regression.force_n[rows]
    found = METHODS[method](regression, SCALES)
    fit = OLS(force, acceleration).fit() if method == "forward" else OLS(acceleration, force).fit()
    (slope,), (error,) = fit.params, fit.bse
    widened = error * correlation_factor(fit.resid)
    mass_kg, u_kg, per = (slope, widened, slope) if method == "forward" else (1 / slope, widened / slope**2, 1.0)
    assert found.mass_kg == pytest.approx(mass_kg, rel=1e-12)
    assert row(found, RANDOM).u_kg == pytest.approx(u_kg, rel=1e-9)
    assert found.residual_m_s2 == pytest.approx(math.sqrt(fit.scale) / per, rel=1e-9)
    assert found.rows == rows.size
    freedom = rows.size / correlation_factor(fit.resid) ** 2 - 1
    assert row(found, RANDOM).degrees_of_freedom == pytest.approx(freedom, rel=1e-9)


def test_correlated_errors_widen_and_others_do_not():
    rng = np.random.default_rng(7)
    white = rng.normal(size=20_000)
    coloured = np.zeros(20_000)
    for k in range(1, 20_000):
        coloured[k] = 0.6 * coloured[k - 1] + white[k]
    assert correlation_factor(coloured) == pytest.approx(math.sqrt(1.6 / 0.4), rel=0.05)
    assert correlation_factor(white) == pytest.approx(1.0, abs=0.03)
    assert correlation_factor(np.tile([1.0, -1.0], 50)) == 1.0
    assert correlation_factor(np.zeros(10)) == 1.0
    assert correlation_factor(np.ones(2)) == 1.0
    assert correlation_factor(np.ones(1000)) == pytest.approx(math.sqrt(1.95 / 0.05))


def test_two_residuals_tell_no_correlation_and_three_do():
    assert correlation_factor(np.ones(2)) == 1.0
    assert correlation_factor(np.ones(3)) == pytest.approx(math.sqrt(5.0))


@pytest.mark.parametrize("method", METHODS)
def test_ten_rows_are_enough_and_nine_are_not(method):
    whole = noisy()
    rows = spaced_rows(whole)

    def of(count: int) -> Regression:
        return replace(whole, trusted=np.isin(np.arange(whole.times_s.size), rows[10 : 10 + count]))

    assert METHODS[method](of(10), SCALES).rows == 10
    with pytest.raises(IdentificationError, match="only 9 independent rows"):
        METHODS[method](of(9), SCALES)


def test_too_few_rows_are_no_estimate():
    regression = noisy()
    few = np.zeros(regression.times_s.size, dtype=bool)
    few[700:800] = True
    with pytest.raises(IdentificationError, match="independent rows") as caught:
        reverse_mass(replace(regression, trusted=few), SCALES)
    assert "at least 10" in str(caught.value)


@pytest.mark.parametrize("method", METHODS)
def test_a_force_against_the_acceleration_is_no_mass(method):
    regression = noisy()
    with pytest.raises(IdentificationError, match="no positive mass relates them") as caught:
        METHODS[method](replace(regression, forces_n=-regression.forces_n), SCALES)
    assert "polarities" in str(caught.value)


@pytest.mark.exhaustive
@given(shift_s=st.floats(-50.0, 50.0))
@settings(max_examples=4, deadline=None)
def test_the_mass_does_not_change_under_a_shift_of_time(shift_s):
    found = identify_shot(FiredShot(bench_shot(shift_s=shift_s), bench_rig()), Options())
    assert found.chosen.estimate.mass_kg == pytest.approx(unshifted(), rel=1e-6)


@cache
def unshifted() -> float:
    return identify_shot(FiredShot(bench_shot(), bench_rig()), Options()).chosen.estimate.mass_kg


@pytest.mark.exhaustive
@pytest.mark.parametrize(("unit", "factor"), [("MPa", 1e6), ("bar", 1e5), ("psi", 6894.757293168361), ("Pa", 1.0)])
def test_the_mass_does_not_change_with_the_unit_of_the_file(unit, factor):
    rig = bench_rig(pressure_unit=unit)
    motion = bench_motion()
    numbers = {
        "acc": motion.acceleration_m_s2,
        "p_breech": motion.breech_pa / factor,
        "p_brake": motion.brake_pa / factor,
        "p_recuperator": motion.recuperator_pa / factor,
    }
    shot = assembled_bench_shot(rig, numbers)
    assert identify_shot(FiredShot(shot, rig), Options()).chosen.estimate.mass_kg == pytest.approx(
        unshifted(), rel=1e-9
    )


def test_an_estimate_prints_what_contributes_most_first():
    rows = tuple(BudgetRow(source, u_kg, "B") for source, u_kg in (("friction", 1.0), ("area", 3.0), ("zero", 2.0)))
    lines = str(MassEstimate("reverse", 782.0, rows, 100, 0.5)).splitlines()
    assert lines[0].startswith("782.0 kg (u 3.7 kg), 95 % ")
    assert [line.split()[0] for line in lines[1:]] == ["area", "zero", "friction"]
