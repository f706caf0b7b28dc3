"""Hum is fitted in the pre-trigger baseline, taken off the whole record, never where that adds more than it takes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.repairs.hum import subtract_hum
from recoil_processing.repairs.hum_line import HumLine
from recoil_processing.repairs.repair import Repaired

RATE_HZ = 10_000.0
PULSE_S = 0.01


def record(seed: int, *, baseline_s: float = 0.1, hum: float = 1.0, mains_hz: float = 50.03, noise: float = 0.3):
    """Silence, a pulse a hundred times the hum, silence; a hum with its third harmonic; white noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(round((baseline_s + 0.3) * RATE_HZ)) / RATE_HZ
    first, third = rng.uniform(0.0, 2 * np.pi, 2)
    line = hum * np.cos(2 * np.pi * mains_hz * t + first) + 0.4 * hum * np.cos(6 * np.pi * mains_hz * t + third)
    since = (t - baseline_s) / PULSE_S
    pulse = 100.0 * np.where((since > 0) & (since < 1), np.sin(np.pi * np.clip(since, 0, 1)) ** 2, 0.0)
    clean = pulse + noise * rng.standard_normal(t.size)
    return clean + line, clean, t < baseline_s


@pytest.mark.parametrize("mains_hz", [49.9, 60.02])
def test_lines_are_found_and_taken_off_the_pulse_too(mains_hz):
    samples, clean, in_baseline = record(1, mains_hz=mains_hz, baseline_s=0.2)
    hum = subtract_hum(samples, RATE_HZ, in_baseline, unit="Pa")
    assert [line.harmonic for line in hum.lines] == [1, 3]
    assert hum.frequency_hz == pytest.approx(mains_hz, abs=0.1)
    assert hum.amplitude == pytest.approx(math.hypot(1.0, 0.4), rel=0.05)
    assert np.sqrt(np.mean((hum.samples - clean) ** 2)) < 0.1 * np.sqrt(np.mean((samples - clean) ** 2))
    assert abs(hum.samples.max() - clean.max()) < 0.2
    Repaired(samples).then(hum.samples, *hum.repairs)
    assert hum.repairs[0].kind == "hum subtracted"
    assert "was taken off the whole record" in hum.reason
    assert hum.repairs[0].figures["excess_db_1"] > 10


@pytest.mark.exhaustive
def test_what_is_left_is_what_is_said():
    """Errors of frequency and phase over their uncertainties, and the hum that is left over its own."""
    deviations, left, told = [], [], []
    for seed in range(60):
        rng = np.random.default_rng(1000 + seed)
        mains = 50.0 * (1.0 + 0.01 * rng.uniform(-1.0, 1.0))
        samples, clean, in_baseline = record(seed, mains_hz=mains, baseline_s=0.06)
        hum = subtract_hum(samples, RATE_HZ, in_baseline, mains_hz=(50.0,))
        line = hum.lines[0]
        deviations.append((line.frequency_hz - mains) / line.u_frequency_hz)
        left.append((hum.samples - clean)[-1000:])
        told.append(hum.u[-1000:])
    assert 0.7 < np.std(deviations) < 1.3
    assert 0.7 < np.sqrt(np.mean(np.square(left)) / np.mean(np.square(told))) < 1.3


@pytest.mark.exhaustive
def test_far_from_the_baseline_nothing_is_added():
    """Two periods in strong noise, five seconds of record: the phase is lost, and so is the reason to subtract."""
    added, hummed = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        t = np.arange(50_000) / RATE_HZ
        line = np.cos(2 * np.pi * (50 + rng.normal(0, 0.29)) * t + rng.uniform(0, 6.28))
        samples = line + 2.0 * rng.standard_normal(t.size)
        hum = subtract_hum(samples, RATE_HZ, t < 0.06, mains_hz=(50.0,))
        taken = samples - hum.samples
        added.append(np.mean((line - taken).reshape(50, -1) ** 2, axis=1))
        hummed.append(np.mean(line.reshape(50, -1) ** 2, axis=1))
        if hum.lines:
            assert np.all(taken[-10_000:] == 0)
            assert hum.u[-1] == pytest.approx(math.sqrt(0.5 * sum(one.amplitude**2 for one in hum.lines)))
    assert np.mean(added, axis=0) == pytest.approx(np.minimum(np.mean(added, axis=0), 1.1 * np.mean(hummed, axis=0)))
    assert np.mean(added, axis=0)[0] < 0.5 * np.mean(hummed, axis=0)[0]


