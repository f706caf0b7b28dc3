"""What an engineer at the range sees: the armed screen, the plain log, and the keys."""

from __future__ import annotations

import io
import os
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from daq.devices.device import Counters
from recoil_daq.armed_screen import ArmedScreen, meter
from recoil_daq.keyboard import Keyboard
from recoil_daq.live_shot import LiveShot
from recoil_daq.losses import losses_of
from recoil_daq.plain_log import PlainLog
from tests.builders.live_status import BRAKE, CAN, IMU, RATE, SILENT, status

SHOTS = (
    LiveShot("0001", state="usable"),
    LiveShot("0002", state="waiting", wanted={"camera", "dewetron"}, files={"camera": Path("x")}),
    LiveShot("0003", state="failed", problem="the disk is full"),
)


def drawn(width: int = 120, height: int = 40, **changes) -> list[str]:
    console = Console(file=io.StringIO(), width=width, height=height, highlight=False, color_system=None)
    screen = ArmedScreen("mixed", console)
    screen.notice("trigger (p_brake at 1.6e+06)")
    with console.capture() as captured:
        console.print(screen.picture(status(**changes), SHOTS))
    return captured.get().splitlines()


def line_of(lines: list[str], word: str) -> str:
    return next(line for line in lines if word in line)


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
    assert any("trigger (p_brake" in line for line in lines)


@pytest.mark.parametrize(("width", "height"), [(80, 24), (60, 20), (120, 40)])
def test_no_line_is_wider_and_no_picture_higher_than_the_terminal(width: int, height: int) -> None:
    many = tuple(replace(RATE, name=f"channel_{i}") for i in range(30))
    lines = drawn(width, height, channels=(*many, BRAKE))
    assert max(map(len, lines)) <= width
    assert len(lines) <= height
    assert any("p_brake" in line for line in lines)
    assert any(line.startswith("+") and line.endswith(" more") for line in lines)
    assert not any("more" in line for line in drawn(width, height))


def test_losses_are_named_in_words_and_none_if_there_are_none() -> None:
    assert losses_of(Counters()) == "none"
    assert losses_of(Counters(counter_gaps=1, bad=2)) == "1 gap, 2 damaged"


def test_the_log_tells_changes_at_once_and_repeats_itself_seldom() -> None:
    stream = io.StringIO()
    with PlainLog(stream) as log:
        log.show(status(), SHOTS)
        log.show(status(), SHOTS)
        log.notice("trigger\n(by hand)")
    first, second = stream.getvalue().splitlines()
    assert "armed | can 8000 frames/s, age 0.01 s, losses none | imu 34.0 kB/s" in first
    assert "shots 2, 1 not finished | disk 83.2 GB free" in first
    assert second[10] == " "
    assert second[23] == "Z"
    assert second.endswith("trigger (by hand)")


def test_the_log_has_no_keys() -> None:
    assert PlainLog(io.StringIO()).key() == ""


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")
def test_keys_come_one_by_one_and_the_terminal_is_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    import termios

    master, slave = os.openpty()
    before = termios.tcgetattr(slave)
    with os.fdopen(slave, "r") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        with Keyboard() as keyboard:
            assert not termios.tcgetattr(slave)[3] & (termios.ECHO | termios.ICANON)
            assert keyboard.key() == ""
            os.write(master, b"Tq")
            assert [keyboard.key(), keyboard.key(), keyboard.key()] == ["t", "q", ""]
        assert termios.tcgetattr(slave) == before
    os.close(master)


def test_without_a_terminal_there_are_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("q"))
    with Keyboard() as keyboard:
        assert keyboard.key() == ""


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
            screen.show(status(), SHOTS[: 1 // 0])
        assert termios.tcgetattr(slave) == before
    os.close(master)
    assert "\x1b[?25h" in file.getvalue()  # the cursor is shown again
