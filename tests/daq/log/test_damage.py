"""Whatever is damaged in a log costs what it touches, is counted, and gives nothing wrong and nothing twice."""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path

import pytest

from recoil_acquisition.errors import StoreError
from recoil_acquisition.log import folder as folder_module
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import HEAD_SIZE, LONGEST_PAYLOAD, MARK, OWN, Kind, crc_seed, pack_record
from recoil_acquisition.log.scan import FileScan, first_log_id, sound_head
from recoil_acquisition.log.writer import LogWriter
from tests.builders.damaged_logs import faults_of_reading, faults_of_trials, write_log
from tests.builders.naive_log import Found, read_file, read_folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> tuple[Path, list[Found]]:
    folder = tmp_path_factory.mktemp("whole") / "log"
    return folder, write_log(folder)


def test_an_undamaged_log_is_without_a_fault(whole):
    folder, written = whole
    assert faults_of_reading(folder, written) == []
    survey = open_log(folder).survey()
    assert (survey.damaged, survey.closed, survey.records) == (False, True, len(written))
    assert len(open_log(folder).segments) >= 3


@pytest.mark.exhaustive
def test_damage_of_every_kind_costs_what_it_touches_and_is_counted(whole, tmp_path):
    faults, kinds = faults_of_trials(*whole, tmp_path / "damaged", trials=40, seed=1)
    assert faults == []
    assert len(kinds) == 10


@pytest.mark.exhaustive
def test_a_log_that_did_not_end_in_order_never_counts_too_many_lost(tmp_path):
    written = write_log(tmp_path / "whole", 300, closed=False)
    faults, _ = faults_of_trials(tmp_path / "whole", written, tmp_path / "damaged", trials=30, seed=2)
    assert faults == []


