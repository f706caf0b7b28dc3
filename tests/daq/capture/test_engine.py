"""The engine turns blocks into decisions and windows of shots; beside it stands what the devices had counted."""

from __future__ import annotations

import math
from typing import Any

import pytest

from recoil_acquisition.capture import engine as module
from recoil_acquisition.capture.engine import PATIENCE_S, SETTLE_S, CaptureEngine, CounterHistory
from recoil_acquisition.devices.device import IDLE, Block, Counters, event_block
from recoil_acquisition.trigger import Edge, Trigger
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


def test_a_shot_gets_the_counts_around_it(device: Counting) -> None:
    history = history_of(device, 19.0, needed_from_s=12.0)
    span = history.spans(12.1, 13.1)["imu"]
    assert span.from_s == pytest.approx(12.0)
    assert (span.before.received, span.after.received) == (200, 325)
    assert history.spans(18.1, 19.5)["imu"].after.received == 900
    device.now_s = 19.2
    assert history.spans(18.1, 19.5)["imu"].after.received == 920


def test_what_nobody_needs_any_more_is_dropped_but_for_one_before(device: Counting) -> None:
    history = history_of(device, 19.0, needed_from_s=18.0)
    # two seconds back, for the rate, and one before that
    assert history.spans(0.0, 1.0)["imu"].from_s == pytest.approx(16.75)
    kept = history_of(device, 19.0, needed_from_s=11.1)
    assert kept.spans(0.0, 1.0)["imu"].from_s == pytest.approx(11.0)


def test_a_shot_before_the_first_count_gets_the_first_or_that_of_now(device: Counting) -> None:
    history = history_of(device, 11.0)
    span = history.spans(9.0, 9.5)["imu"]
    assert (span.from_s, span.before.received, span.after.received) == (10.0, 0, 0)
    nothing = CounterHistory({"imu": device}).spans(9.0, 9.5)["imu"]
    assert (nothing.from_s, nothing.before.received, nothing.after.received) == (9.0, 100, 100)
