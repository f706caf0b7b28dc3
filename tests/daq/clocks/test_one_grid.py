"""Channels on one even grid: what it can hold is unchanged and not moved, what it cannot is taken out, losses stay."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import interp1d

from recoil_acquisition.clocks.one_grid import MOST_INSTANTS, PASSED, grid, read_on_grid

RATE_HZ = 1000.0
INSTANTS_S = np.arange(50, 951) / RATE_HZ
"""Of a second, away from its ends by the reach of the longest filter here."""


def seconds(rate_hz: float) -> np.ndarray:
    return np.arange(int(rate_hz) + 1) / rate_hz


@pytest.mark.parametrize("own_hz", [50e3, 12_345.0, 1010.0, 2500.0])
@pytest.mark.parametrize("hz", [3.0, 120.0, 399.0])
def test_what_the_grid_holds_is_as_it_was_at_the_same_instants(own_hz: float, hz: float) -> None:
    t = seconds(own_hz)
    found = read_on_grid(t, np.sin(2 * np.pi * hz * t + 0.4), INSTANTS_S, RATE_HZ)
    assert found.passed_hz == PASSED * RATE_HZ
    np.testing.assert_allclose(found.samples, np.sin(2 * np.pi * hz * INSTANTS_S + 0.4), atol=5e-3)
    assert found.taken_out < 0.01


@pytest.mark.parametrize("hz", [510.0, 600.0, 990.0, 7000.0])
def test_what_it_cannot_hold_is_taken_out_and_said(hz: float) -> None:
    t = seconds(50e3)
    found = read_on_grid(t, 3.0 * np.sin(2 * np.pi * hz * t), INSTANTS_S, RATE_HZ)
    assert np.abs(found.samples).max() < 5e-3
    assert found.taken_out == pytest.approx(3.0 / math.sqrt(2.0), rel=0.02)
    assert found.largest_before == pytest.approx(3.0, rel=1e-2)
    assert found.largest < 5e-3


def test_a_slower_channel_is_read_between_its_samples_and_nothing_is_taken_out() -> None:
    t = seconds(200.0)
    found = read_on_grid(t, np.sin(2 * np.pi * 5.0 * t), INSTANTS_S, RATE_HZ)
    assert (found.passed_hz, found.taken_out) == (None, 0.0)
    np.testing.assert_allclose(found.samples, np.sin(2 * np.pi * 5.0 * INSTANTS_S), atol=1e-4)
    cubic = interp1d(t, np.sin(2 * np.pi * 5.0 * t), kind="cubic")(INSTANTS_S)
    np.testing.assert_allclose(found.samples, cubic, atol=1e-9)


@pytest.mark.parametrize("own_hz", [200.0, 20e3])
def test_before_a_record_behind_it_and_in_a_gap_nothing_is_there(own_hz: float) -> None:
    t = seconds(own_hz)
    samples = np.ones(t.size)
    samples[(t > 0.3) & (t < 0.4)] = np.nan
    instants = np.arange(-100, 1101) / RATE_HZ
    there = np.isfinite(read_on_grid(t, samples, instants, RATE_HZ).samples)
    known = ((instants >= 0) & (instants <= 0.3 + 1e-9)) | ((instants >= 0.4 - 1e-9) & (instants <= 1.0 + 1e-9))
    assert not there[~known].any()
    # beside a gap the filter would read from what bridges it
    beside = (np.abs(instants - 0.35) < 0.056) & (own_hz > RATE_HZ)
    assert there[known & ~beside].all()


def test_stamps_that_are_not_even_are_read_where_they_are() -> None:
    rng = np.random.default_rng(1)
    t = np.sort(seconds(5000.0) + rng.uniform(-0.4, 0.4, 5001) / 5000.0)
    found = read_on_grid(t, np.sin(2 * np.pi * 40.0 * t), INSTANTS_S, RATE_HZ)
    np.testing.assert_allclose(found.samples, np.sin(2 * np.pi * 40.0 * INSTANTS_S), atol=2e-3)


@pytest.mark.exhaustive
@given(st.integers(0, 2**32 - 1), st.floats(-5.0, 5.0), st.sampled_from([300.0, 4000.0, 30e3]))
def test_a_sum_on_the_grid_is_the_sum_of_both(seed: int, factor: float, own_hz: float) -> None:
    t = np.arange(int(own_hz / 10)) / own_hz
    one, other = np.random.default_rng(seed).normal(size=(2, t.size))
    instants = np.arange(101) / RATE_HZ
    read = [read_on_grid(t, samples, instants, RATE_HZ).samples for samples in (one, other, one + factor * other)]
    np.testing.assert_allclose(read[2], read[0] + factor * read[1], atol=1e-9)


def test_of_a_channel_without_samples_nothing_is_there() -> None:
    found = read_on_grid(seconds(100.0), np.full(101, np.nan), INSTANTS_S, RATE_HZ)
    assert np.isnan(found.samples).all()
    assert math.isnan(found.largest_before)
    assert math.isnan(found.largest)


def test_a_grid_has_the_zero_of_its_clock_and_covers_all_spans() -> None:
    assert grid([(-0.0105, 0.5), (0.1, 1.0)], 1000.0) == (-0.010, 1011)
    assert grid([(0.25, 0.35)], 10.0) == (0.3, 1)


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, math.nan, math.inf])
def test_a_rate_that_is_none_is_refused(rate_hz: float) -> None:
    with pytest.raises(ValueError, match="rate_hz must be positive"):
        grid([(0.0, 1.0)], rate_hz)


def test_a_grid_that_nobody_can_mean_is_refused() -> None:
    with pytest.raises(ValueError, match="at most 50,000,000"):
        grid([(0.0, 1.0)], 2.0 * MOST_INSTANTS)
