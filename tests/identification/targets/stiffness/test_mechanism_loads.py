"""Inverse dynamics gives the loads that made the motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.targets.stiffness.mechanism_loads import (
    MeasuredMotion,
    State,
    foot_displacement,
    foot_velocity,
    loads_of,
    rest_loads,
    state_of,
)
from recoil_rigs.mechanism.model import accelerations, generalized_forces
from recoil_rigs.rig import load_rig
from recoil_rigs.twin.instruments import truth
from recoil_rigs.twin.motion import simulate_motion
from recoil_rigs.twin.settings import read_settings

MECHANISM = load_rig("field-2013").mechanism


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_loads_that_make_a_motion_are_found_from_it(seed):
    rng = np.random.default_rng(seed)
    q = rng.normal(0.0, [0.01, 0.01, 0.02, 0.02, 0.3], (6, 5))
    qd = rng.normal(0.0, [0.1, 0.1, 0.1, 0.2, 8.0], (6, 5))
    P, R, M_C, N_x, N_c, N_d = rng.normal(0.0, 1.0, (6, 6)) * np.array([1e6, 1e5, 1e4, 1e5, 1e4, 1e4])[:, None]
    still = State(q, qd, np.zeros_like(q))
    sliding = np.tanh(foot_velocity(MECHANISM, still) / 5e-3)
    friction = -MECHANISM.f * N_d * sliding
    Q = generalized_forces(MECHANISM, q, P, R, M_C, N_x, N_c, N_d, friction)

    found = loads_of(MECHANISM, replace(still, qdd=accelerations(MECHANISM, q, qd, Q)), P)

    assert np.allclose(found.elevating_moment_n_m, M_C, rtol=1e-9, atol=1e-3)
    assert np.allclose(found.ground_x_n, N_x + friction, rtol=1e-9, atol=1e-3)
    assert np.allclose(found.ground_c_n, N_c, rtol=1e-9, atol=1e-2)
    # the sign of friction in the twin's and the paper's convention is that of the reaction itself
    assert np.allclose(found.ground_d_n, N_d, rtol=1e-9, atol=1e-2)


def test_the_loads_at_rest_carry_the_weights():
    m, rest = MECHANISM, rest_loads(MECHANISM)

    assert rest.ground_x_n[0] == pytest.approx(0.0, abs=1e-6)
    assert rest.ground_c_n[0] + rest.ground_d_n[0] == pytest.approx(-(m.m1 + m.m2 + m.m3) * m.g)
    assert rest.ground_c_n[0] < 0 > rest.ground_d_n[0]


@pytest.fixture(scope="module")
def moved():
    rig = load_rig("field-2013")
    quick = replace(rig, twin={**rig.twin, "duration_s": 0.15, "sample_rate_hz": 25e3})
    settings_ = read_settings(quick)
    motion = simulate_motion(rig.mechanism, settings_, peak_pressure_pa=130e6, friction_n=1500.0)
    place = (0.05, -0.10)

    def feels(role):
        return truth(role, MECHANISM, motion, place)

    P = MECHANISM.force_areas[0] * motion.breech_pressure_pa  # less what the bore takes off
    measured = MeasuredMotion(
        step_s=float(motion.times_s[1]),
        w1=feels("carriage_rate"),
        w2=feels("tipping_rate"),
        f_x=feels("carriage_acceleration_x"),
        f_y=feels("carriage_acceleration_y"),
        r_x=place[0],
        r_y=place[1],
        breech_force_n=P,
        acceleration_m_s2=(P - motion.resistance_n(MECHANISM)) / MECHANISM.m3,
        travel_m=motion.q[:, 4],
        velocity_m_s=motion.qd[:, 4],
        rest=int(np.searchsorted(motion.times_s, motion.t_fire_s)),
    )
    return motion, measured


@pytest.mark.whole_way
def test_sensors_without_errors_give_the_state_of_the_twin(moved):
    motion, measured = moved
    state = state_of(MECHANISM, measured)

    assert np.allclose(state.q, motion.q, rtol=0, atol=2e-6)
    assert np.allclose(state.qd, motion.qd, rtol=0, atol=2e-4)


@pytest.mark.whole_way
def test_sensors_without_errors_give_the_loads_of_the_twin(moved):
    motion, measured = moved
    loads = loads_of(MECHANISM, state_of(MECHANISM, measured), measured.breech_force_n)

    for found, true, largest in (
        (loads.elevating_moment_n_m, motion.elevating_moment_n_m, 20.0),
        (loads.ground_x_n, motion.ground_x_n + motion.ground_friction_n, 150.0),
        (loads.ground_c_n, motion.ground_y_n, 150.0),
        (loads.ground_d_n, motion.ground_d_n, 50.0),
    ):
        assert np.abs(found - true).max() < largest


@pytest.mark.whole_way
def test_a_first_sample_that_is_off_moves_nothing(moved):
    _, measured = moved
    odd = measured.w1.copy()
    odd[0] += 0.01

    plain, disturbed = (state_of(MECHANISM, one) for one in (measured, replace(measured, w1=odd)))

    assert np.abs(disturbed.q[measured.rest :] - plain.q[measured.rest :]).max() < 1e-6


def test_the_foot_rises_with_the_carriage_and_its_rotation():
    q = np.zeros((3, 5))
    q[:, 1], q[:, 2] = 0.001, np.array([0.0, 0.001, -0.002])
    state = State(q, np.tile([0.0, 0.1, 0.2, 0.0, 0.0], (3, 1)), np.zeros_like(q))

    rise, rising = foot_displacement(MECHANISM, state)

    assert np.allclose(rise, 0.001 + MECHANISM.L * q[:, 2] * np.cos(MECHANISM.phi10), atol=1e-6)
    assert np.allclose(rising, 0.1 + MECHANISM.L * 0.2 * np.cos(MECHANISM.phi10 + q[:, 2]))
