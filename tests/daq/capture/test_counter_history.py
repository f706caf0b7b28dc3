"""What the devices had counted at past moments."""

from __future__ import annotations

from typing import Any

import pytest

from recoil_acquisition.capture import engine as module
from recoil_acquisition.capture.engine import CounterHistory
from recoil_acquisition.devices.device import Counters


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
