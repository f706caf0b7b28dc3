"""Natural frequencies and damping ratios on the supports."""

from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_identification.targets.stiffness.support_modes import (
    DERIVED,
    derived_values,
    derived_with_u,
    ground_modes,
    tipping_mode,
)
from recoil_rigs.mechanism.model import mass_matrix
from recoil_rigs.rig import load_rig

MECHANISM = load_rig("field-2013").mechanism
VALUES = np.array([2e6, 2.5e4, 3e7, 2e5, 0.25, 3e7, 2e5, 2e7, 2e5])


def test_the_tipping_part_swings_as_a_pendulum_on_its_spring():
    m = MECHANISM
    inertia = m.J2 + m.J3c + m.m3 * (m.b**2 + m.d**2)

    frequency, ratio = tipping_mode(m, 2e6, 2.5e4)

    assert frequency == pytest.approx(math.sqrt(2e6 / inertia) / (2 * math.pi))
    assert ratio == pytest.approx(2.5e4 / (2 * math.sqrt(2e6 * inertia)))
    assert all(math.isnan(value) for value in tipping_mode(m, -1.0, 1.0))


def test_without_damping_the_modes_are_those_of_mass_and_stiffness():
    from scipy.linalg import eigh

    m, k = MECHANISM, np.array([3e7, 2e7, 1e7])
    arm = m.L * math.cos(m.phi10)
    K = np.array([[k[0], 0, 0], [0, k[1] + k[2], k[2] * arm], [0, k[2] * arm, k[2] * arm**2]])

    modes = ground_modes(m, k, np.zeros(3))

    squares = eigh(K, mass_matrix(m, np.zeros(5))[:3, :3], eigvals_only=True)
    assert modes[:, 0] == pytest.approx(np.sqrt(squares) / (2 * math.pi))
    assert modes[:, 1] == pytest.approx(0.0, abs=1e-9)


def test_a_mode_that_does_not_swing_has_no_frequency():
    modes = ground_modes(MECHANISM, np.full(3, 3e7), np.full(3, 1e8))

    assert np.isnan(modes).all()


def test_the_uncertainty_of_a_sum_knows_that_errors_are_opposed():
    covariance = np.zeros((9, 9))
    covariance[5, 5] = covariance[7, 7] = 1e12
    covariance[5, 7] = covariance[7, 5] = -1e12
    at = [symbol for symbol, _, _ in DERIVED].index("k_ground_vertical")

    values, u = derived_with_u(MECHANISM, VALUES, covariance)

    assert values[at] == pytest.approx(5e7)
    assert u[at] == pytest.approx(0.0, abs=1e-3)


def test_half_a_per_cent_of_frequency_is_one_per_cent_of_stiffness():
    covariance = np.zeros((9, 9))
    covariance[0, 0] = (0.01 * VALUES[0]) ** 2

    values, u = derived_with_u(MECHANISM, VALUES, covariance)

    assert u[0] / values[0] == pytest.approx(0.005, rel=1e-3)
    assert u[2:] == pytest.approx(0.0)


def test_what_hangs_on_an_unknown_parameter_is_unknown():
    unknown = VALUES.copy()
    unknown[7] = np.nan
    covariance = np.diag((0.01 * VALUES) ** 2)
    covariance[7, :] = covariance[:, 7] = np.nan

    values, u = derived_with_u(MECHANISM, unknown, covariance)

    assert np.isfinite(values[:2]).all()
    assert np.isfinite(u[:2]).all()
    assert np.isnan(values[2:9]).all()
    assert np.isnan(u[2:9]).all()
    assert values.shape == derived_values(MECHANISM, VALUES).shape == (len(DERIVED),)
