"""What the packet counter tells of a clock's jumps, and the order of frames whose stamps were wrong."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.clocks.clock_breaks import jumps_by_count, keep_order, step_by_count
from recoil_acquisition.clocks.clock_fit import fit_clock

COUNTS = np.arange(1000)


def stepped(at: int, step_s: float, jitter_s: float = 0.0) -> np.ndarray:
    stamps = COUNTS * 1e-3 + np.random.default_rng(2).normal(0, max(jitter_s, 1e-12), 1000)
    stamps[at:] += step_s
    return stamps


def test_lost_frames_are_no_jump_and_a_step_is_one() -> None:
    kept = np.delete(COUNTS, np.arange(200, 500))
    assert jumps_by_count(kept * 1e-3, kept, 2e-3).size == 0
    assert jumps_by_count(stepped(300, -0.01), COUNTS, 2e-3).tolist() == [300]
    assert jumps_by_count(np.zeros(1), np.zeros(1, dtype=np.int64), 2e-3).size == 0


def test_the_jumps_of_an_uneven_device_are_its_own() -> None:
    assert jumps_by_count(stepped(300, 0.01, jitter_s=2e-3), COUNTS, 2e-3).size == 0


@given(at=st.integers(1, 999), step_s=st.floats(-10, 10), lost=st.integers(0, 100))
@settings(max_examples=50, deadline=None)
def test_the_counter_sizes_a_step_over_lost_frames(at: int, step_s: float, lost: int) -> None:
    x = stepped(at, step_s, jitter_s=1e-6)
    last = max(at - 1 - lost, 0)
    found = step_by_count(x, COUNTS, last, at)
    assert found is not None
    assert abs(found[0] - step_s) < 6 * found[1]
    assert found[1] <= 3e-6 * (at - last)


def test_a_counter_that_began_anew_tells_no_step() -> None:
    counts = np.r_[COUNTS[:500], COUNTS[:500]]
    assert step_by_count(stepped(500, 1.0), counts, 499, 500) is None
    assert step_by_count(np.zeros(3), np.array([1, 2, 3]), 0, 1) is None


@pytest.mark.exhaustive
@given(
    steps_ns=st.lists(st.integers(1, 10**9), min_size=8, max_size=40),
    wrong=st.sets(st.integers(0, 39), max_size=6),
    seed=st.integers(0, 100),
)
@settings(max_examples=100, deadline=None)
def test_whatever_is_placed_stays_in_order_and_the_rest_where_it_is(
    steps_ns: list[int], wrong: set[int], seed: int
) -> None:
    true = 1000 * np.cumsum(steps_ns)
    placed = np.array(sorted(i for i in wrong if i < true.size), dtype=np.intp)
    if placed.size == true.size:
        return
    instants = true.copy()
    instants[placed] += np.random.default_rng(seed).integers(-(10**13), 10**13, placed.size)
    kept = keep_order(instants.copy(), placed)
    assert (np.diff(kept) > 0).all()
    others = np.setdiff1d(np.arange(true.size), placed)
    np.testing.assert_array_equal(kept[others], true[others])


def test_what_is_in_order_is_left_alone() -> None:
    instants = np.array([0, 10, 19, 30])
    np.testing.assert_array_equal(keep_order(instants.copy(), np.array([2])), instants)
    np.testing.assert_array_equal(keep_order(np.array([5, 1]), np.array([0, 1])), [5, 1])


def late_host() -> np.ndarray:
    """Give all frames of 16 ms the time of one read."""
    return np.round(1e9 * 0.016 * np.ceil((COUNTS * 1e-3 + 1e-4) / 0.016)).astype(np.int64)


@pytest.mark.parametrize("at", [8, 500, 994])
def test_the_counter_sizes_a_step_that_the_host_sees_late(at: int) -> None:
    device_s = stepped(at, -0.3)
    device_ns = np.round(1e9 * device_s).astype(np.int64)
    fit = fit_clock(device_ns, late_host(), counts=COUNTS)
    assert fit is not None
    (step,) = fit.steps
    assert (step.index, step.step_s) == (at, pytest.approx(-0.3, abs=1e-6))
    assert step.u_step_s < 1e-5


def test_a_counter_that_left_more_out_than_the_host_was_late_is_not_believed() -> None:
    counts = COUNTS + np.where(COUNTS >= 500, 50, 0)
    fit = fit_clock(np.round(1e9 * stepped(500, -0.3)).astype(np.int64), late_host(), counts=counts)
    assert fit is not None
    assert [step.step_s for step in fit.steps] == [pytest.approx(-0.3, abs=0.02)]


@pytest.mark.parametrize("at", [8, 500, 994])
@pytest.mark.parametrize("step_s", [-0.3, 0.3])
def test_without_a_counter_no_step_is_larger_than_what_keeps_the_frames_in_order(at: int, step_s: float) -> None:
    device_s = stepped(at, step_s)
    device_ns, host_ns = np.round(1e9 * device_s).astype(np.int64), late_host()
    fit = fit_clock(device_ns, host_ns)
    assert fit is not None
    assert [step.index for step in fit.steps] == [at]
    assert abs(fit.steps[0].step_s - step_s) < min(0.02, 3 * fit.steps[0].u_step_s)
    assert (np.diff(fit.device_instants_ns(device_ns, host_ns)) > 0).all()


def test_a_pause_of_the_device_is_not_taken_for_part_of_a_step() -> None:
    device_s = stepped(500, -0.3)
    device_s[500:] += 0.2
    host_ns = np.round(1e9 * (COUNTS * 1e-3 + np.where(COUNTS >= 500, 0.2, 0.0) + 1e-4)).astype(np.int64)
    fit = fit_clock(np.round(1e9 * device_s).astype(np.int64), host_ns, counts=COUNTS)
    assert fit is not None
    assert [step.step_s for step in fit.steps] == [pytest.approx(-0.3, abs=1e-4)]
