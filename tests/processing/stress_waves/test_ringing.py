import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.filters import LowPass
from recoil_processing.stress_waves.ringing import LONGEST_WINDOW, Mode, free_windows, ringing_modes
from tests.builders.ringing import RATE_HZ, modal_acceleration, ringing_record

TIMES_S = np.arange(10_000) / RATE_HZ - 0.01
FIRST = 500


def ring(frequencies_hz, damping_ratios, *, snr_db: float, seed: int) -> np.ndarray:
    """Modes after three knocks, and noise of the given ratio to the mean power of the first 20 ms."""
    rng = np.random.default_rng(seed)
    knocks = np.array([[0.0, 1.2e-4, 1.0], [8e-3, 1.5e-4, 0.6], [60e-3, 1e-4, 0.8]])
    gains = rng.uniform(0.6, 1.0, len(frequencies_hz))
    waves = modal_acceleration(TIMES_S, np.array(frequencies_hz), np.array(damping_ratios), gains, knocks)
    power = np.mean(waves[FIRST : FIRST + 1000] ** 2)
    return waves + np.sqrt(power * 10 ** (-snr_db / 10)) * rng.standard_normal(waves.size)


def nearest(modes: tuple[Mode, ...], frequency_hz: float) -> Mode:
    return min(modes, key=lambda mode: abs(mode.frequency_hz - frequency_hz))


@pytest.mark.parametrize("seed", range(8))
def test_frequencies_and_damping_are_found_at_20_db(seed):
    rng = np.random.default_rng(100 + seed)
    # neighbours at least a tenth apart: closer ones share their half-power bandwidths
    frequencies = np.array([950.0, 1350.0, 1900.0, 2700.0, 3800.0]) * rng.uniform(0.95, 1.05, 5)
    damping = rng.uniform(0.006, 0.03, 5)
    modes = ringing_modes(ring(frequencies, damping, snr_db=20.0, seed=seed), RATE_HZ, lowest_hz=600.0, first=FIRST)
    for frequency, ratio in zip(frequencies, damping, strict=True):
        mode = nearest(modes, frequency)
        assert mode.frequency_hz == pytest.approx(frequency, rel=0.01)
        assert mode.damping_ratio == pytest.approx(ratio, rel=0.20)


@pytest.mark.exhaustive
@settings(max_examples=15)
@given(st.floats(800.0, 4000.0), st.floats(0.004, 0.04), st.integers(0, 1000))
def test_a_single_mode_is_found_alone(frequency_hz, damping, seed):
    modes = ringing_modes(
        ring([frequency_hz], [damping], snr_db=30.0, seed=seed), RATE_HZ, lowest_hz=500.0, first=FIRST
    )
    assert modes[0].frequency_hz == pytest.approx(frequency_hz, rel=0.01)
    assert modes[0].damping_ratio == pytest.approx(damping, rel=0.20)
    assert sum(mode.energy_share for mode in modes[1:]) < 0.01, "orders beyond the first are noise"


@pytest.mark.parametrize("seed", range(10))
def test_noise_does_not_ring(seed):
    noise = np.random.default_rng(seed).standard_normal(13_000)
    assert ringing_modes(noise, RATE_HZ, lowest_hz=600.0) == ()
    assert ringing_modes(noise - LowPass(400.0).apply(noise, RATE_HZ), RATE_HZ, lowest_hz=600.0) == ()


@pytest.mark.parametrize("seed", range(5))
def test_a_shot_without_ringing_has_no_modes(seed):
    record = ringing_record(seed, ringing=0.0)
    residual = record.recorded_m_s2 - LowPass(450.0).apply(record.recorded_m_s2, RATE_HZ)
    modes = ringing_modes(residual, RATE_HZ, lowest_hz=600.0, recorded=record.recorded_m_s2, first=record.onset_index)
    assert sum(mode.energy_share for mode in modes) < 1e-3


def test_silence_does_not_ring():
    assert ringing_modes(np.zeros(1000), RATE_HZ, lowest_hz=600.0) == ()
    assert ringing_modes(np.ones(40), RATE_HZ, lowest_hz=600.0) == ()


def test_shares_add_up_to_what_rings():
    record = ringing_record(3)
    residual = record.recorded_m_s2 - LowPass(450.0).apply(record.recorded_m_s2, RATE_HZ)
    of_residual = ringing_modes(residual, RATE_HZ, lowest_hz=600.0, first=record.onset_index)
    assert sum(mode.energy_share for mode in of_residual) == pytest.approx(1.0, abs=0.15)
    of_record = ringing_modes(
        residual, RATE_HZ, lowest_hz=600.0, recorded=record.recorded_m_s2, first=record.onset_index
    )
    assert 0.3 < sum(mode.energy_share for mode in of_record) < sum(mode.energy_share for mode in of_residual)
    assert [mode.energy_share for mode in of_record] == sorted((m.energy_share for m in of_record), reverse=True)


