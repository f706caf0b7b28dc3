"""Recursive residuals and their cumulative sums against an independent program, definitions and chance."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_identification.constancy.recursive_residuals import (
    cusum,
    cusum_of_squares,
    long_run_factor,
    recursive_residuals,
)

ROWS = 90


def regression(seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    X = np.column_stack([np.ones(ROWS), rng.normal(size=(ROWS, 2))])
    return X, X @ [1.0, -2.0, 0.5] + rng.normal(0.0, 0.3, ROWS)


def test_without_priors_the_residuals_sums_and_bounds_are_those_of_statsmodels() -> None:
    statsmodels = pytest.importorskip("statsmodels.api", reason="the independent program is not installed")
    X, y = regression()
    other = statsmodels.RecursiveLS(y, X).fit()
    w = recursive_residuals(y, X, np.full(3, np.inf), np.ones(ROWS))
    assert np.isnan(w[:3]).all()
    np.testing.assert_allclose(w[3:], other.resid_recursive[3:], rtol=1e-8, atol=1e-10)
    sums, squares = cusum(w, factor=1.0), cusum_of_squares(w, factor=1.0)
    np.testing.assert_allclose(sums.values, other.cusum, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(squares.values, other.cusum_squares, rtol=1e-8)
    for alpha, of_sums, of_squares in (
        (0.05, sums.bounds_5, squares.bounds_5),
        (0.01, sums.bounds_1, squares.bounds_1),
    ):
        low, high = other._cusum_squares_significance_bounds(alpha)
        # its bounds are a straight line between both ends of the sum
        np.testing.assert_allclose(of_squares[[0, -1]].T, [low, high], atol=1.2 / ROWS)
        low, high = other._cusum_significance_bounds(alpha)
        np.testing.assert_allclose(of_sums[-1], [low[1], high[1]], rtol=1e-9)


def test_they_are_the_prediction_errors_of_the_rows_before() -> None:
    X, y = regression(2)
    prior, sigma = np.array([np.inf, 0.7, np.inf]), np.linspace(0.2, 0.6, ROWS)
    w = recursive_residuals(y, X, prior, sigma)
    for i in (2, 5, 40, 89):
        rows = np.vstack([X[:i] / sigma[:i, None], [[0.0, 1 / 0.7, 0.0]]])
        target = np.append(y[:i] / sigma[:i], 0.0)
        found = np.linalg.lstsq(rows, target, rcond=None)[0]
        variance = sigma[i] ** 2 + X[i] @ np.linalg.inv(rows.T @ rows) @ X[i]
        assert w[i] == pytest.approx((y[i] - X[i] @ found) / np.sqrt(variance), rel=1e-8)


def test_what_a_calibrated_error_explains_is_no_residual() -> None:
    rng = np.random.default_rng(4)
    X, known = np.ones((120, 1)), np.linspace(0.0, 1.0, 120) > 0.5
    both = np.column_stack([X, known])
    energies, tight = [], []
    for _ in range(150):
        y = 3.0 + 2.0 * rng.standard_normal() * known + rng.standard_normal(120)
        w = recursive_residuals(y, both, np.array([np.inf, 2.0]), np.ones(120))
        energies.append(np.nanmean(w**2))
        tight.append(np.nanmax(np.abs(np.cumsum(w[1:]))))
    assert np.mean(energies) == pytest.approx(1.0, abs=0.04)
    alone = recursive_residuals(3.0 + 2.0 * known, X, np.array([np.inf]), np.ones(120))
    assert np.nansum(alone) > 3 * np.median(tight)


def test_the_p_values_are_the_levels_of_the_bounds() -> None:
    w = np.random.default_rng(5).standard_normal(2000)
    plain = cusum(w, factor=1.0)
    for a, level in ((0.948, 0.05), (1.143, 0.01), (0.850, 0.10)):
        touched = np.max(np.abs(plain.values) / (np.sqrt(2000) * (1 + 2 * np.arange(1, 2001) / 2000)))
        assert cusum(w, factor=touched / a).p_value == pytest.approx(level, rel=0.02)
    assert not plain.crosses_5
    assert cusum(w, factor=touched / 1.2).crosses_1


@pytest.mark.parametrize("test", [cusum, cusum_of_squares])
def test_independent_errors_cross_the_bounds_as_often_as_they_say_or_less(test) -> None:
    rng = np.random.default_rng(6)
    found = [test(rng.standard_normal(150)) for _ in range(1500)]
    rate = np.mean([f.crosses_5 for f in found])
    assert 0.015 < rate < 0.065
    assert np.mean([f.crosses_1 for f in found]) < 0.02
    assert np.mean([f.p_value < 0.05 for f in found]) == pytest.approx(rate, abs=0.02)


def test_correlated_errors_widen_the_bounds_and_cross_no_more_often() -> None:
    rng = np.random.default_rng(7)

    def drawn() -> np.ndarray:
        e = rng.standard_normal(300)
        for i in range(1, 300):
            e[i] += 0.5 * e[i - 1]
        return e

    found = [drawn() for _ in range(400)]
    assert np.mean([cusum(w, factor=1.0).crosses_5 for w in found]) > 0.2
    assert np.mean([cusum(w).crosses_5 for w in found]) < 0.08
    # the long-run standard deviation of a first-order autoregression is sqrt((1 + r) / (1 - r)) times its own
    assert np.median([long_run_factor(w) for w in found]) == pytest.approx(np.sqrt(3), rel=0.1)


def test_a_slope_that_changes_crosses_the_sum_and_a_scatter_that_changes_the_sum_of_squares() -> None:
    rng = np.random.default_rng(8)
    x = rng.normal(2.0, 0.3, 300)
    later = np.arange(300) > 150
    y = x * np.where(later, 1.3, 1.0) + rng.normal(0.0, 0.2, 300)
    changed = recursive_residuals(y, x[:, None], np.array([np.inf]), np.full(300, 0.2))
    assert cusum(changed, factor=1.0).crosses_1
    scattered = recursive_residuals(
        x + rng.normal(0.0, np.where(later, 0.6, 0.2)), x[:, None], np.array([np.inf]), np.full(300, 0.2)
    )
    assert cusum_of_squares(scattered).crosses_1
    assert not cusum(scattered, factor=1.0).crosses_1
    assert cusum_of_squares(scattered).p_value < 1e-3


def test_what_is_independent_or_short_has_no_long_run_of_its_own() -> None:
    assert long_run_factor(np.zeros(50)) == 1.0
    assert long_run_factor(np.arange(5.0)) == 1.0
    assert long_run_factor(np.cumsum(np.ones(500))) <= 6.0
    alternating = np.random.default_rng(1).normal(size=500) + 3 * np.cos(np.pi * np.arange(500))
    assert long_run_factor(alternating) == 1.0


@pytest.mark.parametrize(
    ("call", "problem"),
    [
        (lambda: recursive_residuals(np.ones(5), np.ones((4, 1)), np.ones(1), np.ones(5)), "shapes do not fit"),
        (lambda: recursive_residuals(np.ones(5), np.ones((5, 1)), np.ones(1), np.zeros(5)), "positive standard"),
        (lambda: recursive_residuals(np.ones(2), np.ones((2, 2)), np.full(2, np.inf), np.ones(2)), "leave no residual"),
        (lambda: cusum(np.array([1.0, np.nan])), "too few"),
        (lambda: cusum_of_squares(np.ones(5)), "at least 6"),
    ],
)
def test_the_callers_mistakes_are_named(call, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        call()
