"""The log: nothing lost, nothing wrong, nothing twice, whatever happens to the process or the disk."""

from __future__ import annotations

import errno
import os
import shutil
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from recoil_acquisition.errors import StoreError
from recoil_acquisition.log import disk
from recoil_acquisition.log import writer as writer_module
from recoil_acquisition.log.disk import LogDisk, SegmentSync
from recoil_acquisition.log.folder import find_logs, open_log, remove_log
from recoil_acquisition.log.record import HEAD_SIZE, LONGEST_PAYLOAD, OWN, UNKNOWN, Kind, Record
from recoil_acquisition.log.segment import segment_paths
from recoil_acquisition.log.writer import LogWriter, merged
from tests.builders.killed_log import kill_a_writer, random_delays_s
from tests.builders.naive_log import read_file, read_folder

SESSION = {
    "sources": {"1": "can0", "2": "imu"},
    "rig": "name = 'stand'\n",
    "clock": {"wall_s": 1.5, "monotonic_s": 2.5},
}
SEGMENT = 6144

needs_kill = pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL and its promises are POSIX")


def writer_in(folder: Path, reserve_bytes: int = 0, **options) -> LogWriter:
    return LogWriter(folder, SESSION, reserve_bytes, segment_bytes=options.pop("segment_bytes", SEGMENT), **options)


def payload(i: int) -> bytes:
    return struct.pack("<I", i) + bytes([i % 255 + 1]) * (i * 37 % 300)


def write_records(folder: Path, count: int) -> None:
    with writer_in(folder) as writer:
        for i in range(count):
            writer.append(i % 3, i % 5, i * 1000, payload(i))


def as_tuples(folder: Path, **limits) -> list[tuple[int, int, int, int, bytes]]:
    """Return what devices delivered, each with the number that it begins with."""
    return [
        (int.from_bytes(r.payload[:4], "little"), r.source, r.kind, r.host_ns, r.payload)
        for r in open_log(folder).records(**limits)
        if r.source != OWN
    ]


def written(count: int) -> list[tuple[int, int, int, int, bytes]]:
    return [(i, i % 3, i % 5, i * 1000, payload(i)) for i in range(count)]


def append_until_it_fails(writer: LogWriter, pause_s: float = 0.0) -> tuple[int, StoreError]:
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
    log = open_log(tmp_path / "j")
    assert as_tuples(tmp_path / "j") == written(200)
    assert log.session == SESSION
    assert len(log.segments) > 5
    survey = log.survey()
    assert (survey.damaged, survey.lost_records, survey.released_records, survey.closed) == (False, 0, 0, True)


def test_a_closed_log_takes_no_more_space_than_its_records(tmp_path):
    write_records(tmp_path / "j", 200)
    names = sorted(path.name for path in (tmp_path / "j").iterdir())
    assert names == [f"{n:06d}.rdlog" for n in range(1, len(names) + 1)]
    for name in names:
        records = read_file(tmp_path / "j" / name)
        assert (tmp_path / "j" / name).stat().st_size == sum(len(one.content) for one in records)


