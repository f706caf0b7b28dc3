"""The journal: nothing lost, nothing wrong, nothing twice, whatever happens to the process or the disk."""

from __future__ import annotations

import errno
import json
import os
import shutil
import struct
import subprocess
import sys
import threading
import time
import tracemalloc
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import StoreError
from recoil_acquisition.journal import JournalWriter, find_journals, read_journal, remove_journal
from recoil_acquisition.journal.layout import RECORD_OVERHEAD
from recoil_acquisition.log.segment import segment_paths as paths_of
from recoil_acquisition.log.sync import SegmentSync
from tests.builders.killed_journal import kill_a_writer, random_delays_s

SESSION = {
    "sources": {"1": "can0", "2": "imu"},
    "rig": "name = 'stand'\n",
    "clock": {"wall_s": 1.5, "monotonic_s": 2.5},
}
SEGMENT = 4096

needs_kill = pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL and its promises are POSIX")


def paths_in(folder: Path) -> dict[int, Path]:
    return paths_of(folder, ".journal")


def writer_in(folder: Path, reserve_bytes: int = 0, **options) -> JournalWriter:
    return JournalWriter(folder, SESSION, reserve_bytes, segment_bytes=options.pop("segment_bytes", SEGMENT), **options)


def payload(i: int) -> bytes:
    return struct.pack("<I", i) + bytes([i % 255 + 1]) * (i * 37 % 300)


def write_records(folder: Path, count: int) -> None:
    with writer_in(folder) as writer:
        for i in range(count):
            assert writer.append(i % 3, i % 5, i * 1000, payload(i)) == i


def as_tuples(folder: Path, **limits) -> list[tuple[int, int, int, int, bytes]]:
    return [(r.sequence, r.source, r.kind, r.host_ns, r.payload) for r in read_journal(folder).records(**limits)]


def written(count: int) -> list[tuple[int, int, int, int, bytes]]:
    return [(i, i % 3, i % 5, i * 1000, payload(i)) for i in range(count)]


def append_until_it_fails(writer: JournalWriter, pause_s: float = 0.0) -> tuple[int, StoreError]:
    """Return how many records were taken, and the error that the next one met."""
    for i in range(100_000):
        try:
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        except StoreError as error:
            return i, error
        time.sleep(pause_s)
    return pytest.fail("all records were taken")


def fail_with(code: int):
    def fail(*_arguments: object) -> int:
        raise OSError(code, os.strerror(code))

    return fail


def test_what_is_appended_is_read_back_in_order_over_many_segments(tmp_path):
    write_records(tmp_path / "j", 200)
    journal = read_journal(tmp_path / "j")
    assert as_tuples(tmp_path / "j") == written(200)
    assert journal.session == SESSION
    assert len(journal.segments) > 5
    assert (journal.count, journal.cut_bytes, journal.lost_records, journal.released_records) == (200, 0, 0, 0)


def test_a_closed_journal_takes_no_more_space_than_its_records(tmp_path):
    write_records(tmp_path / "j", 200)
    names = sorted(path.name for path in (tmp_path / "j").iterdir())
    assert names == [f"{n:06d}.journal" for n in range(1, len(names) + 1)]
    journal = read_journal(tmp_path / "j")
    for segment in journal.segments:
        records = [r for r in written(200) if segment.first_sequence <= r[0] <= segment.last_sequence]
        content = segment.header.size + sum(RECORD_OVERHEAD + len(r[4]) for r in records)
        assert segment.path.stat().st_size == content


def test_an_empty_journal_has_its_session_and_no_records(tmp_path):
    write_records(tmp_path / "j", 0)
    assert as_tuples(tmp_path / "j") == []
    assert read_journal(tmp_path / "j").session == SESSION


