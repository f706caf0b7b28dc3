"""What an engineer at the range sees on the armed screen, whatever the terminal's size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.capture.engine import Level
from recoil_acquisition.devices.device import Counters
from recoil_daq.live.notice_board import Notice
from recoil_daq.live.range_state import RangeShot, RangeState
from recoil_daq.live.screen_picture import COLOURED_S, STATE_STYLES, WARNING, Look, picture
from recoil_daq.live.shot import ShotState
from tests.armed_screens import SCREENS, screens_of
from tests.builders.live_status import BRAKE, CAN, IMU, RATE, SILENT, state_of, status
from tests.builders.range_states import CAMPAIGN, CLIPPED, SIZES, SOURCES, STATES, day, screen_text, usable

EVERYTHING = Counters(
    counter_gaps=3, kernel_drops=12, bad=1, skipped_bytes=40, reopened=2, error_frames=7, queue_high_water=99
)


def lines_of(state: RangeState, width: int = 80, height: int = 24, **look: bool) -> list[str]:
    return [line.plain.rstrip() for line in picture(state, Look(width, height, **look)).lines]


def line_of(lines: list[str], word: str) -> str:
    return next(line for line in lines if line.startswith(word))


@pytest.mark.parametrize("name", STATES)
def test_every_state_is_drawn_as_it_was_looked_at(name: str) -> None:
    """`python -m tests.armed_screens` writes them anew: look at each."""
    assert screens_of(name) == (SCREENS / f"{name}.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
@pytest.mark.parametrize("name", STATES)
def test_nothing_is_cut_off(name: str, size: tuple[int, int]) -> None:
    width, height = size
    text = screen_text(name, width, height)
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    assert len(text.splitlines()) < height


def test_six_channels_have_room_on_the_smallest_terminal() -> None:
    text = screen_text("waiting", 60, 15)
    assert sum(line.split()[0] in {one.name for one in STATES["waiting"].channels} for line in text.splitlines()) == 6


@pytest.mark.parametrize(
    ("state", "colour"), [("armed", "green"), ("recording", "red"), ("disarmed", "yellow"), ("stopped", None)]
)
def test_the_first_line_is_the_state_across_the_screen_in_its_colour(state: str, colour: str | None) -> None:
    first = picture(day(state=state), Look(80, 24)).lines[0]
    assert first.plain.startswith(f" {state.upper()} 0:41:07   mixed")
    assert first.cell_len == 80
    assert first.style == STATE_STYLES[state]
    assert "reverse" in first.style
    assert colour is None or colour in first.style


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


def test_jargon_is_shown_only_where_it_is_bad() -> None:
    text = "\n".join(lines_of(day()))
    assert "behind" not in text
    assert "queue" not in text


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


def test_a_verdict_is_in_colour_for_three_minutes() -> None:
    for age_s, coloured in ((COLOURED_S - 1.0, True), (COLOURED_S + 1.0, False)):
        for shot, colour in ((usable("0002", age_s=age_s), "green"), (replace(CLIPPED, age_s=age_s), "bold red")):
            drawn = picture(day(shots=(shot,)), Look(80, 24)).lines
            row = next(line for line in drawn if line.plain.startswith(shot.name))
            assert (colour in {str(span.style) for span in row.spans}) == coloured


def test_the_shots_on_the_way_come_first_and_those_without_a_row_are_counted_by_what_they_are() -> None:
    lines = lines_of(STATES["many"])
    assert lines[lines.index(line_of(lines, "0018")) + 1].startswith("0017  waiting for camera")
    assert "+15 more: 1 waiting, 13 usable, 1 not usable" in lines
    small = lines_of(STATES["many"], 60, 15)
    assert "camera: 0016 +2 wait, 106 s left" in small[1]
    assert "+16 more: 2 waiting, 13 usable, 1 not usable" in small
    assert line_of(lines_of(day(), 60, 15), "0003") == "0003 waiting for camera, 108 s left  +2 more"


def test_a_mass_says_what_speaks_against_it() -> None:
    rows = lines_of(STATES["many"], 120, 40)
    assert line_of(rows, "0015").endswith("783.0 +- 5.2 NOT VALID")
    assert line_of(lines_of(STATES["shot"]), "0003").endswith("783.0 +- 5.2 provisional")
    words = "\n".join(lines_of(day(shots=STATES["many"].shots), words=True))
    assert "- mass NOT VALID: one clock is ambiguous" in words


def test_warnings_are_read_in_words_and_each_is_there() -> None:
    lines = lines_of(STATES["words"], 120, 40, words=True)
    assert lines[-1].strip().endswith("w back  q quit")
    text = "\n".join(lines)
    for shot in STATES["words"].shots:
        assert f"shot {shot.name}: " in text
        assert shot.verdict is not None
        for sentence in (*shot.verdict.reasons, *shot.verdict.warned):
            assert f"- {sentence}" in text
    assert not any(line.startswith("p_breech") for line in lines)
    assert "no shot has a warning" in lines_of(day(shots=()), words=True)


def test_an_alarm_is_across_the_screen_and_a_question_in_place_of_the_keys() -> None:
    alarm = picture(STATES["alarm"], Look(80, 24)).lines[1]
    assert alarm.cell_len == 80
    assert alarm.style == "bold white on red"
    assert lines_of(STATES["quit"])[-1] == " ARMED: end the session? y yes, n go on"
    assert lines_of(day(), has_keys=False)[-1] == " no keys here: Ctrl-C quits"


def test_virtual_devices_a_full_disk_and_the_added_mass_stand_in_the_head() -> None:
    first = picture(day(virtual=True, added_mass="120 kg, u 0.1 kg"), Look(120, 24)).lines[0]
    assert "VIRTUAL" in [first.plain[s.start : s.end] for s in first.spans if s.style == WARNING]
    assert "next shot 0004   added 120 kg, u 0.1 kg" in first.plain
    full = picture(day(disk_free_bytes=10**8), Look(60, 15)).lines
    assert any(span.style == WARNING for line in full[:2] for span in line.spans)


def test_the_newest_notices_are_in_the_picture_and_it_says_from_which_on() -> None:
    notices = tuple(Notice(n, "2026-11-26T14:02:33+00:00", f"notice {n}") for n in range(5, 14))
    drawn = picture(day(notices=notices), Look(80, 24))
    shown = [line.plain for line in drawn.lines if "notice" in line.plain]
    assert shown == [f"14:02:33Z  notice {n}" for n in (12, 13)]
    assert drawn.first_notice == 12
    assert picture(day(notices=notices), Look(80, 24, words=True)).first_notice == 14
    counted = Notice(3, "2026-11-26T14:02:33+00:00", "suppressed: within the holdoff (p_brake at 8.1 MPa)", 37)
    last = "14:02:33Z  suppressed: within the holdoff (p_brake at 8.1 MPa), 37 times"
    assert last in lines_of(day(notices=(counted,)), 80, 24)


def test_what_the_shots_say_together_is_a_line_with_what_changed() -> None:
    assert "campaign of 2: 782.4 +- 3.6 kg, nothing changed" in lines_of(day())
    changed = {**CAMPAIGN, "changes": ["-6.0 kg since 0005"], "valid": False, "reason": "shots disagree"}
    text = " ".join(lines_of(day(campaign=changed), 80, 40))
    assert "campaign of 2: 782.4 +- 3.6 kg, -6.0 kg since 0005; NOT VALID: shots disagree" in text


def test_names_are_shown_as_they_are() -> None:
    odd = replace(BRAKE, name="p[red]_[/]", source="can[0]")
    lines = lines_of(state_of(status(channels=(odd,), sources=(replace(CAN, name="can[0]"),))))
    assert line_of(lines, "p[red]_[/]")
    assert line_of(lines, "can[0]")


def test_a_terminal_of_another_encoding_gets_what_it_can_show() -> None:
    text = "\n".join(lines_of(STATES["waiting"], ascii_only=True))
    assert text.isascii()
    assert "#......." in text


def test_shots_say_what_they_wait_for_and_why_they_failed() -> None:
    shots = (
        RangeShot("0001", ShotState.FAILED, settled=True, why="the disk is full"),
        RangeShot("0002", ShotState.WAITING),
        RangeShot("0003", ShotState.CONVERTING),
        RangeShot("0004", ShotState.CUTTING),
        RangeShot("0005", ShotState.NOT_WHOLE, why="0005_camera.csv grew after it was taken"),
    )
    lines = lines_of(day(shots=shots), 120, 40)
    for line in (
        "0001  FAILED: the disk is full", "0002  waiting for its turn", "0003  being converted",
        "0004  captured, being cut", "0005  NOT WHOLE: 0005_camera.csv grew after it was taken",
    ):  # fmt: skip
        assert line in lines


@settings(deadline=None, max_examples=60)
@given(
    st.integers(40, 140), st.integers(16, 50), st.integers(1, 30), st.integers(0, 9), st.integers(0, 9), st.booleans()
)
def test_no_picture_is_wider_than_the_terminal_or_fills_its_last_line(
    width: int, height: int, channels: int, shots: int, notices: int, lossy: bool
) -> None:
    told = tuple(Notice(n, "2026-11-26T14:02:33+00:00", f"notice {n} " + "of some length " * 9) for n in range(notices))
    sources = (replace(CAN, counters=EVERYTHING if lossy else CAN.counters), IMU)
    many = tuple(replace(RATE, name=f"a_channel_with_quite_a_long_name_{i}") for i in range(channels))
    waiting = tuple(RangeShot(f"{i:04d}", ShotState.WAITING, ("camera", "dewetron")) for i in range(shots))
    state = replace(state_of(status(sources=sources, channels=many)), shots=waiting, notices=told)
    lines = lines_of(state, width, height, has_keys=False)
    assert max(map(len, lines)) <= width
    assert len(lines) < height
    assert "no keys here" in lines[-1]
    if shots and height >= 24:
        assert any(line.startswith(f"{shots - 1:04d}") for line in lines)


def test_the_screens_that_are_kept_are_those_of_the_states() -> None:
    assert {path.stem for path in Path(SCREENS).iterdir()} == set(STATES)
