"""The suite's own settings: another attempt where the machine stood still and only there, and one thread a worker."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.builders.machine_stalls import MachineStalls

ROOT = Path(__file__).parents[1]

SECOND_TIME = """
import pytest
import tests.conftest

tests.conftest.LONGEST_STALL_S = 0.0  # as if every machine stood still
attempts = []

@pytest.mark.real_time
@pytest.mark.parametrize("fails", [1, 2])
def test_that_fails(tmp_path, fails):
    attempts.append(fails)
    assert not list(tmp_path.iterdir())
    (tmp_path / "left").write_text("")
    assert attempts.count(fails) > fails
"""

SHARED = """
import pytest
import tests.builders.machine_stalls

class Stalled:
    largest_s = 1.0

    def __enter__(self): ...
    def __exit__(self, *_): ...

tests.builders.machine_stalls.MachineStalls = Stalled  # of what is shared alone
plays = []

@pytest.fixture(scope="module")
def played(request):
    with tests.builders.machine_stalls.stalls_kept(request):
        plays.append("")
    return len(plays)

@pytest.mark.real_time
def test_that_does_not_mind(played): ...

@pytest.mark.real_time
def test_that_minds(played):
    assert played == 2

@pytest.mark.real_time
def test_without_it_that_minds():
    raise AssertionError
"""

ALWAYS = """
import pytest

@pytest.mark.real_time
def test_that_fails():
    raise AssertionError("a fault of the program")
"""


def outcome(folder: Path, source: str) -> str:
    path = folder / "test_played.py"
    path.write_text(source, encoding="utf-8")
    words = ["-q", "-n", "0", "-p", "tests.conftest", "-p", "no:cacheprovider", "-o", "addopts=", "--rootdir", folder]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *map(str, words), "-o", "markers=real_time: played", str(path)],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.stdout


@pytest.mark.real_time
def test_a_failure_while_the_machine_stood_still_is_tried_once_more_and_told(tmp_path: Path) -> None:
    said = outcome(tmp_path, SECOND_TIME)
    assert "1 passed" in said
    assert "1 failed" in said
    assert said.count("once more: the machine stood still for") == 2


@pytest.mark.real_time
def test_what_tests_share_is_played_again_if_the_machine_stood_still_then(tmp_path: Path) -> None:
    said = outcome(tmp_path, SHARED)
    assert "2 passed" in said
    assert "1 failed" in said
    assert said.count("once more: the machine stood still for 1.00 s") == 1


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="no process can be made to stand still here")
def test_a_process_that_stands_still_is_measured_from_outside() -> None:
    with MachineStalls() as machine:
        time.sleep(0.05)
        machine.process.send_signal(signal.SIGSTOP)
        time.sleep(0.3)
        machine.process.send_signal(signal.SIGCONT)
    assert machine.largest_s > 0.25


@pytest.mark.real_time
def test_code_that_holds_the_interpreter_is_no_machine_that_stands_still() -> None:
    began_s = time.monotonic()
    with MachineStalls() as machine:
        sum(range(50_000_000))  # in one piece: no other thread runs meanwhile
    assert machine.largest_s < (time.monotonic() - began_s) / 2


@pytest.mark.real_time
def test_a_fault_of_the_program_stays_one(tmp_path: Path) -> None:
    said = outcome(tmp_path, ALWAYS)
    assert "1 failed" in said
    assert "a fault of the program" in said
    assert "the longest that it stood still" in said


@pytest.mark.skipif("PYTEST_XDIST_WORKER" not in os.environ, reason="one process has all cores to itself")
@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="there is nowhere to read how it was born")
def test_a_worker_is_born_with_one_thread_for_its_linear_algebra() -> None:
    born_with = Path("/proc/self/environ").read_text(encoding="utf-8", errors="replace").split("\0")
    assert any(each.startswith("OPENBLAS_NUM_THREADS=") for each in born_with)
