import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from recoil_processing.filters import LowPass

RATE_HZ = 20_000.0
SEEDS = st.integers(0, 2**32 - 1)


def noise(seed: int, count: int = 2000) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(count)


def amplitude_gain(low_pass: LowPass, frequency_hz: float, rate_hz: float) -> float:
    """Gain on a sinusoid far from the ends, by least squares on its sine and cosine."""
    count = max(math.ceil(60 * rate_hz / min(low_pass.cutoff_hz, frequency_hz)), 9000)
    phase = 2 * np.pi * frequency_hz / rate_hz * np.arange(count)
    inner = slice(count // 3, 2 * count // 3)
    basis = np.column_stack([np.sin(phase), np.cos(phase)])[inner]
    filtered = low_pass.apply(np.sin(phase), rate_hz)[inner]
    sine, cosine = np.linalg.lstsq(basis, filtered, rcond=None)[0]
    assert abs(cosine) < 1e-6, "a zero-phase filter delays no sinusoid"
    return float(sine)


@settings(deadline=None, max_examples=25)
@given(SEEDS, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(20.0, 5000.0))
def test_the_filter_is_linear(seed, a, b, cutoff_hz):
    low_pass = LowPass(cutoff_hz)
    x, y = noise(seed), noise(seed + 1)
    together = low_pass.apply(a * x + b * y, RATE_HZ)
    apart = a * low_pass.apply(x, RATE_HZ) + b * low_pass.apply(y, RATE_HZ)
    assert np.allclose(together, apart, rtol=0, atol=1e-9 * (abs(a) + abs(b) + 1))


@pytest.mark.parametrize("half_order", [1, 2, 4, 6])
def test_the_impulse_response_is_symmetric(half_order):
    impulse = np.zeros(4001)
    impulse[2000] = 1.0
    response = LowPass(200.0, half_order).apply(impulse, RATE_HZ)
    assert np.allclose(response, response[::-1], rtol=0, atol=1e-12)
    assert np.argmax(response) == 2000


def test_a_symmetric_pulse_peaks_where_it_did():
    times = (np.arange(4001) - 2000) / RATE_HZ
    pulse = np.where(np.abs(times) < 5e-3, np.cos(np.pi * times / 1e-2) ** 2, 0.0)
    assert np.argmax(LowPass(150.0).apply(pulse, RATE_HZ)) == 2000


@settings(deadline=None, max_examples=25)
@given(st.floats(-1e6, 1e6), st.floats(1.0, 9000.0), st.integers(1, 6), st.integers(1, 300))
def test_a_constant_passes_unchanged_at_any_length(level, cutoff_hz, half_order, count):
    filtered = LowPass(cutoff_hz, half_order).apply(np.full(count, level), RATE_HZ)
    assert np.allclose(filtered, level, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("half_order", [1, 2, 4, 6])
@pytest.mark.parametrize("cutoff_hz", [50.0, 300.0, 4000.0, 8500.0])
def test_the_cutoff_is_the_minus_3_db_point_however_near_nyquist(cutoff_hz, half_order):
    gain = amplitude_gain(LowPass(cutoff_hz, half_order), cutoff_hz, RATE_HZ)
    assert gain == pytest.approx(math.sqrt(0.5), rel=0.005)


@pytest.mark.parametrize("frequency_hz", [30.0, 150.0, 250.0, 420.0, 600.0])
def test_the_gain_is_that_of_the_prototype_far_below_nyquist(frequency_hz):
    low_pass = LowPass(300.0)
    expected = float(low_pass.gain(np.array([frequency_hz]))[0])
    assert amplitude_gain(low_pass, frequency_hz, RATE_HZ) == pytest.approx(expected, rel=0.02)


@settings(deadline=None, max_examples=25)
@given(SEEDS, st.floats(100.0, 5000.0), st.integers(1, 6))
def test_time_reversal_changes_nothing_away_from_the_ends(seed, cutoff_hz, half_order):
    low_pass = LowPass(cutoff_hz, half_order)
    x = noise(seed, 4000)
    forward, backward = low_pass.apply(x, RATE_HZ), low_pass.apply(x[::-1], RATE_HZ)[::-1]
    assert np.allclose(forward[1800:2200], backward[1800:2200], rtol=0, atol=1e-5)


def test_every_column_is_filtered_as_if_it_were_alone():
    table = np.column_stack([noise(1), noise(2), noise(3)])
    together = LowPass(300.0).apply(table, RATE_HZ)
    for i in range(3):
        assert np.allclose(together[:, i], LowPass(300.0).apply(table[:, i], RATE_HZ), rtol=0, atol=1e-12)


def test_nothing_is_changed_in_place():
    x = noise(4)
    x[100] = np.nan
    kept = x.copy()
    LowPass(300.0).apply_with_gaps(x, RATE_HZ)
    assert np.array_equal(x, kept, equal_nan=True)
    whole = noise(4)
    kept = whole.copy()
    filtered = LowPass(300.0).apply(whole, RATE_HZ)
    filtered[:] = 0.0
    assert np.array_equal(whole, kept)


@settings(deadline=None, max_examples=25)
@given(SEEDS, st.integers(0, 3999), st.integers(1, 400), st.integers(1, 8))
def test_samples_that_are_trusted_are_those_without_the_gap(seed, begin, length, half_order):
    low_pass = LowPass(400.0, half_order)
    rough = noise(seed, 4000)
    # a bridge may be wrong by as much as the signal itself is large
    signal = LowPass(400.0).apply(rough, RATE_HZ)
    signal /= np.abs(signal).max()
    lossy = signal.copy()
    lossy[begin : begin + length] = np.nan
    filtered, trusted = low_pass.apply_with_gaps(lossy, RATE_HZ)
    reach = low_pass.reach_samples(RATE_HZ)
    expected = np.ones(4000, dtype=bool)
    expected[max(begin - reach, 0) : begin + length + reach] = False
    assert np.array_equal(trusted, expected)
    assert np.allclose(filtered[trusted], low_pass.apply(signal, RATE_HZ)[trusted], rtol=0, atol=0.02)


@pytest.mark.parametrize("half_order", range(1, 9))
@pytest.mark.parametrize("cutoff_hz", [100.0, 2000.0, 7000.0, 9000.0])
def test_beyond_the_reach_less_than_a_hundredth_of_a_lasting_disturbance_is_left(half_order, cutoff_hz):
    low_pass = LowPass(cutoff_hz, half_order)
    impulse = np.zeros(40_001)
    impulse[20_000] = 1.0
    response = np.abs(low_pass.apply(impulse, RATE_HZ))
    assert response[20_001 + low_pass.reach_samples(RATE_HZ) :].sum() < 0.01


@settings(deadline=None, max_examples=50)
@given(st.floats(1.0, 500.0), st.integers(1, 8))
def test_far_below_nyquist_the_reach_is_that_of_the_prototype(cutoff_hz, half_order):
    low_pass = LowPass(cutoff_hz, half_order)
    assert low_pass.reach_samples(RATE_HZ) == pytest.approx(low_pass.reach_s * RATE_HZ, rel=0.05, abs=1)


def test_a_record_shorter_than_the_reach_is_judged_sample_by_sample():
    lossy = np.zeros(100)
    lossy[0] = np.nan
    low_pass = LowPass(400.0)
    _, trusted = low_pass.apply_with_gaps(lossy, RATE_HZ)
    reach = low_pass.reach_samples(RATE_HZ)
    assert reach < 100 < 2 * reach + 1
    assert np.flatnonzero(trusted).tolist() == list(range(reach + 1, 100))


def test_without_gaps_everything_is_trusted():
    x = noise(5)
    filtered, trusted = LowPass(300.0).apply_with_gaps(x, RATE_HZ)
    assert trusted.all()
    assert np.array_equal(filtered, LowPass(300.0).apply(x, RATE_HZ))


@pytest.mark.parametrize("rate_hz", [600.0, 599.0, 100.0])
def test_a_cutoff_at_or_above_nyquist_is_refused(rate_hz):
    with pytest.raises(ValueError, match="needs more than 600 samples/s"):
        LowPass(300.0).apply(np.zeros(100), rate_hz)


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, math.nan, math.inf])
def test_a_rate_that_is_none_is_refused(rate_hz):
    with pytest.raises(ValueError, match="rate_hz must be positive"):
        LowPass(300.0).apply(np.zeros(100), rate_hz)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_samples_that_are_not_finite_are_refused(value):
    x = np.zeros(100)
    x[3] = value
    with pytest.raises(ValueError, match="samples must be finite"):
        LowPass(300.0).apply(x, RATE_HZ)


