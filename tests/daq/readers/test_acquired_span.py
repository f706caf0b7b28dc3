"""What a live source delivered of times outside the shot's window is not of the shot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.readers.acquired_span import AROUND_S, within_the_window
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.remark import NoteCode
from recoil_acquisition.shot.acquisition import Acquisition
from tests.builders.shots import acquired_source, make_acquisition

TRIGGER_NS, STEP_S = 7_000_000_000, 0.01
TRIGGER_UTC = "2026-03-01T09:15:00.750000"
WALL_NS = 1_772_356_500_750_000_000
"""The trigger's time of day since 1970."""


def recording(first_s: float, last_s: float, **clock: Any) -> Recording:
    """Return a recording of samples between two times from the trigger; its clock begins with the first."""
    base = TimeBase.uniform("imu", 0.0, STEP_S, round((last_s - first_s) / STEP_S) + 1)
    values = base.times_s + first_s
    channel = StoredChannel(
        SignalHeader("acc", "m/s2", base.count), base, lambda start, stop: values[start:stop].copy()
    )
    return Recording(Path("0007.rdlog"), "recoil-daq capture", [channel], **{"metadata": {}, **clock})


def by_fit(first_s: float, last_s: float, zero_ns: int = TRIGGER_NS, drift: float = 0.0) -> Recording:
    """Return a recording whose device's clock is fitted to the host's, which first stamped 20 ms late."""
    late_s = 0.02
    fit = {"host_zero_ns": zero_ns + round(1e9 * (first_s + late_s)), "offset_s": -late_s, "drift": drift}
    return recording(first_s, last_s, metadata={"clock_fit": fit})


def acquired(**changes: Any) -> Acquisition:
    window: dict[str, Any] = {
        "trigger_utc": TRIGGER_UTC,
        "pre_s": 0.5,
        "pre_actual_s": 0.5,
        "post_s": 1.0,
        "duration_s": 1.5,
    }
    sources = (acquired_source("imu", "serial", "0007.rdlog", late=True, late_s=1.2),)
    return make_acquisition(trigger_ns=TRIGGER_NS, sources=sources, **window | changes)


def kept(whole: Recording, acquisition: Acquisition | None = None) -> np.ndarray | None:
    """Return the times from the trigger of the samples that are the shot's."""
    part = within_the_window(whole, acquisition or acquired(), ["acc"])
    return None if part is None else part.read("acc")


@pytest.mark.parametrize("zero_ns", [TRIGGER_NS, WALL_NS])
def test_samples_of_the_next_shot_that_were_read_with_this_one_are_left_out_and_said(zero_ns: int) -> None:
    whole = by_fit(-0.6, 2.6, zero_ns)
    part = within_the_window(whole, acquired(), ["acc"])
    assert part is not None
    times_s = part.read("acc")
    assert times_s[0] == pytest.approx(-0.6)
    assert times_s[-1] == pytest.approx(1.0 + AROUND_S)
    (note,) = part.notes
    assert note.code is NoteCode.EXCERPT
    assert "up to 1.1 s behind the shot's window" in note
    assert "excerpt" not in part.metadata


def test_samples_of_the_shot_before_are_left_out() -> None:
    times_s = kept(by_fit(-2.0, 1.2))
    assert times_s is not None
    assert times_s[0] == pytest.approx(-0.5 - AROUND_S)
    assert times_s[-1] == pytest.approx(1.2)


def test_the_devices_drift_is_reckoned_with() -> None:
    times_s = kept(by_fit(-0.6, 2.6, drift=0.05))
    assert times_s is not None
    # its clock is 5 % slow: what it counts as 2.1 s from its first sample to the window's end are 2.0 s
    assert times_s[-1] == pytest.approx(-0.6 + 2.1 / 1.05, abs=STEP_S)


def test_a_recording_that_is_dated_by_the_host_is_cut_by_the_time_of_day() -> None:
    start = AbsoluteStart("2026-03-01T09:15:00.150000", "UTC", "host's clock at the first read")
    times_s = kept(recording(-0.6, 2.6, absolute_start=start))
    assert times_s is not None
    assert times_s[-1] == pytest.approx(1.0 + AROUND_S)


@pytest.mark.parametrize("whole", [by_fit(-0.9, 1.4), recording(-3.0, 9.0)])
def test_a_recording_about_the_window_or_of_a_clock_that_nothing_relates_stays_what_it_is(whole: Recording) -> None:
    assert within_the_window(whole, acquired(), ["acc"]) is whole


def test_a_source_of_which_all_was_taken_outside_the_window_delivered_nothing() -> None:
    assert kept(by_fit(-2.0, -1.3)) is None
    assert kept(by_fit(1.8, 2.9)) is None


def test_what_is_farther_off_than_anything_waited_is_of_another_clock() -> None:
    whole = by_fit(5000.0, 5002.0)
    assert within_the_window(whole, acquired(), ["acc"]) is whole


def test_an_acquisition_that_says_no_time_of_day_relates_nothing() -> None:
    whole = by_fit(-0.6, 2.6)
    assert within_the_window(whole, acquired(trigger_utc="noon"), ["acc"]) is whole
