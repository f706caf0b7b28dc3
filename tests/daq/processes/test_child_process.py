"""A child process: what it read, printed and said comes back, and nothing of it is left, however it ended."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

from recoil_acquisition.processes.child_process import ChildProcess, Ended, isolated
from tests.builders import child_tasks

TASKS = child_tasks.__name__
posix_only = pytest.mark.skipif(sys.platform == "win32", reason="signals and groups of POSIX")


def test_what_it_read_and_printed_comes_back() -> None:
    assert isolated(TASKS, "turn", limit_s=60.0, given=b"abc") == Ended(0, b"cba", "")


def test_a_fault_is_the_last_line_that_it_said_or_its_code() -> None:
    ended = isolated(TASKS, "fail", limit_s=60.0)
    assert (ended.code, ended.said, ended.why) == (1, "no such thing", "no such thing")
    assert Ended(-9, b"", "").why == "code -9"


def test_one_that_prints_much_is_looked_at_in_passing() -> None:
    with ChildProcess(TASKS, "much") as child:
        while (ended := child.ended(0.0)) is None:
            time.sleep(0.01)
        assert (len(ended.out), child.ended(0.0)) == (3_000_000, ended)


def lingering(folder: Path) -> tuple[ChildProcess, int]:
    """Start one that starts another."""
    child, number = ChildProcess(TASKS, "linger", str(folder / "pid")), ""
    while not number:
        assert child.runs
        time.sleep(0.01)
        number = (folder / "pid").read_text() if (folder / "pid").exists() else ""
    return child, int(number)


def gone(pid: int) -> bool:
    """Whether a process ends within seconds: init takes it away where its parent is gone."""
    for _ in range(500):
        try:
            state = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]
        except OSError:
            return True
        if state == "Z":
            return True
        time.sleep(0.01)
    return False


@posix_only
def test_what_takes_too_long_is_ended_with_all_that_it_started(tmp_path: Path) -> None:
    child, other = lingering(tmp_path)
    assert child.ended(0.01) is None
    child.end()
    assert not child.runs
    assert gone(other)
    with pytest.raises(TimeoutError, match="not done after 0 s"):
        isolated(TASKS, "linger", str(tmp_path / "pid"), limit_s=0.2)


@posix_only
def test_ctrl_c_while_it_is_waited_for_ends_it(tmp_path: Path) -> None:
    child, other = lingering(tmp_path)
    threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt), child:
        child.ended(None)
    assert not child.runs
    assert gone(other)


def test_one_that_serves_answers_until_it_ends_and_a_cut_answer_is_none() -> None:
    with ChildProcess(TASKS, "serve", errors=tempfile.TemporaryFile()) as child:
        child.ask(b"a", b"abc")
        assert child.answer() == (b"a", b"ABC")
        with pytest.raises(EOFError):
            child.answer()
        assert child.ended(60.0) == Ended(0, b"", "it is done")
    with ChildProcess(TASKS, "serve", errors=tempfile.TemporaryFile()) as child:
        child.kill()
        with pytest.raises(EOFError):
            child.answer()
        while child.runs:  # its pipes close one after the other
            time.sleep(0.01)
        with pytest.raises(BrokenPipeError):
            child.ask(b"a", b"abc")


def test_an_answer_larger_than_any_is_refused() -> None:
    with ChildProcess(TASKS, "serve") as child:
        child.ask(b"a", b"abc")
        with pytest.raises(EOFError):
            child.answer(2)
