"""Losses are counted exactly from the numbers of the records that are there."""

from __future__ import annotations

import json

from recoil_acquisition.log.record import OWN, Kind, Record
from recoil_acquisition.log.tally import Loss, Tally

SIZE = 10


def data(number: int, source: int, source_number: int) -> Record:
    """Make one of ten bytes that arrived within 0.4 s before second `number`."""
    host_ns = number * 10**9
    return Record(number, source, Kind.SERIAL, host_ns, bytes(SIZE), 400_000, 0, source_number, SIZE * source_number)


def own(number: int, kind: Kind, said: dict[str, object], source_number: int = 0) -> Record:
    return Record(number, OWN, kind, number * 10**9, json.dumps(said).encode(), 0, 0, source_number, 0)


def alternating(count: int) -> list[Record]:
    """Make records of the sources 1 and 2 in turn."""
    return [data(k, 1 + k % 2, k // 2) for k in range(count)]


def tally_of(records: list[Record]) -> Tally:
    tally = Tally()
    for record in records:
        tally.take(record)
    return tally


def test_a_log_without_a_gap_has_lost_nothing():
    tally = tally_of(alternating(10))
    assert (tally.records, tally.losses, tally.lost_records, tally.released_records) == (10, (), 0, 0)


def test_a_gap_is_told_by_source_with_its_bytes_and_between_which_instants_it_arrived():
    tally = tally_of([record for record in alternating(10) if record.number not in (3, 4, 5)])
    # between the ends of those before and the beginnings of those behind
    assert tally.losses == (
        Loss(1, 2, 2, SIZE, 2 * 10**9, 5_600_000_000),
        Loss(2, 1, 2, 2 * SIZE, 10**9, 6_600_000_000),
    )
    assert tally.lost_records == 3


def test_what_is_missing_at_the_beginning_has_nothing_before_it():
    tally = tally_of(alternating(6)[2:])
    assert [(loss.source, loss.first, loss.last, loss.from_ns) for loss in tally.losses] == [
        (1, 0, 0, None),
        (2, 0, 0, None),
    ]
    assert tally.lost_records == 2


def test_a_missing_record_of_the_log_itself_counts_although_no_source_misses_it():
    tally = tally_of([data(0, 1, 0), data(2, 1, 1)])
    assert tally.losses == ()
    assert tally.lost_records == 1


def test_what_the_log_says_at_its_end_shows_what_is_missing_there():
    said = {"sources": {"1": [3, 3 * SIZE], "2": [2, 2 * SIZE]}}
    tally = tally_of([*alternating(4), own(4, Kind.CLOSED, said)])
    assert tally.closed
    assert tally.losses == (Loss(1, 2, 2, SIZE, 2 * 10**9, None),)
    assert tally.lost_records == 1
    assert not tally_of(alternating(4)).closed


def test_what_was_released_is_no_loss_and_is_counted():
    released = {"records": [[0, 3, 4 * SIZE]], "sources": {"1": [[0, 1, 2 * SIZE]], "2": [[0, 1, 2 * SIZE]]}}
    tally = tally_of([*alternating(8)[4:], own(8, Kind.RELEASED, released)])
    assert (tally.losses, tally.lost_records, tally.released_records) == ((), 0, 4)


def test_what_is_missing_around_the_released_is_lost_on_both_sides():
    records = [data(k, 1, k) for k in range(20)]
    released = {
        "records": [[6, 7, 2 * SIZE], [10, 11, 2 * SIZE]],
        "sources": {"1": [[6, 7, 2 * SIZE], [10, 11, 2 * SIZE]]},
    }
    kept = [record for record in records if not 4 <= record.number <= 13]
    tally = tally_of([*kept, own(20, Kind.RELEASED, released)])
    assert [(loss.first, loss.last) for loss in tally.losses] == [(4, 5), (8, 9), (12, 13)]
    assert sum(loss.bytes for loss in tally.losses) == 6 * SIZE
    assert (tally.lost_records, tally.released_records) == (6, 4)


def test_what_was_released_elsewhere_takes_nothing_off_a_gap():
    records = [data(k, 1, k) for k in range(12)]
    released = {"records": [[0, 1, 2 * SIZE]], "sources": {"1": [[0, 1, 2 * SIZE]], "2": [[5, 6, 2 * SIZE]]}}
    kept = [record for record in records if record.number not in (0, 1, 5, 6)]
    tally = tally_of([*kept, own(12, Kind.RELEASED, released)])
    assert [(loss.source, loss.first, loss.last, loss.bytes) for loss in tally.losses] == [(1, 5, 6, 2 * SIZE)]
    assert (tally.lost_records, tally.released_records) == (2, 2)
