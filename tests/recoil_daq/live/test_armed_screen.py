"""What an engineer at the range sees on the armed screen, whatever the terminal's size."""

from __future__ import annotations

import contextlib
import io
import math
import os
import re
import select
import sys
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from recoil_acquisition.capture.engine import Level
from recoil_acquisition.devices.device import Counters
from recoil_daq.live import armed_screen
from recoil_daq.live.armed_screen import STATE_STYLES, ArmedScreen
from recoil_daq.live.screen_cells import METER_CELLS, meter
from recoil_daq.live.shot import LiveShot, ShotState
from tests.builders.live_status import BRAKE, CAN, IMU, RATE, SILENT, state_of, status

EVERYTHING = Counters(
    counter_gaps=3, kernel_drops=12, bad=1, skipped_bytes=40, reopened=2, error_frames=7, queue_high_water=99
)
DOCUMENT = {
    "shot": "0001", "rig": "mixed", "file": "shots/0001.h5", "usable": True, "reasons": [], "quality": [],
    "channels": [{"name": "p_brake", "clock": "can", "rate_hz": 2000.0, "samples": 4000}],
}  # fmt: skip
SHOTS = (
    LiveShot("0001", state=ShotState.USABLE),
    LiveShot("0002", state=ShotState.WAITING, wanted={"camera", "dewetron"}, files={"camera": Path("x")}),
    LiveShot("0003", state=ShotState.FAILED, problem="the disk is full"),
)


def made(width: int = 80, height: int = 24, **options) -> ArmedScreen:
    options = {"file": io.StringIO(), "color_system": None, **options}
    return ArmedScreen("mixed", Console(width=width, height=height, highlight=False, emoji=False, **options))


def lines_of(screen: ArmedScreen, shots=(), **changes) -> list[str]:
    with screen._console.capture() as captured:
        screen._console.print(screen.picture(state_of(status(**changes), shots)))
    return captured.get().splitlines()


def line_of(lines: list[str], word: str) -> str:
    return next(line for line in lines if line.startswith(word))


def drawn(width: int = 120, height: int = 40, **changes) -> list[str]:
    screen = made(width, height)
    screen.notice("trigger (p_brake at 1.6e+06)")
    return lines_of(screen, SHOTS, **changes)


@pytest.mark.parametrize(
    ("state", "colour"), [("armed", "green"), ("recording", "red"), ("disarmed", "yellow"), ("stopped", None)]
)
def test_the_first_line_is_the_state_across_the_screen_in_its_colour(state: str, colour: str | None) -> None:
    screen = made()
    first = screen.picture(state_of(status(state=state))).renderables[0]
    assert first.plain.startswith(f"   {state.upper()}   rig mixed")
    assert first.cell_len == 80
    assert first.style == STATE_STYLES[state]
    assert "reverse" in first.style
    assert colour is None or colour in first.style


@pytest.mark.parametrize("width", [60, 80, 120])
def test_ages_rates_and_warnings_are_never_cut(width: int) -> None:
    sources = (replace(CAN, counters=EVERYTHING), replace(IMU, age_s=None, error="the adapter is gone " * 9))
    lines = lines_of(made(width), sources=sources, unsynced_s=2.44, unseen_bytes=7700, journal_bytes=36_000_000_000)
    text = " ".join(lines)
    for seen in ("disk 83.2 GB (2.4 h)", "unsynced 2.4 s", "trigger behind by 7700 bytes"):
        assert seen in text
    assert re.search(r"8000 frames/s +0\.01 s", line_of(lines, "can"))
    assert re.search(r"34\.0 kB/s +never", line_of(lines, "imu"))
    assert max(map(len, lines)) <= width


def test_all_losses_are_named_on_eighty_columns() -> None:
    sources = (replace(CAN, counters=replace(EVERYTHING, skipped_bytes=0)), IMU)
    lines = lines_of(made(), sources=sources)
    at = lines.index(line_of(lines, "can"))
    told = " ".join(line[lines[at].index("3 gaps") :].strip() for line in lines[at : at + 2])
    assert told == "3 gaps, 12 dropped by the kernel, 1 damaged, 2 reconnects, 7 error frames"
    assert line_of(lines, "imu").endswith("none")