@pytest.mark.exhaustive
def test_a_reader_that_ends_at_damage_is_found_out(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(FileScan, "_behind_damage", lambda _self, _damaged: None)
    faults, _ = faults_of_trials(*whole, tmp_path / "damaged", trials=10, seed=3)
    assert any("not returned" in fault for fault in faults)


@pytest.mark.exhaustive
def test_a_reader_that_trusts_payloads_is_found_out(whole, tmp_path, monkeypatch):
    def trusting(scan, head):
        payload = scan._bytes(head.at + 64, head.length)
        return head.record._replace(payload=payload) if len(payload) == head.length else None

    monkeypatch.setattr(FileScan, "_whole", trusting)
    faults, _ = faults_of_trials(*whole, tmp_path / "damaged", trials=10, seed=3)
    assert any("wrong" in fault for fault in faults)


@pytest.mark.exhaustive
def test_a_reader_that_takes_records_as_they_stand_is_found_out(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(folder_module, "in_order", lambda records, _following: records)
    faults, _ = faults_of_trials(*whole, tmp_path / "damaged", trials=20, seed=3)
    assert any("twice" in fault for fault in faults)
    assert any("not in order" in fault for fault in faults)


@pytest.mark.exhaustive
def test_any_bit_of_a_head_costs_this_record_alone(tmp_path):
    written = write_log(tmp_path / "log", 20)
    chosen = next(one for one in written if one.source == 1 and one.number > 12)
    path = tmp_path / "log" / chosen.file
    content = path.read_bytes()
    for bit in range(64 * 8):
        damaged = bytearray(content)
        damaged[chosen.begin + bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        log = open_log(tmp_path / "log")
        assert [r.number for r in log.records()] == [one.number for one in written if one is not chosen], bit
        (loss,) = log.survey().losses
        assert (loss.source, loss.first, loss.last, loss.bytes) == (1, chosen.source_number, chosen.source_number,
                                                                     len(chosen.payload))  # fmt: skip


def test_a_flip_in_the_session_of_the_only_segment_leaves_the_session(tmp_path):
    written = write_log(tmp_path / "log", 5)
    assert {one.file for one in written} == {"000001.rdlog"}
    sessions = [one for one in written if one.kind == Kind.SESSION]
    assert len(sessions) == 2
    path = tmp_path / "log" / "000001.rdlog"
    content = path.read_bytes()
    for session in sessions:
        for place in (session.begin + 5, session.begin + 70):
            damaged = bytearray(content)
            damaged[place] ^= 1
            path.write_bytes(damaged)
            assert open_log(tmp_path / "log").session == {"rig": "name = 'stand'\n"}
            assert faults_of_reading(tmp_path / "log", written) == []


@pytest.mark.parametrize("rig_bytes", [20, 1500, 4096, 6000, 30_000])
@pytest.mark.parametrize("page", range(9))
def test_a_page_of_zeros_leaves_the_session_and_what_is_in_other_pages(rig_bytes, page, tmp_path):
    session = {"rig": "x" * rig_bytes}
    with LogWriter(tmp_path / "log", session, 0, segment_bytes=1 << 20) as writer:
        for k in range(200):
            writer.append(0, Kind.SERIAL, k, bytes([k]) * 50)
    path = tmp_path / "log" / "000001.rdlog"
    content = bytearray(path.read_bytes())
    begin, end = 4096 * page, 4096 * (page + 1)
    within = [one for one in read_folder(tmp_path / "log") if one.begin < end and one.begin + len(one.content) > begin]
    content[begin:end] = bytes(len(content[begin:end]))
    path.write_bytes(content)
    log = open_log(tmp_path / "log")
    assert log.session == session
    lost = sum(one.kind == Kind.SERIAL for one in within)
    assert len(list(log.records(0))) == 200 - lost


def test_a_log_without_a_sound_session_still_gives_its_records(tmp_path):
    written = write_log(tmp_path / "log", 5)
    path = tmp_path / "log" / "000001.rdlog"
    content = bytearray(path.read_bytes())
    for one in written:
        if one.kind == Kind.SESSION:
            content[one.begin + 70] ^= 1
    path.write_bytes(content)
    log = open_log(tmp_path / "log")
    assert log.session == {}
    assert sum(1 for record in log.records() if record.source != OWN) == 5


def test_copies_of_a_log_within_its_payloads_are_doubles_and_dropped(tmp_path):
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=1 << 17) as writer:
        for i in range(40):
            writer.append(0, Kind.SERIAL, i, b"before %d" % i)
        so_far = (tmp_path / "log" / "000001.rdlog").read_bytes().rstrip(b"\0")
        writer.append(1, Kind.SERIAL, 100, so_far)
        writer.append(1, Kind.SERIAL, 101, so_far)
        writer.append(0, Kind.SERIAL, 102, b"behind")
    written = read_folder(tmp_path / "log")
    assert faults_of_reading(tmp_path / "log", written) == []
    holder = next(one for one in written if one.source == 1)
    path = tmp_path / "log" / holder.file
    content = path.read_bytes()
    for at in (3, 200, 3000):
        damaged = bytearray(content)
        damaged[holder.begin + at] ^= 4
        path.write_bytes(damaged)
        assert faults_of_reading(tmp_path / "log", written) == []


@pytest.mark.parametrize("later", [True, False])
def test_a_record_that_was_moved_into_the_payload_of_another_is_returned(later, tmp_path):
    written = write_log(tmp_path / "log", 60)
    long = next(one for one in written[20:] if len(one.payload) > 1500)
    others = [one for one in written if one.file == long.file and one.kind == Kind.SERIAL and len(one.content) < 700]
    short = next(one for one in others if (one.number > long.number) == later and abs(one.number - long.number) > 2)
    path = tmp_path / "log" / long.file
    content = bytearray(path.read_bytes())
    content[short.begin : short.begin + len(short.content)] = bytes(len(short.content))
    inside = long.begin + HEAD_SIZE + 300
    content[inside : inside + len(short.content)] = short.content
    path.write_bytes(content)
    assert faults_of_reading(tmp_path / "log", written) == []
    numbers = [record.number for record in open_log(tmp_path / "log").records()]
    assert numbers == [one.number for one in written if one is not long]


def test_what_another_log_left_behind_the_end_is_no_record(tmp_path):
    write_log(tmp_path / "old", 50)
    written = write_log(tmp_path / "new", 5)
    old = (tmp_path / "old" / "000001.rdlog").read_bytes()
    path = tmp_path / "new" / "000001.rdlog"
    path.write_bytes(path.read_bytes() + old)
    log = open_log(tmp_path / "new")
    assert [r.number for r in log.records()] == [one.number for one in written]
    assert log.survey().unfinished_bytes == len(old)
    assert log.survey().damaged


def test_segments_of_two_logs_are_refused(tmp_path):
    write_log(tmp_path / "a")
    write_log(tmp_path / "b")
    shutil.copy(tmp_path / "b" / "000002.rdlog", tmp_path / "a" / "000002.rdlog")
    with pytest.raises(StoreError, match=r"another log than 000001\.rdlog"):
        open_log(tmp_path / "a")


def test_a_segment_that_is_there_twice_is_not_read_twice(whole, tmp_path):
    folder, written = whole
    shutil.copytree(folder, tmp_path / "log")
    shutil.copy(tmp_path / "log" / "000001.rdlog", tmp_path / "log" / "000099.rdlog")
    assert faults_of_reading(tmp_path / "log", written) == []


@pytest.mark.exhaustive
def test_a_payload_full_of_marks_is_given_up_soon(tmp_path):
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=4 << 20) as writer:
        marks = (MARK + writer.log_id) * 80_000
        writer.append(0, Kind.SERIAL, 0, marks)
        writer.append(0, Kind.SERIAL, 1, b"behind")
    held = next(one for one in read_file(tmp_path / "log" / "000001.rdlog") if one.payload == marks)
    path = tmp_path / "log" / "000001.rdlog"
    for at in (20, 100):  # its head, its payload
        content = bytearray(path.read_bytes())
        content[held.begin + at] ^= 1
        path.write_bytes(content)
        began = time.process_time()
        survey = open_log(tmp_path / "log").survey()
        assert time.process_time() - began < 10
        assert survey.damaged
        assert [(loss.source, loss.first, loss.last) for loss in survey.losses] == [(0, 0, 0)]
        content[held.begin + at] ^= 1
        path.write_bytes(content)


def test_any_bytes_at_all_give_records_or_a_store_error(tmp_path):
    for content in (b"", b"\0" * 5000, b"x" * 5000, MARK * 2000, MARK + bytes(200)):
        folder = tmp_path / str(len(content))
        folder.mkdir(exist_ok=True)
        (folder / "000001.rdlog").write_bytes(content)
        with pytest.raises(StoreError, match=r"not one record|holds no log"):
            open_log(folder)


def test_half_a_record_at_the_end_is_said(tmp_path):
    written = write_log(tmp_path / "log", 20, closed=False)
    path = tmp_path / "log" / "000001.rdlog"
    path.write_bytes(path.read_bytes()[:-3])
    survey = open_log(tmp_path / "log").survey()
    assert survey.unfinished_bytes == len(written[-1].content) - 3
    assert survey.damaged
    assert not survey.closed


def test_a_damaged_place_is_said_to_the_byte(tmp_path):
    written = [one for one in write_log(tmp_path / "log", 40) if one.source != OWN and one.payload]
    path = tmp_path / "log" / written[3].file
    content = bytearray(path.read_bytes())
    content[written[3].begin + 64] ^= 1
    path.write_bytes(content)
    (damage,) = open_log(tmp_path / "log").survey().damages
    assert (damage.path, damage.at, damage.size) == (path, written[3].begin, len(written[3].content))


def test_the_longest_payload_is_read_and_a_head_that_says_more_is_damaged(tmp_path):
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=4 << 20) as writer:
        writer.append(0, Kind.SERIAL, 0, b"x" * LONGEST_PAYLOAD)
    log = open_log(tmp_path / "log")
    (record,) = log.records(source=0)
    assert len(record.payload) == LONGEST_PAYLOAD
    content = pack_record(log.log_id, record._replace(payload=b"x" * (LONGEST_PAYLOAD + 1)))
    assert sound_head(content, 0, crc_seed(log.log_id)) is None
    assert sound_head(pack_record(log.log_id, record), 0, crc_seed(log.log_id)) is not None


