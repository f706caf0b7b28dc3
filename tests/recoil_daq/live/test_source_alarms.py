"""A source that gives nothing good is an alarm within two seconds, where the estimate hangs on it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recoil_acquisition.devices.device import Counters
from recoil_daq.live.range_state import RangeSource, SourceState
from recoil_daq.live.source_alarms import SourceAlarms
from tests.builders.live_status import CAN, IMU


def alarms() -> SourceAlarms:
    return SourceAlarms({"can"}, {"imu"})


@pytest.mark.parametrize(
    ("name", "state", "age_s", "text"),
    [
        ("can", "silent", 1.3, "can SILENT: the trigger looks at it"),
        ("imu", "silent", None, "imu SILENT: check its supply and its cable"),
        ("imu", "silent", 1.1, ""),  # one that sends once a second is late by now and then
        ("imu", "lost", 0.3, "imu LOST: it is opened as soon as it is back"),
        ("aside", "lost", 0.3, "aside LOST: it is opened as soon as it is back"),
        ("aside", "silent", 9.0, ""),
        (
            "imu",
            "not understood",
            0.0,
            "imu NOT UNDERSTOOD: bytes come, none of them good: check baud rate, framing and cable",
        ),
        (
            "can",
            "not understood",
            0.0,
            "can NOT UNDERSTOOD: frames come, none of them good: check bit rate, termination and database",
        ),
        ("imu", "live", 0.0, ""),
        ("imu", "stopped", None, ""),
    ],
)
def test_each_way_of_giving_nothing_is_told_apart(
    name: str, state: SourceState, age_s: float | None, text: str
) -> None:
    live = replace(CAN if name == "can" else IMU, name=name, age_s=age_s)
    found = alarms().look([RangeSource(name, "serial", state, live)], 100.0)
    assert found == ((text,) if text else ())


@pytest.mark.parametrize(("share", "told"), [(0.5, "50 %"), (0.2, "20 %"), (0.05, "")])
def test_a_stream_of_which_a_part_is_rubbish_is_told_within_two_seconds_and_no_more_when_it_is_good(
    share: float, told: str
) -> None:
    watched, received, skipped, first_s = alarms(), 10_000, 0, 0.0
    for step in range(40):
        rubbish = share if step < 20 else 0.0
        received, skipped = received + 900, skipped + round(900 * rubbish)
        counters = Counters(received=received, counter_gaps=0, skipped_bytes=skipped)
        source = RangeSource("imu", "serial", "live", replace(IMU, counters=counters, age_s=0.0))
        found = watched.look([source], 100.0 + 0.2 * step)
        if found and not first_s:
            first_s = 0.2 * step
            assert f"imu SPOILT: {told} of its bytes belong to no good frame" in found[0]
    assert (0.0 < first_s < 2.0) == bool(told)
    assert not found


def test_a_few_bytes_between_two_frames_that_come_seldom_are_no_alarm() -> None:
    watched = alarms()
    for step in range(20):
        counters = Counters(received=40 * step, counter_gaps=0, skipped_bytes=20 * step)
        source = RangeSource("imu", "serial", "live", replace(IMU, counters=counters, age_s=0.0))
        assert watched.look([source], 100.0 + 0.5 * step) == ()


def test_a_bus_of_error_frames_is_spoilt() -> None:
    watched = alarms()
    for step in range(10):
        counters = Counters(received=40 * step, counter_gaps=None, error_frames=60 * step)
        found = watched.look([RangeSource("can", "can", "live", replace(CAN, counters=counters))], 100.0 + 0.2 * step)
    assert found == (
        "can SPOILT: 60 % of its frames belong to no good frame: check bit rate, termination and database",
    )
