"""What the armed screen says of each channel: where it is, its trigger, and when it is silent."""

from __future__ import annotations

from dataclasses import replace

from recoil_acquisition.capture.engine import Level
from recoil_daq.live.screen.screen_look import Look
from recoil_daq.live.screen.screen_picture import picture
from tests.builders.live_status import BRAKE, CAN, IMU, RATE, SILENT, state_of, status
from tests.builders.range_states import day, line_of, lines_of


def test_the_trigger_is_marked_in_the_level_and_comes_first() -> None:
    others = tuple(replace(RATE, name=f"rate_{i}") for i in range(3))
    lines = lines_of(day(channels=(*others, replace(BRAKE, peak=(0.0, 12e6)))))
    brake = line_of(lines, "p_brake")
    bar = brake.split()[-1]
    assert bar.index("┃") == len(bar) // 2
    assert bar.index("▲") == 3 * len(bar) // 4
    assert bar.index("█") == 1
    assert lines.index(brake) < lines.index(line_of(lines, "rate_0"))
    for seen in ("1.520 MPa", "12.0 MPa", "8.00 MPa"):
        assert seen in brake


def test_a_channel_whose_source_is_silent_shows_no_old_value() -> None:
    silent = line_of(lines_of(state_of(status(sources=(replace(CAN, age_s=1.2), IMU)))), "p_brake")
    assert "silent" in silent
    assert "1.52" not in silent
    assert "█" not in silent


def test_what_is_outside_of_its_range_is_red() -> None:
    for level, colour in ((Level(17e6, 15e6, 17e6), "bold red"), (Level(1e6, 1e6, 1e6), "bold cyan")):
        drawn = picture(state_of(status(channels=(replace(BRAKE, level=level),))), Look(80, 24)).lines
        row = next(line for line in drawn if line.plain.startswith("p_brake"))
        assert colour in {str(s.style) for s in row.spans if row.plain[s.start : s.end] == "█"}


def test_channels_that_do_not_fit_are_counted_and_the_silent_among_them_named() -> None:
    many = tuple(replace(RATE, name=f"rate_{i}") for i in range(30))
    lines = lines_of(state_of(status(channels=(*many, SILENT, BRAKE))))
    shown = [line for line in lines if line.startswith(("rate_", "p_brake", "gyro"))]
    assert f"+{32 - len(shown)} more, 1 of them silent" in lines
    assert shown[0].startswith("p_brake")
    assert len(shown) > 10
    assert "1 silent" in line_of(lines_of(state_of(status(channels=(*many, SILENT, BRAKE))), 60, 15), "channel +")
