"""A live session keeps what happened, releases what it watched, and gives a shot all that arrived for it."""

from __future__ import annotations

import errno
import os
import queue
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import recoil_acquisition.capture.live_session
from recoil_acquisition.capture.engine import CaptureEngine
from recoil_acquisition.capture.live_session import LiveSession, _free_bytes
from recoil_acquisition.capture.live_source import LiveSamples
from recoil_acquisition.capture.session_record import LiveRecord, RecordedSource, operator_records
from recoil_acquisition.devices.device import Block, Counters, event_of
from recoil_acquisition.devices.reader_thread import DeviceReader
from recoil_acquisition.errors import DeviceError, StoreError
from recoil_acquisition.frames import can_rows
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import Kind
from recoil_acquisition.trigger import Edge, Trigger
from tests.builders.live_logs import rows_in
from tests.builders.live_sources import ANCHOR, bus, can_record

RECORD = LiveRecord("rig", "text", "rig.toml", {}, ANCHOR, (RecordedSource("bus", "can"),))
TRIGGER = Trigger((Edge("pressure", 50e3, rearm=20e3),), "any", pre_s=0.2, post_s=0.4)
EVERY_S = 0.01


class PlayedBus:
    """A device whose frames carry their number, and whose reads may stand still."""

    name, kind, counters = "bus", "can", Counters()

    def __init__(self) -> None:
        self.pressure_kpa: Callable[[int], float] = lambda _: 0.0
        self.began_s = time.monotonic()
        self.stops: queue.SimpleQueue[float] = queue.SimpleQueue()
        self.dated_s: list[float] = []  # of every frame
        self._next = 0
        self._empty_ns = time.monotonic_ns()

    def open(self) -> None:
        """Do nothing: it is open."""

    def read(self, timeout_s: float) -> Block | None:  # noqa: ARG002 - as a device has it
        """Return what was sent since the last read, twenty frames at most."""
        time.sleep(EVERY_S)
        while not self.stops.empty():
            time.sleep(self.stops.get())
        now_ns = time.monotonic_ns()
        due = int((now_ns / 1e9 - self.began_s) / EVERY_S)
        empty_ns, stop = self._empty_ns, min(due, self._next + 20)
        frames = [can_record(now_ns / 1e9, self.pressure_kpa(n), n) for n in range(self._next, stop)]
        self.dated_s += [now_ns / 1e9] * len(frames)
        self._next = stop
        if stop == due:
            self._empty_ns = now_ns
        return Block("bus", now_ns, b"".join(frames), "can", empty_ns) if frames else None

    def close(self) -> tuple[Block, ...]:
        """Return nothing more."""
        return ()


@pytest.fixture
def device() -> PlayedBus:
    return PlayedBus()


def started(folder: Path, device: PlayedBus) -> LiveSession:
    session = LiveSession(RECORD, [bus()], {"bus": device}, TRIGGER, folder / "journal", reserve_bytes=0)
    device.began_s = time.monotonic()
    session.start()
    return session


def pulse_at(first: int) -> Callable[[int], float]:
    return lambda n: 100.0 if first <= n < first + 3 else 0.0


def number_now(device: PlayedBus) -> int:
    return int((time.monotonic() - device.began_s) / EVERY_S)


def numbers_in(path: Path) -> list[int]:
    return [int(row[2]) for row in rows_in(path, "bus")["data"]]


@pytest.mark.real_time
def test_a_crossing_while_disarmed_keeps_the_journal_and_is_told(tmp_path: Path, device: PlayedBus) -> None:
    session = started(tmp_path, device)
    session.arm()
    time.sleep(0.1)
    session.disarm()
    device.pressure_kpa = pulse_at(number_now(device) + 5)
    time.sleep(0.5)
    session.stop()
    (kept,) = session.kept
    assert kept.why == "pressure crossed: not armed"
    assert kept.stop_s - kept.start_s == pytest.approx(TRIGGER.pre_s + TRIGGER.post_s)
    session.close(complete=True)
    journal = open_log(tmp_path / "journal")
    assert operator_records(journal).in_order
    assert any(one.outcome == "suppressed" for one in operator_records(journal).decisions)


