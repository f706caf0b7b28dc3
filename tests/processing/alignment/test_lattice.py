from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.alignment.lattice import count_steps, find_lattice


@settings(deadline=None, max_examples=30)
@given(st.floats(1e-5, 1e3), st.floats(0.0, 0.2), st.floats(0.0, 0.3), st.integers(0, 2**32 - 1))
def test_the_period_of_a_lattice_is_found_through_jitter_and_gaps(period_s, jitter, lost, seed):
    rng = np.random.default_rng(seed)
    index = np.flatnonzero(rng.random(400) >= lost)
    stamps = np.sort(period_s * (index + jitter * rng.standard_normal(index.size)))
    found = find_lattice(stamps)
    assert found is not None
    assert found.frequency_hz * period_s == pytest.approx(1.0, abs=1e-2 * (0.01 + jitter))


@pytest.mark.parametrize("share", [0.1, 0.25])
def test_strangers_between_the_pulses_do_not_hide_the_lattice(share):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        stamps = np.sort(np.concatenate([1e-3 * np.arange(500), rng.uniform(0.0, 0.5, int(500 * share))]))
        found = find_lattice(stamps)
        assert found is not None
        assert found.frequency_hz == pytest.approx(1e3, rel=1e-4)


def test_instants_without_a_lattice_have_none():
    found = [find_lattice(np.cumsum(np.random.default_rng(s).exponential(1.0, 300))) for s in range(100)]
    assert sum(f is not None for f in found) == 0


@settings(deadline=None, max_examples=30)
@given(st.integers(12, 300), st.floats(0.0, 0.5), st.integers(0, 2**32 - 1))
def test_without_jitter_every_gap_is_counted(count, lost, seed):
    rng = np.random.default_rng(seed)
    index = np.flatnonzero(rng.random(count) >= lost)
    if index.size < 12 or np.median(np.diff(index)) != 1:
        return
    places = count_steps(3.0 + 0.01 * index)
    assert places is not None
    assert np.array_equal(places, index - index[0])


def test_a_long_gap_is_counted_by_the_period_of_all_stamps():
    rng = np.random.default_rng(5)
    index = np.concatenate([np.arange(300), np.arange(700, 1000)])
    places = count_steps(1e-3 * (index + 0.02 * rng.standard_normal(index.size)))
    assert places is not None
    assert np.array_equal(places, index)


def test_a_burst_read_at_once_is_no_lattice():
    for seed in range(10):
        rng = np.random.default_rng(seed)
        arrivals = np.cumsum(rng.exponential(0.02, 60))
        stamps = np.sort(np.concatenate([arrivals + 1e-6 * i for i in range(20)]))
        assert find_lattice(stamps) is None


@pytest.mark.parametrize("shift", [0.45, 0.5])
def test_a_beat_that_shifts_by_half_a_step_is_not_taken_for_one_of_twice_the_rate(shift):
    rng = np.random.default_rng(8)
    slow = 1.0013 * np.arange(400)
    even = slow[-1] + 1 + np.arange(1150)
    shifted = even[-1] + 1 - shift + (1 - 2e-5) * np.arange(980)
    places = count_steps(5e-4 * np.concatenate([slow, even + 0.05 * rng.exponential(1.0, even.size), shifted]))
    # whether one beat is seen in it or none: nothing is missing between neighbours
    assert places is None or np.count_nonzero(np.diff(places) != 1) < 5
