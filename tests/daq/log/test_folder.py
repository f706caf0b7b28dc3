"""Records of a log come in order, each once, and a log says what it is before anything else."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.log import folder as folder_module
from recoil_acquisition.log.folder import in_order, open_log, session_in
from recoil_acquisition.log.record import HEAD_SIZE, OWN, SCHEMA, Kind, Record
from tests.builders.damaged_logs import write_log


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


def test_a_record_that_comes_late_within_the_room_takes_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder_module, "REORDER_BYTES", 3 * HEAD_SIZE)
    moved = [record(number) for number in (0, 2, 3, 4, 1, 6, 7, 5, 9, 8)]
    assert [one.number for one in in_order(moved, 0)] == list(range(10))


def part(number: int, of: int, text: str, **changed: object) -> Record:
    said = {"schema": SCHEMA, "part": number, "of": of, "text": text} | changed
    return record(0, json.dumps(said).encode(), source=OWN, kind=Kind.SESSION)


def test_a_session_is_put_together_of_its_parts_and_of_nothing_that_a_device_sent() -> None:
    foreign = part(0, 1, '{"rig": "wrong"}')._replace(source=1)
    other = part(0, 1, '{"rig": "wrong"}')._replace(kind=Kind.CLOCK)
    assert session_in([foreign, other, part(1, 2, '"right"}'), part(0, 2, '{"rig": ')]) == {"rig": "right"}
    assert session_in([foreign, other]) is None
    assert session_in([part(0, 2, "{")]) is None


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
