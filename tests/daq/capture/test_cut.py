"""Captures are cut out of the log byte for byte, or not at all."""

from __future__ import annotations

import errno
import math
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from recoil_acquisition.capture.cut import (
    Cut,
    acquisition_in,
    capture_has,
    cuts_of,
    with_cuts,
    write_everything,
    write_shot,
)
from recoil_acquisition.capture.engine import CaptureEngine
from recoil_acquisition.capture.session_record import (
    CompleteShot,
    LiveRecord,
    OperatorRecords,
    RecordedSource,
    live_record_of,
    operator_records,
)
from recoil_acquisition.capture.shot_record import CounterSpan, acquisition_of
from recoil_acquisition.devices.device import IDLE, LATE_S, Block, Counters, event_block
from recoil_acquisition.errors import StoreError
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.log.folder import Log, open_log
from recoil_acquisition.log.record import Kind
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.shot.acquisition import Acquisition
from recoil_acquisition.trigger import Decision, Edge, ShotWindow, Trigger
from tests.builders.live_logs import append, rows_in, source_in, stream_in
from tests.builders.live_sources import ANCHOR, bus, can_block, can_record, port, serial_block, serial_frame

RECORD = LiveRecord(
    "rig", "text", "rig.toml", {"a.dbc": "x"}, ANCHOR, (RecordedSource("bus", "can"), RecordedSource("port", "serial"))
)
DECIDED = Decision(10.5, "trigger", "", "pressure", 0, 50, 1e5, 10.499)


TRIGGER = Trigger((Edge("pressure", 5e4),), pre_s=0.2, post_s=0.3)
BEGUN = acquisition_of("0001", RECORD, TRIGGER, ShotWindow(10.3, 10.5, 10.8, 0.2, {}, ()), {})


def log_of(folder: Path, blocks: list[Block]) -> Log:
    with LogWriter(folder, RECORD.to_json(), 0, segment_bytes=1 << 16) as writer:
        append(writer, RECORD, blocks)
        writer.say(Kind.DECISION, int(10.5e9), asdict(DECIDED))
        writer.say(Kind.SHOT, int(10.5e9), asdict(CompleteShot("0001", 10.5)))
    return open_log(folder)


def both(count: int = 100) -> list[Block]:
    made: list[Block] = [event_block("port", int(10e9), "opened", "x")]
    for k in range(count):
        t = 10.0 + 0.01 * k
        made += [can_block(t, can_record(t, 1.0, k)), serial_block(t, serial_frame(k, 1.0))]
    return [*made, event_block("bus", int(10.5e9), "lost", "gone")]


def test_the_log_says_again_what_the_session_was(tmp_path: Path) -> None:
    log = log_of(tmp_path / "j", [])
    assert live_record_of(log.session, log.folder) == RECORD
    assert operator_records(log) == OperatorRecords((DECIDED,), (CompleteShot("0001", 10.5),), (), in_order=True)


def test_all_of_it_comes_out_byte_for_byte(tmp_path: Path) -> None:
    blocks, path = both(), tmp_path / "out" / "all.rdlog"
    log = log_of(tmp_path / "j", blocks)
    write_everything(log, path, {"decisions": []})
    assert stream_in(path, "port") == b"".join(b.payload for b in blocks if b.source == "port" and b.kind == "serial")
    assert rows_in(path, "bus").tobytes() == b"".join(b.payload for b in blocks if b.kind == "can")
    assert [event.name for event in source_in(path, "port").events] == ["opened"]
    assert [event.name for event in source_in(path, "bus").events] == ["lost"]
    assert capture_has(log, path, None, None)
    assert live_record_of(read_capture(path).session, path) == RECORD


def test_a_span_has_its_own_blocks_and_those_that_end_just_behind_it(tmp_path: Path) -> None:
    log, path = log_of(tmp_path / "j", both()), tmp_path / "0001.rdlog"
    write_shot(log, RECORD, path, BEGUN, int(10.2e9), int(10.4e9))
    times = [record.host_ns for record in source_in(path, "port").records]
    assert times[0] == int(10.2e9)
    assert (times[-1] - times[0]) / 1e9 == pytest.approx(0.44)
    assert capture_has(log, path, int(10.2e9), int(10.4e9))
    assert not capture_has(log, path, int(10.1e9), int(10.4e9))


