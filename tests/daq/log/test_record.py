"""The bytes of a record are as documented, and a second reader that was written from the table agrees."""

from __future__ import annotations

import itertools
import json
import time
import zlib

from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import OWN, Kind, Record, pack_record
from recoil_acquisition.log.writer import LogWriter
from tests.builders.damaged_logs import write_log
from tests.builders.naive_log import read_folder

GOLDEN = (
    "8d52444c0102030405060708"  # mark, log
    "07000000" "04030201" "05000000" "06000000"  # length, source and kind, span, wait
    "09000000" "0a00000000000000" "0b00000000000000"  # numbers, position
    "feffffffffffffff"  # host time of -2 ns
)  # fmt: skip


def test_the_bytes_of_a_record_are_as_documented():
    log_id = bytes(range(1, 9))
    seed = zlib.crc32(log_id)
    record = Record(10, 0x0304, 0x0102, -2, b"payload", 5, 6, 9, 11)
    head = bytes.fromhex(GOLDEN)
    payload_crc = zlib.crc32(b"payload", seed).to_bytes(4, "little")
    head_crc = zlib.crc32(head + payload_crc, seed).to_bytes(4, "little")
    assert pack_record(log_id, record) == head + payload_crc + head_crc + b"payload"
    # written down once, so that a change of the CRC or its seed is seen too
    assert (payload_crc + head_crc).hex() == "01540725fea1c38e"


def test_the_kinds_have_the_numbers_of_the_format():
    numbers = (1, 2, 3, 16, 17, 32, 33, 34, 35, 36, 37, 38)
    names = [
        "CAN",
        "SERIAL",
        "STREAM",
        "EVENT",
        "IDLE",
        "SESSION",
        "CLOCK",
        "DECISION",
        "KEPT",
        "SHOT",
        "RELEASED",
        "CLOSED",
    ]
    assert {kind.name: int(kind) for kind in Kind} == dict(zip(names, numbers, strict=True))


def test_a_writer_begins_with_its_session_twice_and_ends_with_its_totals_twice(tmp_path):
    with LogWriter(tmp_path / "log", {"rig": "x"}, 0, segment_bytes=1 << 16) as writer:
        writer.append(3, Kind.SERIAL, 2_000_000, b"abc", empty_ns=994_001)
        writer.append(3, Kind.SERIAL, 2_000_000, b"defg")
    found = read_folder(tmp_path / "log")
    session, clock, device, closed = Kind.SESSION, Kind.CLOCK, Kind.SERIAL, Kind.CLOSED
    assert [one.kind for one in found] == [session, clock, session, clock, device, device, closed, closed]
    assert [one.number for one in found] == list(range(8))
    assert [(one.source_number, one.position) for one in found if one.source == 3] == [(0, 0), (1, 3)]
    assert [one.span_us for one in found if one.source == 3] == [1006, 0xFFFFFFFF]
    said = json.loads(found[0].payload)
    assert (said["schema"], json.loads(said["text"])) == ("recoil-daq/log/1", {"rig": "x"})
    assert json.loads(found[-1].payload)["sources"] == {"3": [2, 7]}


def test_the_reader_and_a_naive_one_agree_and_what_is_read_packs_to_the_same_bytes(tmp_path):
    written = write_log(tmp_path / "log")
    log = open_log(tmp_path / "log")
    read = list(log.records())
    assert b"".join(pack_record(log.log_id, one) for one in read) == b"".join(one.content for one in written)
    for found, one in zip(written, read, strict=True):
        assert one[:5] == (found.number, found.source, found.kind, found.host_ns, found.payload)
        assert (one.source_number, one.position) == (found.source_number, found.position)
        assert (one.span_us, one.wait_us) == (None if one.source == OWN else found.span_us, found.wait_us)


def test_logged_time_never_runs_backwards_and_never_before_the_read(tmp_path):
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=1 << 16) as writer:
        now_ns = time.monotonic_ns()
        for late_ns in (0, 3_000_000_000, 10, -5_000, 2_500_000, -1_000_000_000, 7, 0):
            writer.append(0, Kind.SERIAL, now_ns - late_ns, b"x")
    logged = [record.logged_ns for record in open_log(tmp_path / "log").records()]
    assert all(b >= a - 1000 for a, b in itertools.pairwise(logged))
    assert all(r.logged_ns >= r.host_ns for r in open_log(tmp_path / "log").records())
