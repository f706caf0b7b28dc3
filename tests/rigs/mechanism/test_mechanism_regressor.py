"""The regressor is the equations of motion, written by parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_rigs.mechanism.mechanism_regressor import (
    LOADS,
    PARAMETER_UNITS,
    PARAMETERS,
    Geometry,
    load_directions,
    regressor,
    standard_parameters,
)
from recoil_rigs.mechanism.model import Mechanism, generalized_forces, mass_matrix, velocity_terms
from recoil_rigs.rig import load_rig


def random_mechanism(rng: np.random.Generator) -> Mechanism:
    names = ("m1", "m2", "m3", "J1", "J2", "J3c", "X1", "Y1", "XA", "YA", "s2", "d2", "b", "d", "e", "L", "f")
    values = dict(zip(names, rng.uniform(0.1, 2.0, len(names)), strict=True))
    return replace(load_rig("field-2013").mechanism, **values, phi10=rng.uniform(-1, 1), phi20=rng.uniform(-1, 1))


@pytest.mark.parametrize("seed", range(5))
def test_the_regressor_times_the_parameters_is_mass_matrix_times_acceleration_and_velocity_terms(seed):
    rng = np.random.default_rng(seed)
    m = random_mechanism(rng)
    q, qd, qdd = rng.normal(0.0, 1.0, (3, 200, 5))
    expected = np.einsum("nij,nj->ni", mass_matrix(m, q), qdd) + velocity_terms(m, q, qd)
    found = regressor(Geometry.of(m), q, qd, qdd) @ standard_parameters(m)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_the_load_directions_give_the_generalized_forces():
    rng = np.random.default_rng(7)
    m = random_mechanism(rng)
    q, loads = rng.normal(0.0, 1.0, (50, 5)), rng.normal(0.0, 1.0, (50, len(LOADS)))
    expected = generalized_forces(m, q, *loads.T)
    found = np.einsum("nij,nj->ni", load_directions(Geometry.of(m), q[:, 2], q[:, 3]), loads)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_states_may_have_any_leading_shape():
    m = load_rig("field-2013").mechanism
    q, qd, qdd = np.random.default_rng(1).normal(0.0, 1.0, (3, 2, 3, 5))
    Y = regressor(Geometry.of(m), q, qd, qdd)
    assert Y.shape == (2, 3, 5, len(PARAMETERS)) == (2, 3, 5, len(PARAMETER_UNITS))
    np.testing.assert_array_equal(Y[1, 2], regressor(Geometry.of(m), q[1, 2], qd[1, 2], qdd[1, 2]))


def test_what_is_not_declared_is_not_a_number():
    m = replace(load_rig("field-2013").mechanism, m1=float("nan"))
    theta = standard_parameters(m)
    assert np.isnan(theta[:3]).all()
    assert np.isfinite(theta[3:]).all()
