"""What an engineer at the range sees on the armed screen, whatever the terminal's size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_daq.live.notice_board import Notice
from recoil_daq.live.range_state import RangeShot
from recoil_daq.live.screen.screen_look import WARNING, Look
from recoil_daq.live.screen.screen_picture import STATE_STYLES, picture
from recoil_daq.live.shot import ShotState
from tests.armed_screens import SCREENS, screens_of
from tests.builders.live_status import BRAKE, CAN, EVERYTHING, IMU, RATE, state_of, status
from tests.builders.range_states import CAMPAIGN, SIZES, STATES, day, line_of, lines_of, screen_text


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


def test_jargon_is_shown_only_where_it_is_bad() -> None:
    text = "\n".join(lines_of(day()))
    assert "behind" not in text
    assert "queue" not in text


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
