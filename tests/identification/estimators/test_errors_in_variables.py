from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import IdentificationError
from recoil_identification.estimators.errors_in_variables import (
    deming_mass,
    instrumental_mass,
    neighbouring_force,
)
from tests.builders.recoil_scenario import MASS_KG, true_recoil

TRUE = true_recoil()
A, F = TRUE.acceleration_m_s2[TRUE.moving], TRUE.forces_n[TRUE.moving].sum(axis=1)


def white(seed: int, sigma_a: float, sigma_f: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return A + rng.normal(0.0, sigma_a, A.size), F + rng.normal(0.0, sigma_f, F.size)


def test_without_noise_every_correction_is_exact():
    for found in (
        deming_mass(A, F, 30.0),
        instrumental_mass(A, F, neighbouring_force(F, 3)),
    ):
        assert found.mass_kg == pytest.approx(MASS_KG, rel=1e-9)


def test_demings_ends_are_the_two_regressions_and_between_them_it_rises():
    a, f = white(1, 200.0, 3e4)
    reverse, forward = f @ f / (a @ f), a @ f / (a @ a)
    assert deming_mass(a, f, 0.0).mass_kg == pytest.approx(reverse, rel=1e-12)
    assert deming_mass(a, f, math.inf).mass_kg == pytest.approx(forward, rel=1e-12)
    assert deming_mass(a, f, 1e9).mass_kg == pytest.approx(forward, rel=1e-9)
    masses = [deming_mass(a, f, ratio).mass_kg for ratio in (0.0, 10.0, 100.0, 1e3, 1e4, math.inf)]
    assert masses == sorted(masses, reverse=True)


@given(st.floats(1.0, 1e4), st.integers(0, 100))
@settings(max_examples=25)
def test_demings_mass_minimises_the_weighted_distances(ratio, seed):
    a, f = white(seed, 300.0, 5e4)
    mass = deming_mass(a, f, ratio).mass_kg

    def distance(m: float) -> float:
        return float(np.sum((f - m * a) ** 2)) / (ratio**2 + m**2)

    assert distance(mass) <= min(distance(mass * (1 - 1e-4)), distance(mass * (1 + 1e-4)))


@pytest.mark.parametrize("name", ["deming", "instrumental"])
def test_white_noise_of_both_sides_is_corrected_and_the_interval_is_honest(name):
    sigma_a, sigma_f = 180.0, 6e4
    found, forward = [], []
    for seed in range(80):
        a, f = white(seed, sigma_a, sigma_f)
        forward.append(float(a @ f / (a @ a)))
        found.append(
            {
                "deming": lambda a=a, f=f: deming_mass(a, f, sigma_f / sigma_a),
                "instrumental": lambda a=a, f=f: instrumental_mass(a, f, neighbouring_force(f, 4)),
            }[name]()
        )
    error = np.array([one.mass_kg for one in found]) - MASS_KG
    u = np.array([one.u_kg for one in found])
    assert abs(error.mean()) < 3 * error.std() / math.sqrt(80)
    assert 0.8 < u.mean() / error.std() < 1.4
    assert np.mean(np.abs(error) < 1.96 * u) > 0.85
    # the plain regression is off by the noise's share of the power
    share = sigma_a**2 / (sigma_a**2 + TRUE.rms_m_s2**2)
    corrected = np.array([one.mass_kg for one in found])
    assert np.mean(np.array(forward) / corrected) == pytest.approx(1 - share, abs=0.005)


def test_correlated_errors_are_counted_as_such():
    rng = np.random.default_rng(0)
    slow = np.repeat(rng.normal(0.0, 100.0, A.size // 20 + 1), 20)[: A.size]
    independent = [deming_mass(A + rng.normal(0.0, 100.0, A.size), F, 0.0).u_kg for _ in range(30)]
    assert np.mean(independent) == pytest.approx(MASS_KG**2 * 100.0 / math.sqrt(F @ F), rel=0.15)
    assert deming_mass(A + slow, F, 0.0).u_kg > 2.5 * np.mean(independent)


def test_the_uncertainty_is_no_less_than_the_baseline_allows():
    a, f = white(2, 1e-3, 1e-3)
    found = deming_mass(a, f, 0.0, baseline_sigma_m_s2=50.0)
    assert found.u_kg == pytest.approx(MASS_KG**2 * 50.0 / math.sqrt(F @ F), rel=1e-6)


def test_a_neighbouring_force_is_the_mean_of_both_sides():
    np.testing.assert_allclose(neighbouring_force(np.array([1.0, 2.0, 4.0, 8.0]), 1), [1.5, 2.5, 5.0, 6.0])
    with pytest.raises(ValueError, match="lag"):
        neighbouring_force(np.ones(4), 4)


def test_samples_that_are_not_used_do_not_matter():
    a, f = white(3, 100.0, 2e4)
    used = np.ones(a.shape, dtype=bool)
    used[200:230] = False
    broken = np.where(used, a, np.nan)
    found = instrumental_mass(broken, f, neighbouring_force(f, 2), used=used)
    assert found.rows == a.size - 30
    assert found.mass_kg == pytest.approx(MASS_KG, rel=0.02)


def test_what_is_no_estimate_says_why():
    with pytest.raises(IdentificationError, match="no positive mass"):
        deming_mass(A, -F, 1.0)
    with pytest.raises(IdentificationError, match="instrument does not go with the motion"):
        instrumental_mass(A, F, np.where(np.arange(A.size) % 2 == 0, 1.0, -1.0) * 0.0)
    with pytest.raises(IdentificationError, match="only 5 samples"):
        deming_mass(A[:5], F[:5], 1.0)


@pytest.mark.parametrize("ratio", [-1.0, math.nan])
def test_a_ratio_that_is_none_is_refused(ratio):
    with pytest.raises(ValueError, match="noise_ratio_kg"):
        deming_mass(A, F, ratio)


def test_arrays_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="equally long"):
        deming_mass(A[1:], F, 1.0)
    with pytest.raises(ValueError, match="finite"):
        deming_mass(A * np.nan, F, 1.0)
    with pytest.raises(ValueError, match="instrument"):
        instrumental_mass(A, F, F * np.nan)
