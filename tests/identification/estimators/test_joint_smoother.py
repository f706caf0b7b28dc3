from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.estimators.joint_recoil import Knowledge, Recoil
from recoil_identification.estimators.joint_smoother import joint_mass
from tests.builders.recoil_scenario import MARKER_SIGMA_M, MASS_KG, RATE_HZ, record_recoil, true_recoil

TRUE = true_recoil()
T = TRUE.times_s


def recoil(seed: int, **errors: float) -> tuple[Recoil, Knowledge]:
    shot = record_recoil(seed, **errors)
    known = Knowledge(float(shot.force_n[:3900].std()), float(shot.acceleration_m_s2[:3900].std()))
    force = np.where(T >= 0, shot.force_n, 0.0)
    return (
        Recoil(
            float(T[0]), 1 / RATE_HZ, force, shot.acceleration_m_s2, np.zeros_like(T), T >= -2e-3,
            TRUE.frame_times_s, shot.displacement_m, 0.0, TRUE.end_s,
        ),
        known,
    )  # fmt: skip


def test_the_interval_holds_the_mass_as_often_as_it_says():
    found = [joint_mass(*recoil(seed)) for seed in range(20)]
    error = np.array([one.mass_kg for one in found]) / MASS_KG - 1
    u = np.array([one.u_kg for one in found]) / MASS_KG
    assert abs(error.mean()) < 4e-4
    assert np.abs(error).mean() < 1e-3
    assert 0.8 < u.mean() / error.std() < 1.35
    assert np.mean(np.abs(error) < 1.96 * u) >= 0.88
    assert all(one.settled for one in found)
    for value, stated in (("zero_m_s2", "u_zero_m_s2"), ("skew_s", "u_skew_s")):
        over = np.array([getattr(one, value) / getattr(one, stated) for one in found])
        assert 0.7 < over.std() < 1.4, value


def test_a_zero_shift_is_absorbed():
    found = joint_mass(*recoil(1, zero_shift=0.02))
    assert found.zero_m_s2 == pytest.approx(0.02 * TRUE.peak_m_s2, abs=4 * found.u_zero_m_s2)
    assert found.mass_kg == pytest.approx(joint_mass(*recoil(1)).mass_kg, rel=1e-4)


@pytest.mark.parametrize("samples", [1, 4])
def test_a_late_force_is_absorbed(samples):
    late, plain = joint_mass(*recoil(2, force_late_samples=samples)), joint_mass(*recoil(2))
    assert late.skew_s - plain.skew_s == pytest.approx(samples / RATE_HZ, abs=3e-6)
    assert late.mass_kg == pytest.approx(plain.mass_kg, rel=3e-4)


def test_a_skew_that_is_held_is_none():
    shot, known = recoil(2, force_late_samples=4)
    held = joint_mass(shot, replace(known, u_skew_s=0.0, u_zero_m_s2=0.0))
    assert held.skew_s == held.zero_m_s2 == held.u_skew_kg == 0.0


def test_a_wrong_scale_is_told_where_it_may_be_wrong():
    shot, known = recoil(3, acceleration_gain=1.02)
    found = joint_mass(shot, replace(known, u_gain=0.02))
    assert found.gain_error == pytest.approx(0.02, abs=0.012)
    assert found.mass_kg == pytest.approx(MASS_KG, rel=3e-3)
    assert found.u_gain_kg < 0.002 * MASS_KG


def test_the_cameras_own_scale_is_not_told_but_counted():
    shot, known = recoil(3)
    found = joint_mass(shot, replace(known, u_scale=0.002, u_gain=0.05))
    assert found.u_scale_kg == pytest.approx(0.002 * MASS_KG, rel=0.05)
    assert found.u_kg < 0.0015 * MASS_KG


def test_travel_and_velocity_are_smoother_than_the_frames():
    found = joint_mass(*recoil(5))
    at = np.searchsorted(TRUE.frame_times_s, found.frame_times_s)
    assert np.std(found.travel_m - TRUE.displacement_m[at]) < 0.3 * MARKER_SIGMA_M
    assert np.max(np.abs(found.velocity_m_s - TRUE.velocity_at_frames_m_s[at])) < 0.08
    assert np.std(found.residual_m) == pytest.approx(MARKER_SIGMA_M, rel=0.15)
    assert found.levels.marker_sigma_m == pytest.approx(MARKER_SIGMA_M, rel=0.15)


def test_a_shifted_camera_clock_is_found_where_it_may_be():
    shot, known = recoil(6)
    moved = replace(shot, frame_times_s=shot.frame_times_s + 2e-4)
    found = joint_mass(moved, replace(known, u_shift_s=math.inf))
    plain = joint_mass(shot, replace(known, u_shift_s=math.inf))
    assert found.shift_s - plain.shift_s == pytest.approx(-2e-4, abs=3e-5)
    assert found.mass_kg == pytest.approx(plain.mass_kg, rel=5e-4)


def test_the_answers_are_the_changes_of_the_mass_by_errors_of_the_force():
    shot, known = recoil(7)
    breech = np.where(T >= 0, TRUE.forces_n[:, 0], 0.0)
    found = joint_mass(shot, known, perturbations_n=breech[:, None])
    moved = joint_mass(replace(shot, force_n=shot.force_n + 1e-3 * breech), known, levels=found.levels)
    assert found.sensitivities_kg[0] == pytest.approx((moved.mass_kg - found.mass_kg) / 1e-3, rel=0.005)


def test_what_is_no_estimate_says_why():
    shot, known = recoil(8)
    with pytest.raises(IdentificationError, match="frames saw the recoil"):
        joint_mass(replace(shot, end_s=3e-3), known)
    with pytest.raises(IdentificationError, match="no positive mass"):
        joint_mass(replace(shot, force_n=-shot.force_n), known)


def test_arguments_that_are_none_are_refused():
    shot, _ = recoil(8)
    with pytest.raises(ValueError, match="equally long"):
        replace(shot, used=shot.used[1:])
    with pytest.raises(ValueError, match="finite"):
        replace(shot, force_n=shot.force_n * np.nan)
    with pytest.raises(ValueError, match="before the end"):
        replace(shot, end_s=-1.0)
    with pytest.raises(ValueError, match="u_zero_m_s2"):
        Knowledge(1.0, 1.0, u_zero_m_s2=-1.0)