def test_a_source_without_data_has_no_file(tmp_path: Path) -> None:
    log, path = log_of(tmp_path / "j", [b for b in both() if b.source == "bus"]), tmp_path / "0001.rdlog"
    made = write_shot(log, RECORD, path, BEGUN, int(10.2e9), int(10.4e9))
    assert [(source.name, source.file) for source in made.sources] == [("bus", "0001.rdlog"), ("port", "")]
    assert acquisition_in(path) == made


def test_captures_are_never_overwritten(tmp_path: Path) -> None:
    log, path = log_of(tmp_path / "j", both(3)), tmp_path / "0001.rdlog"
    write_shot(log, RECORD, path, BEGUN, 0, int(20e9))
    before = path.read_bytes()
    with pytest.raises(StoreError, match="exists already"):
        write_shot(log, RECORD, path, BEGUN, 0, int(20e9))
    assert path.read_bytes() == before


def test_nothing_is_left_where_the_disk_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    log = log_of(tmp_path / "j", both(3))
    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(StoreError, match=r"No space left on device; make room$"):
        write_shot(log, RECORD, tmp_path / "out" / "0001.rdlog", BEGUN, 0, int(20e9))
    assert list((tmp_path / "out").iterdir()) == []


def test_a_log_of_something_else_is_refused(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "j", {"schema": "other"}, 0, segment_bytes=1 << 16) as writer:
        writer.append(0, 0, 1, b"x")
    with pytest.raises(StoreError, match="of no live acquisition"):
        live_record_of(open_log(tmp_path / "j").session, tmp_path / "j")


@pytest.mark.parametrize("content", [b"", b"x" * 500, None])
def test_what_is_no_capture_says_nothing_of_an_acquisition(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "a.rdlog").write_bytes(content)
    assert acquisition_in(tmp_path / "a.rdlog") is None


def test_the_record_of_a_shot_counts_what_happened_within_it_alone(tmp_path: Path) -> None:
    log = log_of(tmp_path / "j", both())
    window = ShotWindow(10.3, 10.5, 10.8, 0.2, {"bus": 0.2, "port": 0.2}, (DECIDED,), ("port",))
    span = CounterSpan(10.2, Counters(bad=3, kernel_drops=1, reopened=1), Counters(bad=5, kernel_drops=4, reopened=2))
    begun = acquisition_of("0001", RECORD, TRIGGER, window, {"bus": span}, unseen_bytes=7)
    made = write_shot(log, RECORD, tmp_path / "0001.rdlog", begun, int(10.3e9), int(10.8e9))
    assert Acquisition.from_json(made.to_json()) == made
    bus, port = made.sources
    assert (bus.bad, bus.kernel_drops, bus.reopened, bus.late) == (2, 3, 1, False)
    assert bus.counted_from_s == pytest.approx(-0.3)
    assert [(event.time_s, event.name) for event in bus.events] == [(0.0, "lost")]
    assert port.late
    assert made.decisions[0].time_s == 0.0
    assert made.unseen_bytes == 7
    assert made.trigger_utc == "2023-11-14T22:13:29.500000"


