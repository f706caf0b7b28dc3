"""The engine turns blocks into decisions and windows of shots; beside it stands what the devices had counted."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.capture import engine as module
from recoil_acquisition.capture.engine import PATIENCE_S, SETTLE_S, CaptureEngine, CounterHistory
from recoil_acquisition.capture.live_source import LiveSamples
from recoil_acquisition.devices.device import CHANGED, IDLE, Block, Counters, event_block
from recoil_acquisition.trigger import Edge, ShotWindow, Trigger
from tests.builders.live_sources import bus, can_block, can_record, port, serial_block, serial_frame

TRIGGER = Trigger((Edge("pressure", 50e3, 20e3),), pre_s=0.2, post_s=0.3)


def blocks(until_s: float, pulse_s: float = math.inf) -> list[Block]:
    """Both sources every 10 ms; the pressure is 100 kPa for 20 ms from a time on."""
    made = []
    for k in range(round(until_s * 100)):
        t = 10.0 + 0.01 * k
        pressure = 100.0 if 0 <= t - 10.0 - pulse_s < 0.02 else 0.0
        made += [can_block(t, can_record(t, pressure)), serial_block(t, serial_frame(k, 1.0))]
    return made


def test_a_pulse_gives_a_window_with_its_pre_and_post_time() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    engine.arm(-math.inf)
    windows = []
    for block in blocks(2.0, pulse_s=1.0):
        engine.take(block)
        windows += engine.ready(block.host_ns / 1e9)
    (window,) = windows
    assert (window.start_s, window.trigger_s, window.stop_s) == pytest.approx((10.8, 11.0, 11.3))
    assert window.pre_actual_s == pytest.approx(0.2)
    assert window.late_sources == ()
    (decision,) = engine.news()
    assert (decision.outcome, decision.channel, decision.value) == ("trigger", "pressure", 100e3)
    assert engine.news() == ()


def test_nothing_triggers_before_it_is_armed_or_when_it_is_disarmed() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    for block in blocks(1.0, pulse_s=0.5):
        engine.take(block)
    engine.arm(11.0)
    engine.disarm()
    for block in blocks(2.0, pulse_s=1.5)[200:]:
        engine.take(block)
    assert engine.ready(math.inf) == ()
    assert not engine.armed


def test_a_shot_soon_after_the_start_has_less_pre_time_and_says_so() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    engine.arm(-math.inf)
    for block in blocks(1.0, pulse_s=0.05):
        engine.take(block)
    (window,) = engine.ready(11.0)
    assert window.pre_actual_s == pytest.approx(0.05)
    assert window.start_s == pytest.approx(10.0)


def test_a_source_that_falls_silent_is_waited_for_and_then_named() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    engine.arm(-math.inf)
    for block in blocks(2.0, pulse_s=1.0):
        if block.source == "bus" or block.host_ns < 11.1e9:
            engine.take(block)
    assert engine.recording
    assert engine.ready(11.3 + PATIENCE_S - 0.01) == ()
    (window,) = engine.ready(11.3 + PATIENCE_S)
    assert window.late_sources == ("port",)


def test_a_source_that_falls_silent_is_named_although_it_was_looked_at() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    engine.arm(-math.inf)
    for block in blocks(2.0, pulse_s=1.0):
        if block.source == "bus" or block.host_ns < 11.1e9:
            engine.take(block)
    engine.take(Block("port", 12_100_000_000, b"", IDLE, 12_000_000_000))
    assert engine.ready(12.1) == ()
    (window,) = engine.ready(11.3 + PATIENCE_S)
    assert window.late_sources == ("port",)


def test_a_manual_trigger_takes_a_shot() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    engine.arm(-math.inf)
    for block in blocks(1.5):
        engine.take(block)
    engine.fire(10.5)
    (window,) = engine.ready(11.0)
    assert window.trigger_s == 10.5
    assert window.decisions[0].channel == ""


def test_what_is_still_needed_never_runs_past_the_start_of_an_open_shot() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    engine.arm(-math.inf)
    for block in blocks(3.0, pulse_s=1.0):
        engine.take(block)
    assert engine.needed_from_s == pytest.approx(10.8)
    engine.ready(13.0)
    assert engine.needed_from_s == pytest.approx(12.99 - SETTLE_S - 1.0 - 0.2)


def test_levels_show_the_last_second_of_every_channel() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    assert engine.level("pressure", 12.5) is None
    for block in blocks(2.5, pulse_s=2.0):
        engine.take(block)
    pressure, rate = engine.level("pressure", 12.5), engine.level("rate", 12.5)
    assert pressure is not None
    assert (pressure.last, pressure.low, pressure.high) == (0.0, 0.0, 100e3)
    assert rate is not None
    assert rate.last == -1.0
    assert engine.level("pressure", 14.0) is None


def test_blocks_that_were_not_looked_at_count_as_delivered() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    engine.arm(-math.inf)
    for block in blocks(2.0, pulse_s=1.0):
        if block.host_ns > 11.15e9:
            engine.take_unseen(block)
        else:
            engine.take(block)
    (window,) = engine.ready(12.0)
    assert window.late_sources == ()


def test_what_only_the_screen_shows_is_decoded_ten_times_per_second() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    shown = []
    for k in range(100):
        engine.take(serial_block(10.0 + 0.01 * k, serial_frame(k, float(k))))
        level = engine.level("rate", 10.0 + 0.01 * k)
        shown.append(None if level is None else -level.last)
    assert 10 <= len(set(shown)) <= 12
    assert shown[-1] == pytest.approx(99.0, abs=11.0)


def test_a_look_that_finds_half_a_frame_goes_on_until_it_has_one() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    stream = b"".join(serial_frame(k, float(k)) for k in range(40))
    for k, at in enumerate(range(0, len(stream), 5)):
        engine.take(serial_block(10.0 + 0.01 * k, stream[at : at + 5]))
    level = engine.level("rate", 10.64)
    assert level is not None
    assert -level.last > 30
    assert level.low == level.last < level.high


def test_a_level_keeps_its_low_and_high_within_a_tenth_of_a_second() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    for k, pressure in enumerate((5.0, 40.0, -3.0, 1.0)):
        engine.take(can_block(10.0 + 0.01 * k, can_record(10.0 + 0.01 * k, pressure)))
    level = engine.level("pressure", 10.1)
    assert level is not None
    assert (level.last, level.low, level.high) == (1e3, -3e3, 40e3)
    engine.take(can_block(10.5, can_record(10.5, 2.0)))
    level = engine.level("pressure", 11.2)
    assert level is not None
    assert (level.last, level.low, level.high) == (2e3, 2e3, 2e3)


def test_an_event_is_no_delivery_of_data() -> None:
    for taken in (CaptureEngine.take, CaptureEngine.take_unseen):
        engine = CaptureEngine([bus(), port()], TRIGGER)
        engine.arm(-math.inf)
        for block in blocks(2.0, pulse_s=1.0):
            if block.source == "bus":
                engine.take(block)
            else:
                taken(engine, event_block("port", block.host_ns, "unanswered", ""))
        assert engine.ready(12.0) == ()
        (window,) = engine.ready(11.3 + PATIENCE_S)
        assert window.late_sources == ("port",)


def test_a_frame_that_lost_its_end_among_unseen_blocks_is_no_sample() -> None:
    trigger = Trigger((Edge("rate", 50.0, 20.0),), pre_s=0.2, post_s=0.3)
    engine = CaptureEngine([bus(), port()], trigger)
    frame = serial_frame(1, 3.0)
    engine.take(serial_block(10.0, frame[:4]))
    engine.take_unseen(serial_block(10.01, b""))
    engine.take(serial_block(10.02, frame[4:]))
    assert engine.level("rate", 10.1) is None


def test_a_trigger_waits_for_a_channel_that_lags_and_no_longer_at_the_end() -> None:
    both = Trigger((Edge("pressure", 50e3, 20e3), Edge("rate", 50.0, 20.0)), pre_s=0.2, post_s=0.3)
    engine = CaptureEngine([bus(), port()], both)
    engine.arm(-math.inf)
    for block in blocks(1.2, pulse_s=1.0):
        if block.source == "bus" or block.host_ns < 10.9e9:
            engine.take(block)
    assert engine.news() == ()
    engine.finish()
    assert [decision.outcome for decision in engine.news()] == ["trigger"]


class Counting:
    """A device that receives 100 things per second from 10 s until 20 s, and a clock that the test sets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 10.0
        monkeypatch.setattr(module.time, "monotonic", lambda: self.now_s)

    @property
    def counters(self) -> Counters:
        return Counters(received=round(100 * (min(self.now_s, 20.0) - 10.0)))


