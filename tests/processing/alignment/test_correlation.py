import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.alignment.correlation import CoarseLag, coarse_lag
from tests.builders.motions import ONSET_S, velocity

STEP_S = 1e-4


def reference(start_s: float = 0.0, end_s: float = 0.9) -> np.ndarray:
    return velocity(np.arange(start_s, end_s, STEP_S))


def find(times: np.ndarray, source: np.ndarray, other: np.ndarray, start_s: float = 0.0) -> CoarseLag:
    lag = coarse_lag(times, source, start_s, STEP_S, other, step_of_search_s=5e-4)
    assert isinstance(lag, CoarseLag), lag
    return lag


@settings(deadline=None, max_examples=25)
@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(1e-9, 1e9), st.floats(-1e3, 1e3))
def test_a_known_offset_is_found_on_any_clocks_in_any_unit_at_any_level(source_zero, reference_zero, scale, level):
    times = np.arange(1500) / 2000
    source = scale * (velocity(times + 0.05) + level)
    lag = find(times + source_zero, source, reference(), reference_zero)
    assert lag.offset_s == pytest.approx(0.05 + reference_zero - source_zero, abs=6e-4)
    assert 0.999 < lag.correlation <= 1.0 + 1e-9
    assert lag.second_peak < 0.5
    assert not lag.at_search_edge


def test_lost_samples_do_no_harm():
    times = np.arange(1500) / 2000
    source = velocity(times + 0.05)
    source[np.random.default_rng(1).random(1500) < 0.3] = np.nan
    assert find(times, source, reference()).offset_s == pytest.approx(0.05, abs=6e-4)


@pytest.mark.parametrize(("first_s", "last_s"), [(0.12, 0.4), (0.0, 0.2), (ONSET_S + 0.01, ONSET_S + 0.1)])
def test_a_source_that_saw_a_part_of_the_motion_is_placed(first_s, last_s):
    times = np.arange(first_s, last_s, 5e-4)
    lag = find(times - 0.3, velocity(times), reference())
    assert lag.offset_s == pytest.approx(0.3, abs=1e-3)
    assert lag.correlation > 0.99


def test_a_reference_that_begins_in_the_motion_is_placed():
    times = np.arange(1500) / 2000
    part = reference(0.12, 0.8)
    lag = find(times, velocity(times), part - part[0], 0.12)
    assert lag.offset_s == pytest.approx(0.0, abs=1e-3)


def test_a_second_shot_in_the_record_is_a_second_peak():
    times = np.arange(0.0, 2.0, STEP_S)
    two = velocity(times) + velocity(times - 0.9)
    seen = np.arange(1600) / 2000
    lag = find(seen, velocity(seen), two)
    assert lag.correlation - lag.second_peak < 0.03


def test_the_flank_of_a_slow_motion_is_no_second_peak():
    times = np.arange(0.0, 2.0, STEP_S)
    slow = np.where(times < 1.5, np.sin(np.pi * times / 1.5) ** 2, 0.0)
    seen = times[::5]
    lag = find(seen, slow[::5], slow)
    assert lag.correlation > 0.999
    assert lag.second_peak < 0.5


def test_a_lag_at_the_edge_of_the_search_is_marked():
    times = np.arange(0.0, 0.5, 5e-4)
    # the source rises where the reference has just ended: the best lag is the last one
    lag = find(times, times**2, np.arange(0.0, 0.5, STEP_S) ** 0.5)
    assert lag.at_search_edge


@pytest.mark.parametrize(
    ("source", "other", "sentence"),
    [
        (np.zeros(100), reference(), "constant signal"),
        (velocity(np.arange(100) / 200), np.zeros(1000), "constant signal"),
        (np.full(100, np.nan), reference(), "only 0 samples"),
        (velocity(np.arange(100) / 200), np.ones(3), "only 3 samples"),
    ],
)
def test_what_does_not_move_or_is_not_there_gives_a_sentence(source, other, sentence):
    assert sentence in str(coarse_lag(np.arange(100) / 200, source, 0.0, STEP_S, other, step_of_search_s=5e-4))


def test_a_record_shorter_than_the_search_gives_a_sentence():
    times = np.arange(10) * 1e-5
    assert "too short" in str(coarse_lag(times, times, 0.0, STEP_S, reference(), step_of_search_s=5e-4))


def test_times_that_do_not_increase_are_refused():
    times = np.arange(100.0)
    times[50] = times[49]
    with pytest.raises(ValueError, match="increase strictly"):
        coarse_lag(times, np.arange(100.0), 0.0, STEP_S, reference(), step_of_search_s=5e-4)


def test_a_reference_with_lost_samples_is_refused():
    other = reference()
    other[7] = np.nan
    with pytest.raises(ValueError, match="bridge lost samples first"):
        coarse_lag(np.arange(100.0), np.arange(100.0), 0.0, STEP_S, other, step_of_search_s=5e-4)


def test_records_too_long_for_the_search_are_refused():
    times = np.linspace(0.0, 1e5, 100)
    with pytest.raises(ValueError, match="too long to be searched"):
        coarse_lag(times, np.arange(100.0), 0.0, STEP_S, reference(), step_of_search_s=5e-4)
