"""Inertia forces are minus mass times acceleration of every body, and their moments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recoil_identification.targets.parameters.inertia_forces import FORCES, inertia_forces, mass_alone, peak, with_mass
from recoil_rigs.mechanism.mechanism_regressor import Geometry, standard_parameters
from recoil_rigs.mechanism.model import specific_acceleration
from recoil_rigs.rig import load_rig

MECHANISM = load_rig("field-2013").mechanism


def centres(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of A, of the tipping and of the recoiling part's centre of mass on the ground, shape (n, 2) each."""
    m = MECHANISM
    phi1, phi2 = m.phi10 + q[:, 2], m.phi20 + q[:, 2] + q[:, 3]

    def turned(angle, along, across):
        return np.column_stack(
            [np.cos(angle) * along - np.sin(angle) * across, np.sin(angle) * along + np.cos(angle) * across]
        )

    A = q[:, :2] + turned(phi1, m.XA, m.YA)
    return A, A + turned(phi2, m.s2, m.d2), A + turned(phi2, m.b - q[:, 4], m.d)


def test_forces_and_moments_are_those_of_differentiated_places():
    m, step = MECHANISM, 1e-4
    t = np.arange(0.0, 0.02, step)
    waves = [(0.02, 70.0), (0.01, 90.0), (0.05, 40.0), (0.08, 50.0), (0.4, 60.0)]
    q = np.column_stack([a * np.sin(w * t) for a, w in waves])
    qd = np.column_stack([a * w * np.cos(w * t) for a, w in waves])
    qdd = np.column_stack([-a * w * w * np.sin(w * t) for a, w in waves])
    found = inertia_forces(Geometry.of(m), standard_parameters(m), q, qd, qdd)
    A, tipping, recoiling = centres(q)
    a2, a3 = (np.gradient(np.gradient(c, step, axis=0), step, axis=0) for c in (tipping, recoiling))
    dw2 = qdd[:, 2] + qdd[:, 3]
    phi2 = m.phi20 + q[:, 2] + q[:, 3]
    force3 = -m.m3 * a3

    def cross(lever, force):
        return lever[:, 0] * force[:, 1] - lever[:, 1] * force[:, 0]

    moment3 = cross(recoiling - A, force3) - m.J3c * dw2
    own2 = m.J2 - m.m2 * (m.s2**2 + m.d2**2)
    moment2 = cross(tipping - A, -m.m2 * a2) - own2 * dw2
    expected = np.column_stack(
        [
            -m.m3 * specific_acceleration(m, q, qd, qdd),
            -force3[:, 0] * np.cos(phi2) - force3[:, 1] * np.sin(phi2),
            force3[:, 1] * np.cos(phi2) - force3[:, 0] * np.sin(phi2),
            *force3.T,
            moment3,
            *(force3 - m.m2 * a2).T,
            moment3 + moment2,
        ]
    )
    inner = slice(3, -3)
    for k, name in enumerate(FORCES):
        scale = np.abs(expected[inner, k]).max()
        np.testing.assert_allclose(found[inner, k], expected[inner, k], atol=2e-4 * scale, err_msg=name)


def test_without_gravity_the_two_forces_along_the_bore_are_one():
    q, qd, qdd = np.random.default_rng(4).normal(0.0, 0.3, (3, 20, 5))
    weightless = replace(Geometry.of(MECHANISM), g=0.0)
    found = inertia_forces(weightless, standard_parameters(MECHANISM), q, qd, qdd)
    np.testing.assert_allclose(found[:, 0], found[:, 1])


def test_an_undeclared_tipping_part_leaves_the_recoiling_parts_forces():
    theta = standard_parameters(replace(MECHANISM, m2=float("nan")))
    q, qd, qdd = np.random.default_rng(4).normal(0.0, 0.3, (3, 20, 5))
    found = inertia_forces(Geometry.of(MECHANISM), theta, q, qd, qdd)
    assert np.isfinite(found[:, :6]).all()
    assert np.isnan(found[:, 6:]).all()


def test_a_mass_alone_takes_its_moments_with_it():
    (leading,), shares = mass_alone(MECHANISM)
    lighter, heavier = with_mass(MECHANISM, 700.0), with_mass(MECHANISM, 701.0)
    assert leading == 8
    np.testing.assert_allclose((heavier - lighter)[8:11], shares[0, 8:11])


def test_a_peak_is_read_between_samples():
    t = np.arange(0.0, 0.1, 1e-3)
    true = -5.0 * np.exp(-(((t - 0.0504) / 0.01) ** 2))
    found = peak(t, true, np.full(t.shape, 0.1))
    assert found is not None
    assert abs(found.value + 5.0) < 1e-2
    assert abs(found.time_s - 0.0504) < 1e-3
    assert found.u == 0.1
    assert peak(t, np.full(t.shape, np.nan), t) is None
