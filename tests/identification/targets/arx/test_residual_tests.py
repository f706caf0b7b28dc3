from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.targets.arx.model import ArxOrders, arx_regressors, estimate_arx, residuals
from recoil_identification.targets.arx.residual_tests import independence, whiteness
from tests.builders.arx_systems import arx_record


def coloured(n_samples: int, seed: int) -> np.ndarray:
    e = np.random.default_rng(seed).standard_normal(n_samples + 1)
    return e[1:] + 0.5 * e[:-1]


@pytest.mark.parametrize("n_dynamic", [0, 2])
def test_the_statistic_is_that_of_statsmodels(n_dynamic):
    from statsmodels.stats.diagnostic import acorr_ljungbox
    from statsmodels.tsa.stattools import acf

    residual = coloured(300, 1)
    residual -= residual.mean()
    theirs = acorr_ljungbox(residual, lags=[15], model_df=n_dynamic)
    ours = whiteness(residual, 15, n_dynamic=n_dynamic)
    assert ours.statistic == pytest.approx(theirs["lb_stat"].iloc[0], rel=1e-12)
    assert ours.p_value == pytest.approx(theirs["lb_pvalue"].iloc[0], rel=1e-9)
    assert ours.degrees_of_freedom == 15 - n_dynamic
    np.testing.assert_allclose(ours.correlation, acf(residual, nlags=15, fft=False), atol=1e-13)


def test_white_residuals_pass_and_lie_within_their_bands_as_often_as_stated():
    passed, outside = 0, 0
    for seed in range(400):
        found = whiteness(np.random.default_rng(seed).standard_normal(250), 20)
        passed += found.passed
        outside += found.outside.size
    assert abs(passed / 400 - 0.99) < 0.02
    assert 0.004 < outside / (400 * 20) < 0.015


def test_residuals_with_gaps_are_tested_at_their_true_lags_as_strictly():
    passed = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        residual = rng.standard_normal(300)
        residual[rng.random(300) < 0.2] = np.nan
        passed += whiteness(residual, 20).passed
    assert abs(passed / 300 - 0.99) < 0.025
    holes = coloured(600, 2)
    holes[200:260] = np.nan
    found = whiteness(holes, 10)
    assert not found.passed
    assert found.count == 540
    # by the sums of an MA(1): 0.5 / 1.25
    assert found.correlation[1] == pytest.approx(0.4, abs=0.1)
    assert 1 in found.outside
    assert 0 not in found.outside


def test_the_bands_are_those_of_the_normal_distribution():
    found = whiteness(coloured(400, 3), 5)
    np.testing.assert_allclose(found.band, 2.5758293 / 20.0, rtol=1e-7)


@pytest.mark.whole_way
def test_residuals_of_the_right_model_pass_both_tests_as_often_as_stated():
    orders = ArxOrders(2, 1, 1)
    white = independent = 0
    for seed in range(300):
        u, y = arx_record(300, seed, noise=0.3)
        model = estimate_arx(u, y, orders)
        e = residuals(model, u, y)
        white += whiteness(e, 20, n_dynamic=2).passed
        independent += independence(e, u, 20, arx_regressors(u, y, orders)).passed
    assert white >= 288
    assert independent >= 288


def test_a_delay_that_was_missed_shows_at_its_lag():
    u, y = arx_record(400, 4, system=((), (1.0, 0.0, 0.0, 0.4), 0))
    orders = ArxOrders()
    model = estimate_arx(u, y, orders)
    found = independence(residuals(model, u, y), u, 10, arx_regressors(u, y, orders))
    assert not found.passed
    assert list(found.outside) == [3]


def test_feedback_shows_at_a_negative_lag_and_is_no_part_of_the_statistic():
    rng = np.random.default_rng(6)
    e = rng.standard_normal(500)
    u = rng.standard_normal(500)
    u[2:] += 0.5 * e[:-2]
    found = independence(e, u, 8, np.zeros((500, 0)))
    assert list(found.outside) == [-2]
    assert found.passed


def test_a_fitted_lag_has_no_correlation_left_and_no_band():
    u, y = arx_record(300, 6)
    orders = ArxOrders(0, 1, 1)
    e = residuals(estimate_arx(u, y, orders), u, y)
    found = independence(e, u, 5, arx_regressors(u, y, orders))
    fitted = np.isin(found.lags, [1, 2])
    assert np.isinf(found.band[fitted]).all()
    np.testing.assert_array_equal(found.correlation[fitted], 0.0)
    assert np.isfinite(found.band[~fitted]).all()
    assert found.degrees_of_freedom == 4


def test_without_a_fit_the_correlation_is_the_plain_one():
    rng = np.random.default_rng(7)
    e, u = rng.standard_normal(200), rng.standard_normal(200)
    found = independence(e, u, 3, np.zeros((200, 0)))
    for lag in range(-3, 4):
        late = np.array([u[k - lag] if 0 <= k - lag < 200 else 0.0 for k in range(200)])
        expected = e @ late / np.sqrt((e @ e) * (late @ late))
        assert found.correlation[lag + 3] == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(found.band, 2.5758293 / np.sqrt(200), rtol=1e-7)


def test_the_score_test_is_that_of_an_auxiliary_regression():
    import statsmodels.api as sm

    u, y = arx_record(300, 8, system=((), (1.0, 0.1), 0))
    orders = ArxOrders()
    e = residuals(estimate_arx(u, y, orders), u, y)
    found = independence(e, u, 4, arx_regressors(u, y, orders))
    lagged = np.column_stack([np.concatenate([np.zeros(k), u[: 300 - k]]) for k in range(5)])
    auxiliary = sm.OLS(e, lagged).fit()
    explained = 1.0 - (auxiliary.resid @ auxiliary.resid) / (e @ e)
    assert found.statistic == pytest.approx(299 * explained, rel=1e-9)
    assert found.degrees_of_freedom == 4


@settings(max_examples=25)
@given(st.floats(-9, 9), st.floats(-9, 9), st.integers(0, 2**31))
def test_scales_and_signs_do_not_matter(log_e, log_u, seed):
    rng = np.random.default_rng(seed)
    e, u = rng.standard_normal(80), rng.standard_normal(80)
    none = np.zeros((80, 0))
    one, scaled = independence(e, u, 5, none), independence(-(10.0**log_e) * e, 10.0**log_u * u, 5, none)
    np.testing.assert_allclose(scaled.correlation, -one.correlation, rtol=1e-9, atol=1e-13)
    assert scaled.statistic == pytest.approx(one.statistic, rel=1e-8)
    assert whiteness(10.0**log_e * e, 5).statistic == pytest.approx(whiteness(e, 5).statistic, rel=1e-9)


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: whiteness(np.ones(6), 5), "too few"),
        (lambda: whiteness(np.zeros(30), 5), "zero throughout"),
        (lambda: independence(np.ones(30), np.zeros(30), 5, np.zeros((30, 0))), "zero throughout"),
    ],
)
def test_residuals_that_cannot_be_tested_are_refused(call, match):
    with pytest.raises(ValueError, match=match):
        call()
