import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.outliers import agreeing, isolated_outliers, stuck_repeats

SIGMA = 5e-5


def residual(seed: int, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """A slow walk plus marker noise, frames missing here and there."""
    rng = np.random.default_rng(seed)
    times = np.flatnonzero(rng.random(2 * count) > 0.1)[:count] / 2000
    return times, 1e-3 * np.sin(2 * np.pi * 3 * times) + SIGMA * rng.standard_normal(count)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_noise_has_no_outliers(seed):
    assert not isolated_outliers(*residual(seed), SIGMA).any()


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(2, 397), st.sampled_from([-1, 1]), st.floats(2e-3, 1.0))
def test_a_spike_is_found_and_nothing_beside_it(seed, at, sign, height):
    times, values = residual(seed)
    values[at] += sign * height
    assert np.flatnonzero(isolated_outliers(times, values, SIGMA)).tolist() == [at]


def test_several_spikes_are_found():
    times, values = residual(1)
    spikes = [20, 31, 200, 370]
    values[spikes] += [0.01, -0.002, 0.5, 0.001]
    assert np.flatnonzero(isolated_outliers(times, values, SIGMA)).tolist() == spikes


@pytest.mark.parametrize("height", [2e-3, 5e-3, -0.1])
def test_a_step_is_no_outlier(height):
    times, values = residual(2)
    values[200:] += height
    assert not isolated_outliers(times, values, SIGMA).any()


@pytest.mark.parametrize("count", range(5))
def test_fewer_than_five_values_are_not_judged(count):
    assert not isolated_outliers(np.arange(float(count)), 1e3 * np.arange(count) ** 4.0, SIGMA).any()


def test_the_values_are_left_alone():
    times, values = residual(3)
    values[50] = 1.0
    kept = values.copy()
    isolated_outliers(times, values, SIGMA)
    assert np.array_equal(values, kept)


def test_repeats_count_where_the_model_has_moved_on():
    model = np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 4.0])
    positions = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 4.0, 4.0])
    stuck = stuck_repeats(positions, positions - model, 0.01)
    assert np.flatnonzero(stuck).tolist() == [4, 5]


def test_nothing_repeats_in_nothing():
    assert stuck_repeats(np.empty(0), np.empty(0), 1.0).size == 0


def test_frames_that_contradict_their_neighbours_are_lost_and_those_that_were_lost_stay_so():
    times_s = np.arange(200) / 1000.0
    positions = np.sin(6.0 * times_s) + 1e-4 * np.random.default_rng(2).standard_normal(200)
    positions[50] += 0.1
    positions[120] = positions[119]
    positions[[0, 90]] = np.nan
    found = agreeing(times_s, positions)
    assert np.flatnonzero(np.isnan(found)).tolist() == [0, 50, 90, 120]
    assert agreeing(times_s, np.full(200, np.nan)).size == 200
