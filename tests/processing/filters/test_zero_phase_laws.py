"""Laws that every filter keeps, each filter through the one door."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.filters import ChannelFrequencyClass, LowPass

RATE_HZ = 20_000.0


FILTERS = {
    "low pass": LowPass(300.0),
    "low pass of half-order 2": LowPass(300.0, 2),
    "low pass of half-order 6": LowPass(500.0, 6),
    "CFC 60": ChannelFrequencyClass(60),
    "CFC 180": ChannelFrequencyClass(180),
    "CFC 1000": ChannelFrequencyClass(1000),
}
SEEDS = st.integers(0, 2**32 - 1)
every_filter = pytest.mark.parametrize("zero_phase", FILTERS.values(), ids=FILTERS.keys())


def noise(seed, count=3000):
    return np.random.default_rng(seed).standard_normal(count)


def measured_gain(zero_phase, frequency_hz, rate_hz, count):
    """Amplitude and phase on a sinusoid, far from the ends, by least squares."""
    phase = 2 * np.pi * frequency_hz / rate_hz * np.arange(count)
    inner = slice(count // 3, 2 * count // 3)
    basis = np.column_stack([np.sin(phase), np.cos(phase)])[inner]
    sine, cosine = np.linalg.lstsq(basis, zero_phase.apply(np.sin(phase), rate_hz)[inner], rcond=None)[0]
    return float(sine), float(cosine)


@every_filter
@settings(max_examples=8, deadline=None)
@given(seed=SEEDS, a=st.floats(-1e3, 1e3), b=st.floats(-1e3, 1e3))
def test_a_filter_is_linear(zero_phase, seed, a, b):
    x, y = noise(seed), noise(seed + 1)
    together = zero_phase.apply(a * x + b * y, RATE_HZ)
    apart = a * zero_phase.apply(x, RATE_HZ) + b * zero_phase.apply(y, RATE_HZ)
    assert np.allclose(together, apart, rtol=0, atol=1e-9 * (abs(a) + abs(b) + 1))


@every_filter
@settings(max_examples=8, deadline=None)
@given(seed=SEEDS)
def test_time_reversal_changes_nothing_away_from_the_ends(zero_phase, seed):
    x = noise(seed, 6000)
    forward, backward = zero_phase.apply(x, RATE_HZ), zero_phase.apply(x[::-1], RATE_HZ)[::-1]
    assert np.allclose(forward[2000:4000], backward[2000:4000], rtol=0, atol=1e-7)


@every_filter
@settings(max_examples=8, deadline=None)
@given(seed=SEEDS, shift=st.integers(1, 500))
def test_a_shift_before_is_a_shift_after_away_from_the_ends(zero_phase, seed, shift):
    x = noise(seed, 6000)
    late = zero_phase.apply(np.concatenate([noise(seed + 1, shift), x]), RATE_HZ)[shift:]
    assert np.allclose(late[2000:4000], zero_phase.apply(x, RATE_HZ)[2000:4000], rtol=0, atol=1e-7)


@every_filter
def test_the_response_to_an_impulse_is_symmetric_and_highest_at_it(zero_phase):
    impulse = np.zeros(8001)
    impulse[4000] = 1.0
    response = zero_phase.apply(impulse, RATE_HZ)
    assert np.allclose(response, response[::-1], rtol=0, atol=1e-12)
    assert np.argmax(response) == 4000


@every_filter
@settings(max_examples=15, deadline=None)
@given(level=st.floats(-1e6, 1e6), count=st.integers(10, 400))
def test_a_constant_passes_unchanged_at_any_length(zero_phase, level, count):
    filtered = zero_phase.apply(np.full(count, level), RATE_HZ)
    assert np.allclose(filtered, level, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("zero_phase", "degree"),
    [
        (LowPass(300.0, 1), 1),
        (LowPass(300.0, 2), 3),
        (LowPass(300.0, 4), 7),
        (ChannelFrequencyClass(180), 3),
    ],
)
def test_polynomials_up_to_the_order_of_the_gain_at_zero_pass_unchanged_away_from_the_ends(zero_phase, degree):
    # an amplitude 1 - c f^p has moments that vanish up to p - 1: a polynomial of that degree passes unchanged
    t = np.linspace(-1.0, 1.0, 8001)
    for power in range(degree + 1):
        error = zero_phase.apply(t**power, RATE_HZ) - t**power
        assert np.abs(error[3000:5000]).max() < 1e-10
    error = zero_phase.apply(t ** (degree + 1), RATE_HZ) - t ** (degree + 1)
    if zero_phase != LowPass(300.0, 4):
        assert np.abs(error[3000:5000]).max() > 1e-10


@every_filter
def test_a_straight_line_passes_far_from_the_ends(zero_phase):
    line = np.linspace(-5.0, 20.0, 6001)
    assert np.allclose(zero_phase.apply(line, RATE_HZ)[2000:4000], line[2000:4000], rtol=0, atol=1e-9)


@every_filter
@pytest.mark.parametrize("octaves", [-2.0, -0.7, 0.0, 0.3, 0.8])
def test_the_gain_at_the_rate_is_that_on_a_sine(zero_phase, octaves):
    frequency_hz = zero_phase.describe(RATE_HZ).minus_3_db_hz * 2.0**octaves
    sine, cosine = measured_gain(zero_phase, frequency_hz, RATE_HZ, 12_000)
    assert sine == pytest.approx(float(zero_phase.gain(np.array(frequency_hz), RATE_HZ)), abs=1e-6)
    assert abs(cosine) < 1e-6, "a filter without phase delays no sinusoid"


@every_filter
@pytest.mark.parametrize("rate_hz", [20_000.0, 50_000.0])
def test_the_stated_points_are_where_a_sine_loses_3_and_6_db(zero_phase, rate_hz):
    told = zero_phase.describe(rate_hz)
    for frequency_hz, amplitude in ((told.minus_3_db_hz, math.sqrt(0.5)), (told.minus_6_db_hz, 0.5)):
        sine, _ = measured_gain(zero_phase, frequency_hz, rate_hz, 30_000)
        assert sine == pytest.approx(amplitude, rel=1e-5)


@every_filter
def test_at_high_rates_the_gain_is_that_without_a_rate(zero_phase):
    frequency_hz = np.array([0.0, 20.0, 77.0, 210.0, 333.0])
    expected = zero_phase.gain(frequency_hz)
    assert np.allclose(zero_phase.gain(frequency_hz, 1e5), expected, rtol=0, atol=2e-3)
    assert zero_phase.describe(1e5).minus_3_db_hz == pytest.approx(zero_phase.describe().minus_3_db_hz, rel=2e-3)
    assert zero_phase.describe(1e5).minus_6_db_hz == pytest.approx(zero_phase.describe().minus_6_db_hz, rel=2e-3)


@every_filter
def test_gains_keep_their_shape(zero_phase):
    assert zero_phase.gain(np.full((2, 3), 50.0)).shape == (2, 3)
    assert zero_phase.gain(np.full((2, 3), 50.0), RATE_HZ).shape == (2, 3)


@every_filter
@pytest.mark.parametrize("rate_hz", [12_000.0, 50_000.0])
def test_beyond_the_reach_less_than_a_hundredth_of_a_lasting_disturbance_is_left(zero_phase, rate_hz):
    impulse = np.zeros(20_001)
    impulse[10_000] = 1.0
    response = np.abs(zero_phase.apply(impulse, rate_hz))
    reach = zero_phase.reach_samples(rate_hz)
    assert response[10_001 + reach :].sum() < 0.01
    # and it is no idle bound
    assert response[10_001 + reach // 3 :].sum() > 1e-3


@every_filter
def test_every_column_is_filtered_as_if_it_were_alone(zero_phase):
    table = np.column_stack([noise(1), noise(2), noise(3)])
    for layout in (table, np.asfortranarray(table)):
        together = zero_phase.apply(layout, RATE_HZ)
        assert together.shape == table.shape
        for i in range(3):
            assert np.allclose(together[:, i], zero_phase.apply(table[:, i], RATE_HZ), rtol=0, atol=1e-12)


@every_filter
def test_nothing_is_changed_in_place_and_results_are_new(zero_phase):
    x = noise(4)
    kept = x.copy()
    zero_phase.apply(x, RATE_HZ)[:] = 0.0
    x[100] = np.nan
    kept[100] = np.nan
    filtered, _ = zero_phase.apply_with_gaps(x, RATE_HZ)
    filtered[:] = 0.0
    assert np.array_equal(x, kept, equal_nan=True)


@every_filter
@pytest.mark.parametrize("dtype", [np.float32, np.int16])
def test_other_numbers_are_filtered_in_double_precision(zero_phase, dtype):
    x = (100 * noise(6)).astype(dtype)
    filtered = zero_phase.apply(x, RATE_HZ)
    assert filtered.dtype == np.float64
    assert np.allclose(filtered, zero_phase.apply(x.astype(np.float64), RATE_HZ), rtol=0, atol=1e-9)


@every_filter
@settings(max_examples=10, deadline=None)
@given(seed=SEEDS, begin=st.integers(0, 2999), length=st.integers(1, 300))
def test_samples_that_are_trusted_are_those_without_the_gap(zero_phase, seed, begin, length):
    whole = LowPass(300.0).apply(noise(seed), RATE_HZ)
    whole /= np.abs(whole).max()
    lossy = whole.copy()
    lossy[begin : begin + length] = np.nan
    filtered, trusted = zero_phase.apply_with_gaps(lossy, RATE_HZ)
    reach = zero_phase.reach_samples(RATE_HZ)
    expected = np.ones(3000, dtype=bool)
    expected[max(begin - reach, 0) : begin + length + reach] = False
    assert np.array_equal(trusted, expected)
    assert np.isfinite(filtered).all()
    assert np.allclose(filtered[trusted], zero_phase.apply(whole, RATE_HZ)[trusted], rtol=0, atol=0.02)


@every_filter
def test_without_gaps_everything_is_trusted(zero_phase):
    x = noise(5)
    filtered, trusted = zero_phase.apply_with_gaps(x, RATE_HZ)
    assert trusted.all()
    assert np.array_equal(filtered, zero_phase.apply(x, RATE_HZ))


@every_filter
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("index", [0, 500, 999])
def test_samples_that_are_not_finite_are_refused(zero_phase, value, index):
    x = noise(1, 1000)
    x[index] = value
    with pytest.raises(ValueError, match="samples must be finite"):
        zero_phase.apply(x, RATE_HZ)
    with pytest.raises(ValueError, match="samples must be finite"):
        zero_phase.apply(np.column_stack([noise(2, 1000), x]), RATE_HZ)


@every_filter
def test_infinity_is_no_gap(zero_phase):
    x = noise(1, 1000)
    x[3], x[50] = math.inf, math.nan
    with pytest.raises(ValueError, match="samples must be finite"):
        zero_phase.apply_with_gaps(x, RATE_HZ)


@every_filter
@pytest.mark.parametrize("there", [0, 1])
def test_nothing_is_trusted_of_a_channel_that_is_lost_but_for_a_sample(zero_phase, there):
    x = np.full(100, np.nan)
    x[:there] = 1.0
    filtered, trusted = zero_phase.apply_with_gaps(x, RATE_HZ)
    assert np.isnan(filtered).all()
    assert not trusted.any()


@every_filter
@pytest.mark.parametrize("rate_hz", [0.0, -1.0, math.nan, math.inf])
def test_a_rate_that_is_none_is_refused(zero_phase, rate_hz):
    with pytest.raises(ValueError, match="rate_hz must be positive"):
        zero_phase.apply(np.zeros(100), rate_hz)


@every_filter
def test_nothing_filtered_is_nothing(zero_phase):
    assert zero_phase.apply(np.empty(0), RATE_HZ).shape == (0,)
    assert zero_phase.apply(np.empty((0, 3)), RATE_HZ).shape == (0, 3)


@every_filter
def test_samples_of_three_dimensions_are_refused(zero_phase):
    with pytest.raises(ValueError, match=r"n_samples, n_channels"):
        zero_phase.apply(np.zeros((4, 3, 2)), RATE_HZ)


@every_filter
def test_a_description_survives_json(zero_phase):
    for rate_hz in (None, RATE_HZ):
        told = zero_phase.describe(rate_hz).to_json()
        assert json.loads(json.dumps(told, allow_nan=False)) == told
        assert told["rate_hz"] == rate_hz
        assert told["minus_3_db_hz"] < told["minus_6_db_hz"]
