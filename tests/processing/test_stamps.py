import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from processing.redundant_alignment import even_stamps as as_once_imported
from processing.stamps import even_stamps


@settings(deadline=None, max_examples=50)
@given(st.floats(-1e4, 1e4), st.floats(1e-4, 1.0), st.integers(2, 300), st.integers(0, 2**32 - 1))
def test_stamps_with_jitter_and_losses_come_to_lie_on_their_line(start_s, step_s, count, seed):
    rng = np.random.default_rng(seed)
    index = np.flatnonzero(rng.random(count) > 0.2)
    assume(index.size > 0)
    true = start_s + step_s * index
    stamps = true + step_s * rng.uniform(-0.1, 0.1, index.size)
    line, scatter_s = even_stamps(stamps)
    assert line.shape == stamps.shape
    assert np.all(np.diff(line) > 0)
    assert np.std(stamps - line) == pytest.approx(scatter_s, abs=1e-12)
    # of a few stamps most steps may be double ones
    if index.size > 50:
        assert scatter_s <= 0.1 * step_s + 1e-9
        assert np.allclose(line, true, rtol=0, atol=0.06 * step_s)
        assert np.allclose(np.diff(line) / np.diff(index), (line[-1] - line[0]) / (index[-1] - index[0]), rtol=1e-6)


def test_the_scatter_is_that_of_the_stamps():
    rng = np.random.default_rng(1)
    _, scatter_s = even_stamps(1e-3 * np.arange(2000) + 8e-5 * rng.standard_normal(2000))
    assert scatter_s == pytest.approx(8e-5, rel=0.05)


def test_normal_jitter_of_a_tenth_of_a_step_is_told_from_lost_samples():
    right = 0
    for seed in range(50):
        rng = np.random.default_rng(seed)
        index = np.flatnonzero(rng.random(2000) > 0.05)
        line, _ = even_stamps(1e-3 * (index + 0.1 * rng.standard_normal(index.size)))
        right += bool(np.allclose(line, 1e-3 * index, rtol=0, atol=3e-5))
    assert right >= 48


def test_a_source_that_does_not_sample_evenly_keeps_its_stamps():
    stamps = np.cumsum(np.random.default_rng(2).exponential(1.0, 200))
    line, scatter_s = even_stamps(stamps)
    assert line is stamps
    assert scatter_s == 0.0


@pytest.mark.parametrize("stamps", [[], [3.0], [0.0, 0.0, 1.0, 2.0]])
def test_too_few_or_doubled_stamps_are_left_as_they_are(stamps):
    given_stamps = np.array(stamps)
    line, scatter_s = even_stamps(given_stamps)
    assert np.array_equal(line, given_stamps)
    assert scatter_s == 0.0


def test_it_is_still_found_where_it_was():
    assert as_once_imported is even_stamps
