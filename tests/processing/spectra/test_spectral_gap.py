import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.spectra.spectral_gap import (
    ROLL_OFF,
    SpectralGap,
    find_gap,
    gap_of,
    rest_level,
    rise_time_s,
    shot_spectrum,
    shot_window,
)
from recoil_processing.spectra.spectrum import Spectrum
from tests.builders.ringing import RATE_HZ, ringing_record

GRID_HZ = 2.0 ** (np.arange(24 * 6, 24 * 14) / 24)


def spectrum_of(level_db: np.ndarray) -> Spectrum:
    return Spectrum(GRID_HZ, 10.0 ** (level_db / 10.0), 10.0)


def valley_at(frequency_hz: float, depth_db: float) -> Spectrum:
    """A spectrum that falls to a valley and rises by a depth to a hump an octave above it."""
    octaves = np.log2(GRID_HZ / frequency_hz)
    return spectrum_of(np.where(octaves < 0, -12.0 * octaves, depth_db * np.clip(octaves, 0, 1) - 1e-6 * octaves))


@settings(max_examples=40)
@given(st.floats(300.0, 4000.0), st.floats(10.5, 40.0))
def test_the_valley_and_the_shoulder_are_where_they_are(valley_hz, depth_db):
    gap = gap_of(valley_at(valley_hz, depth_db), 200.0, 10.0)
    assert isinstance(gap, SpectralGap)
    step = 2.0 ** (1 / 24)
    assert valley_hz / step <= gap.valley_hz <= valley_hz * step
    # the next point of the grid after the rise
    assert valley_hz * 2 ** (10.0 / depth_db) / step < gap.shoulder_hz < valley_hz * 2 ** (10.0 / depth_db) * step**2
    assert gap.depth_db == pytest.approx(depth_db, abs=1.5)


@settings(max_examples=40)
@given(st.floats(300.0, 4000.0), st.floats(0.0, 9.0))
def test_a_rise_below_the_threshold_is_no_gap(valley_hz, depth_db):
    found = gap_of(valley_at(valley_hz, depth_db), 200.0, 10.0)
    assert isinstance(found, str)
    assert "no gap" in found


def test_a_zero_of_the_pulses_own_spectrum_below_the_search_is_no_gap():
    level = -12.0 * np.log2(GRID_HZ / 100.0)
    level = level - 25.0 * np.exp(-(np.log2(GRID_HZ / 150.0) ** 2) * 100.0)
    assert isinstance(gap_of(spectrum_of(level), 100.0, 10.0), SpectralGap), "without the guard it is taken for one"
    assert isinstance(gap_of(spectrum_of(level), 220.0, 10.0), str)


def test_a_search_beyond_the_spectrum_says_so():
    found = gap_of(valley_at(1000.0, 20.0), 1e6, 10.0)
    assert isinstance(found, str)
    assert "ends at" in found


@pytest.mark.parametrize("ringing", [1.0, 2.0, 3.0])
def test_the_gap_of_a_shot_lies_between_motion_and_lowest_mode(ringing):
    record = ringing_record(0, ringing=ringing)
    gap = find_gap(record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index)
    assert isinstance(gap, SpectralGap)
    assert 300.0 < gap.valley_hz < gap.shoulder_hz < record.frequencies_hz[0]
    assert gap.depth_db > 20.0


def test_a_shot_without_ringing_has_no_gap():
    record = ringing_record(0, ringing=0.0)
    assert isinstance(find_gap(record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index), str)


def test_the_rise_time_is_that_of_the_velocity():
    times = np.arange(20_000) / 1e5 - 0.01
    pulse = np.where((times > 0) & (times < 10e-3), np.sin(np.pi * times / 10e-3), 0.0)
    # (1 - cos(pi t/T)) / 2 is a tenth at 0.2048 T and nine tenths at 0.7952 T
    assert rise_time_s(pulse, 1e5) == pytest.approx(0.5904 * 10e-3, rel=0.01)


def test_ringing_changes_the_rise_time_little():
    record = ringing_record(1, ringing=3.0)
    clean = rise_time_s(record.truth_m_s2, RATE_HZ)
    assert rise_time_s(record.recorded_m_s2, RATE_HZ) == pytest.approx(clean, rel=0.15)


