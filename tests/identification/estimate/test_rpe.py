from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from recoil_identification.estimate.rpe import relative_percentage_error, rpe_interval


def test_equation_37_by_hand():
    # |780 - 741| + |780 - 784| + |780 - 780| = 43; 43 / (3 * 780) = 1.8376 %
    assert relative_percentage_error(np.array([741.0, 784.0, 780.0]), 780.0) == pytest.approx(100 * 43 / 2340)


def test_the_papers_figures():
    assert relative_percentage_error(np.full(100, 740.0), 782.2) == pytest.approx(5.4, abs=0.01)


def test_what_was_not_identified_is_counted_out_of_both_sums():
    assert relative_percentage_error(np.array([741.0, np.nan, 784.0]), 780.0) == pytest.approx(100 * 43 / 1560)
    assert math.isnan(relative_percentage_error(np.full(3, np.nan), 780.0))


@given(
    arrays(np.float64, st.integers(1, 30), elements=st.floats(100, 2000)), st.floats(100, 2000), st.floats(1e-3, 1e3)
)
@settings(max_examples=50, deadline=None)
def test_it_does_not_depend_on_the_unit_and_is_never_negative(mass, specification, unit):
    rpe = relative_percentage_error(mass, specification)
    assert rpe >= 0
    assert relative_percentage_error(unit * mass, unit * specification) == pytest.approx(rpe, rel=1e-9, abs=1e-9)


def test_far_from_zero_the_interval_is_that_of_the_shift():
    # RPE = |s - m (1 + e)| / s: normal around 5 % where it cannot fold
    low, high = rpe_interval(np.full(50, 741.0), 780.0, 0.004, 0.0)
    half = 1.96 * 0.004 * 100 * 741 / 780
    assert (low, high) == (pytest.approx(5 - half, abs=0.06), pytest.approx(5 + half, abs=0.06))


def test_the_specifications_tolerance_widens_it():
    low, high = rpe_interval(np.full(50, 741.0), 780.0, 0.0, 3.9)
    half = 1.96 * 100 * 741 * 3.9 / 780**2
    assert (high - low) / 2 == pytest.approx(half, rel=0.05)


def test_at_the_specification_the_interval_begins_at_zero():
    low, high = rpe_interval(np.full(50, 780.0), 780.0, 0.004, 0.0)
    assert low == 0.0
    assert high == pytest.approx(1.96 * 0.4, rel=0.05)


@given(st.floats(-0.03, 0.03), st.floats(0.0, 0.02), st.floats(0.0, 0.01), st.floats(0.0, 8.0))
@settings(max_examples=30, deadline=None)
def test_the_interval_holds_the_rpe(bias, scatter, systematic, u_specification):
    mass = 780.0 * (1 + bias + scatter * np.random.default_rng(1).normal(size=200))
    low, high = rpe_interval(mass, 780.0, systematic, u_specification)
    assert 0 <= low <= relative_percentage_error(mass, 780.0) <= high


def test_the_interval_is_reproducible_and_without_masses_there_is_none():
    mass = np.linspace(760, 790, 2000)
    assert rpe_interval(mass, 780.0, 0.004, 1.0) == rpe_interval(mass, 780.0, 0.004, 1.0)
    assert all(map(math.isnan, rpe_interval(np.full(4, np.nan), 780.0, 0.004, 1.0)))
