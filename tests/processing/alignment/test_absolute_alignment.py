from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import pytest

from recoil_acquisition.clocks.time_lock import TimeLock
from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.absolute_alignment import (
    MOST_EXPLAINED_S,
    WARNED,
    ClockTime,
    align_absolute,
    beside_second,
    without_second,
)


def clock(name: str, at: str, lock: TimeLock | None = TimeLock.PTP, zone: str = "UTC", said: str = "") -> ClockTime:
    return ClockTime(name, AbsoluteStart(f"2026-06-01T{at}", zone, "header", said), lock, 0.0, 0.5)


DAQ = clock("daq", "12:00:00.000000000")
BUS = clock("bus", "12:00:00.250000123")


def test_two_starts_give_the_offset_to_the_nanosecond_and_the_locks_its_uncertainty() -> None:
    found = align_absolute(BUS, DAQ)
    assert (found.status, found.method, found.drift) == ("ok", "absolute", 0.0)
    assert found.offset_s == pytest.approx(0.250000123, abs=1e-12)
    assert found.u_offset_s == pytest.approx(150e-9, rel=1e-3)
    assert found.u_drift == pytest.approx(2 * 150e-9, rel=1e-3)
    by_irig = align_absolute(replace(BUS, declared=TimeLock.IRIG_B), DAQ)
    assert by_irig.u_offset_s == pytest.approx(math.hypot(10e-6, 150e-9) / math.sqrt(2), rel=1e-3)
    assert align_absolute(BUS, DAQ, u_s=1e-5).u_offset_s == pytest.approx(1e-5, rel=1e-3)
    assert json.loads(json.dumps(found.details, allow_nan=False)) == found.details
    assert found.details["absolute"]["source"]["lock"] == "ptp"
    assert found.details["absolute"]["source"]["lock_by"] == "rig"


def test_starts_of_other_zones_are_the_same_instant_and_a_day_later_is_a_day() -> None:
    summer = clock("bus", "14:00:00.250000", zone="+02:00")
    assert align_absolute(summer, DAQ).offset_s == pytest.approx(0.25, abs=1e-12)
    later = replace(BUS, start=AbsoluteStart("2026-06-02T12:00:00.500000", "UTC", "header"))
    assert align_absolute(later, DAQ).offset_s == pytest.approx(86_400.5, abs=1e-9)
    local = [clock(name, at, zone="unknown") for name, at in (("bus", "12:00:01.000000"), ("daq", "12:00:00.000000"))]
    assert align_absolute(*local).offset_s == 1.0


@pytest.mark.parametrize(("digits", "u_s"), [("250", 2.9e-4), ("250000", 4e-7), ("250000000", 1.5e-7)])
def test_the_digits_of_a_start_are_part_of_the_uncertainty_whatever_is_stated(digits: str, u_s: float) -> None:
    found = align_absolute(clock("bus", f"12:00:00.{digits}"), DAQ, u_s=150e-9)
    assert found.u_offset_s == pytest.approx(u_s, rel=0.25)
    assert (found.status == "ok") is (digits != "250")


def test_the_stamps_and_the_rate_of_what_the_host_dated_are_part_of_it() -> None:
    found = align_absolute(BUS, DAQ, u_stamps_s=3e-5, drift=2e-5, u_drift=8e-5)
    assert found.u_offset_s == pytest.approx(math.hypot(3e-5, 2e-5), rel=1e-3)
    assert found.drift == 2e-5
    assert found.u_drift > 8e-5


@pytest.mark.parametrize(
    ("own", "says"),
    [
        (replace(BUS, start=None), "nothing says when the clock of bus was zero"),
        (clock("bus", "no time"), "nothing says when the clock of bus was zero"),
        (replace(BUS, declared=None), "nothing says what the clock of bus is locked to: declare `time`"),
        (replace(BUS, declared=TimeLock.FREE), "the clock of bus runs free"),
        (clock("bus", "12:00:00.25", said="PTP, unlocked"), r"runs free, by what it says itself \(PTP, unlocked\)"),
        (clock("bus", "12:00:00.25", zone="unknown"), "the zone of the start of bus is not known"),
        (replace(BUS, start=AbsoluteStart("1970-01-01T00:00:00", "UTC", "header")), "was never set"),
    ],
)
def test_a_clock_without_absolute_time_is_refused_with_the_reason(own: ClockTime, says: str) -> None:
    found = align_absolute(own, DAQ)
    assert (found.status, found.u_offset_s) == ("failed", math.inf)
    assert len(found.reasons) == 1
    assert re.search(says, found.reasons[0])


