import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter, lsim

from recoil_processing.stress_waves.shock_response import (
    QUALITY_FACTOR,
    absolute_acceleration_filter,
    octave_frequencies,
    shock_response,
)

RATE_HZ = 20_000.0


def half_sine(duration_s: float, peak: float = 1.0, rate_hz: float = RATE_HZ) -> np.ndarray:
    count = round(duration_s * rate_hz)
    return np.concatenate([np.zeros(50), peak * np.sin(np.pi * np.arange(count) / count), np.zeros(2000)])


@settings(deadline=None, max_examples=30)
@given(st.floats(20.0, 2000.0), st.floats(2.0, 50.0), st.integers(0, 2**32 - 1))
def test_the_response_is_that_of_the_differential_equation_for_an_acceleration_that_is_straight_between_samples(
    frequency_hz, quality, seed
):
    base = np.random.default_rng(seed).normal(size=300)
    base[0] = 0.0
    w, zeta = 2 * np.pi * frequency_hz, 1 / (2 * quality)
    # absolute acceleration over base acceleration: (2 zeta w s + w^2) / (s^2 + 2 zeta w s + w^2)
    _, exact, _ = lsim(([2 * zeta * w, w**2], [1, 2 * zeta * w, w**2]), base, np.arange(300) / RATE_HZ, interp=True)
    b, a = absolute_acceleration_filter(frequency_hz, RATE_HZ, quality)
    np.testing.assert_allclose(lfilter(b, a, base), exact, rtol=0, atol=1e-8 * np.abs(exact).max())


def test_a_stiff_system_follows_the_pulse_and_has_no_negative_side():
    response = shock_response(half_sine(0.01), RATE_HZ, np.array([2000.0]))
    assert response.positive[0] == pytest.approx(1.0, abs=0.06)
    assert response.negative[0] < 0.05
    assert response.ratio_db[0] > 20


def test_a_soft_system_answers_to_the_velocity_alone_and_to_either_side_alike():
    pulse = half_sine(0.001)
    frequency = 20.0
    response = shock_response(pulse, RATE_HZ, np.array([frequency]), quality=1e4)
    velocity = pulse.sum() / RATE_HZ
    assert response.positive[0] == pytest.approx(2 * np.pi * frequency * velocity, rel=0.01)
    assert response.ratio_db[0] == pytest.approx(0.0, abs=0.1)


def test_undamped_the_half_sine_has_the_textbook_peak():
    # largest amplification of a half-sine pulse without damping: 1.768 at f T = 0.81
    frequencies = np.linspace(60.0, 110.0, 101)
    response = shock_response(half_sine(0.01), RATE_HZ, frequencies, quality=1e6)
    best = int(np.argmax(response.positive))
    assert response.positive[best] == pytest.approx(1.768, abs=0.004)
    assert frequencies[best] * 0.01 == pytest.approx(0.81, abs=0.02)


def test_a_steady_sine_is_amplified_by_the_quality_at_resonance():
    times = np.arange(40_000) / RATE_HZ
    response = shock_response(np.sin(2 * np.pi * 200.0 * times), RATE_HZ, np.array([200.0]))
    assert response.positive[0] == pytest.approx(np.sqrt(QUALITY_FACTOR**2 + 1), rel=0.01)


def test_turning_the_sensor_swaps_the_sides():
    base, frequencies = half_sine(0.004), octave_frequencies(50.0, 2000.0)
    there, back = (shock_response(sign * base, RATE_HZ, frequencies) for sign in (1, -1))
    np.testing.assert_allclose(there.positive, back.negative, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(there.ratio_db, -back.ratio_db, atol=1e-6)


def test_octaves_have_twelve_points_and_an_empty_band_has_none():
    frequencies = octave_frequencies(10.0, 80.0)
    assert frequencies.size == 37
    assert frequencies[0] == 10.0
    assert frequencies[-1] == pytest.approx(80.0)
    np.testing.assert_allclose(frequencies[12:] / frequencies[:-12], 2.0)
    for low, high in ((80.0, 10.0), (0.0, 10.0), (-1.0, 10.0), (1.0, np.inf)):
        assert octave_frequencies(low, high).size == 0


@pytest.mark.parametrize(
    ("frequency", "rate", "quality", "words"),
    [(0.0, 1e3, 10.0, "must be positive"), (10.0, np.inf, 10.0, "must be positive"), (10.0, 1e3, 0.5, "above 0.5")],
)
def test_parameters_out_of_their_range_are_refused(frequency, rate, quality, words):
    with pytest.raises(ValueError, match=words):
        absolute_acceleration_filter(frequency, rate, quality)


def test_lost_samples_are_refused():
    with pytest.raises(ValueError, match="bridge lost samples first"):
        shock_response(np.array([0.0, np.nan]), RATE_HZ, np.array([10.0]))
