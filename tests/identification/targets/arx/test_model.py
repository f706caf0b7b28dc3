from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import IdentificationError
from recoil_identification.targets.arx.model import (
    ArxModel,
    ArxOrders,
    arx_regressors,
    estimate_arx,
    fit_percent,
    residuals,
    robust_covariance,
    simulate,
)
from tests.builders.arx_systems import SECOND_ORDER, arx_output, arx_record

ORDERS = ArxOrders(2, 1, 1)
TRUE = np.array([-1.5, 0.7, 1.0, 0.5])
MODEL = ArxModel(ORDERS, TRUE, np.eye(4), 1.0, 100)


def test_orders_count_their_parameters_and_name_them():
    assert (ArxOrders(2, 1, 3).n_parameters, ArxOrders(2, 1, 3).names) == (4, ("a1", "a2", "b0", "b1"))
    assert str(ArxOrders(2, 1, 3)) == "na 2, nb 1, d 3"


def test_the_criterion_is_that_of_the_normal_likelihood_and_least_for_a_perfect_fit():
    from scipy.stats import norm

    errors = np.random.default_rng(1).standard_normal(50)
    rss = float(errors @ errors)
    log_likelihood = norm(scale=math.sqrt(rss / 50)).logpdf(errors).sum()
    model = ArxModel(ArxOrders(1, 1), np.ones(3), np.eye(3), rss, 50)
    assert model.bic == pytest.approx(3 * math.log(50) - 2 * log_likelihood)
    assert model.loss == rss / 50
    assert ArxModel(ArxOrders(1, 1), np.ones(3), np.eye(3), 0.0, 50).bic == -math.inf


def test_a_row_holds_past_outputs_with_minus_sign_and_then_delayed_inputs():
    u, y = np.arange(1.0, 7.0), np.arange(10.0, 70.0, 10.0)
    rows = arx_regressors(u, y, ArxOrders(2, 1, 1))
    assert np.isnan(rows[:2]).any(axis=1).all()
    np.testing.assert_array_equal(rows[3], [-30.0, -20.0, 3.0, 2.0])
    np.testing.assert_array_equal(rows[5], [-50.0, -40.0, 5.0, 4.0])


def test_a_model_without_past_is_the_ratio_of_output_and_input():
    rng = np.random.default_rng(1)
    u = rng.standard_normal(200)
    y = u / 782.0 + 1e-5 * rng.standard_normal(200)
    model = estimate_arx(u, y, ArxOrders())
    assert model.parameters[0] == pytest.approx(u @ y / (u @ u), rel=1e-13)
    assert model.n_rows == 200


def test_a_record_without_errors_gives_the_coefficients_exactly():
    u, y = arx_record(120, 2, noise=0.0)
    model = estimate_arx(u, y, ORDERS)
    np.testing.assert_allclose(model.parameters, TRUE, rtol=1e-11)
    np.testing.assert_allclose(model.a, SECOND_ORDER[0], rtol=1e-11)
    np.testing.assert_allclose(model.b, SECOND_ORDER[1], rtol=1e-11)
    np.testing.assert_allclose(model.numerator, [0.0, 1.0, 0.5], atol=1e-11)
    np.testing.assert_allclose(model.denominator, [1.0, -1.5, 0.7], rtol=1e-11)


def test_estimates_and_errors_are_those_of_statsmodels_ordinary_least_squares():
    import statsmodels.api as sm

    u, y = arx_record(400, 3)
    rows = np.array([[-y[k - 1], -y[k - 2], u[k - 1], u[k - 2]] for k in range(2, 400)])
    theirs = sm.OLS(y[2:], rows).fit()
    ours = estimate_arx(u, y, ORDERS)
    np.testing.assert_allclose(ours.parameters, theirs.params, rtol=1e-11)
    np.testing.assert_allclose(ours.covariance, theirs.cov_params(), rtol=1e-9)
    np.testing.assert_allclose(ours.standard_errors, theirs.bse, rtol=1e-10)
    assert ours.bic == pytest.approx(theirs.bic, rel=1e-12)
    np.testing.assert_allclose(residuals(ours, u, y)[2:], theirs.resid, atol=1e-12)


def test_estimates_are_those_of_numpys_least_squares():
    u, y = arx_record(300, 4)
    rows = arx_regressors(u, y, ORDERS)[2:]
    expected, *_ = np.linalg.lstsq(rows, y[2:], rcond=None)
    np.testing.assert_allclose(estimate_arx(u, y, ORDERS).parameters, expected, rtol=1e-11)


def test_the_robust_covariance_is_that_of_statsmodels():
    import statsmodels.api as sm

    u, y = arx_record(300, 5)
    rows = arx_regressors(u, y, ORDERS)[2:]
    # 4 (298 / 100)^(2/9) is 5.1
    theirs = sm.OLS(y[2:], rows).fit(cov_type="HAC", cov_kwds={"maxlags": 5, "use_correction": True})
    ours = robust_covariance(estimate_arx(u, y, ORDERS), u, y)
    np.testing.assert_allclose(ours, theirs.cov_params(), rtol=1e-8, atol=1e-14)


