"""Host time of an instrument's ticks: it never steps, never runs backwards, and is right whatever the network does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.devices.tick_clock import SLEW, START_S, TICK_ANCHORS, TickClock, _upper_quartile, tick_anchors

RATE_HZ = 10_000.0
PACKET = 100
BEGAN_S = 5000.0


def packets(seconds: float, ppm: float, stalls: list[tuple[float, float]], seed: int = 1) -> list[tuple[int, int]]:
    """First ticks and arrivals, ns, of packets of 10 ms, which the network holds back by 0.2 to 3 ms and in stalls."""
    first = np.arange(round(seconds * RATE_HZ / PACKET)) * PACKET
    taken_s = BEGAN_S + (first + PACKET - 1) / (RATE_HZ * (1 + 1e-6 * ppm))
    arrives_s = taken_s + 2e-4 + np.random.default_rng(seed).exponential(4e-4, first.size)
    for begin, lasts in stalls:
        held = (begin <= taken_s - BEGAN_S) & (taken_s - BEGAN_S < begin + lasts)
        arrives_s[held] = BEGAN_S + begin + lasts
    arrives_s = np.maximum.accumulate(arrives_s)  # in order
    return list(zip(first.tolist(), np.rint(1e9 * arrives_s).astype(np.int64).tolist(), strict=True))


def dated(made: list[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    """Ticks and the instants that they were given."""
    clock, ticks, times = TickClock(RATE_HZ), [], []
    for first, arrival_ns in made:
        found = clock.feed(first, PACKET, arrival_ns)
        if found is not None:
            ticks.append(first + np.arange(PACKET))
            times.append(found)
    return np.concatenate(ticks), np.concatenate(times)


@pytest.mark.real_time
@settings(max_examples=40)
@given(
    ppm=st.floats(-200, 200),
    stalls=st.lists(st.tuples(st.floats(0, 20), st.floats(0.05, 0.3)), max_size=4),
    seed=st.integers(0, 99),
)
def test_time_runs_forward_evenly_and_is_right(ppm: float, stalls: list[tuple[float, float]], seed: int) -> None:
    ticks, times_s = dated(packets(20.0, ppm, stalls, seed))
    steps_s = np.diff(times_s)
    assert (np.abs(steps_s * RATE_HZ - 1.0) <= SLEW + 1e-6).all()
    true_s = BEGAN_S + ticks / (RATE_HZ * (1 + 1e-6 * ppm))
    late_s = times_s - true_s
    # half a second of a stalled network is all that it begins with
    settled = ticks > 5.0 * RATE_HZ if not any(begin < 1.0 for begin, _ in stalls) else ticks > ticks[-1]
    assert np.abs(late_s[settled]).max(initial=0.0) < 2e-3
    assert late_s.max() < 0.35


def test_it_begins_after_half_a_second_and_says_how_sure_it_is() -> None:
    clock, made = TickClock(RATE_HZ), packets(10.0, 50.0, [])
    found = [clock.feed(first, PACKET, arrival_ns) is not None for first, arrival_ns in made[:60]]
    assert found.index(True) == pytest.approx(START_S * RATE_HZ / PACKET, abs=1)
    assert all(found[found.index(True) :])
    for first, arrival_ns in made[60:]:
        clock.feed(first, PACKET, arrival_ns)
    anchor = clock.anchor
    assert anchor is not None
    assert anchor.tick == made[-1][0] + PACKET - 1
    true_s = BEGAN_S + anchor.tick / (RATE_HZ * (1 + 50e-6))
    # the least delay of the network cannot be told from the clocks
    assert abs(anchor.host_ns / 1e9 - 2e-4 - true_s) < 4e-9 * anchor.u_ns
    assert 0 < anchor.u_ns < 1e6


def test_ticks_that_run_backwards_are_a_new_epoch_whose_time_goes_on() -> None:
    clock, made = TickClock(RATE_HZ), packets(2.0, 0.0, [])
    before = [clock.feed(first, PACKET, arrival_ns) for first, arrival_ns in made]
    with pytest.raises(ValueError, match="ticks run backwards"):
        clock.feed(0, PACKET, made[-1][1])
    clock.restart()
    assert clock.anchor is None
    after = [clock.feed(first, PACKET, arrival_ns + 2_100_000_000) for first, arrival_ns in made]
    assert before[-1] is not None
    known = [one for one in after if one is not None]
    assert known[0][0] >= before[-1][-1]
    assert known[-1][-1] == pytest.approx(BEGAN_S + 2.0 + 2.1, abs=2e-3)


def test_time_stands_still_where_another_epoch_would_take_it_back() -> None:
    clock, made = TickClock(RATE_HZ), packets(2.0, 0.0, [])
    before = [clock.feed(first, PACKET, arrival_ns) for first, arrival_ns in made][-1]
    clock.restart()
    after = [clock.feed(first, PACKET, arrival_ns - 300_000_000) for first, arrival_ns in made]
    assert before is not None
    times_s = np.concatenate([one for one in after if one is not None])
    assert times_s[0] == before[-1]
    assert (np.diff(times_s) >= 0).all()


def test_a_gap_is_passed_over_by_the_ticks() -> None:
    clock, made = TickClock(RATE_HZ), packets(4.0, 0.0, [])
    kept = [one for one in made if not 1.5 <= one[0] / RATE_HZ < 2.5]
    times = {first: clock.feed(first, PACKET, arrival_ns) for first, arrival_ns in kept}
    behind = times[25_000]
    assert behind is not None
    assert behind[0] == pytest.approx(BEGAN_S + 2.5, abs=2e-3)


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("inf"), float("nan")])
def test_a_rate_that_is_none_is_refused(rate_hz: float) -> None:
    with pytest.raises(ValueError, match="rate_hz"):
        TickClock(rate_hz)


def test_a_packet_without_samples_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one sample"):
        TickClock(RATE_HZ).feed(0, 0, 1)


def test_a_recordings_anchors_are_a_second_apart_and_say_when_its_ticks_were_taken() -> None:
    made = packets(4.0, 50.0, [])
    found = tick_anchors(RATE_HZ, [(first, PACKET, arrival_ns) for first, arrival_ns in made])
    anchors = found[TICK_ANCHORS]
    assert [round(one["tick"] / RATE_HZ, 1) for one in anchors] == [0.5, 1.5, 2.5, 3.5, 4.0]
    for one in anchors:
        true_s = BEGAN_S + one["tick"] / (RATE_HZ * (1 + 50e-6))
        assert abs(one["host_ns"] / 1e9 - 2e-4 - true_s) < 5e-9 * one["u_ns"] + 1e-4


def test_each_epoch_has_its_anchors_and_one_that_is_too_short_has_none() -> None:
    made = [(first, PACKET, arrival_ns) for first, arrival_ns in packets(1.0, 0.0, [])]
    later = [(first, count, arrival_ns + 2_000_000_000) for first, count, arrival_ns in made]
    ticks = [one["tick"] for one in tick_anchors(RATE_HZ, made + later)[TICK_ANCHORS]]
    assert [round(tick / RATE_HZ, 1) for tick in ticks] == [0.5, 1.0, 0.5, 1.0]
    assert tick_anchors(RATE_HZ, made[:20])[TICK_ANCHORS] == []


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=20))
def test_the_upper_quartile_is_numpys(values: list[float]) -> None:
    assert _upper_quartile(values) == pytest.approx(np.quantile(values, 0.75), abs=1e-12)
