"""The record of a shot counts from before it to its end, and dates everything from its trigger."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recoil_acquisition.capture.session_record import LiveRecord, RecordedSource
from recoil_acquisition.capture.shot_record import CounterSpan, acquisition_of
from recoil_acquisition.devices.device import Counters
from recoil_acquisition.shot.acquisition import AcquiredSource
from recoil_acquisition.trigger import Decision, Edge, ShotWindow, Trigger
from tests.builders.live_sources import ANCHOR

RECORD = LiveRecord(
    "rig", "text", "rig.toml", {}, ANCHOR, (RecordedSource("bus", "can"), RecordedSource("port", "serial"))
)
TRIGGER = Trigger((Edge("pressure", 5e4),), pre_s=0.25, post_s=0.5)
WINDOW = ShotWindow(10.25, 10.5, 11.125, 0.125, {"bus": 0.25}, (), ("port",))


def bus_after(before: Counters, after: Counters) -> AcquiredSource:
    return acquisition_of("0001", RECORD, TRIGGER, WINDOW, {"bus": CounterSpan(10.0, before, after)}).sources[0]


def test_what_a_device_met_before_the_shot_is_not_counted_in_it() -> None:
    before = Counters(bad=3, kernel_drops=2, reopened=1, error_frames=5, queue_high_water=40)
    bus = bus_after(before, Counters(bad=10, kernel_drops=8, reopened=5, error_frames=8, queue_high_water=70))
    assert (bus.bad, bus.kernel_drops, bus.reopened, bus.error_frames) == (7, 6, 4, 3)
    assert bus.queue_high_water == 70
    assert bus.counted_from_s == -0.5


def test_drops_of_a_kernel_that_does_not_say_are_unknown_and_count_from_none_where_it_begins_to() -> None:
    assert bus_after(Counters(), Counters()).kernel_drops is None
    assert bus_after(Counters(kernel_drops=4), Counters()).kernel_drops is None
    assert bus_after(Counters(), Counters(kernel_drops=4)).kernel_drops == 4
    assert bus_after(Counters(kernel_drops=4), Counters(kernel_drops=4)).kernel_drops == 0


def test_a_source_whose_counters_are_not_known_has_counted_nothing_since_the_window_began() -> None:
    bus, port = acquisition_of("0001", RECORD, TRIGGER, WINDOW, {}).sources
    for source in (bus, port):
        assert (source.bad, source.kernel_drops, source.reopened, source.error_frames) == (0, None, 0, 0)
        assert source.counted_from_s == -0.25


def test_a_shot_has_each_source_of_its_session_with_its_pre_time_and_whether_it_came_late() -> None:
    sources = acquisition_of("0001", RECORD, TRIGGER, WINDOW, {}).sources
    told = [(source.name, source.kind, source.pre_s, source.late) for source in sources]
    assert told == [("bus", "can", 0.25, False), ("port", "serial", None, True)]
    # what the log has of them is not known yet
    assert {(source.file, source.blocks, source.bytes, source.late_s, source.events) for source in sources} == {
        ("", 0, 0, 0.0, ())
    }


def test_a_shots_record_has_what_was_asked_for_and_what_there_is() -> None:
    made = acquisition_of("0001", RECORD, TRIGGER, WINDOW, {})
    assert (made.shot, made.rig) == ("0001", "rig")
    assert (made.pre_s, made.post_s, made.pre_actual_s, made.duration_s) == (0.25, 0.5, 0.125, 0.875)
    assert (made.unseen_bytes, made.lost_records, made.recovered) == (0, 0, False)
    made = acquisition_of("0001", RECORD, TRIGGER, WINDOW, {}, unseen_bytes=5, lost_records=6, recovered=True)
    assert (made.unseen_bytes, made.lost_records, made.recovered) == (5, 6, True)


def test_decisions_are_dated_from_the_trigger() -> None:
    begun = Decision(10.5, "trigger", "", "pressure", 0, 50, 6e4, 10.5)
    again = replace(begun, time_s=10.75, outcome="suppressed", reason="why", channel="rate", value=None)
    made = acquisition_of("0001", RECORD, TRIGGER, replace(WINDOW, decisions=(begun, again)), {})
    told = [(one.time_s, one.outcome, one.reason, one.channel, one.value) for one in made.decisions]
    assert told == [(0.0, "trigger", "", "pressure", 6e4), (0.25, "suppressed", "why", "rate", None)]


@pytest.mark.parametrize(
    ("trigger_s", "ns", "utc"),
    [
        (1.0, 1_000_000_000, "2023-11-14T22:13:20.000000"),
        (10.5, 10_500_000_000, "2023-11-14T22:13:29.500000"),
        (3601.000000999, 3_601_000_000_999, "2023-11-14T23:13:20.000000"),
        (3601.000001, 3_601_000_001_000, "2023-11-14T23:13:20.000001"),
    ],
)
def test_a_trigger_is_dated_on_both_clocks_of_the_host(trigger_s: float, ns: int, utc: str) -> None:
    made = acquisition_of("0001", RECORD, TRIGGER, replace(WINDOW, trigger_s=trigger_s), {})
    assert (made.trigger_ns, made.trigger_utc) == (ns, utc)