def test_what_cannot_be_decoded_is_recorded_and_said_and_ends_nothing(
    tmp_path: Path, device: PlayedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = started(tmp_path, device)

    def fails(block: Block) -> list[LiveSamples]:
        raise LookupError(f"no {block.kind} of this kind")

    monkeypatch.setattr(session._engine._looks["bus"]._needed, "feed", fails)
    until_s = time.monotonic() + 10.0
    while not session.status.alert and time.monotonic() < until_s:
        time.sleep(0.01)
    time.sleep(0.1)
    assert session.error is None
    assert session.status.alert == "bus CANNOT BE READ LIVE"
    (event,) = (event_of(block) for block in session.device_events())
    session.close(complete=False)
    assert event.name == "undecoded"
    assert event.detail == "LookupError: no can of this kind"  # it was not armed
    kinds = [record.kind for record in open_log(tmp_path / "journal").records(0)]
    assert kinds.count(Kind.EVENT) == 1
    assert Kind.CAN in kinds[kinds.index(Kind.EVENT) :]


def test_a_read_larger_than_a_record_of_the_journal_is_kept_whole(tmp_path: Path, device: PlayedBus) -> None:
    session = started(tmp_path, device)
    now_s = time.monotonic()
    content = b"".join(can_record(now_s, 0.0, n) for n in range(20_000))  # 1.8 MB
    given = [content]
    device.read = lambda _: (  # type: ignore[method-assign]
        Block("bus", time.monotonic_ns(), given.pop(), "can") if given else None
    )
    until_s = time.monotonic() + 10.0
    while session.status.journal_bytes < len(content) and time.monotonic() < until_s:
        time.sleep(0.01)
    assert session.error is None
    session.close(complete=False)
    records = [record for record in open_log(tmp_path / "journal").records(0) if record.kind == Kind.CAN]
    assert b"".join(record.payload for record in records).endswith(content)


def test_a_session_in_which_nothing_happened_leaves_no_journal(tmp_path: Path, device: PlayedBus) -> None:
    session = started(tmp_path, device)
    session.arm()
    time.sleep(0.2)
    session.close(complete=True)
    assert not (tmp_path / "journal").exists()


@pytest.mark.real_time
def test_what_was_watched_is_released_and_what_crossed_while_disarmed_stays(
    tmp_path: Path, device: PlayedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recoil_acquisition.capture.live_session, "SEGMENT_BYTES", 1 << 12)
    monkeypatch.setattr(recoil_acquisition.capture.live_session, "_RELEASE_EVERY_S", 0.05)
    session = started(tmp_path, device)
    session.arm()
    time.sleep(0.1)
    session.disarm()
    first = number_now(device) + 20
    device.pressure_kpa = pulse_at(first)
    ends = time.monotonic() + 20.0
    while session.status.released_records < 50 and time.monotonic() < ends:
        time.sleep(0.05)
    session.close(complete=True)
    journal = open_log(tmp_path / "journal")
    survey = journal.survey()
    assert survey.released_records >= 50
    assert (survey.lost_records, survey.losses, survey.damaged) == (0, (), False)
    records = b"".join(r.payload for r in journal.records(0) if r.kind == Kind.CAN)
    held = [int(row[2]) for row in can_rows.parse_rows(records)["data"]]
    # on a busy machine frames are read, and dated, late: what is around the crossing is so by its date
    around_s = (EVERY_S - TRIGGER.pre_s, TRIGGER.post_s - EVERY_S)
    since_s = [dated_s - device.dated_s[first] for dated_s in device.dated_s]
    around = [n % 256 for n, at_s in enumerate(since_s) if around_s[0] < at_s < around_s[1]]
    assert len(around) > 20
    begins = held.index(around[0])
    assert held[begins : begins + len(around)] == around


@pytest.mark.real_time
@pytest.mark.parametrize("delay_s", [0.05, 0.38])
def test_what_a_stalled_read_returns_after_the_shots_end_is_in_the_shot(
    tmp_path: Path, device: PlayedBus, delay_s: float
) -> None:
    session = started(tmp_path, device)
    session.arm()
    time.sleep(0.3)
    first = number_now(device) + 2
    device.pressure_kpa = pulse_at(first)
    time.sleep(delay_s)
    device.stops.put(0.8)
    window = session.next_window(5.0)
    assert window is not None
    captured = session.cut("0001", window, tmp_path / "captures" / "0001.rdlog")
    session.release(window)
    session.close(complete=True)
    numbers = numbers_in(captured.path)
    # on a busy machine the trigger's frame is read, and dated, late: its shot begins by its date
    begins_s = device.dated_s[first] - TRIGGER.pre_s
    begins = next(n for n, dated_s in enumerate(device.dated_s) if dated_s > begins_s)
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert numbers[0] <= begins
    assert numbers[-1] >= first + round(TRIGGER.post_s / EVERY_S) - 1
    (source,) = captured.acquisition.sources
    assert source.late
    assert 0.75 < source.late_s < 3.0
    assert not (tmp_path / "journal").exists()


@pytest.mark.real_time
@pytest.mark.parametrize(
    "spoil", [Path.unlink, lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])]
)
def test_a_journal_stays_that_holds_more_of_a_shot_than_its_capture(
    tmp_path: Path, device: PlayedBus, spoil: Callable[[Path], Any]
) -> None:
    session = started(tmp_path, device)
    session.arm()
    time.sleep(0.3)
    device.pressure_kpa = pulse_at(number_now(device) + 2)
    window = session.next_window(5.0)
    assert window is not None
    captured = session.cut("0001", window, tmp_path / "captures" / "0001.rdlog")
    session.release(window)
    spoil(captured.path)
    with pytest.raises(StoreError, match=r"the journal is kept: not all that it has is in 0001\.rdlog"):
        session.close(complete=True)
    assert (tmp_path / "journal").exists()


