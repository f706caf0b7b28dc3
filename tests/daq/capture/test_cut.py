"""Captures are cut out of the journal byte for byte, or not at all."""

from __future__ import annotations

import errno
from dataclasses import replace
from pathlib import Path

import pytest

from recoil_acquisition.acquisition import Acquisition
from recoil_acquisition.capture.cut import write_captures
from recoil_acquisition.capture.session_record import (
    CLOSED,
    DECISION,
    KINDS,
    OPERATOR,
    SHOT,
    CompleteShot,
    LiveRecord,
    OperatorRecords,
    RecordedSource,
    live_record_of,
    operator_records,
    pack_decision,
    pack_shot,
)
from recoil_acquisition.capture.shot_record import CounterSpan, acquisition_of
from recoil_acquisition.devices.device import Block, Counters, event_block
from recoil_acquisition.errors import StoreError
from recoil_acquisition.frames import can_capture_file, capture_file
from recoil_acquisition.journal import Journal, JournalWriter, read_journal
from recoil_acquisition.trigger import Decision, Edge, ShotWindow, Trigger
from tests.builders.live_sources import ANCHOR, can_block, can_record, serial_block, serial_frame

RECORD = LiveRecord(
    "rig", "text", "rig.toml", {"a.dbc": "x"}, ANCHOR, (RecordedSource("bus", "can"), RecordedSource("port", "serial"))
)
DECIDED = Decision(10.5, "trigger", "", "pressure", 0, 50, 1e5, 10.499)


def journal_of(folder: Path, blocks: list[Block]) -> Journal:
    with JournalWriter(folder, RECORD.to_json(), 0, segment_bytes=1 << 16) as writer:
        for block in blocks:
            number, kind = RECORD.number(block.source), KINDS.index(block.kind)
            writer.append(number, kind, block.host_ns, block.payload, empty_ns=block.empty_ns)
        writer.append(OPERATOR, DECISION, int(10.5e9), pack_decision(DECIDED))
        writer.append(OPERATOR, SHOT, int(10.5e9), pack_shot(CompleteShot("0001", 10.5)))
        writer.append(OPERATOR, CLOSED, int(11e9), b"{}")
    return read_journal(folder)


def both(count: int = 100) -> list[Block]:
    made: list[Block] = [event_block("port", int(10e9), "opened", "x")]
    for k in range(count):
        t = 10.0 + 0.01 * k
        made += [can_block(t, can_record(t, 1.0, k)), serial_block(t, serial_frame(k, 1.0))]
    return [*made, event_block("bus", int(10.5e9), "lost", "gone")]


def test_the_journal_says_again_what_the_session_was(tmp_path: Path) -> None:
    journal = journal_of(tmp_path / "j", [])
    assert live_record_of(journal) == RECORD
    assert operator_records(journal) == OperatorRecords((DECIDED,), (CompleteShot("0001", 10.5),), (), in_order=True)


def test_all_of_it_comes_out_byte_for_byte(tmp_path: Path) -> None:
    blocks = both()
    cuts = write_captures(journal_of(tmp_path / "j", blocks), RECORD, tmp_path / "out", "0001", None, None)
    port, bus = cuts["port"].file, cuts["bus"].file
    assert port is not None
    assert bus is not None
    stream = capture_file.parse_capture(port.read_bytes())
    assert stream.stream == b"".join(b.payload for b in blocks if b.source == "port" and b.kind == "serial")
    assert not stream.cut
    records = can_capture_file.parse_capture(bus.read_bytes()).records
    assert (records["flags"] & can_capture_file.EVENT != 0).sum() == 1
    assert (records["flags"] & can_capture_file.ANCHOR != 0).sum() == 1
    assert len(records) == 102
    assert cuts["bus"].blocks == 100
    assert [event.name for _, event in cuts["port"].events] == ["opened"]


def test_a_span_has_its_own_blocks_and_those_that_end_just_behind_it(tmp_path: Path) -> None:
    journal = journal_of(tmp_path / "j", both())
    cuts = write_captures(journal, RECORD, tmp_path / "out", "0001", int(10.2e9), int(10.4e9))
    assert cuts["port"].file is not None
    times = capture_file.parse_capture(cuts["port"].file.read_bytes()).host_ns
    first = ANCHOR.wall_of(int(10.2e9))
    assert times[0] == first
    assert (times[-1] - first) / 1e9 == pytest.approx(0.44)


def test_a_source_without_data_has_no_file(tmp_path: Path) -> None:
    blocks = [b for b in both() if b.source == "bus"]
    cuts = write_captures(journal_of(tmp_path / "j", blocks), RECORD, tmp_path / "out", "0001", None, None)
    assert cuts["port"].file is None
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["0001_bus.rdcc"]


def test_captures_are_never_overwritten(tmp_path: Path) -> None:
    journal = journal_of(tmp_path / "j", both(3))
    write_captures(journal, RECORD, tmp_path / "out", "0001", None, None)
    with pytest.raises(StoreError, match="exist already"):
        write_captures(journal, RECORD, tmp_path / "out", "0001", None, None)


def test_nothing_is_left_where_the_disk_is_full(tmp_path: Path) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    journal = journal_of(tmp_path / "j", both(3))
    with pytest.raises(StoreError, match="No space left on device; make room; the journal still has it"):
        write_captures(journal, RECORD, tmp_path / "out" / "0001", "0001", None, None, full)
    assert list((tmp_path / "out").iterdir()) == []


def test_a_journal_of_something_else_is_refused(tmp_path: Path) -> None:
    with JournalWriter(tmp_path / "j", {"schema": "other"}, 0, segment_bytes=1 << 16) as writer:
        writer.append(0, 0, 1, b"x")
    with pytest.raises(StoreError, match="of no live acquisition"):
        live_record_of(read_journal(tmp_path / "j"))


def test_the_record_of_a_shot_counts_what_happened_within_it_alone(tmp_path: Path) -> None:
    journal = journal_of(tmp_path / "j", both())
    cuts = write_captures(journal, RECORD, tmp_path / "out", "0001", int(10.3e9), int(10.8e9))
    window = ShotWindow(10.3, 10.5, 10.8, 0.2, {"bus": 0.2, "port": 0.2}, (DECIDED,), ("port",))
    trigger = Trigger((Edge("pressure", 5e4),), pre_s=0.2, post_s=0.3)
    span = CounterSpan(10.2, Counters(bad=3, kernel_drops=1, reopened=1), Counters(bad=5, kernel_drops=4, reopened=2))
    made = acquisition_of("0001", RECORD, trigger, window, cuts, {"bus": span}, unseen_bytes=7)
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
    cuts = write_captures(journal_of(tmp_path / "busy", busy), RECORD, tmp_path / "a", "0001", None, None)
    assert cuts["bus"].late_s == pytest.approx(0.01)
    stood_still = [read(10.0, 9.99), read(10.7, 10.0), read(10.701, 10.0), read(10.8, 10.79)]
    cuts = write_captures(journal_of(tmp_path / "still", stood_still), RECORD, tmp_path / "b", "0001", None, None)
    assert cuts["bus"].late_s == pytest.approx(0.7)
    silent = [read(10.0, 9.99), read(10.7, 10.69)]
    cuts = write_captures(journal_of(tmp_path / "silent", silent), RECORD, tmp_path / "c", "0001", None, None)
    assert cuts["bus"].late_s == pytest.approx(0.01)
