import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.filters import ChannelFrequencyClass, KaiserLowPass, LowPass, WhittakerLowPass, WienerFilter
from recoil_processing.filters.filter_blocks import filter_in_blocks, overlap_samples

RATE_HZ = 20_000.0
FILTERS = {
    "low pass": LowPass(300.0),
    "low pass of half-order 1": LowPass(300.0, 1),
    "low pass of half-order 7": LowPass(900.0, 7),
    "slow low pass": LowPass(40.0, 6),
    "fast low pass": LowPass(9000.0, 3),
    "low pass padded evenly": LowPass(300.0, padding="even"),
    "low pass without padding": LowPass(300.0, padding_periods=0.0),
    "CFC 60": ChannelFrequencyClass(60),
    "CFC 1000": ChannelFrequencyClass(1000),
    "Kaiser": KaiserLowPass(300.0),
    "Whittaker": WhittakerLowPass(300.0),
    "Wiener": WienerFilter(lambda f: 1.0 / (1.0 + (f / 300.0) ** 6), lambda f: 1e-2 + 0.0 * f),
}
every_filter = pytest.mark.parametrize("zero_phase", FILTERS.values(), ids=FILTERS.keys())


def blocks_of(samples, cuts):
    return np.split(samples, sorted(cuts))


@every_filter
@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(10, 20_000),
    cuts=st.lists(st.integers(0, 20_000), max_size=60),
    drift=st.booleans(),
)
def test_blocks_of_any_lengths_give_what_the_whole_gives(zero_phase, seed, count, cuts, drift):
    samples = np.random.default_rng(seed).standard_normal(count)
    samples = samples.cumsum() if drift else samples
    parts = blocks_of(samples, [c for c in cuts if c <= count])
    result = np.concatenate(list(filter_in_blocks(zero_phase, parts, RATE_HZ)))
    assert result.shape == samples.shape
    assert np.abs(result - zero_phase.apply(samples, RATE_HZ)).max() <= 1e-9 * np.abs(samples).max()


@every_filter
@pytest.mark.parametrize("size", [1, 100, 7000])
def test_channels_stay_beside_each_other(zero_phase, size):
    table = np.random.default_rng(2).standard_normal((8000 if size > 1 else 1500, 3)).cumsum(axis=0)
    parts = (table[i : i + size] for i in range(0, len(table), size))
    result = np.concatenate(list(filter_in_blocks(zero_phase, parts, RATE_HZ)))
    assert np.abs(result - zero_phase.apply(table, RATE_HZ)).max() <= 1e-9 * np.abs(table).max()


@pytest.mark.parametrize("zero_phase", [LowPass(300.0), ChannelFrequencyClass(180)])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6, 1e-8])
def test_a_looser_tolerance_is_kept_to_by_a_shorter_overlap(zero_phase, tolerance):
    # a record that is least like the continuation that the pass backward starts from
    samples = np.where(np.arange(30_000) // 37 % 2, 1.0, -1.0)
    parts = blocks_of(samples, range(501, 30_000, 501))
    result = np.concatenate(list(filter_in_blocks(zero_phase, parts, RATE_HZ, tolerance=tolerance)))
    error = np.abs(result - zero_phase.apply(samples, RATE_HZ)).max()
    assert error <= tolerance
    assert overlap_samples(zero_phase, RATE_HZ, tolerance) < overlap_samples(zero_phase, RATE_HZ, tolerance / 10)


def test_the_overlap_is_what_the_documentation_says():
    periods = overlap_samples(LowPass(300.0), RATE_HZ) * 300.0 / RATE_HZ
    assert 8 < periods < 10


@every_filter
def test_results_come_before_the_record_has_ended(zero_phase):
    fed = []

    def blocks():
        for k in range(300):
            fed.append(k)
            yield np.random.default_rng(k).standard_normal(1000)

    next(filter_in_blocks(zero_phase, blocks(), RATE_HZ))
    assert len(fed) < 150


def test_memory_is_bounded_by_block_and_overlap():
    def blocks(count):
        for k in range(count):
            yield np.random.default_rng(k).standard_normal(20_000)

    peaks = []
    for count in (5, 60):
        sum(block.shape[0] for block in filter_in_blocks(LowPass(300.0), blocks(2), RATE_HZ))
        tracemalloc.start()
        total = sum(block.shape[0] for block in filter_in_blocks(LowPass(300.0), blocks(count), RATE_HZ))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert total == count * 20_000
    needed = 8 * (20_000 + overlap_samples(LowPass(300.0), RATE_HZ))
    assert peaks[1] < 10 * needed
    assert peaks[1] < 1.2 * peaks[0]


def test_blocks_are_taken_as_they_were_when_they_came():
    shared = np.empty(500)
    samples = np.random.default_rng(3).standard_normal(5000)

    def blocks():
        for k in range(10):
            shared[:] = samples[500 * k : 500 * (k + 1)]
            yield shared

    result = np.concatenate(list(filter_in_blocks(LowPass(300.0), blocks(), RATE_HZ)))
    assert np.allclose(result, LowPass(300.0).apply(samples, RATE_HZ), rtol=0, atol=1e-8)


@every_filter
def test_nothing_filtered_is_nothing(zero_phase):
    assert list(filter_in_blocks(zero_phase, [], RATE_HZ)) == []
    assert list(filter_in_blocks(zero_phase, [np.empty(0)], RATE_HZ)) == []


@every_filter
@pytest.mark.parametrize("place", [0, 700, 12_345, 29_999])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_samples_that_are_not_finite_are_refused(zero_phase, place, value):
    samples = np.random.default_rng(4).standard_normal(30_000)
    samples[place] = value
    with pytest.raises(ValueError, match="samples must be finite"):
        list(filter_in_blocks(zero_phase, np.split(samples, 30), RATE_HZ))


def test_blocks_of_other_shapes_are_refused():
    with pytest.raises(ValueError, match=r"shape \(2,\), those before have \(\)"):
        list(filter_in_blocks(LowPass(300.0), [np.zeros(100), np.zeros((100, 2))], RATE_HZ))
    with pytest.raises(ValueError, match="n_samples, n_channels"):
        list(filter_in_blocks(LowPass(300.0), [np.zeros((2, 2, 2))], RATE_HZ))


@pytest.mark.parametrize("tolerance", [0.0, -1.0, 1.0, np.nan])
def test_a_tolerance_that_is_none_is_refused_at_once(tolerance):
    with pytest.raises(ValueError, match="tolerance must be between 0 and 1"):
        filter_in_blocks(LowPass(300.0), [], RATE_HZ, tolerance=tolerance)


@pytest.mark.parametrize("rate_hz", [0.0, 100.0])
def test_a_rate_that_does_not_suit_is_refused_at_once(rate_hz):
    with pytest.raises(ValueError, match=r"rate_hz must be positive|needs more than"):
        filter_in_blocks(LowPass(300.0), [], rate_hz)


def test_spectra_with_a_step_cannot_be_filtered_in_blocks():
    step = WienerFilter(lambda f: 1.0 * (f < 300.0), lambda f: 1.0 * (f >= 300.0))
    with pytest.raises(ValueError, match="steps or corners; filter the record as a whole"):
        filter_in_blocks(step, [], RATE_HZ)


def test_a_filter_that_does_not_tell_its_memory_is_refused():
    with pytest.raises(TypeError, match="a str cannot work in blocks"):
        filter_in_blocks("butter", [], RATE_HZ)
