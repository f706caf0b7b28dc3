import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import firwin, kaiserord

from recoil_processing.filters import KaiserLowPass

RATE_HZ = 50_000.0


def test_the_reach_is_exact():
    low_pass = KaiserLowPass(500.0)
    impulse = np.zeros(4001)
    impulse[2000] = 1.0
    touched = np.flatnonzero(np.abs(low_pass.apply(impulse, RATE_HZ)) > 1e-15)
    reach = low_pass.reach_samples(RATE_HZ)
    # the window's last weights may be as small as rounding
    assert 0.98 * reach < 2000 - touched[0] <= reach
    assert 0.98 * reach < touched[-1] - 2000 <= reach


@settings(max_examples=12, deadline=None)
@given(st.floats(80.0, 4000.0), st.floats(0.15, 1.0), st.floats(40.0, 100.0), st.sampled_from([20_500.0, 50_000.0]))
def test_cutoff_stop_band_and_pass_band_are_where_they_are_stated(cutoff_hz, transition, attenuation_db, rate_hz):
    low_pass = KaiserLowPass(cutoff_hz, transition, attenuation_db)
    assert float(low_pass.gain(np.array(cutoff_hz), rate_hz)) == pytest.approx(math.sqrt(0.5), abs=1e-8)
    edge_hz = low_pass.describe(rate_hz).minus_6_db_hz
    half = 0.5 * transition * cutoff_hz
    ripple = 10 ** (-(attenuation_db - 1.5) / 20)
    stop = low_pass.gain(np.linspace(min(edge_hz + half, rate_hz / 2), rate_hz / 2, 400), rate_hz)
    assert np.abs(stop).max() < ripple
    if edge_hz > half:
        assert np.abs(low_pass.gain(np.linspace(0.0, edge_hz - half, 400), rate_hz) - 1.0).max() < 2 * ripple


def test_the_length_is_kaisers():
    taps, shape = kaiserord(60.0, 250.0 / (RATE_HZ / 2))
    low_pass = KaiserLowPass(500.0)
    assert abs(2 * low_pass.reach_samples(RATE_HZ) + 1 - taps) <= 2
    reach = low_pass.reach_samples(RATE_HZ)
    edge_hz = low_pass.describe(RATE_HZ).minus_6_db_hz
    side = firwin(2 * reach + 1, edge_hz, window=("kaiser", shape), fs=RATE_HZ)[reach:]
    # the corner of the design is that of half the amplitude but for the pass band's ripple
    assert np.allclose(low_pass.weights(RATE_HZ), side, rtol=0, atol=1e-4 * side[0])


@pytest.mark.parametrize("count", [1, 2, 5, 100, 364, 800])
def test_records_shorter_than_the_reach_are_continued_over_and_over(count):
    low_pass = KaiserLowPass(500.0)
    line = np.linspace(3.0, 7.0, count)
    assert np.allclose(low_pass.apply(line, RATE_HZ), line, rtol=0, atol=1e-12)


def test_long_records_are_convolved_with_the_stated_weights():
    x = np.random.default_rng(1).standard_normal(30_000)
    side = KaiserLowPass(500.0).weights(RATE_HZ)
    expected = np.convolve(x, np.concatenate([side[:0:-1], side]), mode="same")
    reach = side.size - 1
    assert np.allclose(KaiserLowPass(500.0).apply(x, RATE_HZ)[reach:-reach], expected[reach:-reach], rtol=0, atol=1e-12)


def test_weights_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        KaiserLowPass(500.0).weights(RATE_HZ)[0] = 0.0


def test_a_transition_beyond_nyquist_is_refused():
    with pytest.raises(ValueError, match=r"up to 600 Hz needs more than 1200 samples/s, not 1100"):
        KaiserLowPass(400.0).apply(np.zeros(100), 1100.0)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ((0.0,), "cutoff_hz must be positive"),
        ((math.nan,), "cutoff_hz must be positive"),
        ((300.0, 0.0), "transition must be above 0 and at most 1"),
        ((300.0, 1.1), "transition must be above 0 and at most 1"),
        ((300.0, 0.5, 39.0), "attenuation_db must be at least 40"),
        ((300.0, 0.5, math.inf), "attenuation_db must be at least 40"),
    ],
)
def test_parameters_that_make_no_filter_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        KaiserLowPass(*parameters)
