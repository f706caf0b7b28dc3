from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import IdentificationError
from recoil_processing.shot.clocks.double_impulse import DoubleImpulseMass, double_impulse_mass
from tests.builders.recoil_scenario import MARKER_SIGMA_M, MASS_KG, RATE_HZ, record_recoil, true_recoil

TRUE = true_recoil()
T, FRAMES_S = TRUE.times_s, TRUE.frame_times_s
FORCE = TRUE.forces_n.sum(axis=1)


def estimated(x: np.ndarray = TRUE.displacement_m, force: np.ndarray = FORCE, frames_s=FRAMES_S, **more):
    options = {"release_s": 0.0, "end_s": TRUE.end_s, "rough_mass_kg": 770.0} | more
    return double_impulse_mass(frames_s, x, float(T[0]), 1 / RATE_HZ, force, **options)


def of_shot(seed: int, **more) -> DoubleImpulseMass:
    shot = record_recoil(seed)
    sigma = float(shot.force_n[:3900].std())
    force = np.where(T >= 0, shot.force_n, 0.0)
    return estimated(shot.displacement_m, force, force_sigma_n=sigma, **more)


def test_without_noise_the_mass_is_right_to_the_integration_of_straight_lines():
    assert estimated().mass_kg == pytest.approx(MASS_KG, rel=2e-5)


@pytest.mark.exhaustive
def test_the_interval_holds_the_mass_as_often_as_it_says_and_the_noise_is_found():
    found = [of_shot(seed) for seed in range(40)]
    error = np.array([one.mass_kg for one in found]) / MASS_KG - 1
    u = np.array([one.u_kg for one in found]) / MASS_KG
    assert abs(error.mean()) < 4e-4
    assert np.abs(error).mean() < 1e-3
    assert 0.8 < u.mean() / error.std() < 1.3
    assert np.mean(np.abs(error) < 1.96 * u) >= 0.88
    assert np.mean([one.marker_sigma_m for one in found]) == pytest.approx(MARKER_SIGMA_M, rel=0.03)
    assert np.median([one.inflation for one in found]) == 1.0


@pytest.mark.exhaustive
@given(st.floats(-1.0, 1.0), st.floats(-0.5, 0.5), st.floats(-2e-4, 2e-4))
@settings(max_examples=10)
def test_start_velocity_and_shift_may_be_free(start_m, velocity_m_s, shift_s):
    moving = FRAMES_S >= 0
    t = FRAMES_S[moving]
    x = np.interp(t + shift_s, FRAMES_S, TRUE.displacement_m) + start_m + velocity_m_s * t
    found = estimated(x, frames_s=t, u_shift_s=math.inf, u_velocity_m_s=math.inf)
    assert found.mass_kg == pytest.approx(MASS_KG, rel=3e-3)
    assert found.shift_s == pytest.approx(shift_s, abs=2e-5)


def test_what_is_held_by_a_certain_knowledge_is_as_if_it_were_not_asked_for():
    held, certain = of_shot(1), of_shot(1, u_shift_s=1e-12)
    assert certain.mass_kg == pytest.approx(held.mass_kg, rel=1e-5)
    assert held.shift_s == held.u_shift_s == 0.0


def test_an_uncertain_clock_costs_what_it_may_move():
    free, known = of_shot(2, u_shift_s=math.inf), of_shot(2, u_shift_s=1e-4)
    assert 0 < known.u_shift_s < free.u_shift_s
    assert known.u_kg <= free.u_kg


def test_an_acceleration_that_is_no_force_over_mass_is_taken_off():
    gravity = np.where(T >= 0, -1.7, 0.0)
    x = TRUE.displacement_m - 0.85 * np.maximum(FRAMES_S, 0.0) ** 2
    assert double_impulse_mass(
        FRAMES_S, x, float(T[0]), 1 / RATE_HZ, FORCE, gravity, release_s=0.0, rough_mass_kg=780.0
    ).mass_kg == pytest.approx(MASS_KG, rel=5e-5)
    assert abs(estimated(x).mass_kg / MASS_KG - 1) > 1e-3


def test_rest_before_the_release_makes_the_mass_more_certain():
    assert of_shot(3).u_kg < 0.95 * of_shot(3, u_velocity_m_s=math.inf).u_kg


def test_lost_and_wild_frames_are_set_aside():
    shot = record_recoil(6)
    x = shot.displacement_m.copy()
    x[1050], x[1100:1105] = x[1050] + 0.02, np.nan
    found = estimated(x, np.where(T >= 0, shot.force_n, 0.0), force_sigma_n=2e4)
    assert found.set_aside >= 1
    assert found.mass_kg == pytest.approx(MASS_KG, rel=4e-3)


def test_a_wrong_gauge_walks_and_is_not_taken_for_the_markers_noise():
    shot = record_recoil(7, brake_gain=1.05)
    found = estimated(shot.displacement_m, np.where(T >= 0, shot.force_n, 0.0), force_sigma_n=2e4)
    assert found.inflation > 1
    assert found.marker_sigma_m == pytest.approx(MARKER_SIGMA_M, rel=0.15)


def test_too_few_frames_or_a_force_against_the_motion_are_no_estimate():
    with pytest.raises(IdentificationError, match="frames saw the recoil"):
        estimated(end_s=4e-3)
    with pytest.raises(IdentificationError, match="no positive mass"):
        estimated(-TRUE.displacement_m)


def test_arguments_that_are_none_are_refused():
    with pytest.raises(ValueError, match="equally many"):
        estimated(TRUE.displacement_m[1:])
    with pytest.raises(ValueError, match="increase"):
        estimated(frames_s=FRAMES_S[::-1])
    with pytest.raises(ValueError, match="finite"):
        estimated(force=FORCE * np.nan)
    with pytest.raises(ValueError, match="u_shift_s must not be negative"):
        estimated(u_shift_s=-1.0)
    with pytest.raises(ValueError, match="rough_mass_kg"):
        estimated(rough_mass_kg=0.0)


def restricted(force_n: np.ndarray, u: tuple[float, ...]) -> DoubleImpulseMass:
    """Estimate with an error of each gauge's force as an unknown of its own."""
    errors = record_errors()
    return estimated(force=force_n, force_errors_n=errors, u_force_errors=np.array(u), levels=(MARKER_SIGMA_M, 1e-4))


def record_errors() -> np.ndarray:
    return TRUE.forces_n[:, :2]


def test_an_error_of_a_force_that_is_free_is_found_and_does_not_move_the_mass():
    wrong = FORCE + 0.02 * record_errors()[:, 1]
    assert estimated(force=wrong, levels=(MARKER_SIGMA_M, 1e-4)).mass_kg != pytest.approx(MASS_KG, rel=5e-4)
    found = restricted(wrong, (1e-6, 1.0))
    assert found.mass_kg == pytest.approx(MASS_KG, rel=5e-4)
    assert found.force_errors[1] == pytest.approx(0.02, abs=1e-3)


def test_errors_that_are_known_to_be_none_change_nothing():
    plain, held = estimated(levels=(MARKER_SIGMA_M, 1e-4)), restricted(FORCE, (0.0, 0.0))
    assert held.mass_kg == plain.mass_kg
    assert held.u_kg == plain.u_kg
    assert np.array_equal(held.force_errors, [0.0, 0.0])


def test_uncertainties_that_do_not_fit_the_errors_are_refused():
    with pytest.raises(ValueError, match="do not fit errors"):
        estimated(force_errors_n=record_errors(), u_force_errors=np.ones(3))
