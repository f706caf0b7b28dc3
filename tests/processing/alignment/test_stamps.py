from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from recoil_processing.alignment.stamps import EvenStamps, even_stamps, share_at_stamps


@settings(deadline=None, max_examples=50)
@given(st.floats(-1e4, 1e4), st.floats(1e-4, 1.0), st.integers(2, 300), st.integers(0, 2**32 - 1))
def test_stamps_with_jitter_and_losses_come_to_lie_on_their_line(start_s, step_s, count, seed):
    rng = np.random.default_rng(seed)
    index = np.flatnonzero(rng.random(count) > 0.2)
    assume(index.size > 0)
    true = start_s + step_s * index
    stamps = true + step_s * rng.uniform(-0.1, 0.1, index.size)
    found = even_stamps(stamps)
    assert found.times_s.shape == stamps.shape
    assert np.all(np.diff(found.times_s) > 0)
    assert np.std(stamps - found.times_s) == pytest.approx(found.scatter_s, abs=1e-12)
    # of a few stamps most steps may be double ones
    if index.size > 50:
        assert found.even
        assert found.step_s == pytest.approx(step_s, rel=2e-3)
        steps = np.diff(found.times_s) / np.diff(index)
        assert np.allclose(steps, found.step_s, rtol=1e-6)
        # the line is that of the mean, or of the edge of a jitter of 0.1
        assert np.allclose(found.times_s, true, rtol=0, atol=0.13 * step_s)


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=25)
@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.integers(0, 1000))
def test_where_time_begins_and_in_which_unit_it_is_changes_nothing(shift_s, unit, seed):
    rng = np.random.default_rng(seed)
    index = np.flatnonzero(rng.random(400) > 0.05)
    stamps = 1e-3 * (index + 0.2 * rng.exponential(1.0, index.size))
    stamps = np.maximum.accumulate(stamps) + 1e-9 * index
    one, other = even_stamps(stamps), even_stamps(unit * (stamps + shift_s))
    assert (one.even, one.line) == (other.even, other.line)
    assert np.allclose(other.times_s / unit - shift_s, one.times_s, rtol=0, atol=1e-7)


@pytest.mark.exhaustive
def test_a_wait_is_one_sided_and_its_lower_edge_is_the_beat():
    for mean_wait in (0.02, 0.1, 0.3):
        errors, waits = [], []
        for seed in range(8):
            rng = np.random.default_rng(seed)
            index = np.flatnonzero(rng.random(1500) > 0.02)
            found = even_stamps(5.0 + 1e-3 * (index + mean_wait * rng.exponential(1.0, index.size)))
            assert found.line == "lower edge"
            errors.append(np.median(found.times_s - 5.0 - 1e-3 * index))
            waits.append(found.wait_s)
        # late by a small part of the mean wait; the mean of the stamps would be late by all of it
        assert 0.0 < np.mean(errors) < 0.1 * 1e-3 * mean_wait
        assert np.mean(waits) == pytest.approx(1e-3 * mean_wait, rel=0.1)


@pytest.mark.exhaustive
def test_of_two_sided_jitter_the_mean_is_taken_and_its_uncertainty_holds():
    pulls, means = [], 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        found = even_stamps(1e-3 * np.arange(1000) + 5e-5 * rng.standard_normal(1000))
        means += found.line == "mean"
        assert found.scatter_s == pytest.approx(5e-5, rel=0.1)
        pulls += [(found.times_s[500] - 0.5) / found.u_line_s] if found.line == "mean" else []
    assert means >= 28
    assert 0.6 < np.std(pulls) < 1.3


@pytest.mark.exhaustive
@pytest.mark.parametrize("jitter", [0.1, 0.15, 0.2, 0.22])
def test_jitter_up_to_a_fifth_of_a_step_is_told_from_lost_samples(jitter):
    found, wrong = 0, 0
    for seed in range(15):
        rng = np.random.default_rng(seed)
        index = np.flatnonzero(rng.random(1500) > 0.05)
        stamps = np.sort(1e-3 * (index + jitter * rng.standard_normal(index.size)))
        line = even_stamps(stamps)
        if not line.even:
            continue
        found += 1
        off = np.abs(line.times_s - 1e-3 * index) > 0.4e-3
        # beside a gap a stamp may belong to either side of it
        wrong += np.mean(off) > 0.01
        assert np.mean(line.times_s - 1e-3 * index) == pytest.approx(0.0, abs=6e-5)
    assert found >= 14
    assert wrong == 0


@pytest.mark.parametrize("wait", [0.5, 0.8, 1.0, 2.0, 4.0])
def test_a_late_host_is_seen_through_or_left_alone(wait):
    for seed in range(15):
        rng = np.random.default_rng(seed)
        index = np.flatnonzero(rng.random(1000) > 0.03)
        stamps = np.maximum.accumulate(1e-3 * (index + wait * rng.exponential(1.0, index.size)))
        stamps += 1e-9 * np.arange(index.size)
        found = even_stamps(stamps)
        if found.even:
            assert np.mean(np.abs(found.times_s - 1e-3 * index) > 0.5e-3) < 0.15
            assert np.median(found.times_s - 1e-3 * index) == pytest.approx(0.0, abs=1.5e-4)
        else:
            np.testing.assert_array_equal(found.times_s, stamps)


