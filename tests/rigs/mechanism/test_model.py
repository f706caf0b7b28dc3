"""The three-body model against an independent simulator, conservation laws and virtual work."""

from __future__ import annotations

import dataclasses
import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from recoil_rigs.mechanism import model
from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.mechanism.model import Mechanism
from tests.builders.mujoco_mechanism import mujoco_model

MECHANISM = Gun(
    m1=1600.0, m2=520.0, m3=866.0, J1=2900.0 + 3200.0, J2=420.0, J3c=610.0, X1=1.35, Y1=0.42, XA=2.05, YA=0.95,
    s2=0.35, d2=0.02, b=0.85, d=0.04, e=0.02, L=2.9, f=0.25, phi10=0.02, phi20=0.17,
    bore_area=0.00883, brake_area=0.0056, recuperator_area=0.0078, friction=1800.0,
)  # fmt: skip


def random_states(count: int, seed: int = 20) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q = rng.uniform([-0.2, -0.2, -0.6, -0.8, -0.1], [0.2, 0.2, 0.6, 0.8, 1.1], (count, 5))
    return q, rng.normal(0, [1.0, 1.0, 2.0, 2.0, 10.0], (count, 5))


def test_mass_matrix_velocity_terms_and_accelerations_agree_with_mujoco_at_200_states() -> None:
    simulator = mujoco_model(MECHANISM)
    data = mujoco.MjData(simulator)
    q, qd = random_states(200)
    Q = np.random.default_rng(3).normal(0, [1e5, 1e5, 1e5, 1e5, 1e6], q.shape)
    M = model.mass_matrix(MECHANISM, q)
    h = model.velocity_terms(MECHANISM, q, qd)
    qdd = model.accelerations(MECHANISM, q, qd, Q)
    for i in range(len(q)):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q[i], qd[i], Q[i]
        mujoco.mj_forward(simulator, data)
        full = np.zeros((5, 5))
        mujoco.mj_fullM(simulator, data, full)
        # the massless frame of the two slides weighs a milligram in the simulator
        np.testing.assert_allclose(M[i], full, rtol=1e-9, atol=1e-9 * np.abs(full).max())
        np.testing.assert_allclose(h[i], data.qfrc_bias, rtol=1e-9, atol=1e-9 * np.abs(data.qfrc_bias).max())
        np.testing.assert_allclose(qdd[i], data.qacc, rtol=1e-9, atol=1e-9 * np.abs(data.qacc).max())


finite = st.floats(-1.5, 1.5)


@settings(max_examples=60, deadline=None)
@given(q=st.tuples(finite, finite, finite, finite, finite), scale=st.floats(0.3, 3.0))
def test_mass_matrix_is_symmetric_and_positive_definite(q: tuple[float, ...], scale: float) -> None:
    heavier = dataclasses.replace(MECHANISM, m2=MECHANISM.m2 * scale, J2=MECHANISM.J2 * scale)
    M = model.mass_matrix(heavier, q)
    np.testing.assert_array_equal(M, M.T)
    assert np.linalg.eigvalsh(M).min() > 0


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_an_array_of_states_is_the_same_as_one_state_at_a_time(seed: int) -> None:
    q, qd = random_states(6, seed)
    together = model.accelerations(MECHANISM, q.reshape(2, 3, 5), qd.reshape(2, 3, 5), np.zeros(5))
    apart = np.array([model.accelerations(MECHANISM, a, b, np.zeros(5)) for a, b in zip(q, qd, strict=True)])
    np.testing.assert_allclose(together.reshape(6, 5), apart, rtol=1e-12, atol=1e-12)


def free_flight(m: Mechanism) -> tuple[np.ndarray, np.ndarray]:
    def rates(_: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[5:], model.accelerations(m, y[:5], y[5:], np.zeros(5))])

    start = np.array([0.0, 0.0, 0.1, -0.2, 0.1, 0.3, -0.2, 0.8, -1.5, 3.0])
    run = solve_ivp(rates, (0.0, 0.4), start, method="DOP853", rtol=1e-12, atol=1e-12, t_eval=np.linspace(0, 0.4, 41))
    return run.y[:5].T, run.y[5:].T


