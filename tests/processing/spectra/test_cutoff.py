import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import loadmat

from recoil_processing.filters import LowPass
from recoil_processing.spectra.cutoff import choose_cutoff, cutoff_of, share_above, split
from recoil_processing.spectra.spectral_gap import ShotSpectrum, SpectralGap, gap_of, shot_spectrum
from recoil_processing.spectra.spectrum import Spectrum
from tests.builders.ringing import PRE_TRIGGER_S, RATE_HZ, RingingRecord, ringing_record
from tests.builders.shared_data import shared_file

CUTOFFS_HZ = np.geomspace(200.0, 900.0, 40)
SCENARIOS = {
    "once the pulse": {"ringing": 1.0},
    "twice the pulse": {"ringing": 2.0},
    "three times the pulse": {"ringing": 3.0},
    "twice a smooth pulse": {"ringing": 2.0, "smooth": True},
    "modes from 450 Hz": {"ringing": 1.0, "lowest_hz": 450.0},
}


def chosen(record: RingingRecord):
    return choose_cutoff(record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index)


def least_error(record: RingingRecord) -> float:
    """The error behind the best cut-off, chosen knowing the truth."""
    return min(record.error(LowPass(f).apply(record.recorded_m_s2, RATE_HZ)) for f in CUTOFFS_HZ)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_error_is_within_5_percent_of_that_of_the_best_cutoff(scenario):
    found, best, expected = [], [], []
    for seed in range(40, 44):
        record = ringing_record(seed, **SCENARIOS[scenario])
        choice = chosen(record)
        assert choice.confidence == "sure"
        assert choice.low_pass is not None
        found.append(record.error(choice.low_pass.apply(record.recorded_m_s2, RATE_HZ)))
        best.append(least_error(record))
        expected.append(choice.predicted_error)
    limit = 1.08 if scenario == "modes from 450 Hz" else 1.05
    assert np.mean(found) < limit * np.mean(best)
    assert 0.7 < np.mean(expected) / np.mean(found) < 2.5, "the prediction is of the right size"


@pytest.mark.parametrize("ringing", [1.0, 2.0, 3.0])
def test_the_peak_is_kept_in_height_and_time(ringing):
    heights, instants = [], []
    for seed in range(40, 46):
        record = ringing_record(seed, ringing=ringing)
        low_pass = chosen(record).low_pass
        assert low_pass is not None
        filtered = low_pass.apply(record.recorded_m_s2, RATE_HZ)
        heights.append(filtered.max() / record.truth_m_s2.max() - 1.0)
        instants.append((np.argmax(filtered) - np.argmax(record.truth_m_s2)) / RATE_HZ)
    assert abs(np.mean(heights)) < 0.01
    # a pulse that rises in 2 ms and falls in 10 ms leans towards its fall under any symmetric filter
    assert 0.0 < np.mean(instants) < 2.5e-4


def stepped(exponent: float) -> ShotSpectrum:
    """A motion up to 10 kHz, a fall by a power of the frequency up to 100 kHz, and a resonance of 20 dB above."""
    f = np.geomspace(1e3, 4e5, 200)
    below = np.where(f < 1e4, (f / 1e4) ** -4.0, (f / 1e4) ** exponent)
    resonance = below * 10.0 ** (2.0 * np.exp(-0.5 * (np.log(f / 1.4e5) / 0.2) ** 2))
    return ShotSpectrum(Spectrum(f, resonance, 10.0), 1.5e4, 1e-4, 4.0)


@pytest.mark.parametrize(
    ("exponent", "confidence"), [(-4.0, "sure"), (-2.2, "sure"), (-1.8, "doubtful"), (-1.0, "doubtful")]
)
def test_a_gap_above_a_flat_spectrum_parts_ringing_from_ringing_and_is_not_sure(exponent, confidence):
    choice = cutoff_of(stepped(exponent))
    assert choice.depth_db > 10.0
    assert choice.confidence == confidence
    assert ("not sure" in choice.reason) == (confidence == "doubtful")


def test_no_real_sensor_that_has_no_gap_is_given_a_sure_cutoff():
    """A drop tower's six sensors: the resonance of the second one's crystal at 150 kHz is no gap of its motion."""
    path = shared_file("matlab/Unit105_Series1_1.mat")
    table = loadmat(path)["Unit105_Series1_1"]
    choices = [choose_cutoff(column, 1e6) for column in table[:, :6].T]
    sure = [round(choice.cutoff_hz or 0.0) for choice in choices if choice.confidence == "sure"]
    assert sure == [pytest.approx(12_098, rel=0.01)]
    assert choices[1].confidence == "doubtful"
    assert "ringing lies below that frequency as well" in choices[1].reason


@pytest.mark.parametrize("seed", range(40, 44))
@pytest.mark.parametrize("smooth", [False, True])
def test_a_record_without_ringing_is_left_alone(seed, smooth):
    choice = chosen(ringing_record(seed, ringing=0.0, smooth=smooth))
    assert choice.cutoff_hz is None
    assert choice.low_pass is None
    assert choice.nothing_to_take_off
    assert "nothing to take off" in choice.reason


def rumbling(seed: int) -> RingingRecord:
    """A record whose ringing falls as the motion's own spectrum does, from below its highest frequencies on."""
    record = ringing_record(seed, ringing=0.0)
    rumble = np.cumsum(np.random.default_rng(seed).standard_normal(record.times_s.size))
    rumble -= LowPass(100.0).apply(rumble, RATE_HZ)
    rumble *= (record.times_s > 0) * np.exp(-np.maximum(record.times_s, 0.0) / 0.03)
    return replace(record, recorded_m_s2=record.recorded_m_s2 + 600.0 / rumble.std() * rumble)


