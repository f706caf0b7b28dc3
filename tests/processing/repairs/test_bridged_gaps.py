import numpy as np
import pytest

from recoil_processing.gaps import bridge
from recoil_processing.repairs.bridged_gaps import bridge_errors


def flags(count: int, *runs: tuple[int, int]) -> np.ndarray:
    lost = np.zeros(count, dtype=bool)
    for start, stop in runs:
        lost[start:stop] = True
    return lost


def test_without_lost_samples_there_is_no_gap():
    assert bridge_errors(np.zeros(50), flags(50), 1e-3) == []


def test_a_gap_lies_between_the_samples_that_are_there():
    (inner,) = bridge_errors(np.zeros(50), flags(50, (10, 14)), 1e-3)
    assert (inner.first, inner.last) == (9, 14)
    assert inner.start_s == pytest.approx(9e-3)
    assert inner.duration_s == pytest.approx(5e-3)
    first, last = bridge_errors(np.zeros(50), flags(50, (0, 3), (45, 50)), 1e-3)
    assert (first.first, first.last) == (0, 3)
    assert (last.first, last.last) == (44, 49)


def test_bridges_of_straight_lines_miss_nothing():
    (gap,) = bridge_errors(3.0 - 2.0 * np.arange(400.0), flags(400, (100, 120)), 1e-3)
    assert gap.error == pytest.approx(0.0, abs=1e-10)
    assert gap.density == pytest.approx(0.0, abs=1e-18)


def test_the_error_of_a_parabola_is_that_of_its_chord():
    t = np.arange(4000.0)
    (gap,) = bridge_errors(0.5 * 6.0 * t**2, flags(4000, (2000, 2049)), 1e-3)
    # a chord of length L misses c s (L - s) / 2: the mean square over it is c^2 L^4 / 120
    assert gap.error == pytest.approx(6.0 * 50**2 / np.sqrt(120), rel=0.02)
    assert gap.density == pytest.approx(gap.error**2 * 0.05)


def test_the_error_covers_what_bridges_in_a_pulse_really_miss():
    t = np.arange(20000) / 20000
    pulse = 2400 * np.sin(np.pi * np.clip((t - 0.5) / 0.008, 0, 1)) ** 2
    ratios = []
    for start in range(9960, 10180, 20):
        lost = flags(t.size, (start, start + 30))
        bridged = bridge(np.where(lost, np.nan, pulse))
        (gap,) = bridge_errors(bridged, lost, 1 / 20000)
        ratios.append(np.sqrt(np.mean((bridged - pulse)[lost] ** 2)) / gap.error)
    assert np.max(ratios) < 1.2
    assert np.max(ratios) > 0.5


def test_the_search_stays_near_the_gap_and_off_other_gaps():
    samples = np.zeros(20000)
    samples[15000] = 1000.0
    near, far = bridge_errors(samples, flags(20000, (14900, 14902), (1000, 1002)), 1e-4)[::-1]
    assert near.error > 100
    assert far.error == 0
    hidden = bridge_errors(samples, flags(20000, (14900, 14902), (14998, 15003)), 1e-4)
    assert hidden[0].error == 0


def test_where_no_bridge_can_be_tried_the_span_counts():
    samples = np.array([0.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0])
    (gap,) = bridge_errors(samples, flags(8, (1, 7)), 1e-3)
    assert gap.error == 5.0