@pytest.mark.exhaustive
@pytest.mark.parametrize("wait", [0.5, 2.0, 4.0])
def test_the_sources_own_count_is_right_however_late_the_host_is(wait):
    errors = []
    for seed in range(15):
        rng = np.random.default_rng(seed)
        index = np.flatnonzero(rng.random(1000) > 0.03)
        stamps = 1e-3 * (index + wait * rng.exponential(1.0, index.size))
        stamps = np.maximum.accumulate(stamps) + 1e-9 * np.arange(index.size)
        found = even_stamps(stamps, 7 + index)
        assert found.line == "lower edge"
        off = found.times_s - 1e-3 * index
        errors.append(np.median(off))
        assert np.ptp(off) < 0.5 * 1e-3 * wait
    # a host that delays in order stays late for long: the shortest wait is part of the way then
    assert 0.0 < np.mean(errors) < 0.45 * 1e-3 * wait
    assert np.std(errors) < 0.15 * 1e-3 * wait


def test_a_count_that_contradicts_itself_is_not_used():
    stamps = 1e-3 * np.arange(100)
    counts = np.arange(100)
    counts[50] = 3
    np.testing.assert_array_equal(even_stamps(stamps, counts).times_s, stamps)
    with pytest.raises(ValueError, match="equally many"):
        even_stamps(stamps, counts[1:])


def test_a_stall_of_the_host_does_not_bend_the_line():
    rng = np.random.default_rng(3)
    index = np.arange(2000)
    stamps = 1e-3 * (index + 0.1 * rng.exponential(1.0, 2000))
    stamps[900:960] = stamps[960] + 1e-7 * np.arange(-60, 0)
    stamps = np.maximum.accumulate(stamps)
    found = even_stamps(stamps)
    assert found.even
    assert np.allclose(found.times_s, 1e-3 * index, rtol=0, atol=2e-5)


def test_a_source_that_does_not_sample_evenly_keeps_its_stamps():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        for stamps in (np.cumsum(rng.exponential(1.0, 200)), np.cumsum(1.0 + 0.1 * rng.standard_normal(1000))):
            found = even_stamps(stamps)
            assert not found.even
            np.testing.assert_array_equal(found.times_s, stamps)
            assert (found.line, found.scatter_s, found.wait_s, found.u_line_s) == ("none", 0.0, 0.0, 0.0)


def test_stamps_that_are_rounded_to_ticks_are_even():
    for drift in (0.0, 2e-6, 6e-5):
        stamps = np.round(1e6 * (1e-3 * (1 + drift) * np.arange(1000))) / 1e6
        found = even_stamps(stamps)
        assert found.even
        assert np.allclose(found.times_s, 1e-3 * (1 + drift) * np.arange(1000), rtol=0, atol=1.1e-6)


@pytest.mark.parametrize("stamps", [[], [3.0], [0.0, 0.0, 1.0, 2.0], [1.0, 1.0]])
def test_too_few_or_doubled_stamps_are_left_as_they_are(stamps):
    given_stamps = np.array(stamps)
    found = even_stamps(given_stamps)
    assert isinstance(found, EvenStamps)
    np.testing.assert_array_equal(found.times_s, given_stamps)
    assert not found.even


@pytest.mark.parametrize("truth", [0.0, 1.0])
def test_the_signals_show_whether_they_were_taken_at_the_stamps_or_on_the_beat(truth):
    rng = np.random.default_rng(6)
    places = np.delete(np.arange(8000), np.r_[200:210, 4000])
    step_s, late_s = 1e-4, 5e-6 * rng.standard_normal(places.size)
    at_s = step_s * places + truth * late_s
    series = [100.0 * np.sin(2 * np.pi * f * at_s) + 0.05 * rng.standard_normal(places.size) for f in (40.0, 800.0)]
    series[1][70] = np.nan
    share, u = share_at_stamps(series, late_s, places, step_s)
    assert u < 0.05
    assert abs(share - truth) < 4 * u


def test_signals_that_are_at_rest_show_nothing_of_their_instants():
    rng = np.random.default_rng(7)
    places, late_s = np.arange(8000), 8e-7 * rng.standard_normal(8000)
    share, u = share_at_stamps([rng.standard_normal(8000)], late_s, places, 1e-4)
    assert share < 3 * u
    assert share_at_stamps([np.zeros(8000)], late_s, places, 1e-4) == (0.0, np.inf)
    assert share_at_stamps([], late_s[:3], places[:3], 1e-4) == (0.0, np.inf)


@pytest.mark.parametrize("pause_s", [0.004, 0.1, 5.0])
@pytest.mark.parametrize("at", [300, 600, 1190])
def test_a_source_that_paused_and_did_not_count_is_not_laid_on_one_line(at: int, pause_s: float) -> None:
    counts = np.arange(1200)
    stamps_s = 1e-3 * counts + np.where(counts >= at, pause_s, 0.0) + 1e-4 * np.random.default_rng(3).random(1200)
    assert not even_stamps(stamps_s, counts).even


def test_stalls_of_a_host_are_seen_through_by_the_count() -> None:
    sent_s = 1e-3 * np.arange(1200)
    stamps_s = np.where((sent_s >= 0.5) & (sent_s < 0.7), 0.7, sent_s) + 1e-6 * np.arange(1200)
    found = even_stamps(stamps_s, np.arange(1200))
    assert found.even
    assert np.ptp(found.times_s - sent_s) < 2e-3
