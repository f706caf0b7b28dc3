import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.filters import WhittakerLowPass

RATE_HZ = 20_000.0


def by_dense_algebra(samples, weights, penalty):
    """The normal equations in whole, by orthogonal decomposition of their square root."""
    differences = np.diff(np.eye(samples.size), 3, axis=0)
    root = np.vstack([np.diag(np.sqrt(weights)), math.sqrt(penalty) * differences])
    right = np.concatenate([np.sqrt(weights) * np.where(weights > 0, samples, 0.0), np.zeros(samples.size - 3)])
    return np.linalg.lstsq(root, right, rcond=None)[0]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 60), st.floats(200.0, 9000.0), st.floats(0.0, 0.6))
def test_it_is_the_minimum_that_it_is_defined_by(seed, count, cutoff_hz, share_lost):
    rng = np.random.default_rng(seed)
    samples = rng.standard_normal(count)
    weights = rng.uniform(0.2, 5.0, count)
    weights[3:] *= rng.random(count - 3) > share_lost
    smoother = WhittakerLowPass(cutoff_hz)
    expected = by_dense_algebra(samples, weights, smoother.penalty(RATE_HZ))
    found = smoother.apply(samples, RATE_HZ, weights)
    assert np.allclose(found, expected, rtol=0, atol=1e-7 * max(1.0, np.abs(expected).max()))


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(3, 3000),
    st.floats(30.0, 9000.0),
    st.tuples(*[st.floats(-10.0, 10.0)] * 3),
)
def test_a_parabola_passes_unchanged_whatever_weights_and_ends(seed, count, cutoff_hz, coefficients):
    t = np.linspace(-1.0, 1.0, count)
    parabola = coefficients[0] + coefficients[1] * t + coefficients[2] * t**2
    weights = np.random.default_rng(seed).uniform(0.1, 3.0, count)
    for w in (None, weights):
        assert np.allclose(WhittakerLowPass(cutoff_hz).apply(parabola, RATE_HZ, w), parabola, rtol=0, atol=1e-7)


@settings(max_examples=15, deadline=None)
@given(st.integers(10, 1900), st.integers(1, 40))
def test_a_parabola_is_carried_over_a_gap(begin, length):
    t = np.linspace(-1.0, 1.0, 2000)
    lossy = 1.0 - 2.0 * t + 5.0 * t**2
    truth = lossy.copy()
    lossy[begin : begin + length] = np.nan
    filtered, trusted = WhittakerLowPass(300.0).apply_with_gaps(lossy, RATE_HZ)
    assert np.allclose(filtered, truth, rtol=0, atol=1e-8)
    assert not trusted[begin : min(begin + length, 2000)].any()


def test_what_stands_in_a_sample_without_weight_does_not_matter():
    samples = np.random.default_rng(1).standard_normal(500)
    weights = np.ones(500)
    weights[100:110] = 0.0
    expected = WhittakerLowPass(300.0).apply(samples, RATE_HZ, weights)
    for value in (1e9, math.nan, math.inf):
        samples[100:110] = value
        assert np.array_equal(WhittakerLowPass(300.0).apply(samples, RATE_HZ, weights), expected)


def test_all_weights_together_move_the_cutoff_as_stated():
    samples = np.random.default_rng(2).standard_normal(2000)
    quiet, heavy = WhittakerLowPass(300.0), WhittakerLowPass(600.0)
    ratio = quiet.penalty(RATE_HZ) / heavy.penalty(RATE_HZ)
    found = quiet.apply(samples, RATE_HZ, np.full(2000, ratio))
    assert np.allclose(found, heavy.apply(samples, RATE_HZ), rtol=0, atol=1e-10)


def test_the_lowest_cutoff_at_a_rate_is_solved_to_nine_digits():
    rate_hz = 50_000.0
    with pytest.raises(ValueError, match=r"can be solved for cut-offs from ([\d.]+) Hz, not 1 Hz") as refusal:
        WhittakerLowPass(1.0).apply(np.zeros(100), rate_hz)
    lowest_hz = 1.01 * float(str(refusal.value).split(" from ")[1].split(" ")[0])
    sine = np.sin(2 * np.pi * lowest_hz / rate_hz * np.arange(30_000))
    filtered = WhittakerLowPass(lowest_hz).apply(sine, rate_hz)
    assert np.allclose(filtered[12_000:18_000], math.sqrt(0.5) * sine[12_000:18_000], rtol=0, atol=1e-9)


@pytest.mark.parametrize("weights", [np.ones(9), -np.ones(10), np.full(10, np.nan), np.ones((10, 1))])
def test_weights_that_are_none_are_refused(weights):
    with pytest.raises(ValueError, match="weights must be 10 finite numbers"):
        WhittakerLowPass(300.0).apply(np.zeros(10), RATE_HZ, weights)


def test_fewer_than_three_samples_of_weight_are_refused():
    weights = np.zeros(10)
    weights[:2] = 1.0
    with pytest.raises(ValueError, match="2 of 10 samples have a weight; 3 are needed"):
        WhittakerLowPass(300.0).apply(np.zeros(10), RATE_HZ, weights)
    with pytest.raises(ValueError, match="2 of 10 samples are there; 3 are needed"):
        WhittakerLowPass(300.0).apply_with_gaps(np.where(weights > 0, 1.0, np.nan), RATE_HZ)


def test_a_gap_too_long_for_the_cutoff_is_refused_and_not_made_up():
    samples = np.random.default_rng(3).standard_normal(400_000)
    samples[1000:399_000] = np.nan
    with pytest.raises(ValueError, match="its gaps are too long for its cut-off"):
        WhittakerLowPass(5000.0).apply_with_gaps(samples, RATE_HZ)


@pytest.mark.parametrize("cutoff_hz", [10_000.0, 12_000.0])
def test_a_cutoff_at_or_above_nyquist_is_refused(cutoff_hz):
    with pytest.raises(ValueError, match="needs more than"):
        WhittakerLowPass(cutoff_hz).apply(np.zeros(100), RATE_HZ)


def test_a_cutoff_so_high_that_nothing_falls_to_half_says_so():
    told = WhittakerLowPass(9900.0).describe(RATE_HZ)
    assert told.minus_3_db_hz == 9900.0
    assert told.minus_6_db_hz is None
    assert WhittakerLowPass(300.0).describe(RATE_HZ).parameters["penalty"] == WhittakerLowPass(300.0).penalty(RATE_HZ)