def test_empty_and_foreign_payload_types_come_back_as_bytes(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        for data in (b"", memoryview(b""), bytearray(b"ab"), memoryview(b"abcd").cast("H")):
            writer.append(1, 2, -5, data)
    assert [r.payload for r in read_journal(tmp_path / "j").records()] == [b"", b"", b"ab", b"abcd"]


def test_records_are_selected_by_source_and_host_time(tmp_path):
    write_records(tmp_path / "j", 100)
    everything = written(100)
    assert as_tuples(tmp_path / "j", source=2) == [r for r in everything if r[1] == 2]
    within = [r for r in everything if 31_000 <= r[3] < 60_000]
    assert as_tuples(tmp_path / "j", start_ns=31_000, stop_ns=60_000) == within
    for limit in range(0, 101_000, 1000):
        assert as_tuples(tmp_path / "j", start_ns=limit) == [r for r in everything if r[3] >= limit]
        assert as_tuples(tmp_path / "j", stop_ns=limit) == [r for r in everything if r[3] < limit]
    assert as_tuples(tmp_path / "j", source=0, start_ns=60_000) == [
        r for r in everything if r[1] == 0 and r[3] >= 60_000
    ]


def test_a_journal_can_be_read_while_it_is_written(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        for i in range(50):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        assert as_tuples(tmp_path / "j") == written(50)
        journal = read_journal(tmp_path / "j")
        writer.append(0, 0, 0, b"later")
        assert sum(1 for _ in journal.records()) == 50


def test_appends_of_several_threads_keep_each_sources_order(tmp_path):
    def append(source: int) -> None:
        for i in range(400):
            writer.append(source, 0, i, payload(i))

    with writer_in(tmp_path / "j", segment_bytes=1 << 15) as writer:
        threads = [threading.Thread(target=append, args=(source,)) for source in range(5)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        counters = writer.counters
    journal = read_journal(tmp_path / "j")
    assert [r.sequence for r in journal.records()] == list(range(2000))
    for source in range(5):
        assert [r.payload for r in journal.records(source=source)] == [payload(i) for i in range(400)]
    assert counters.records == 2000
    assert counters.bytes == sum(RECORD_OVERHEAD + len(r.payload) for r in journal.records())


def test_the_journal_is_forced_to_the_disk_at_least_four_times_a_second(tmp_path, monkeypatch):
    forced = []
    # The disk's own time is not what this is about
    monkeypatch.setattr(os, "fdatasync", forced.append)
    oldest = 0.0
    with writer_in(tmp_path / "j", segment_bytes=1 << 20) as writer:
        stop = time.monotonic() + 1.5
        while time.monotonic() < stop:
            writer.append(1, 1, 0, b"x" * 100)
            oldest = max(oldest, writer.counters.unsynced_s)
            time.sleep(0.002)
        assert writer.counters.largest_sync_s > 0
    assert len(forced) >= 6
    # Half a second of allowance for a machine that does other things too
    assert oldest < 0.75


def test_a_sync_leaves_nothing_unsynced(tmp_path):
    with writer_in(tmp_path / "j", sync_interval_s=0.25) as writer:
        writer.append(1, 1, 0, b"x")
        writer.sync()
        assert writer.counters.unsynced_s == 0.0


def test_segments_that_fill_up_while_the_journal_is_synced_do_no_harm(tmp_path):
    def append() -> None:
        for i in range(3000):
            writer.append(i % 3, i % 5, i * 1000, payload(i))

    with writer_in(tmp_path / "j", reserve_bytes=20 * SEGMENT) as writer:
        thread = threading.Thread(target=append)
        thread.start()
        while thread.is_alive():
            writer.sync()
            writer.release(0)
        thread.join()
    assert as_tuples(tmp_path / "j") == written(3000)


def test_old_segments_are_released_and_the_rest_stays_readable(tmp_path):
    with writer_in(tmp_path / "j", reserve_bytes=3 * SEGMENT) as writer:
        for i in range(200):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        writer.sync()
        before = set(paths_in(tmp_path / "j").values())
        assert writer.release(120_000) > 2
        left = [r for r in written(200) if r[3] >= 120_000]
        found = as_tuples(tmp_path / "j")
        assert found[-len(left) :] == left
        assert found[0][0] == read_journal(tmp_path / "j").released_records > 100
        assert len(before & set(paths_in(tmp_path / "j").values())) < len(before)
        assert writer.release(120_000) == 0
        writer.append(0, 0, 200_000, b"after")
    assert as_tuples(tmp_path / "j")[-1][4] == b"after"
    assert read_journal(tmp_path / "j").lost_records == 0


def test_releasing_everything_keeps_the_segment_being_written(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        for i in range(100):
            writer.append(0, 0, i, payload(i))
        writer.sync()
        writer.release(1 << 62)
        writer.append(0, 0, 100, b"last")
    found = as_tuples(tmp_path / "j")
    assert found[-1][4] == b"last"
    assert [r[0] for r in found] == [*range(found[0][0], 100), 101]  # 100 is the list of what was released


def test_space_stays_reserved_while_segments_are_used_and_released(tmp_path):
    with writer_in(tmp_path / "j", reserve_bytes=10 * SEGMENT) as writer:
        on_disk = sum(p.stat().st_size for p in paths_in(tmp_path / "j").values())
        assert on_disk == 10 * SEGMENT
        assert writer.counters.reserved_bytes > 9 * (SEGMENT - 300)
        for i in range(200):
            writer.append(0, 0, i, payload(i))
        writer.sync()
        writer.release(1 << 62)
        stop = time.monotonic() + 10
        while len(paths_in(tmp_path / "j")) < 10 and time.monotonic() < stop:
            time.sleep(0.01)
        assert len(paths_in(tmp_path / "j")) >= 10


@pytest.mark.parametrize(
    "missing", [["posix_fallocate"], ["writev"], ["fdatasync"], ["posix_fallocate", "writev", "fdatasync"]]
)
def test_a_system_without_a_call_does_the_same_by_others(tmp_path, monkeypatch, missing):
    for name in missing:
        monkeypatch.delattr(os, name, raising=False)
    with writer_in(tmp_path / "j", reserve_bytes=3 * SEGMENT) as writer:
        assert sum(p.stat().st_size for p in paths_in(tmp_path / "j").values()) == 3 * SEGMENT
        for i in range(200):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        writer.sync()
    assert as_tuples(tmp_path / "j") == written(200)


def test_a_file_system_that_cannot_reserve_gets_zeros(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "posix_fallocate", fail_with(errno.EOPNOTSUPP))
    with writer_in(tmp_path / "j", reserve_bytes=2 * SEGMENT) as writer:
        assert sum(p.stat().st_size for p in paths_in(tmp_path / "j").values()) == 2 * SEGMENT
        writer.append(0, 0, 0, b"x")
    assert [r[4] for r in as_tuples(tmp_path / "j")] == [b"x"]


# --- a disk that is full, or breaks


def test_a_disk_without_room_is_refused_when_arming_and_nothing_is_left(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _path: shutil._ntuple_diskusage(10**9, 10**9 - 5000, 5000))
    with pytest.raises(StoreError, match=r"not enough room for the log; expected 0\.0 MB, found 0\.0 MB free"):
        writer_in(tmp_path / "new" / "j", reserve_bytes=3 * SEGMENT)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_while_reserving_is_refused_and_nothing_is_left(tmp_path, monkeypatch):
    calls = []
    reserve = os.posix_fallocate

    def fill(descriptor: int, offset: int, size: int) -> None:
        calls.append(size)
        if len(calls) == 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        reserve(descriptor, offset, size)

    monkeypatch.setattr(os, "posix_fallocate", fill)
    (tmp_path / "kept").touch()
    with pytest.raises(StoreError, match="not enough room") as caught:
        writer_in(tmp_path / "j", reserve_bytes=5 * SEGMENT)
    assert "\n" not in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["kept"]


def test_a_disk_that_fills_later_is_an_error_at_once_and_everything_before_is_intact(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "j", reserve_bytes=3 * SEGMENT)
    monkeypatch.setattr(os, "posix_fallocate", fail_with(errno.ENOSPC))
    count, error = append_until_it_fails(writer)
    assert "No space left on device" in str(error)
    monkeypatch.undo()
    with pytest.raises(StoreError, match="No space left on device"):
        writer.append(0, 0, 0, b"after")
    writer.close()
    assert count > 20
    assert as_tuples(tmp_path / "j") == written(count)


def test_a_write_that_fails_in_the_middle_ends_the_journal_and_everything_before_is_intact(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "j", segment_bytes=1 << 16)
    for i in range(20):
        writer.append(i % 3, i % 5, i * 1000, payload(i))
    write = os.write
    monkeypatch.setattr(os, "writev", lambda descriptor, parts: write(descriptor, parts[0][:11]))
    monkeypatch.setattr(os, "write", fail_with(errno.EIO))
    with pytest.raises(StoreError, match="Input/output error"):
        writer.append(0x0101, 0x0101, 0x0101010101010101, b"torn")
    monkeypatch.undo()
    with pytest.raises(StoreError, match="Input/output error"):
        writer.append(0, 0, 0, b"after")
    writer.close()
    assert as_tuples(tmp_path / "j") == written(20)
    assert read_journal(tmp_path / "j").cut_bytes == 9  # the last two of eleven are zeros, as is what was reserved


def test_short_writes_are_continued(tmp_path, monkeypatch):
    writev, write = os.writev, os.write
    with writer_in(tmp_path / "j", reserve_bytes=20 * SEGMENT) as writer:
        monkeypatch.setattr(os, "writev", lambda d, parts: writev(d, [b"".join(parts)[:9]]))
        monkeypatch.setattr(os, "write", lambda d, data: write(d, data[:13]))
        for i in range(100):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
    assert as_tuples(tmp_path / "j") == written(100)


@pytest.mark.skipif(not hasattr(os, "fdatasync"), reason="this system has no fdatasync")
def test_a_failed_sync_is_told_at_the_next_append(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "j", segment_bytes=1 << 16)
    writer.append(0, 0, 0, b"first")
    monkeypatch.setattr(os, "fdatasync", fail_with(errno.EIO))
    _, error = append_until_it_fails(writer, pause_s=0.01)
    assert "Input/output error" in str(error)
    assert writer.counters.unsynced_s > 0
    monkeypatch.undo()
    writer.close()


def test_a_failure_at_the_end_is_told_by_close(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "j")
    writer.append(0, 0, 0, b"x")
    monkeypatch.setattr(os, "fsync", fail_with(errno.EIO))
    with pytest.raises(StoreError, match="Input/output error"):
        writer.close()
    monkeypatch.undo()
    writer.close()
    remove_journal(tmp_path / "j")


@pytest.fixture
def small_disk(tmp_path) -> Iterator[Path]:
    """Mount a file system of 4 MB."""
    mount, point = shutil.which("mount"), tmp_path / "disk"
    point.mkdir()
    command = [mount or "mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(point)]
    if mount is None or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("a file system cannot be mounted on this machine")
    yield point
    subprocess.run([shutil.which("umount") or "umount", str(point)], check=True)


def test_a_really_full_disk_is_refused_when_arming_and_told_later(small_disk):
    with pytest.raises(StoreError, match="not enough room"):
        writer_in(small_disk / "j", reserve_bytes=5 << 20, segment_bytes=1 << 18)
    assert list(small_disk.iterdir()) == []
    writer = writer_in(small_disk / "j", reserve_bytes=1 << 20, segment_bytes=1 << 18)
    count, error = append_until_it_fails(writer)
    assert "No space left on device" in str(error)
    writer.close()
    assert count * 180 > 3 << 20
    assert as_tuples(small_disk / "j") == written(count)


def test_reserved_space_is_there_when_another_program_fills_the_disk(small_disk):
    with writer_in(small_disk / "j", reserve_bytes=1 << 20, segment_bytes=1 << 18, sync_interval_s=0.25) as writer:
        (small_disk / "other").write_bytes(bytes(shutil.disk_usage(small_disk).free))
        assert shutil.disk_usage(small_disk).free == 0
        for i in range(4000):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
    assert as_tuples(small_disk / "j") == written(4000)


# --- a process that is interrupted, or killed


def test_records_after_an_interrupted_one_are_read(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "j", reserve_bytes=3 * SEGMENT)
    writer.append(0, 0, 0, b"before")
    writev = os.writev

    def interrupt(descriptor: int, parts: list[bytes]) -> int:
        writev(descriptor, [parts[0][:20]])
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "writev", interrupt)
    with pytest.raises(KeyboardInterrupt):
        writer.append(0, 0, 1, b"torn")
    monkeypatch.undo()
    writer.append(0, 0, 2, b"after")
    writer.close()
    assert [r[4] for r in as_tuples(tmp_path / "j")] == [b"before", b"after"]
    assert read_journal(tmp_path / "j").lost_records == 1


@needs_kill
def test_a_killed_writer_loses_nothing_that_it_was_told_is_written(tmp_path):
    for i, delay_s in enumerate(random_delays_s(8, seed=1)):
        acknowledged, found = kill_a_writer(tmp_path / str(i), delay_s)
        assert 2 <= acknowledged <= found <= acknowledged + 2


@needs_kill
def test_a_killed_writers_journal_is_left_over_and_a_living_ones_is_not(tmp_path):
    kill_a_writer(tmp_path / "dead", 0.0)
    with writer_in(tmp_path / "alive") as writer:
        writer.append(0, 0, 0, b"x")
        assert find_journals(tmp_path) == (tmp_path / "dead" / "journal",)
        assert find_journals(tmp_path / "dead" / "journal") == (tmp_path / "dead" / "journal",)
        with pytest.raises(StoreError, match="is being written"):
            remove_journal(tmp_path / "alive")
        with pytest.raises(StoreError, match="another recording writes here"):
            writer_in(tmp_path / "alive")
        writer.append(0, 0, 0, b"y")
    assert find_journals(tmp_path) == (tmp_path / "alive", tmp_path / "dead" / "journal")
    read_journal(tmp_path / "dead" / "journal").remove()
    assert find_journals(tmp_path) == (tmp_path / "alive",)
    assert not (tmp_path / "dead" / "journal").exists()


# --- a file that is damaged


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole") / "j"
    write_records(folder, 60)
    return folder


def end_of_each_record(folder: Path) -> dict[int, tuple[str, int]]:
    """Return the segment and the byte behind each record, by sequence number."""
    ends = {}
    for segment in read_journal(folder).segments:
        at = segment.header.size
        for sequence in range(segment.first_sequence, segment.last_sequence + 1):
            at += RECORD_OVERHEAD + len(payload(sequence))
            ends[sequence] = (segment.path.name, at)
    return ends


def end_of_last_record(folder: Path, name: str, last: int) -> int:
    """Where records of a segment end that is cut just there: nothing in it tells that more followed."""
    return max(
        (end for at, (segment, end) in end_of_each_record(folder).items() if segment == name and at <= last), default=0
    )


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damage_costs_what_it_touches_and_is_told_and_returns_nothing_wrong(whole, tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("damaged") / "j"
    shutil.copytree(whole, folder)
    name = data.draw(st.sampled_from([path.name for path in paths_in(whole).values()]))
    content = bytearray((whole / name).read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    until = len(content)
    if data.draw(st.booleans()):
        del content[at:]
        content += bytes(data.draw(st.sampled_from([0, 1, 5000])))
    else:
        noise = data.draw(st.binary(min_size=1, max_size=40))
        until = min(at + len(noise), until)
        for i, byte in enumerate(noise[: len(content) - at]):
            content[at + i] ^= byte
    (folder / name).write_bytes(content)
    found = as_tuples(folder)
    everything = dict(enumerate(written(60)))
    sequences = [r[0] for r in found]
    assert all(r == everything[r[0]] for r in found)
    assert sequences == sorted(set(sequences))
    untouched = bytes(content) == (whole / name).read_bytes()
    for sequence, (segment, end) in end_of_each_record(whole).items():
        begin = end - RECORD_OVERHEAD - len(payload(sequence))
        if segment != name or end <= at or begin >= until or untouched:
            assert sequence in sequences
    journal = read_journal(folder)
    assert journal.damaged or untouched or (len(found) == 60) or at >= end_of_last_record(whole, name, max(sequences))
    last_lost = 59 - max(sequences, default=-1)
    assert journal.lost_records + journal.released_records + last_lost == 60 - len(found)
    shutil.rmtree(folder)


@settings(max_examples=100, deadline=None)
@given(content=st.binary(max_size=300), header=st.booleans())
def test_any_bytes_at_all_give_records_or_a_store_error(whole, tmp_path_factory, content, header):
    folder = tmp_path_factory.mktemp("noise")
    start = (whole / "000001.journal").read_bytes()[:60] if header else b""
    (folder / "000001.journal").write_bytes(start + content)
    with pytest.raises(StoreError, match="undamaged header"):
        read_journal(folder)
    shutil.rmtree(folder)


def test_a_damaged_length_does_not_ask_for_gigabytes(whole, tmp_path):
    folder = tmp_path / "j"
    shutil.copytree(whole, folder)
    path, start = folder / "000001.journal", read_journal(whole).segments[0].header.size
    content = path.read_bytes()
    path.write_bytes(content[: start + 8] + b"\xff" * 4 + content[start + 12 :])
    tracemalloc.start()
    try:
        assert read_journal(folder).segments[0].first_sequence == 1
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()


def test_a_segment_that_is_there_twice_is_not_read_twice(whole, tmp_path):
    folder = tmp_path / "j"
    shutil.copytree(whole, folder)
    shutil.copy(folder / "000001.journal", folder / "000099.journal")
    assert as_tuples(folder) == written(60)
    assert read_journal(folder).cut_bytes > 0


def test_a_missing_segment_is_counted(whole, tmp_path):
    folder = tmp_path / "j"
    shutil.copytree(whole, folder)
    lost = read_journal(folder).segments[1].count
    (folder / "000002.journal").unlink()
    assert read_journal(folder).lost_records == lost > 0


def test_what_another_session_left_behind_the_end_is_no_record(tmp_path):
    write_records(tmp_path / "old", 5)
    with writer_in(tmp_path / "new") as writer:
        writer.append(0, 0, 0, payload(0))
    old = read_journal(tmp_path / "old").segments[0]
    skip = old.header.size + RECORD_OVERHEAD + len(payload(0))
    new_path = tmp_path / "new" / "000001.journal"
    new_path.write_bytes(new_path.read_bytes() + old.path.read_bytes()[skip:])
    assert read_journal(tmp_path / "new").count == 1
    assert read_journal(tmp_path / "new").cut_bytes == old.path.stat().st_size - skip


def test_segments_of_two_sessions_are_refused(tmp_path):
    write_records(tmp_path / "a", 60)
    write_records(tmp_path / "b", 60)
    shutil.copy(tmp_path / "b" / "000002.journal", tmp_path / "a" / "000002.journal")
    with pytest.raises(StoreError, match=r"another session than 000001\.journal"):
        read_journal(tmp_path / "a")


def test_a_journal_that_changes_while_it_is_read_is_told(whole, tmp_path):
    folder = tmp_path / "j"
    shutil.copytree(whole, folder)
    journal = read_journal(folder)
    path = folder / "000001.journal"
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(StoreError, match="changed while it was read"):
        list(journal.records())
    path.unlink()
    with pytest.raises(StoreError, match="cannot be read"):
        list(journal.records())


# --- what a caller may not do


def test_a_folder_with_a_journal_is_not_written_over(whole):
    before = as_tuples(whole)
    with pytest.raises(StoreError, match="holds a log already"):
        writer_in(whole)
    assert as_tuples(whole) == before


def test_folders_without_a_journal_are_told(tmp_path):
    with pytest.raises(StoreError, match="holds no journal"):
        read_journal(tmp_path)
    with pytest.raises(StoreError, match="cannot be read"):
        read_journal(tmp_path / "missing")
    assert find_journals(tmp_path / "missing") == ()


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="cannot be written"):
        writer_in(tmp_path / "file" / "j")


def test_removing_leaves_what_is_not_the_journals(tmp_path):
    write_records(tmp_path / "j", 5)
    (tmp_path / "j" / "notes.txt").touch()
    remove_journal(tmp_path / "j")
    assert [p.name for p in (tmp_path / "j").iterdir()] == ["notes.txt"]


def test_a_callers_mistakes_are_value_errors_and_write_nothing(tmp_path):
    for options in ({"sync_interval_s": 0.0}, {"sync_interval_s": 0.3}, {"reserve_bytes": -1}, {"segment_bytes": 100}):
        with pytest.raises(ValueError, match=next(iter(options))):
            writer_in(tmp_path / "j", **options)
    with pytest.raises(TypeError):
        JournalWriter(tmp_path / "j", {"rig": object()}, 0)
    with pytest.raises(ValueError, match="not JSON compliant"):
        JournalWriter(tmp_path / "j", {"rig": float("nan")}, 0)
    assert list(tmp_path.iterdir()) == []
    with writer_in(tmp_path / "j") as writer:
        for arguments in ((-1, 0, 0, b""), (0, 1 << 16, 0, b""), (0, 0, 1 << 63, b""), (0, 0, 0, bytes(SEGMENT))):
            with pytest.raises(ValueError, match="not"):
                writer.append(*arguments)
        with pytest.raises(ValueError, match="contiguous"):
            writer.append(0, 0, 0, memoryview(b"abcd")[::2])
        assert writer.append(0, 0, 0, b"x") == 0
    with pytest.raises(ValueError, match="closed"):
        writer.append(0, 0, 0, b"x")
    writer.sync()
    assert len(as_tuples(tmp_path / "j")) == 1


def test_the_bytes_are_as_documented(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        writer.append(0x0102, 0x0304, 2000, b"payload", empty_ns=-5999)
        writer.append(0, 0, 0, b"")
    content = (tmp_path / "j" / "000001.journal").read_bytes()
    assert content.startswith(b"recoil-daq journal 1\n")
    session_id, length = content[21:29], int.from_bytes(content[29:33], "little")
    assert json.loads(content[33 : 33 + length]) == SESSION
    assert int.from_bytes(content[33 + length : 37 + length], "little") == zlib.crc32(content[: 33 + length])
    record = content[37 + length :]
    assert record[:8] == session_id
    assert record[8:36].hex() == "070000000201040308000000d0070000000000000000000000000000"
    crc = zlib.crc32(record[:36], zlib.crc32(b"payload", zlib.crc32(session_id)))
    assert record[36:47] == crc.to_bytes(4, "little") + b"payload"
    assert record[47 + 16 : 47 + 20] == b"\xff\xff\xff\xff"  # of an unknown span
    first, second = read_journal(tmp_path / "j").records()
    assert (first.span_us, first.from_ns, second.span_us, second.from_ns) == (8, -6000, None, 0)


def test_a_record_is_selected_by_when_its_content_may_have_arrived(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        writer.append(0, 0, 9_000_000, b"read late", empty_ns=2_000_000)
        writer.append(0, 0, 9_000_000, b"unknown")
    assert [r[4] for r in as_tuples(tmp_path / "j", stop_ns=3_000_000)] == [b"read late"]
    assert as_tuples(tmp_path / "j", stop_ns=2_000_000) == []
    assert len(as_tuples(tmp_path / "j", start_ns=9_000_000)) == 2


def test_what_is_kept_is_not_released_and_what_was_released_is_not_lost(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        for i in range(200):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        writer.sync()
        released = writer.release(1 << 62, [(100_000, 100_500)])
        assert writer.counters.released == released > 100
        writer.append(0, 0, 200_000, b"after")
    kept = [r[0] for r in as_tuples(tmp_path / "j")]
    assert 100 in kept
    assert min(kept) > 50
    journal = read_journal(tmp_path / "j")
    assert (journal.released_records, journal.lost_records, journal.damaged) == (released, 0, False)
    assert journal.count + released == 202


def test_a_crash_between_the_list_of_what_is_released_and_its_removal_counts_nothing_twice(tmp_path, monkeypatch):
    with writer_in(tmp_path / "j") as writer:
        for i in range(200):
            writer.append(0, 0, i * 1000, payload(i))
        writer.sync()
        monkeypatch.setattr(SegmentSync, "remove", fail_with(errno.EACCES))
        with pytest.raises(PermissionError):
            writer.release(1 << 62)
    journal = read_journal(tmp_path / "j")
    assert (journal.released_records, journal.lost_records, journal.count) == (0, 0, 201)


def test_a_payload_full_of_marks_is_given_up_soon(tmp_path):
    with writer_in(tmp_path / "j", segment_bytes=1 << 21) as writer:
        mark = (tmp_path / "j" / "000001.journal").read_bytes()[21:29]
        writer.append(0, 0, 0, (mark + (1 << 20).to_bytes(4, "little")) * 80_000)
        writer.append(0, 0, 1, b"behind")
    path = tmp_path / "j" / "000001.journal"
    content = bytearray(path.read_bytes())
    content[read_journal(tmp_path / "j").segments[0].header.size + 50] ^= 1
    path.write_bytes(content)
    began = time.process_time()
    assert read_journal(tmp_path / "j").damaged
    assert time.process_time() - began < 10


def test_a_damaged_header_is_made_good_by_another_and_told(whole, tmp_path):
    folder = tmp_path / "j"
    shutil.copytree(whole, folder)
    content = bytearray((folder / "000002.journal").read_bytes())
    content[40] ^= 1
    (folder / "000002.journal").write_bytes(content)
    assert as_tuples(folder) == written(60)
    assert read_journal(folder).damaged_headers == 1
    assert read_journal(folder).damaged
    assert not read_journal(whole).damaged
