import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.gaps import bridge, bridged_smoothly, longest_run, near, runs_of

FLAGS = st.lists(st.booleans(), max_size=40).map(lambda flags: np.array(flags, dtype=bool))


def test_bridges_are_straight_and_ends_stand():
    samples = np.array([np.nan, 1.0, np.nan, np.nan, 4.0, np.nan])
    assert bridge(samples).tolist() == [1.0, 1.0, 2.0, 3.0, 4.0, 4.0]


def test_a_bridge_is_a_new_array_and_leaves_the_old_one_alone():
    samples = np.array([1.0, np.nan, 3.0])
    bridge(samples)[:] = 7.0
    assert np.isnan(samples[1])
    whole = np.array([1.0, 2.0])
    assert bridge(whole) is not whole


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=1, max_size=30))
def test_what_is_there_stays_and_nothing_is_missing_afterwards(values):
    samples = np.array(values)
    bridged = bridge(samples, otherwise=0.0)
    there = ~np.isnan(samples)
    assert np.array_equal(bridged[there], samples[there])
    assert np.isfinite(bridged).all()
    if there.any():
        assert bridged.min() >= samples[there].min()
        assert bridged.max() <= samples[there].max()


def test_nothing_to_bridge_from_is_refused_unless_a_value_is_given():
    with pytest.raises(ValueError, match="none of the 3 samples is there"):
        bridge(np.full(3, np.nan))
    assert bridge(np.full(3, np.nan), otherwise=5.0).tolist() == [5.0, 5.0, 5.0]


def test_an_empty_series_is_bridged_already():
    assert bridge(np.empty(0)).size == 0


def test_a_table_is_refused():
    with pytest.raises(ValueError, match=r"shape \(n,\)"):
        bridge(np.zeros((3, 2)))


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=100)
@given(FLAGS, st.integers(0, 60))
def test_near_is_within_the_reach_of_a_flag(flags, reach):
    at = np.flatnonzero(flags)
    expected = [bool(at.size and np.abs(at - i).min() <= reach) for i in range(flags.size)]
    assert near(flags, reach).tolist() == expected


def test_a_negative_reach_is_refused():
    with pytest.raises(ValueError, match="not -1"):
        near(np.zeros(3, dtype=bool), -1)


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=100)
@given(FLAGS)
def test_runs_are_the_flags_and_the_longest_one_is_the_longest_row_of_them(flags):
    again = np.zeros(flags.size, dtype=bool)
    for start, stop in runs_of(flags):
        assert stop > start
        again[start:stop] = True
    assert np.array_equal(again, flags)
    text = "".join("x" if flag else " " for flag in flags)
    start, stop = longest_run(flags)
    assert stop - start == max((len(run) for run in text.split(" ")), default=0)
    assert flags[start:stop].all()


def test_a_short_gap_of_a_smooth_motion_is_bridged_by_a_cubic_and_a_long_one_stays():
    at = np.arange(40.0)
    lost = at**3 / 100.0
    lost[[10, 11, *range(20, 28)]] = np.nan
    found = bridged_smoothly(lost, 3)
    assert found[10:12] == pytest.approx(at[10:12] ** 3 / 100.0, rel=1e-9)
    assert np.isnan(found[20:28]).all()


def test_what_a_smooth_bridge_knows_one_side_of_stays_lost():
    samples = np.array([np.nan, 1.0, 2.0, 3.0, 4.0, np.nan])
    assert np.isnan(bridged_smoothly(samples, 5)).tolist() == np.isnan(samples).tolist()
    assert bridged_smoothly(np.array([1.0, np.nan, 3.0]), 5).tolist()[::2] == [1.0, 3.0]
