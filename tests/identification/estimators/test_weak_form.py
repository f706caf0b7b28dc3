from __future__ import annotations

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.estimators.weak_form import weak_mass
from tests.builders.recoil_scenario import FORCE_NOISE, MASS_KG, RATE_HZ, record_recoil, true_recoil

TRUE = true_recoil()
T, LEAD = TRUE.times_s, TRUE.times_s >= -4e-3
FORCE = TRUE.forces_n.sum(axis=1)


def test_without_noise_the_mass_is_exact():
    assert weak_mass(T, TRUE.acceleration_m_s2, FORCE, used=LEAD).mass_kg == pytest.approx(MASS_KG, rel=1e-9)


def test_the_interval_holds_the_mass_of_ringing_shots_about_as_often_as_it_says():
    found = []
    for seed in range(50):
        shot = record_recoil(seed)
        force = np.where(T >= 0, shot.force_n, 0.0)
        sigma_a, sigma_f = float(shot.acceleration_m_s2[:3900].std()), float(shot.force_n[:3900].std())
        found.append(
            weak_mass(T, shot.acceleration_m_s2, force, used=LEAD, force_sigma_n=sigma_f, baseline_sigma_m_s2=sigma_a)
        )
    error = np.array([one.mass_kg for one in found]) / MASS_KG - 1
    u = np.array([one.u_kg for one in found]) / MASS_KG
    assert np.abs(error).mean() < 0.004
    assert 0.85 < u.mean() / error.std() < 1.5
    assert np.mean(np.abs(error) < 1.96 * u) >= 0.88


def test_functions_that_reach_lost_samples_are_left_out():
    a, used = TRUE.acceleration_m_s2.copy(), LEAD.copy()
    used[4300] = False
    a[4300] = np.nan
    found = weak_mass(T, a, FORCE, used=used)
    whole = weak_mass(T, TRUE.acceleration_m_s2, FORCE, used=LEAD)
    assert 0 < whole.rows - found.rows <= 8
    assert found.mass_kg == pytest.approx(MASS_KG, rel=1e-9)


def test_the_answers_are_the_changes_of_the_mass_by_errors_of_the_force():
    shot = record_recoil(4)
    forces = np.where((T >= 0)[:, None], shot.forces_n, 0.0)
    force = forces.sum(axis=1)
    found = weak_mass(T, shot.acceleration_m_s2, force, used=LEAD, perturbations_n=forces)
    for column, answer in zip(forces.T, found.sensitivities_kg, strict=True):
        moved = weak_mass(T, shot.acceleration_m_s2, force + 1e-3 * column, used=LEAD).mass_kg
        assert answer == pytest.approx((moved - found.mass_kg) / 1e-3, abs=0.005 * MASS_KG)


def test_too_short_an_interval_or_a_force_against_the_motion_are_no_estimate():
    with pytest.raises(IdentificationError, match="functions of bounded support"):
        weak_mass(T, TRUE.acceleration_m_s2, FORCE, used=(T > 0) & (T < 3e-3))
    with pytest.raises(IdentificationError, match="functions of bounded support"):
        weak_mass(T, TRUE.acceleration_m_s2, FORCE, used=np.zeros(T.shape, dtype=bool))
    with pytest.raises(IdentificationError, match="no positive mass"):
        weak_mass(T, TRUE.acceleration_m_s2, -FORCE, used=LEAD)


def test_arguments_that_are_none_are_refused():
    a = TRUE.acceleration_m_s2
    with pytest.raises(ValueError, match="equally long"):
        weak_mass(T, a[1:], FORCE)
    with pytest.raises(ValueError, match="finite"):
        weak_mass(T, a * np.nan, FORCE)
    with pytest.raises(ValueError, match="half_width_s"):
        weak_mass(T, a, FORCE, half_width_s=1 / RATE_HZ)
    with pytest.raises(ValueError, match="noises"):
        weak_mass(T, a, FORCE, force_sigma_n=-FORCE_NOISE)