@pytest.mark.whole_way
def test_the_robust_covariance_covers_where_the_ordinary_one_does_not():
    rng = np.random.default_rng(6)
    ordinary = robust = 0
    for _ in range(200):
        u = np.convolve(rng.standard_normal(420), np.ones(4) / 4, mode="valid")
        e = np.convolve(rng.standard_normal(u.size + 3), np.ones(4) / 4, mode="valid")
        y = 2.0 * u + e
        model = estimate_arx(u, y, ArxOrders())
        error = abs(model.parameters[0] - 2.0)
        ordinary += error <= 1.96 * model.standard_errors[0]
        robust += error <= 1.96 * np.sqrt(robust_covariance(model, u, y)[0, 0])
    assert ordinary < 165
    assert robust > 172
    assert robust > ordinary + 15


@pytest.mark.whole_way
def test_known_systems_lie_within_their_stated_intervals_as_often_as_stated():
    inside = np.zeros(4)
    joint = 0
    for seed in range(400):
        u, y = arx_record(300, 1000 + seed, noise=0.3)
        model = estimate_arx(u, y, ORDERS)
        error = model.parameters - TRUE
        inside += np.abs(error) <= 1.96 * model.standard_errors
        joint += error @ np.linalg.solve(model.covariance, error) <= 9.488
    # binomial standard deviation at 95 % of 400 is 1.1 %
    assert (np.abs(inside / 400 - 0.95) < 0.035).all()
    assert abs(joint / 400 - 0.95) < 0.035


def test_a_lost_sample_leaves_out_every_row_that_needs_it_and_no_other():
    u, y = arx_record(300, 7)
    whole = np.isfinite(arx_regressors(u, y, ORDERS)).all(axis=1)
    lost_u, lost_y = u.copy(), y.copy()
    lost_u[100], lost_y[200] = np.nan, np.nan
    model = estimate_arx(lost_u, lost_y, ORDERS)
    # u(100) is needed at 101 and 102, y(200) at 200, 201 and 202
    needed = whole.copy()
    needed[[101, 102, 200, 201, 202]] = False
    expected = estimate_arx(u, y, ORDERS, rows=needed)
    np.testing.assert_allclose(model.parameters, expected.parameters, rtol=1e-13)
    assert model.n_rows == expected.n_rows == 298 - 5
    assert np.isnan(residuals(model, lost_u, lost_y)[[0, 1, 101, 102, 200, 201, 202]]).all()


def test_rows_choose_equations_whose_past_may_lie_outside():
    u, y = arx_record(100, 8)
    rows = np.zeros(100, dtype=bool)
    rows[40:60] = True
    model = estimate_arx(u, y, ORDERS, rows=rows)
    np.testing.assert_array_equal(model.parameters, estimate_arx(u[38:60], y[38:60], ORDERS).parameters)
    assert model.n_rows == 20


def test_the_callers_arrays_are_not_touched():
    u, y = arx_record(50, 9)
    before = u.copy(), y.copy()
    robust_covariance(estimate_arx(u, y, ORDERS), u, y)
    np.testing.assert_array_equal(u, before[0])
    np.testing.assert_array_equal(y, before[1])