@pytest.mark.exhaustive
@settings(max_examples=10)
@given(st.floats(1e-6, 1e6))
def test_the_unit_changes_the_amplitudes_alone(scale):
    samples = ring([1000.0, 2200.0], [0.01, 0.02], snr_db=30.0, seed=1)
    own = ringing_modes(samples, RATE_HZ, lowest_hz=600.0, first=FIRST)
    scaled = ringing_modes(scale * samples, RATE_HZ, lowest_hz=600.0, first=FIRST)
    assert len(own) == len(scaled)
    for a, b in zip(own, scaled, strict=True):
        assert b.frequency_hz == pytest.approx(a.frequency_hz, rel=1e-6)
        assert b.energy_share == pytest.approx(a.energy_share, rel=1e-4)
        assert b.amplitude == pytest.approx(scale * a.amplitude, rel=1e-4)


@pytest.mark.parametrize("stride_rate_hz", [50_000.0, 400_000.0])
def test_the_amplitude_is_that_of_the_sinusoid(stride_rate_hz):
    times = np.arange(round(0.1 * stride_rate_hz)) / stride_rate_hz
    decay = np.exp(-2 * np.pi * 2000.0 * 0.01 * times)
    samples = 7.0 * decay * np.sin(2 * np.pi * 2000.0 * math.sqrt(1 - 0.01**2) * times)
    samples += 1e-3 * np.random.default_rng(1).standard_normal(times.size)
    (mode, *_) = ringing_modes(samples, stride_rate_hz, lowest_hz=800.0)
    # the window begins a little after the knock
    assert mode.amplitude == pytest.approx(7.0, rel=0.15)


@pytest.mark.parametrize("lowest_hz", [0.0, -5.0, 25_000.0, math.nan])
def test_a_lowest_frequency_outside_the_band_is_refused(lowest_hz):
    with pytest.raises(ValueError, match="lowest_hz must be between"):
        ringing_modes(np.zeros(1000), RATE_HZ, lowest_hz=lowest_hz)


def test_a_recorded_signal_of_another_length_is_refused():
    with pytest.raises(ValueError, match="residual and recorded must be equally many"):
        ringing_modes(np.zeros(1000), RATE_HZ, lowest_hz=600.0, recorded=np.zeros(999))


def test_a_shot_outside_the_record_is_refused():
    with pytest.raises(ValueError, match="first 1000 is not one"):
        ringing_modes(np.zeros(1000), RATE_HZ, lowest_hz=600.0, first=1000)


def test_lost_samples_cannot_be_told_from_ringing():
    samples = ring([1000.0], [0.01], snr_db=30.0, seed=1)
    samples[700] = math.nan
    with pytest.raises(ValueError, match="finite"):
        ringing_modes(samples, RATE_HZ, lowest_hz=600.0, first=FIRST)


KNOCK_RATE_HZ = 10_000.0


def rung(instants_s: list[float], *, noise: float = 1e-4) -> np.ndarray:
    times = np.arange(3000) / KNOCK_RATE_HZ
    knocks = np.array([[instant, 2e-4, 1.0] for instant in instants_s])
    waves = modal_acceleration(times, np.array([700.0, 1500.0]), np.array([0.01, 0.02]), np.array([1.0, 0.7]), knocks)
    return waves / np.abs(waves).max() + noise * np.random.default_rng(1).standard_normal(times.size)


@pytest.mark.parametrize("instants_s", [[0.001], [0.001, 0.02], [0.001, 0.0085, 0.03], [0.05, 0.1, 0.15]])
def test_no_window_holds_a_knock_and_each_knock_has_one_behind_it(instants_s):
    windows = free_windows(rung(instants_s), 40)
    for instant in instants_s:
        begin, end = instant * KNOCK_RATE_HZ, (instant + 2e-4) * KNOCK_RATE_HZ
        assert not any(first < begin < last - 1 or first < end < last for first, last in windows)
        assert any(0 <= first - end < 40 for first, _ in windows)


def test_windows_are_long_enough_and_no_longer_than_allowed():
    windows = free_windows(rung([0.001, 0.0085, 0.03]), 40)
    assert all(40 <= last - first <= LONGEST_WINDOW for first, last in windows)
    assert free_windows(rung([0.001, 0.0085, 0.03]), 5000) == ()


def test_what_has_died_away_is_in_no_window():
    windows = free_windows(rung([0.001], noise=0.01), 40)
    # of the slower mode a thousandth is left after 157 ms
    assert max(last for _, last in windows) < 1600