@pytest.fixture
def device(monkeypatch: pytest.MonkeyPatch) -> Counting:
    return Counting(monkeypatch)


def history_of(device: Any, until_s: float, needed_from_s: float = 1e9) -> CounterHistory:
    """Count 16 times per second, which is more often than it takes."""
    history = CounterHistory({"imu": device})
    for k in range(round(16 * (until_s - 10.0)) + 1):
        device.now_s = 10.0 + k / 16
        history.count(needed_from_s)
    return history


@pytest.mark.exhaustive
def test_the_rate_is_that_of_the_last_two_seconds(device: Counting) -> None:
    history = history_of(device, 11.0)
    assert history.rate_hz("imu") == pytest.approx(100.0)
    history = history_of(device, 21.0)
    assert history.rate_hz("imu") == pytest.approx(50.0)
    history = history_of(device, 22.5)
    assert history.rate_hz("imu") == 0.0


def test_at_first_it_is_too_early_for_a_rate(device: Counting) -> None:
    assert CounterHistory({"imu": device}).rate_hz("imu") == 0.0
    history = history_of(device, 10.0)
    device.now_s = 10.0625
    assert history.rate_hz("imu") == 0.0


@pytest.mark.exhaustive
def test_a_shot_gets_the_counts_around_it(device: Counting) -> None:
    history = history_of(device, 19.0, needed_from_s=12.0)
    span = history.spans(12.1, 13.1)["imu"]
    assert span.from_s == pytest.approx(12.0)
    assert (span.before.received, span.after.received) == (200, 325)
    assert history.spans(18.1, 19.5)["imu"].after.received == 900
    device.now_s = 19.2
    assert history.spans(18.1, 19.5)["imu"].after.received == 920


