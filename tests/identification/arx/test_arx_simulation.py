from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.arx.estimation import estimate_arx, residuals
from recoil_identification.arx.model import ArxModel, ArxOrders
from recoil_identification.arx.simulation import fit_percent, predict, simulate
from tests.builders.arx_systems import SECOND_ORDER, arx_output, arx_record

ORDERS = ArxOrders(2, 1, 1)
MODEL = ArxModel(ORDERS, np.array([-1.5, 0.7, 1.0, 0.5]), np.eye(4), 1.0, 100)


def test_a_simulation_is_scipys_filter_and_the_systems_own_recursion():
    from scipy.signal import lfilter

    u, _ = arx_record(200, 1)
    found = simulate(MODEL, u)
    np.testing.assert_allclose(found, lfilter([0, 1.0, 0.5], [1.0, -1.5, 0.7], u), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found, arx_output(*SECOND_ORDER, u, np.zeros(200)), rtol=1e-10, atol=1e-10)


def test_a_simulation_may_begin_in_the_measured_state():
    u, y = arx_record(200, 2, noise=0.0)
    found = simulate(MODEL, u, y, start=50)
    np.testing.assert_allclose(found, y, atol=1e-10)
    # a noisy start decays, and nothing of the measured output behind it is used
    spoilt = y.copy()
    spoilt[50:] = np.nan
    np.testing.assert_allclose(simulate(MODEL, u, spoilt, start=50), y, atol=1e-10)


def test_a_simulation_ends_at_a_lost_input_and_begins_anew_behind_it():
    u, y = arx_record(200, 3, noise=0.0)
    u[80] = np.nan
    found = simulate(MODEL, u, y)
    np.testing.assert_allclose(found[:80], y[:80], atol=1e-10)
    # u(80) is needed at 81 and 82; the state is known again at 83
    assert np.isnan(found[80:83]).all()
    np.testing.assert_allclose(found[83:], y[83:], atol=1e-10)
    assert np.isnan(simulate(MODEL, u)[80:]).all()


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
    np.testing.assert_array_equal(simulate(model, u), [0.5, np.nan, 1.5, 2.0])
    np.testing.assert_array_equal(simulate(model, u, np.zeros(4)), [0.5, np.nan, 1.5, 2.0])


def test_a_prediction_one_sample_ahead_leaves_the_residuals():
    u, y = arx_record(150, 6)
    model = estimate_arx(u, y, ORDERS)
    np.testing.assert_allclose(y - predict(model, u, y), residuals(model, u, y), atol=1e-12)


@pytest.mark.parametrize("horizon", [1, 2, 3, 7])
def test_a_prediction_is_a_simulation_from_the_outputs_so_long_before(horizon):
    u, y = arx_record(80, 7)
    found = predict(MODEL, u, y, horizon)
    for k in (20, 41, 79):
        assert found[k] == pytest.approx(simulate(MODEL, u, y, start=k - horizon + 1)[k], rel=1e-10)
    # outputs after k - horizon are not used
    changed = y.copy()
    changed[41 - horizon + 1 :] = 99.0
    assert predict(MODEL, u, changed, horizon)[41] == found[41]


def test_a_far_prediction_is_the_simulation():
    u, y = arx_record(300, 8)
    np.testing.assert_allclose(predict(MODEL, u, y, 150)[160:], simulate(MODEL, u)[160:], atol=1e-6)


def test_a_prediction_lacks_only_what_the_lost_sample_reaches():
    u, y = arx_record(60, 9)
    y[30] = np.nan
    one = predict(MODEL, u, y, 1)
    assert list(np.flatnonzero(np.isnan(one))) == [0, 1, 31, 32]
    two = predict(MODEL, u, y, 2)
    assert list(np.flatnonzero(np.isnan(two[10:])) + 10) == [32, 33]


def test_fit_percent_is_matlabs():
    y = np.array([1.0, 2.0, 3.0, 4.0])
    assert fit_percent(y, y) == 100.0
    assert fit_percent(y, np.full(4, 2.5)) == 0.0
    model = np.array([1.0, 2.0, 3.0, 5.0])
    assert fit_percent(y, model) == pytest.approx(100 * (1 - 1 / np.sqrt(5)))
    assert fit_percent(y, -y) < 0
    assert fit_percent([*y, np.nan, 7.0], [*model, 1.0, np.nan]) == pytest.approx(fit_percent(y, model))
    assert fit_percent(y, model, np.array([True, True, True, False])) == 100.0
    assert np.isnan(fit_percent(np.ones(4), np.ones(4)))
    assert np.isnan(fit_percent(np.full(4, np.nan), np.ones(4)))


def test_an_unstable_model_explains_nothing_and_warns_of_nothing():
    unstable = ArxModel(ArxOrders(1, 0), np.array([-5.0, 1.0]), np.eye(2), 1.0, 100)
    u, y = arx_record(400, 10)
    assert fit_percent(y, simulate(unstable, u)) == -np.inf


@settings(max_examples=25)
@given(st.integers(0, 40), st.integers(0, 2**31))
def test_a_later_input_gives_the_same_output_later(shift, seed):
    u, _ = arx_record(60, seed)
    late = simulate(MODEL, np.concatenate([np.zeros(shift), u]))
    np.testing.assert_array_equal(late[:shift], 0.0)
    np.testing.assert_allclose(late[shift:], simulate(MODEL, u), atol=1e-12)


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: simulate(MODEL, np.ones(5), start=2), "measured output"),
        (lambda: simulate(MODEL, np.ones(5), np.ones(5), start=6), "measured output"),
        (lambda: simulate(MODEL, np.ones(5), np.ones(4)), "one length"),
        (lambda: predict(MODEL, np.ones(5), np.ones(5), 0), "horizon"),
        (lambda: fit_percent(np.ones(5), np.ones(4)), "one length"),
        (lambda: fit_percent(np.ones(5), np.ones(5), np.ones(4, dtype=bool)), "one length"),
    ],
)
def test_mistakes_of_the_caller_are_value_errors(call, match):
    with pytest.raises(ValueError, match=match):
        call()
