"""The virtual rig's true motion: equilibrium, equations of motion, energy, and what a recoil looks like."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from recoil_rigs.mechanism import model
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import load_rig
from recoil_rigs.twin.loads import check_statics
from recoil_rigs.twin.motion import Motion, breech_pressure, simulate_motion
from recoil_rigs.twin.settings import TwinSettings

SETTINGS = TwinSettings()


@cache
def bundled() -> tuple[Mechanism, Motion]:
    mechanism = dataclasses.replace(load_rig("field-2013").mechanism, bore_friction=0.0)
    return mechanism, simulate_motion(mechanism, SETTINGS, peak_pressure_pa=130e6, friction_n=1500.0)


def forces(m: Mechanism, motion: Motion) -> np.ndarray:
    return model.generalized_forces(
        m, motion.q, m.bore_area * motion.breech_pressure_pa, motion.resistance_n(m), motion.elevating_moment_n_m,
        motion.ground_x_n, motion.ground_y_n, motion.ground_d_n, motion.ground_friction_n,
    )  # fmt: skip


@pytest.mark.exhaustive
def test_the_accelerations_are_those_of_the_model_under_the_recorded_loads() -> None:
    m, motion = bundled()
    expected = model.accelerations(m, motion.q, motion.qd, forces(m, motion))
    np.testing.assert_allclose(motion.qdd, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.exhaustive
def test_work_of_the_loads_is_the_change_of_energy() -> None:
    m, motion = bundled()
    power = np.sum(forces(m, motion) * motion.qd, axis=1)
    work = cumulative_simpson(power, dx=motion.times_s[1], initial=0.0)
    energy = model.kinetic_energy(m, motion.q, motion.qd) + model.potential_energy(m, motion.q)
    np.testing.assert_allclose(energy - energy[0], work, atol=1e-6 * np.ptp(energy))


@pytest.mark.exhaustive
def test_velocity_and_travel_are_the_integrals_of_the_acceleration() -> None:
    _, motion = bundled()
    step = motion.times_s[1]
    for rate, integral in ((motion.qdd, motion.qd), (motion.qd, motion.q)):
        expected = cumulative_simpson(rate, dx=step, axis=0, initial=0.0)
        np.testing.assert_allclose(integral, expected, atol=1e-5 * np.abs(integral).max())


@pytest.mark.exhaustive
def test_a_smaller_step_gives_the_same_motion() -> None:
    m, motion = bundled()
    finer = SETTINGS.model_copy(update={"sample_rate_hz": 100e3, "duration_s": 0.15})
    fine = simulate_motion(m, finer, peak_pressure_pa=130e6, friction_n=1500.0)
    np.testing.assert_allclose(motion.q[:7500], fine.q[::2], atol=1e-6)
    np.testing.assert_allclose(motion.qd[:7500], fine.qd[::2], atol=1e-4)


@pytest.mark.exhaustive
def test_a_lower_sample_rate_is_integrated_in_smaller_steps() -> None:
    m, motion = bundled()
    slow = simulate_motion(
        m, SETTINGS.model_copy(update={"sample_rate_hz": 10e3}), peak_pressure_pa=130e6, friction_n=1500.0
    )
    assert slow.times_s[1] == pytest.approx(25e-6)
    assert slow.q[:, 4].max() == pytest.approx(motion.q[:, 4].max(), rel=1e-6)


def test_nothing_moves_before_the_shot_although_all_weights_and_preloads_act() -> None:
    m, motion = bundled()
    before = motion.times_s < motion.t_fire_s
    assert before.sum() > 1000
    assert not motion.q[before].any()
    assert np.abs(motion.qdd[before]).max() < 1e-9
    assert motion.contact_n[0] > 1000.0
    weight = (m.m1 + m.m2 + m.m3) * m.g
    assert -motion.ground_y_n[0] - motion.ground_d_n[0] == pytest.approx(weight)


def test_the_motion_has_the_size_of_a_recoil() -> None:
    m, motion = bundled()
    assert 0.7 < motion.q[:, 4].max() < 1.0
    assert 0.1 < motion.t_end_s - motion.t_fire_s < 0.25
    assert m.bore_area * motion.breech_pressure_pa.max() == pytest.approx(1.148e6, rel=1e-3)
    peak = motion.times_s[motion.breech_pressure_pa.argmax()] - motion.t_fire_s
    assert 1.5e-3 < peak < 3e-3
    assert motion.qd[-1, 4] < -0.5  # the record holds a part of the counter-recoil
    assert motion.brake_pressure_pa.min() == 0.0
    at_end = np.searchsorted(motion.times_s, motion.t_end_s)
    assert motion.qd[at_end - 1, 4] > 0 >= motion.qd[at_end, 4]


def test_packing_friction_opposes_the_motion_and_is_whole_while_it_slides() -> None:
    _, motion = bundled()
    sliding = (motion.q[:, 4] > 1e-3) & (motion.times_s < motion.t_end_s)
    np.testing.assert_array_equal(motion.friction_n[sliding], 1500.0)
    assert motion.friction_n[-1] == -1500.0


@pytest.mark.exhaustive
def test_packing_friction_holds_at_rest() -> None:
    m, _ = bundled()
    # too small a shot to overcome the preload of the stop: the part stays in battery
    short = SETTINGS.model_copy(update={"duration_s": 0.15})
    motion = simulate_motion(m, short, peak_pressure_pa=1e6, friction_n=1500.0)
    assert motion.q[:, 4].max() < 1e-4
    assert np.isnan(motion.t_end_s)


def test_breech_pressure_peaks_where_it_is_told_to_and_is_zero_before() -> None:
    times = np.arange(-0.01, 0.05, 1e-6)
    pulse = breech_pressure(times, 130e6, 1.5e-3, 5e-3)
    assert pulse.max() == pytest.approx(130e6, rel=1e-6)
    assert not pulse[times <= 0].any()
    assert pulse.min() == 0.0


def test_a_mechanism_that_tips_over_or_is_not_held_in_battery_is_refused() -> None:
    m, _ = bundled()
    short = dataclasses.replace(m, L=0.5)
    weak = SETTINGS.model_copy(update={"recuperator_pressure_pa": 1e4})
    assert [fault.key for fault in check_statics(short, SETTINGS)] == ["mechanism.L"]
    assert [fault.key for fault in check_statics(m, weak)] == ["twin.recuperator_pressure_pa"]
    with pytest.raises(ValueError, match="rest in battery"):
        simulate_motion(short, SETTINGS, peak_pressure_pa=130e6, friction_n=1500.0)
    with pytest.raises(ValueError, match="friction_n"):
        simulate_motion(m, SETTINGS, peak_pressure_pa=130e6, friction_n=-1.0)