@settings(max_examples=20)
@given(st.floats(1e-3, 1.0), st.floats(0.0, 2.0), st.floats(0.0, 10.0))
def test_what_is_taken_shrinks_with_the_phase(u_phase, u_hz, since_s):
    line = HumLine(1, 50.0, u_hz, 2.0, 0.01, 0.3, u_phase, 20.0)
    at = np.array([0.0, since_s])
    gain = line.gain_at(at)
    assert np.all(np.diff(gain) <= 0)
    assert np.all(np.abs(line.taken_at(at)) <= gain * 2.0)
    assert np.all(line.u_left_at(at) <= (1 + 1e-12) * 2.0 / math.sqrt(2.0))


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_noise_without_a_hum_comes_back_bit_for_bit(seed):
    samples, _, in_baseline = record(seed, hum=0.0)
    hum = subtract_hum(samples, RATE_HZ, in_baseline)
    if hum.lines:  # one in a hundred by chance, and then it is small
        assert hum.amplitude < 0.2 * 0.3
        return
    assert hum.samples.tobytes() == samples.tobytes()
    assert hum.repairs == ()


@pytest.mark.exhaustive
def test_chance_seldom_makes_a_line():
    found = sum(bool(subtract_hum(*_noise(seed)).lines) for seed in range(100))
    assert found <= 3


def _noise(seed: int) -> tuple[np.ndarray, float, np.ndarray]:
    samples, _, in_baseline = record(seed, hum=0.0, baseline_s=0.05)
    return samples, RATE_HZ, in_baseline


def test_a_baseline_of_less_than_two_periods_is_too_short():
    samples, _, in_baseline = record(2, baseline_s=0.035)
    hum = subtract_hum(samples, RATE_HZ, in_baseline)
    assert not hum.identifiable
    assert hum.samples.tobytes() == samples.tobytes()
    assert hum.reason == (
        "hum cannot be identified: the pre-trigger baseline of 35 ms is shorter than 2 periods of 50 Hz; "
        "lengthen the pre-trigger to 40 ms"
    )
    assert not subtract_hum(samples, RATE_HZ, np.zeros_like(in_baseline)).identifiable
    exactly, _, in_baseline = record(2, baseline_s=0.04)
    assert subtract_hum(exactly, RATE_HZ, in_baseline).identifiable


def test_where_two_mains_look_alike_neither_is_taken_off():
    t = np.arange(4000) / RATE_HZ
    samples = np.cos(2 * np.pi * 54.6 * t) + 0.8 * np.random.default_rng(3).standard_normal(t.size)
    hum = subtract_hum(samples, RATE_HZ, t < 0.0405, mains_hz=(54.0, 55.2))
    assert not hum.identifiable
    assert "do not show whether of 5" in hum.reason
    assert hum.samples.tobytes() == samples.tobytes()


def test_a_baseline_of_zeros_and_one_without_noise_do_no_harm():
    constant = np.full(3000, 0.1)
    assert subtract_hum(constant, RATE_HZ, np.arange(3000) < 1000).samples.tobytes() == constant.tobytes()
    pure, clean, in_baseline = record(4, noise=0.0, baseline_s=0.2)
    assert np.max(np.abs(subtract_hum(pure, RATE_HZ, in_baseline).samples - clean)) < 1e-3


def test_lost_samples_stay_lost():
    samples, clean, in_baseline = record(5, baseline_s=0.2)
    samples[300:330] = samples[2500] = np.nan
    hum = subtract_hum(samples, RATE_HZ, in_baseline)
    assert np.array_equal(np.isnan(hum.samples), np.isnan(samples))
    assert np.nanmax(np.abs(hum.samples - clean)) < 0.3


@pytest.mark.exhaustive
@settings(max_examples=10)
@given(st.integers(-20, 20), st.sampled_from([-1.0, 1.0]))
def test_units_and_sign_do_not_matter(exponent, sign):
    samples, _, in_baseline = record(6)
    factor = sign * 2.0**exponent
    one, other = (subtract_hum(k * samples, RATE_HZ, in_baseline) for k in (1.0, factor))
    assert other.amplitude == pytest.approx(abs(factor) * one.amplitude, rel=1e-6)
    assert other.samples / factor == pytest.approx(one.samples, abs=1e-5)


def test_faults_of_the_caller_are_refused():
    samples, _, in_baseline = record(7)
    with pytest.raises(ValueError, match="samples and in_baseline must be equally many"):
        subtract_hum(samples, RATE_HZ, in_baseline[1:])
    with pytest.raises(ValueError, match="mains_hz must be positive"):
        subtract_hum(samples, RATE_HZ, in_baseline, mains_hz=(0.0,))
