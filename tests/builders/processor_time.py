"""What each test costs, and the law that one which costs more than half a second says by a marker why it may.

The cost is processor time, of the test and of the processes that it waited for: on a busy machine the clock tells of
the others. What is made once for the whole run is not charged to whoever asks first, nor is the loading of a library.
"""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.machinery import SourceFileLoader
from pathlib import Path
from time import monotonic, process_time
from types import ModuleType
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

LONGEST_S = 0.5
"""That a test without a marker may take, on a machine that takes `REFERENCE_S` for the exercise."""
WAITED = 8
"""How many times as long by the clock: what waits does nothing, and takes a worker all the same."""
REFERENCE_S = 0.02
LAW, COSTS = "RECOIL_DAQ_LAW_OF_TIME", "RECOIL_DAQ_TEST_COSTS"
"""Environment variables: how many seconds a test without a marker may take, and a file that takes each one's cost."""
KEPT, A_LAW = "indispensable", "law"
MARKERS = {
    KEPT: "takes longer than half a second and is in the short run: the one whole way of the kind it names, or a law",
    "whole_way": "runs commands or whole evaluations, beyond the first of their kind",
    "real_time": "plays in real time or kills what does; has one more attempt where the machine stood still",
    "exhaustive": "tries a law at every place, or with many seeds",
}
"""Marker -> what a test does that carries it. All but the first run beside the short run, by a command of their own."""


@dataclass
class Apart:
    """Processor time and time by the clock of what is not charged to a test."""

    cpu_s: float = 0.0
    wall_s: float = 0.0
    depth: int = 0


APART = Apart()


def processor_s() -> float:
    """Return the processor time of this process and of those that it has waited for."""
    return sum(os.times()[:4])


@contextmanager
def apart() -> Iterator[None]:
    """Charge what is done within to no test."""
    APART.depth += 1
    cpu_s, wall_s = processor_s(), monotonic()
    try:
        yield
    finally:
        APART.depth -= 1
        if APART.depth == 0:
            APART.cpu_s += processor_s() - cpu_s
            APART.wall_s += monotonic() - wall_s


def load_apart() -> None:
    """Charge the loading of a module, and what tests keep in a cache, to none: whoever comes first would bear it."""
    functools.cache = _cached_apart  # type: ignore[assignment]
    execute = SourceFileLoader.exec_module

    def exec_module(loader: SourceFileLoader, module: ModuleType) -> None:
        with apart():
            execute(loader, module)

    SourceFileLoader.exec_module = exec_module  # type: ignore[method-assign]


def lay_out_characters() -> None:
    """Draw one text: in a fresh clone hypothesis works out its table of characters with it, which takes seconds."""

    @settings(max_examples=1, database=None)
    @given(st.text())
    def drawn(_: str) -> None: ...

    drawn()


def _cached_apart(function: Callable[..., Any]) -> Any:
    """Keep what a function returns, as `functools.cache` does; one of the tests works it out apart."""
    if not function.__module__.startswith("tests."):
        return functools.lru_cache(maxsize=None)(function)

    @functools.wraps(function)
    def worked_out(*args: Any, **more: Any) -> Any:
        with apart():
            return function(*args, **more)

    return functools.lru_cache(maxsize=None)(worked_out)


@dataclass
class Cost:
    """Cost of a part of a test: processor time, and time by the clock."""

    cpu_s: float = 0.0
    wall_s: float = 0.0

    @property
    def charged_s(self) -> float:
        """Return the processor time, or the share of the time by the clock that counts as such."""
        return max(self.cpu_s, self.wall_s / WAITED)


@contextmanager
def measured() -> Iterator[Cost]:
    """Measure what is done within."""
    cost = Cost()
    cpu_s, wall_s = processor_s() - APART.cpu_s, monotonic() - APART.wall_s
    try:
        yield cost
    finally:
        cost.cpu_s = processor_s() - APART.cpu_s - cpu_s
        cost.wall_s = monotonic() - APART.wall_s - wall_s


@functools.cache
def slowness() -> float:
    """Return how many times as long as the reference this machine takes for an exercise, at least 1."""
    matrix, took = np.linspace(0.0, 1.0, 10_000).reshape(100, 100), []
    for _ in range(5):
        start_s = process_time()
        sum(len(json.dumps({str(k): k * 1.5})) for k in range(4000))
        for _ in range(20):
            np.linalg.solve(matrix + np.eye(100), matrix)
        took.append(process_time() - start_s)
    return max(1.0, min(took) / REFERENCE_S)


def breach(markers: frozenset[str], cost: Cost, slow: float, longest_s: float = LONGEST_S) -> str | None:
    """Return what is said of a part of a test that costs too much for one without a marker; None where nothing is.

    Parameters
    ----------
    markers
        Names of all that the test carries.
    slow
        How many times as long as the reference the machine takes, see `slowness`.
    """
    if markers & MARKERS.keys() or cost.charged_s <= longest_s * slow:
        return None
    return (
        f"{cost.cpu_s:.2f} s of processor, {cost.wall_s:.2f} s by the clock, where a test without a marker has"
        f" {longest_s * slow:.2f} s: make it smaller, or say what it does by one of {', '.join(MARKERS)}"
    )


def kinds_twice(kept: Iterable[tuple[str, tuple[object, ...]]]) -> str | None:
    """Return what is said where two tests of the short run are whole ways of one kind; None where none are.

    Parameters
    ----------
    kept
        Name of a test without its parameters, and what its marker names.
    """
    of: dict[object, str] = {}
    for test, names in kept:
        if len(names) != 1 or not isinstance(names[0], str):
            return f"{test}: {KEPT} names one kind of whole way, or {A_LAW!r}"
        if names[0] != A_LAW and of.setdefault(names[0], test) != test:
            return f"{test}: {of[names[0]]} is the whole way of the kind {names[0]!r}; mark one as whole_way"
    return None


def append_line(path: Path, **values: object) -> None:
    """Append a document to a file of lines; a test that gave its rights away may not."""
    with suppress(PermissionError), path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(values) + "\n")
