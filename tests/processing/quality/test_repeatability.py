import math

import numpy as np
import pytest

from recoil_processing.filters import LowPass
from recoil_processing.quality.repeatability import ShotPeaks, check_repeat_peaks, shot_peaks

RATE_HZ = 20_000.0
LOW_PASS = LowPass(300.0)


def shot(name: str, height: float, ringing: float) -> ShotPeaks:
    times = np.arange(4000) / RATE_HZ
    since = np.maximum(times - 0.05, 0.0)
    pulse = height * np.where(since < 0.01, np.sin(np.pi * since / 0.01) ** 2, 0.0)
    samples = pulse + ringing * np.sin(2 * np.pi * 2500 * since) * np.exp(-since / 0.02)
    return shot_peaks(name, samples, RATE_HZ, LOW_PASS)


def test_the_filtered_peak_is_the_pulses_and_the_raw_one_what_was_recorded():
    peaks = shot("1", 1000.0, 800.0)
    assert peaks.filtered == pytest.approx(1000.0, rel=0.02)
    assert peaks.raw > 1500.0


def test_raw_peaks_that_spread_by_ringing_are_no_fault():
    verdict, detail = check_repeat_peaks([shot(str(i), 1000.0 + i, 300.0 * i) for i in range(4)])
    assert verdict == "ok"
    assert "what differs is ringing" in detail


def test_a_rigid_body_that_does_not_repeat_is_named_with_the_shot_that_is_furthest_off():
    verdict, detail = check_repeat_peaks([shot(str(i), 1000.0 * (1.3 if i == 2 else 1.0), 10.0) for i in range(5)])
    assert verdict == "warn"
    assert "limit 5 %" in detail
    assert "shot 2 is furthest off" in detail
    assert "before the next shot" in detail


def test_two_shots_are_too_few():
    assert check_repeat_peaks([shot("1", 1.0, 0.0), shot("2", 2.0, 0.0)])[0] == "ok"


@pytest.mark.parametrize("bad", [math.nan, 0.0])
def test_peaks_that_are_no_numbers_are_a_warning(bad):
    assert check_repeat_peaks([ShotPeaks(str(i), bad, bad) for i in range(3)])[0] == "warn"


def test_lost_samples_near_the_peak_do_not_count():
    samples = np.zeros(4000)
    samples[2000:2200] = 100 * np.sin(np.pi * np.arange(200) / 200)
    samples[3000] = np.nan
    assert shot_peaks("1", samples, RATE_HZ, LOW_PASS).filtered == pytest.approx(100.0, rel=0.05)


@pytest.mark.parametrize("there", [0, 1])
def test_a_record_that_lost_all_has_no_peaks(there):
    samples = np.full(100, np.nan)
    samples[:there] = 1.0
    with pytest.raises(ValueError, match=f"{there} of 100 samples are there"):
        shot_peaks("1", samples, RATE_HZ, LOW_PASS)
