"""Whiteness: white noise stays within the limits as often as they say, and what is coloured leaves them."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_identification.calibration.residuals import rows_left, whiteness
from tests.builders.virtual_shots import identified


def noise(seed: int, n: int = 300) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


def test_white_noise_leaves_the_limits_in_one_series_of_twenty() -> None:
    tested = [whiteness(noise(seed)) for seed in range(400)]
    beyond = np.mean([not one.is_white for one in tested if one is not None])
    assert 0.02 < beyond < 0.08
    outside = np.mean([np.mean(np.abs(one.autocorrelation) > one.limit) for one in tested if one is not None])
    assert 0.03 < outside < 0.07


@pytest.mark.parametrize("weights", [(1.0, 0.6), (1.0, -0.6), (1.0, 1.0, 1.0)])
def test_coloured_noise_leaves_them(weights: tuple[float, ...]) -> None:
    tested = whiteness(np.convolve(noise(1), weights))
    assert tested is not None
    assert not tested.is_white
    assert abs(tested.autocorrelation[0]) > tested.limit


def test_autocorrelation_is_that_of_its_definition() -> None:
    left = noise(2, 60) + 3.0
    tested = whiteness(left)
    assert tested is not None
    expected = [np.correlate(left - left.mean(), left - left.mean(), "full")[59 + k] for k in range(1, 16)]
    np.testing.assert_allclose(tested.autocorrelation, np.array(expected) / (60 * left.var()))
    assert tested.cumulative[-1] == pytest.approx(1.0)
    assert np.all(np.diff(tested.cumulative) >= 0.0)


@pytest.mark.parametrize("left", [np.zeros(100), np.arange(5.0)])
def test_what_says_nothing_gives_none(left: np.ndarray) -> None:
    assert whiteness(left) is None


def test_the_rows_of_a_fit_have_unit_variance_and_are_white() -> None:
    """The virtual shot's noise is the model's: what the fit leaves, its correlation taken off, is white."""
    left = rows_left(identified("mixed").route.calibration)
    tested = whiteness(left)
    assert left.size == identified("mixed").route.calibration.block.rows.size
    assert 0.6 < np.std(left) < 1.4
    assert tested is not None
    assert tested.furthest < 1.5 * tested.cumulative_limit
