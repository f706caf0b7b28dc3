"""What the armed screen says of each source: rate, age, losses, the files that are waited for."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recoil_acquisition.devices.device import Counters
from recoil_daq.live.range_state import source_state
from recoil_daq.live.screen.screen_look import Look
from recoil_daq.live.screen.screen_picture import picture
from tests.builders.live_status import BRAKE, CAN, EVERYTHING, IMU, state_of, status
from tests.builders.range_states import SOURCES, day, line_of, lines_of


@pytest.mark.parametrize("width", [60, 80, 120])
def test_ages_rates_and_warnings_are_never_cut(width: int) -> None:
    sources = (replace(CAN, counters=EVERYTHING), replace(IMU, age_s=None, error="the adapter is gone " * 9))
    state = state_of(
        status(sources=sources, unsynced_s=2.44, unseen_bytes=7700, journal_bytes=36_000_000_000, armed_s=3725.0)
    )
    lines = lines_of(replace(state, disk_free_bytes=900_000_000), width, 40)
    text = " ".join(lines)
    for seen in ("disk 0.9 GB", "disk 2.4 s behind", "trigger behind by 7.70 kB"):
        assert seen in text
    if width > 60:
        assert "8000 frames/s     0.01 s" in line_of(lines, "can")
        assert "34.0 kB/s          never" in line_of(lines, "imu")
    else:
        assert "can live   imu STOPPED never" in text
    assert max(map(len, lines)) <= width


def test_all_losses_are_named_on_eighty_columns() -> None:
    sources = (replace(CAN, counters=EVERYTHING), IMU)  # the skipped bytes are those of the damaged frame
    lines = lines_of(state_of(status(sources=sources)))
    at = lines.index(line_of(lines, "can"))
    told = " ".join(line[lines[at].index("3 gaps") :].strip() for line in lines[at : at + 3])
    assert told == "3 gaps, 12 dropped by the kernel, 1 damaged, 2 reconnects, 7 error frames"
    assert line_of(lines, "imu").endswith("none")


def test_an_error_does_not_hide_what_was_lost() -> None:
    gone = replace(CAN, error="unplugged", counters=Counters(counter_gaps=1))
    assert "unplugged; 1 gap" in line_of(lines_of(state_of(status(sources=(gone, IMU)))), "can")


def test_no_losses_are_green_only_where_something_was_received() -> None:
    for age, styles in ((0.01, {"green"}), (None, {"bold red"})):
        drawn = picture(state_of(status(sources=(replace(CAN, age_s=age),))), Look(80, 24)).lines
        row = next(line for line in drawn if line.plain.startswith("can "))
        of_end = {str(span.style) for span in row.spans if row.plain[span.start : span.end].startswith("none")}
        assert ("green" in of_end) == (age is not None)
        assert styles <= {str(span.style) for span in row.spans}


def test_where_and_since_when_a_file_is_waited_for_is_said_and_how_much_of_it_is_there() -> None:
    growing = replace(SOURCES[3], growing=(("0003_camera.csv", 1_230_000),))
    wide = line_of(lines_of(day(sources=(growing,)), 120, 40), "camera")
    assert "0003 waits" in wide
    assert wide.endswith("in incoming/ for 12 s, 108 s left; 0003_camera.csv grows, 1.23 MB")
    assert line_of(lines_of(day(sources=(growing,))), "camera").endswith("in incoming/, 108 s left; 1.23 MB")
    assert "in incoming/ (made) for 12 s" in line_of(lines_of(day(folder_made=True), 120, 40), "camera")
    assert "no folder is watched: --watch FOLDER" in line_of(lines_of(day(watched=None), 120, 40), "camera")
    assert "camera: 0003 waits, 108 s left, 1.23 MB" in "\n".join(lines_of(day(sources=(growing,)), 60, 15))


@pytest.mark.parametrize("size", [(60, 15), (80, 24)])
def test_while_the_shots_are_completed_no_source_is_silent_and_only_the_keys_that_count_are_named(
    size: tuple[int, int],
) -> None:
    sources = tuple(replace(one, age_s=20.0, rate_hz=0.0) for one in (CAN, IMU))
    ended = state_of(status(state="stopped", sources=sources, channels=(replace(BRAKE, level=None),)))
    closed = [replace(one, state=source_state(one.live, lost=False, ended=True)) for one in ended.sources if one.live]
    ended = replace(ended, sources=tuple(closed))
    text = "\n".join(lines_of(ended, *size))
    assert "silent" not in text.lower()
    assert "20.00 s" not in text
    assert text.endswith("completing the shots; q or Ctrl-C gives up what is not")
    failed = replace(ended.sources[0], live=replace(CAN, error="unplugged"))
    assert "STOPPED" in "\n".join(lines_of(replace(ended, sources=(failed,)), *size))