@pytest.mark.real_time
def test_a_source_that_answers_after_its_shot_was_given_up_keeps_the_journal(
    tmp_path: Path, device: PlayedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    less_patient = partial(CaptureEngine, patience_s=0.5)
    monkeypatch.setattr(recoil_acquisition.capture.live_session, "CaptureEngine", less_patient)
    session = started(tmp_path, device)
    session.arm()
    time.sleep(0.3)
    device.pressure_kpa = pulse_at(number_now(device) + 2)
    time.sleep(0.2)
    device.stops.put(1.5)
    window = session.next_window(10.0)
    assert window is not None
    assert window.late_sources == ("bus",)
    session.cut("0001", window, tmp_path / "captures" / "0001.rdlog")
    session.release(window)
    ends = time.monotonic() + 20.0
    while not session.kept and time.monotonic() < ends:
        time.sleep(0.02)
    session.close(complete=True)
    assert [one.why for one in session.kept] == ["bus: arrived when its shot was already cut"]
    assert (tmp_path / "journal").exists()


@pytest.mark.real_time
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="tells files apart by /proc")
def test_a_disk_that_fails_costs_nothing_where_there_is_a_spare_folder(
    tmp_path: Path, device: PlayedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = os.writev

    def fail(descriptor: int, parts: list[bytes]) -> int:
        if "spare" not in str(Path(f"/proc/self/fd/{descriptor}").readlink()):
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return whole(descriptor, parts)

    spare = tmp_path / "spare" / "journal"
    session = LiveSession(RECORD, [bus()], {"bus": device}, TRIGGER, tmp_path / "journal", reserve_bytes=0, spare=spare)
    device.began_s = time.monotonic()
    session.start()
    session.arm()
    time.sleep(0.3)
    assert session.status.alert == ""
    first = number_now(device) + 2
    device.pressure_kpa = pulse_at(first)
    time.sleep(0.1)
    monkeypatch.setattr(os, "writev", fail)
    window = session.next_window(10.0)
    assert window is not None
    assert session.status.alert == f"the journal goes on in {spare}: Input/output error"
    captured = session.cut("0001", window, tmp_path / "captures" / "0001.rdlog")
    numbers = numbers_in(captured.path)
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert numbers[0] < first < numbers[-1]
    session.release(window)
    session.close(complete=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["captures", "spare"]
    assert list((tmp_path / "spare").iterdir()) == []


def test_a_driver_that_hangs_ends_nothing_but_its_own_source(
    tmp_path: Path, device: PlayedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(DeviceReader, "stop", lambda self, stop=DeviceReader.stop: stop(self, 0.1))
    session = started(tmp_path, device)
    time.sleep(0.1)
    assert session.error is None
    device.stops.put(1.0)
    time.sleep(0.1)
    session.stop()
    session.close(complete=True)
    assert isinstance(session.error, DeviceError)
    assert "source 'bus': its device hangs, and is not closed within 0.1 s; unplug it" in str(session.error)
    assert len(list(open_log(tmp_path / "journal").records(0))) > 3


def test_the_room_on_the_disk_is_known_when_the_journal_is_gone(tmp_path: Path) -> None:
    assert _free_bytes(tmp_path / "journal" / "gone") == pytest.approx(shutil.disk_usage(tmp_path).free, rel=0.05)


def test_what_the_journal_has_reserved_is_no_room_for_shots(
    tmp_path: Path, device: PlayedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = started(tmp_path, device)
    full = shutil.disk_usage(tmp_path)._replace(free=0)
    with monkeypatch.context() as disk:
        disk.setattr(shutil, "disk_usage", lambda _: full)
        assert session.status.disk_free_bytes == 0
    session.close(complete=False)


@pytest.mark.real_time
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="the system's timer sends the signals")
def test_a_signal_as_the_wait_for_a_shot_ends_makes_it_no_endless_one(tmp_path: Path, device: PlayedBus) -> None:
    """Else Ctrl-C would find a session that neither heeds it nor shows anything any more."""
    session, over, looked_s, stuck = started(tmp_path, device), threading.Event(), [time.monotonic()], []

    def keep_busy() -> None:
        while not over.is_set():
            sum(range(2000))

    def watch() -> None:
        while not over.wait(0.1):
            if time.monotonic() - looked_s[0] > 2.0:
                stuck.append(time.monotonic())
                session._windows.put(None)  # type: ignore[arg-type]  # it ends the wait

    others = [threading.Thread(target=one) for one in (watch, *[keep_busy] * 3)]
    for one in others:
        one.start()
    before = signal.signal(signal.SIGALRM, lambda *_: None)
    signal.setitimer(signal.ITIMER_REAL, 0.0017, 0.0017)
    try:
        ends_s = time.monotonic() + 2.0
        while time.monotonic() < ends_s and not stuck:
            looked_s[0] = time.monotonic()
            session.next_window(0.002)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        over.set()
        for one in others:
            one.join()
        session.close(complete=True)
    assert stuck == []