def test_infinity_is_no_gap():
    x = np.zeros(100)
    x[3], x[50] = math.inf, math.nan
    with pytest.raises(ValueError, match="samples must be finite"):
        LowPass(300.0).apply_with_gaps(x, RATE_HZ)


def test_nothing_filtered_is_nothing():
    assert LowPass(300.0).apply(np.empty(0), RATE_HZ).shape == (0,)
    assert LowPass(300.0).apply(np.empty((0, 3)), RATE_HZ).shape == (0, 3)


@pytest.mark.parametrize("cutoff_hz", [0.0, -1.0, math.nan, math.inf])
def test_a_cutoff_that_is_none_is_refused(cutoff_hz):
    with pytest.raises(ValueError, match="cutoff_hz must be positive"):
        LowPass(cutoff_hz)


@pytest.mark.parametrize("half_order", [0, -2, 2.5])
def test_an_order_that_is_none_is_refused(half_order):
    with pytest.raises(ValueError, match="half_order must be a whole number"):
        LowPass(300.0, half_order)


@pytest.mark.parametrize("half_order", [1, 3, 4])
@pytest.mark.parametrize("count", [2, 5, 199, 200, 201, 3000, 8193])
def test_the_result_is_that_of_scipys_two_passes_over_the_stated_padding(half_order, count):
    low_pass = LowPass(300.0, half_order)
    corner_hz = low_pass.describe(RATE_HZ).minus_6_db_hz
    sections = butter(half_order, corner_hz, fs=RATE_HZ, output="sos")
    x = np.column_stack([noise(7, count), 1e6 * noise(8, count)])
    expected = sosfiltfilt(sections, x, axis=0, padtype="odd", padlen=min(200, count - 1))
    assert np.allclose(low_pass.apply(x, RATE_HZ), expected, rtol=0, atol=1e-12 * np.abs(x).max())


def test_the_padding_is_odd_and_of_three_periods_and_told_so():
    assert LowPass(300.0).describe(RATE_HZ).to_json() == {
        "kind": "butterworth",
        "order": 4,
        "passes": 2,
        "minus_3_db_hz": 300.0,
        "minus_6_db_hz": pytest.approx(LowPass(300.0).corner_hz(RATE_HZ)),
        "padding": "odd",
        "padding_s": 0.01,
        "rate_hz": RATE_HZ,
        "parameters": {},
    }
    assert LowPass(300.0).describe().minus_6_db_hz == LowPass(300.0).design_hz


def test_odd_padding_keeps_a_slope_to_the_very_ends():
    line = np.linspace(0.0, 1.0, 3000)
    assert np.abs(LowPass(300.0).apply(line, RATE_HZ) - line).max() < 1e-4