@settings(max_examples=30)
@given(st.floats(-6, 6), st.floats(-6, 6), st.booleans(), st.integers(0, 2**31))
def test_scaled_signals_scale_b_and_leave_a_as_it_is(log_u, log_y, mirrored, seed):
    u, y = arx_record(80, seed)
    scale_u, scale_y = 10.0**log_u * (-1.0 if mirrored else 1.0), 10.0**log_y
    model, scaled = estimate_arx(u, y, ORDERS), estimate_arx(scale_u * u, scale_y * y, ORDERS)
    np.testing.assert_allclose(scaled.a, model.a, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(scaled.b, model.b * scale_y / scale_u, rtol=1e-8, atol=1e-10 * abs(scale_y / scale_u))
    assert scaled.loss == pytest.approx(model.loss * scale_y**2, rel=1e-9)
    np.testing.assert_allclose(scaled.standard_errors[:2], model.standard_errors[:2], rtol=1e-8)


@settings(max_examples=30)
@given(st.integers(0, 60), st.integers(0, 2**31))
def test_a_record_that_begins_later_gives_the_same_model(shift, seed):
    u, y = arx_record(80, seed)
    late_u, late_y = (np.concatenate([np.full(shift, np.nan), series]) for series in (u, y))
    model, later = estimate_arx(u, y, ORDERS), estimate_arx(late_u, late_y, ORDERS)
    np.testing.assert_array_equal(later.parameters, model.parameters)
    assert later.n_rows == model.n_rows


@settings(max_examples=30)
@given(st.integers(0, 6), st.integers(0, 2**31))
def test_an_input_that_is_later_is_a_delay_that_is_shorter(shift, seed):
    u, y = arx_record(90, seed, system=((-0.5,), (2.0,), 6))
    later_u = np.concatenate([np.full(shift, np.nan), u[: u.size - shift]])
    rows = np.arange(90) >= 12
    model = estimate_arx(u, y, ArxOrders(1, 0, 6), rows=rows)
    moved = estimate_arx(later_u, y, ArxOrders(1, 0, 6 - shift), rows=rows)
    np.testing.assert_array_equal(moved.parameters, model.parameters)


def test_an_input_without_signal_is_refused():
    with pytest.raises(IdentificationError, match="carries no signal"):
        estimate_arx(np.zeros(50), np.random.default_rng(1).standard_normal(50), ORDERS)


def test_a_constant_input_cannot_tell_its_lags_apart():
    with pytest.raises(IdentificationError, match="cannot be told apart"):
        estimate_arx(np.ones(50), np.random.default_rng(1).standard_normal(50), ArxOrders(0, 1))


def test_a_record_that_is_too_short_is_refused():
    u, y = arx_record(6, 1)
    with pytest.raises(IdentificationError, match="too few samples"):
        estimate_arx(u, y, ORDERS)


def test_a_simulation_is_scipys_filter_and_the_systems_own_recursion():
    from scipy.signal import lfilter

    u, unused = arx_record(200, 1)
    found = simulate(MODEL, u, np.full_like(unused, np.nan))
    np.testing.assert_allclose(found, lfilter([0, 1.0, 0.5], [1.0, -1.5, 0.7], u), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found, arx_output(*SECOND_ORDER, u, np.zeros(200)), rtol=1e-10, atol=1e-10)


def test_a_simulation_ends_at_a_lost_input_and_begins_anew_behind_it():
    u, y = arx_record(200, 3, noise=0.0)
    u[80] = np.nan
    found = simulate(MODEL, u, y)
    np.testing.assert_allclose(found[:80], y[:80], atol=1e-10)
    # u(80) is needed at 81 and 82; the state is known again at 83
    assert np.isnan(found[80:83]).all()
    np.testing.assert_allclose(found[83:], y[83:], atol=1e-10)
    assert np.isnan(simulate(MODEL, u, np.full(200, np.nan))[80:]).all()


def test_a_lost_output_does_not_matter_to_a_simulation():
    u, y = arx_record(100, 4, noise=0.0)
    y_lost = y.copy()
    y_lost[30:60] = np.nan
    np.testing.assert_allclose(simulate(MODEL, u, y_lost), y, atol=1e-10)


def test_a_gap_is_never_bridged_where_the_state_stays_unknown():
    u, y = arx_record(100, 5, noise=0.0)
    u[40], y[41:70] = np.nan, np.nan
    found = simulate(MODEL, u, y)
    assert np.isnan(found[40:72]).all()
    assert np.isfinite(found[72:]).all()


def test_a_model_without_past_follows_the_input():
    model = ArxModel(ArxOrders(), np.array([0.5]), np.eye(1), 1.0, 100)
    u = np.array([1.0, np.nan, 3.0, 4.0])
    np.testing.assert_array_equal(simulate(model, u, np.zeros(4)), [0.5, np.nan, 1.5, 2.0])


def test_fit_percent_is_matlabs():
    y, model, rows = np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 2.0, 3.0, 5.0]), np.ones(4, dtype=bool)
    assert fit_percent(y, y, rows) == 100.0
    assert fit_percent(y, np.full(4, 2.5), rows) == 0.0
    assert fit_percent(y, model, rows) == pytest.approx(100 * (1 - 1 / np.sqrt(5)))
    assert fit_percent(y, -y, rows) < 0
    longer = np.ones(6, dtype=bool)
    assert fit_percent(np.array([*y, np.nan, 7.0]), np.array([*model, 1.0, np.nan]), longer) == pytest.approx(
        fit_percent(y, model, rows)
    )
    assert fit_percent(y, model, np.array([True, True, True, False])) == 100.0
    assert np.isnan(fit_percent(np.ones(4), np.ones(4), rows))
    assert np.isnan(fit_percent(np.full(4, np.nan), np.ones(4), rows))


def test_an_unstable_model_explains_nothing_and_warns_of_nothing():
    unstable = ArxModel(ArxOrders(1, 0), np.array([-5.0, 1.0]), np.eye(2), 1.0, 100)
    u, y = arx_record(400, 10)
    assert fit_percent(y, simulate(unstable, u, y), np.ones(400, dtype=bool)) == -np.inf


@settings(max_examples=25)
@given(st.integers(0, 40), st.integers(0, 2**31))
def test_a_later_input_gives_the_same_output_later(shift, seed):
    u, y = arx_record(60, seed)
    late = simulate(MODEL, np.concatenate([np.zeros(shift), u]), np.zeros(shift + 60))
    np.testing.assert_array_equal(late[:shift], 0.0)
    np.testing.assert_allclose(late[shift:], simulate(MODEL, u, y), atol=1e-12)
