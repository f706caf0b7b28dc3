import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.quality.clipping_checks import check_out_of_band, noise_left_at_peak, slew_limited_share
from recoil_processing.quality.spectral_checks import (
    check_aliasing,
    check_gap,
    check_hum,
    check_no_gap,
    check_srs_symmetry,
    last_octave_fall_db,
)

RATE_HZ = 50_000.0
COUNT = 10_000
TIMES_S = np.arange(COUNT) / RATE_HZ
FIRE_S = 0.05
IN_BASELINE = TIMES_S < FIRE_S - 1e-3
PULSE = (TIMES_S >= FIRE_S) & (TIMES_S < FIRE_S + 0.1)


def shot(*, ringing: float = 0.5, at_hz: float = 2000.0, noise: float = 0.002, seed: int = 1) -> np.ndarray:
    since = np.maximum(TIMES_S - FIRE_S, 0.0)
    pulse = np.where(since < 0.01, np.sin(np.pi * since / 0.01) ** 2, 0.0)
    rings = ringing * np.sin(2 * np.pi * at_hz * since) * np.exp(-since / 0.01)
    return 1000 * (pulse + rings + noise * np.random.default_rng(seed).normal(size=COUNT))


@settings(deadline=None, max_examples=40)
@given(st.floats(0.0, 3.0), st.floats(800.0, 4000.0), st.floats(1e-4, 0.02), st.integers(0, 2**32 - 1))
def test_sound_shots_that_ring_show_no_clipping_ahead_of_the_recorder_and_no_aliasing(ringing, at_hz, noise, seed):
    samples = shot(ringing=ringing, at_hz=at_hz, noise=noise, seed=seed)
    assert check_out_of_band(samples, IN_BASELINE)[0] == "ok"
    fall = last_octave_fall_db(samples, IN_BASELINE, PULSE, RATE_HZ, 600.0)
    assert check_aliasing(fall, RATE_HZ)[0] == "ok"


def test_a_triangle_of_equal_rates_is_the_slew_rate():
    triangle = 1000 * np.abs(((TIMES_S - FIRE_S) * 500) % 2 - 1)
    samples = np.where(PULSE, triangle, 1000.0) + 0.1 * np.random.default_rng(1).normal(size=COUNT)
    assert slew_limited_share(samples, IN_BASELINE) > 0.9
    assert check_out_of_band(samples, IN_BASELINE)[0] == "warn"


def test_the_part_of_a_sine_at_its_largest_rate_is_small():
    # half of the sine's height lies between the phases in which its rate is 2 % below the largest: sin(acos(0.98))
    samples = 1000 * np.sin(2 * np.pi * 100 * TIMES_S)
    assert slew_limited_share(samples, IN_BASELINE) == pytest.approx(math.sin(math.acos(0.98)), abs=0.05)


def test_an_amplifier_that_is_full_passes_no_noise():
    samples = 1000 * np.tanh(shot(ringing=0.0) * 3 / 1000)
    assert noise_left_at_peak(samples, IN_BASELINE) < 0.1
    verdict, detail = check_out_of_band(samples, IN_BASELINE)
    assert verdict == "warn"
    assert "use a smaller gain before the next shot" in detail
    assert noise_left_at_peak(shot(ringing=0.0), IN_BASELINE) == pytest.approx(1.0, abs=0.4)


@pytest.mark.parametrize("samples", [np.empty(0), np.full(500, np.nan), np.zeros(500), np.ones(10)])
def test_nothing_to_judge_is_no_fault(samples):
    assert check_out_of_band(samples, np.zeros(samples.size, dtype=bool))[0] == "ok"


def test_ringing_near_half_the_sampling_rate_is_folded():
    samples = shot(at_hz=2000.0) + shot(at_hz=23_500.0, ringing=0.3, seed=2)
    fall = last_octave_fall_db(samples, IN_BASELINE, PULSE, RATE_HZ, 600.0)
    verdict, detail = check_aliasing(fall, RATE_HZ)
    assert verdict == "warn"
    assert "raise the sampling rate or lower the anti-alias filter before the next shot" in detail
    assert "12.5 and 25 kHz" in detail