def test_what_the_recorder_says_of_its_lock_counts_before_the_rig() -> None:
    said = clock("bus", "12:00:00.250000000", TimeLock.PTP, said="GPS")
    found = align_absolute(said, DAQ)
    assert found.u_offset_s == pytest.approx(math.hypot(1e-6, 150e-9) / math.sqrt(2), rel=1e-3)
    assert found.details["absolute"]["source"]["lock_by"] == "instrument"


def test_records_that_do_not_overlap_are_not_of_one_shot() -> None:
    found = align_absolute(clock("bus", "12:00:01.750000"), DAQ)
    alone = without_second(found, clock("bus", "12:00:01.750000"), DAQ)
    assert alone.status == "failed"
    assert "the record of bus is 1.25 s away from that of daq" in alone.reasons[0]
    earlier = clock("bus", "11:59:59.000000")
    assert without_second(align_absolute(earlier, DAQ), earlier, DAQ).status == "failed"
    assert without_second(align_absolute(BUS, DAQ), BUS, DAQ).status == "ok"


def second(offset_s: float, u_s: float = 5e-6, status: str = "ok") -> ClockAlignment:
    reasons = () if status == "ok" else ("a second offset fits nearly as well",)
    return ClockAlignment("bus", offset_s, u_s, 1e-6, 1e-6, status, "motion", reasons, {"gain": 1.0})  # type: ignore[arg-type]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("apart_s", "status", "method"),
    [
        (1e-5, "ok", "absolute"),
        (2.1e-5, "ok", "absolute"),
        (2.5e-5, "ok", "motion"),
        (1e-3, "ok", "motion"),
        (0.99 * MOST_EXPLAINED_S, "ok", "motion"),
        (1.01 * MOST_EXPLAINED_S, "failed", "absolute"),
        (1.0, "failed", "absolute"),
    ],
)
def test_a_lock_that_is_wrong_is_used_then_warned_of_then_refused(
    sign: int, apart_s: float, status: str, method: str
) -> None:
    absolute = replace(align_absolute(BUS, DAQ, u_s=1e-5), drift=1e-6)
    found = beside_second(absolute, second(absolute.offset_s + sign * apart_s), 0.25)
    assert (found.status, found.method) == (status, method)
    assert (WARNED in found.details) == (method == "motion")
    assert found.details["second_apart_s"] == pytest.approx(sign * apart_s)
    assert found.details["absolute"]["offset_s"] == absolute.offset_s
    assert found.details["second_offset_s"] == pytest.approx(absolute.offset_s + sign * apart_s)
    if method == "motion":
        assert (found.offset_s, found.u_offset_s) == (absolute.offset_s + sign * apart_s, 5e-6)
    if status == "failed":
        assert "more than any lock explains" in found.reasons[0]


def test_offsets_are_compared_in_the_middle_of_the_record_where_drifts_part_them() -> None:
    absolute = align_absolute(BUS, DAQ, u_s=1e-5)
    drifting = replace(second(absolute.offset_s), drift=1e-4)
    assert beside_second(absolute, drifting, 0.0).details["second_apart_s"] == 0.0
    assert beside_second(absolute, drifting, 10.0).details["second_apart_s"] == pytest.approx(1e-3)


def test_a_second_opinion_in_doubt_replaces_nothing_and_its_doubt_is_said() -> None:
    absolute = align_absolute(BUS, DAQ, u_s=1e-5)
    for apart_s in (1e-3, 1.0):
        found = beside_second(absolute, second(absolute.offset_s + apart_s, status="ambiguous"), 0.25)
        assert (found.status, found.method) == ("ambiguous", "absolute")
        assert found.reasons[1] == "by motion: a second offset fits nearly as well"
    agreeing = beside_second(absolute, second(absolute.offset_s, status="ambiguous"), 0.25)
    assert (agreeing.status, agreeing.method) == ("ok", "absolute")


def test_where_there_is_no_absolute_time_the_second_opinion_is_used_aloud() -> None:
    free = align_absolute(replace(BUS, declared=TimeLock.FREE), DAQ)
    found = beside_second(free, second(0.25), 0.25)
    assert (found.status, found.method, found.offset_s) == ("ok", "motion", 0.25)
    assert found.details[WARNED] == (
        "there is no absolute time: the clock of bus runs free; motion is used in its place"
    )


def test_a_start_to_the_millisecond_leaves_the_offset_to_what_agrees_with_it() -> None:
    coarse = align_absolute(clock("bus", "12:00:00.250"), DAQ)
    found = beside_second(coarse, second(0.2502), 0.25)
    assert (found.status, found.method) == ("ok", "motion")
    assert "known to 0.29 ms only; motion agrees, and is used in its place" in found.details[WARNED]
