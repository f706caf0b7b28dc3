"""Lost samples that no low-pass notices are bridged, and what that may have left is told."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.quantities.quantity import UNITS
from recoil_processing.repairs.short_gaps import LARGEST_SHARE, LEFT, LONGEST_GAP, SHAPES, bridge_short_gaps

RATE_HZ = 50e3
COUNT = 6000


@cache
def recorded(seed: int = 1, noise: float = 3.0) -> np.ndarray:
    """Record rest, a pulse of 8 ms that rings, and what comes behind it, with noise."""
    t = np.arange(COUNT) / RATE_HZ
    pulse = 2400.0 * np.sin(np.pi * np.clip((t - 0.05) / 0.008, 0, 1)) ** 2
    ringing = 60.0 * np.sin(2 * np.pi * 3000 * t) * (t > 0.05) * np.exp(-np.clip(t - 0.05, 0, None) / 0.02)
    samples = pulse + ringing + np.random.default_rng(seed).normal(0.0, noise, COUNT)
    samples.flags.writeable = False
    return samples


def holed(samples: np.ndarray, flags: np.ndarray) -> np.ndarray:
    return np.where(flags, np.nan, samples)


def every(k: int, phase: int = 0) -> np.ndarray:
    at = np.arange(COUNT)
    return (at % k == phase % k) & (at > 0) & (at < COUNT - 1)


def at_random(one_in: float, seed: int) -> np.ndarray:
    flags = np.random.default_rng(seed).random(COUNT) < 1.0 / one_in
    flags[[0, -1]] = False
    return flags


def low_passed(samples: np.ndarray, cutoff_hz: float = 1000.0) -> np.ndarray:
    """Fold with a windowed sinc, which shares nothing with the filters under test."""
    taps = np.arange(-150, 151)
    kernel = np.sinc(2 * cutoff_hz / RATE_HZ * taps) * np.hanning(taps.size)
    return np.convolve(samples, kernel / kernel.sum(), mode="same")


def test_without_lost_samples_nothing_is_done():
    samples = recorded()
    done = bridge_short_gaps(samples, 1 / RATE_HZ)
    np.testing.assert_array_equal(done.samples, samples)
    assert done.repairs == ()
    assert done.left == {}


@pytest.mark.parametrize("lost", [every(400), every(97, 13), every(25, 7), every(5, 2), at_random(100, 4)])
def test_a_low_pass_does_not_notice_what_is_bridged(lost):
    samples = recorded()
    done = bridge_short_gaps(holed(samples, lost), 1 / RATE_HZ)
    (repair,) = done.repairs
    assert repair.count == np.count_nonzero(lost)
    np.testing.assert_array_equal(repair.flags, lost)
    moved = low_passed(done.samples) - low_passed(samples)
    assert np.max(np.abs(moved)) < 3 * LARGEST_SHARE * np.ptp(samples)


@pytest.mark.parametrize("one_in", [5, 25, 97])
def test_what_is_left_is_what_the_bridges_really_miss(one_in):
    missed, told = 0.0, 0.0
    for seed in range(12):
        samples, lost = recorded(seed), at_random(one_in, seed)
        done = bridge_short_gaps(holed(samples, lost), 1 / RATE_HZ)
        flags = done.repairs[0].flags
        missed += np.sum((done.samples - samples)[flags] ** 2)
        told += np.sum(done.left[LEFT] ** 2)
    assert 0.8 < np.sqrt(told / missed) < 1.5


def test_a_sum_over_the_shot_moves_by_as_much_as_the_shapes_say_whatever_its_weights():
    missed, left = [], []
    for seed in range(30):
        samples, lost = recorded(seed), at_random(50, seed)
        done = bridge_short_gaps(holed(samples, lost), 1 / RATE_HZ)
        missed.append(np.nan_to_num(done.samples - samples))
        left.append(done.left[LEFT])
    for weights in (np.ones(COUNT), recorded(0, 0.0), np.sin(np.arange(COUNT) / 40.0)):
        told = np.sum((np.array(left) @ weights) ** 2, axis=1)
        assert 0.6 < np.sqrt(np.mean(told) / np.mean((np.array(missed) @ weights) ** 2)) < 1.8


def test_a_long_gap_one_at_an_end_and_one_that_must_stay_are_not_bridged():
    samples, kept = recorded(), np.zeros(COUNT, dtype=bool)
    lost = kept.copy()
    lost[[0, 1, 300, COUNT - 1]] = True
    lost[1000 : 1001 + LONGEST_GAP] = True
    lost[1500 : 1500 + LONGEST_GAP] = True
    kept[300] = True
    done = bridge_short_gaps(holed(samples, lost), 1 / RATE_HZ, kept=kept)
    (repair,) = done.repairs
    assert np.flatnonzero(repair.flags).tolist() == list(range(1500, 1500 + LONGEST_GAP))
    np.testing.assert_array_equal(np.isnan(done.samples), lost & ~repair.flags)


def test_where_the_signal_bends_too_much_a_gap_stays_lost():
    samples = recorded() + np.where(np.arange(COUNT) < 3000, 0.0, 2000.0)
    lost = np.zeros(COUNT, dtype=bool)
    lost[[2000, 2998]] = True
    slow = bridge_short_gaps(holed(samples, lost), 1 / RATE_HZ)
    assert np.flatnonzero(np.isnan(slow.samples)).tolist() == [2998]
    assert np.flatnonzero(slow.repairs[0].flags).tolist() == [2000]


def test_what_misses_by_noise_alone_is_bridged_however_small_the_span():
    noise = np.random.default_rng(2).normal(0.0, 1.0, COUNT)
    done = bridge_short_gaps(holed(noise, every(50, 20)), 1 / 2000.0)
    assert np.isfinite(done.samples).all()


def test_half_of_the_samples_are_no_short_gaps():
    done = bridge_short_gaps(holed(recorded(), every(2, 1)), 1 / RATE_HZ)
    assert done.repairs == ()


def test_the_sentence_says_how_many_and_how_much_in_the_channels_own_unit():
    lost = every(400, 7)
    (repair,) = bridge_short_gaps(1e6 * holed(recorded(), lost), 1 / RATE_HZ, unit="MPa", shown_in=UNITS["MPa"]).repairs
    assert repair.sentence.startswith(f"{np.count_nonzero(lost)} lost samples, at most 1 in a row, are bridged")
    assert f"miss by {repair.figures['largest_error'] / 1e6:.2g} MPa" in repair.sentence
    assert 0 < repair.figures["noise_growth"] < 1


@settings(max_examples=30)
@given(
    lost=st.lists(st.integers(1, 598), max_size=60), scale=st.floats(0.01, 1e6), level=st.floats(-1e3, 1e3),
    sign=st.sampled_from([-1.0, 1.0]),
)  # fmt: skip
def test_measured_samples_stay_and_the_unit_does_not_matter(lost, scale, level, sign):
    samples = recorded()[2300:2900].copy()
    samples[lost] = np.nan
    done = bridge_short_gaps(samples, 1 / RATE_HZ)
    there = np.isfinite(samples)
    np.testing.assert_array_equal(done.samples[there], samples[there])
    flags = done.repairs[0].flags if done.repairs else np.zeros(samples.size, dtype=bool)
    np.testing.assert_array_equal(np.isfinite(done.samples), there | flags)
    for shapes in done.left.values():
        assert shapes.shape == (SHAPES, samples.size)
        assert not shapes[:, ~flags].any()
    other = bridge_short_gaps(sign * scale * (samples + level), 1 / RATE_HZ)
    assert len(other.repairs) == len(done.repairs)
    np.testing.assert_allclose(other.samples, sign * scale * (done.samples + level), rtol=1e-6, atol=1e-6 * scale)
    for cause, shapes in done.left.items():
        np.testing.assert_allclose(other.left[cause], scale * shapes, rtol=1e-6, atol=1e-6 * scale)
