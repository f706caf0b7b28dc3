import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.noise import noise_sigma, robust_sigma

ESTIMATORS = [noise_sigma, robust_sigma]


@pytest.mark.parametrize("estimate", ESTIMATORS)
@pytest.mark.parametrize("sigma", [1e-9, 5e-5, 3.0, 1e8])
def test_a_known_sigma_is_found(estimate, sigma):
    noise = sigma * np.random.default_rng(3).standard_normal(20_000)
    assert estimate(noise) == pytest.approx(sigma, rel=0.03)


@pytest.mark.parametrize("estimate", ESTIMATORS)
def test_some_outliers_do_not_decide(estimate):
    rng = np.random.default_rng(4)
    noise = rng.standard_normal(20_000)
    noise[rng.choice(20_000, 400, replace=False)] = 1e6
    assert estimate(noise) == pytest.approx(1.0, rel=0.12)


@pytest.mark.parametrize("estimate", ESTIMATORS)
def test_missing_samples_drop_out(estimate):
    rng = np.random.default_rng(5)
    noise = 2.0 * rng.standard_normal(20_000)
    noise[rng.random(20_000) < 0.2] = np.nan
    assert estimate(noise) == pytest.approx(2.0, rel=0.05)


def test_a_smooth_signal_is_no_noise():
    times = np.arange(4000) / 2000
    noise = 5e-5 * np.random.default_rng(6).standard_normal(4000)
    assert noise_sigma(np.sin(2 * np.pi * 3 * times) + 4 * times**2 + noise) == pytest.approx(5e-5, rel=0.06)


@settings(deadline=None, max_examples=50)
@given(st.floats(-100, 100), st.floats(-100, 100), st.floats(-100, 100), st.integers(0, 2**32 - 1))
def test_a_parabola_adds_nothing(c0, c1, c2, seed):
    t = np.linspace(-1, 1, 200)
    noise = np.random.default_rng(seed).standard_normal(200)
    assert noise_sigma(noise + c0 + c1 * t + c2 * t**2) == pytest.approx(noise_sigma(noise), rel=1e-9)


@settings(deadline=None, max_examples=50)
@given(st.sampled_from(ESTIMATORS), st.floats(1e-6, 1e6), st.floats(-1e3, 1e3), st.integers(0, 2**32 - 1))
def test_scale_scales_and_level_does_not_matter(estimate, scale, level, seed):
    noise = np.random.default_rng(seed).standard_normal(101)
    assert estimate(scale * (noise + level)) == pytest.approx(scale * estimate(noise), rel=1e-8)


@pytest.mark.parametrize("estimate", ESTIMATORS)
def test_a_constant_has_no_noise(estimate):
    assert estimate(np.full(100, 3.5)) == 0.0


@pytest.mark.parametrize("estimate", ESTIMATORS)
@pytest.mark.parametrize("samples", [np.empty(0), np.full(10, np.nan)])
def test_nothing_there_gives_no_number(estimate, samples):
    assert math.isnan(estimate(samples))


def test_fewer_than_four_neighbours_give_no_number():
    assert math.isnan(noise_sigma(np.array([1.0, 2.0, 3.0])))
    assert math.isnan(noise_sigma(np.array([1.0, 2.0, 4.0, np.nan, 1.0, 5.0, 2.0])))
    assert noise_sigma(np.array([1.0, 2.0, 4.0, 3.0])) > 0
