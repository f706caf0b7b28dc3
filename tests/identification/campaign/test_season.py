"""The masses of a season's campaigns against one another: by what they share, as generalised least squares has it."""

from __future__ import annotations

import numpy as np
import pytest
import statsmodels.api as sm
from numpy.typing import NDArray
from scipy.stats import kstest

from recoil_identification.campaign.season import season


def covariance(own_kg: NDArray[np.float64], shared_kg: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.diag(own_kg**2) + np.outer(shared_kg, shared_kg)


def test_mean_and_distance_are_those_of_generalised_least_squares() -> None:
    masses = np.array([780.0, 784.0, 779.0, 783.0])
    matrix = covariance(np.array([1.0, 2.0, 1.5, 0.7]), np.array([3.0, 3.2, 2.0, 2.5]))
    found = season(masses, matrix)
    fit = sm.GLS(masses, np.ones((4, 1)), sigma=matrix).fit()
    assert found.mean_kg == pytest.approx(fit.params[0], rel=1e-12)
    assert found.u_kg == pytest.approx(np.sqrt(fit.normalized_cov_params[0, 0]), rel=1e-9)
    residuals = masses - fit.params[0]
    assert found.chi_square == pytest.approx(residuals @ np.linalg.solve(matrix, residuals), rel=1e-9)
    assert found.degrees_of_freedom == 3


def test_p_is_uniform_where_the_masses_are_one_and_share_an_error() -> None:
    rng = np.random.default_rng(5)
    own, shared = np.array([1.0, 2.0, 1.5]), np.array([4.0, 4.5, -3.0])
    matrix = covariance(own, shared)
    draws = 780.0 + own * rng.standard_normal((2000, 3)) + shared * rng.standard_normal((2000, 1))
    found = [season(one, matrix) for one in draws]
    assert kstest([one.p for one in found], "uniform").pvalue > 0.01
    z = np.array([one.differences_kg[0] / one.u_differences_kg[0] for one in found])
    assert np.std(z) == pytest.approx(1.0, abs=0.05)


def test_what_is_shared_lets_a_smaller_difference_be_seen() -> None:
    rng = np.random.default_rng(6)
    own, shared = np.array([1.0, 1.5]), np.array([4.0, 4.2])
    matrix = covariance(own, shared)
    draws = np.array([780.0, 786.0]) + own * rng.standard_normal((500, 2)) + shared * rng.standard_normal((500, 1))
    assert sum(not season(one, matrix).agrees for one in draws) > 400
    assert sum(not season(one, np.diag(np.diag(matrix))).agrees for one in draws) < 100


def test_masses_without_anything_in_common_have_the_plain_difference() -> None:
    found = season(np.array([780.0, 786.0]), np.diag([9.0, 16.0]))
    assert found.differences_kg.tolist() == [-6.0, 0.0]
    assert found.u_differences_kg.tolist() == [5.0, 0.0]
    assert found.chi_square == pytest.approx(36.0 / 25.0)


def test_what_is_no_season_is_refused() -> None:
    with pytest.raises(ValueError, match="two campaigns"):
        season(np.array([1.0]), np.eye(1))
    with pytest.raises(ValueError, match="positive definite"):
        season(np.array([1.0, 2.0]), np.ones((2, 2)))