@pytest.mark.parametrize("part", [20, 64, -1], ids=["within its head", "its head", "all but a byte"])
def test_what_was_read_in_part_is_read_again(part, tmp_path):
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=1 << 16) as writer:
        for i in range(20):
            writer.append(0, Kind.SERIAL, i, b"a read of the port")
    path = tmp_path / "log" / "000001.rdlog"
    written, content = read_file(path), path.read_bytes()
    there = written[5].begin + part % len(written[5].content)
    path.write_bytes(content[:there] + bytes(len(content) - there))
    log_id = content[4:12]
    with FileScan(path, log_id) as scan:
        records = iter(scan)
        assert [next(records).number for _ in range(5)] == list(range(5))
        path.write_bytes(content)
        assert [record.number for record in records] == [one.number for one in written[5:]]
        assert scan.damages == []


def test_an_interrupted_write_costs_its_own_record_only(tmp_path, monkeypatch):
    writer = LogWriter(tmp_path / "log", {}, 0, segment_bytes=1 << 16)
    writer.append(0, Kind.SERIAL, 0, b"before")
    writev = os.writev

    def interrupt(descriptor: int, parts: list[bytes]) -> int:
        writev(descriptor, [parts[0][:20]])
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "writev", interrupt)
    with pytest.raises(KeyboardInterrupt):
        writer.append(0, Kind.SERIAL, 1, b"torn")
    monkeypatch.undo()
    writer.append(0, Kind.SERIAL, 2, b"after")
    counters = writer.counters
    with (tmp_path / "log" / "000001.rdlog").open("rb") as segment:
        assert counters.reserved_bytes == (1 << 16) - len(segment.read().rstrip(bytes(1)))
    writer.close()
    log = open_log(tmp_path / "log")
    assert [r.payload for r in log.records(source=0)] == [b"before", b"after"]
    assert [(loss.first, loss.last, loss.bytes) for loss in log.survey().losses] == [(1, 1, 4)]


