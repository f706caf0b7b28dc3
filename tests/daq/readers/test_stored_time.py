"""Stored stamps that a clock's ticks rounded are the even instants that were rounded."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_acquisition.readers.containers.stored_time import resolution_of, time_from_stamps


@pytest.mark.parametrize("rate_hz", [20_000.0, 12_800.0, 9000.0, 999.7])
def test_stamps_of_coarse_ticks_keep_all_samples_and_their_rate(rate_hz):
    times = 1.2 + np.round(np.arange(8000) / rate_hz / 1e-4) * 1e-4
    found = time_from_stamps("c", times, resolution_of(times))
    assert (found.kept, found.dropped) == (None, 0)
    assert 1 / found.time_base.step_s == pytest.approx(rate_hz, rel=1e-9)
    assert found.note == f"its time resolves only 0.0001 s: rebuilt at {rate_hz:g} Hz"


def test_gaps_and_a_stamp_that_is_off_are_no_ticks():
    whole = 1e-4 * np.arange(8000)
    off = whole.copy()
    off[3] += 4e-5
    for times in (np.delete(whole, [500, 4000]), off):
        found = time_from_stamps("c", times, resolution_of(times))
        assert found.time_base.stamps_s is not None
        assert found.note == ""


def test_whole_milliseconds_are_ticks_too():
    times = np.round(np.arange(4000) / 1.6) * 1e-3
    found = time_from_stamps("c", times, 0.0)
    assert 1 / found.time_base.step_s == pytest.approx(1600.0)
    assert found.dropped == 0


@pytest.mark.parametrize("epoch_s", [1.7e18, -1.7e18, 1e308])
def test_times_that_no_recording_has_are_refused(epoch_s: float) -> None:
    with pytest.raises(ValueError, match="is longer than any recording"):
        time_from_stamps("c", epoch_s + 1e6 * np.arange(50.0), 1e-9)