@pytest.mark.exhaustive
def test_what_nobody_needs_any_more_is_dropped_but_for_one_before(device: Counting) -> None:
    history = history_of(device, 19.0, needed_from_s=18.0)
    # two seconds back, for the rate, and one before that
    assert history.spans(0.0, 1.0)["imu"].from_s == pytest.approx(16.75)
    kept = history_of(device, 19.0, needed_from_s=11.1)
    assert kept.spans(0.0, 1.0)["imu"].from_s == pytest.approx(11.0)


@pytest.mark.real_time
def test_a_shot_before_the_first_count_gets_the_first_or_that_of_now(device: Counting) -> None:
    history = history_of(device, 11.0)
    span = history.spans(9.0, 9.5)["imu"]
    assert (span.from_s, span.before.received, span.after.received) == (10.0, 0, 0)
    nothing = CounterHistory({"imu": device}).spans(9.0, 9.5)["imu"]
    assert (nothing.from_s, nothing.before.received, nothing.after.received) == (9.0, 100, 100)


def read(block: Block, empty_s: float) -> Block:
    """A block of a device that was last found empty at a time."""
    return replace(block, empty_ns=round(1e9 * empty_s))


def window_of(blocks: list[Block], trigger: Trigger = TRIGGER) -> ShotWindow:
    engine = CaptureEngine([bus(), port()], trigger)
    engine.arm(-math.inf)
    for block in sorted(blocks, key=lambda block: block.host_ns):
        engine.arrived(block)
        engine.take(block)
    (window,) = engine.ready(math.inf)
    return window


def of_bus(times_s: list[float], pulse_s: float, empty_s: float | None = None) -> list[Block]:
    """Frames of the bus, the pulse from a time on, found empty a moment before each, or last at a time."""
    return [
        read(can_block(t, can_record(t, 100.0 if t >= pulse_s else 0.0)), t - 0.005 if empty_s is None else empty_s)
        for t in times_s
    ]


def of_port(times_s: list[float], empty_s: float | None = None) -> list[Block]:
    return [
        read(serial_block(t, serial_frame(k, 1.0)), t - 0.005 if empty_s is None else empty_s)
        for k, t in enumerate(times_s)
    ]


def hundredths(start_s: float, stop_s: float) -> list[float]:
    return [round(0.01 * k, 2) for k in range(round(100 * start_s), round(100 * stop_s))]


def test_only_what_dated_the_trigger_moves_its_shot() -> None:
    steady = of_bus(hundredths(10, 12), 11.0)
    stood_still = [*of_port(hundredths(10, 10.5)), *of_port([11.4, 11.41], 10.5), *of_port(hundredths(11.5, 12))]
    assert window_of([*steady, *stood_still]).start_s == pytest.approx(11.0 - 0.2)
    late = [*of_bus(hundredths(10, 10.5), 11.0), *of_bus([11.4], 11.0, 10.5), *of_bus(hundredths(11.5, 12), 11.0)]
    window = window_of([*late, *of_port(hundredths(10, 12))])
    assert (window.trigger_s, window.start_s) == pytest.approx((11.4, 10.49 - 0.2), abs=0.011)