def test_empty_and_foreign_payload_types_come_back_as_bytes(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        for data in (b"", memoryview(b""), bytearray(b"ab"), memoryview(b"abcd").cast("H")):
            writer.append(1, 2, -5, data)
    assert [r.payload for r in open_log(tmp_path / "j").records(1)] == [b"", b"", b"ab", b"abcd"]


@pytest.mark.exhaustive
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


def test_a_log_can_be_read_while_it_is_written(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        for i in range(50):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        assert as_tuples(tmp_path / "j") == written(50)
        log = open_log(tmp_path / "j")
        assert not log.survey().damaged


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
    log = open_log(tmp_path / "j")
    everything = list(log.records())
    assert [r.number for r in everything] == list(range(len(everything)))
    for source in range(5):
        assert [r.payload for r in log.records(source=source)] == [payload(i) for i in range(400)]
        assert [r.source_number for r in log.records(source=source)] == list(range(400))
    before = everything[: [r.kind for r in everything].index(Kind.CLOSED)]
    assert counters.records == len(before)
    assert counters.bytes == sum(HEAD_SIZE + len(r.payload) for r in before)


@pytest.mark.real_time
def test_the_log_is_forced_to_the_disk_at_least_four_times_a_second(tmp_path, monkeypatch):
    forced = []
    # The disk's own time is not what this is about
    monkeypatch.setattr(os, "fdatasync", forced.append)
    oldest = 0.0
    with writer_in(tmp_path / "j", segment_bytes=1 << 20) as writer:
        stop = time.monotonic() + 0.9
        while time.monotonic() < stop:
            writer.append(1, 1, 0, b"x" * 100)
            oldest = max(oldest, writer.counters.unsynced_s)
            time.sleep(0.002)
    assert len(forced) >= 3
    # Half a second of allowance for a machine that does other things too
    assert oldest < 0.75


@pytest.mark.parametrize("kind", [Kind.DECISION, Kind.SHOT, Kind.EVENT])
def test_a_decision_a_shot_and_an_event_are_forced_to_the_disk_at_once(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(writer_module, "_LONGEST_SYNC_INTERVAL_S", 3600.0)
    with writer_in(tmp_path / "j", sync_interval_s=3600.0) as writer:
        writer.append(1, Kind.SERIAL, 0, b"x")
        writer.append(1, kind, 0, b"{}")
        ends_s = time.monotonic() + 30.0
        while writer.counters.unsynced_s and time.monotonic() < ends_s:
            time.sleep(0.002)
        assert writer.counters.unsynced_s == 0.0


def test_what_comes_behind_a_record_that_is_forced_to_the_disk_at_once_waits_as_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(writer_module, "_LONGEST_SYNC_INTERVAL_S", 3600.0)
    with writer_in(tmp_path / "j", sync_interval_s=3600.0) as writer:
        writer.append(1, Kind.EVENT, 0, b"{}")
        ends_s = time.monotonic() + 30.0
        while writer.counters.unsynced_s and time.monotonic() < ends_s:
            time.sleep(0.002)
        writer.append(1, Kind.SERIAL, 0, b"x")
        time.sleep(0.05)
        assert writer.counters.unsynced_s >= 0.05


def test_what_a_log_says_of_itself_is_forced_to_the_disk_before_it_takes_a_record(tmp_path, monkeypatch):
    forced = []
    monkeypatch.setattr(writer_module, "_LONGEST_SYNC_INTERVAL_S", 3600.0)
    monkeypatch.setattr(os, "fdatasync", forced.append)
    with writer_in(tmp_path / "j", sync_interval_s=3600.0):
        assert len(forced) == 1


def test_a_sync_leaves_nothing_unsynced(tmp_path):
    with writer_in(tmp_path / "j", sync_interval_s=0.25) as writer:
        writer.append(1, 1, 0, b"x")
        writer.sync()
        assert writer.counters.unsynced_s == 0.0


def test_old_segments_are_released_and_the_rest_stays_readable(tmp_path):
    with writer_in(tmp_path / "j", reserve_bytes=3 * SEGMENT) as writer:
        for i in range(200):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        writer.sync()
        before = set(segment_paths(tmp_path / "j").values())
        assert writer.release(120_000) > 2
        left = [r for r in written(200) if r[3] >= 120_000]
        found = as_tuples(tmp_path / "j")
        assert found[-len(left) :] == left
        assert 100 < found[0][0] < open_log(tmp_path / "j").survey().released_records
        assert len(before & set(segment_paths(tmp_path / "j").values())) < len(before)
        assert writer.release(120_000) == 0
        writer.append(0, 0, 200_000, b"after")
    assert as_tuples(tmp_path / "j")[-1][4] == b"after"
    survey = open_log(tmp_path / "j").survey()
    assert (survey.lost_records, survey.losses, survey.damaged) == (0, (), False)
    assert open_log(tmp_path / "j").session == SESSION


def test_releasing_everything_keeps_the_segment_being_written(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        for i in range(100):
            writer.append(0, 0, i, payload(i))
        writer.sync()
        writer.release(1 << 62)
        writer.append(0, 0, 100, b"last")
    found = as_tuples(tmp_path / "j")
    assert found[-1][4] == b"last"
    assert [r[0] for r in found[:-1]] == list(range(found[0][0], 100))
    assert found[0][0] > 50


def test_space_stays_reserved_while_segments_are_used_and_released(tmp_path):
    with writer_in(tmp_path / "j", reserve_bytes=10 * SEGMENT) as writer:
        on_disk = sum(p.stat().st_size for p in segment_paths(tmp_path / "j").values())
        assert on_disk == 10 * SEGMENT
        assert writer.counters.reserved_bytes > 9 * (SEGMENT - 300)
        for i in range(200):
            writer.append(0, 0, i, payload(i))
        writer.sync()
        writer.release(1 << 62)
        stop = time.monotonic() + 10
        while len(segment_paths(tmp_path / "j")) < 10 and time.monotonic() < stop:
            time.sleep(0.01)
        assert len(segment_paths(tmp_path / "j")) >= 10


@pytest.mark.parametrize(
    "missing", [["posix_fallocate"], ["writev"], ["fdatasync"], ["posix_fallocate", "writev", "fdatasync"]]
)
def test_a_system_without_a_call_does_the_same_by_others(tmp_path, monkeypatch, missing):
    for name in missing:
        monkeypatch.delattr(os, name, raising=False)
    with writer_in(tmp_path / "j", reserve_bytes=3 * SEGMENT) as writer:
        assert sum(p.stat().st_size for p in segment_paths(tmp_path / "j").values()) == 3 * SEGMENT
        for i in range(200):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        writer.sync()
    assert as_tuples(tmp_path / "j") == written(200)


def test_a_file_system_that_cannot_reserve_gets_zeros(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "posix_fallocate", fail_with(errno.EOPNOTSUPP))
    with writer_in(tmp_path / "j", reserve_bytes=2 * SEGMENT) as writer:
        assert sum(p.stat().st_size for p in segment_paths(tmp_path / "j").values()) == 2 * SEGMENT
        writer.append(0, 0, 0, b"x")
    assert [r[4] for r in as_tuples(tmp_path / "j")] == [b"x"]


# --- a disk that is full, or breaks


def test_a_disk_without_room_is_refused_when_arming_and_nothing_is_left(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _path: shutil._ntuple_diskusage(10**9, 10**9 - 5000, 5000))
    with pytest.raises(StoreError, match=r"not enough room for the log; expected 0\.0 MB, found 0\.0 MB free"):
        writer_in(tmp_path / "new" / "j", reserve_bytes=3 * SEGMENT)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("spare", [None, "spare"])
@pytest.mark.parametrize("call", ["_write_all", "sync_data"])
def test_a_disk_that_does_not_take_the_first_records_is_refused_and_nothing_is_left(call, spare, tmp_path, monkeypatch):
    monkeypatch.setattr(f"recoil_acquisition.log.segment.{call}", fail_with(errno.EIO))
    with pytest.raises(StoreError, match="Input/output error"):
        writer_in(tmp_path / "made" / "j", reserve_bytes=3 * SEGMENT, spare=spare and tmp_path / spare)
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


def test_a_write_that_fails_in_the_middle_ends_the_log_and_everything_before_is_intact(tmp_path, monkeypatch):
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
    # it may end in zeros, as does what was reserved
    assert 4 <= open_log(tmp_path / "j").survey().unfinished_bytes <= 11


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


def test_a_folder_that_is_not_synchronised_at_the_end_is_told_by_close(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "log")
    writer.append(1, 0, 5, b"abc")
    monkeypatch.setattr("recoil_acquisition.log.disk.sync_folder", fail_with(errno.EIO))
    with pytest.raises(StoreError, match=os.strerror(errno.EIO)):
        writer.close()


def test_a_failure_at_the_end_is_told_by_close(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "j")
    writer.append(0, 0, 0, b"x")
    monkeypatch.setattr(os, "fsync", fail_with(errno.EIO))
    with pytest.raises(StoreError, match="Input/output error"):
        writer.close()
    monkeypatch.undo()
    writer.close()
    remove_log(tmp_path / "j")


@pytest.fixture
def small_disk(tmp_path) -> Iterator[Path]:
    """Mount a file system of 2 MB."""
    mount, point = shutil.which("mount"), tmp_path / "disk"
    point.mkdir()
    command = [mount or "mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(point)]
    if mount is None or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("a file system cannot be mounted on this machine")
    yield point
    subprocess.run([shutil.which("umount") or "umount", str(point)], check=True)


@pytest.mark.exhaustive
def test_a_really_full_disk_is_refused_when_arming_and_told_later(small_disk):
    with pytest.raises(StoreError, match="not enough room"):
        writer_in(small_disk / "j", reserve_bytes=5 << 20, segment_bytes=1 << 18)
    assert list(small_disk.iterdir()) == []
    writer = writer_in(small_disk / "j", reserve_bytes=1 << 19, segment_bytes=1 << 17)
    count, error = append_until_it_fails(writer)
    assert "No space left on device" in str(error)
    writer.close()
    assert count * 180 > 3 << 19
    assert as_tuples(small_disk / "j") == written(count)


def test_reserved_space_is_there_when_another_program_fills_the_disk(small_disk):
    with writer_in(small_disk / "j", reserve_bytes=1 << 20, segment_bytes=1 << 18, sync_interval_s=0.25) as writer:
        (small_disk / "other").write_bytes(bytes(shutil.disk_usage(small_disk).free))
        assert shutil.disk_usage(small_disk).free == 0
        for i in range(4000):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
    assert as_tuples(small_disk / "j") == written(4000)


# --- a process that is interrupted, or killed


@pytest.mark.exhaustive
@needs_kill
def test_a_killed_writer_loses_nothing_that_it_was_told_is_written(tmp_path):
    for i, delay_s in enumerate(random_delays_s(4, seed=1)):
        acknowledged, found = kill_a_writer(tmp_path / str(i), delay_s)
        assert 2 <= acknowledged <= found <= acknowledged + 2


@pytest.mark.exhaustive
@needs_kill
def test_a_killed_writers_log_is_left_over_and_a_living_ones_is_not(tmp_path):
    kill_a_writer(tmp_path / "dead", 0.0)
    with writer_in(tmp_path / "alive") as writer:
        writer.append(0, 0, 0, b"x")
        assert find_logs(tmp_path) == (tmp_path / "dead" / "log",)
        assert find_logs(tmp_path / "dead" / "log") == (tmp_path / "dead" / "log",)
        with pytest.raises(StoreError, match="is being written"):
            remove_log(tmp_path / "alive")
        with pytest.raises(StoreError, match="another recording writes here"):
            writer_in(tmp_path / "alive")
        writer.append(0, 0, 0, b"y")
    assert find_logs(tmp_path) == (tmp_path / "alive", tmp_path / "dead" / "log")
    open_log(tmp_path / "dead" / "log").remove()
    assert find_logs(tmp_path) == (tmp_path / "alive",)
    assert not (tmp_path / "dead" / "log").exists()


# --- what a caller may not do


def test_a_folder_with_a_log_is_not_written_over(tmp_path):
    write_records(tmp_path, 20)
    with pytest.raises(StoreError, match="holds a log already"):
        writer_in(tmp_path)
    assert as_tuples(tmp_path) == written(20)


def test_folders_without_a_log_are_told(tmp_path):
    with pytest.raises(StoreError, match="holds no log"):
        open_log(tmp_path)
    with pytest.raises(StoreError, match="cannot be read"):
        open_log(tmp_path / "missing")
    assert find_logs(tmp_path / "missing") == ()


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="cannot be written"):
        writer_in(tmp_path / "file" / "j")


def test_removing_leaves_what_is_not_the_logs(tmp_path):
    write_records(tmp_path / "j", 5)
    (tmp_path / "j" / "notes.txt").touch()
    remove_log(tmp_path / "j")
    assert [p.name for p in (tmp_path / "j").iterdir()] == ["notes.txt"]


def test_a_callers_mistakes_are_value_errors_and_write_nothing(tmp_path):
    for options in ({"sync_interval_s": 0.0}, {"sync_interval_s": 0.3}, {"reserve_bytes": -1}, {"segment_bytes": 100}):
        with pytest.raises(ValueError, match=next(iter(options))):
            writer_in(tmp_path / "j", **options)
    with pytest.raises(TypeError):
        LogWriter(tmp_path / "j", {"rig": object()}, 0)
    with pytest.raises(ValueError, match="not JSON compliant"):
        LogWriter(tmp_path / "j", {"rig": float("nan")}, 0)
    assert list(tmp_path.iterdir()) == []
    with writer_in(tmp_path / "j") as writer:
        for arguments in ((-1, 0, 0, b""), (0, 1 << 16, 0, b""), (0, 0, 1 << 63, b""), (0, 0, 0, bytes(SEGMENT))):
            with pytest.raises(ValueError, match="not"):
                writer.append(*arguments)
        with pytest.raises(ValueError, match="contiguous"):
            writer.append(0, 0, 0, memoryview(b"abcd")[::2])
        before = writer.counters.records
        assert writer.append(0, 0, 0, b"x") == before
    with pytest.raises(ValueError, match="closed"):
        writer.append(0, 0, 0, b"x")
    writer.sync()
    assert len(as_tuples(tmp_path / "j")) == 1
    assert [one.source for one in read_folder(tmp_path / "j") if one.source != OWN] == [0]


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
    survey = open_log(tmp_path / "j").survey()
    assert (survey.released_records, survey.lost_records, survey.losses, survey.damaged) == (released, 0, (), False)
    assert survey.records + released == max(r.number for r in open_log(tmp_path / "j").records()) + 1


def test_what_may_have_arrived_in_a_span_that_is_kept_is_not_released(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        writer.append(0, 0, 100_000, b"read late", empty_ns=40_000)
        for i in range(100):
            writer.append(0, 0, 101_000 + i, payload(i))
        writer.sync()
        writer.release(1 << 62, [(50_000, 60_000)])
    assert as_tuples(tmp_path / "j")[0][4] == b"read late"


def test_a_crash_between_the_list_of_what_is_released_and_its_removal_counts_nothing_twice(tmp_path, monkeypatch):
    with writer_in(tmp_path / "j") as writer:
        for i in range(200):
            writer.append(0, 0, i * 1000, payload(i))
        writer.sync()
        monkeypatch.setattr(SegmentSync, "remove", fail_with(errno.EACCES))
        with pytest.raises(PermissionError):
            writer.release(1 << 62)
    survey = open_log(tmp_path / "j").survey()
    assert (survey.released_records, survey.lost_records, survey.losses) == (0, 0, ())
    assert len(as_tuples(tmp_path / "j")) == 200


# --- a disk that fails, and a spare folder


def numbers_of(folder: Path) -> list[int]:
    return [r[0] for r in as_tuples(folder)]


@pytest.mark.real_time
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="tells files apart by /proc")
@pytest.mark.parametrize("call", ["writev", "fdatasync"])
def test_where_the_disk_fails_the_log_goes_on_in_the_spare_folder_and_nothing_is_lost_or_doubled(
    tmp_path, monkeypatch, call
):
    whole = getattr(os, call)
    failing = threading.Event()

    def fail(descriptor: int, *arguments: object) -> int:
        if failing.is_set() and "spare" not in str(Path(f"/proc/self/fd/{descriptor}").readlink()):
            if call == "writev":
                os.write(descriptor, arguments[0][0][:30])
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return whole(descriptor, *arguments)

    monkeypatch.setattr(os, call, fail)
    with writer_in(tmp_path / "j", spare=tmp_path / "spare", segment_bytes=1 << 15) as writer:
        for i in range(600):
            if i == 250:
                failing.set()
            writer.append(i % 3, i % 5, i * 1000, payload(i))
            time.sleep(0.001)
        writer.sync()
        assert "Input/output error" in writer.counters.spare
    assert as_tuples(tmp_path / "j") == written(600)
    survey = open_log(tmp_path / "j").survey()
    assert (survey.lost_records, survey.losses, survey.closed) == (0, (), True)
    open_log(tmp_path / "j").remove()
    assert list(tmp_path.iterdir()) == []


def test_what_a_failed_sync_left_in_doubt_is_read_from_the_spare_folder(tmp_path, monkeypatch):
    with writer_in(tmp_path / "j", spare=tmp_path / "spare", segment_bytes=1 << 16) as writer:
        for i in range(50):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        writer.sync()
        kept = (tmp_path / "j" / "000001.rdlog").read_bytes()
        for i in range(50, 100):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        monkeypatch.setattr(os, "fdatasync", fail_once(errno.EIO))
        writer.sync()
        for i in range(100, 150):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
    # the disk has none of what it was not synchronised with
    (tmp_path / "j" / "000001.rdlog").write_bytes(kept)
    assert as_tuples(tmp_path / "j") == written(150)


def fail_once(code: int):
    whole, calls = os.fdatasync, []

    def fail(descriptor: int) -> None:
        calls.append(descriptor)
        if len(calls) == 1:
            raise OSError(code, os.strerror(code))
        whole(descriptor)

    return fail


def test_a_spare_folder_that_was_not_needed_leaves_nothing(tmp_path):
    with writer_in(tmp_path / "j", spare=tmp_path / "spare" / "j") as writer:
        writer.append(0, 0, 0, b"x")
        assert segment_paths(tmp_path / "spare" / "j")
    assert [path.name for path in tmp_path.iterdir()] == ["j"]


def test_a_spare_folder_that_fails_too_is_told_at_the_next_append(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "j", spare=tmp_path / "spare", segment_bytes=1 << 16)
    writer.append(0, 0, 0, b"first")
    monkeypatch.setattr(os, "writev", fail_with(errno.EIO))
    with pytest.raises(StoreError, match="Input/output error"):
        writer.append(0, 0, 1, b"second")
    monkeypatch.undo()
    with pytest.raises(StoreError, match="Input/output error"):
        writer.append(0, 0, 2, b"third")
    writer.close()
    assert [r[4] for r in as_tuples(tmp_path / "j")] == [b"first"]


def test_a_spare_folder_that_cannot_be_had_is_refused_and_nothing_is_left(tmp_path):
    write_records(tmp_path / "spare", 3)
    with pytest.raises(StoreError, match="holds a log already"):
        writer_in(tmp_path / "new" / "j", spare=tmp_path / "spare")
    assert [path.name for path in tmp_path.iterdir()] == ["spare"]


def test_a_session_longer_than_a_record_stands_in_parts(tmp_path):
    session = {"rig": '"\n\u00e9' * 500_000}
    with LogWriter(tmp_path / "j", session, 0, segment_bytes=32 << 20) as writer:
        writer.append(0, 0, 0, b"x")
    assert open_log(tmp_path / "j").session == session
    assert sum(one.kind == Kind.SESSION for one in read_folder(tmp_path / "j")) > 4


@pytest.mark.real_time
def test_clocks_stand_at_the_beginning_and_every_ten_seconds(tmp_path, monkeypatch):
    monkeypatch.setattr("recoil_acquisition.log.writer.CLOCK_EVERY_S", 0.1)
    with writer_in(tmp_path / "j", segment_bytes=1 << 16):
        time.sleep(0.5)
    clocks = [r for r in open_log(tmp_path / "j").records(OWN) if r.kind == Kind.CLOCK]
    assert len(clocks) >= 4
    # behind the two of the session
    assert all(later.host_ns - earlier.host_ns >= 100_000_000 for earlier, later in pairwise(clocks[1:]))
    for clock in clocks:
        said = clock.said
        assert said["monotonic_ns"] == clock.host_ns
        assert abs(said["wall_ns"] - time.time_ns() - said["monotonic_ns"] + time.monotonic_ns()) < 50_000_000


# --- what a record may hold, and what is said of it


def test_the_smallest_segment_takes_a_payload_of_one_byte_and_no_longer_one(tmp_path):
    def refused(size: int) -> bool:
        try:
            writer_in(tmp_path / "j", segment_bytes=size).close()
        except ValueError:
            return True
        return False

    smallest = next(size for size in range(64, SEGMENT) if not refused(size))
    remove_log(tmp_path / "j")
    with writer_in(tmp_path / "j", segment_bytes=smallest) as writer:
        for i in range(20):
            writer.append(0, 0, i, b"x")
        with pytest.raises(ValueError, match="must not exceed 1 bytes, not 2"):
            writer.append(0, 0, 20, b"xx")
    assert [r.payload for r in open_log(tmp_path / "j").records(0)] == [b"x"] * 20


def test_the_longest_payload_is_taken_and_none_that_is_longer(tmp_path):
    with writer_in(tmp_path / "j", segment_bytes=4 << 20) as writer:
        writer.append(0, 0, 0, bytes(LONGEST_PAYLOAD))
        with pytest.raises(ValueError, match="must not exceed"):
            writer.append(0, 0, 1, bytes(LONGEST_PAYLOAD + 1))
    assert [len(r.payload) for r in open_log(tmp_path / "j").records(0)] == [LONGEST_PAYLOAD]


@pytest.mark.parametrize(
    ("since_ns", "span_us"),
    [
        (0, 0), (1, 1), (1000, 1), (1001, 2),
        # found empty when the read had returned: nothing can have waited
        (-1, 0), (-5000, 0),
        (1000 * (UNKNOWN - 1), UNKNOWN - 1), (1000 * UNKNOWN, None), (10**17, None),
    ],
)  # fmt: skip
def test_a_span_is_rounded_up_to_microseconds_and_unknown_if_it_is_too_long(tmp_path, since_ns, span_us):
    with writer_in(tmp_path / "j") as writer:
        writer.append(0, 0, 10**15, b"x", empty_ns=10**15 - since_ns)
    (record,) = open_log(tmp_path / "j").records(0)
    assert record.span_us == span_us


def test_a_wait_is_rounded_up_to_microseconds_and_unknown_if_it_is_too_long(tmp_path, monkeypatch):
    now_ns = time.monotonic_ns() + 10**9
    waits = ((0, 0), (1, 1), (1000, 1), (1001, 2), (1000 * (UNKNOWN - 1), UNKNOWN - 1), (1000 * UNKNOWN, None))
    with writer_in(tmp_path / "j") as writer:
        monkeypatch.setattr(time, "monotonic_ns", lambda: now_ns)
        for since_ns, _ in waits:
            writer.append(0, 0, now_ns - since_ns, b"x")
        # dated behind the present: what follows was appended no earlier than it
        writer.append(0, 0, now_ns + 1500, b"x")
        writer.append(0, 0, now_ns, b"x")
        monkeypatch.undo()
    found = [record.wait_us for record in open_log(tmp_path / "j").records(0)]
    assert found == [wait_us for _, wait_us in waits] + [0, 2]


def test_every_session_and_the_end_say_the_longest_wait_and_span_of_all_before(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        for i in range(100):
            read_ns = time.monotonic_ns() - 10_000 * (i % 7)
            writer.append(0, 0, read_ns, payload(i), empty_ns=None if i % 3 else read_ns - 10**9 * i)
    longest_us, stated = 0, []
    for record in open_log(tmp_path / "j").records():
        if record.kind in (Kind.SESSION, Kind.CLOSED):
            assert record.said["longest_us"] == longest_us
            stated.append(longest_us)
        assert record.wait_us is not None
        longest_us = max(longest_us, record.wait_us + (record.span_us or 0))
    assert len(stated) > 5
    assert stated[0] == 0
    assert stated[-1] >= 99 * 10**6


def test_behind_a_wait_that_is_unknown_the_longest_is_unknown(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        writer.append(0, 0, time.monotonic_ns() - 10**14, b"x")
        writer.append(0, 0, time.monotonic_ns(), b"x")
    log = open_log(tmp_path / "j")
    said = [record.said["longest_us"] for record in log.records(OWN) if record.kind == Kind.CLOSED]
    assert said == [None, None]
    assert len(list(log.records(0, stop_ns=0))) == 1


def test_a_record_says_its_number_and_what_bytes_of_its_source_came_before(tmp_path):
    write_records(tmp_path / "j", 100)
    records = read_folder(tmp_path / "j")
    assert [one.number for one in records] == list(range(len(records)))
    for source in (0, 1, 2, OWN):
        own = [one for one in records if one.source == source]
        assert [one.source_number for one in own] == list(range(len(own)))
        assert [one.position for one in own] == [sum(len(one.payload) for one in own[:i]) for i in range(len(own))]
    data = [[one for one in records if one.source == source] for source in (0, 1, 2)]
    totals = {str(i): [len(own), sum(len(one.payload) for one in own)] for i, own in enumerate(data)}
    closed = [record.said["sources"] for record in open_log(tmp_path / "j").records(OWN) if record.kind == Kind.CLOSED]
    assert closed == [totals, totals]


def test_the_last_segment_with_data_is_missed_if_it_is_missing(tmp_path):
    write_records(tmp_path / "j", 200)
    data = [one for one in read_folder(tmp_path / "j") if one.source != OWN]
    last = data[-1].file
    (tmp_path / "j" / last).unlink()
    survey = open_log(tmp_path / "j").survey()
    lost = sum(loss.records for loss in survey.losses if loss.source != OWN)
    assert lost == sum(one.file == last for one in data) > 0
    assert (survey.damaged, survey.closed) == (True, True)


def test_a_log_whose_writer_was_left_by_an_error_did_not_end_in_order(tmp_path):
    def fail() -> None:
        with writer_in(tmp_path / "j") as writer:
            writer.append(0, 0, 0, b"x")
            raise RuntimeError("something else")

    with pytest.raises(RuntimeError, match="something else"):
        fail()
    survey = open_log(tmp_path / "j").survey()
    assert (survey.closed, survey.damaged) == (False, False)
    assert [r[4] for r in as_tuples(tmp_path / "j")] == [b"x"]


def test_a_program_that_forgets_to_close_its_log_can_end(tmp_path):
    before = set(threading.enumerate())
    with writer_in(tmp_path / "j"):
        began = set(threading.enumerate()) - before
        assert began
        assert all(thread.daemon for thread in began)


def test_a_log_that_is_closed_has_no_thread_left(tmp_path, monkeypatch):
    monkeypatch.setattr(LogDisk, "top_up", lambda _: time.sleep(0.2))
    before = set(threading.enumerate())
    with writer_in(tmp_path / "j", sync_interval_s=0.001):
        time.sleep(0.02)
    assert set(threading.enumerate()) <= before


# --- space, and what is forced to the disk


def test_records_take_of_the_reserved_space_what_they_have_of_bytes(tmp_path):
    with writer_in(tmp_path / "j", reserve_bytes=4 * SEGMENT, sync_interval_s=0.005) as writer:
        for i in range(20):
            writer.append(0, 0, i, b"x" * i)
        time.sleep(0.1)  # time enough to reserve more than was asked for
        counters = writer.counters
        assert counters.bytes + counters.reserved_bytes == 4 * SEGMENT
        assert len(segment_paths(tmp_path / "j")) == 4


def test_space_is_reserved_again_as_soon_as_it_was_used_or_released(tmp_path, monkeypatch):
    monkeypatch.setattr(writer_module, "_LONGEST_SYNC_INTERVAL_S", 3600.0)

    def reserved(count: int) -> bool:
        ends_s = time.monotonic() + 30.0
        while writer.counters.reserved_bytes < count * SEGMENT and time.monotonic() < ends_s:
            time.sleep(0.002)
        return writer.counters.reserved_bytes >= count * SEGMENT

    with writer_in(tmp_path / "j", reserve_bytes=3 * SEGMENT, sync_interval_s=3600.0) as writer:
        for i in range(100):
            writer.append(0, 0, i, payload(i))
        assert reserved(1)
        assert writer.counters.reserved_bytes < 2 * SEGMENT
        writer.sync()
        writer.release(1 << 62)
        assert reserved(2)


def test_what_is_on_the_disk_is_not_forced_there_again(tmp_path, monkeypatch):
    with writer_in(tmp_path / "j") as writer:
        writer.append(0, 0, 0, b"x")
        writer.sync()
        forced = []
        monkeypatch.setattr(os, "fdatasync", forced.append)
        writer.sync()
        assert forced == []


def test_the_age_of_what_is_not_on_the_disk_is_that_of_the_oldest_until_it_is_there(tmp_path, monkeypatch):
    asked, answered = threading.Event(), threading.Event()

    def wait(_descriptor: int) -> None:
        asked.set()
        answered.wait(30.0)

    with writer_in(tmp_path / "j") as writer:
        writer.sync()
        monkeypatch.setattr(os, "fdatasync", wait)
        writer.append(0, Kind.EVENT, 0, b"{}")
        assert asked.wait(30.0)
        time.sleep(0.05)
        writer.append(0, 0, 1, b"while the first is forced to the disk")
        assert writer.counters.unsynced_s >= 0.05
        answered.set()


def test_the_age_of_what_is_not_on_the_disk_does_not_begin_anew_with_every_record(tmp_path, monkeypatch):
    monkeypatch.setattr(writer_module, "_LONGEST_SYNC_INTERVAL_S", 3600.0)
    with writer_in(tmp_path / "j", sync_interval_s=3600.0) as writer:
        writer.sync()
        writer.append(0, 0, 0, b"first")
        time.sleep(0.05)
        writer.append(0, 0, 1, b"second")
        assert writer.counters.unsynced_s >= 0.05


def test_after_a_sync_that_failed_no_later_one_succeeds(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "j")
    with monkeypatch.context() as failing:
        failing.setattr(os, "fdatasync", fail_with(errno.EIO))
        writer.append(0, 0, 0, b"x")
        with pytest.raises(StoreError, match="Input/output error"):
            writer.sync()
    # the system has forgotten what it could not write, and would say that all is well
    for _ in range(2):
        with pytest.raises(StoreError, match="Input/output error"):
            writer.sync()
    assert writer.counters.unsynced_s > 0
    writer.close()


def test_what_was_written_before_a_write_failed_is_still_forced_to_the_disk(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "j")
    with monkeypatch.context() as failing:
        writer.append(0, 0, 0, b"x")
        failing.setattr(os, "writev", fail_with(errno.EIO))
        with pytest.raises(StoreError, match="Input/output error"):
            writer.append(0, 0, 1, b"y")
    writer.sync()
    assert writer.counters.unsynced_s == 0.0
    writer.close()


def test_a_failure_that_nobody_was_told_is_told_by_close(tmp_path, monkeypatch):
    failed = threading.Event()

    def fail(_descriptor: int) -> None:
        failed.set()
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    writer = writer_in(tmp_path / "j")
    writer.sync()
    monkeypatch.setattr(os, "fdatasync", fail)
    writer.append(0, Kind.EVENT, 0, b"{}")
    assert failed.wait(30.0)
    monkeypatch.undo()
    with pytest.raises(StoreError, match="Input/output error"):
        writer.close()
    writer.close()


@pytest.mark.real_time
def test_a_log_that_cannot_be_written_takes_nothing_more_of_itself_either(tmp_path, monkeypatch):
    writer = writer_in(tmp_path / "j")
    writer.append(0, 0, 0, b"x")
    monkeypatch.setattr(os, "writev", fail_with(errno.EIO))
    with pytest.raises(StoreError, match="Input/output error"):
        writer.append(0, 0, 1, b"y")
    monkeypatch.undo()
    records = writer.counters.records
    monkeypatch.setattr(writer_module, "CLOCK_EVERY_S", 0.0)
    time.sleep(0.5)
    assert writer.counters.records == records
    writer.close()


def test_what_was_released_is_listed_as_one_stretch_with_its_bytes(tmp_path):
    with writer_in(tmp_path / "j") as writer:
        every: dict[int, Record] = {}
        for k in range(3):
            for i in range(100 * k, 100 * k + 100):
                writer.append(i % 2, 0, i * 1000, payload(i))
            writer.sync()
            every |= {record.number: record for record in open_log(tmp_path / "j").records()}
            assert writer.release((100 * k + 50) * 1000) > 0
        released = writer.counters.released
    said = [record.said for record in open_log(tmp_path / "j").records(OWN) if record.kind == Kind.RELEASED]
    gone = [every[number] for number in range(released)]
    assert said[-1]["records"] == [[0, released - 1, sum(len(record.payload) for record in gone)]]
    for source in (0, 1, OWN):
        own = [record for record in gone if record.source == source]
        expected = [[0, own[-1].source_number, sum(len(record.payload) for record in own)]]
        assert said[-1]["sources"][str(source)] == expected


def test_nothing_goes_before_the_list_of_what_is_released_is_on_the_disk(tmp_path, monkeypatch):
    with writer_in(tmp_path / "j") as writer:
        for i in range(100):
            writer.append(0, 0, i * 1000, payload(i))
        writer.sync()
        before = segment_paths(tmp_path / "j")
        monkeypatch.setattr(os, "fdatasync", fail_with(errno.EIO))
        with pytest.raises(StoreError, match="Input/output error"):
            writer.release(1 << 62)
        assert before.items() <= segment_paths(tmp_path / "j").items()
        assert len(before) > 2
    assert as_tuples(tmp_path / "j") == [(i, 0, 0, i * 1000, payload(i)) for i in range(100)]


def test_stretches_of_numbers_that_follow_one_another_are_one():
    assert merged([]) == []
    assert merged([(5, 6, 20), (0, 1, 3), (2, 4, 7)]) == [(0, 6, 30)]
    assert merged([(0, 1, 3), (3, 4, 7)]) == [(0, 1, 3), (3, 4, 7)]


# --- what a disk that failed has in doubt


def test_what_is_in_doubt_is_read_from_as_many_segments_of_the_spare_folder_as_it_needs(tmp_path, monkeypatch):
    whole, there, asked = os.fdatasync, threading.Event(), []

    def fail_once_all_is_there(descriptor: int) -> None:
        asked.append(descriptor)
        if len(asked) == 1:
            there.wait(30.0)
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        whole(descriptor)

    with writer_in(tmp_path / "j", spare=tmp_path / "spare") as writer:
        writer.append(0, 0, 0, payload(0))
        writer.sync()
        synced = (tmp_path / "j" / "000001.rdlog").read_bytes()
        monkeypatch.setattr(os, "fdatasync", fail_once_all_is_there)
        for i in range(1, 150):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
        there.set()
        writer.sync()
        assert "Input/output error" in writer.counters.spare
        # it stands in two folders, or in none that is sure: nothing of it goes
        assert writer.release(1 << 62) == 0
    assert len(segment_paths(tmp_path / "spare")) > 3
    for path in segment_paths(tmp_path / "j").values():
        path.unlink()
    (tmp_path / "j" / "000001.rdlog").write_bytes(synced)
    assert as_tuples(tmp_path / "j") == written(150)
    survey = open_log(tmp_path / "j").survey()
    assert (survey.lost_records, survey.losses, survey.closed) == (0, (), True)


def test_what_is_held_in_memory_until_it_is_on_the_disk_is_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(writer_module, "_LONGEST_SYNC_INTERVAL_S", 3600.0)
    monkeypatch.setattr(disk, "KEPT_BYTES", 10 * (HEAD_SIZE + 100))
    options = {"segment_bytes": 1 << 16, "sync_interval_s": 3600.0}
    with writer_in(tmp_path / "j", spare=tmp_path / "spare", **options) as writer:
        for i in range(30):
            writer.append(0, 0, i, bytes([i]) * 100)
        monkeypatch.setattr(os, "fdatasync", fail_once(errno.EIO))
        writer.sync()
    (again,) = segment_paths(tmp_path / "spare").values()
    assert [one.payload[0] for one in read_file(again) if one.source == 0] == list(range(20, 30))
    assert [r.payload[0] for r in open_log(tmp_path / "j").records(0)] == list(range(30))


def test_what_is_appended_while_the_disk_is_forced_is_in_doubt_until_it_is_forced_again(tmp_path, monkeypatch):
    monkeypatch.setattr(disk, "KEPT_BYTES", 4 * SEGMENT)  # what was forced there before takes none of it
    whole, asked = os.fdatasync, []

    def append_then_fail(descriptor: int) -> None:
        asked.append(descriptor)
        if len(asked) == 1:
            writer.append(101 % 3, 101 % 5, 101_000, payload(101))
        if len(asked) == 2:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        whole(descriptor)

    with writer_in(tmp_path / "j", spare=tmp_path / "spare", segment_bytes=1 << 16) as writer:
        for i in range(100):
            writer.append(i % 3, i % 5, i * 1000, payload(i))
            writer.sync()
        synced = (tmp_path / "j" / "000001.rdlog").read_bytes()
        monkeypatch.setattr(os, "fdatasync", append_then_fail)
        writer.append(100 % 3, 100 % 5, 100_000, payload(100))
        writer.sync()
        writer.sync()
        assert "Input/output error" in writer.counters.spare
    size = HEAD_SIZE + len(payload(100))
    at = len(synced.rstrip(b"\0"))
    content = (tmp_path / "j" / "000001.rdlog").read_bytes()
    (tmp_path / "j" / "000001.rdlog").write_bytes(content[: at + size])
    assert as_tuples(tmp_path / "j") == written(102)
