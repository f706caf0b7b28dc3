"""The line between a device's clock and the host's, with late stamps, wrong stamps and steps."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.clocks.clock_fit import ClockFit, fit_clock

DEVICE_ZERO_NS, HOST_ZERO_NS = 10**15, 3 * 10**12


def stamps(
    frames: int = 2000,
    rate_hz: float = 1000.0,
    drift: float = 5e-5,
    *,
    steps: tuple[tuple[float, float], ...] = (),
    stall: tuple[float, float] | None = None,
    delay_s: float = 3e-4,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """Make stamps of frames at an even rate: the device's with its steps, the host's late and in order."""
    rng = np.random.default_rng(seed)
    true_s = np.arange(frames) / rate_hz
    device_s = true_s.copy()
    for at_s, step_s in steps:
        device_s[true_s >= at_s] += step_s
    host_s = true_s * (1 + drift) + 1e-4 + rng.exponential(delay_s, frames)
    if stall is not None:
        held = (true_s >= stall[0]) & (true_s < stall[1])
        host_s[held] = stall[1]
    host_s = np.maximum.accumulate(host_s)
    return (
        np.round(device_s * 1e9).astype(np.int64) + DEVICE_ZERO_NS,
        np.round(host_s * 1e9).astype(np.int64) + HOST_ZERO_NS,
    )


def fitted(*pair: np.ndarray, **options: object) -> ClockFit:
    fit = fit_clock(*pair, **options)
    assert fit is not None
    return fit


@settings(max_examples=60, deadline=None)
@given(drift=st.floats(-2e-4, 2e-4), seed=st.integers(0, 10**6), rate_hz=st.sampled_from([50.0, 400.0, 2000.0]))
def test_the_drift_is_found_within_its_uncertainty(drift: float, seed: int, rate_hz: float) -> None:
    fit = fitted(*stamps(2000, rate_hz, drift, seed=seed))
    assert abs(fit.drift - drift) < 6 * fit.u_drift
    assert fit.u_drift < 2e-5 * rate_hz / 2000
    assert fit.steps == ()
    assert fit.wrong_stamps == ()


def test_the_stated_uncertainty_is_that_of_many_fits() -> None:
    fits, first_delays_s = [], []
    for seed in range(150):
        device, host = stamps(seed=seed)
        fits.append(fitted(device, host))
        first_delays_s.append((host[0] - HOST_ZERO_NS) / 1e9 - 1e-4)
    drifts = np.array([(fit.drift - 5e-5) / fit.u_drift for fit in fits])
    assert 0.7 < np.std(drifts) < 1.5
    # the first frame's own delay is not in the offset; the shortest of some twenty is
    offsets_s = np.array([fit.offset_s for fit in fits]) + first_delays_s
    assert 0 < np.mean(offsets_s) < 1.6e-5
    assert 0.9 < np.std((offsets_s - np.mean(offsets_s)) / [fit.u_offset_s for fit in fits]) < 2.1
    assert np.mean([fit.typical_delay_s for fit in fits]) == pytest.approx(3e-4 * np.log(2), rel=0.05)
    assert np.mean([fit.scatter_s for fit in fits]) == pytest.approx(7.6e-6, rel=0.3)


@pytest.mark.parametrize(("at", "least", "most"), [(7, 0.1, 0.4), (1000, 0.7, 1.6), (1800, 0.8, 2.1), (1993, 0.1, 0.4)])
@pytest.mark.parametrize("step_s", [-0.3, 100.0])
def test_the_stated_uncertainty_of_a_step_is_that_of_many(at: int, least: float, most: float, step_s: float) -> None:
    pulls = []
    for seed in range(60):
        (step,) = fitted(*stamps(steps=((at / 1000 - 1e-9, step_s),), seed=seed)).steps
        pulls.append((step.step_s - step_s) / step.u_step_s)
    # a side of a few frames may be late as a whole, and its uncertainty holds that
    assert least < np.std(pulls) < most


@pytest.mark.exhaustive
@settings(max_examples=60, deadline=None)
@given(
    step_s=st.one_of(st.floats(-0.9, -0.004), st.floats(0.004, 30.0)),
    at=st.integers(200, 1800),
    seed=st.integers(0, 10**6),
)
def test_a_step_is_located_and_sized(step_s: float, at: int, seed: int) -> None:
    fit = fitted(*stamps(steps=((at / 1000 - 1e-9, step_s),), seed=seed))
    assert [step.index for step in fit.steps] == [at]
    step = fit.steps[0]
    assert abs(step.step_s - step_s) < max(8 * step.u_step_s, 3e-5)
    assert abs(fit.drift - 5e-5) < 1.5e-5


def test_several_steps_are_told_apart_and_taken_out() -> None:
    device, host = stamps(4000, steps=((0.7, -0.5), (1.2, 0.02), (2.9, 100.0)))
    fit = fitted(device, host)
    assert [step.index for step in fit.steps] == [700, 1200, 2900]
    assert abs(fit.offset_s) < 2e-3
    for step in fit.steps:
        assert (step.device_ns, step.host_ns) == (device[step.index], host[step.index])
    np.testing.assert_allclose([step.step_s for step in fit.steps], [-0.5, 0.02, 100.0], atol=1.5e-5)
    instants_s = (fit.device_instants_ns(device, host) - device[0]) / 1e9
    np.testing.assert_allclose(instants_s, np.arange(4000) / 1000, atol=1.5e-5)


@pytest.mark.parametrize("stall", [(0.5, 1.5), (1.4, 2.5), (0.001, 0.6)])
def test_a_stall_of_the_host_is_no_step_and_does_not_bend_the_line(stall: tuple[float, float]) -> None:
    fit = fitted(*stamps(stall=stall))
    assert fit.steps == ()
    assert abs(fit.drift - 5e-5) < 5e-6
    assert fit.largest_delay_s == pytest.approx(min(stall[1] - stall[0], 2.0), rel=0.005)


def test_a_step_inside_a_stall_is_found() -> None:
    fit = fitted(*stamps(stall=(0.5, 1.5), steps=((1.0, -0.3),)))
    assert [step.index for step in fit.steps] == [1000]
    assert fit.steps[0].step_s == pytest.approx(-0.3, abs=1e-5)


def test_single_wrong_stamps_are_left_out_and_replaced() -> None:
    device, host = stamps()
    device[100] += 41_900_000
    device[500] -= 50_000_000
    fit = fitted(device, host)
    assert fit.wrong_stamps == (100, 500)
    assert fit.steps == ()
    instants_s = (fit.device_instants_ns(device, host) - device[0]) / 1e9
    np.testing.assert_allclose(instants_s, np.arange(2000) / 1000, atol=2e-4)


def late_by_two_milliseconds_but_for_each_tenth() -> tuple[np.ndarray, np.ndarray]:
    """Make 1,000 frames at 50 Hz that lack four in a place; the first one is late too."""
    number = np.delete(np.arange(1000), [508, 509, 510, 511])
    device_ns = number * 20_000_000
    host_ns = np.round(device_ns * (1 + 5e-5)).astype(np.int64) + np.where(number % 10 == 5, 0, 2_000_000)
    return device_ns + DEVICE_ZERO_NS, host_ns + HOST_ZERO_NS


def test_a_wrong_stamp_is_replaced_by_the_lines_at_the_hosts_less_the_typical_delay() -> None:
    device, host = late_by_two_milliseconds_but_for_each_tenth()
    true = device.copy()
    device[103] += 500_000_000
    device[507] -= 500_000_000
    fit = fitted(device, host)
    assert fit.wrong_stamps == (103, 507)
    assert fit.offset_s == pytest.approx(-2e-3, abs=1e-6)
    assert fit.typical_delay_s == pytest.approx(2e-3, abs=1e-6)
    assert fit.largest_delay_s == pytest.approx(2e-3, abs=1e-6)
    # between its neighbours the second would be 40 ms off
    np.testing.assert_allclose(fit.device_instants_ns(device, host), true, rtol=0, atol=3e3)
    assert fit.to_json()["wrong_stamps"] == 2


def test_a_wrong_stamp_that_the_host_read_late_stays_between_its_neighbours() -> None:
    device, host = late_by_two_milliseconds_but_for_each_tenth()
    device[103] += 500_000_000
    host[103:105] += 30_000_000
    host[:] = np.maximum.accumulate(host)
    instants = fitted(device, host).device_instants_ns(device, host)
    assert (np.diff(instants) > 0).all()


def test_frames_that_say_nothing_of_the_drift_leave_its_uncertainty_open() -> None:
    device, host = stamps(2)
    device[1], host[1] = device[0], host[0] + 1_000_000
    fit = fitted(device, host)
    assert (fit.drift, fit.u_drift) == (0.0, np.inf)
    assert np.isfinite([fit.offset_s, fit.u_offset_s]).all()
    document = fit.to_json()
    assert document["u_drift"] is None
    assert json.loads(json.dumps(document, allow_nan=False)) == document


def test_lost_frames_are_no_step() -> None:
    device, host = stamps()
    kept = np.ones(2000, dtype=bool)
    kept[300:900] = False
    fit = fitted(device[kept], host[kept])
    assert fit.steps == ()
    assert fit.wrong_stamps == ()


def test_the_packet_counter_tells_a_step_from_frames_of_irregular_spacing() -> None:
    counts = np.cumsum(np.random.default_rng(3).choice([1, 1, 1, 30], 600))
    true_s = counts * 1e-3
    device = np.round((true_s + np.where(true_s >= true_s[300], 0.015, 0.0)) * 1e9).astype(np.int64)
    host = np.round((true_s + 2e-4) * 1e9).astype(np.int64)
    with_counts = fitted(device, host, counts=counts)
    assert [step.index for step in with_counts.steps] == [300]
    assert with_counts.order_faults == 0
    assert fitted(device, host).order_faults is None
    counts[40] = counts[39]
    assert fitted(device, host, counts=counts).order_faults == 1


def test_a_counter_that_went_on_for_long_does_not_overrule_a_host_that_knows_better() -> None:
    counts = np.delete(np.arange(3000), np.arange(1000, 1900))
    true_s = counts * 1e-3
    jitter_s = np.random.default_rng(4).normal(0.0, 5e-5, counts.size)
    device = np.round((true_s + jitter_s + np.where(counts >= 1900, -0.3, 0.0)) * 1e9).astype(np.int64)
    late_s = np.random.default_rng(5).exponential(1e-3, counts.size)
    host = np.round(np.maximum.accumulate(true_s + late_s) * 1e9).astype(np.int64)
    (step,) = fitted(device, host, counts=counts).steps
    assert step.step_s == fitted(device, host).steps[0].step_s
    assert step.step_s == pytest.approx(-0.3, abs=3e-4)


def test_a_clock_that_begins_anew_at_a_known_break_is_followed() -> None:
    device, host = stamps(steps=((1.0, 0.0004),), delay_s=1e-5)
    assert fitted(device, host).steps == ()
    fit = fitted(device, host, breaks=[1000], smallest_step_s=2e-4)
    assert [step.index for step in fit.steps] == [1000]
    assert fit.steps[0].step_s == pytest.approx(4e-4, abs=1e-6)


def test_a_step_that_frames_of_uneven_spacing_hide_is_found_at_a_known_break() -> None:
    true_s = np.cumsum(np.random.default_rng(5).uniform(1e-3, 9e-3, 1000))
    device = np.round((true_s + np.where(np.arange(1000) >= 400, 3e-3, 0.0)) * 1e9).astype(np.int64)
    host = np.round((true_s + 2e-4) * 1e9).astype(np.int64)
    assert fitted(device, host).steps == ()
    (step,) = fitted(device, host, breaks=[400]).steps
    assert (step.index, step.step_s) == (400, pytest.approx(3e-3, abs=1e-8))


def test_two_frames_give_a_line_without_certainty_and_fewer_none() -> None:
    device, host = stamps(2)
    assert fit_clock(device[:1], host[:1]) is None
    fit = fitted(device, host)
    assert np.isfinite([fit.offset_s, fit.drift]).all()
    with pytest.raises(ValueError, match="one value for each frame"):
        fit_clock(device, host[:1])


@pytest.mark.exhaustive
@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.integers(-(2**63), 2**63 - 1), st.integers(-(2**63), 2**63 - 1)), min_size=2, max_size=40))
def test_no_stamps_whatever_make_it_fail(pairs: list[tuple[int, int]]) -> None:
    device = np.array([p[0] for p in pairs], dtype=np.int64)
    host = np.array([p[1] for p in pairs], dtype=np.int64)
    fit = fitted(device, host)
    assert fit.device_instants_ns(device, host).shape == device.shape
    assert np.isfinite([fit.offset_s, fit.drift, fit.typical_delay_s]).all()