def test_an_error_does_not_hide_what_was_lost() -> None:
    gone = replace(CAN, error="unplugged", counters=Counters(counter_gaps=1))
    assert "unplugged; 1 gap" in line_of(lines_of(made(), sources=(gone, IMU)), "can")


def test_no_losses_are_green_only_where_something_was_received() -> None:
    screen = made(color_system="standard", force_terminal=True)
    heard, never = (
        line_of(
            [re.sub("^(\x1b\\[0m)*", "", line) for line in lines_of(screen, sources=(replace(CAN, age_s=age),))], "can"
        )
        for age in (0.01, None)
    )
    assert "\x1b[32mnone" in heard
    assert "\x1b[32mnone" not in never
    assert "\x1b[1;31m" in never[: never.index("never")]
    assert "\x1b[1;31m" not in heard


@pytest.mark.parametrize(
    ("disk", "written", "text"),
    [
        (2 * 10**9, 0, "disk 2.0 GB  "),
        (9 * 10**8, 0, "disk 0.9 GB  "),
        (35 * 10**8, 3725 * 10**6, "disk 3.5 GB (58 min)"),
        (35 * 10**8, 3725 * 10**6 * 8, "disk 3.5 GB (7 min)"),
    ],
)
def test_a_disk_that_is_nearly_full_is_a_warning(disk: int, written: int, text: str) -> None:
    first = made(120).picture(state_of(status(disk_free_bytes=disk, journal_bytes=written))).renderables[0]
    assert text in first.plain
    little = disk < 10**9 or "(7 min)" in text
    assert little == any(span.style == armed_screen.WARNING for span in first.spans)


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_trigger_is_marked_in_the_level_and_comes_first(width: int) -> None:
    others = tuple(replace(RATE, name=f"rate_{i}") for i in range(3))
    lines = lines_of(made(width), channels=(*others, BRAKE))
    brake = line_of(lines, "p_brake")
    bar = brake.split()[-1]
    assert 16 <= len(bar) <= METER_CELLS
    assert bar.index("┃") == len(bar) // 2
    assert bar.index("█") == 1
    assert lines.index(brake) < lines.index(line_of(lines, "rate_0"))
    assert "1.52 MPa" in brake
    assert ("1.40 .. 1.60 MPa" in brake) == (width < 110)
    assert ("1.40 MPa .. 1.60 MPa" in brake) == (width == 120)


def test_a_channel_whose_source_is_silent_shows_no_old_value() -> None:
    silent = line_of(lines_of(made(), sources=(replace(CAN, age_s=1.2), IMU)), "p_brake")
    assert "silent" in silent
    assert "1.52" not in silent
    assert "█" not in silent


def test_without_a_range_there_is_no_level_and_outside_of_it_is_red() -> None:
    assert meter(replace(BRAKE, range=None)) == ""
    above = replace(BRAKE, level=Level(17e6, 15e6, 17e6))
    assert meter(above).endswith("▒█")
    screen = made(color_system="standard", force_terminal=True)
    assert "\x1b[1;31m█" in "".join(lines_of(screen, channels=(above,)))
    assert "\x1b[1;36m█" in "".join(lines_of(screen, channels=(BRAKE,)))


numbers = st.floats(allow_nan=True, allow_infinity=True)


@given(numbers, numbers, numbers, st.one_of(st.none(), numbers.filter(math.isfinite)))
def test_the_level_is_drawn_or_left_out_for_whatever_a_sensor_sends(last, low, high, trigger) -> None:
    drawn = meter(replace(BRAKE, level=Level(last, low, high), triggers_at=trigger))
    if all(map(math.isfinite, (last, low, high))):
        assert len(drawn) == METER_CELLS
        assert drawn.count("█") == 1
    else:
        assert drawn == ""


def test_channels_that_do_not_fit_are_counted_and_the_silent_among_them_named() -> None:
    many = tuple(replace(RATE, name=f"rate_{i}") for i in range(30))
    lines = lines_of(made(), channels=(*many, SILENT, BRAKE))
    shown = [line for line in lines if line.startswith(("rate_", "p_brake", "gyro"))]
    assert f"+{32 - len(shown)} more, 1 of them silent" in lines
    assert shown[0].startswith("p_brake")
    assert len(shown) > 10