@pytest.mark.parametrize(("waited_s", "earlier_s"), [(0.01, 0.0), (0.04, 0.04), (0.12, 0.12)])
def test_the_rest_before_a_trigger_is_counted_from_when_its_frames_may_have_come(
    waited_s: float, earlier_s: float
) -> None:
    came = [t for t in hundredths(10, 12) if not 11.0 - waited_s < t < 11.0]
    frames = [
        read(can_block(t, can_record(t, 100.0 if t >= 11.0 else 0.0)), t - (waited_s if t == 11.0 else 0.005))
        for t in came
    ]
    window = window_of([*frames, *of_port(hundredths(10, 12))])
    assert (window.trigger_s, window.start_s) == pytest.approx((11.0, 11.0 - earlier_s - 0.2), abs=1e-6)


def test_what_waited_comes_in_several_blocks_and_the_last_of_them_is_as_late() -> None:
    waited = [*of_bus(hundredths(10, 10.5), 11.5), *of_bus([11.4, 11.41, 11.42], 11.42, 10.5)]
    window = window_of([*waited, *of_bus(hundredths(11.5, 12), 11.0), *of_port(hundredths(10, 12))])
    assert (window.trigger_s, window.start_s) == pytest.approx((11.42, 10.5 - 0.2))
    caught_up = [*of_bus(hundredths(10, 10.5), 11.5), *of_bus([11.4, 11.41], 11.5, 10.5)]
    window = window_of([*caught_up, *of_bus(hundredths(11.5, 12), 11.5), *of_port(hundredths(10, 12))])
    assert (window.trigger_s, window.start_s) == pytest.approx((11.5, 11.3))


def test_a_source_that_is_read_all_the_time_is_busy_and_not_late() -> None:
    busy = of_bus(hundredths(10, 15), 14.0, empty_s=10.0)
    assert window_of([*busy, *of_port(hundredths(10, 15))]).start_s == pytest.approx(14.0 - 0.2)


def test_where_all_conditions_must_be_met_each_of_them_dates_the_trigger() -> None:
    both = Trigger((Edge("pressure", 50e3, 20e3), Edge("rate", -2.0, -3.0)), "all", pre_s=0.2, post_s=0.3)
    late = [*of_bus(hundredths(10, 10.5), 11.0), *of_bus([11.4], 11.0, 10.5), *of_bus(hundredths(11.5, 12), 11.0)]
    rate = [read(serial_block(t, serial_frame(0, 4.0 if t < 11.45 else 1.0)), t - 0.005) for t in hundredths(10, 12)]
    window = window_of([*late, *rate], both)
    assert (window.trigger_s, window.start_s) == pytest.approx((11.45, 11.25), abs=0.02)


def test_a_source_that_cannot_be_decoded_ends_neither_the_watch_nor_the_others() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    engine.arm(-math.inf)

    class Backwards:
        def feed(self, block: Block) -> list[LiveSamples]:
            return [LiveSamples("pressure", np.array([block.host_ns / 1e9 - 1e-9, 0.0]), np.zeros(2))]

        def skip(self) -> None: ...

    engine._looks["port"]._needed = Backwards()  # type: ignore[assignment] - it says what it should not
    for block in blocks(2.0, pulse_s=1.0):
        engine.take(block)
    (window,) = engine.ready(math.inf)
    assert window.late_sources == ()
    assert [d.outcome for d in engine.news()] == ["trigger"]
    assert engine.new_faults() == ("port",)
    assert engine.new_faults() == ()
    assert "must not run backwards" in engine.faults["port"]
    assert engine.armed


def test_a_source_of_the_trigger_that_cannot_be_decoded_disarms_until_somebody_arms_again() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    engine.arm(-math.inf)
    engine._looks["bus"]._needed = None  # type: ignore[assignment] - what is not there decodes nothing
    engine._looks["bus"]._rest = object()  # type: ignore[assignment] - and this cannot
    engine.take(can_block(10.0, can_record(10.0, 0.0)))
    assert not engine.armed
    assert engine.faults["bus"].endswith("; the trigger looks at it: disarmed")
    engine.arm(10.0)
    engine.take(can_block(11.0, can_record(11.0, 0.0)))
    assert engine.armed
    engine.fire(12.0)
    assert engine.recording


def test_a_source_of_the_trigger_that_changes_disarms_and_another_one_does_not() -> None:
    engine = CaptureEngine([bus(), port()], TRIGGER)
    engine.arm(-math.inf)
    engine.take(event_block("port", 10_000_000_000, CHANGED, "unit of w is V, was rad/s"))
    assert engine.armed
    engine.take(event_block("bus", 10_100_000_000, CHANGED, "factor of NODE.p is 2, was 1"))
    assert not engine.armed
