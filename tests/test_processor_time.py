"""The law of time: a test that takes long says why it may, and what is shared is charged to none."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.builders.processor_time import LAW, LONGEST_S, MARKERS, WAITED, Cost, apart, breach, kinds_twice, measured
from tests.test_real_time import ROOT

NONE: frozenset[str] = frozenset()

LONG = """
import time
import pytest

@pytest.fixture
def long():
    end_s = time.process_time() + {took_s}
    while time.process_time() < end_s: ...

def test_that_asks_for_much(long): ...

def test_that_is_quick(): ...

BEFORE = []

def test_that_was_slow_once():
    end_s = time.process_time() + (0.0 if BEFORE else {took_s})
    BEFORE.append(end_s)
    while time.process_time() < end_s: ...

@pytest.mark.whole_way
def test_that_says_why(long): ...
"""


def work(lasting_s: float) -> None:
    end_s = time.process_time() + lasting_s
    while time.process_time() < end_s:
        pass


def test_a_test_without_a_marker_may_take_half_a_second_of_a_quiet_machine() -> None:
    assert breach(NONE, Cost(cpu_s=0.9 * LONGEST_S), 1.0) is None
    assert "make it smaller" in (breach(NONE, Cost(cpu_s=1.1 * LONGEST_S), 1.0) or "")
    assert breach(NONE, Cost(cpu_s=1.1 * LONGEST_S), 1.3) is None
    assert all(breach(frozenset({name}), Cost(cpu_s=60.0), 1.0) is None for name in MARKERS)
    assert breach(frozenset({"parametrize"}), Cost(cpu_s=60.0), 1.0) is not None


def test_one_that_waits_takes_its_worker_too() -> None:
    assert breach(NONE, Cost(0.0, 0.9 * LONGEST_S * WAITED), 1.0) is None
    assert breach(NONE, Cost(0.0, 1.1 * LONGEST_S * WAITED), 1.0) is not None


def test_what_is_shared_is_charged_to_no_test() -> None:
    with measured() as cost:
        work(0.05)
        with apart():
            work(0.1)
            with apart():
                work(0.1)
    assert cost.cpu_s == pytest.approx(0.05, abs=0.03)


def test_what_a_child_computes_is_charged_where_it_is_waited_for() -> None:
    code = "import time\nwhile time.process_time() < 0.1: pass"
    with measured() as cost:
        subprocess.run([sys.executable, "-S", "-c", code], check=True)
    assert cost.cpu_s >= 0.05


def test_a_whole_way_of_the_short_run_is_the_one_of_its_kind() -> None:
    assert kinds_twice([("a", ("identify",)), ("a", ("identify",)), ("b", ("law",)), ("c", ("law",))]) is None
    assert "a is the whole way" in (kinds_twice([("a", ("identify",)), ("b", ("identify",))]) or "")
    assert "names one kind" in (kinds_twice([("a", ())]) or "")


@pytest.mark.whole_way
def test_a_run_that_is_held_to_the_law_fails_for_a_test_that_takes_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "test_long.py").write_text(LONG.format(took_s=0.4), encoding="utf-8")
    words = ["-q", "-n", "0", "-p", "tests.conftest", "-p", "no:cacheprovider", "-o", "addopts=", "--rootdir", tmp_path]
    monkeypatch.setenv(LAW, "0.02")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *map(str, words), str(tmp_path)],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "3 passed" in done.stdout
    assert "1 failed" in done.stdout
    assert "test_long.py::test_that_asks_for_much" in done.stdout