@settings(deadline=None, max_examples=60)
@given(
    st.integers(40, 140), st.integers(16, 50), st.integers(1, 30), st.integers(0, 9), st.integers(0, 9), st.booleans()
)
def test_no_picture_is_wider_than_the_terminal_or_fills_its_last_line(
    width: int, height: int, channels: int, shots: int, notices: int, lossy: bool
) -> None:
    screen = made(width, height)
    for i in range(notices):
        screen.notice(f"notice {i} " + "of some length " * 9)
    sources = (replace(CAN, counters=EVERYTHING if lossy else CAN.counters), IMU)
    many = tuple(replace(RATE, name=f"a_channel_with_quite_a_long_name_{i}") for i in range(channels))
    waiting = [LiveShot(f"{i:04d}", state=ShotState.WAITING, wanted={"camera", "dewetron"}) for i in range(shots)]
    lines = lines_of(screen, waiting, sources=sources, channels=many)
    assert max(map(len, lines)) <= width
    assert len(lines) < height
    assert "no keys here" in lines[-1]
    if shots and height >= 24:
        assert any(f"shot {shots - 1:04d}" in line for line in lines)


def test_the_last_shots_and_notices_are_listed() -> None:
    screen = made(120, 40)
    for i in range(8):
        screen.notice(f"notice {i}")
    shots = [LiveShot(f"{i:04d}", state=ShotState.WAITING, wanted={"camera", "dewetron"}) for i in range(9)]
    shots = [*(LiveShot(f"9{i:03d}", state=ShotState.USABLE) for i in range(9)), *shots]
    text = "\n".join(lines_of(screen, shots))
    assert re.findall(r"shot (\d+)  waiting for files of camera, dewetron", text) == [f"{i:04d}" for i in range(9)]
    assert re.findall(r"shot (\d+)  usable", text) == [f"9{i:03d}" for i in range(3, 9)]
    assert "more shots" not in text


def test_where_not_all_shots_have_room_the_rest_is_counted_by_what_it_is() -> None:
    shots = [LiveShot(f"{i:04d}", state=ShotState.WAITING, wanted={"camera"}) for i in range(2, 12)]
    shots.insert(0, LiveShot("0001", state=ShotState.USABLE))
    lines = lines_of(made(80, 16), shots)
    shown = [line for line in lines if line.startswith("shot ")]
    assert len(lines) <= 15
    counted = next(line for line in lines if "more shots" in line)
    more = 11 - len(shown)
    assert counted == f"+{more} more shots (0001 .. {more:04d}): 1 usable, {more - 1} waiting"
    assert shown[-1].startswith("shot 0011  waiting for files of camera")
    assert lines.index(counted) == lines.index(shown[0]) - 1


def test_a_notice_that_is_to_be_seen_above_the_picture_is_not_doubled_in_it() -> None:
    screen = made(120, 40)
    for i in range(8):
        screen.notice(f"notice {i}")
    assert "notice" not in "\n".join(lines_of(screen, SHOTS))


def test_notices_that_the_picture_hides_are_listed_in_it() -> None:
    screen = made(120, 18)
    for i in range(8):
        screen.notice(f"notice {i}")
    text = "\n".join(lines_of(screen, SHOTS[:2]))
    assert re.findall(r"\d\d:\d\d:\d\dZ  notice (\d)", text) == ["5", "6", "7"]


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_watched_folder_stands_in_the_head(width: int) -> None:
    console = Console(width=width, height=40, highlight=False, emoji=False, file=io.StringIO(), color_system=None)
    screen = ArmedScreen("mixed", console, watched=Path("/mnt/daq/incoming"))
    head = " ".join(lines_of(screen)[:3])
    assert "files from /mnt/daq/incoming" in head
    assert "files from" not in " ".join(lines_of(made(width)))


def test_columns_keep_their_place_when_numbers_get_shorter() -> None:
    screen = made()
    wide = replace(BRAKE, level=Level(-1.52e5, -1.4e5, -1.6e5))
    first = line_of(lines_of(screen, channels=(wide,)), "channel")
    assert line_of(lines_of(screen, channels=(replace(BRAKE, level=Level(0.0, 0.0, 0.0)),)), "channel") == first


