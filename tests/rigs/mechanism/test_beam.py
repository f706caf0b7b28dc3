"""The clamped-free beam against the textbook, its differential equation, quadrature and finite elements."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import eigh

from recoil_rigs.mechanism.beam import eigenvalues, integrals, natural_frequencies, shapes

LENGTH, MASS, STIFFNESS = 2.5, 160.0, 2e6


def test_eigenvalues_are_the_textbooks() -> None:
    # roots of cos z cosh z = -1 as tables of beams print them
    expected = [1.875104068711961, 4.694091132974175, 7.854757438237613, 10.99554073487547]
    np.testing.assert_allclose(eigenvalues(4), expected, rtol=1e-13)
    assert eigenvalues(0).size == 0
    lowest = natural_frequencies(LENGTH, MASS, STIFFNESS, 1)[0]
    assert lowest == pytest.approx(1.875104068711961**2 * np.sqrt(STIFFNESS / (MASS / LENGTH * LENGTH**4)), rel=1e-9)
    for count in (-1, 5):
        with pytest.raises(ValueError, match="from 0 to 4 modes"):
            eigenvalues(count)


def finite_elements(count: int, modes: int) -> np.ndarray:
    """Angular frequencies of a beam of cubic elements with consistent masses, clamped at its first node."""
    h, mu = LENGTH / count, MASS / LENGTH
    stiff = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h], [-12, -6 * h, 12, -6 * h],
                      [6 * h, 2 * h * h, -6 * h, 4 * h * h]]) * STIFFNESS / h**3  # fmt: skip
    heavy = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h], [54, 13 * h, 156, -22 * h],
                      [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]) * mu * h / 420  # fmt: skip
    K, M = np.zeros((2, 2 * count + 2, 2 * count + 2))
    for e in range(count):
        at = slice(2 * e, 2 * e + 4)
        K[at, at] += stiff
        M[at, at] += heavy
    return np.sqrt(eigh(K[2:, 2:], M[2:, 2:], eigvals_only=True)[:modes])


def test_frequencies_are_those_of_finite_elements() -> None:
    np.testing.assert_allclose(natural_frequencies(LENGTH, MASS, STIFFNESS, 4), finite_elements(24, 4), rtol=1e-4)


def test_shapes_are_clamped_free_normalised_and_orthogonal() -> None:
    values, slopes = shapes(LENGTH, 3, [0.0, LENGTH])
    np.testing.assert_allclose(values[:, 0], 0.0, atol=1e-14)
    np.testing.assert_allclose(slopes[:, 0], 0.0, atol=1e-14)
    np.testing.assert_allclose(np.abs(values[:, 1]), 2.0, rtol=1e-9)
    for i in range(3):
        for j in range(3):
            mean = quad(lambda s, i=i, j=j: np.prod(shapes(LENGTH, 3, [s])[0][[i, j], 0]), 0, LENGTH)[0] / LENGTH
            assert mean == pytest.approx(float(i == j), abs=1e-10)


def test_shapes_solve_the_differential_equation_and_end_without_moment_and_force() -> None:
    z = eigenvalues(3)
    step = 0.02

    def values(s: float) -> np.ndarray:
        return shapes(LENGTH, 3, [s])[0][:, 0]

    for s in (0.6, 1.3, 2.1):
        five = [values(s + k * step) for k in (-3, -2, -1, 0, 1, 2, 3)]
        fourth = np.tensordot([-1 / 6, 2, -13 / 2, 28 / 3, -13 / 2, 2, -1 / 6], five, axes=1) / step**4
        np.testing.assert_allclose(fourth, (z / LENGTH) ** 4 * values(s), rtol=2e-4, atol=2e-3 * (z[-1] / LENGTH) ** 4)
    end = [shapes(LENGTH, 3, [LENGTH - k * 1e-3])[1][:, 0] for k in range(3)]
    curvature = (end[0] - end[1]) / 1e-3
    assert np.all(np.abs(curvature) < 1e-2 * (z / LENGTH) ** 2)


@pytest.mark.parametrize("root", [0.0, 0.4])
def test_integrals_are_those_of_adaptive_quadrature(root: float) -> None:
    found = integrals(LENGTH, MASS, root, 2)
    mu = MASS / LENGTH

    def g(i: int, j: int, s: float) -> float:
        return quad(lambda r: np.prod(shapes(LENGTH, 2, [r])[1][[i, j], 0]), 0, s)[0]

    for i in range(2):
        one = quad(lambda s, i=i: mu * shapes(LENGTH, 2, [s])[0][i, 0], 0, LENGTH)[0]
        arm = quad(lambda s, i=i: mu * (root + s) * shapes(LENGTH, 2, [s])[0][i, 0], 0, LENGTH)[0]
        assert found.first[i] == pytest.approx(one, rel=1e-10)
        assert found.moment[i] == pytest.approx(arm, rel=1e-10)
        for j in range(2):
            short = quad(lambda s, i=i, j=j: mu * g(i, j, s), 0, LENGTH)[0]
            arm = quad(lambda s, i=i, j=j: mu * (root + s) * g(i, j, s), 0, LENGTH)[0]
            assert found.shortening[i, j] == pytest.approx(short, rel=1e-8, abs=1e-8)
            assert found.shortening_moment[i, j] == pytest.approx(arm, rel=1e-8, abs=1e-8)
    # a clamped-free beam's first integrals in closed form, 2 share / z and 2 / z^2 of the tables
    z = eigenvalues(2)
    if root == 0.0:
        np.testing.assert_allclose(np.abs(found.moment), MASS * LENGTH * 2 / z**2, rtol=1e-12)
