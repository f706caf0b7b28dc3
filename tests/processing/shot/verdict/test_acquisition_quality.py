"""What was lost on the way to the shot is told with its number, and judged by what it touches."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.devices.tick_clock import TICK_ANCHORS
from recoil_acquisition.shot.acquisition import AcquiredEvent
from recoil_acquisition.shot.quality_check import QualityCheck
from recoil_processing.shot.verdict.acquisition_quality import check_acquisition, check_clock_fits
from recoil_processing.shot.verdict.shot_quality import check_shot
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from tests.builders.bench_shots import ArrayRecording, bench_rig, bench_shot
from tests.builders.shots import CLOCK_FIT, acquired_source, make_acquisition

COUNTED = {
    "counted_frames": 10_000, "counter_gaps": 0, "missing_frames": 0, "unsized_gaps": 0, "longest_gap_frames": 0,
    "longest_gap_s": 0.0,
}  # fmt: skip
STREAM = {"received": 5000, "bytes": 100_000, "skipped_bytes": 0, "skipped_at_ends": 0, "bad_checksum": 0}


def recording(name: str = "0007.rdlog", **metadata: Any) -> ArrayRecording:
    return ArrayRecording({}, path=Path(name), metadata=metadata)


def by_check(checks: tuple[QualityCheck, ...], channel: str = "can") -> dict[str, QualityCheck]:
    found = {c.check: c for c in checks if c.channel == channel}
    assert len(found) == sum(c.channel == channel for c in checks)
    return found


def acquired(
    essential: bool = True,
    metadata: dict[str, Any] | None = None,
    given: str = "0007.rdlog",
    replaced: tuple[str, ...] = (),
    **source: Any,
) -> dict[str, QualityCheck]:
    """Check a live shot of one bus."""
    acquisition = make_acquisition(sources=(acquired_source("can", "can", "0007.rdlog", **source),))
    recordings = {"can": recording(given, **({"data_frames": 10_000} if metadata is None else metadata))}
    return by_check(check_acquisition(acquisition, recordings, {"can"} if essential else set(), replaced))


def test_a_sound_acquisition_has_no_warning() -> None:
    recordings = {"can": recording(**COUNTED), "imu": recording("0007.rdlog", **COUNTED, **STREAM)}
    found = check_acquisition(make_acquisition(), recordings, {"can", "imu"})
    assert {c.verdict for c in found} == {"ok"}
    assert by_check(found)["missing frames"].detail == "none of 10000 by the counter"
    assert by_check(found, "imu")["stream"].verdict == "ok"


def test_files_without_counter_and_acquisition_are_not_judged() -> None:
    assert check_acquisition(None, {"can": recording(data_frames=3)}, {"can"}) == ()


@pytest.mark.parametrize(
    ("lost", "essential", "verdict"),
    [
        ({"missing_frames": 8, "counter_gaps": 8, "longest_gap_frames": 1, "longest_gap_s": 2e-3}, True, "warn"),
        ({"missing_frames": 1, "counter_gaps": 1, "longest_gap_frames": 1, "longest_gap_s": 0.02}, True, "warn"),
        ({"missing_frames": 3, "counter_gaps": 1, "longest_gap_frames": 3, "longest_gap_s": 0.02}, True, "fail"),
        ({"missing_frames": 3, "counter_gaps": 1, "longest_gap_frames": 3, "longest_gap_s": 0.02}, False, "warn"),
        ({"missing_frames": 150, "counter_gaps": 150, "longest_gap_frames": 1, "longest_gap_s": 2e-3}, True, "fail"),
        ({"missing_frames": 150, "counter_gaps": 150, "longest_gap_frames": 1, "longest_gap_s": 2e-3}, False, "warn"),
        ({"missing_frames": 0, "counter_gaps": 1, "unsized_gaps": 1, "longest_gap_s": 0.2}, True, "fail"),
        ({"missing_frames": 0, "counter_gaps": 1, "unsized_gaps": 1, "longest_gap_s": 1e-3}, True, "warn"),
    ],
)
def test_missing_frames_are_judged_by_their_share_and_the_longest_gap(
    lost: dict[str, Any], essential: bool, verdict: str
) -> None:
    found = check_acquisition(None, {"can": recording(**COUNTED | lost)}, {"can"} if essential else set())
    check = by_check(found)["missing frames"]
    assert check.verdict == verdict
    whole = 10_000 + lost["missing_frames"]
    assert check.detail.startswith(f"{lost['missing_frames']} of {whole} (")
    assert f"in {lost['counter_gaps']} gaps" in check.detail
    assert "check the cable and the bus load before the next shot" in check.detail
    assert ("does not show how many" in check.detail) == ("unsized_gaps" in lost)


def test_a_single_missing_frame_fails_where_the_device_was_away() -> None:
    lost = COUNTED | {"missing_frames": 1, "counter_gaps": 1, "longest_gap_frames": 1, "longest_gap_s": 2e-3}
    events = (AcquiredEvent(0.1, "lost", "unplugged"), AcquiredEvent(0.25, "reopened", "after 3 tries"))
    found = acquired(metadata=lost, reopened=1, events=events)
    assert found["missing frames"].verdict == "fail"
    assert acquired(metadata=lost)["missing frames"].verdict == "warn"


@pytest.mark.parametrize(
    ("events", "gone"),
    [
        ([(0.1, "lost"), (0.25, "reopened")], "0.150"),
        ([(0.1, "lost"), (0.2, "reopened"), (0.5, "lost"), (0.55, "reopened")], "0.150"),
        ([(0.1, "lost"), (0.15, "lost"), (0.2, "reopened")], "0.100"),
        ([(0.9, "lost")], "0.100"),
        ([(-3.0, "lost"), (-0.4, "reopened")], "0.100"),
        ([(0.9, "lost"), (4.0, "reopened")], "0.100"),
    ],
)
@pytest.mark.parametrize("essential", [True, False])
def test_a_device_that_was_away_is_told_with_the_time_within_the_shot(
    events: list[tuple[float, str]], gone: str, essential: bool
) -> None:
    told = tuple(AcquiredEvent(at, name, "the adapter is gone") for at, name in events)
    check = acquired(essential, reopened=1, events=told)["connection"]
    assert check.verdict == ("fail" if essential else "warn")
    assert check.detail.startswith(f"was away for {gone} s of the shot")
    assert "(the adapter is gone)" in check.detail


def test_a_device_that_was_away_before_the_shot_is_a_warning() -> None:
    events = (AcquiredEvent(-1.5, "lost", ""), AcquiredEvent(-0.7, "reopened", ""))
    for told in (events, ()):
        check = acquired(reopened=1, events=told)["connection"]
        assert check.verdict == "warn"
        assert "lost and opened again 1 times around the shot, counted from -2.000 s" in check.detail


def test_a_source_that_delivered_nothing_fails() -> None:
    nothing = acquired_source("imu", "serial", "", blocks=0, bytes=0, pre_s=None)
    acquisition = make_acquisition(sources=(acquired_source("can", "can", "0007.rdlog"), nothing))
    check = by_check(check_acquisition(acquisition, {"can": recording()}, set()), "imu")["delivery"]
    assert (check.verdict, check.detail.split(":")[0]) == ("fail", "delivered nothing within the shot")


@pytest.mark.parametrize(
    ("source", "check", "says"),
    [
        ({"late": True}, "delivery", "had not delivered the whole span"),
        ({"error_frames": 7}, "error frames", "7 error frames on the bus, counted from -2.000 s"),
        ({"error_frames": 1}, "error frames", "1 error frame on the bus, counted from -2.000 s"),
        ({"bad": 3}, "damaged entries", "3 entries or frames came damaged"),
        ({"kernel_drops": 9}, "kernel drops", "the kernel dropped 9 frames"),
        ({"events": (AcquiredEvent(0.0, "unanswered", ""),) * 2}, "unanswered", "2 requests"),
    ],
)
def test_what_the_host_met_is_a_warning_with_its_number(source: dict[str, Any], check: str, says: str) -> None:
    found = acquired(**source)
    assert list(found) == [check]
    assert found[check].verdict == "warn"
    assert says in found[check].detail


@pytest.mark.parametrize("name", ["kernel_drops", "bad"])
def test_many_drops_fail_unless_a_counter_tells_what_is_missing(name: str) -> None:
    check = name.replace("_", " ") if name == "kernel_drops" else "damaged entries"
    assert acquired(**{name: 500})[check].verdict == "fail"
    assert acquired(essential=False, **{name: 500})[check].verdict == "warn"
    assert acquired(metadata=COUNTED, **{name: 500})[check].verdict == "warn"


def test_what_was_lost_live_fails_no_shot_that_has_the_instruments_own_file() -> None:
    losses = {"kernel_drops": 500, "bad": 500}
    assert {one.verdict for one in acquired(given="7.dmd", **losses).values()} == {"fail", "warn"}
    found = acquired(given="7.dmd", replaced=("can",), **losses)
    assert {name: one.verdict for name, one in found.items()} == {"kernel drops": "warn", "damaged entries": "warn"}


@pytest.mark.parametrize(
    ("stream", "counted", "verdict"),
    [
        ({"skipped_bytes": 30, "skipped_at_ends": 30}, False, "ok"),
        ({"skipped_bytes": 30, "skipped_at_ends": 10, "bad_checksum": 1}, False, "warn"),
        ({"skipped_bytes": 4000, "bad_checksum": 200}, False, "fail"),
        ({"skipped_bytes": 4000, "bad_checksum": 200}, True, "warn"),
    ],
)
def test_bytes_of_no_frame_are_told_unless_the_capture_just_begins_or_ends_there(
    stream: dict[str, int], counted: bool, verdict: str
) -> None:
    metadata = STREAM | stream | (COUNTED if counted else {})
    check = by_check(check_acquisition(None, {"imu": recording(**metadata)}, {"imu"}), "imu")["stream"]
    assert check.verdict == verdict
    if verdict != "ok":
        assert check.detail.startswith(f"{stream['skipped_bytes']} of 100000 bytes belong to no good frame")


@pytest.mark.parametrize(
    ("changes", "check", "verdict", "says"),
    [
        ({"pre_actual_s": 0.31}, "pre-time", "warn", "0.310 s of 0.500 s asked for"),
        ({"unseen_bytes": 4096}, "trigger", "warn", "4096 bytes are recorded, but the trigger did not look"),
        ({"lost_records": 3, "recovered": True}, "journal", "fail", "3 records of the journal"),
        ({"recovered": True}, "journal", "ok", "no record lost"),
    ],
)
def test_what_concerns_the_whole_shot_is_told_of_the_shot(
    changes: dict[str, Any], check: str, verdict: str, says: str
) -> None:
    recordings = {"can": recording(), "imu": recording("0007.rdlog")}
    (found,) = check_acquisition(make_acquisition(**changes), recordings, {"can"})
    assert (found.channel, found.check, found.verdict) == ("shot", check, verdict)
    assert says in found.detail


def test_the_source_with_too_little_pre_time_is_named() -> None:
    sources = (acquired_source("can", "can", "0007.rdlog", pre_s=0.2), acquired_source("imu", "serial", "0007.rdlog"))
    acquisition = make_acquisition(pre_actual_s=0.2, sources=sources)
    checks = check_acquisition(acquisition, {}, set())
    assert "(can 0.200 s)" in by_check(checks, "shot")["pre-time"].detail
    assert "0007.rdlog was not given" in by_check(checks)["file"].detail


def test_a_capture_of_another_shot_is_a_warning() -> None:
    acquisition = make_acquisition(sources=(acquired_source("can", "can", "0007.rdlog"),))
    check = by_check(check_acquisition(acquisition, {"can": recording("0008.rdlog")}, set()))["file names"]
    assert check.verdict == "warn"
    assert "acquired as 0007.rdlog, given as 0008.rdlog" in check.detail


def test_the_fit_of_a_clock_is_told_with_its_uncertainty_and_steps_warn() -> None:
    found = by_check(check_clock_fits({"can": CLOCK_FIT}))
    assert found["clock fit"].verdict == "ok"
    assert found["clock fit"].detail.startswith(
        "drift -12.5 +- 0.4 ppm against the host, offset u 2.5 us, 1 steps, 1200 frames"
    )
    assert "0.200 ms typically, 15.000 ms at most" in found["clock fit"].detail
    assert found["clock steps"].verdict == "warn"
    assert "stepped 1 times, taken out: +0.500000 s (u 3e-05 s) at 1.250 s" in found["clock steps"].detail


def test_the_anchors_of_ticks_are_told_with_their_drift() -> None:
    anchors = [{"tick": 1000 * k, "host_ns": k * 1_000_020_000, "u_ns": 9000 + k} for k in range(3)]
    found = by_check(check_clock_fits({"can": {"rate_hz": 1000.0, TICK_ANCHORS: anchors}}))["clock fit"]
    told = "3 anchors of its ticks on the host's clock, u 9 us at most"
    assert (found.verdict, found.detail) == ("ok", f"{told}; drift +20 +- 6 ppm over 2.00 s")
    anew = [*anchors, {"tick": 0, "host_ns": 9_000_000_000, "u_ns": 9000}]
    assert by_check(check_clock_fits({"can": {"rate_hz": 1e3, TICK_ANCHORS: anew}}))["clock fit"].detail == (
        told.replace("3", "4")
    )


def test_an_unknown_drift_and_wrong_stamps_are_told() -> None:
    found = by_check(check_clock_fits({"can": {**CLOCK_FIT, "steps": [], "u_drift": None, "wrong_stamps": 2}}))
    assert "+- unknown ppm" in found["clock fit"].detail
    assert "clock steps" not in found
    assert found["clock stamps"].verdict == "warn"
    assert found["clock stamps"].detail.startswith("2 of 1200 stamps")


def test_a_shots_own_acquisition_and_clocks_are_checked() -> None:
    source = acquired_source("recorder", "can", "file.csv", kernel_drops=500)
    shot = replace(bench_shot(), acquisition=make_acquisition(sources=(source,)), clock_fits={"recorder": CLOCK_FIT})
    recordings = {"recorder": ArrayRecording({}, metadata={"data_frames": 4000})}
    day = CalibrationDay(dt.date(2026, 6, 1), DayOf.START)
    found = by_check(check_shot(FiredShot(shot, bench_rig()), (), recordings, day), "recorder")
    assert found["kernel drops"].verdict == "fail"  # its channels have roles
    assert found["clock steps"].verdict == "warn"
