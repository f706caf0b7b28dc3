"""Workers: the same results in the same order whoever does the work, and a clear word on whatever goes wrong."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from recoil_acquisition.errors import MissingChannelError, RecoilDaqError, WorkerError
from recoil_daq.workers import LEAST_FOR_PROCESSES, Workers
from tests.builders import pieces_of_work as work

ROOT = Path(__file__).resolve().parents[2]
posix_only = pytest.mark.skipif(sys.platform == "win32", reason="sends signals of POSIX")


@pytest.fixture(scope="module")
def two() -> Iterator[Workers]:
    with Workers(2) as workers:
        yield workers


def named(count: int) -> tuple[list[int], list[str]]:
    return list(range(count)), [f"shot {k}" for k in range(count)]


def running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.whole_way
@pytest.mark.parametrize("number", [1, 2])
def test_results_come_in_the_order_of_the_shots(number: int) -> None:
    items, names = named(5)
    with Workers(number) as workers:
        assert list(workers.map(work.slow_first, items, names)) == items
        assert list(workers.map(work.square, items, names)) == [0, 1, 4, 9, 16]


def test_one_worker_or_one_shot_stays_in_this_process(two: Workers) -> None:
    assert [pid for pid, *_ in Workers(1).map(work.process, *named(2))] == [os.getpid()] * 2
    assert [pid for pid, *_ in two.map(work.process, *named(1))] == [os.getpid()]


def test_few_shots_stay_in_this_process_unless_processes_are_asked_for(two: Workers) -> None:
    few = LEAST_FOR_PROCESSES - 1
    with Workers() as workers:
        assert {pid for pid, *_ in workers.map(work.process, *named(few))} == {os.getpid()}
    assert os.getpid() not in {pid for pid, *_ in two.map(work.process, *named(few))}


def test_each_process_has_one_thread_for_its_linear_algebra_before_that_is_loaded(two: Workers) -> None:
    before = dict(os.environ)
    found = list(two.map(work.process, *named(4)))
    assert {(threads, loaded) for _, threads, loaded in found} == {("1", False)}
    assert len({pid for pid, *_ in found} - {os.getpid()}) == 2
    assert dict(os.environ) == before


@pytest.mark.parametrize("number", [1, 2])
def test_the_first_fault_in_the_order_of_the_shots_comes_back_as_it_was_raised(number: int) -> None:
    with Workers(number) as workers:
        results = workers.map(work.refuse_odd, *named(4))
        assert next(results) == 0
        with pytest.raises(MissingChannelError) as caught:
            next(results)
        assert (caught.value.name, caught.value.nearest, caught.value.path) == ("acc_1", ("acc_0",), Path("1.csv"))


@pytest.mark.whole_way
def test_who_wants_no_more_results_leaves_no_process_at_work() -> None:
    with Workers(2) as workers:
        results = workers.map(work.square, *named(50))
        assert next(results) == 0
        results.close()
        assert list(workers.map(work.square, *named(3))) == [0, 1, 4]


@pytest.mark.whole_way
@pytest.mark.parametrize("number", [1, 2])
def test_outcomes_go_on_past_a_fault(number: int) -> None:
    with Workers(number) as workers:
        outcomes = list(workers.outcomes(work.refuse_odd, *named(4)))
    assert [type(one).__name__ for one in outcomes] == ["int", "MissingChannelError"] * 2


@pytest.mark.whole_way
def test_an_error_of_the_program_itself_keeps_its_kind_and_place(two: Workers) -> None:
    with pytest.raises(ZeroDivisionError) as caught:
        list(two.map(work.fail, *named(2)))
    assert "in fail" in str(caught.value.__cause__)


@pytest.mark.indispensable("workers")
@posix_only
def test_a_process_that_crashes_is_one_line_with_the_shot_s_name_and_the_others_are_done() -> None:
    items, names = named(6)
    with Workers(2) as workers:
        outcomes = list(workers.outcomes(work.crash_on_three, items, names))
        assert [one for one in outcomes if not isinstance(one, RecoilDaqError)] == [0, 1, 2, 4, 5]
        assert isinstance(outcomes[3], WorkerError)
        assert str(outcomes[3]).startswith("shot 3: the process that worked on it ended before it was done; found ")
        assert "\n" not in str(outcomes[3])
        # and the next work has all its processes again
        assert len({pid for pid, *_ in workers.map(work.process, *named(4))}) == 2


@pytest.mark.whole_way
@posix_only
def test_what_crashed_beside_another_is_tried_alone(tmp_path: Path) -> None:
    with Workers(2) as workers:
        paths = [tmp_path / "a", tmp_path / "b"]
        paths[1].touch()
        assert list(workers.map(work.crash_once, paths, ["a", "b"])) == ["a", "b"]


def test_any_other_executor_does_the_work_and_is_left_open() -> None:
    with ThreadPoolExecutor(2) as threads:
        with Workers(executor=threads) as workers:
            assert workers.may_repeat
            assert workers.place(Path("a")) == Path("a").absolute()
            assert list(workers.map(work.square, *named(3))) == [0, 1, 4]
        assert threads.submit(work.square, 3).result() == 9
    broken = ThreadPoolExecutor(1, initializer=work.fail, initargs=(0,))
    with broken, pytest.raises(WorkerError, match="shot 0: the process that worked on it ended"):
        list(Workers(executor=broken).map(work.square, *named(1)))
    with pytest.raises(WorkerError, match="shot 0: the process that worked on it ended"):
        list(Workers(executor=broken).map(work.square, *named(1)))


def test_a_worker_of_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from recoil_daq import workers

    threads = ThreadPoolExecutor(1)
    with threads, monkeypatch.context() as patch:
        submit = threads.submit
        patch.setattr(threads, "submit", lambda work, version, *rest: submit(work, f"{version}.older", *rest))
        with pytest.raises(WorkerError, match="another version of recoil-daq"):
            list(workers.Workers(executor=threads).map(work.square, *named(1)))


def test_what_is_asked_for_must_make_sense() -> None:
    with pytest.raises(ValueError, match="at least 1"):
        Workers(0)
    with ThreadPoolExecutor(1) as threads, pytest.raises(ValueError, match="either"):
        Workers(2, executor=threads)


@pytest.mark.whole_way
@pytest.mark.parametrize("number", [1, 2])
def test_progress_says_how_many_are_done_and_how_long_the_others_take(number: int) -> None:
    said: list[str] = []
    with Workers(number) as workers:
        list(workers.map(work.slow_first, *named(3), progress=said.append))
    assert said[0].startswith("0 of 3 done")
    assert any(" s left" in one for one in said)


SCRIPT = """
    import signal
    from pathlib import Path
    from recoil_daq.workers import Workers
    from tests.builders import pieces_of_work as work

    # whoever runs the tests in the background has them ignore Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)
    print("once", flush=True)
    with Workers(2) as workers:
        list(workers.map(work.{work}, [Path({folder!r})] * 4, list("abcd")))
