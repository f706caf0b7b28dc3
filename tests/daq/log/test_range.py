"""A range of a log is what a filter of all of it gives."""

from __future__ import annotations

import os
import random
import time
from pathlib import Path

import pytest

from recoil_acquisition.clocks.host_clock import Anchor
from recoil_acquisition.log import folder as folder_module
from recoil_acquisition.log import scan as scan_module
from recoil_acquisition.log import writer as writer_module
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import Kind
from recoil_acquisition.log.writer import LogWriter

SEGMENT_BYTES = 1 << 16
STEP_NS = 1_000_000


class Clock:
    """The host's monotonic clock, set by the test."""

    def __init__(self) -> None:
        self.now_ns = time.monotonic_ns() + 10**8

    def monotonic_ns(self) -> int:
        return self.now_ns

    def __getattr__(self, name: str):
        return getattr(time, name)


def write_late(folder: Path, monkeypatch: pytest.MonkeyPatch, *, closed: bool) -> None:
    """Write three sources whose threads sometimes stand for up to three seconds before they append."""
    choice = random.Random(5)  # noqa: S311 - a test's choice, no secret
    clock = Clock()
    monkeypatch.setattr(writer_module, "time", clock)
    due = []
    for source in range(3):
        until_ns = 0
        for k in range(2000):
            read_ns = clock.now_ns + k * 2 * STEP_NS + source
            until_ns = max(until_ns, read_ns + 20_000)
            if choice.random() < 0.001:
                until_ns = read_ns + choice.randrange(3_000_000_000)
            span_ns = None if choice.random() < 0.01 else choice.choice((300_000, STEP_NS, 40 * STEP_NS))
            due.append((until_ns, source, read_ns, None if span_ns is None else read_ns - span_ns, k))
    writer = LogWriter(folder, {}, 0, segment_bytes=SEGMENT_BYTES)
    for until_ns, source, read_ns, empty_ns, k in sorted(due):
        clock.now_ns = until_ns
        writer.append(source, Kind.SERIAL, read_ns, choice.randbytes(k % 200), empty_ns=empty_ns)
    writer.close(in_order=closed)
    monkeypatch.undo()


def faults_of_windows(folder: Path, windows: int, seed: int) -> list[str]:
    choice = random.Random(seed)  # noqa: S311 - a test's choice, no secret
    log = open_log(folder)
    everything = list(log.records())
    begin = min(record.from_ns for record in everything)
    end = max(record.host_ns for record in everything)
    faults = []
    for _ in range(windows):
        start = choice.randrange(begin - 2 * 10**8, end)
        stop = start + choice.choice((1, STEP_NS, 10**9, 3 * 10**9))
        expected = [r for r in everything if r.host_ns >= start and r.from_ns < stop]
        found = list(log.records(start_ns=start, stop_ns=stop))
        if found != expected:
            faults.append(f"{start} to {stop}: {len(found)} instead of {len(expected)}")
    return faults


@pytest.mark.exhaustive
@pytest.mark.parametrize("closed", [True, False])
def test_a_range_is_a_filter_of_all_however_late_something_was_appended(tmp_path, monkeypatch, closed):
    write_late(tmp_path / "log", monkeypatch, closed=closed)
    assert len(open_log(tmp_path / "log").segments) > 10
    assert faults_of_windows(tmp_path / "log", 40, 1) == []


@pytest.mark.exhaustive
@pytest.mark.parametrize("step_ns", [0, 1300])
def test_a_range_is_a_filter_of_all_to_the_nanosecond(tmp_path, monkeypatch, step_ns):
    choice = random.Random(6)  # noqa: S311 - a test's choice, no secret
    clock = Clock()
    monkeypatch.setattr(writer_module, "time", clock)
    monkeypatch.setattr(writer_module, "anchor", lambda: Anchor(0, clock.now_ns, 0))
    began_ns = clock.now_ns
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=1 << 20) as writer:
        for i in range(240):
            clock.now_ns += step_ns
            read_ns = clock.now_ns - choice.randrange(3000)
            span_ns = choice.randrange(5000)
            # one every so often that waits for longest, from the first instant that it may hold until it is appended
            if i % 80 == 40:
                read_ns, span_ns = clock.now_ns - 3000, 5000
            writer.append(0, Kind.SERIAL, read_ns, bytes(12_000), empty_ns=read_ns - span_ns)
    log = open_log(tmp_path / "log")
    records = list(log.records(0))
    longest = [record for record in records if record.host_ns - record.from_ns == 5000]
    last_begins_ns = log.segments[-1].begin_ns
    assert len(log.segments) >= 3
    assert last_begins_ns is not None
    for start in (began_ns, *(last_begins_ns + off for off in (-1000, -1, 0, 1, 999))):
        expected = [record for record in records if record.host_ns >= start]
        assert list(log.records(0, start_ns=start)) == expected
    for start in (record.host_ns for record in records):
        assert next(log.records(0, start_ns=start)) == next(one for one in records if one.host_ns >= start)
    for stop in (record.from_ns + off for record in longest for off in (0, 1)):
        expected = [record for record in records if record.from_ns < stop]
        assert list(log.records(0, stop_ns=stop)) == expected


