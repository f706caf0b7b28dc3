from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import IdentificationError
from recoil_identification.estimators.prewhitening import prewhitened_mass
from tests.builders.recoil_scenario import MASS_KG, record_recoil, true_recoil

TRUE = true_recoil()
LEAD = TRUE.times_s >= -2e-3
QUIET = slice(0, 3900)


def recorded(seed: int, **errors: float) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    shot = record_recoil(seed, **errors)
    force = np.where(TRUE.times_s >= 0, shot.force_n, 0.0)
    noise = {
        "force_sigma_n": float(shot.force_n[QUIET].std()),
        "baseline_sigma_m_s2": float(shot.acceleration_m_s2[QUIET].std()),
    }
    return shot.acceleration_m_s2, force, noise


def test_without_noise_the_mass_is_exact():
    found = prewhitened_mass(TRUE.acceleration_m_s2, TRUE.forces_n.sum(axis=1), used=LEAD)
    assert found.mass_kg == pytest.approx(MASS_KG, rel=1e-9)


def test_the_interval_holds_the_mass_of_ringing_shots_about_as_often_as_it_says():
    found = [prewhitened_mass(a, f, used=LEAD, **noise) for a, f, noise in map(recorded, range(60))]
    error = np.array([one.mass_kg for one in found]) / MASS_KG - 1
    u = np.array([one.u_kg for one in found]) / MASS_KG
    assert abs(error.mean()) < 0.002
    assert np.abs(error).mean() < 0.0040
    assert 0.9 * error.std() < u.mean() < 1.25 * error.std()
    assert np.mean(np.abs(error) < 1.96 * u) >= 0.88


def test_the_uncertainty_is_never_less_than_what_the_baselines_noise_leaves():
    acceleration, force, noise = recorded(1)
    by_rows = prewhitened_mass(acceleration, force, used=LEAD, **noise)
    noisy = 50.0 * noise["baseline_sigma_m_s2"]
    by_baseline = prewhitened_mass(acceleration, force, used=LEAD, **{**noise, "baseline_sigma_m_s2": noisy})
    own = math.hypot(noisy, noise["force_sigma_n"] / by_rows.mass_kg) / float(np.linalg.norm(force[LEAD]))
    assert by_baseline.mass_kg == by_rows.mass_kg
    assert by_baseline.u_kg == pytest.approx(by_rows.mass_kg**2 * own, rel=1e-9)
    assert by_baseline.u_kg > by_rows.u_kg


def test_noise_of_the_force_does_not_bias_where_it_is_known():
    a_true, f_true = TRUE.acceleration_m_s2, TRUE.forces_n.sum(axis=1)
    sigma = 0.1 * float(f_true[TRUE.moving].std())
    masses: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(30):
        rng = np.random.default_rng(seed)
        force = f_true + rng.normal(0.0, sigma, f_true.size)
        a = a_true + rng.normal(0.0, 10.0, a_true.size)
        for known, found_kg in masses.items():
            given = {"force_sigma_n": sigma if known else 0.0, "most_order": 0}
            found_kg.append(prewhitened_mass(a, force, used=TRUE.times_s >= 0, **given).mass_kg)
    assert np.mean(masses[True]) == pytest.approx(MASS_KG, rel=0.002)
    assert np.mean(masses[False]) == pytest.approx(
        MASS_KG * (1 + 0.1**2 * float(f_true[TRUE.moving].var()) / np.mean(f_true[TRUE.moving] ** 2)), rel=0.002
    )


def test_lost_samples_part_the_record_and_are_not_looked_at():
    a, force, noise = recorded(5)
    used = LEAD.copy()
    used[4300:4330] = used[4800] = False
    a[~used] = np.nan
    found = prewhitened_mass(a, force, used=used, **noise)
    assert found.rows == int(used.sum())
    assert found.mass_kg == pytest.approx(MASS_KG, rel=0.015)


def test_the_answers_are_the_changes_of_the_mass_by_errors_of_the_force():
    a, force, noise = recorded(7)
    forces = np.where(LEAD[:, None], record_recoil(7).forces_n, 0.0) * (TRUE.times_s >= 0)[:, None]
    found = prewhitened_mass(a, force, used=LEAD, perturbations_n=forces, **noise)
    for column, answer in zip(forces.T, found.sensitivities_kg, strict=True):
        moved = prewhitened_mass(a, force + 1e-3 * column, used=LEAD, noise=found.noise, **noise)
        assert answer == pytest.approx((moved.mass_kg - found.mass_kg) / 1e-3, abs=0.005 * MASS_KG)


@given(st.floats(0.2, 5.0), st.floats(0.2, 5.0))
@settings(max_examples=10)
def test_the_mass_scales_with_the_units_of_both_sides(force_scale, acceleration_scale):
    a, force, _ = recorded(2)
    plain = prewhitened_mass(a, force, used=LEAD)
    scaled = prewhitened_mass(acceleration_scale * a, force_scale * force, used=LEAD)
    assert scaled.mass_kg == pytest.approx(plain.mass_kg * force_scale / acceleration_scale, rel=1e-6)
    assert scaled.u_kg == pytest.approx(plain.u_kg * force_scale / acceleration_scale, rel=1e-4)


def test_too_few_samples_or_a_force_against_the_motion_are_no_estimate():
    a, force, _ = recorded(1)
    few = np.zeros(a.shape, dtype=bool)
    few[4100:4110] = True
    with pytest.raises(IdentificationError, match="only 10 samples"):
        prewhitened_mass(a, force, used=few)
    with pytest.raises(IdentificationError, match="no positive mass"):
        prewhitened_mass(a, -force, used=LEAD)


def test_arrays_that_do_not_fit_are_refused():
    a, force, _ = recorded(1)
    with pytest.raises(ValueError, match="equally long"):
        prewhitened_mass(a[1:], force)
    with pytest.raises(ValueError, match="finite"):
        prewhitened_mass(np.where(LEAD, np.nan, a), force)
