from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import IdentificationError
from recoil_identification.estimators.weak_form import Bumps, weak_displacement_mass, weak_mass
from tests.builders.recoil_scenario import FORCE_NOISE, MARKER_SIGMA_M, MASS_KG, RATE_HZ, record_recoil, true_recoil

TRUE = true_recoil()
T, LEAD, FRAMES_S = TRUE.times_s, TRUE.times_s >= -4e-3, TRUE.frame_times_s
FORCE = TRUE.forces_n.sum(axis=1)


def test_bumps_vanish_at_their_ends_and_their_second_derivative_is_that_of_differences():
    bumps = Bumps(np.array([0.1]), 0.02)
    t = np.linspace(0.07, 0.13, 60_001)
    phi, curvature = bumps.at(t)
    assert phi.max() == pytest.approx(1.0)
    assert np.all(phi[0, np.abs(t - 0.1) >= 0.02] == 0)
    by_differences = np.gradient(np.gradient(phi[0], t), t)
    np.testing.assert_allclose(curvature[0, 5:-5], by_differences[5:-5], atol=1e-3 * np.abs(curvature).max())


@given(st.floats(1e-3, 0.2), st.floats(1e-4, 0.05))
@settings(max_examples=30)
def test_bumps_stay_within_their_interval_and_reach_its_ends(length, half_width):
    bumps = Bumps.over(1.0, 1.0 + length, half_width)
    if length < 2 * half_width:
        assert bumps.centres_s.size == 0
    else:
        assert bumps.centres_s[0] == pytest.approx(1.0 + half_width)
        assert bumps.centres_s[-1] <= 1.0 + length - half_width + 1e-12


def test_without_noise_the_mass_is_exact():
    assert weak_mass(T, TRUE.acceleration_m_s2, FORCE, used=LEAD).mass_kg == pytest.approx(MASS_KG, rel=1e-9)


def test_of_a_displacement_the_mass_is_right_to_what_the_frames_resolve():
    for start_m, drift_m_s in ((0.0, 0.0), (3.0, -2.0)):
        # position and velocity at the begin drop out
        x = TRUE.displacement_m + start_m + drift_m_s * FRAMES_S
        found = weak_displacement_mass(FRAMES_S, x, T, FORCE, used=LEAD, marker_sigma_m=1e-5)
        assert found.mass_kg == pytest.approx(MASS_KG, rel=2e-4)


def test_an_acceleration_that_is_no_force_over_mass_is_taken_off():
    gravity = np.full(T.size, -2.0)
    x = TRUE.displacement_m - FRAMES_S**2
    found = weak_displacement_mass(FRAMES_S, x, T, FORCE, gravity, used=LEAD, marker_sigma_m=1e-5)
    assert found.mass_kg == pytest.approx(MASS_KG, rel=3e-4)
    without = weak_displacement_mass(FRAMES_S, x, T, FORCE, used=LEAD, marker_sigma_m=1e-5)
    assert abs(without.mass_kg / MASS_KG - 1) > 1e-3


@pytest.mark.parametrize("form", ["acceleration", "displacement"])
def test_the_interval_holds_the_mass_of_ringing_shots_about_as_often_as_it_says(form):
    found = []
    for seed in range(50):
        shot = record_recoil(seed)
        force = np.where(T >= 0, shot.force_n, 0.0)
        sigma_a, sigma_f = float(shot.acceleration_m_s2[:3900].std()), float(shot.force_n[:3900].std())
        if form == "acceleration":
            found.append(
                weak_mass(T, shot.acceleration_m_s2, force, used=LEAD, force_sigma_n=sigma_f, quiet_sigma_m_s2=sigma_a)
            )
        else:
            found.append(
                weak_displacement_mass(
                    FRAMES_S,
                    shot.displacement_m,
                    T,
                    force,
                    used=T > -16e-3,
                    marker_sigma_m=MARKER_SIGMA_M,
                    force_sigma_n=sigma_f,
                )
            )
    error = np.array([one.mass_kg for one in found]) / MASS_KG - 1
    u = np.array([one.u_kg for one in found]) / MASS_KG
    assert np.abs(error).mean() < (0.004 if form == "acceleration" else 0.001)
    assert 0.85 < u.mean() / error.std() < 1.5
    assert np.mean(np.abs(error) < 1.96 * u) >= 0.88


def test_functions_that_reach_lost_samples_are_left_out():
    a, used = TRUE.acceleration_m_s2.copy(), LEAD.copy()
    used[4300] = False
    a[4300] = np.nan
    found = weak_mass(T, a, FORCE, used=used)
    assert 0 < found.rows_left_out <= 8
    assert found.mass_kg == pytest.approx(MASS_KG, rel=1e-9)


def test_functions_that_reach_lost_frames_are_left_out_missing_ones_too():
    x = TRUE.displacement_m.copy()
    x[1100] = np.nan
    lost = weak_displacement_mass(FRAMES_S, x, T, FORCE, used=LEAD, marker_sigma_m=1e-5)
    there = np.arange(x.size) != 1100
    missing = weak_displacement_mass(FRAMES_S[there], x[there], T, FORCE, used=LEAD, marker_sigma_m=1e-5)
    for found in (lost, missing):
        assert found.rows_left_out > 0
        assert found.mass_kg == pytest.approx(MASS_KG, rel=3e-4)


def test_the_answers_are_the_changes_of_the_mass_by_errors_of_the_force():
    shot = record_recoil(4)
    forces = np.where((T >= 0)[:, None], shot.forces_n, 0.0)
    force = forces.sum(axis=1)
    found = weak_mass(T, shot.acceleration_m_s2, force, used=LEAD, probes_n=forces)
    for column, answer in zip(forces.T, found.answers_kg, strict=True):
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
    with pytest.raises(ValueError, match="equally many"):
        weak_displacement_mass(FRAMES_S[1:], TRUE.displacement_m, T, FORCE, marker_sigma_m=1e-4)
