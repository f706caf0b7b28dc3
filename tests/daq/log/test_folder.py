"""Records of a log come in order, each once, and a log says what it is before anything else."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.errors import StoreError
from recoil_acquisition.log import folder as folder_module
from recoil_acquisition.log.capture import write_capture
from recoil_acquisition.log.folder import find_logs, in_order, open_log, remove_log
from recoil_acquisition.log.record import HEAD_SIZE, LONGEST_PAYLOAD, OWN, SCHEMA, Kind, Record
from recoil_acquisition.log.session import session_in
from recoil_acquisition.log.writer import LogWriter
from tests.builders import rdlog_bytes
from tests.builders.damaged_logs import write_log
from tests.builders.naive_log import read_file


def record(number: int, payload: bytes = b"", *, source: int = 1, kind: int = Kind.SERIAL) -> Record:
    return Record(number, source, kind, number * 10**9, payload, 0, 0, number, 0)


@given(st.lists(st.integers(0, 40), max_size=60), st.sampled_from([None, 0]))
def test_records_come_in_order_and_each_once_however_they_stand(numbers: list[int], following: int | None) -> None:
    came = [one.number for one in in_order([record(number) for number in numbers], following)]
    assert came == sorted(set(came))
    if following == 0:
        assert set(came) == set(numbers)


@pytest.mark.parametrize(("room", "waiting"), [(3, 3), (0, 0)])
def test_what_waits_for_a_missing_record_is_bounded(monkeypatch: pytest.MonkeyPatch, room: int, waiting: int) -> None:
    size = HEAD_SIZE + 5
    monkeypatch.setattr(folder_module, "REORDER_BYTES", room * size)
    taken: list[int] = []

    def without_the_first() -> Iterator[Record]:
        for number in range(1, 9):
            taken.append(number)
            yield record(number, b"12345")

    came = in_order(without_the_first(), 0)
    # as soon as more waits than there is room for, the missing one is given up
    assert next(came).number == 1
    assert taken[-1] == waiting + 1
    assert [one.number for one in came] == [2, 3, 4, 5, 6, 7, 8]


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 0, 1, 2), (1, 3, 0, 2), (2, 2, 1, 0, 3)])
def test_a_log_gives_its_records_by_number_however_they_stand_in_its_file(
    tmp_path: Path, order: tuple[int, ...]
) -> None:
    pieces = [rdlog_bytes.record(i, 0, rdlog_bytes.SERIAL, i, bytes([i]), i, i) for i in range(4)]
    (tmp_path / "000001.rdlog").write_bytes(b"".join(pieces[i] for i in order))
    assert [one.payload[0] for one in open_log(tmp_path).records()] == [0, 1, 2, 3]


def test_a_record_that_comes_late_within_the_room_takes_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder_module, "REORDER_BYTES", 3 * HEAD_SIZE)
    moved = [record(number) for number in (0, 2, 3, 4, 1, 6, 7, 5, 9, 8)]
    assert [one.number for one in in_order(moved, 0)] == list(range(10))


def test_what_waited_comes_as_soon_as_the_record_before_it_has_come() -> None:
    taken: list[int] = []

    def one_late() -> Iterator[Record]:
        for number in (0, 2, 3, 1, 4, 5):
            taken.append(number)
            yield record(number)

    came = in_order(one_late(), 0)
    assert [next(came).number for _ in range(4)] == [0, 1, 2, 3]
    assert taken == [0, 2, 3, 1]
    assert [one.number for one in came] == [4, 5]


def part(number: int, of: int, text: str, changed: Mapping[str, object] | None = None) -> Record:
    said = {"schema": SCHEMA, "part": number, "of": of, "text": text} | dict(changed or {})
    return record(0, json.dumps(said).encode(), source=OWN, kind=Kind.SESSION)


def test_a_session_is_put_together_of_its_parts_and_of_nothing_that_a_device_sent() -> None:
    foreign = part(0, 1, '{"rig": "wrong"}')._replace(source=1)
    other = part(0, 1, '{"rig": "wrong"}')._replace(kind=Kind.CLOCK)
    assert session_in([foreign, other, part(1, 2, '"right"}'), part(0, 2, '{"rig": ')]) == {"rig": "right"}
    assert session_in([foreign, other]) is None
    assert session_in([part(0, 2, "{")]) is None


@pytest.mark.parametrize(
    "changed",
    [
        {"part": "first"}, {"part": None}, {"part": math.inf}, {"of": 2},
        {"text": "{"}, {"text": "[1]"}, {"text": "1"}, {"text": "[" * 100_000},
    ],
)  # fmt: skip
def test_what_says_no_session_is_none(changed: dict[str, object]) -> None:
    assert session_in([part(0, 1, "{}", changed)]) is None


def test_a_session_stands_behind_what_says_none() -> None:
    nonsense = [part(0, 1, "{"), record(0, b"[]", source=OWN, kind=Kind.SESSION)]
    lacking = [record(0, b'{"schema": "%s"}' % SCHEMA.encode(), source=OWN, kind=Kind.SESSION)]
    assert session_in([*nonsense, *lacking, part(0, 1, '{"rig": 1}')]) == {"rig": 1}


def test_a_log_of_another_version_is_refused() -> None:
    with pytest.raises(StoreError, match="another version") as caught:
        session_in([part(0, 1, "{}", {"schema": "recoil-daq/log/2"})])
    assert (caught.value.expected, caught.value.found) == (SCHEMA, "recoil-daq/log/2")


def flip(path: Path, *places: int) -> None:
    content = bytearray(path.read_bytes())
    for place in places:
        content[place] ^= 1
    path.write_bytes(content)


def test_of_the_records_of_a_session_the_sound_ones_are_returned(tmp_path: Path) -> None:
    written = write_log(tmp_path / "log", 5)
    first, second = (one for one in written if one.kind == Kind.SESSION)
    assert [one.number for one in open_log(tmp_path / "log").session_records()] == [first.number]
    flip(tmp_path / "log" / first.file, first.begin + 70)
    assert [one.number for one in open_log(tmp_path / "log").session_records()] == [second.number]


def test_what_says_no_part_of_a_session_is_none_of_its_records(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=1 << 14) as writer:
        for said in ({"text": "{}"}, {"part": "x"}, {"part": None}, {"part": math.inf}):
            writer.append(OWN, Kind.SESSION, 0, json.dumps(said).encode())
        writer.append(1, Kind.SESSION, 0, b'{"part": 1}')
    assert [one.number for one in open_log(tmp_path / "log").session_records()] == [0]


def test_a_log_is_known_by_what_stands_behind_its_longest_record(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=4 << 20) as writer:
        writer.append(0, Kind.SERIAL, 0, bytes(LONGEST_PAYLOAD))
        writer.append(0, Kind.SERIAL, 1, b"behind")
    path = tmp_path / "log" / "000001.rdlog"
    behind = next(one for one in read_file(path) if one.payload == b"behind")
    flip(path, *(one.begin for one in read_file(path) if one.begin < behind.begin))
    assert [one.payload for one in open_log(tmp_path / "log").records(0)] == [b"behind"]


def test_what_is_damaged_of_a_log_counts_in_bytes_wherever_it_lies(tmp_path: Path) -> None:
    written = write_log(tmp_path / "log", closed=False)
    damaged = [one for one in written if one.source == 0][10::100]
    for one in damaged:
        flip(tmp_path / "log" / one.file, one.begin)
    path = tmp_path / "log" / written[-1].file
    path.write_bytes(path.read_bytes()[:-1])
    survey = open_log(tmp_path / "log").survey()
    assert len({one.file for one in damaged}) > 1
    assert survey.unfinished_bytes == len(written[-1].content) - 1
    assert survey.damaged_bytes == sum(len(one.content) for one in damaged) + survey.unfinished_bytes
    assert survey.damaged


def test_records_that_are_gone_without_a_trace_are_damage_though_no_byte_is(tmp_path: Path) -> None:
    written = write_log(tmp_path / "log")
    (tmp_path / "log" / "000002.rdlog").unlink()
    survey = open_log(tmp_path / "log").survey()
    assert (survey.damaged_bytes, survey.damaged) == (0, True)
    assert survey.lost_records == sum(one.file == "000002.rdlog" for one in written)


def test_a_record_that_says_nonsense_of_the_whole_log_is_told(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=1 << 14) as writer:
        number = writer.say(Kind.CLOSED, 0, {"sources": {"0": 1}})
    with pytest.raises(StoreError, match=f"record {number} cannot be understood"):
        open_log(tmp_path / "log").survey()


@pytest.fixture
def spared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the spare folder in which a log has gone on."""
    with LogWriter(tmp_path / "log", {}, 0, spare=tmp_path / "spare", segment_bytes=1 << 14) as writer:
        writer.append(0, Kind.SERIAL, 0, b"first")
        writer.sync()
        whole = os.writev

        def fail_once(*_arguments: object) -> int:
            monkeypatch.setattr(os, "writev", whole)
            raise OSError(errno.EIO, os.strerror(errno.EIO))

        monkeypatch.setattr(os, "writev", fail_once)
        writer.append(0, Kind.SERIAL, 1, b"second")
    return tmp_path / "spare"