@pytest.mark.exhaustive
def test_records_without_a_gap_say_so_and_none_is_sure():
    choices = [chosen(rumbling(seed)) for seed in range(20)]
    assert all(choice.confidence != "sure" for choice in choices)
    refused = [choice for choice in choices if choice.cutoff_hz is None]
    assert len(refused) >= 12
    assert all("no gap" in choice.reason or "not worth" in choice.reason for choice in refused)
    assert not any(choice.nothing_to_take_off for choice in refused)
    assert all(choice.predicted_error > 0.2 for choice in choices if choice.cutoff_hz is not None), "and it is told"


@settings(max_examples=10)
@given(st.floats(1e-6, 1e6), st.floats(-1e3, 1e3))
def test_unit_and_offset_change_nothing(scale, offset):
    record = ringing_record(52)
    first = chosen(record)
    second = choose_cutoff(scale * (record.recorded_m_s2 + offset), RATE_HZ, onset_index=record.onset_index)
    assert second.cutoff_hz == pytest.approx(first.cutoff_hz)
    assert second.predicted_error == pytest.approx(first.predicted_error, rel=1e-6)


def test_an_angular_rate_is_integrated_once_less():
    record = ringing_record(53)
    rate = np.cumsum(record.truth_m_s2) / RATE_HZ / 5.0
    noisy = rate + 0.5 * np.cumsum(record.ringing_m_s2) / RATE_HZ
    noisy += 1e-3 * np.random.default_rng(53).standard_normal(rate.size)
    choice = choose_cutoff(noisy, RATE_HZ, onset_index=record.onset_index, quantity="angular_rate")
    assert choice.confidence == "sure"
    assert choice.low_pass is not None
    assert choice.cutoff_hz is not None
    assert choice.cutoff_hz < record.frequencies_hz[0]
    left = np.linalg.norm(choice.low_pass.apply(noisy, RATE_HZ) - rate)
    assert left < 0.1 * np.linalg.norm(noisy - rate)


def test_a_pressure_that_rings_with_its_mounting_is_filtered():
    record = ringing_record(54)
    pressure = 1e5 * np.maximum(record.truth_m_s2, 0.0)
    noise = 5e5 * np.random.default_rng(54).standard_normal(pressure.size)
    choice = choose_cutoff(
        pressure + 1e4 * record.ringing_m_s2 + noise, RATE_HZ, onset_index=record.onset_index, quantity="pressure"
    )
    assert choice.confidence == "sure"
    assert choice.cutoff_hz is not None
    assert 300.0 < choice.cutoff_hz < record.frequencies_hz[0]


def shallow(depth_db: float) -> ShotSpectrum:
    """Motion that falls to a valley at 1 kHz, and a broad hump of ringing."""
    f = 2.0 ** (np.arange(24 * 4, 24 * 15) / 24)
    octaves = np.log2(f / 1000.0)
    level = np.where(octaves < 0, -24.0 * octaves, depth_db * np.minimum(octaves, 1.0))
    level = np.where(octaves > 3, level - 30.0 * (octaves - 3), level)
    return ShotSpectrum(Spectrum(f, 10 ** (level / 10), 5.0), 150.0, 0.01, 4.0)


@pytest.mark.parametrize(
    ("depth_db", "confidence"),
    [(15.0, "sure"), (10.2, "sure"), (9.8, "doubtful"), (6.3, "doubtful"), (5.8, "none"), (0.0, "none")],
)
def test_the_confidence_goes_by_the_depth(depth_db, confidence):
    choice = cutoff_of(shallow(depth_db))
    assert choice.confidence == confidence
    assert ("doubtful" in choice.reason) == (confidence == "doubtful")
    if confidence == "none":
        assert choice.cutoff_hz is None
    else:
        assert choice.depth_db == pytest.approx(depth_db, abs=0.5)
        assert choice.valley_hz == pytest.approx(1000.0, rel=0.05)


def test_the_models_are_what_was_measured_on_their_own_side():
    record = ringing_record(55)
    shot = shot_spectrum(record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index)
    assert isinstance(shot, ShotSpectrum)
    gap = gap_of(shot.spectrum, shot.lowest_hz, 10.0)
    assert isinstance(gap, SpectralGap)
    motion, ringing = split(shot, gap)
    f, density = shot.spectrum.frequency_hz, shot.spectrum.density
    below, beyond = f < 0.84 * gap.valley_hz, f > 1.5 * gap.shoulder_hz
    assert np.array_equal(motion[below], density[below])
    assert np.allclose(ringing[beyond] + np.minimum(motion[beyond], 0.7 * density[beyond]), density[beyond])
    slope = np.diff(np.log(motion[f > gap.valley_hz])) / np.diff(np.log(f[f > gap.valley_hz]))
    assert np.all(slope <= -2.0 + 1e-9)
    assert 0.0 < share_above(shot) < 1.0


def test_a_record_that_allows_no_spectrum_is_refused_in_words():
    choice = choose_cutoff(np.full(1000, 2.0), 1e4)
    assert choice.cutoff_hz is None
    assert choice.reason == "the signal is constant"
    assert math.isnan(choice.predicted_error)


def test_the_onset_is_that_of_the_builder():
    record = ringing_record(0)
    assert record.onset_index == round(PRE_TRIGGER_S * RATE_HZ)
    assert record.times_s[record.onset_index] == pytest.approx(0.0, abs=1e-9)
