"""Settings of the whole test suite."""

import gc
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from _pytest.runner import runtestprotocol
from hypothesis import settings

from tests.builders.bytecode import Backwards, collects_backwards, in_order, keep_bytecode
from tests.builders.machine_stalls import MachineStalls, shared_stall_s
from tests.builders.processor_time import (
    COSTS,
    KEPT,
    LAW,
    MARKERS,
    Cost,
    append_line,
    breach,
    kinds_twice,
    lay_out_characters,
    load_apart,
    measured,
    slowness,
)
from tests.builders.shared_motions import folder_of_this_run, share_motions

# the same examples at every run: a failure belongs to the change under test, not to chance; explore before a release
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=50)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

OF_THE_RUN = pytest.StashKey[ExitStack]()
SETUP = pytest.StashKey[Cost]()
"""What the setup of a test cost."""
TOO_LONG = pytest.StashKey[str]()
"""What is said of the cost of a test that the law of time does not allow."""


def pytest_configure(config: pytest.Config) -> None:
    """Make the folder of the run before its workers start, and give each of them one thread for its linear algebra.

    The threads of OpenBLAS spin while they wait for one another: with two workers that have two each, a test of small
    matrices took twenty times as long. The library looks once, when it is loaded: a worker must be born with it.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # as whatever a shell starts in the background; what tests interrupt, and start, would not be
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if sys.dont_write_bytecode and sys.pycache_prefix is None and (cache := getattr(config, "cache", None)) is not None:
        keep_bytecode(cache.mkdir("bytecode"))
    for name, what in MARKERS.items():
        config.addinivalue_line("markers", f"{name}: {what}")
    if LAW in os.environ or COSTS in os.environ:
        load_apart()
    if config.getoption("numprocesses", None):
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    config.stash[OF_THE_RUN] = ExitStack()
    config.stash[OF_THE_RUN].enter_context(folder_of_this_run())


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the folder of the run."""
    if OF_THE_RUN in config.stash:
        config.stash[OF_THE_RUN].close()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Deal the tests out by file, unless another way was asked for."""
    from tests.builders.tests_by_file import TestsByFile

    if config.getoption("dist") != "load":
        return None
    config.option.loadscopereorder = False
    return TestsByFile(config, log)


def pytest_collect_directory(path: Path, parent: pytest.Collector) -> pytest.Dir | None:
    """Let every second worker begin with the last files, so that no two compile the same ones."""
    is_package = (path / "__init__.py").exists()
    return Backwards.from_parent(parent, path=path) if collects_backwards() and not is_package else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Hold whole ways of the short run to one of each kind, and begin with what takes long by the clock."""
    if twice := kinds_twice(
        (item.nodeid.split("[")[0], mark.args) for item in items for mark in item.iter_markers(KEPT)
    ):
        raise pytest.UsageError(twice)
    if "PYTEST_XDIST_WORKER" in os.environ:
        from tests.builders.tests_by_file import long_first

        in_order(items)
        long_first(items)


def pytest_collection_finish() -> None:
    """Share what many tests would compute again, and never look through what was collected for garbage.

    That is a million objects which stay to the end: each search took a third of a second, and stopped what was played.
    What tests leave behind is searched more seldom than usual: they leave little in circles.
    """
    share_motions()
    if LAW in os.environ:
        lay_out_characters()
    gc.collect()
    gc.freeze()
    gc.set_threshold(5000, 20, 20)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    """Measure what a test asks for."""
    with measured() as cost:
        yield
    item.stash[SETUP] = cost


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Measure a test, and hold it to the law of time where that is asked for."""
    with measured() as call:
        yield
    setup, markers = item.stash[SETUP], frozenset(mark.name for mark in item.iter_markers())
    if COSTS in os.environ:
        named = sorted(markers & MARKERS.keys())
        append_line(
            Path(os.environ[COSTS]), test=item.nodeid, markers=named, setup=vars(setup), call=vars(call),
            slowness=slowness(),
        )  # fmt: skip
    if LAW in os.environ:
        longest_s = float(os.environ[LAW])
        costs = [cost for cost in (setup, call) if breach(markers, cost, slowness(), longest_s) is not None]
        # what was busy beside it then slows an exercise now
        slowness.cache_clear() if costs else None
        told = [text for cost in costs if (text := breach(markers, cost, slowness(), longest_s)) is not None]
        if told and TOO_LONG in item.stash:
            pytest.fail(told[0], pytrace=False)
        if told:
            item.stash[TOO_LONG] = told[0]


ATTEMPTS = 2
LONGEST_STALL_S = 0.25
"""A machine whose processes wait for longer plays nothing in real time; beside busy ones they wait a tenth of it."""


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Give a test that plays devices in real time another attempt if the machine stood still, and it failed, meanwhile.

    What it says of its subject then is not known. A test that fails while the machine kept time has failed.
    """
    if item.get_closest_marker("real_time") is None:
        return _within_its_time(item, nextitem) if LAW in os.environ else None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for left in reversed(range(ATTEMPTS)):
        with MachineStalls() as machine:
            reports = runtestprotocol(item, nextitem=nextitem, log=False)
        failed = any(report.failed for report in reports)
        largest_s = max(machine.largest_s, shared_stall_s(item))
        if not failed or not left or largest_s < LONGEST_STALL_S:
            break
        # what it shares with the tests before it was played while the machine stood still: it is played again
        item.session._setupstate.teardown_exact(None)
        lines = [line for report in reports if report.failed for line in report.longreprtext.splitlines()]
        why = next((line[1:].strip() for line in lines if line.startswith("E ")), "")
        _tell(item, f"{item.nodeid} once more: the machine stood still for {largest_s:.2f} s; {why}")
    for report in reports:
        if report.failed:
            report.sections.append(("machine", f"the longest that it stood still: {largest_s:.3f} s"))
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _within_its_time(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test that the law of time holds; one that took too long once more, since much may have been busy beside it.

    It has taken too long where it does so both times, each with all that it asks for made anew.
    """
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports = runtestprotocol(item, nextitem=nextitem, log=False)
    if TOO_LONG in item.stash and not any(report.failed for report in reports):
        item.session._setupstate.teardown_exact(None)
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _tell(item: pytest.Item, text: str) -> None:
    """List a warning at the end of the run, of whichever worker it comes."""
    message = warnings.WarningMessage(RuntimeWarning(text), RuntimeWarning, str(item.path), 1)
    what = {"warning_message": message, "when": "runtest", "nodeid": item.nodeid, "location": None}
    item.ihook.pytest_warning_recorded.call_historic(kwargs=what)