def test_a_log_that_was_closed_misses_its_last_segment_whichever_that_is(tmp_path):
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=1 << 14) as writer:
        for i in range(200):
            writer.append(0, Kind.SERIAL, i, bytes([i]) * 200)
    paths = sorted((tmp_path / "log").glob("*.rdlog"))
    for gone in paths[-2:]:
        shutil.copytree(tmp_path / "log", tmp_path / gone.stem)
        (tmp_path / gone.stem / gone.name).unlink()
    data_gone, totals_gone = (open_log(tmp_path / gone.stem).survey() for gone in paths[-2:])
    assert data_gone.closed
    assert [loss.source for loss in data_gone.losses if loss.source == 0] == [0]
    assert totals_gone.closed
    assert not totals_gone.lost_records


def test_the_next_sound_head_before_a_byte_is_found_past_damaged_ones(tmp_path):
    written = write_log(tmp_path / "log", 10)
    path = tmp_path / "log" / written[0].file
    content = bytearray(path.read_bytes())
    for damaged in written[2:4]:
        content[damaged.begin + 20] ^= 1
    path.write_bytes(content)
    with FileScan(path, bytes(content[4:12])) as scan:
        for at, until, found in (
            (0, 1, 0),
            (1, len(content), 1),
            (written[1].begin, written[1].begin, None),
            (written[1].begin, written[1].begin + 1, 1),
            (written[2].begin, len(content), 4),
            (written[2].begin, written[4].begin + 1, 4),
            (written[2].begin, written[4].begin, None),
            (written[-1].begin + 1, len(content), None),
        ):
            head = scan.head_from(at, until)
            assert (None if head is None else head.record.number) == found, (at, until)


def test_a_log_is_told_by_its_first_sound_head_within_what_is_looked_at(tmp_path):
    written = write_log(tmp_path / "log", 10)
    path = tmp_path / "log" / written[0].file
    content = path.read_bytes()
    assert first_log_id(path, 0) == content[4:12]
    before = MARK * 3 + bytes(100)
    path.write_bytes(before + content)
    assert first_log_id(path, len(before) + HEAD_SIZE) == content[4:12]
    assert first_log_id(path, len(before) - HEAD_SIZE) is None
    path.write_bytes(MARK * 50)
    assert first_log_id(path, 1 << 16) is None


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes in folders")
def test_a_pipe_among_the_files_of_a_log_is_refused_and_not_waited_for(tmp_path: Path, whole) -> None:
    copied = tmp_path / "log"
    shutil.copytree(whole[0], copied)
    segment = sorted(copied.glob("*.rdlog"))[-1]
    segment.unlink()
    os.mkfifo(segment)
    with pytest.raises(StoreError, match="is a pipe, a device or a folder; expected a file of a log") as caught:
        open_log(copied)
    assert caught.value.path == segment
    with pytest.raises(StoreError, match="is a pipe, a device or a folder; expected a file of a log"):
        FileScan(segment, bytes(8))
