"""Processes of this machine that work for this one, and end with it."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any, TypeVar

from recoil_acquisition.child_process import NOWHERE, ChildProcess
from recoil_daq.work import CLEAN_UP_S, GIVE_WAY, WORK

Item = TypeVar("Item")
Result = TypeVar("Result")


class _Place(Exception):  # noqa: N818 - the cause of one, as a traceback shows it
    """Place in another process where an error was raised: the text of its traceback."""

    def __str__(self) -> str:
        return f"\n{self.args[0]}"


class WorkerProcesses:
    """Processes of this machine, started anew: what this one has in its memory or runs as a script is not theirs.

    They stay, because what they load takes longer than a piece of work. When nobody asks them any more, or this process
    is gone, they end.

    Parameters
    ----------
    beside
        Whether they work beside something that must not be disturbed: below normal priority, and without a terminal.

    Raises
    ------
    OSError
        If they cannot be started.
    """

    def __init__(self, number: int, *, beside: bool = False) -> None:
        self.number = number
        self._children: list[ChildProcess] = []
        self._idle: SimpleQueue[ChildProcess] = SimpleQueue()
        self._pool = ThreadPoolExecutor(number)  # whose threads wait for them
        path = pickle.dumps([folder or str(Path.cwd()) for folder in sys.path])
        try:
            for _ in range(number):
                child = ChildProcess("recoil_daq.work", errors=NOWHERE if beside else None, below_normal=beside)
                self._children.append(child)
                self._idle.put(child)
                with suppress(OSError):  # it has ended, which whoever asks it will hear
                    child.ask(WORK, path)
        except OSError:
            self.close(at_once=True)
            raise

    @property
    def pids(self) -> tuple[int, ...]:
        """Numbers of the processes."""
        return tuple(child.pid for child in self._children)

    def submit(self, work: Callable[[Item], Result], item: Item) -> Future[Result]:
        """Have a piece of work done by the next process that is free.

        Raises
        ------
        BrokenExecutor
            If one of them has ended.
        """
        if not all(child.runs for child in self._children):
            raise BrokenExecutor("a process that worked for this one has ended")
        return self._pool.submit(self._done, work, item)

    def _done(self, work: Callable[[Item], Result], item: Item) -> Any:
        """Have it done by a process that is idle; with one that ends at it the others end too."""
        task = pickle.dumps((work, item))
        child = self._idle.get()
        try:
            child.ask(WORK, task)
            result, error, place = pickle.loads(child.answer()[1])  # noqa: S301 - of our own process
        except (OSError, EOFError) as ended:
            for each in self._children:
                each.hang_up()
            raise BrokenExecutor("a process that worked for this one has ended") from ended
        finally:
            self._idle.put(child)
        if error is not None:
            raise error from _Place(place)
        return result

    def give_way(self) -> None:
        """Have the work that is under way end with `recoil_daq.work.GaveWay`, if it may; of one process."""
        with suppress(OSError):  # it has ended
            self._children[0].ask(GIVE_WAY)

    def close(self, *, at_once: bool) -> None:
        """End all processes: at once, or when they have done what they are at."""
        self._pool.shutdown(wait=not at_once, cancel_futures=True)
        for child in self._children:
            child.hang_up()
        for child in self._children:
            child.wait(2 * CLEAN_UP_S)
            child.kill()
        self._pool.shutdown()
        for child in self._children:
            child.end()