def test_the_spectra_are_those_of_welch_as_scipy_has_them():
    from scipy.signal import welch

    samples = shot(at_hz=2000.0) + shot(at_hz=23_500.0, ringing=0.3, seed=2)
    # 5,000 samples of the pulse and 2,450 before it: windows of 1,024
    frequency, power = welch(samples[PULSE], fs=RATE_HZ, nperseg=1024)
    ringing, last = (frequency >= 600.0) & (frequency < 12_500.0), (frequency >= 12_500.0) & (frequency < 24_500.0)
    expected = 10 * math.log10(np.max(power[ringing]) / np.mean(power[last]))
    assert last_octave_fall_db(samples, IN_BASELINE, PULSE, RATE_HZ, 600.0) == pytest.approx(expected, rel=1e-12)


def test_too_short_or_too_slow_a_record_tells_no_aliasing():
    assert last_octave_fall_db(shot()[:100], IN_BASELINE[:100], ~IN_BASELINE[:100], RATE_HZ, 600.0) is None
    assert last_octave_fall_db(shot(), IN_BASELINE, PULSE, 2000.0, 600.0) is None


@pytest.mark.parametrize(("depth", "verdict"), [(25.0, "ok"), (8.0, "warn"), (math.nan, "warn")])
def test_a_shallow_gap_asks_for_a_cutoff_by_hand(depth, verdict):
    found, detail = check_gap(depth, 700.0, 900.0)
    assert found == verdict
    assert ("choose the cut-off by hand" in detail) == (verdict != "ok")


@pytest.mark.parametrize(("ringing", "verdict"), [(10.0, "ok"), (200.0, "warn")])
def test_what_hardly_rings_needs_no_gap(ringing, verdict):
    found, detail = check_no_gap("no gap: it rises by 2 dB", ringing, 1000.0)
    assert found == verdict
    assert "no gap: it rises by 2 dB" in detail


@pytest.mark.parametrize(("amplitude", "verdict"), [(0.0, "ok"), (1.0, "ok"), (5.0, "warn"), (80.0, "fail")])
def test_hum_is_judged_by_its_share_of_the_peak(amplitude, verdict):
    found, detail = check_hum(amplitude, 50.0, 1000.0, unit="m/s^2")
    assert found == verdict
    assert ("ground loop" in detail) == (verdict != "ok")


def ringing_only(rectified: bool) -> np.ndarray:
    since = np.maximum(TIMES_S - FIRE_S, 0.0)
    rings = sum(size * np.sin(2 * np.pi * f * since) for f, size in ((1300.0, 3.0), (1700.0, 2.0), (2300.0, 2.0)))
    rings = 1000 * rings * np.exp(-since / 0.02)
    return np.maximum(rings, 0.0) if rectified else rings


def test_ringing_that_is_rectified_is_lopsided_and_sound_ringing_is_not():
    assert check_srs_symmetry(ringing_only(False)[2000:], RATE_HZ, 400.0, 7.0)[0] == "ok"
    verdict, detail = check_srs_symmetry(ringing_only(True)[2000:], RATE_HZ, 400.0, 7.0)
    assert verdict in ("warn", "fail")
    assert "clipped on one side" in detail
    turned, detail = check_srs_symmetry(-ringing_only(True)[2000:], RATE_HZ, 400.0, 7.0)
    assert turned == verdict
    assert " -" in detail


@pytest.mark.parametrize(("lowest", "over", "words"), [(400.0, 1.0, "not judged"), (6000.0, 9.0, "no band")])
def test_a_one_sided_pulse_is_not_judged(lowest, over, words):
    verdict, detail = check_srs_symmetry(shot(ringing=0.0), RATE_HZ, lowest, over)
    assert verdict == "ok"
    assert words in detail