def test_energy_is_conserved_without_loads() -> None:
    q, qd = free_flight(MECHANISM)
    energy = model.kinetic_energy(MECHANISM, q, qd) + model.potential_energy(MECHANISM, q)
    assert np.ptp(model.kinetic_energy(MECHANISM, q, qd)) > 100.0
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)


def test_horizontal_momentum_is_conserved_without_loads_and_vertical_momentum_changes_by_the_weight() -> None:
    q, qd = free_flight(MECHANISM)
    p = model.momentum(MECHANISM, q, qd)
    weight = (MECHANISM.m1 + MECHANISM.m2 + MECHANISM.m3) * MECHANISM.g
    np.testing.assert_allclose(p[:, 0], p[0, 0], rtol=1e-9)
    np.testing.assert_allclose(p[:, 1], p[0, 1] - weight * np.linspace(0, 0.4, 41), rtol=1e-9)


def test_both_momenta_are_conserved_without_gravity() -> None:
    weightless = dataclasses.replace(MECHANISM, g=0.0)
    p = model.momentum(weightless, *free_flight(weightless))
    np.testing.assert_allclose(p, np.broadcast_to(p[0], p.shape), rtol=1e-9)


def points(m: Mechanism, q: np.ndarray) -> dict[str, np.ndarray]:
    """Places of the points on which the loads act, from C in battery, written out of the drawing alone."""
    phi1, phi2 = m.phi10 + q[2], m.phi20 + q[2] + q[3]
    C = q[:2]
    e1, e2 = np.array([math.cos(phi1), math.sin(phi1)]), np.array([-math.sin(phi1), math.cos(phi1)])
    e5, e6 = np.array([math.cos(phi2), math.sin(phi2)]), np.array([-math.sin(phi2), math.cos(phi2)])
    A = C + m.XA * e1 + m.YA * e2
    recoiling = A + (m.b - q[4]) * e5 + m.d * e6
    return {"C": C, "D": C + m.L * e1, "breech": recoiling + m.e * e6, "cm3": recoiling, "A": A, "e5": e5}


def test_generalized_forces_do_the_same_virtual_work_as_the_loads() -> None:
    m = MECHANISM
    q = np.array([0.02, 0.01, 0.05, -0.1, 0.4])
    P, R, M_C, N_x, N_y, N_d = 9e5, 4e4, 7e3, -3e3, -2e4, -1.5e4
    here = points(m, q)
    loads = {
        "breech": -P * here["e5"],
        "cm3": R * here["e5"],
        "C": np.array([-N_x, -N_y]),
        "D": np.array([-m.f * N_d, -N_d]),
    }
    step = 1e-6
    expected = np.zeros(5)
    for j in range(5):
        up, down = (points(m, q + sign * step * np.eye(5)[j]) for sign in (1, -1))
        for name, load in loads.items():
            expected[j] += load @ (up[name] - down[name]) / (2 * step)
        # the resistance's reaction acts on the tipping part, which moves with A and turns: take the
        # point of B2 that lies at the centre of mass of B3, that is B3's point without the travel
        if j != 4:
            expected[j] += -R * here["e5"] @ (up["cm3"] - down["cm3"]) / (2 * step)
    expected[3] -= M_C
    found = model.generalized_forces(m, q, P, R, M_C, N_x, N_y, N_d)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-3)
    given_friction = model.generalized_forces(m, q, P, R, M_C, N_x, N_y, N_d, ground_friction=m.f * N_d)
    np.testing.assert_array_equal(found, given_friction)