def test_a_source_is_late_where_nobody_read_and_not_where_it_is_busy(tmp_path: Path) -> None:
    def read(time_s: float, empty_s: float) -> Block:
        return replace(can_block(time_s, can_record(time_s, 1.0)), empty_ns=round(empty_s * 1e9))

    busy = [read(10.0 + 0.01 * k, 9.9) for k in range(50)]
    cuts = cuts_of(log_of(tmp_path / "busy", busy), RECORD, None, None)
    assert cuts["bus"].late_s == pytest.approx(0.01)
    stood_still = [read(10.0, 9.99), read(10.7, 10.0), read(10.701, 10.0), read(10.8, 10.79)]
    cuts = cuts_of(log_of(tmp_path / "still", stood_still), RECORD, None, None)
    assert cuts["bus"].late_s == pytest.approx(0.7)
    assert [source.late for source in with_cuts(BEGUN, cuts, "0001.rdlog").sources] == [True, False]
    said = [event_block("bus", round(10.7e9), "stalled", "nothing was read for 0.700 s")]
    cuts = cuts_of(log_of(tmp_path / "said", stood_still[:1] + said + stood_still[1:]), RECORD, None, None)
    assert cuts["bus"].late_s == pytest.approx(0.7)
    idle = [Block("bus", round(10.6e9), b"", IDLE, round(10.5e9))]
    cuts = cuts_of(log_of(tmp_path / "idle", stood_still[:1] + idle + stood_still[1:]), RECORD, None, None)
    assert cuts["bus"].late_s == pytest.approx(0.7 - 0.6)
    silent = [read(10.0, 9.99), read(10.7, 10.69)]
    cuts = cuts_of(log_of(tmp_path / "silent", silent), RECORD, None, None)
    assert cuts["bus"].late_s == pytest.approx(0.01)


def test_a_shots_record_counts_reads_and_bytes_of_each_source_and_dates_its_events_from_the_trigger(
    tmp_path: Path,
) -> None:
    blocks = [*both(40), event_block("port", int(10.75e9), "reopened", "again")]
    cuts = cuts_of(log_of(tmp_path / "j", blocks), RECORD, int(10.2e9), int(11e9))
    bus, port = with_cuts(BEGUN, cuts, "0001.rdlog").sources
    of_port = [block for block in blocks if block.source == "port" and block.kind == "serial"]
    # reads at 10.20 to 10.39 s
    assert (port.blocks, port.bytes) == (20, sum(len(block.payload) for block in of_port[20:]))
    assert bus.blocks == 20
    assert [(event.time_s, event.name) for event in port.events] == [(0.25, "reopened")]


@pytest.mark.parametrize(("late_s", "late"), [(LATE_S, False), (LATE_S + 1e-3, True)])
def test_a_source_is_late_beyond_a_quarter_of_a_second(late_s: float, late: bool) -> None:
    cuts = {"bus": Cut(1, 10, late_s), "port": Cut()}
    assert with_cuts(BEGUN, cuts, "0001.rdlog").sources[0].late is late


@pytest.mark.exhaustive
@pytest.mark.parametrize("of_the_bus", ["steady", "busy", "stood still"])
def test_a_shots_capture_holds_the_shots_share_of_a_stream_whatever_another_source_does(
    tmp_path: Path, of_the_bus: str
) -> None:
    trigger, packet = Trigger((Edge("rate", -2.0, -3.0),), pre_s=0.3, post_s=0.7), serial_frame(0, 5.0) * 250
    found_empty = {"steady": lambda t: t - 0.001, "busy": lambda _: 10.0, "stood still": lambda t: min(t, 10.0)}
    blocks = []
    for k in range(1000):
        t = 10.0 + 0.01 * k
        content = packet if k < 500 else serial_frame(0, 1.0) * 250
        blocks.append(replace(serial_block(t, content), empty_ns=round(1e9 * (t - 0.001))))
        if of_the_bus != "stood still" or not 0 < k < 600:
            frames = (can_record(t, 1.0, k),)
            blocks.append(replace(can_block(t, *frames), empty_ns=round(1e9 * found_empty[of_the_bus](t))))
    engine = CaptureEngine([bus(), port()], trigger)
    engine.arm(-math.inf)
    for block in blocks:
        engine.arrived(block)
        engine.take(block)
    (window,) = engine.ready(math.inf)
    path = tmp_path / "0001.rdlog"
    begun = acquisition_of("0001", RECORD, trigger, window, {})
    write_shot(
        log_of(tmp_path / "j", blocks), RECORD, path, begun, *(round(1e9 * t) for t in (window.start_s, window.stop_s))
    )
    share = 100 * len(packet)
    assert share <= len(stream_in(path, "port")) <= 1.3 * share
    assert path.stat().st_size <= 1.3 * share + 88 * 1000 + 20_000