def test_names_are_shown_as_they_are() -> None:
    odd = replace(BRAKE, name="p[red]_[/]", source="can[0]")
    lines = lines_of(made(), channels=(odd,), sources=(replace(CAN, name="can[0]"),))
    assert line_of(lines, "p[red]_[/]")
    assert line_of(lines, "can[0]")


def test_a_terminal_of_another_encoding_gets_what_it_can_show() -> None:
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding="ascii")
    with made(file=file, force_terminal=True) as screen:
        screen.notice("left alone: \udcff中.csv")
        screen.show(state_of(status()))
    assert file.errors == "strict"
    file.flush()
    assert rb"left alone: \udcff?.csv" in raw.getvalue()
    assert b".#=.......|........." in raw.getvalue()


def left_on_terminal(written: str, height: int) -> list[str]:
    """What a terminal of some height holds, with what scrolled away, after what was written on it."""
    rows, at, column = [""], 0, 0
    for code in re.findall(r"\x1b\[[?\d;]*[A-Za-z]|[\r\n]|[^\x1b\r\n]+", written):
        if code == "\n":
            at, column = at + 1, 0
            rows += [""] * (at + 1 - len(rows))
        elif code == "\r":
            column = 0
        elif code == "\x1b[1A":
            at = max(at - 1, len(rows) - height, 0)
        elif code == "\x1b[2K":
            rows[at] = ""
        elif not code.startswith("\x1b"):
            rows[at] = rows[at][:column].ljust(column) + code + rows[at][column + len(code) :]
            column += len(code)
    return [row.rstrip() for row in rows if row.strip()]


def test_notices_and_verdicts_stay_when_the_screen_is_taken_away(monkeypatch) -> None:
    now_s = 100.0
    monkeypatch.setattr(armed_screen.time, "monotonic", lambda: now_s)
    file = io.StringIO()
    command = (
        "finish it with `recoil-daq ingest rigs/recoil_rigs/mixed.toml shots/captures/0002.rdlog FILES --out shots`"
    )
    many = tuple(replace(RATE, name=f"rate_{i}") for i in range(30))
    with made(file=file, force_terminal=True) as screen:
        for i in range(3):
            now_s += 1
            screen.show(state_of(status(channels=many)))
            screen.notice(f"{i}: {command}")
        screen.verdict(DOCUMENT)
        now_s += 1
        screen.show(state_of(status(channels=many)))
        seen = left_on_terminal(file.getvalue(), 24)
        assert seen[-1] == " no keys here: Ctrl-C quits"
        assert sum("rig mixed   " in line for line in seen) == 1  # one picture
        assert "".join(seen).count("+1") == 1
    left = left_on_terminal(file.getvalue(), 24)
    assert [line[11:] for line in left[:3]] == [f"{i}: {command}" for i in range(3)]  # in one piece, to be copied
    assert left[3:] == [
        "Shot 0001 on rig mixed", "channel or clock  clock  rate, Hz  samples  verdict  finding",
        "p_brake           can        2000     4000  ok", "USABLE -> shots/0001.h5",
    ]  # fmt: skip
    assert file.getvalue().count("\x1b[?25l") == file.getvalue().count("\x1b[?25h") == 1  # the cursor is back


def test_it_draws_five_times_per_second_at_most(monkeypatch) -> None:
    now_s = 100.0
    monkeypatch.setattr(armed_screen.time, "monotonic", lambda: now_s)
    file = io.StringIO()
    with made(file=file, force_terminal=True) as screen:
        for tenth in range(21):
            now_s = 100.0 + tenth / 10 + 1e-6 * tenth
            screen.show(state_of(status()))
        assert file.getvalue().count("rig mixed") == 11


