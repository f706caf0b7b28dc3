"""Decisions of the trigger as people learn them: of what goes on all day as few are kept as anybody needs."""

from __future__ import annotations

import pytest

from recoil_acquisition.capture.live_source import LiveChannel
from recoil_acquisition.quantities.quantity import UNITS
from recoil_acquisition.trigger import Decision, Edge, Trigger
from recoil_acquisition.trigger.decision import Suppression
from recoil_daq.live import trigger_decisions
from recoil_daq.live.trigger_decisions import TriggerDecisions
from tests.builders.range_session import Told

PRESSURE = LiveChannel("p", "M.p", 1e6, 0.0, "Pa", (0.0, 16e6), "MPa", UNITS["MPa"])


def taken() -> tuple[TriggerDecisions, list[Decision], list[float]]:
    kept: list[Decision] = []
    moved: list[float] = []
    trigger = Trigger((Edge("p", 1.5e6, 1e6),))
    return TriggerDecisions(trigger, {"p": PRESSURE}, Told(), kept, moved.append), kept, moved


def crossing(at_s: float, *, reason: str = Suppression.NOT_ARMED) -> Decision:
    return Decision(at_s, "suppressed" if reason else "trigger", reason, "p", 0, 1, 2e6, at_s)


def test_of_what_crosses_all_day_the_first_and_the_last_are_kept_and_the_others_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(trigger_decisions, "MOST_ALIKE", 3)
    decisions, kept, moved = taken()
    for at_s in range(10):
        decisions.take(crossing(float(at_s)))
    assert [one.time_s for one in kept] == [0.0, 1.0, 9.0]
    assert (decisions.left_out, decisions.alarms) == (7, 10)
    assert decisions.last is not None
    assert decisions.last.count == 10
    assert len(moved) == 10
    decisions.take(crossing(11.0, reason=""))
    decisions.take(crossing(12.0))
    assert [one.time_s for one in kept] == [0.0, 1.0, 9.0, 11.0, 12.0]


def test_what_crosses_for_a_part_of_the_time_is_a_shot_and_all_the_time_is_noise() -> None:
    for crossed_s, fires in (((10.0, 10.05), False), ((10.05, 10.3, 10.5, 10.7), True)):
        decisions, _, _ = taken()
        decisions.begin_rest()
        for at_s in crossed_s:
            decisions.take(crossing(at_s, reason=""))
        text = decisions.fired_at_rest(10.0, 1.0)
        assert text.startswith("the trigger fires at rest, in 1 s: p crossed 1.5 MPa 4 times") == fires
        decisions.take(crossing(12.0))
        assert bool(decisions.alarm) != fires  # what is noise alarms nobody until somebody arms
