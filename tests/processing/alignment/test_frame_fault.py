import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_processing.alignment.frame_fault import FrameFault, correct_times

PERIOD_S = 1 / 6000


def fault(index: int, missing: int, jump_m: float = 0.0) -> FrameFault:
    return FrameFault(index, index, index, index * PERIOD_S, missing, PERIOD_S, 100.0, jump_m)


@given(st.lists(st.tuples(st.integers(1, 99), st.sampled_from([1, -1])), max_size=4, unique_by=lambda pair: pair[0]))
def test_corrected_times_are_those_of_the_pictures(events):
    taken, file = 0, []
    missing_or_twice = dict(events)
    for index in range(100):
        # the file's picture `index`: behind a missing one, or the one before again
        if index in missing_or_twice:
            taken += missing_or_twice[index]
        file.append(taken)
        taken += 1
    corrected, real = correct_times(np.arange(100) * PERIOD_S, [fault(*event) for event in events])
    assert np.allclose(corrected[real], np.array(file)[real] * PERIOD_S, rtol=0, atol=1e-12)
    assert np.flatnonzero(~real).tolist() == sorted(index for index, missing in events if missing < 0)
    assert np.all(np.diff(corrected[: np.flatnonzero(real)[-1] + 1]) > 0)


def test_a_jump_changes_no_time():
    times = np.arange(10.0)
    corrected, real = correct_times(times, [fault(4, 0, 0.01)])
    assert corrected.tolist() == times.tolist()
    assert real.all()


@pytest.mark.parametrize("index", [0, 10, -1])
def test_a_place_outside_the_track_is_refused(index):
    with pytest.raises(ValueError, match="none of the 10 frames"):
        correct_times(np.arange(10.0), [fault(index, 1)])


def test_each_fault_says_what_it_is():
    assert str(FrameFault(1234, 1233, 1236, 0.20567, 1, PERIOD_S, 90.0)) == (
        "one frame is missing near frame 1234 (t = 0.2057 s; 95 %: 1233 to 1236, counted from 0): "
        "all later times are 166.7 us early"
    )
    assert str(fault(12, -1)) == (
        "one picture was written twice near frame 12 (t = 0.0020 s; 95 %: 12, counted from 0): "
        "all later times are 166.7 us late"
    )
    assert str(fault(12, 0, -0.0236)) == (
        "the track jumps by -23.6 mm near frame 12 (t = 0.0020 s; 95 %: 12, counted from 0)"
    )