def test_a_notice_of_another_thread_waits_for_the_next_picture() -> None:
    file = io.StringIO()
    with made(file=file, force_terminal=True) as screen:
        thread = threading.Thread(target=screen.notice, args=("trigger (p_brake)",))
        thread.start()
        thread.join()
        assert "trigger (p_brake)" not in file.getvalue()
        screen.show(state_of(status()))
        assert file.getvalue().count("trigger (p_brake)") == 1  # above the picture, which leaves it room


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")
def test_keys_are_offered_and_read_where_there_is_a_terminal(monkeypatch) -> None:
    import termios

    master, slave = os.openpty()
    before = termios.tcgetattr(slave)
    with os.fdopen(slave, "r") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        screen = made(force_terminal=True)
        with contextlib.suppress(ZeroDivisionError), screen:
            assert lines_of(screen)[-1].strip().endswith("a arm  d disarm  t trigger  q quit")
            os.write(master, b"D")
            select.select([terminal], [], [], 5.0)
            assert screen.key() == "d"
            raise ZeroDivisionError("as anything may fail meanwhile")
        assert termios.tcgetattr(slave) == before
        assert "no keys here: Ctrl-C quits" in lines_of(screen)[-1]
    os.close(master)


def test_the_screen_says_state_time_shots_and_disk() -> None:
    head = drawn()[0]
    assert "ARMED" in head
    assert "rig mixed   1:02:05   shots 2   disk 83.2 GB" in head
    assert "RECORDING" in drawn(state="recording")[0]
    assert "unsynced 2.0 s" in drawn(unsynced_s=2.0)[0]
    assert "trigger behind by 77 bytes" in drawn(unseen_bytes=77)[0]
    assert "(2.4 h)" in drawn(journal_bytes=36_000_000_000)[0]


def test_a_source_shows_its_rate_its_age_and_what_it_lost() -> None:
    lossy = replace(CAN, counters=Counters(counter_gaps=3, kernel_drops=1, reopened=2))
    never = replace(IMU, age_s=None)
    lines = drawn(sources=(lossy, never))
    assert "8000 frames/s" in line_of(lines, "can  ")
    assert "3 gaps, 1 dropped by the kernel, 2 reconnects" in line_of(lines, "can  ")
    assert "34.0 kB/s" in line_of(lines, "imu  ")
    assert "never" in line_of(lines, "imu  ")
    stopped = drawn(sources=(replace(CAN, error="the adapter [is] gone"), IMU))
    assert "the adapter [is] gone" in line_of(stopped, "can  ")


def test_a_channel_shows_its_value_its_span_and_the_trigger_in_its_range() -> None:
    lines = drawn()
    brake = line_of(lines, "p_brake  ")
    assert "1.52 MPa" in brake
    assert "1.40 MPa .. 1.60 MPa" in brake
    assert "8.00 MPa" in brake
    assert meter(BRAKE) == "·█▒·······┃·········"
    assert "silent" in line_of(lines, "gyro_tipping")
    assert meter(SILENT) == ""
    assert meter(RATE).index("█") == 10


def test_shots_say_what_they_wait_for_and_why_they_failed() -> None:
    lines = drawn()
    assert "shot 0001  usable" in lines
    assert "shot 0002  waiting for files of dewetron" in lines
    assert "shot 0003  failed: the disk is full" in lines


@pytest.mark.parametrize(("width", "height"), [(80, 24), (60, 20), (120, 40)])
def test_no_line_is_wider_and_no_picture_higher_than_the_terminal(width: int, height: int) -> None:
    many = tuple(replace(RATE, name=f"channel_{i}") for i in range(30))
    lines = drawn(width, height, channels=(*many, BRAKE))
    assert max(map(len, lines)) <= width
    assert len(lines) <= height
    assert any("p_brake" in line for line in lines)
    assert any(line.startswith("+") and line.endswith(" more") for line in lines)
    assert not any("more" in line for line in drawn(width, height))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")
def test_the_screen_gives_the_terminal_back_when_something_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    import termios

    master, slave = os.openpty()
    before = termios.tcgetattr(slave)
    file = io.StringIO()
    console = Console(file=file, width=80, height=24, force_terminal=True)
    with os.fdopen(slave, "r") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        with pytest.raises(ZeroDivisionError), ArmedScreen("mixed", console) as screen:
            screen.show(state_of(status(), SHOTS[: 1 // 0]))
        assert termios.tcgetattr(slave) == before
    os.close(master)
    assert "\x1b[?25h" in file.getvalue()  # the cursor is shown again
