"""A test that plays devices has another attempt where the machine stood still, and only there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]

THIRD_TIME = """
import pytest

attempts = []

@pytest.mark.real_time
def test_that_fails_twice_while_nothing_else_runs(tmp_path):
    attempts.append(tmp_path)
    assert not list(tmp_path.iterdir())
    (tmp_path / "left").write_text("")
    sum(range(20_000_000))  # in one piece: no other thread runs meanwhile
    assert len(attempts) == 3
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


def test_a_failure_while_the_machine_stood_still_is_tried_again_and_told(tmp_path: Path) -> None:
    said = outcome(tmp_path, THIRD_TIME)
    assert "1 passed" in said
    assert said.count("failed while the machine stood still for") == 2


def test_a_fault_of_the_program_stays_one(tmp_path: Path) -> None:
    said = outcome(tmp_path, ALWAYS)
    assert "1 failed" in said
    assert "a fault of the program" in said
    assert "the longest that it stood still" in said
