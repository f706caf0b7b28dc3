"""A zero that moved and noise that grew since before the last shot are named, and nothing else is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recoil_acquisition.capture.engine import Level
from recoil_acquisition.capture.status import ChannelStatus
from recoil_daq.live import rest_watch
from recoil_daq.live.rest_watch import AFTER_S, RestWatch
from tests.builders.live_status import BRAKE


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now_s = [100.0]
    monkeypatch.setattr(rest_watch.time, "monotonic", lambda: now_s[0])
    return now_s


def at(middle: float, noise: float) -> ChannelStatus:
    return replace(BRAKE, level=Level(middle, middle - noise / 2, middle + noise / 2))


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("after", "text"),
    [
        (at(1.5e6, 2e4), None),
        (at(1.62e6, 2e4), None),
        (at(1.71e6, 2e4), "zero of p_brake +210 kPa since before 0003"),
        (at(1.29e6, 2e4), "zero of p_brake -210 kPa since before 0003"),
        (at(1.5e6, 5e4), None),
        (at(1.5e6, 8.4e4), "noise of p_brake 4.2 times that before 0003"),
        (at(1.71e6, 5e5), "noise of p_brake 25.0 times that before 0003"),
        (replace(BRAKE, level=None), None),
        (replace(at(1.71e6, 2e4), range=None), None),
    ],
)
def test_what_rests_otherwise_than_before_the_last_shot(
    clock: list[float], after: ChannelStatus, text: str | None
) -> None:
    rest = RestWatch()
    assert rest.look((at(1.5e6, 2e4),)) == ()
    rest.fired("0003", 100.5)
    clock[0] = 101.0
    assert rest.look((at(9e6, 5e6),)) == ()
    clock[0] = 100.5 + AFTER_S + 0.1
    assert rest.look((after,)) == (() if text is None else (text,))


@pytest.mark.real_time
def test_what_moves_while_it_is_disarmed_does_not_rest_for_a_while(clock: list[float]) -> None:
    rest = RestWatch()
    rest.look((at(1.5e6, 2e4),))
    rest.fired("0003", 100.5)
    clock[0] = 110.0
    rest.moved(109.9)
    assert rest.look((at(9e6, 5e6),)) == ()
    clock[0] = 110.0 + AFTER_S
    assert len(rest.look((at(9e6, 2e4),))) == 1


@pytest.mark.real_time
def test_before_the_first_shot_there_is_nothing_to_compare_with(clock: list[float]) -> None:
    rest = RestWatch()
    for _ in range(100):
        clock[0] += 1.0
        assert rest.look((at(clock[0] * 1e5, 2e4),)) == ()
    rest.fired("0001", 50.0)  # of which nothing is known any more
    clock[0] += 10.0
    assert rest.look((at(0.0, 2e4),)) == ()
