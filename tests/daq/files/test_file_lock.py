"""Locks where the file system has them, and where it has none."""

import errno
import json
import os
import platform
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from recoil_acquisition.errors import StoreError
from recoil_acquisition.files import file_lock
from recoil_acquisition.files.file_lock import FileLock, LockTakenError, mark_path
from recoil_acquisition.log.folder import find_logs, remove_log
from recoil_acquisition.log.segment import FolderLock, is_being_written
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from recoil_daq.live.output_folder import OutputFolder
from tests.builders.saved_logs import long_ago

pytestmark = pytest.mark.usefixtures("without_locks")


@pytest.fixture(params=[errno.ENOTSUP, errno.ENOLCK], ids=errno.errorcode.get)
def without_locks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the file system answer that it has no locks."""

    def refuse(_: int) -> None:
        raise OSError(request.param, os.strerror(request.param))

    monkeypatch.setattr(file_lock, "try_lock", refuse)


def ended_pid() -> int:
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        process.wait()
        return process.pid


def left(lock: Path, host: str, pid: int) -> Path:
    """Leave what a process that ended left of a lock."""
    lock.touch()
    mark = mark_path(lock)
    mark.write_text(json.dumps({"host": host, "pid": pid, "token": "theirs"}))
    return mark


def aged(mark: Path) -> Path:
    """Have a holder's file be older than any command takes."""
    then = time.time() - 2 * file_lock.LONGEST_COMMAND_S
    os.utime(mark, (then, then))
    return mark


def test_one_at_a_time_holds_a_lock_and_its_holder_is_named(tmp_path: Path) -> None:
    lock = tmp_path / "lock"
    with FileLock(lock, 0.0), pytest.raises(TimeoutError, match=f"process {os.getpid()} of .*remove .*lock.held"):
        FileLock(lock, 0.05)
    with FileLock(lock, 0.0):
        pass
    assert list(tmp_path.iterdir()) == [lock]


def test_commands_that_change_a_log_at_once_lose_nothing(tmp_path: Path) -> None:
    log = tmp_path / SHOT_LOG

    def add(k: int) -> None:
        ShotLog.changed(log, lambda one: one.with_cells(f"s{k}", {"notes": str(k)}), ())

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(add, range(8)))
    assert {row.shot: row.notes for row in ShotLog.read(log, ()).rows} == {f"s{k}": str(k) for k in range(8)}


@pytest.mark.skipif(sys.platform == "win32", reason="there a process that ended is known by the age alone")
def test_what_a_process_of_this_computer_left_is_taken_away(tmp_path: Path) -> None:
    left(tmp_path / "lock", platform.node(), ended_pid())
    with FileLock(tmp_path / "lock", 0.0):
        pass
    left(tmp_path / "lock", platform.node(), os.getpid())
    long_ago(mark_path(tmp_path / "lock"))
    with pytest.raises(TimeoutError):
        FileLock(tmp_path / "lock", 0.0)


def test_what_another_computer_left_is_known_by_its_age(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mark = left(tmp_path / "lock", "elsewhere\x1b[2J", 1)
    with pytest.raises(TimeoutError, match=r"process 1 of elsewhere\\x1b"):
        FileLock(tmp_path / "lock", 0.0)
    long_ago(mark)
    monkeypatch.setattr(file_lock, "LONGEST_COMMAND_S", 30.0)
    with FileLock(tmp_path / "lock", 0.0):
        pass
    assert not mark.exists()


@pytest.mark.parametrize("content", [b"", b"\xff", b"[]", b'{"host": 1}', b"[" * 900, b'{"host": "a", "pid": 1e99}'])
def test_a_damaged_holders_file_is_known_by_its_age(tmp_path: Path, content: bytes) -> None:
    mark = mark_path(tmp_path / "lock")
    mark.write_bytes(content)
    with pytest.raises(TimeoutError, match="a process since"):
        FileLock(tmp_path / "lock", 0.0)
    aged(mark)
    with FileLock(tmp_path / "lock", 0.0):
        pass


def test_of_many_who_find_what_was_left_one_holds_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lock = tmp_path / "lock"
    before = sys.getswitchinterval()
    monkeypatch.setattr(file_lock, "LOOK_EVERY_S", 0.001)

    def hold(held: list[int]) -> None:
        with FileLock(lock, 20.0):
            held.append(1)
            assert len(held) == 1
            held.pop()

    sys.setswitchinterval(1e-5)
    try:
        for _ in range(10):
            aged(left(lock, "elsewhere", 1))
            with ThreadPoolExecutor(8) as pool:
                list(pool.map(hold, [[]] * 16))
            assert list(tmp_path.iterdir()) == [lock]
    finally:
        sys.setswitchinterval(before)


def test_who_was_slow_to_take_away_what_was_left_touches_nothing_of_a_new_holder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lock = tmp_path / "lock"
    aged(left(lock, "elsewhere", 1))
    look = file_lock._look

    def look_slowly(mark: Path, longest_s: float) -> tuple[bytes | None, str | None]:
        found = look(mark, longest_s)
        monkeypatch.setattr(file_lock, "_look", look)
        held.append(FileLock(lock, 0.0))
        return found

    held: list[FileLock] = []
    monkeypatch.setattr(file_lock, "_look", look_slowly)
    with pytest.raises(TimeoutError):
        FileLock(lock, 0.0)
    with held[0], pytest.raises(TimeoutError):
        FileLock(lock, 0.0)
    assert list(tmp_path.iterdir()) == [lock]


def test_a_right_to_take_away_that_was_left_keeps_nobody_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lock = tmp_path / "lock"
    mark = aged(left(lock, "elsewhere", 1))

    def die(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", die)
        with pytest.raises(KeyboardInterrupt):
            FileLock(lock, 0.0)
    (right,) = set(tmp_path.iterdir()) - {lock, mark}
    with pytest.raises(TimeoutError, match=right.name):
        FileLock(lock, 0.0)
    aged(right)
    right.write_text(json.dumps({"host": platform.node(), "pid": ended_pid(), "token": "theirs"}))
    with FileLock(lock, 1.0):
        pass
    assert list(tmp_path.iterdir()) == [lock]


def test_a_holders_file_that_is_too_long_is_taken_away_by_its_age(tmp_path: Path) -> None:
    mark = left(tmp_path / "lock", "elsewhere", 1)
    mark.write_bytes(b" " * 5000)
    aged(mark)
    with FileLock(tmp_path / "lock", 1.0):
        pass


def test_a_journal_is_written_by_one_session_and_by_none_that_is_not_there(tmp_path: Path) -> None:
    with OutputFolder(tmp_path):
        assert is_being_written(tmp_path / "journal")
        with pytest.raises(StoreError, match=f"another live session.*process {os.getpid()}"):
            OutputFolder(tmp_path)
    assert not is_being_written(tmp_path / "journal")
    assert list(tmp_path.iterdir()) == []


def test_a_log_is_one_writers_and_left_over_when_it_was_killed(tmp_path: Path) -> None:
    folder = tmp_path / "log"
    with LogWriter(folder, {}, 0, segment_bytes=1 << 14):
        assert find_logs(tmp_path) == ()
        with pytest.raises(LockTakenError):
            FolderLock(folder)
    if sys.platform != "win32":
        left(folder / "writer.lock", platform.node(), ended_pid())
    assert find_logs(tmp_path) == (folder,)
    remove_log(folder)
    assert not folder.exists()
