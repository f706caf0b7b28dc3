from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.targets.resistance.resistance_law import block_means, fit_brake_profile, fit_gas_law

TRAVEL = np.linspace(0.0, 0.8, 200)


@settings(max_examples=30)
@given(st.floats(1e5, 1e7), st.floats(1.2, 4.0), st.floats(1.0, 1.67))
def test_a_gas_law_without_noise_is_recovered(p0, length, exponent):
    found = fit_gas_law(TRAVEL, p0 * (1 - TRAVEL / length) ** -exponent)
    assert not isinstance(found, str)
    assert found.pressure_pa == pytest.approx(p0, rel=1e-6)
    assert found.length_m == pytest.approx(length, rel=1e-4)
    assert found.exponent == pytest.approx(exponent, rel=1e-4)


def test_a_gas_law_states_an_uncertainty_that_holds_the_truth():
    inside = []
    for seed in range(60):
        noise = 3e3 * np.random.default_rng(seed).normal(size=TRAVEL.size)
        found = fit_gas_law(TRAVEL, 1.65e6 * (1 - TRAVEL / 2.1) ** -1.3 + noise)
        assert not isinstance(found, str)
        off = found.parameters - np.array([np.log(1.65e6), np.log(2.1), 1.3])
        inside.append(np.abs(off) < 1.96 * np.sqrt(np.diag(found.covariance)))
    assert np.all(np.mean(inside, axis=0) > 0.85)


def test_a_gas_that_is_hardly_compressed_is_a_sentence():
    assert "no law is to be told" in str(fit_gas_law(TRAVEL, np.full(TRAVEL.size, 1e6)))
    assert "too few" in str(fit_gas_law(TRAVEL[:5], TRAVEL[:5] + 1.0))
    assert "not positive" in str(fit_gas_law(TRAVEL, TRAVEL - 0.1))


def recoil(seed: int | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    time = np.linspace(0.0, 1.0, 250)
    travel = 0.85 * (1 - (1 - time) ** 2)
    velocity = 8.0 * (1 - time) + 1e-3
    coefficient = 400.0 / (0.03 + np.sqrt(1 - travel / 0.9)) ** 2
    noise = 0.0 if seed is None else 60.0 * np.random.default_rng(seed).normal(size=time.size)
    return travel, velocity, coefficient, coefficient * velocity**2 + noise


def test_the_throttle_of_a_brake_is_recovered_within_its_band():
    travel, velocity, coefficient, _ = recoil()
    inside, at = [], slice(10, 200)
    for seed in range(15):
        force = recoil(seed)[3]
        found = fit_brake_profile(travel, velocity, force, u_force_n=60.0, u_velocity_m_s=np.full(travel.size, 1e-4))
        assert not isinstance(found, str)
        logarithm, u = found.logarithm(travel[at])
        error = logarithm - np.log(coefficient[at])
        assert np.max(np.abs(error)) < 0.03
        inside.append(np.mean(np.abs(error) < 1.96 * u))
    assert np.mean(inside) > 0.85


def test_beyond_its_rows_a_throttle_is_not_known():
    travel, velocity, _, force = recoil(1)
    found = fit_brake_profile(travel, velocity, force, u_force_n=60.0, u_velocity_m_s=np.full(travel.size, 1e-4))
    assert not isinstance(found, str)
    assert np.all(np.isnan(found.force(np.array([-0.1, 2.0]), np.ones(2))))


def test_a_brake_that_never_presses_is_a_sentence():
    travel, velocity, _, _ = recoil()
    nothing = np.zeros(travel.size)
    found = fit_brake_profile(travel, velocity, nothing, u_force_n=60.0, u_velocity_m_s=nothing)
    assert "too few" in str(found)


def test_means_of_blocks_keep_lost_samples_lost():
    columns = np.array([[1.0, 2.0], [3.0, np.nan], [5.0, 6.0], [7.0, 8.0], [9.0, 9.0]])
    np.testing.assert_equal(block_means(columns, 2), [[2.0, np.nan], [6.0, 7.0]])
    with pytest.raises(ValueError, match="at least one row"):
        block_means(columns, 0)


def test_columns_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="one length"):
        fit_gas_law(TRAVEL, TRAVEL[:-1])
    with pytest.raises(ValueError, match="finite"):
        fit_gas_law(TRAVEL, np.full(TRAVEL.size, np.nan))
