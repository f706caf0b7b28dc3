from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.arx.estimation import arx_regressors, estimate_arx
from recoil_identification.arx.model import ArxOrders
from recoil_identification.arx.recursive import finite_history_arx, forgetting_arx
from recoil_identification.memory.windowed_estimates import WindowStatus
from tests.builders.arx_systems import arx_output, arx_record

ORDERS = ArxOrders(2, 1, 1)
TRUE = np.array([-1.5, 0.7, 1.0, 0.5])


def weighted(rows: np.ndarray, y: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Estimate and covariance of one weighted regression, by normal equations in extended precision."""
    X, w, y = (np.asarray(values, dtype=np.longdouble) for values in (rows, weights, y))
    gram = np.asarray((X * w[:, None]).T @ X, dtype=float)
    theta = np.linalg.solve(gram, np.asarray((X * w[:, None]).T @ y, dtype=float))
    P = np.linalg.inv(gram)
    squares = np.asarray((X * (w**2)[:, None]).T @ X, dtype=float)
    error = np.asarray(y - X @ theta, dtype=float)
    variance = float(np.asarray(w, dtype=float) @ error**2) / (float(w.sum()) - np.trace(P @ squares))
    return theta, variance * P @ squares @ P


@pytest.mark.parametrize("forgetting", [0.5, 0.9, 0.99, 1.0])
def test_every_estimate_is_its_own_weighted_regression(forgetting):
    u, y = arx_record(300, 1)
    u[150] = np.nan
    found = forgetting_arx(u, y, ORDERS, forgetting)
    rows = arx_regressors(u, y, ORDERS)
    for k in (12, 16, 17, 33, 34, 127, 128, 149, 150, 151, 153, 200, 255, 256, 299):
        present = np.flatnonzero(np.isfinite(rows[: k + 1]).all(axis=1))
        theta, covariance = weighted(rows[present], y[present], forgetting ** np.arange(present.size)[::-1])
        np.testing.assert_allclose(found.parameters[k], theta, rtol=1e-9)
        np.testing.assert_allclose(found.covariance[k], covariance, rtol=1e-6, atol=1e-9 * np.abs(covariance).max())
        np.testing.assert_allclose(found.standard_errors[k], np.sqrt(np.diag(covariance)), rtol=1e-6)


def test_nothing_forgotten_is_the_whole_record():
    u, y = arx_record(200, 2)
    found, whole = forgetting_arx(u, y, ORDERS, 1.0), estimate_arx(u, y, ORDERS)
    np.testing.assert_allclose(found.parameters[-1], whole.parameters, rtol=1e-11)
    np.testing.assert_allclose(found.covariance[-1], whole.covariance, rtol=1e-9)
    assert found.noise_variance[-1] == pytest.approx(whole.noise_variance, rel=1e-11)
    assert found.effective_samples[-1] == 198


def test_the_memory_of_a_forgetting_factor_counts_its_effective_samples():
    u, y = arx_record(600, 3)
    found = forgetting_arx(u, y, ArxOrders(), 0.95)
    assert found.effective_samples[-1] == pytest.approx(1.95 / 0.05, rel=1e-9)
    assert found.forgot.all()


def test_the_stated_errors_hold_the_truth_as_often_as_stated():
    held = 0
    for seed in range(150):
        u, y = arx_record(100, 500 + seed, noise=0.3)
        found = forgetting_arx(u, y, ORDERS, 0.95)
        held += np.abs(found.parameters[-1] - TRUE) <= 2.02 * found.standard_errors[-1]
    # 39 effective rows: 95 % of Student's distribution
    assert (np.abs(held / 150 - 0.95) < 0.055).all()


def test_parameters_that_change_are_followed():
    rng = np.random.default_rng(4)
    u = rng.standard_normal(800)
    y = np.where(np.arange(800) < 400, 1.0, 2.0) * u + 0.01 * rng.standard_normal(800)
    faded = forgetting_arx(u, y, ArxOrders(), 0.95)
    finite = finite_history_arx(u, y, ArxOrders(), 60)
    for estimates in (faded.parameters, finite.parameters):
        np.testing.assert_allclose(estimates[399], 1.0, atol=0.01)
        np.testing.assert_allclose(estimates[600], 2.0, atol=0.01)


def silent_record() -> tuple[np.ndarray, np.ndarray]:
    """Give a system an input for 500 samples, and then 20000 of silence with little noise."""
    rng = np.random.default_rng(5)
    u = np.where(np.arange(20_500) < 500, rng.standard_normal(20_500), 0.0)
    y = arx_output((-1.5, 0.7), (1.0, 0.5), 1, u, np.zeros(u.size)) + 1e-6 * rng.standard_normal(u.size)
    return u + 1e-9 * rng.standard_normal(u.size), y


def test_forgetting_stands_still_in_silence_so_that_the_estimates_stay():
    u, y = silent_record()
    guarded = forgetting_arx(u, y, ORDERS, 0.97, min_excitation=1.0)
    np.testing.assert_allclose(guarded.parameters[500:], np.tile(TRUE, (20_000, 1)), atol=1e-5)
    assert (guarded.standard_errors[500:] < 1e-5).all()
    assert guarded.forgot[:500][2:].mean() > 0.9
    assert not guarded.forgot[1000:].any()


def test_without_the_guard_silence_winds_up_and_the_standard_errors_say_so():
    u, y = silent_record()
    loose = forgetting_arx(u, y, ORDERS, 0.97)
    assert np.abs(loose.parameters[-1] - TRUE).max() > 0.5
    assert (loose.standard_errors[-1] > 0.05).all()


def test_exact_silence_is_said_to_be_no_excitation():
    u, y = arx_record(400, 6)
    u[300:], y[300:] = 0.0, 0.0
    long_u, long_y = (np.concatenate([series, np.zeros(6000)]) for series in (u, y))
    found = forgetting_arx(long_u, long_y, ORDERS, 0.9)
    assert found.identified[299]
    assert found.status[-1] == WindowStatus.NO_EXCITATION
    assert np.isnan(found.parameters[-1]).all()
    # nothing of it is left when the signal comes back
    back_u, back_y = (
        np.concatenate([series, s]) for series, s in zip((long_u, long_y), arx_record(200, 7), strict=True)
    )
    back = forgetting_arx(back_u, back_y, ORDERS, 0.9)
    np.testing.assert_allclose(back.parameters[-1], TRUE, atol=0.15)


def test_a_shot_leaves_no_round_off_in_the_quiet_part_behind_it():
    rng = np.random.default_rng(8)
    u = rng.standard_normal(3000)
    u[100:200] *= 1e6
    y = 0.5 * u + 0.01 * rng.standard_normal(3000)
    found = forgetting_arx(u, y, ArxOrders(), 0.9)
    weights = 0.9 ** np.arange(2000.0)[::-1]
    theta, _ = weighted(u[1000:, None], y[1000:], weights)
    np.testing.assert_allclose(found.parameters[-1], theta, rtol=1e-13)


def test_a_missing_row_changes_nothing_and_costs_no_memory():
    u, y = arx_record(200, 9)
    y_lost = y.copy()
    y_lost[150:] = np.nan
    found = forgetting_arx(u, y_lost, ORDERS, 0.95)
    np.testing.assert_allclose(found.parameters[150:], np.tile(found.parameters[149], (50, 1)), rtol=1e-12)
    np.testing.assert_array_equal(found.effective_samples[150:], found.effective_samples[149])
    assert not found.forgot[150:].any()


def test_too_few_rows_give_no_number():
    u, y = arx_record(30, 10)
    found = forgetting_arx(u, y, ORDERS, 0.95)
    assert (found.status[:6] == WindowStatus.TOO_FEW_SAMPLES).all()
    assert np.isnan(found.parameters[:6]).all()
    assert found.identified[6:].all()


def test_columns_that_are_alike_are_collinear():
    u = np.ones(40)
    found = forgetting_arx(u, np.random.default_rng(1).standard_normal(40), ArxOrders(0, 1), 0.9)
    assert found.status[-1] == WindowStatus.COLLINEAR


@pytest.mark.parametrize("size", [0, 1, 3])
def test_a_record_shorter_than_the_memory_of_the_model_has_no_estimates(size):
    found = forgetting_arx(np.ones(size), np.ones(size), ArxOrders(3, 0), 0.9)
    assert found.parameters.shape == (size, 4)
    assert not found.identified.any()


def test_finite_history_is_the_regression_of_the_last_rows():
    u, y = arx_record(200, 11)
    found = finite_history_arx(u, y, ORDERS, 50)
    rows = np.zeros(200, dtype=bool)
    rows[100:150] = True
    one = estimate_arx(u, y, ORDERS, rows=rows)
    np.testing.assert_allclose(found.parameters[149], one.parameters, rtol=1e-9)
    np.testing.assert_allclose(found.standard_errors[149], one.standard_errors, rtol=1e-8)
    assert found.status[48] == WindowStatus.WINDOW_NOT_FULL


@settings(max_examples=20)
@given(st.floats(-6, 6), st.floats(-6, 6), st.floats(0.6, 1.0), st.integers(0, 2**31))
def test_scaled_signals_scale_b_and_leave_a_as_it_is(log_u, log_y, forgetting, seed):
    u, y = arx_record(60, seed)
    one = forgetting_arx(u, y, ORDERS, forgetting)
    scaled = forgetting_arx(10.0**log_u * u, 10.0**log_y * y, ORDERS, forgetting)
    ratio = 10.0 ** (log_y - log_u)
    np.testing.assert_allclose(scaled.parameters[-1, :2], one.parameters[-1, :2], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(scaled.parameters[-1, 2:], ratio * one.parameters[-1, 2:], rtol=1e-6, atol=1e-8 * ratio)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"forgetting": 0.0}, "forgetting"),
        ({"forgetting": 1.1}, "forgetting"),
        ({"forgetting": np.nan}, "forgetting"),
        ({"forgetting": 0.9, "min_excitation": -1.0}, "min_excitation"),
        ({"forgetting": 0.9, "min_excitation": [1.0, 2.0]}, "min_excitation"),
    ],
)
def test_mistakes_of_the_caller_are_value_errors(options, match):
    with pytest.raises(ValueError, match=match):
        forgetting_arx(*arx_record(30, 1), ORDERS, **options)
