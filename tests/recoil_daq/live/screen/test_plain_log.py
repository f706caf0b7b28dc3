"""A live session as lines: what is told, when, and what a log that cannot be written does."""

from __future__ import annotations

import io
import re
import threading
from dataclasses import replace

import pytest
from rich.console import Console

from recoil_acquisition.devices.device import Counters
from recoil_daq.live.screen import plain_log, repeated_notices
from recoil_daq.live.screen.plain_log import PlainLog
from recoil_daq.live.shot import LiveShot, ShotState
from recoil_daq.terminal.console import PIPED_WIDTH
from recoil_daq.terminal.ingest import print_verdict
from tests.builders.live_status import CAN, IMU, state_of, status

STAMP = r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3}Z  "
DOCUMENT = {
    "shot": "0001", "rig": "mixed", "file": "shots/0001.h5", "usable": False,
    "reasons": ["p_brake: 31 samples at 16 MPa"],
    "channels": [{"name": "p_brake", "clock": "can", "rate_hz": 2000.0, "samples": 4000}],
    "quality": [{"channel": "p_brake", "check": "range", "verdict": "fail", "detail": "31 samples at 16 MPa"}],
}  # fmt: skip


class Clock:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 3.0
        monkeypatch.setattr(plain_log.time, "monotonic", lambda: self.now_s)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def test_every_line_has_its_time_in_utc() -> None:
    stream = io.StringIO()
    log = PlainLog(stream)
    log.show(state_of(status()))
    log.notice("trigger")
    lines = stream.getvalue().splitlines()
    assert len(lines) == 2
    assert all(re.match(STAMP, line) for line in lines)


@pytest.mark.real_time
def test_without_a_change_it_tells_every_minute(clock: Clock) -> None:
    stream = io.StringIO()
    log = PlainLog(stream)
    for tenths in range(1805):
        clock.now_s = 3.0 + tenths / 10
        log.show(state_of(status()))
    assert len(stream.getvalue().splitlines()) == 4


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"state": "recording"}, "recording | can"),
        ({"sources": (replace(CAN, counters=Counters(counter_gaps=2)), IMU)}, "losses 2 gaps | imu"),
        ({"sources": (CAN, replace(IMU, age_s=3.2))}, "imu 34.0 kB/s, age 3.20 s"),
        ({"sources": (CAN, replace(IMU, error="unplugged"))}, "losses none, STOPPED: unplugged"),
    ],
)
def test_a_change_is_told_at_once_but_once_per_second(clock: Clock, changes, told: str) -> None:
    stream = io.StringIO()
    log = PlainLog(stream)
    log.show(state_of(status()))
    clock.now_s += 0.5
    log.show(state_of(status(**changes)))
    assert len(stream.getvalue().splitlines()) == 1
    clock.now_s += 0.5
    log.show(state_of(status(**changes)))
    assert told in stream.getvalue().splitlines()[1]
    clock.now_s += 5
    log.show(state_of(status()))
    assert len(stream.getvalue().splitlines()) == 3


@pytest.mark.real_time
def test_an_alarm_is_told_once_and_what_is_to_be_looked_at_stands_in_the_line(clock: Clock) -> None:
    stream = io.StringIO()
    log = PlainLog(stream)
    state = state_of(status(state="disarmed"))
    for crossings in range(5):
        alert = f"ALARM: p_brake crossed while disarmed, {crossings} times" if crossings else ""
        log.show(
            replace(state, alarms=crossings, alert=alert, cautions=("zero of p_brake +210 kPa since before 0003",))
        )
        clock.now_s += 1.5
    lines = stream.getvalue().splitlines()
    assert len(lines) == 2
    assert " | look at: zero of p_brake +210 kPa since before 0003" in lines[0]
    assert "ALARM: p_brake crossed while disarmed, 1 times" in lines[1]


