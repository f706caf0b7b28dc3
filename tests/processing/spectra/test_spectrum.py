import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.spectra.spectrum import (
    BAND_OCTAVES,
    POINTS_PER_OCTAVE,
    TAPERS,
    average_normalised,
    multitaper,
    slepian_tapers,
    smooth,
)

RATE_HZ = 10_000.0


def test_the_density_of_white_noise_is_its_variance_over_the_band():
    spectrum = multitaper(3.0 * np.random.default_rng(1).standard_normal(20_000), RATE_HZ)
    assert np.mean(spectrum.density) == pytest.approx(9.0 / (0.5 * RATE_HZ), rel=0.03)


def test_a_line_keeps_its_power_and_stays_within_the_resolution():
    phase = 2 * np.pi * 1234.0 / RATE_HZ * np.arange(5000)
    spectrum = multitaper(2.0 * np.sin(phase), RATE_HZ)
    step = spectrum.frequency_hz[1]
    near = np.abs(spectrum.frequency_hz - 1234.0) <= spectrum.resolution_hz
    assert np.sum(spectrum.density[near]) * step == pytest.approx(2.0, rel=0.01)
    assert np.sum(spectrum.density[~near]) * step < 0.02


@settings(max_examples=20)
@given(st.integers(16, 6000), st.floats(1e-6, 1e6))
def test_the_integral_is_the_mean_square_weighted_by_the_tapers(count, scale):
    samples = scale * np.random.default_rng(count).standard_normal(count)
    spectrum = multitaper(samples, RATE_HZ)
    weighted = np.mean(np.sum((slepian_tapers(count) * samples) ** 2, axis=1))
    assert np.sum(spectrum.density) * spectrum.frequency_hz[1] == pytest.approx(weighted, rel=1e-9)


@pytest.mark.parametrize("count", [64, 2048, 2049, 15_000])
def test_the_tapers_are_orthonormal_whether_interpolated_or_not(count):
    tapers = slepian_tapers(count)
    assert tapers.shape == (TAPERS, count)
    assert np.allclose(tapers @ tapers.T, np.eye(TAPERS), atol=2e-6)


@pytest.mark.parametrize(("count", "tolerance"), [(64, 1e-12), (2047, 1e-12), (2048, 1e-12), (6000, 1e-5)])
def test_tapers_are_scipys_but_for_their_signs_and_interpolated_ones_nearly(count, tolerance):
    from scipy.signal.windows import dpss

    for mine, theirs in zip(slepian_tapers(count), dpss(count, 4.0, TAPERS), strict=True):
        assert np.max(np.abs(mine * np.sign(mine @ theirs) - theirs)) < tolerance * np.max(np.abs(theirs))


def test_smoothing_keeps_a_flat_density_and_the_power_of_a_band():
    noise = multitaper(np.random.default_rng(2).standard_normal(20_000), RATE_HZ)
    smoothed = smooth(noise)
    assert np.allclose(np.diff(np.log2(smoothed.frequency_hz)), 1.0 / POINTS_PER_OCTAVE)
    centre = np.argmin(np.abs(smoothed.frequency_hz - 1000.0))
    low, high = smoothed.frequency_hz[centre] * 2.0 ** (np.array([-0.5, 0.5]) * BAND_OCTAVES)
    inside = (noise.frequency_hz > low) & (noise.frequency_hz < high)
    assert smoothed.density[centre] == pytest.approx(np.mean(noise.density[inside]), rel=0.02)
    assert np.std(10 * np.log10(smoothed.density[smoothed.frequency_hz > 1000.0])) < 0.6, "many cells to a band"


def test_grids_of_records_of_any_length_share_their_points():
    first = smooth(multitaper(np.random.default_rng(3).standard_normal(3000), RATE_HZ))
    second = smooth(multitaper(np.random.default_rng(4).standard_normal(4100), 25_000.0))
    mean = average_normalised([first, second])
    assert mean.frequency_hz[0] == max(first.frequency_hz[0], second.frequency_hz[0])
    assert mean.frequency_hz[-1] == min(first.frequency_hz[-1], second.frequency_hz[-1])
    assert np.sum(mean.density * mean.frequency_hz) == pytest.approx(1.0)


@settings(max_examples=20)
@given(st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=5))
def test_a_louder_shot_counts_no_more_than_a_quieter_one(scales):
    samples = np.random.default_rng(5).standard_normal(1000)
    alone = average_normalised([smooth(multitaper(samples, RATE_HZ))])
    mean = average_normalised([smooth(multitaper(scale * samples, RATE_HZ)) for scale in scales])
    assert np.allclose(mean.density, alone.density)


def test_an_average_of_nothing_or_of_strangers_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        average_normalised([])
    slow = smooth(multitaper(np.random.default_rng(6).standard_normal(400), 10.0))
    quick = smooth(multitaper(np.random.default_rng(7).standard_normal(400), 1e6))
    with pytest.raises(ValueError, match="no frequency in common"):
        average_normalised([slow, quick])


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, math.nan, math.inf])
def test_a_rate_that_is_none_has_no_spectrum(rate_hz):
    with pytest.raises(ValueError, match="rate_hz must be positive"):
        multitaper(np.zeros(100), rate_hz)


@pytest.mark.parametrize("samples", [np.zeros(15), np.zeros((20, 2))])
def test_too_few_samples_have_no_spectrum(samples):
    with pytest.raises(ValueError, match="at least 16 samples"):
        multitaper(samples, RATE_HZ)


def test_lost_samples_have_no_spectrum():
    samples = np.zeros(100)
    samples[3] = math.nan
    with pytest.raises(ValueError, match="bridge lost samples"):
        multitaper(samples, RATE_HZ)