def test_power_of_the_loads_is_the_rate_of_change_of_energy() -> None:
    q, qd = random_states(50, 4)
    Q = model.generalized_forces(MECHANISM, q, 8e5, 3e4, 2e3, -1e3, -2e4, -1e4)
    qdd = model.accelerations(MECHANISM, q, qd, Q)
    step = 1e-6

    def energy(sign: float) -> np.ndarray:
        place = q + sign * step * qd + 0.5 * step**2 * qdd
        rate = qd + sign * step * qdd
        return model.kinetic_energy(MECHANISM, place, rate) + model.potential_energy(MECHANISM, place)

    power = np.sum(Q * qd, axis=1)
    np.testing.assert_allclose((energy(1) - energy(-1)) / (2 * step), power, rtol=1e-6, atol=1e-6 * np.abs(power).max())


def test_the_second_row_of_12_is_the_inertia_of_the_tipping_part_once_its_bracket_holds_both_terms() -> None:
    m = dataclasses.replace(MECHANISM, m3=0.0, J3c=0.0, g=0.0)  # what is left of the fourth equation is B2's
    q, qd = random_states(200, 12)
    qdd = np.random.default_rng(13).normal(0, [30, 30, 20, 20, 500], q.shape)
    phi1, phi2 = m.phi10 + q[:, 2], m.phi20 + q[:, 2] + q[:, 3]
    c2, s2 = np.cos(phi2), np.sin(phi2)
    cd, sd = np.cos(phi2 - phi1), np.sin(phi2 - phi1)
    along, across = m.s2 * m.XA + m.d2 * m.YA, m.s2 * m.YA - m.d2 * m.XA
    linear = (
        m.m2 * (m.s2 * s2 + m.d2 * c2) * qdd[:, 0] - m.m2 * (m.s2 * c2 - m.d2 * s2) * qdd[:, 1]
        - (m.J2 + m.m2 * along * cd + m.m2 * across * sd) * qdd[:, 2] - m.J2 * qdd[:, 3]
    )  # fmt: skip
    printed = linear - m.m2 * (along * sd - across * cd * qd[:, 2] ** 2)
    right = linear - m.m2 * (along * sd - across * cd) * qd[:, 2] ** 2
    M, h = model.mass_matrix(m, q), model.velocity_terms(m, q, qd)
    expected = -np.einsum("ij,ij->i", M[:, 3], qdd) - h[:, 3]
    np.testing.assert_allclose(right, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    assert np.abs(printed - expected).max() > 100.0


def written_out(m: Mechanism, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """a' of (36), term by term."""
    phi1, phi2 = m.phi10 + q[:, 2], m.phi20 + q[:, 2] + q[:, 3]
    c2, s2 = np.cos(phi2), np.sin(phi2)
    cd, sd = np.cos(phi2 - phi1), np.sin(phi2 - phi1)
    xi2, eta2, alpha2, beta2, x2 = qdd.T
    return (
        x2 + m.d * (alpha2 + beta2) - xi2 * c2 - eta2 * s2 - (m.XA * sd - m.YA * cd) * alpha2
        + (m.XA * cd + m.YA * sd) * qd[:, 2] ** 2 + (m.b - q[:, 4]) * (qd[:, 2] + qd[:, 3]) ** 2 - m.g * s2
    )  # fmt: skip


def test_the_specific_acceleration_is_the_identification_equation_and_balances_the_forces() -> None:
    q, qd = random_states(200, 5)
    P, R = 9e5, 4e4
    Q = model.generalized_forces(MECHANISM, q, P, R, 1e3, -5e3, -2e4, -1e4)
    qdd = model.accelerations(MECHANISM, q, qd, Q)
    a = model.specific_acceleration(MECHANISM, q, qd, qdd)
    np.testing.assert_allclose(a, written_out(MECHANISM, q, qd, qdd), rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(MECHANISM.m3 * a, P - R, rtol=1e-9)


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.3, -0.2)])
def test_the_kinematic_way_takes_the_mounting_place_of_the_carriage_accelerometers_off(
    place: tuple[float, float],
) -> None:
    q, qd = random_states(200, 6)
    qdd = np.random.default_rng(7).normal(0, [30, 30, 20, 20, 500], q.shape)
    f_x, f_y = model.carriage_specific_force(MECHANISM, q, qd, qdd, *place)
    w2, dw2 = qd[:, 2] + qd[:, 3], qdd[:, 2] + qdd[:, 3]
    common = (q[:, 4], w2, dw2, f_x, f_y, q[:, 3])
    off = {"w1": qd[:, 2], "dw1": qdd[:, 2], "r_x": place[0], "r_y": place[1]}
    a = model.specific_acceleration_kinematic(MECHANISM, qdd[:, 4], *common, **off)
    np.testing.assert_allclose(a, written_out(MECHANISM, q, qd, qdd), rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(model.relative_acceleration(MECHANISM, a, *common, **off), qdd[:, 4], atol=1e-9)


def test_the_inertial_way_takes_the_lever_arms_off() -> None:
    m, (r5, r6) = MECHANISM, (-0.4, 0.15)
    q, qd = random_states(1, 8)
    qdd = np.random.default_rng(9).normal(0, [30, 30, 20, 20, 500], q.shape)
    step = 1e-4

    def place(t: float) -> np.ndarray:
        state = q[0] + t * qd[0] + 0.5 * t**2 * qdd[0]
        at = points(m, state)
        e6 = np.array([-at["e5"][1], at["e5"][0]])
        return at["cm3"] + r5 * at["e5"] + r6 * e6

    second = (place(step) - 2 * place(0.0) + place(-step)) / step**2
    reading = -(second + np.array([0.0, m.g])) @ points(m, q[0])["e5"]
    a = model.specific_acceleration_inertial(reading, qd[0, 2] + qd[0, 3], qdd[0, 2] + qdd[0, 3], r5, r6)
    assert abs(reading - a) > 0.1
    np.testing.assert_allclose(a, written_out(m, q, qd, qdd)[0], rtol=1e-5)


@pytest.mark.parametrize("mark", [(0.0, 0.0), (-0.4, 0.15)])
@pytest.mark.parametrize("place", [(0.0, 0.0), (0.3, -0.2)])
def test_a_camera_on_the_ground_sees_the_second_difference_of_a_marks_place_along_the_bore_at_rest(place, mark) -> None:
    m = MECHANISM
    q, qd = random_states(40, 14)
    qdd = np.random.default_rng(15).normal(0, [30, 30, 20, 20, 500], q.shape)
    f_x, f_y = model.carriage_specific_force(m, q, qd, qdd, *place)
    w2, dw2, turned = qd[:, 2] + qd[:, 3], qdd[:, 2] + qdd[:, 3], q[:, 2] + q[:, 3]
    found = model.ground_acceleration(
        m, model.specific_acceleration(m, q, qd, qdd), q[:, 4], qd[:, 4], turned, w2, dw2, f_x, f_y, q[:, 3],
        w1=qd[:, 2], dw1=qdd[:, 2], r_x=place[0], r_y=place[1], p_5=mark[0], p_6=mark[1],
    )  # fmt: skip
    step, at_rest = 1e-4, np.array([math.cos(m.phi20), math.sin(m.phi20)])

    def seen(i: int, t: float) -> float:
        at = points(m, q[i] + t * qd[i] + 0.5 * t**2 * qdd[i])
        e6 = np.array([-at["e5"][1], at["e5"][0]])
        return float(-(at["cm3"] + mark[0] * at["e5"] + mark[1] * e6) @ at_rest)

    second = [(seen(i, step) - 2 * seen(i, 0.0) + seen(i, -step)) / step**2 for i in range(len(q))]
    np.testing.assert_allclose(found, second, rtol=1e-5, atol=1e-3)


def test_carriage_accelerometers_read_gravity_resolved_on_their_axes_in_battery() -> None:
    rest = np.zeros(5)
    f_x, f_y = model.carriage_specific_force(MECHANISM, rest, rest, rest)
    np.testing.assert_allclose([f_x, f_y], [9.80665 * math.sin(0.02), 9.80665 * math.cos(0.02)])