@pytest.mark.real_time
def test_the_same_again_and_again_is_a_count(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(repeated_notices.time, "monotonic", lambda: clock.now_s)
    stream = io.StringIO()
    with PlainLog(stream) as log:
        for _ in range(500):
            log.notice("suppressed: within the holdoff")
            clock.now_s += 0.01
        log.notice("trigger")
        for _ in range(1500):
            log.notice("suppressed: within the holdoff")
            clock.now_s += 0.01
        log.show(state_of(status()))
        log.notice("shot 0001 captured")
        log.notice("shot 0002 captured")
    told = [line[26:] for line in stream.getvalue().splitlines() if " | " not in line]
    assert told == [
        "suppressed: within the holdoff",
        "499 times more in 5.0 s, last: suppressed: within the holdoff",
        "trigger",
        "suppressed: within the holdoff",
        "1000 times more in 10.0 s, last: suppressed: within the holdoff",
        "499 times more in 5.0 s, last: suppressed: within the holdoff",
        "shot 0001 captured",
        "shot 0002 captured",
    ]


def test_a_source_that_was_never_heard_and_data_that_waits_are_named() -> None:
    stream = io.StringIO()
    never = replace(IMU, age_s=None, rate_hz=0.0)
    PlainLog(stream).show(state_of(status(sources=(never,), unsynced_s=2.4, unseen_bytes=77)))
    assert "imu 0.0 kB/s, never heard" in stream.getvalue()
    assert "unsynced 2.4 s | the trigger fell behind by 77 bytes" in stream.getvalue()


def test_the_verdict_is_the_table_of_the_ingest_command() -> None:
    stream, expected = io.StringIO(), io.StringIO()
    PlainLog(stream).verdict(DOCUMENT)
    print_verdict(DOCUMENT, Console(file=expected, width=PIPED_WIDTH, highlight=False, emoji=False))
    lines = stream.getvalue().splitlines()
    assert all(re.match(STAMP, line) for line in lines)
    assert [line[26:] for line in lines] == expected.getvalue().splitlines()
    assert "range, see below" in stream.getvalue()
    assert "NOT USABLE: p_brake: 31 samples at 16 MPa" in stream.getvalue()


def test_a_notice_of_another_thread_does_not_wait_for_the_reader_of_the_log() -> None:
    stream = io.StringIO()
    with PlainLog(stream) as log:
        thread = threading.Thread(target=log.notice, args=("trigger",))
        thread.start()
        thread.join()
        assert stream.getvalue() == ""
        log.notice("shot 0001 captured")
        thread = threading.Thread(target=log.notice, args=("refused",))
        thread.start()
        thread.join()
    assert [line[26:] for line in stream.getvalue().splitlines()] == ["trigger", "shot 0001 captured", "refused"]


class Pipe(io.RawIOBase):
    """Takes no more than a number of writes, and remembers them."""

    def __init__(self, writes: int) -> None:
        self.left = writes
        self.written: list[bytes] = []

    def writable(self) -> bool:
        return True

    def write(self, data) -> int:
        if not self.left:
            raise BrokenPipeError(32, "Broken pipe")
        self.left -= 1
        self.written.append(bytes(data))
        return len(data)


def test_every_line_is_flushed_at_once() -> None:
    pipe = Pipe(2)
    log = PlainLog(io.TextIOWrapper(io.BufferedWriter(pipe), encoding="utf-8"))
    log.notice("one")
    assert pipe.written[0].endswith(b"one\n")
    log.notice("two")
    assert pipe.written[1].endswith(b"two\n")


def test_a_log_that_cannot_be_written_ends_no_session_and_says_so_once(capsys) -> None:
    pipe = Pipe(1)
    stream = io.TextIOWrapper(io.BufferedWriter(pipe), encoding="utf-8")
    with PlainLog(stream) as log:
        for text in ("one", "two", "three"):
            log.notice(text)
        log.show(state_of(status()))
        log.verdict(DOCUMENT)
    assert len(pipe.written) == 1
    assert capsys.readouterr().err == "the log cannot be written: Broken pipe; the session goes on\n"
    pipe.left = 100  # else the stream would complain when it is closed


def test_a_name_that_the_stream_cannot_write_is_written_in_escapes() -> None:
    pipe = Pipe(5)
    log = PlainLog(io.TextIOWrapper(io.BufferedWriter(pipe), encoding="latin-1"))
    log.notice("left alone: \udcff 中 µ.csv")
    assert pipe.written[0].endswith(b"left alone: \\udcff \\u4e2d \xb5.csv\n")


def test_the_log_tells_changes_at_once_and_repeats_itself_seldom() -> None:
    stream = io.StringIO()
    with PlainLog(stream) as log:
        log.show(state_of(status(), [LiveShot("0002", state=ShotState.WAITING)]))
        log.show(state_of(status(), [LiveShot("0002", state=ShotState.WAITING)]))
        log.notice("trigger\n(by hand)")
    first, second = stream.getvalue().splitlines()
    assert "armed | can 8000 frames/s, age 0.01 s, losses none | imu 34.0 kB/s" in first
    assert "shots 2, 1 not finished | disk 83.2 GB free" in first
    assert second[10] == " "
    assert second[23] == "Z"
    assert second.endswith("trigger (by hand)")


def test_the_log_has_no_keys() -> None:
    assert PlainLog(io.StringIO()).key() == ""
