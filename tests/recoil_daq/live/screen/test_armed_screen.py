"""The armed screen in a terminal: what it prints and takes away, what it reads, and how it gives the terminal back."""

from __future__ import annotations

import contextlib
import io
import os
import re
import select
import sys
import threading
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from recoil_daq.live.range_state import RangeShot, RangeState
from recoil_daq.live.screen import armed_screen
from recoil_daq.live.screen.armed_screen import ArmedScreen
from recoil_daq.live.shot import ShotState
from tests.builders.live_status import RATE
from tests.builders.range_states import SPOILT, day, usable

DOCUMENT = {
    "shot": "0001", "rig": "mixed", "file": "shots/0001.h5", "usable": True, "reasons": [],
    "quality": [{"channel": "can", "check": "error frames", "verdict": "warn", "detail": "1 error frame"}],
    "channels": [{"name": "p_brake", "clock": "can", "rate_hz": 2000.0, "samples": 4000}],
}  # fmt: skip
MANY = tuple(replace(RATE, name=f"rate_{i}") for i in range(30))


def made(width: int = 80, height: int = 24, **options: Any) -> ArmedScreen:
    options = {"file": io.StringIO(), "color_system": None, **options}
    return ArmedScreen(Console(width=width, height=height, highlight=False, emoji=False, **options))


def state_with(screen: ArmedScreen, **changes: Any) -> RangeState:
    """Return a state that has the notices which the screen was given, as the range makes it."""
    return day(notices=screen.noticed, **changes)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the host's time, which a test sets."""
    now_s = [100.0]
    monkeypatch.setattr(armed_screen.time, "monotonic", lambda: now_s[0])
    return now_s


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


@pytest.mark.real_time
def test_each_notice_is_to_be_seen_once_and_stays_when_the_screen_is_taken_away(clock: list[float]) -> None:
    file = io.StringIO()
    command = (
        "finish it with `recoil-daq ingest rigs/recoil_rigs/mixed.toml shots/captures/0002.rdlog FILES --out shots`"
    )
    with made(file=file, force_terminal=True) as screen:
        for i in range(4):
            clock[0] += 1
            screen.notice(f"{i}: {command}")
            screen.show(state_with(screen, channels=MANY))
        screen.verdict(DOCUMENT)
        clock[0] += 1
        screen.show(state_with(screen, channels=MANY))
        seen = left_on_terminal(file.getvalue(), 24)
        assert seen[-1] == " no keys here: Ctrl-C quits"
        assert sum(line.startswith(" ARMED ") for line in seen) == 1  # one picture
        text = "".join(seen)
        assert [text.count(f"{i}: finish it with") for i in range(4)] == [1] * 4
        assert text.count("shot 0001 usable, 1 warning") == 1
    left = left_on_terminal(file.getvalue(), 24)
    assert [line[11:] for line in left[:4]] == [f"{i}: {command}" for i in range(4)]  # in one piece, to be copied
    assert left[4][11:] == "shot 0001 usable, 1 warning"
    assert len(left) == 5
    assert file.getvalue().count("\x1b[?25l") == file.getvalue().count("\x1b[?25h") == 1  # the cursor is back


def test_what_is_not_usable_says_why_in_the_line_of_its_verdict() -> None:
    file = io.StringIO()
    with made(width=200, file=file) as screen:
        screen.verdict({**DOCUMENT, "usable": False, "reasons": ["p_breech at the end of its range", "no rest"]})
    assert "shot 0001 not usable, 1 warning: p_breech at the end of its range" in file.getvalue()


def test_a_row_that_is_not_in_the_shot_log_is_said() -> None:
    file = io.StringIO()
    with made(width=200, file=file) as screen:
        screen.verdict({**DOCUMENT, "log_fault": "shotlog.csv: line 3 holds a zero byte"})
    assert "shot log of 0001: shotlog.csv: line 3 holds a zero byte" in file.getvalue()


@pytest.mark.real_time
def test_what_is_said_before_and_after_the_session_is_printed_at_once(clock: list[float]) -> None:
    file = io.StringIO()
    with made(file=file, force_terminal=True) as screen:
        screen.notice("a journal was left over")
        assert "a journal was left over" in file.getvalue()
        screen.show(state_with(screen))
        assert file.getvalue().count("a journal was left over") == 1
        screen.notice("trigger")
        assert "trigger\n" not in file.getvalue()
        clock[0] += 1
        screen.show(state_with(screen, state="stopped"))
        screen.notice("identify shot 0001")
        assert file.getvalue().count("identify shot 0001") == 1


@pytest.mark.real_time
def test_what_is_suppressed_again_and_again_is_one_line_with_a_count(clock: list[float]) -> None:
    file = io.StringIO()
    with made(width=120, height=40, file=file, force_terminal=True) as screen:
        screen.show(state_with(screen))
        for i in range(37):
            screen.notice(f"suppressed: within the holdoff (p_brake at 8.{i} MPa)", same=("suppressed", 0))
        screen.notice("shot 0003 captured")
        screen.notice("suppressed: within the holdoff (p_brake at 8.1 MPa)", same=("suppressed", 0))
        clock[0] += 1
        screen.show(state_with(screen))
    shown = [line[11:] for line in left_on_terminal(file.getvalue(), 40) if "suppressed" in line]
    assert shown == ["suppressed: within the holdoff (p_brake at 8.1 MPa), 38 times"]


