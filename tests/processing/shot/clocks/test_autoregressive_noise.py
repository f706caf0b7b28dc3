from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_processing.shot.clocks.autoregressive_noise import (
    AutoregressiveNoise,
    few_samples_factor,
    fit_noise,
    long_run_variance,
)


def autoregressive(coefficients: tuple[float, ...], count: int, seed: int = 0) -> np.ndarray:
    from scipy.signal import lfilter

    white = np.random.default_rng(seed).standard_normal(count + 500)
    return np.asarray(lfilter([1.0], [1.0, *(-c for c in coefficients)], white)[500:])


def test_burg_finds_coefficients_and_order_of_a_process():
    noise = fit_noise([autoregressive((1.2, -0.8), 20_000)])
    assert noise.order >= 2
    np.testing.assert_allclose(noise.predictors[2, :2], [1.2, -0.8], atol=0.02)
    np.testing.assert_allclose(noise.predictors[-1, 2:], 0.0, atol=0.05)
    assert noise.sigma == pytest.approx(1.0, abs=0.02)
    # variance of the process itself, Yule and Walker: (1 - c2) / ((1 + c2) ((1 - c2)^2 - c1^2))
    assert noise.deviations[0] ** 2 == pytest.approx(1.8 / (0.2 * (1.8**2 - 1.2**2)), rel=0.1)


def test_white_noise_is_left_as_it_is():
    noise = fit_noise([2.0 * np.random.default_rng(3).standard_normal(5000)])
    assert noise.sigma == pytest.approx(2.0, rel=0.03)
    assert math.sqrt(noise.slow_density) == pytest.approx(2.0, rel=0.25)


def test_pieces_tell_the_same_as_the_whole_without_a_join():
    series = autoregressive((0.9,), 30_000, seed=5)
    whole, parts = fit_noise([series]), fit_noise([series[:9000], series[9100:20_000], series[20_500:]])
    assert parts.predictors[1, 0] == pytest.approx(whole.predictors[1, 0], abs=0.01)


def test_the_long_run_variance_is_that_of_the_sum():
    sums = [float(autoregressive((0.8,), 2000, seed).sum()) for seed in range(300)]
    stated = np.mean([long_run_variance([autoregressive((0.8,), 2000, seed)]) for seed in range(40)])
    assert stated == pytest.approx(np.var(sums), rel=0.2)


def test_an_uncertainty_from_few_samples_is_wider():
    assert few_samples_factor(10**9, 4) == pytest.approx(1.0, abs=1e-6)
    assert few_samples_factor(200, 10) == pytest.approx(math.sqrt(10.0 / 8.0))
    assert few_samples_factor(10, 10) == pytest.approx(math.sqrt(2.0))


def test_a_constant_series_has_no_noise_but_a_model():
    noise = fit_noise([np.zeros(100)])
    assert noise.order == 0
    assert noise.sigma < 1e-100
    assert isinstance(noise, AutoregressiveNoise)


@pytest.mark.parametrize("pieces", [[], [np.zeros(0)], [np.array([1.0, np.nan])]])
def test_no_samples_or_lost_ones_are_refused(pieces):
    with pytest.raises(ValueError, match="samples"):
        fit_noise(pieces)


def test_a_negative_order_is_refused():
    with pytest.raises(ValueError, match="most_order"):
        fit_noise([np.ones(50)], -1)


def test_what_returns_to_no_mean_has_the_variance_that_was_seen_for_a_density() -> None:
    only_wanders = AutoregressiveNoise(np.array([[0.0], [1.0]]), np.array([3.0, 0.1]))
    assert only_wanders.slow_density == pytest.approx(9.0)
    # a level that was not taken off is predicted without an error
    held = fit_noise([np.full(2000, 5.0)], 4)
    assert math.isfinite(held.slow_density)