"""


def script(tmp_path: Path, name: str) -> Path:
    """Write a user's script, which does not expect to be run once more by each process."""
    path = tmp_path / "users_script.py"
    path.write_text(textwrap.dedent(SCRIPT.format(work=name, folder=str(tmp_path))), encoding="utf-8")
    return path


@pytest.mark.whole_way
def test_a_script_without_a_guard_runs_once_and_a_user_s_own_modules_are_left_alone(tmp_path: Path) -> None:
    for name in ("multiprocessing", "socket", "numpy"):
        elsewhere = tmp_path / "cwd"
        elsewhere.mkdir(exist_ok=True)
        (elsewhere / f"{name}.py").write_text("raise SystemExit('the user\\'s own module was run')")
    (tmp_path / "go on").touch()
    path = script(tmp_path, "crash_where_asked")
    done = subprocess.run([sys.executable, path], cwd=elsewhere, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "once\n", "")


@pytest.mark.whole_way
@posix_only
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_whatever_ends_the_command_its_processes_end_and_leave_nothing_half_written(
    tmp_path: Path, number: signal.Signals
) -> None:
    command = subprocess.Popen([sys.executable, script(tmp_path, "half_written")], stderr=subprocess.PIPE, text=True)
    deadline_s = time.monotonic() + 60.0
    while len(half := list(tmp_path.glob("*.partial"))) < 2:
        assert command.poll() is None, f"the script ended by itself:\n{command.communicate()[1]}"
        assert time.monotonic() < deadline_s
        time.sleep(0.02)
    children = [int(path.stem) for path in half]
    command.send_signal(number)
    said = command.communicate(timeout=30.0)[1]
    assert command.returncode == -number
    while any(running(pid) for pid in children):
        assert time.monotonic() < deadline_s
        time.sleep(0.02)
    assert not list(tmp_path.glob("*.partial"))
    assert said.count("Traceback") == (number == signal.SIGINT), f"only of the script itself, not:\n{said}"
    assert "leaked" not in said  # what the pool's semaphores were is taken away, which is no news to anybody
