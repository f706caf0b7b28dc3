from __future__ import annotations

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.memory.window_length import choose_window

WINDOWS = sorted({round(length) for length in np.geomspace(10, 1000, 14)})


def record(seed, noise, parameter, n_samples=8_000):
    """One regressor of rms one, a parameter over time, and white errors."""
    rng = np.random.default_rng(seed)
    regressor = rng.standard_normal(n_samples)
    return regressor[:, np.newaxis], regressor * parameter + noise * rng.standard_normal(n_samples)


def stepping(every, n_samples=8_000):
    return np.where(np.arange(n_samples) // every % 2 == 0, 1.0, 2.0)


@pytest.mark.parametrize("seed", range(5))
def test_a_constant_parameter_is_given_the_longest_window(seed):
    choice = choose_window(*record(seed, 0.3, 1.0), WINDOWS)
    assert choice.window == choice.tried[-1].window == 1000
    assert choice.reason.endswith("the record shows no variation that a shorter memory would follow")


@pytest.mark.parametrize("seed", range(5))
def test_a_parameter_that_steps_is_given_a_window_shorter_than_its_steps(seed):
    choice = choose_window(*record(seed, 0.3, stepping(400)), WINDOWS)
    assert choice.window < 100
    assert "% larger, as the parameters vary" in choice.reason
    assert f"{choice.window}" in choice.reason


@pytest.mark.exhaustive
def test_the_window_grows_with_the_noise():
    for seed in range(3):
        records = [record(seed, noise, stepping(400)) for noise in (0.03, 0.3, 1.0, 10.0, 30.0)]
        lengths = [choose_window(*one, WINDOWS).window for one in records]
        assert lengths == sorted(lengths)
        assert lengths[0] < 20
        assert lengths[-1] > 300


def test_the_window_shrinks_as_the_parameter_moves_faster():
    def wave(period):
        return 1.0 + 0.5 * np.sin(2 * np.pi * np.arange(8_000) / period)

    records = [record(4, 0.3, wave(period)) for period in (200, 1_000, 8_000, 1e9)]
    lengths = [choose_window(*one, WINDOWS).window for one in records]
    assert lengths == sorted(lengths)
    assert lengths[0] < 40
    assert lengths[-1] == 1000


def test_errors_that_are_correlated_in_time_do_not_shorten_the_window_where_predictions_reach_beyond_them():
    rng = np.random.default_rng(5)
    level = np.ones((8_000, 1))
    errors = np.convolve(rng.standard_normal(8_100), np.ones(20) / 20, "valid")[:8_000]
    next_one = choose_window(level, 5.0 + errors, WINDOWS)
    beyond = choose_window(level, 5.0 + errors, WINDOWS, ahead=40)
    assert next_one.window < 50
    assert beyond.window > 500
    assert "the response 40 samples later" in beyond.reason


def test_the_table_tells_what_was_tried():
    choice = choose_window(*record(6, 0.3, 1.0), windows=[400, 25, 100])
    assert [one.window for one in choice.tried] == [25, 100, 400]
    assert choice.n_predictions == 8_000 - 400
    # of the noise's own variance and the estimate's, 1 + 1 / window
    assert choice.tried[-1].excess == 0.0
    assert choice.tried[-1].u_excess == 0.0
    assert choice.tried[0].excess == pytest.approx(1 / 25 - 1 / 400, rel=0.3)


def test_missing_samples_are_left_out_of_the_comparison():
    regressors, response = record(7, 0.3, 1.0)
    lost = np.where(np.arange(8_000) % 50 == 7, np.nan, response)
    choice = choose_window(regressors, lost, WINDOWS)
    assert choice.window == 1000
    assert choice.n_predictions == np.isfinite(lost[1000:]).sum()


def test_units_do_not_matter():
    regressors, response = record(8, 0.3, stepping(400))
    small, large = (
        choose_window(1e-6 * regressors, 1e9 * response, WINDOWS),
        choose_window(regressors, response, WINDOWS),
    )
    assert small.window == large.window


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"windows": [50]}, "two different lengths or more"),
        ({"windows": [50, 50, 60]}, "two different lengths or more"),
        ({"windows": [1, 50]}, "at least 2, found 1"),
        ({"ahead": 0}, "ahead must be at least 1"),
        ({"response": np.ones((300, 1))}, "found shapes"),
    ],
)
def test_a_callers_mistake_is_named(changed, message):
    arguments = {"regressors": np.ones((300, 1)), "response": np.ones(300), "windows": [10, 20]} | changed
    with pytest.raises(ValueError, match=message):
        choose_window(**arguments)


def test_a_record_that_is_too_short_says_what_to_do():
    with pytest.raises(IdentificationError, match=r"too few samples to compare windows"):
        choose_window(np.ones((100, 1)), np.ones(100), windows=[10, 98])
