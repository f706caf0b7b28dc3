"""The flexible tube: Lagrange's equations anew, a chain of rigid links, energy, and what is left without bending."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import mujoco
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from recoil_rigs.mechanism import flexible_tube as flexible
from recoil_rigs.mechanism import model as rigid
from recoil_rigs.mechanism.beam import natural_frequencies, shapes
from recoil_rigs.mechanism.flexible_tube import FlexibleTube, uniform_tube
from recoil_rigs.rig import load_rig
from tests.builders.bore_correction import bore_correction

MECHANISM = load_rig("field-2013").mechanism
LENGTH, MASS, STIFFNESS, ROOT, OFFSET = 2.5, 160.0, 2e6, 0.1, 0.02


def tube(modes: int = 2, damping: float = 0.0, stiffness: float = STIFFNESS) -> FlexibleTube:
    return uniform_tube(LENGTH, MASS, stiffness, modes, damping, ROOT, OFFSET)


def random_states(count: int, modes: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1, 1, (count, 5 + modes)) * ([0.2, 0.2, 0.6, 0.8, 0.5] + [0.02] * modes)
    qd = rng.normal(0, 1, (count, 5 + modes)) * ([1.0, 1.0, 2.0, 2.0, 10.0] + [1.0] * modes)
    return q, qd


PARTICLES = np.array([[30.0, 0.7], [50.0, 2.1]])
"""Masses, kg, and places ahead of the centre of mass, m, of a tube that is two particles."""
SHAPES = np.linalg.qr(np.sqrt(PARTICLES[:, :1]) * [[0.2, 0.5], [2.0, 1.0]])[0]
SHAPES = np.sqrt(100.0 / PARTICLES[:, :1]) * SHAPES
"""Deflections of two modes there: the sum of mass times the product of both is 100 kg or nothing."""
SHORTENING = np.array([[[0.4, -0.1], [-0.1, 0.9]], [[1.1, 0.2], [0.2, 2.0]]])


def tube_of_particles() -> FlexibleTube:
    mass, place = PARTICLES.T
    return FlexibleTube(
        100.0, OFFSET, mass @ SHAPES, (mass * place) @ SHAPES, np.tensordot(mass, SHORTENING, 1),
        np.tensordot(mass * place, SHORTENING, 1), np.array([4e5, 9e6]), np.array([30.0, 70.0]),
    )  # fmt: skip


@cache
def lagrange():
    """Mass matrix and velocity terms that the bending of one particle of 1 kg adds, out of its place alone."""
    q, v = sp.symbols("q:7"), sp.symbols("v:7")
    place, first_shape, second_shape, g11, g12, g22 = particle = sp.symbols(
        "place first_shape second_shape g11 g12 g22"
    )
    m = MECHANISM
    phi1, phi2 = m.phi10 + q[2], m.phi20 + q[2] + q[3]
    e1, e2 = sp.Matrix([sp.cos(phi1), sp.sin(phi1)]), sp.Matrix([-sp.sin(phi1), sp.cos(phi1)])
    e5, e6 = sp.Matrix([sp.cos(phi2), sp.sin(phi2)]), sp.Matrix([-sp.sin(phi2), sp.cos(phi2)])
    w = first_shape * q[5] + second_shape * q[6]
    u = g11 * q[5] ** 2 / 2 + g12 * q[5] * q[6] + g22 * q[6] ** 2 / 2
    unbent = sp.Matrix(q[:2]) + m.XA * e1 + m.YA * e2 + (m.b - q[4] + place) * e5 + (m.d + OFFSET) * e6
    bent, drawn = w * e6, -u * e5
    fixed, first, second = (part.jacobian(sp.Matrix(q)) * sp.Matrix(v) for part in (unbent, bent, drawn))
    # bending adds what is of first and second order in it
    T = fixed.dot(first) + fixed.dot(second) + first.dot(first) / 2
    V = m.g * (bent + drawn)[1]
    dT = sp.Matrix([T]).jacobian(v)
    h = dT.jacobian(q) * sp.Matrix(v) - sp.Matrix([T - V]).jacobian(q).T
    return sp.lambdify((q, v, particle), (dT.jacobian(v), h), modules="numpy", cse=True)


@pytest.mark.exhaustive
def test_mass_matrix_and_velocity_terms_are_lagranges() -> None:
    tube_, added = tube_of_particles(), lagrange()
    for q, qd in zip(*random_states(20, 2), strict=True):
        M, h = np.zeros((7, 7)), np.zeros(7)
        for (mass, place), shape, g in zip(PARTICLES, SHAPES, SHORTENING, strict=True):
            of_one = added(q, qd, (place, *shape, g[0, 0], g[0, 1], g[1, 1]))
            M += mass * np.array(of_one[0], dtype=float)
            h += mass * np.array(of_one[1], dtype=float)[:, 0]
        M[:5, :5] += rigid.mass_matrix(MECHANISM, q[:5])
        h[:5] += rigid.velocity_terms(MECHANISM, q[:5], qd[:5])
        h[5:] += tube_.stiffness_n_m * q[5:] + tube_.damping_n_s_m * qd[5:]
        np.testing.assert_allclose(flexible.mass_matrix(MECHANISM, tube_, q), M, rtol=1e-11, atol=1e-9)
        np.testing.assert_allclose(flexible.velocity_terms(MECHANISM, tube_, q, qd), h, rtol=1e-10, atol=1e-8)


def test_without_modes_it_is_the_rigid_model_and_a_very_stiff_tube_moves_with_it() -> None:
    q, qd = random_states(30, 0)
    none, Q = tube(0), np.random.default_rng(2).normal(0, 1e5, (30, 5))
    np.testing.assert_array_equal(flexible.mass_matrix(MECHANISM, none, q), rigid.mass_matrix(MECHANISM, q))
    np.testing.assert_array_equal(
        flexible.velocity_terms(MECHANISM, none, q, qd), rigid.velocity_terms(MECHANISM, q, qd)
    )
    np.testing.assert_allclose(
        flexible.accelerations(MECHANISM, none, q, qd, Q), rigid.accelerations(MECHANISM, q, qd, Q), rtol=1e-12
    )
    errors = []
    for stiffness in (1e8, 1e10, 1e12):
        stiff = tube(2, stiffness=stiffness)
        # bent by as much as the motion then demands: in equilibrium with its inertia
        place, rate = np.pad(q, ((0, 0), (0, 2))), np.pad(qd, ((0, 0), (0, 2)))
        expected = rigid.accelerations(MECHANISM, q, qd, Q)
        still = np.concatenate([expected, np.zeros((30, 2))], axis=1)
        for _ in range(3):
            demanded = flexible.mass_matrix(MECHANISM, stiff, place) @ still[..., None]
            rest = demanded[..., 0] + flexible.velocity_terms(MECHANISM, stiff, place, rate)
            place[:, 5:] -= rest[:, 5:] / stiff.stiffness_n_m
        found = flexible.accelerations(MECHANISM, stiff, place, rate, Q)[:, :5]
        errors.append(np.abs(found - expected).max() / np.abs(expected).max())
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-5


def free_motion(tube_: FlexibleTube, end_s: float) -> tuple[np.ndarray, np.ndarray]:
    n = 5 + tube_.modes

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[n:], flexible.accelerations(MECHANISM, tube_, y[:n], y[n:], np.zeros(5))])

    start = np.zeros(2 * n)
    start[:6] = [0.0, 0.0, 0.1, -0.2, 0.1, 0.02]
    start[n : n + 6] = [0.3, -0.2, 0.8, -1.5, 3.0, 0.4]
    run = solve_ivp(rates, (0, end_s), start, method="DOP853", rtol=1e-10, atol=1e-11, t_eval=np.linspace(0, end_s, 11))
    return run.y[:n].T, run.y[n:].T


@pytest.mark.exhaustive
def test_energy_is_conserved_without_loads_and_damping_takes_it_away() -> None:
    q, qd = free_motion(tube(), 0.08)
    energy = flexible.kinetic_energy(MECHANISM, tube(), q, qd) + flexible.potential_energy(MECHANISM, tube(), q)
    assert np.ptp(q[:, 5]) > 0.02
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    damped = tube(damping=0.02)
    q, qd = free_motion(damped, 0.04)
    energy = flexible.kinetic_energy(MECHANISM, damped, q, qd) + flexible.potential_energy(MECHANISM, damped, q)
    assert (np.diff(energy) < 0).all()


def test_the_mass_matrix_is_symmetric_and_positive_definite() -> None:
    q, _ = random_states(100, 2, seed=5)
    M = flexible.mass_matrix(MECHANISM, tube(), q)
    np.testing.assert_array_equal(M, np.swapaxes(M, -1, -2))
    assert np.linalg.eigvalsh(M).min() > 0


def test_the_identification_equation_holds_with_its_correction_and_not_without() -> None:
    q, qd = random_states(50, 2, seed=7)
    P, R = 9e5, 4e4
    Q = rigid.generalized_forces(MECHANISM, q[:, :5], P, R, 1e3, -5e3, -2e4, -1e4)
    qdd = flexible.accelerations(MECHANISM, tube(damping=0.01), q, qd, Q)
    felt = MECHANISM.m3 * rigid.specific_acceleration(MECHANISM, q[:, :5], qd[:, :5], qdd[:, :5])
    correction = bore_correction(tube(), q, qd, qdd)
    np.testing.assert_allclose(felt, P - R + correction, rtol=1e-9)
    assert np.abs(correction).max() > 100.0


def test_it_hangs_at_rest_as_its_weight_bends_it() -> None:
    stiff = tube(2, stiffness=STIFFNESS)
    hangs, moment = flexible.sag(MECHANISM, stiff)
    q, rest = np.concatenate([np.zeros(5), hangs]), np.zeros(7)
    h = flexible.velocity_terms(MECHANISM, stiff, q, rest)
    np.testing.assert_allclose(h[5:], 0.0, atol=1e-8)
    unbent = rigid.velocity_terms(MECHANISM, q[:5], rest[:5])
    np.testing.assert_allclose(h[:5] - unbent, [0, 0, moment, moment, 0], atol=1e-8)
    # the deflection of a uniform cantilever's end under its weight is  mu g L^4 / (8 EI)
    end = shapes(LENGTH, 2, [LENGTH])[0][:, 0] @ hangs
    expected = -MASS * MECHANISM.g * math.cos(MECHANISM.phi20) * LENGTH**3 / (8 * STIFFNESS)
    assert end == pytest.approx(expected, rel=0.01)


def chain(links: int, pull: float) -> np.ndarray:
    """Lowest angular frequencies of a chain of rigid links with springs between them, clamped to an accelerated base.

    Its weight is a constant pull along the chain: what a base that accelerates to the rear does to its tube.
    """
    h, mu = LENGTH / links, MASS / LENGTH
    spring, own = STIFFNESS / h, mu * h**3 / 12
    bodies, closing = "", ""
    for i in range(links):
        # a hinge stands for the bending of half a link on either side; at the clamp there is one side only
        bodies += f"""<body pos="{0.0 if i == 0 else h} 0 0">
          <joint type="hinge" axis="0 -1 0" stiffness="{2 * spring if i == 0 else spring}"/>
          <inertial mass="{mu * h}" pos="{h / 2} 0 0" diaginertia="{own} {own} {own}"/>"""
        closing += "</body>"
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option gravity="{pull} 0 0"/>
      <compiler autolimits="true"/><worldbody>{bodies}{closing}</worldbody></mujoco>""")
    data = mujoco.MjData(model)

    def bias(q: np.ndarray) -> np.ndarray:
        data.qpos[:], data.qvel[:] = q, 0.0
        mujoco.mj_forward(model, data)
        return data.qfrc_bias - data.qfrc_passive

    step = 1e-6
    K = np.array([(bias(step * e) - bias(-step * e)) / (2 * step) for e in np.eye(links)]).T
    data.qpos[:] = 0.0
    mujoco.mj_forward(model, data)
    M = np.zeros((links, links))
    mujoco.mj_fullM(model, data, M)
    return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)[:2])


