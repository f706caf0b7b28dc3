"""Unknown samples of waves are found from the known ones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.repairs.autoregressive import interpolate_unknown, prediction_filter

COUNT = 400


def waves(seed: int = 1, noise: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    t = np.arange(COUNT)
    modes = [np.exp(-z * t) * np.cos(w * t + p) for w, z, p in ((0.31, 2e-3, 0), (0.52, 4e-3, 1), (0.17, 1e-3, 2))]
    return np.asarray(np.sum(modes, axis=0) + noise * rng.standard_normal(COUNT))


def unknown(*runs: tuple[int, int]) -> np.ndarray:
    flags = np.zeros(COUNT, dtype=bool)
    for start, stop in runs:
        flags[start:stop] = True
    return flags


def test_waves_are_continued_far_better_than_by_a_straight_line():
    truth = waves()
    flags = unknown((100, 106), (180, 186), (250, 253))
    found = interpolate_unknown(np.where(flags, 1e9, truth), flags)
    error = np.abs(found.samples - truth)[flags]
    assert error.max() < 0.02 * np.ptp(truth)
    assert found.settled
    assert found.order == 48


def test_the_filter_predicts_a_known_process():
    rng = np.random.default_rng(3)
    process = np.zeros(20_000)
    noise = rng.standard_normal(process.size)
    for i in range(2, process.size):
        process[i] = 1.5 * process[i - 1] - 0.8 * process[i - 2] + noise[i]
    assert prediction_filter(process, 2) == pytest.approx([1.0, -1.5, 0.8], abs=0.02)


def test_bounds_hold():
    truth = waves(noise=0.02)
    flags = unknown((100, 106))
    lowest = np.where(flags, truth.max(), -np.inf)
    found = interpolate_unknown(truth, flags, lowest=lowest)
    assert np.all(found.samples[flags] >= truth.max() * (1 - 1e-9))
    assert found.at_bound > 0
    mirrored = interpolate_unknown(-truth, flags, highest=-lowest)
    assert mirrored.samples == pytest.approx(-found.samples, abs=1e-6)


def test_the_uncertainty_is_about_the_error():
    errors, told = [], []
    for seed in range(30):
        truth = waves(seed, noise=0.05)
        flags = unknown((100, 104), (200, 204))
        found = interpolate_unknown(truth, flags, most_order=12)
        errors.append((found.samples - truth)[flags])
        told.append(found.u[flags])
        assert np.all(found.u[~flags] == 0)
    ratio = np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(told)))
    assert 0.7 < ratio < 1.5


@pytest.mark.exhaustive
@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(20, 370), st.integers(1, 8))
def test_known_samples_are_not_touched(seed, start, length):
    samples = waves(seed, noise=0.1)
    flags = unknown((start, start + length))
    found = interpolate_unknown(samples, flags)
    assert found.samples[~flags].tobytes() == samples[~flags].tobytes()
    assert np.all(np.isfinite(found.samples))


@settings(max_examples=15)
@given(st.floats(1e-6, 1e6), st.floats(-5.0, 5.0))
def test_units_do_not_matter(factor, level):
    samples = waves(noise=0.05)
    flags = unknown((100, 106))
    one = interpolate_unknown(samples, flags, most_order=16)
    other = interpolate_unknown(factor * (samples + level), flags, most_order=16)
    assert other.samples / factor - level == pytest.approx(one.samples, abs=1e-6)
    assert other.u / factor == pytest.approx(one.u, abs=1e-6)


def test_nothing_unknown_is_nothing_to_do_and_too_little_known_is_said():
    samples = waves()
    assert interpolate_unknown(samples, unknown()).samples.tobytes() == samples.tobytes()
    assert np.all(interpolate_unknown(np.full(COUNT, 2.0), unknown((3, 9))).samples == 2.0)
    assert interpolate_unknown(samples[:6], np.arange(6) > 2) == (
        "3 known samples are too few to predict how the signal goes on"
    )


def test_faults_of_the_caller_are_refused():
    with pytest.raises(ValueError, match="known samples must be finite"):
        interpolate_unknown(np.where(unknown((5, 6)), np.nan, waves()), unknown())
    with pytest.raises(ValueError, match="unknown must be equally many"):
        interpolate_unknown(waves(), unknown()[1:])
    with pytest.raises(ValueError, match="most_order must be at least 1"):
        interpolate_unknown(waves(), unknown(), most_order=0)
