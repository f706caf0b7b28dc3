"""What the armed screen says of each shot: what it waits for, verdict, mass, and warnings in words."""

from __future__ import annotations

from dataclasses import replace

from recoil_daq.live.range_state import RangeShot
from recoil_daq.live.screen.screen_look import Look
from recoil_daq.live.screen.screen_picture import picture
from recoil_daq.live.screen.screen_shots import COLOURED_S
from recoil_daq.live.shot import ShotState
from tests.builders.range_states import CLIPPED, STATES, day, line_of, lines_of, usable


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


def test_shots_say_what_they_wait_for_and_why_they_failed() -> None:
    shots = (
        RangeShot("0001", ShotState.FAILED, settled=True, why="the disk is full"),
        RangeShot("0002", ShotState.WAITING),
        RangeShot("0003", ShotState.CONVERTING),
        RangeShot("0004", ShotState.CUTTING),
        RangeShot("0006", ShotState.WAITING, ("daq",), left_s=4.0, growing=("0006_camera.csv",)),
        RangeShot("0005", ShotState.NOT_WHOLE, why="0005_camera.csv grew after it was taken"),
    )
    lines = lines_of(day(shots=shots), 120, 40)
    for line in (
        "0001  FAILED: the disk is full", "0002  waiting for its turn", "0003  being converted",
        "0004  captured, being cut",
        "0006  waiting for the rest of 0006_camera.csv, daq, 4 s left",
        "0005  NOT WHOLE: 0005_camera.csv grew after it was taken",
    ):  # fmt: skip
        assert line in lines
