"""What a killed session had not yet decided is decided from its journal, as it would have been."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.capture.engine import SETTLE_S, CaptureEngine
from recoil_acquisition.capture.replay import outrun, replayed
from recoil_acquisition.devices.device import Block
from recoil_acquisition.trigger import Decision, Edge, Trigger
from recoil_acquisition.trigger.decision import MANUAL, Suppression
from tests.builders.live_sources import bus, can_block, can_record, port, serial_block, serial_frame

TRIGGER = Trigger((Edge("pressure", 50e3, 20e3),), pre_s=0.2, post_s=0.3)
SOURCES = [bus(), port()]


def blocks(pulses: set[int], count: int = 200, step_s: float = 0.01) -> list[Block]:
    """Both sources every so often; the pressure is beyond the level in the blocks of these numbers."""
    return [block for k in range(count) for block in blocks_at(k, step_s, k in pulses)]


@cache
def blocks_at(k: int, step_s: float, beyond: bool) -> tuple[Block, Block]:
    t = 10.0 + step_s * k
    return (
        can_block(t, can_record(t, 100.0 if beyond else 0.0)),
        serial_block(t, serial_frame(k, 80.0 if beyond else 1.0)),
    )


def decided(trigger: Trigger, recorded: list[Block]) -> list[Decision]:
    engine = CaptureEngine(SOURCES, trigger)
    engine.arm(-math.inf)
    for block in recorded:
        engine.take(block)
    engine.finish()
    return list(engine.news())


def told(decisions: list[Decision]) -> list[tuple[float, str, str]]:
    return [(decision.time_s, decision.outcome, decision.reason) for decision in decisions]


def test_recorded_decisions_give_the_same_window_again() -> None:
    recorded = blocks({100})
    engine = CaptureEngine(SOURCES, TRIGGER)
    engine.arm(-math.inf)
    for block in recorded:
        engine.take(block)
    (window,) = engine.ready(math.inf)
    held = {"bus": [(10.0, 11.99)], "port": [(10.0, 11.99)]}
    assert replayed(held, TRIGGER, engine.news()) == (window,)


def test_a_shot_that_a_crash_cut_short_ends_where_the_data_does() -> None:
    held = {"bus": [(10.0, 11.09)], "port": []}
    (window,) = replayed(held, TRIGGER, decided(TRIGGER, blocks({100}, 110)))
    assert window.trigger_s == pytest.approx(11.0)
    assert window.late_sources == ("bus", "port")


def pulsed(pressure: dict[float, float], rate: dict[float, float]) -> list[Block]:
    """Blocks at instants that a number of the machine holds exactly; the bus comes first of the two."""
    made = []
    for k, t in enumerate(sorted({*pressure, *rate})):
        made += [can_block(t, can_record(t, pressure[t]))] if t in pressure else []
        made += [serial_block(t, serial_frame(k, rate[t]))] if t in rate else []
    return made


EITHER = replace(TRIGGER, conditions=(Edge("pressure", 50e3, 20e3), Edge("rate", -50.0, -20.0, slope="falling")))


@pytest.mark.parametrize("extend", [True, False])
@pytest.mark.parametrize("holdoff_s", [0.0, 0.25])
def test_of_two_channels_that_cross_at_one_instant_the_second_begins_no_other_shot(
    holdoff_s: float, extend: bool
) -> None:
    trigger = replace(EITHER, holdoff_s=holdoff_s, extend=extend)
    recorded = pulsed({10.0: 0.0, 10.5: 100.0, 11.0: 0.0}, {10.0: 1.0, 10.5: 80.0, 11.0: 1.0})
    live = decided(trigger, recorded)
    assert [one.channel for one in live] == ["pressure", "rate"]
    assert outrun(SOURCES, trigger, recorded, []) == live
    # the first may have been decided while nothing counted
    (alone,) = outrun(
        SOURCES, trigger, recorded, [replace(live[0], outcome="suppressed", reason=Suppression.NOT_ARMED)]
    )
    assert (alone.channel, alone.outcome) == ("rate", "trigger")


@pytest.mark.parametrize("extend", [True, False])
@pytest.mark.parametrize("holdoff_s", [0.0, 0.25, 0.5, 0.75])
@pytest.mark.parametrize("post_s", [0.25, 0.5, 0.75])
def test_a_crossing_at_the_very_end_of_the_post_time_or_the_holdoff_is_decided_as_live(
    post_s: float, holdoff_s: float, extend: bool
) -> None:
    trigger = replace(TRIGGER, post_s=post_s, holdoff_s=holdoff_s, extend=extend)
    recorded = pulsed({10.0: 0.0, 10.5: 100.0, 10.75: 0.0, 11.0: 100.0, 11.25: 0.0, 11.5: 100.0}, {})
    live = decided(trigger, recorded)
    assert len(live) == 3
    assert outrun(SOURCES, trigger, recorded, []) == live
    assert [*live[:1], *outrun(SOURCES, trigger, recorded, live[:1])] == live


def test_neither_a_shot_by_hand_nor_what_was_suppressed_holds_off_a_crossing() -> None:
    trigger = replace(TRIGGER, holdoff_s=1.0)
    recorded = pulsed({10.0: 0.0, 10.5: 100.0}, {})
    (crossing,) = decided(trigger, recorded)
    for before in (
        replace(crossing, time_s=10.125, channel="", condition=MANUAL, index=MANUAL, value=None),
        replace(crossing, time_s=10.125, outcome="suppressed", reason=Suppression.HOLDOFF),
    ):
        assert outrun(SOURCES, trigger, recorded, [before]) == [crossing]
    (held_off,) = outrun(SOURCES, trigger, recorded, [replace(crossing, time_s=10.125)])
    assert (held_off.outcome, held_off.reason) == ("suppressed", Suppression.HOLDOFF)


def test_a_later_trigger_holds_off_no_crossing_before_it() -> None:
    recorded = pulsed({10.0: 0.0, 10.5: 100.0}, {})
    (crossing,) = decided(TRIGGER, recorded)
    assert outrun(SOURCES, TRIGGER, recorded, [replace(crossing, time_s=11.0)]) == [crossing]


@pytest.mark.parametrize(
    ("off_s", "channel", "again"),
    [
        (-SETTLE_S, "pressure", False),
        (SETTLE_S, "pressure", False),
        (-SETTLE_S - 0.125, "pressure", True),
        (SETTLE_S + 0.125, "pressure", True),
        (0.0, "rate", True),
    ],
)
def test_only_what_a_recorded_decision_of_its_channel_lies_next_to_is_not_decided_again(
    off_s: float, channel: str, again: bool
) -> None:
    recorded = pulsed({10.0: 0.0, 10.5: 100.0}, {})
    (crossing,) = decided(TRIGGER, recorded)
    before = replace(crossing, time_s=crossing.time_s + off_s, channel=channel)
    assert bool(outrun(SOURCES, TRIGGER, recorded, [before])) is again


def test_what_is_beyond_the_level_from_the_beginning_is_no_crossing() -> None:
    assert outrun(SOURCES, TRIGGER, pulsed({10.0: 100.0, 10.5: 100.0}, {}), []) == []


def test_what_was_read_late_makes_a_window_begin_where_it_may_have_arrived() -> None:
    (decision,) = decided(TRIGGER, pulsed({10.0: 0.0, 10.5: 100.0}, {}))
    held = {"bus": [(5.0, 20.0)], "port": [(5.0, 20.0)]}
    stalls = ((), [("bus", 9.5, 10.5)], [("bus", 8.0, 9.0)], [("port", 9.5, 10.5)])
    of = {"pressure": "bus", "rate": "port"}
    begins = [replayed(held, TRIGGER, [decision], each, of)[0].start_s for each in stalls]
    assert begins == pytest.approx([10.3, 9.3, 10.3, 10.3])


@pytest.mark.exhaustive
@given(
    pulses=st.sets(st.integers(1, 6).map(lambda k: 15 * k), max_size=5),
    watched=st.integers(0, 200),
    holdoff_s=st.sampled_from((0.0, 0.45, 1.0)),
    extend=st.booleans(),
    channel=st.sampled_from(("pressure", "rate")),
)
def test_a_kill_changes_no_decision(
    pulses: set[int], watched: int, holdoff_s: float, extend: bool, channel: str
) -> None:
    edge = Edge("pressure", 50e3, 20e3) if channel == "pressure" else Edge("rate", -50.0, -20.0, slope="falling")
    trigger = replace(TRIGGER, conditions=(edge,), holdoff_s=holdoff_s, extend=extend)
    recorded = blocks(pulses, 100, step_s=0.02)
    before = decided(trigger, recorded[:watched])
    assert told([*before, *outrun(SOURCES, trigger, recorded, before)]) == told(decided(trigger, recorded))


def test_what_was_suppressed_while_disarmed_is_not_decided_again() -> None:
    recorded = blocks({50})
    (seen,) = decided(TRIGGER, recorded)
    disarmed = replace(seen, outcome="suppressed", reason="not armed", time_s=seen.time_s + 0.02)
    assert outrun(SOURCES, TRIGGER, recorded, [disarmed]) == []


def test_a_missing_record_joins_no_two_halves_of_frames() -> None:
    falling = replace(TRIGGER, conditions=(Edge("rate", 50.0, 20.0),))
    head, tail = serial_frame(1, -80.0)[:4], serial_frame(1, -80.0)[4:]
    recorded = [serial_block(10.0, serial_frame(0, 0.0)), serial_block(10.1, head), serial_block(10.3, tail)]
    (joined,) = outrun(SOURCES, falling, recorded, [])
    assert joined.value == pytest.approx(80.0)
    assert outrun(SOURCES, falling, [*recorded[:2], None, recorded[2]], []) == []


def test_a_crossing_in_the_last_block_is_decided_although_no_other_source_has_come_so_far() -> None:
    recorded = [block for block in blocks({9}, 10) if block.source == "bus"]
    (found,) = outrun(
        SOURCES, replace(TRIGGER, conditions=(Edge("pressure", 50e3, 20e3), Edge("rate", 50.0, 20.0))), recorded, []
    )
    assert (found.channel, found.outcome) == ("pressure", "trigger")
