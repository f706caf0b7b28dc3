"""A capture is a range of a log, byte for byte, readable alone, and says what it lacks."""

from __future__ import annotations

import math
import random
import shutil
from pathlib import Path

import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError, StoreError
from recoil_acquisition.files.new_file import partial_path
from recoil_acquisition.log.capture import capture_holds, extents, read_capture, write_capture
from recoil_acquisition.log.folder import Log, open_log
from recoil_acquisition.log.record import OWN, UNNUMBERED, Kind
from recoil_acquisition.log.tally import Loss
from recoil_acquisition.log.writer import LogWriter
from tests.builders import rdlog_bytes
from tests.builders.damaged_logs import write_log
from tests.builders.naive_log import read_file, read_folder


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Log:
    folder = tmp_path_factory.mktemp("whole") / "log"
    write_log(folder)
    return open_log(folder)


def middle(log: Log) -> tuple[int, int]:
    times = sorted(record.host_ns for record in log.records() if record.source != OWN)
    return times[len(times) // 3], times[2 * len(times) // 3]


def test_a_capture_holds_the_range_byte_for_byte_and_can_be_read_without_the_log(log, tmp_path):
    start, stop = middle(log)
    path = tmp_path / "0001.rdlog"
    write_capture(log, path, start, stop, {"shot": "0001"})
    inside = {r.number for r in log.records(start_ns=start, stop_ns=stop)}
    original = {one.number: one.content for one in read_folder(log.folder)}
    copied = read_file(path)
    assert {one.number for one in copied} > inside
    assert all(one.content == original[one.number] for one in copied if one.number != UNNUMBERED)
    order = [one.kind for one in copied]
    assert order[:3] == [Kind.SESSION, Kind.CLOCK, Kind.SHOT]
    assert order[-2:] == [Kind.SHOT, Kind.SESSION]
    assert {one.number for one in copied[3:-2] if one.source == OWN} <= inside
    # the declaration is in no log: nothing is said of when it arrived and of what came before it
    declared = [one for one in copied if one.number == UNNUMBERED]
    assert [(one.host_ns, one.source_number, one.position) for one in declared] == [(0, 0, 0)] * 2

    capture = read_capture(path)

    assert capture.session == log.session
    assert capture.declaration["shot"] == "0001"
    assert [r for r in capture.records if r.number in inside] == list(log.records(start_ns=start, stop_ns=stop))
    for source in range(4):
        assert capture.of(source) == tuple(log.records(source, start, stop))
    assert capture.of(4) == ()
    assert (capture.complete, capture.losses, capture.damages, capture.unfinished_bytes) == (True, (), (), 0)
    assert capture_holds(log, path, start, stop)
    assert capture_holds(log, path, start + 10**6, stop - 10**6)
    assert not capture_holds(log, path, None, None)
    assert [p.name for p in tmp_path.iterdir()] == ["0001.rdlog"]


def test_a_capture_of_everything_holds_everything(log, tmp_path):
    write_capture(log, tmp_path / "all.rdlog", None, None, {})
    assert capture_holds(log, tmp_path / "all.rdlog", None, None)
    assert read_capture(tmp_path / "all.rdlog").records == tuple(log.records())


@pytest.mark.exhaustive
def test_any_record_that_is_missing_of_a_capture_is_said_and_no_log_is_removed_for_it(log, tmp_path):
    start, stop = middle(log)
    path = tmp_path / "whole.rdlog"
    write_capture(log, path, start, stop, {})
    content = path.read_bytes()
    inside = {r.number for r in log.records(start_ns=start, stop_ns=stop)}
    beside = {(r.source, r.source_number): r for r in read_capture(path).records}
    for one in read_file(path):
        if one.number not in inside or one.source == OWN:
            continue
        path.write_bytes(content[: one.begin] + content[one.begin + len(one.content) :])
        capture = read_capture(path)
        source, number = one.source, one.source_number
        before, behind = beside.get((source, number - 1)), beside.get((source, number + 1))
        # its bytes and its instants are known by what stands before and behind it
        size = 0 if before is None or behind is None else len(one.payload)
        from_ns, until_ns = before and before.host_ns, behind and behind.from_ns
        assert capture.losses == (Loss(source, number, number, size, from_ns, until_ns),)
        assert not capture.complete
        assert not capture_holds(log, path, start, stop)


@pytest.mark.exhaustive
def test_damage_of_a_capture_costs_one_record_and_is_said(log, tmp_path):
    start, stop = middle(log)
    path = tmp_path / "whole.rdlog"
    write_capture(log, path, start, stop, {"shot": "7"})
    content = path.read_bytes()
    whole = read_capture(path)
    choice = random.Random(4)  # noqa: S311 - a test's choice, no secret
    for _ in range(100):
        damaged = bytearray(content)
        damaged[choice.randrange(len(content))] ^= 1 << choice.randrange(8)
        path.write_bytes(damaged)
        capture = read_capture(path)
        lost = set(whole.records) - set(capture.records)
        assert set(capture.records) <= set(whole.records)
        assert len(lost) <= 1
        data = [one for one in lost if one.source != OWN]
        assert sum(loss.records for loss in capture.losses) == len(data)
        assert capture.declaration["shot"] == "7"
        assert capture.session == log.session
        assert capture.damages or capture.unfinished_bytes


def test_a_capture_without_its_declaration_is_not_complete(log, tmp_path):
    path = tmp_path / "whole.rdlog"
    write_capture(log, path, *middle(log), {"shot": "7"})
    content = bytearray(path.read_bytes())
    for one in read_file(path):
        if one.kind == Kind.SHOT:
            content[one.begin + 70] ^= 1
    path.write_bytes(content)
    assert not read_capture(path).complete


@pytest.mark.parametrize(
    "holds",
    [None, "all", {"x": [0, 9]}, {"0": 9}, {"0": [0]}, {"0": ["a", 9]}, {"0": [0, None]}, {"0": [0, math.inf]}],
)
def test_what_is_missing_shows_in_the_numbers_where_a_declaration_does_not_say_what_it_holds(tmp_path, holds):
    path = tmp_path / "x.rdlog"
    records = [(0, rdlog_bytes.SERIAL, 1000 * i, bytes(10 * i)) for i in range(5)]
    alone = (3, rdlog_bytes.SERIAL, 9000, b"alone")
    content = rdlog_bytes.rdlog({}, [*records, alone], {"shot": "7", "holds": holds})
    path.write_bytes(content)
    assert read_capture(path).losses == ()
    # it is the second of its source, behind the session and the first
    path.write_bytes(content.replace(rdlog_bytes.record(2, *records[1], 1, 0), b""))
    assert read_capture(path).losses == (Loss(0, 1, 1, 10, 0, 2000),)


def test_what_a_capture_is_of_is_what_it_declares_first(tmp_path):
    path = tmp_path / "x.rdlog"
    kept, other = (
        rdlog_bytes.record(UNNUMBERED, OWN, kind, 0, b'{"shot": "%d"}' % kind, 0, 0) for kind in (Kind.KEPT, Kind.SHOT)
    )
    path.write_bytes(kept + rdlog_bytes.rdlog({}, [], {"shot": "7"}) + other)
    assert read_capture(path).declaration == {"shot": "7"}


@pytest.mark.parametrize("said", [b"[]", b"7", b"no JSON"])
def test_a_declaration_that_cannot_be_understood_is_none(tmp_path, said):
    path = tmp_path / "x.rdlog"
    path.write_bytes(rdlog_bytes.record(UNNUMBERED, OWN, Kind.SHOT, 0, said, 0, 0) + rdlog_bytes.rdlog({}, []))
    capture = read_capture(path)
    assert (capture.declaration, capture.complete) == ({}, False)


def test_a_capture_of_a_log_without_a_sound_clock_has_none(tmp_path):
    for one in write_log(tmp_path / "log", 20):
        path = tmp_path / "log" / one.file
        content = bytearray(path.read_bytes())
        content[one.begin + 70] ^= one.kind == Kind.CLOCK
        path.write_bytes(content)
    log = open_log(tmp_path / "log")
    write_capture(log, tmp_path / "x.rdlog", None, None, {})
    kinds = {record.kind for record in read_capture(tmp_path / "x.rdlog").records}
    assert kinds == {Kind.SESSION, Kind.SERIAL, Kind.CLOSED}
    assert capture_holds(log, tmp_path / "x.rdlog", None, None)


def test_a_capture_is_read_though_its_beginning_is_damaged(log, tmp_path):
    path = tmp_path / "whole.rdlog"
    write_capture(log, path, *middle(log), {"shot": "7"})
    whole = read_capture(path)
    path.write_bytes(bytes(100) + path.read_bytes()[100:])
    capture = read_capture(path)
    assert set(capture.records) == set(whole.records)
    assert (capture.session, capture.declaration) == (whole.session, whole.declaration)
    assert [damage.at for damage in capture.damages] == [0]


def test_a_capture_of_another_log_holds_nothing_of_this_one(log, tmp_path):
    write_log(tmp_path / "other")
    write_capture(open_log(tmp_path / "other"), tmp_path / "x.rdlog", None, None, {})
    assert capture_holds(log, tmp_path / "x.rdlog", None, None) is False
    assert capture_holds(log, tmp_path / "missing.rdlog", None, None) is False


def test_a_capture_is_not_written_over_and_a_failed_one_leaves_nothing(log, tmp_path, monkeypatch):
    path = tmp_path / "x.rdlog"
    path.write_bytes(b"mine")
    with pytest.raises(StoreError, match="exists already"):
        write_capture(log, path, None, None, {})
    assert path.read_bytes() == b"mine"

    def full(*_arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(StoreError, match="No space left"):
        write_capture(log, tmp_path / "y.rdlog", None, None, {})
    assert [p.name for p in tmp_path.iterdir()] == ["x.rdlog"]


def test_a_capture_is_written_where_a_file_cannot_have_two_names(log, tmp_path, monkeypatch):
    def refuse(*_arguments: object) -> None:
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "hardlink_to", refuse)
    write_capture(log, tmp_path / "x.rdlog", None, None, {})
    assert capture_holds(log, tmp_path / "x.rdlog", None, None)
    assert [p.name for p in tmp_path.iterdir()] == ["x.rdlog"]


def test_what_an_attempt_that_a_crash_ended_left_goes_with_the_next(log, tmp_path):
    left = partial_path(tmp_path / "x.rdlog")
    left.write_bytes(b"half")
    write_capture(log, tmp_path / "x.rdlog", None, None, {})
    assert [p.name for p in tmp_path.iterdir()] == ["x.rdlog"]


def test_a_capture_for_a_folder_that_is_not_there_is_refused(log, tmp_path):
    with pytest.raises(StoreError, match="cannot be written"):
        write_capture(log, tmp_path / "missing" / "x.rdlog", None, None, {})
    assert list(tmp_path.iterdir()) == []


def test_a_capture_of_a_log_that_is_still_written(tmp_path):
    with LogWriter(tmp_path / "log", {"rig": "x"}, 0, segment_bytes=1 << 16) as writer:
        for i in range(500):
            writer.append(0, Kind.SERIAL, i, bytes(100))
        write_capture(open_log(tmp_path / "log"), tmp_path / "x.rdlog", 100, 200, {})
    assert sum(record.source == 0 for record in read_capture(tmp_path / "x.rdlog").records) == 100


@pytest.mark.parametrize(("start", "stop"), [(100, 400), (None, 400), (100, None)])
def test_what_the_log_says_of_a_range_afterwards_is_no_part_of_its_capture(tmp_path, start, stop):
    with LogWriter(tmp_path / "log", {"rig": "x"}, 0, segment_bytes=1 << 16) as writer:
        for i in range(300):
            writer.append(0, Kind.SERIAL, i, bytes(100))
        write_capture(open_log(tmp_path / "log"), tmp_path / "x.rdlog", start, stop, {})
        writer.append(OWN, Kind.SHOT, 250, b'{"shot": "0002"}')
        assert capture_holds(open_log(tmp_path / "log"), tmp_path / "x.rdlog", start, stop)
        writer.append(0, Kind.SERIAL, 350, bytes(100))
        assert not capture_holds(open_log(tmp_path / "log"), tmp_path / "x.rdlog", start, stop)


def test_files_that_are_no_capture_are_said(tmp_path):
    (tmp_path / "x.rdlog").write_bytes(b"something else" * 100)
    with pytest.raises(CorruptFileError, match="not one sound record"):
        read_capture(tmp_path / "x.rdlog")
    with pytest.raises((ReadError, StoreError), match="cannot be read"):
        read_capture(tmp_path / "missing.rdlog")
    shutil.rmtree(tmp_path)
    assert not Path(tmp_path).exists()


def test_what_a_range_holds_of_each_source_is_its_first_and_last_number_and_its_bytes(log):
    records = [record for record in log.records() if record.source != OWN]
    start_ns, stop_ns = records[len(records) // 4].host_ns, records[len(records) // 2].host_ns
    for span in ((None, None), (start_ns, stop_ns)):
        within = [record for record in log.records(start_ns=span[0], stop_ns=span[1]) if record.source != OWN]
        expected = {}
        for source in {record.source for record in within}:
            own = [record for record in within if record.source == source]
            numbers = [record.source_number for record in own]
            whole = [
                record
                for record in records
                if record.source == source and numbers[0] <= record.source_number <= numbers[-1]
            ]
            expected[source] = numbers[0], numbers[-1], sum(len(record.payload) for record in whole)
        assert extents(log, *span) == expected
        assert len(expected) == 4


def test_a_source_of_which_a_capture_has_nothing_left_is_lost_as_a_whole(log, tmp_path):
    path = tmp_path / "0001.rdlog"
    write_capture(log, path, None, None, {"schema": "x"})
    held = extents(log, None, None)
    path.write_bytes(b"".join(one.content for one in read_file(path) if one.source != 2))
    lost = [loss for loss in read_capture(path).losses if loss.source == 2]
    assert [(loss.first, loss.last) for loss in lost] == [held[2][:2]]
