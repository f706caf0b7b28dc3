from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.alignment.aliasing import folded_samples, usual_filter
from recoil_processing.filters.analog_filter import AnalogLowPass

STEP_S = 2e-5
TIMES_S = STEP_S * np.arange(20_000)
OPEN = AnalogLowPass(1e6, "butterworth", 1)
"""A filter that takes nothing away."""


def power_of(reference: np.ndarray, anti_alias: AnalogLowPass = OPEN, *, integral: bool = False) -> float:
    """Mean square of what 1 kHz sampling folds, away from the ends."""
    instants = 1e-3 * np.arange(400)
    folded = folded_samples(instants, 0.0, STEP_S, reference, anti_alias, integral=integral)
    return 0.5 * float(np.mean(folded[100:300] ** 2, axis=0).sum())


@settings(deadline=None, max_examples=20)
@given(st.integers(2, 14), st.floats(-60.0, 60.0), st.floats(0.0, 6.0))
def test_what_lies_above_half_the_rate_is_folded_with_all_its_power(band, off_hz, phase):
    frequency_hz = 125.0 + 250.0 * band + off_hz
    assert power_of(np.sin(2 * np.pi * frequency_hz * TIMES_S + phase)) == pytest.approx(0.5, rel=0.05)


@pytest.mark.parametrize("frequency_hz", [20.0, 150.0, 400.0])
def test_what_lies_below_is_none_of_it(frequency_hz):
    window = np.sin(np.pi * TIMES_S / TIMES_S[-1]) ** 2
    assert power_of(window * np.sin(2 * np.pi * frequency_hz * TIMES_S)) < 1e-4


def test_the_sources_filter_takes_its_share():
    wave = np.sin(2 * np.pi * 1700.0 * TIMES_S)
    weak = AnalogLowPass(300.0, "bessel", 4)
    gain = float(weak.gain(np.array([1700.0]))[0])
    assert 0.0 < gain < 0.02
    assert power_of(wave, weak) == pytest.approx(0.5 * gain**2, rel=0.1)


def test_a_source_of_the_integral_folds_the_integrated_ringing():
    wave = np.sin(2 * np.pi * 1700.0 * TIMES_S)
    assert power_of(wave, integral=True) == pytest.approx(0.5 / (2 * np.pi * 1700.0) ** 2, rel=0.1)


def test_a_reference_that_is_no_faster_folds_nothing():
    assert folded_samples(1e-4 * np.arange(100), 0.0, 1e-3, np.ones(100), usual_filter(1e4)).shape == (100, 0)


def test_instants_beyond_the_record_hold_nothing():
    wave = np.sin(2 * np.pi * 1700.0 * TIMES_S)
    folded = folded_samples(1.0 + 1e-3 * np.arange(50), 0.0, STEP_S, wave, OPEN)
    assert folded.shape[1] > 0
    assert not folded.any()