@pytest.mark.parametrize("pull", [0.0, 1300.0])
def test_a_chain_of_rigid_links_swings_as_fast_also_where_the_recoil_drags_it(pull: float) -> None:
    tube_ = tube(4)
    # fq with a5 = -pull: the recoil's acceleration stretches the tube
    stiffness = np.diag(tube_.stiffness_n_m) + pull * tube_.shortening
    found = np.sqrt(np.linalg.eigvalsh(stiffness / tube_.mass_kg))[:2]
    np.testing.assert_allclose(found, chain(40, pull), rtol=2e-3)
    if pull:
        free = natural_frequencies(LENGTH, MASS, STIFFNESS, 1)[0]
        assert found[0] > 1.03 * free


def test_senseless_tubes_are_refused() -> None:
    for wrong in ({"length_m": 0.0}, {"mass_kg": -1.0}, {"bending_stiffness_n_m2": 0.0}, {"damping": -0.1}):
        settings = {"length_m": 2.0, "mass_kg": 100.0, "bending_stiffness_n_m2": 1e6, "modes": 1} | wrong
        with pytest.raises(ValueError, match="must be positive"):
            uniform_tube(**settings)


def test_a_mechanism_without_gravity_keeps_its_momentum_although_the_tube_swings() -> None:
    weightless, tube_ = dataclasses.replace(MECHANISM, g=0.0), tube()
    q, qd = random_states(40, 2, seed=9)
    qdd = flexible.accelerations(weightless, tube_, q, qd, np.zeros(5))
    step = 1e-6

    def momentum(sign: float) -> np.ndarray:
        place, rate = q + sign * step * qd + 0.5 * step**2 * qdd, qd + sign * step * qdd
        return np.einsum("...ij,...j->...i", flexible.mass_matrix(weightless, tube_, place)[:, :2], rate)

    change = (momentum(1) - momentum(-1)) / (2 * step)
    np.testing.assert_allclose(change, 0.0, atol=1e-3 * MECHANISM.m3)