@pytest.mark.exhaustive
def test_a_range_is_a_filter_of_all_where_the_log_is_damaged(tmp_path, monkeypatch):
    write_late(tmp_path / "log", monkeypatch, closed=True)
    choice = random.Random(2)  # noqa: S311 - a test's choice, no secret
    paths = sorted((tmp_path / "log").glob("*.rdlog"))
    for _ in range(100):
        path = choice.choice(paths)
        content = bytearray(path.read_bytes())
        content[choice.randrange(len(content))] ^= 1 << choice.randrange(8)
        path.write_bytes(content)
    content = bytearray(paths[4].read_bytes())
    content[20_000:60_000] = bytes(40_000)
    paths[4].write_bytes(content)
    paths[7].unlink()
    assert faults_of_windows(tmp_path / "log", 30, 3) == []


@pytest.mark.exhaustive
def test_a_range_that_ends_with_its_segment_too_early_is_found_out(tmp_path, monkeypatch):
    write_late(tmp_path / "log", monkeypatch, closed=True)
    monkeypatch.setattr(folder_module, "_longest_us", lambda _record, _kind: 0)
    assert faults_of_windows(tmp_path / "log", 20, 1) != []


@pytest.mark.exhaustive
@pytest.mark.parametrize("segment_bytes", [4 << 20, 64 << 20])
def test_only_the_range_is_read(tmp_path, monkeypatch, segment_bytes):
    clock = Clock()
    monkeypatch.setattr(writer_module, "time", clock)
    monkeypatch.setattr(writer_module, "anchor", lambda: Anchor(0, clock.now_ns, 0))
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=segment_bytes) as writer:
        for _ in range(8000):
            clock.now_ns += STEP_NS
            writer.append(0, Kind.SERIAL, clock.now_ns, bytes(4000))
    log = open_log(tmp_path / "log")
    everything = list(log.records(0))
    read = []
    whole = os.pread
    monkeypatch.setattr(os, "pread", lambda *a: read.append(a[1]) or whole(*a))
    monkeypatch.setattr(scan_module, "PIECE", 1 << 16)
    found = list(log.records(0, everything[4000].host_ns, everything[4080].host_ns))
    assert found == everything[4000:4080]
    size = sum(path.stat().st_size for path in (tmp_path / "log").glob("*.rdlog"))
    assert 80 * 4000 < sum(read) < size / 10


def test_a_range_is_a_filter_of_all_where_payloads_hold_copies_of_earlier_records(tmp_path, monkeypatch):
    clock = Clock()
    monkeypatch.setattr(writer_module, "time", clock)
    monkeypatch.setattr(writer_module, "anchor", lambda: Anchor(0, clock.now_ns, 0))
    with LogWriter(tmp_path / "log", {}, 0, segment_bytes=4 << 20) as writer:
        first = (tmp_path / "log" / "000001.rdlog").read_bytes().rstrip(b"\0")
        for _ in range(400):
            clock.now_ns += STEP_NS
            writer.append(0, Kind.SERIAL, clock.now_ns, first.rjust(4000))
    log = open_log(tmp_path / "log")
    everything = list(log.records(0))
    for start in (10, 100, 200, 390):
        assert list(log.records(0, start_ns=everything[start].host_ns)) == everything[start:]


def test_records_are_selected_by_source(tmp_path, monkeypatch):
    write_late(tmp_path / "log", monkeypatch, closed=True)
    log = open_log(tmp_path / "log")
    every = list(log.records())
    assert list(log.records(2)) == [record for record in every if record.source == 2]