def test_a_log_whose_spare_folder_holds_something_else_leaves_that_where_it_is(tmp_path: Path, spared: Path) -> None:
    (spared / "notes.txt").touch()
    open_log(tmp_path / "log").remove()
    assert [path.name for path in tmp_path.iterdir()] == [spared.name]
    assert [path.name for path in spared.iterdir()] == ["notes.txt"]


def test_of_a_spare_folder_only_the_segments_of_the_log_itself_are_taken(tmp_path: Path, spared: Path) -> None:
    (first,) = (path.name for path in (tmp_path / "log").glob("*.rdlog"))
    own = [segment.path for segment in open_log(tmp_path / "log").segments]
    assert [path.parent.name for path in own] == ["log", spared.name]
    foreign = spared / "000009.rdlog"
    write_log(tmp_path / "other", 5)
    (tmp_path / "other" / first).rename(foreign)
    log = open_log(tmp_path / "log")
    assert [segment.path for segment in log.segments] == own
    log.remove()
    assert list(spared.iterdir()) == [foreign]


def test_a_spare_folder_that_is_opened_itself_is_read_once_however_it_is_called(
    tmp_path: Path, spared: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in (spared, Path(spared.name)):
        log = open_log(folder)
        assert [segment.path for segment in log.segments] == [folder / "000001.rdlog"]
        assert [one.payload for one in log.records(0)] == [b"second"]


def test_a_spare_folder_that_cannot_be_read_is_told(tmp_path: Path, spared: Path) -> None:
    (spared / "000009.rdlog").symlink_to(tmp_path / "missing")
    with pytest.raises(StoreError, match="cannot be read") as caught:
        open_log(tmp_path / "log")
    assert caught.value.path == spared


def test_a_spare_folder_that_is_gone_leaves_the_rest_of_the_log(tmp_path: Path, spared: Path) -> None:
    spared.rename(tmp_path / "elsewhere")
    log = open_log(tmp_path / "log")
    assert [segment.path.parent.name for segment in log.segments] == ["log"]
    assert log.session["spare"] == str(spared)


def test_files_that_are_called_like_segments_and_are_captures_are_no_log(tmp_path: Path) -> None:
    write_log(tmp_path / "log", 5)
    for folder, name in (("shots", "100000.rdlog"), ("usual", "0001.rdlog")):
        (tmp_path / folder).mkdir()
        write_capture(open_log(tmp_path / "log"), tmp_path / folder / name, None, None, {})
    assert find_logs(tmp_path) == (tmp_path / "log",)
    with pytest.raises(StoreError, match="holds captures and no log"):
        open_log(tmp_path / "shots")


def test_the_lock_that_a_killed_writer_left_goes_with_its_log(tmp_path: Path) -> None:
    write_log(tmp_path / "log", 5, closed=False)
    (tmp_path / "log" / "writer.lock").touch()
    open_log(tmp_path / "log").remove()
    assert list(tmp_path.iterdir()) == []


def test_a_log_that_is_being_written_is_neither_left_over_nor_removed(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=1 << 14):
        assert find_logs(tmp_path) == ()
        with pytest.raises(StoreError, match="is being written"):
            remove_log(tmp_path / "log")
    assert find_logs(tmp_path) == (tmp_path / "log",)


def test_the_clock_before_an_instant_is_the_last_of_those_at_the_beginnings_of_segments(tmp_path: Path) -> None:
    written = write_log(tmp_path / "log")
    log = open_log(tmp_path / "log")
    at_beginnings = {one.file: one.number for one in reversed(written) if one.kind == Kind.CLOCK}
    clocks = [one for one in log.records() if one.number in at_beginnings.values()]
    assert len(clocks) == len(log.segments) >= 3
    assert [log.clock_before(clock.host_ns) for clock in clocks] == clocks
    before = log.clock_before(clocks[2].host_ns - 1)
    assert before is not None
    assert clocks[1].number <= before.number < clocks[2].number
    assert log.clock_before(None) == log.clock_before(clocks[0].host_ns - 1) == clocks[0]
