import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.filters import LowPass, WienerFilter

RATE_HZ = 20_000.0
FREQUENCY_HZ = np.linspace(0.0, 10_000.0, 2001)


def low(frequency_hz):
    return 1.0 / (1.0 + (frequency_hz / 300.0) ** 6)


def floor(frequency_hz):
    return np.full_like(frequency_hz, 1e-2)


def test_the_gain_is_the_signals_share():
    wiener = WienerFilter(low, floor)
    expected = low(FREQUENCY_HZ) / (low(FREQUENCY_HZ) + 1e-2)
    assert np.allclose(wiener.gain(FREQUENCY_HZ), expected, rtol=1e-12, atol=0)
    assert np.array_equal(wiener.gain(-FREQUENCY_HZ, RATE_HZ), wiener.gain(FREQUENCY_HZ))


def test_spectra_as_arrays_are_spectra_as_functions():
    arrays = WienerFilter.from_spectra(FREQUENCY_HZ, low(FREQUENCY_HZ), floor(FREQUENCY_HZ))
    functions = WienerFilter(low, floor)
    x = np.random.default_rng(1).standard_normal(5000)
    assert np.allclose(arrays.gain(FREQUENCY_HZ), functions.gain(FREQUENCY_HZ), rtol=1e-12, atol=0)
    assert np.allclose(arrays.apply(x, RATE_HZ), functions.apply(x, RATE_HZ), rtol=0, atol=1e-3)


def test_beyond_the_given_frequencies_the_last_density_holds():
    wiener = WienerFilter.from_spectra(np.array([10.0, 100.0]), np.array([3.0, 1.0]), np.array([1.0, 1.0]))
    assert wiener.gain(np.array([0.0, 10.0, 55.0, 100.0, 5000.0])).tolist() == [0.75, 0.75, 2 / 3, 0.5, 0.5]


def test_where_there_is_neither_signal_nor_noise_nothing_passes():
    nothing = WienerFilter(np.zeros_like, np.zeros_like)
    assert nothing.gain(np.array([0.0, 50.0])).tolist() == [0.0, 0.0]
    assert not nothing.apply(np.ones(200), RATE_HZ).any()
    assert nothing.describe(RATE_HZ).minus_3_db_hz == 0.0


def test_without_noise_everything_passes():
    everything = WienerFilter(np.ones_like, np.zeros_like)
    x = np.random.default_rng(2).standard_normal(777)
    assert np.allclose(everything.apply(x, RATE_HZ), x, rtol=0, atol=1e-12)
    assert everything.describe(RATE_HZ).minus_3_db_hz is None
    assert everything.reach_samples(RATE_HZ) == 0


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_low_pass_leaves_less_error_on_what_the_spectra_describe(seed):
    rng = np.random.default_rng(seed)
    count, half = 1 << 15, (1 << 14) + 1
    frequency_hz = np.linspace(0.0, RATE_HZ / 2, half)
    ringing = 1e-3 + 2.0 * np.exp(-(((frequency_hz - 700.0) / 100.0) ** 2))
    spectra = [
        np.sqrt(density) * (rng.standard_normal(half) + 1j * rng.standard_normal(half))
        for density in (low(frequency_hz), ringing)
    ]
    signal, noise = (np.fft.irfft(s, count) for s in spectra)
    inner = slice(2000, -2000)

    def error(zero_phase):
        return float(np.sum((zero_phase.apply(signal + noise, RATE_HZ) - signal)[inner] ** 2))

    wiener = WienerFilter.from_spectra(frequency_hz, low(frequency_hz), ringing)
    assert error(wiener) < min(error(LowPass(cutoff_hz)) for cutoff_hz in np.geomspace(150.0, 1500.0, 15))


def test_the_response_of_spectra_with_steps_reaches_as_far_as_it_does():
    step = WienerFilter(lambda f: 1.0 * (f < 300.0), lambda f: 1.0 * (f >= 300.0))
    assert step.reach_samples(RATE_HZ) > 10_000
    assert WienerFilter(low, floor).reach_samples(RATE_HZ) < 200


def test_the_description_tells_gain_at_zero_and_points():
    told = WienerFilter(low, floor).describe(RATE_HZ)
    assert told.parameters["gain_at_0_hz"] == pytest.approx(1 / 1.01)
    # S / (S + N) = a where S = N a / (1 - a)
    for found, amplitude in ((told.minus_3_db_hz, math.sqrt(0.5)), (told.minus_6_db_hz, 0.5)):
        density = 1e-2 * amplitude / (1 - amplitude)
        assert found == pytest.approx(300.0 * (1 / density - 1) ** (1 / 6), rel=1e-9)


@pytest.mark.parametrize(
    ("frequency_hz", "signal", "noise", "message"),
    [
        ([0.0, 0.0], [1.0, 1.0], [1.0, 1.0], "must increase"),
        ([-1.0, 0.0], [1.0, 1.0], [1.0, 1.0], "must increase, from 0 or above"),
        ([0.0, math.nan], [1.0, 1.0], [1.0, 1.0], "must increase"),
        ([0.0, 1.0], [1.0, -1.0], [1.0, 1.0], "signal density must be finite and not negative"),
        ([0.0, 1.0], [1.0, 1.0], [1.0, math.inf], "noise density must be finite"),
        ([0.0, 1.0], [1.0], [1.0, 1.0], "one shape"),
        ([], [], [], "one shape"),
        ([[0.0]], [[1.0]], [[1.0]], "one shape"),
    ],
)
def test_arrays_that_are_no_spectra_are_refused(frequency_hz, signal, noise, message):
    with pytest.raises(ValueError, match=message):
        WienerFilter.from_spectra(np.array(frequency_hz), np.array(signal), np.array(noise))


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_functions_that_are_no_densities_are_refused(value):
    wiener = WienerFilter(low, lambda f: np.full_like(f, value))
    with pytest.raises(ValueError, match="densities of signal and noise must be finite and not negative"):
        wiener.apply(np.zeros(100), RATE_HZ)
