"""The projectile's travel and exit against their formulas, and what a muzzle brake takes off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_processing.shot.projectile import breech_force_on_body_n, muzzle_force_n, projectile_travel_m
from tests.builders.bench_shots import bench_regression, bench_rig

STEP_S = 1e-5
TIMES_S = STEP_S * np.arange(2001)
FORCE_N, MASS_KG, BORE_M = 1e6, 20.0, 2.0
EXIT_S = float(np.sqrt(2.0 * BORE_M * MASS_KG / FORCE_N))
"""Of a constant force."""
STATED = replace(bench_rig().mechanism, muzzle_brake=0.3, projectile_mass=MASS_KG, bore_length=BORE_M)


def test_a_constant_force_drives_it_by_half_of_its_acceleration_times_time_squared() -> None:
    travel_m = projectile_travel_m(np.full(TIMES_S.size, FORCE_N), STEP_S, MASS_KG)
    np.testing.assert_allclose(travel_m, 0.5 * FORCE_N / MASS_KG * TIMES_S**2, atol=1e-9)


def test_lost_samples_are_bridged_and_what_pulls_does_nothing() -> None:
    force_n = np.full(TIMES_S.size, FORCE_N)
    lossy = np.where((TIMES_S > 2e-3) & (TIMES_S < 3e-3), np.nan, force_n)
    whole = projectile_travel_m(force_n, STEP_S, MASS_KG)
    np.testing.assert_allclose(projectile_travel_m(lossy, STEP_S, MASS_KG), whole, rtol=1e-12)
    assert not projectile_travel_m(-force_n, STEP_S, MASS_KG).any()


def test_a_muzzle_brake_takes_its_share_from_the_exit_on_and_comes_up_in_a_third_of_a_millisecond() -> None:
    force_n = np.full(TIMES_S.size, FORCE_N)
    expected = FORCE_N * np.where(TIMES_S > EXIT_S, 1.0 - np.exp(-(TIMES_S - EXIT_S) / 3e-4), 0.0)
    found = muzzle_force_n(force_n, STEP_S, STATED)
    np.testing.assert_allclose(found, expected, atol=1e-3 * FORCE_N)
    on_body_n = breech_force_on_body_n(force_n / STATED.force_areas[0], STEP_S, STATED)
    np.testing.assert_allclose(on_body_n, force_n - 0.3 * found, rtol=1e-12)


@pytest.mark.parametrize("unstated", [{"projectile_mass": 0.0}, {"bore_length": 0.0}, {"bore_length": 1e3}])
def test_without_an_exit_it_takes_nothing(unstated: dict[str, float]) -> None:
    force_n = np.full(TIMES_S.size, FORCE_N)
    none = replace(STATED, **unstated)
    found = breech_force_on_body_n(force_n / none.force_areas[0], STEP_S, none)
    np.testing.assert_allclose(found, force_n, rtol=1e-12)


def test_a_stated_muzzle_brake_is_in_the_breech_force_of_the_equation_of_motion() -> None:
    stated = replace(STATED, projectile_mass=15.0)
    plain, braked = (bench_regression(rig=replace(bench_rig(), mechanism=m)) for m in (bench_rig().mechanism, stated))
    off_n = plain.forces_n - braked.forces_n
    assert not off_n[:, 1:].any()
    expected = 0.3 * muzzle_force_n(plain.forces_n[:, 0], plain.step_s, stated)
    assert expected.max() > 1e4
    np.testing.assert_allclose(off_n[:, 0], expected, atol=0.01 * expected.max())
