"""The process that stays warm for what is to be done soon after a live shot: conversions, masses, the campaign."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future
from dataclasses import dataclass, field
from typing import Any

from recoil_acquisition.errors import WorkerError
from recoil_daq.worker_processes import GaveWay, WorkerProcesses, named_work


@dataclass(eq=False)
class WarmWork:
    """Piece of work that a `WarmWorker` was asked for.

    Attributes
    ----------
    work
        Function of one argument, as ``module:name``.
    rank
        Rank: a lower one goes first.
    puts_off
        Whether it gives way, unfinished, to what comes later with a lower rank, and is begun anew after it.
    """

    work: str
    item: Any
    rank: int
    puts_off: bool
    _again: Callable[[Any], Any] | None
    _future: Future[Any] | None = None
    _ended: Future[Any] = field(default_factory=Future)

    @property
    def done(self) -> bool:
        """Whether it is over, with a result or an error."""
        return self._ended.done()

    def result(self) -> Any:
        """Return its result, once it is over.

        Raises
        ------
        WorkerError
            If the process ended at it twice.
        Exception
            That the function raised.
        """
        return self._ended.result(0.0)


class WarmWorker:
    """One process of this machine that stays for what is to be done soon after a shot, one piece of work at a time.

    It gives way to the acquisition, and is started with the first work. What it does is named, not given, so that the
    process that asks loads nothing of it. Where it ends at a piece of work, another one does that again, once. One
    thread asks, and looks.
    """

    def __init__(self) -> None:
        self._processes: WorkerProcesses | None = None
        self._waiting: list[WarmWork] = []
        self._under_way: WarmWork | None = None

    def ask(
        self,
        work: str,
        item: Any,
        *,
        rank: int = 0,
        puts_off: bool = False,
        again: Callable[[Any], Any] | None = lambda item: item,
    ) -> WarmWork:
        """Ask for a piece of work.

        Parameters
        ----------
        work
            Function of one argument, as ``module:name``.
        item
            Argument of it, which can be pickled.
        rank, puts_off
            Order in which it is done, as of `WarmWork`.
        again
            Function that returns the argument with which the work is done again, after the process ended at it; None if
            it is not done again.
        """
        asked = WarmWork(work, item, rank, puts_off, again)
        self._waiting.append(asked)
        if self._under_way is not None and self._under_way.puts_off and rank < self._under_way.rank:
            self._require().give_way()
        self.look()
        return asked

    def drop(self, asked: WarmWork) -> bool:
        """Take back what waits; return whether it did."""
        if asked not in self._waiting:
            return False
        self._waiting.remove(asked)
        asked._ended.cancel()
        return True

    def look(self) -> None:
        """Take what is done, and begin what waits."""
        one = self._under_way
        if one is not None and one._future is not None and one._future.done():
            self._under_way = None
            self._take(one, one._future)
        while self._under_way is None and self._waiting:
            one = min(self._waiting, key=lambda waiting: waiting.rank)
            self._waiting.remove(one)
            try:
                one._future = self._require().submit(named_work, (one.work, one.item, one.puts_off))
                self._under_way = one
            except BrokenExecutor:  # the process ended since
                self.close_process()
                self._waiting.insert(0, one)
            except OSError as error:
                one._ended.set_exception(
                    WorkerError(f"no process can be started: {error}", remedy="look at the memory of the machine")
                )

    def _take(self, one: WarmWork, future: Future[Any]) -> None:
        error = future.exception()
        if error is None:
            one._ended.set_result(future.result())
        elif isinstance(error, GaveWay):
            self._waiting.insert(0, one)
        elif not isinstance(error, BrokenExecutor):
            one._ended.set_exception(error)
        else:
            self.close_process()
            if one._again is None:
                one._ended.set_exception(WorkerError("the process that worked on it ended before it was done"))
                return
            one.item, one._again = one._again(one.item), None
            self._waiting.insert(0, one)

    def _require(self) -> WorkerProcesses:
        if self._processes is None:
            self._processes = WorkerProcesses(1, beside=True)
        return self._processes

    def close_process(self) -> None:
        """End the process at once, whatever it is at; it leaves nothing half done, and the next work starts another."""
        processes, self._processes = self._processes, None
        if processes is not None:
            processes.close(at_once=True)

    def give_up(self, asked: WarmWork) -> None:
        """End a piece of work at once, and what it was writing with it; it has no result."""
        if self._under_way is asked:
            self._under_way = None
            self.close_process()
            asked._ended.cancel()
        self.drop(asked)

    def close(self) -> None:
        """End the process, whatever it is at, and take back all that waits."""
        for one in tuple(self._waiting):
            self.drop(one)
        self._under_way = None
        self.close_process()