@pytest.mark.real_time
def test_it_draws_five_times_per_second_at_most(clock: list[float]) -> None:
    file = io.StringIO()
    with made(file=file, force_terminal=True) as screen:
        for tenth in range(21):
            clock[0] = 100.0 + tenth / 10 + 1e-6 * tenth
            screen.show(day())
        assert file.getvalue().count(" ARMED ") == 11


def test_a_notice_of_another_thread_waits_for_the_next_picture() -> None:
    file = io.StringIO()
    with made(file=file, force_terminal=True) as screen:
        thread = threading.Thread(target=screen.notice, args=("trigger (p_brake)",))
        thread.start()
        thread.join()
        assert "trigger (p_brake)" not in file.getvalue()
        screen.show(state_with(screen))
        assert "trigger (p_brake)" in file.getvalue()


@pytest.mark.real_time
def test_an_alarm_rings_once(clock: list[float]) -> None:
    file = io.StringIO()
    with made(file=file, force_terminal=True) as screen:
        for alert in ("", "ALARM: p_breech crossed", "ALARM: p_breech crossed, 2 times", "", "imu LOST"):
            clock[0] += 1
            screen.show(day(alert=alert))
    assert file.getvalue().count("\a") == 2


def test_a_terminal_of_another_encoding_gets_what_it_can_show() -> None:
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding="ascii")
    with made(file=file, force_terminal=True) as screen:
        screen.notice("left alone: \udcff中.csv")
        screen.show(day())
    assert file.errors == "strict"
    file.flush()
    assert rb"left alone: \udcff?.csv" in raw.getvalue()
    assert b"#.......^..........." in raw.getvalue()


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")
def test_keys_are_read_while_it_is_shown_and_the_terminal_is_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    import termios

    master, slave = os.openpty()
    before = termios.tcgetattr(slave)
    with os.fdopen(slave, "r") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        screen = made(force_terminal=True)

        def pressed(key: bytes) -> str:
            os.write(master, key)
            select.select([terminal], [], [], 5.0)
            return screen.key()

        with contextlib.suppress(ZeroDivisionError), screen:
            assert screen.look.has_keys
            assert pressed(b"D") == "d"
            assert not screen.look.words
            assert pressed(b"w") == ""  # the screen's own
            assert screen.look.words
            assert pressed(b"W") == ""
            assert not screen.look.words
            raise ZeroDivisionError("as anything may fail meanwhile")
        assert termios.tcgetattr(slave) == before
        assert not screen.look.has_keys
    os.close(master)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")
def test_the_screen_gives_the_terminal_back_when_something_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    import termios

    master, slave = os.openpty()
    before = termios.tcgetattr(slave)
    file = io.StringIO()
    console = Console(file=file, width=80, height=24, force_terminal=True)
    with os.fdopen(slave, "r") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        with pytest.raises(ZeroDivisionError), ArmedScreen(console) as screen:
            screen.show(day(shots=day().shots[: 1 // 0]))
        assert termios.tcgetattr(slave) == before
    os.close(master)
    assert "\x1b[?25h" in file.getvalue()  # the cursor is shown again


def test_each_verdict_rings_once_and_twice_where_the_shot_is_not_usable(clock: list[float]) -> None:
    file = io.StringIO()
    with made(file=file, force_terminal=True) as screen:

        def rings_of(*shots: RangeShot) -> int:
            before = file.getvalue().count("\a")
            for _ in range(6):
                clock[0] += 0.21
                screen.show(day(shots=shots))
            return file.getvalue().count("\a") - before

        assert rings_of(usable("0001", age_s=900.0)) == 0  # of before
        assert rings_of(usable("0001", age_s=900.0), usable("0002", age_s=1.0)) == 1
        assert rings_of(usable("0002", age_s=3.0), SPOILT) == 2
        assert rings_of(usable("0002", age_s=3.0), SPOILT) == 0
        assert rings_of(usable("0002", age_s=3.0), replace(SPOILT, state=ShotState.USABLE)) == 1  # made anew
        assert rings_of(replace(usable("0004", age_s=1.0), seen=True)) == 0


def test_a_text_that_is_typed_may_have_any_letter_and_the_words_have_their_key_otherwise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    screen = made()
    pressed = list("wWaW")
    monkeypatch.setattr(screen._keyboard, "key", lambda *, typed=False: pressed.pop(0))  # noqa: ARG005 - as the keyboard's
    assert [screen.key(typed=True), screen.key(), screen.key(), screen.key(typed=True)] == ["w", "", "a", "W"]
    assert screen.look.words
