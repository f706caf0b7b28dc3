from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.readers.time.printed_time import start_agreeing, uniform_from_printed


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=100)
@given(
    rate_hz=st.sampled_from([100.0, 1000.0, 6000.0, 4800.0, 20000.0, 51200.0, 200000.0]),
    decimals=st.integers(6, 9),
    count=st.integers(200, 3000),
    start=st.sampled_from([0.0, -0.1, 1200.02]),
)
def test_the_exact_rate_is_found_in_rounded_times(rate_hz: float, decimals: int, count: int, start: float) -> None:
    printed = np.round(start + np.arange(count) / rate_hz, decimals)
    found = uniform_from_printed(printed, 10.0**-decimals)
    assert found is not None
    worst = abs(found[0] + found[1] * (count - 1) - start - (count - 1) / rate_hz)
    assert worst <= 1.01 * 10.0**-decimals
    if rate_hz in (100.0, 1000.0, 20000.0, 200000.0):
        assert found[1] == 1 / rate_hz
        assert found[0] == printed[0]


def test_stamps_coarser_than_the_step_still_give_the_step() -> None:
    printed = np.floor(np.arange(4000) / 20.0) * 1e-3 + 0.0005
    found = uniform_from_printed(printed, 1e-3)
    assert found is not None
    assert found[1] == 1 / 20000.0


def test_a_gap_or_a_changed_rate_is_not_uniform() -> None:
    times = np.arange(100) * 1e-3
    times[50:] += 0.004
    assert uniform_from_printed(times, 1e-6) is None
    assert uniform_from_printed(np.r_[np.arange(50) * 1e-3, 0.05 + np.arange(50) * 2e-3], 1e-6) is None


def test_times_that_fall_or_are_too_few_have_no_step() -> None:
    assert uniform_from_printed(np.array([1.0]), 1e-3) is None
    assert uniform_from_printed(np.array([2.0, 1.0]), 1e-3) is None


def test_numbers_with_gaps_are_taken_as_they_are() -> None:
    numbers = np.array([0, 1, 2, 7, 8, 20])
    found = uniform_from_printed(np.round(numbers / 6000.0, 6), 1e-6, numbers)
    assert found == (0.0, 1 / 6000.0)


def test_a_start_is_zero_where_that_agrees() -> None:
    numbers = np.arange(10)
    assert start_agreeing(np.round(numbers / 6000.0, 6), 1 / 6000.0, 1e-6, numbers) == 0.0
    assert start_agreeing(np.round(numbers / 6000.0, 6), 1 / 5000.0, 1e-6, numbers) is None
