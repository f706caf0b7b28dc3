"""What is no measurement is masked and counted, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.repairs.dropouts import find_drop_outs


def noisy(seed: int = 1, count: int = 4000, resolution: float = 0.01) -> np.ndarray:
    """Noise of twenty steps of the resolution on a slow wave."""
    rng = np.random.default_rng(seed)
    wave = 5.0 * np.sin(np.arange(count) / 300.0) + rng.normal(0.0, 20 * resolution, count)
    return np.asarray(np.round(wave / resolution) * resolution)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_a_record_without_fault_comes_back_bit_for_bit(seed):
    samples = noisy(seed)
    found = find_drop_outs(samples, 1e-4 * np.arange(samples.size))
    masked, repairs = found.mask(samples)
    assert repairs == ()
    assert found.absent == 0
    assert masked.tobytes() == samples.tobytes()
    assert not found.flags.any()


def test_lost_samples_are_counted_and_stay_lost():
    samples = noisy()
    samples[[10, 11, 500]] = np.nan
    samples[700] = np.inf
    found = find_drop_outs(samples)
    masked, (repair,) = found.mask(samples)
    assert np.flatnonzero(found.flags).tolist() == [10, 11, 500, 700]
    assert np.isnan(masked[[10, 11, 500, 700]]).all()
    assert repair.kind == "drop-outs masked"
    assert repair.sentence == "4 of 4000 samples are left out (4 not recorded), the longest gap 2 samples"
    assert repair.figures["gaps"] == 3


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(8, 60), st.integers(100, 3900))
def test_a_stuck_converter_is_masked_but_for_the_sample_that_it_stuck_at(seed, length, first):
    samples = noisy(seed)
    samples[first + 1 : first + length] = samples[first]
    found = find_drop_outs(samples)
    assert found.held[first + 1 : first + length].all()
    assert not found.held[: first - 1].any()
    assert not found.held[first + length + 1 :].any()
    masked, (repair,) = found.mask(samples)
    assert np.array_equal(masked[~repair.flags], samples[~repair.flags])
    assert "held by a stuck converter" in repair.sentence


def test_clipped_samples_are_not_stuck_ones():
    samples = np.minimum(noisy(), 4.0)
    clipped = samples == 4.0
    assert find_drop_outs(samples).held.any()
    assert not find_drop_outs(samples, spared=clipped).flags.any()


def test_repeats_tell_nothing_where_the_resolution_hides_the_noise():
    coarse = np.round(noisy())
    found = find_drop_outs(coarse)
    assert not found.flags.any()
    assert not find_drop_outs(np.full(500, 3.0)).flags.any()


def test_a_stamp_that_is_off_is_masked_alone():
    samples, times = noisy(), 1e-4 * np.arange(4000)
    times[40] += 3e-5
    found = find_drop_outs(samples, times)
    assert np.flatnonzero(found.mistimed).tolist() == [40]
    assert "1 with a stamp that is off" in found.mask(samples)[1][0].sentence


def test_beside_a_clock_that_jumps_both_samples_are_masked():
    times = 1e-4 * np.arange(4000)
    times[2000:] += 3.3e-5
    assert np.flatnonzero(find_drop_outs(noisy(), times).mistimed).tolist() == [1999, 2000]


def test_samples_that_were_never_recorded_are_counted():
    keep = np.ones(4000, dtype=bool)
    keep[100:107] = keep[900] = False
    found = find_drop_outs(noisy()[keep], (1e-4 * np.arange(4000))[keep])
    assert found.absent == 8
    assert not found.flags.any()


def test_stamps_and_samples_must_fit():
    with pytest.raises(ValueError, match="stamps and samples must be equally many"):
        find_drop_outs(np.zeros(5), np.arange(4.0))
    with pytest.raises(ValueError, match="stamps must increase strictly"):
        find_drop_outs(np.zeros(5), np.zeros(5))
    with pytest.raises(ValueError, match="spared must be equally many"):
        find_drop_outs(np.zeros(5), spared=np.zeros(4, dtype=bool))


@pytest.mark.parametrize("share", [0.002, 0.008, 0.05])
def test_stamps_that_jitter_lose_nothing(share):
    rng = np.random.default_rng(4)
    place = np.arange(21_000)
    samples = noisy(count=place.size)
    for jitter in (rng.standard_normal(place.size), rng.exponential(1.0, place.size), place % 2):
        found = find_drop_outs(samples, 2e-5 * (place + share * jitter))
        assert not found.flags.any()
        assert found.absent <= 1


def test_between_stamps_that_jitter_a_gap_is_counted_and_a_stamp_that_is_off_is_masked():
    rng = np.random.default_rng(5)
    times = 1e-4 * (np.arange(4000) + 0.008 * rng.standard_normal(4000))
    times[900] += 4e-5
    keep = np.ones(4000, dtype=bool)
    keep[100:120] = False
    found = find_drop_outs(noisy()[keep], times[keep])
    assert found.absent == 20
    assert np.flatnonzero(found.mistimed).tolist() == [880]


@pytest.mark.parametrize("rate_hz", [1980.0, 4900.0, 8000.0])
def test_stamps_that_are_rounded_to_ticks_lose_nothing(rate_hz):
    found = find_drop_outs(noisy(), np.round(np.arange(4000) / rate_hz / 1e-4) * 1e-4)
    assert not found.flags.any()
    assert found.absent == 0