def test_ripple_on_the_rise_counts_and_a_rebound_does_not():
    times = np.arange(1000) / 1e4
    velocity = np.clip((times - 0.01) / 0.01, 0.0, 0.93)
    ripple = velocity - 0.05 * np.exp(-(((times - 0.025) / 0.001) ** 2)) + 0.1 * np.clip((times - 0.05) / 0.01, 0, 0.7)
    rebound = velocity - 0.30 * np.exp(-(((times - 0.025) / 0.001) ** 2)) + 0.1 * np.clip((times - 0.05) / 0.01, 0, 0.7)
    assert rise_time_s(np.diff(ripple), 1e4) > 0.013
    assert rise_time_s(np.diff(rebound), 1e4) < 0.009


def test_a_record_that_begins_in_the_motion_says_so():
    found = rise_time_s(np.r_[5.0, np.full(100, 0.01)], 1e4)
    assert isinstance(found, str)
    assert "no rise" in found


def test_the_window_is_that_around_the_shot_as_far_as_the_record_goes():
    assert shot_window(10_000, 1e4, None) == (0, 10_000)
    assert shot_window(10_000, 1e4, 500) == (450, 1701)
    assert shot_window(1000, 1e4, 20) == (0, 1000)


@pytest.mark.parametrize("onset", [-1, 1000])
def test_an_onset_outside_the_record_is_refused(onset):
    with pytest.raises(ValueError, match="is not one of the record's 1000 samples"):
        shot_window(1000, 1e4, onset)


def test_the_level_at_rest_is_that_before_the_shot():
    window = np.r_[np.full(50, 3.0), np.full(950, 100.0)]
    assert rest_level(window, 50) == 3.0
    assert rest_level(window, None) == 3.0
    assert rest_level(window, 5) == 0.0, "five samples tell no level"


def test_an_offset_changes_nothing():
    record = ringing_record(2)
    first = find_gap(record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index)
    second = find_gap(record.recorded_m_s2 + 500.0, RATE_HZ, onset_index=record.onset_index)
    assert isinstance(first, SpectralGap)
    assert isinstance(second, SpectralGap)
    assert second.valley_hz == first.valley_hz
    assert second.depth_db == pytest.approx(first.depth_db, abs=1e-6)


@settings(max_examples=10)
@given(st.floats(1e-9, 1e9))
def test_the_unit_changes_nothing(scale):
    record = ringing_record(2)
    first = find_gap(record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index)
    second = find_gap(scale * record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index)
    assert isinstance(first, SpectralGap)
    assert isinstance(second, SpectralGap)
    assert second.valley_hz == first.valley_hz
    assert second.depth_db == pytest.approx(first.depth_db, abs=1e-6)


def test_a_few_lost_samples_are_bridged_and_many_are_told():
    record = ringing_record(2)
    lossy = record.recorded_m_s2.copy()
    lossy[3000:3010] = math.nan
    whole = find_gap(record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index)
    bridged = find_gap(lossy, RATE_HZ, onset_index=record.onset_index)
    assert isinstance(whole, SpectralGap)
    assert isinstance(bridged, SpectralGap)
    assert bridged.valley_hz == pytest.approx(whole.valley_hz, rel=0.2)
    lossy[2500:4000] = math.nan
    found = find_gap(lossy, RATE_HZ, onset_index=record.onset_index)
    assert isinstance(found, str)
    assert "lost samples" in found


@pytest.mark.parametrize(
    ("samples", "sentence"),
    [(np.zeros(40), "only 40 samples"), (np.full(1000, 5.0), "constant")],
)
def test_a_record_that_tells_nothing_says_so(samples, sentence):
    found = shot_spectrum(samples, 1e4)
    assert isinstance(found, str)
    assert sentence in found


def test_a_record_sampled_too_slowly_says_so():
    times = np.arange(400) / 100.0 - 1.0
    found = shot_spectrum(np.where((times > 0) & (times < 0.03), 1.0, 0.0), 100.0)
    assert isinstance(found, str)
    assert "samples/s" in found


def test_every_quantity_has_its_rule_and_no_other():
    samples = ringing_record(0).recorded_m_s2
    for quantity in ROLL_OFF:
        assert not isinstance(shot_spectrum(samples, RATE_HZ, onset_index=2000, quantity=quantity), str)
    with pytest.raises(ValueError, match="no rule for the ringing of a temperature"):
        shot_spectrum(samples, RATE_HZ, quantity="temperature")


def test_what_cannot_be_measured_is_refused():
    with pytest.raises(ValueError, match="infinite"):
        shot_spectrum(np.r_[np.zeros(100), math.inf], 1e4)
    with pytest.raises(ValueError, match="rate_hz must be positive"):
        shot_spectrum(np.zeros(100), 0.0)
