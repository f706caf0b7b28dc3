from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import IdentificationError
from recoil_processing.shot.regression import FREE_TRAVEL_M, end_of_travel, release_index, stop_release_impulse

TIMES = 1e-3 * np.arange(200)


def test_the_release_is_the_first_of_ten_driving_samples():
    force = np.where(np.arange(200) < 60, -10e3, 50e3)
    force[[40, 45, 46]] = 1e3  # noise
    assert release_index(TIMES, force, 0.030) == 60


def test_before_the_onset_nothing_is_released():
    force = np.full(200, 5e3)
    assert release_index(TIMES, force, 0.050) == 50


def test_a_lost_sample_does_not_drive():
    force = np.where(np.arange(200) < 60, -10e3, 50e3)
    force[55:75] = np.nan
    assert release_index(TIMES, force, 0.030) == 75


@pytest.mark.parametrize(
    ("force", "found"), [(np.full(200, -3e3), "at most -3.0 kN"), (np.full(200, np.nan), "no sample of all three")]
)
def test_a_part_that_is_never_driven_is_an_error_that_says_where_to_look(force, found):
    with pytest.raises(IdentificationError, match=found) as caught:
        release_index(TIMES, force, 0.030)
    assert "areas, units and polarities" in str(caught.value)


def test_a_stop_pushes_with_what_it_held_at_most_until_the_part_has_left_it():
    times = 1e-5 * np.arange(20_000)
    force = np.interp(times, [0.0, 0.03, 0.09, 0.2], [-10e3, -10e3, 50e3, 50e3])
    found = stop_release_impulse(times, force, 0.030, mass_kg=500.0)
    # released at 40 ms, and then driven by 1 kN more each ms: x = (1e6 N/s) t^3 / (6 m), 0.2 mm after 8.4 ms
    free_s = (6 * 500.0 * FREE_TRAVEL_M / 1e6) ** (1 / 3)
    at = np.flatnonzero(found.per_s)
    assert times[at[0]] == pytest.approx(0.04, abs=2e-5)
    assert times[at[-1]] - times[at[0]] == pytest.approx(free_s, rel=0.01)
    assert found.mean_n_s == pytest.approx(10e3 * free_s / 2, rel=0.01)
    # every impulse from none to the most is as likely as any other
    assert found.u_n_s == pytest.approx(10e3 * free_s / np.sqrt(12), rel=0.01)
    # it dies away
    assert np.all(np.diff(found.per_s[at]) < 0)
    assert found.per_s.sum() * 1e-5 == pytest.approx(1.0)


@pytest.mark.parametrize(("at_rest", "driven", "onset"), [(-10e3, 5.0, 0.03), (-10e3, 50e3, 0.0), (0.0, 5e4, 0.03)])
def test_where_rest_or_rise_are_not_recorded_or_nothing_is_held_there_is_nothing_to_tell(at_rest, driven, onset):
    found = stop_release_impulse(TIMES, np.where(TIMES < 0.03, at_rest, driven), onset, mass_kg=1e3)
    assert (found.mean_n_s, found.u_n_s) == (0.0, 0.0)
    assert not found.per_s.any()


@given(end=st.floats(0.101, 0.198), onset=st.floats(0.0, 0.05))
@settings(max_examples=30, deadline=None)
def test_the_end_of_travel_lies_between_samples(end, onset):
    velocity = np.where(onset <= TIMES, end - TIMES, 0.0)
    assert end_of_travel(TIMES, velocity, onset) == pytest.approx(end, abs=1e-12)


def test_what_moved_before_the_onset_or_after_the_return_does_not_count():
    velocity = np.interp(TIMES, [0.0, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2], [0, 5, 0, 10, 0, -4, 3])
    assert end_of_travel(TIMES, velocity, 0.03) == pytest.approx(0.1)


def test_a_record_that_ends_before_the_recoil_ends_the_interval():
    assert end_of_travel(TIMES, TIMES, 0.03) == TIMES[-1]


@pytest.mark.parametrize(
    ("velocity", "onset"), [(-TIMES, 0.03), (np.zeros(200), 0.0), (-np.ones(200), 0.0), (TIMES, 0.5)]
)
def test_a_part_that_never_moves_to_the_rear_is_an_error(velocity, onset):
    with pytest.raises(IdentificationError, match="never moves to the rear") as caught:
        end_of_travel(TIMES, velocity, onset)
    assert "polarity" in str(caught.value)
