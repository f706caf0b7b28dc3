"""One thread for the linear algebra while a call takes, whoever loaded numpy before; and what was there comes back."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from recoil_acquisition.numerics.linear_algebra import LIMITS
from tests.builders.virtual_shots import SHORTER, with_twin

BEGIN = """
import threading
import numpy, scipy.linalg
from threadpoolctl import ThreadpoolController, threadpool_limits
from recoil_acquisition.numerics.linear_algebra import on_one_thread, stated_threads, threads

def now():
    return sorted({one["num_threads"] for one in ThreadpoolController().info()})

threadpool_limits(2)  # as on a computer with two cores
"""


def printed(program: str, **environment: str) -> list[str]:
    """Run a program in a process of its own, whose environment sets no other limits, and return what it printed."""
    rest = {name: value for name, value in os.environ.items() if name not in LIMITS}
    done = subprocess.run(
        [sys.executable, "-c", BEGIN + textwrap.dedent(program)], env={**rest, **environment}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    return done.stdout.splitlines()


@pytest.fixture(scope="module", autouse=True)
def _several_threads() -> None:
    if printed("print(now())") != ["[2]"]:
        pytest.skip("the linear algebra of this computer has no threads to limit")


@pytest.mark.exhaustive
def test_a_call_within_a_call_is_limited_and_all_comes_back_behind_it() -> None:
    program = """
        @on_one_thread
        def inner():
            print(now(), threads())

        @on_one_thread
        def outer():
            inner()
            print(now())
            raise OSError("as a file may")

        try:
            outer()
        except OSError:
            print(now(), threads())
    """
    assert printed(program) == ["[1] 1", "[1]", "[2] 2"]


@pytest.mark.exhaustive
def test_a_call_that_ends_does_not_lift_the_limit_of_another_thread() -> None:
    program = """
        both, first_ended = threading.Barrier(2), threading.Event()

        @on_one_thread
        def first():
            both.wait()

        @on_one_thread
        def second():
            both.wait()
            first_ended.wait()
            print(now())

        threads_of = [threading.Thread(target=first), threading.Thread(target=second)]
        for one in threads_of:
            one.start()
        threads_of[0].join()
        first_ended.set()
        threads_of[1].join()
        print(now())
    """
    assert printed(program) == ["[1]", "[2]"]


@pytest.mark.exhaustive
def test_a_number_in_the_environment_is_what_somebody_wants() -> None:
    program = """
        on_one_thread(lambda: print(now()))()
        print(stated_threads(), threads())
    """
    assert printed(program, OMP_NUM_THREADS="2") == ["[2]", "2 2"]


@pytest.mark.exhaustive
def test_files_are_worked_on_by_one_thread_from_python(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(with_twin("field-2013", **SHORTER).text, encoding="utf-8")
    program = """
        import os, tempfile
        from pathlib import Path
        from recoil_daq import identify_file, ingest_files, load_rig, simulate

        seen = []
        with tempfile.TemporaryDirectory() as folder:
            rig = load_rig(os.environ["RIG"])
            watch = lambda step: seen.append(now())
            fired = simulate(rig, Path(folder) / "fired", progress=watch)
            done = ingest_files(rig, fired.shots[0].files, out=Path(folder) / "shots", progress=watch)
            found = identify_file(done.path, out=Path(folder) / "reports", progress=watch)
        print(sorted({tuple(each) for each in seen}), now())
        print(found.document["provenance"]["computer"]["blas_threads"])
    """
    assert printed(program, RIG=str(tmp_path / "rig.toml")) == ["[(1,)] [2]", "1"]
