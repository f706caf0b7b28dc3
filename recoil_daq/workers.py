"""Workers: the processes, here or on other machines, among which shots are shared out; results in the shots' order.

The processes of other machines are those of a dask cluster, which an extra brings.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from recoil_acquisition.errors import RecoilDaqError, WorkerError
from recoil_acquisition.packages.extras import CLUSTER
from recoil_daq.version import __version__
from recoil_daq.worker_processes import WorkerProcesses

Item = TypeVar("Item")
Result = TypeVar("Result")

LEAST_FOR_PROCESSES = 4
"""Number of pieces of work from which on processes pay: each of them takes longer to start than a shot takes to
identify."""
MOST_PROCESSES = 61
"""Most processes: Windows waits for no more at once."""
LOOK_EVERY_S = 0.5
"""Time between two looks whether somebody pressed Ctrl-C, s: Windows interrupts no wait for it."""
CONNECT_S = 10.0
"""Time within which a scheduler answers, s, or does not at all."""


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Workers:
    """Does one piece of work for each of many shots, several at a time; to be closed, or used as a context.

    Parameters
    ----------
    number
        Number of processes; 1 works in this one. None takes one for each core, and none for fewer pieces of work than
        `LEAST_FOR_PROCESSES`. They are started when there is work for more than one.
    executor
        Any other executor, which stays its owner's: it is told functions and values that can be pickled. It may do
        work again that was lost with a machine.
    lost
        Errors of its futures that mean that the work was lost, beside those of the standard library.

    Raises
    ------
    ValueError
        If the number is below 1, or both are given.
    """

    def __init__(
        self,
        number: int | None = None,
        *,
        executor: Executor | None = None,
        lost: tuple[type[Exception], ...] = (),
    ) -> None:
        if number is not None and number < 1:
            raise ValueError(f"workers must be at least 1, not {number}")
        if number is not None and executor is not None:
            raise ValueError("give either a number of workers or an executor")
        self.number = min(number or cores(), MOST_PROCESSES)
        self._least = LEAST_FOR_PROCESSES if number is None else 2
        self._given = executor
        self._lost: tuple[type[Exception], ...] = (BrokenExecutor, CancelledError, *lost)
        self._own: WorkerProcesses | None = None

    @classmethod
    def of(cls, workers: int | Workers | None, executor: Executor | None) -> AbstractContextManager[Workers]:
        """Return those that a caller means: so many, an executor, or some that are there and stay open."""
        if isinstance(workers, Workers):
            return nullcontext(workers)
        return cls(workers, executor=executor)

    @property
    def may_repeat(self) -> bool:
        """Whether a piece of work may be done twice: what it wrote the first time is there then."""
        return self._given is not None

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(at_once=error is not None)

    def close(self, *, at_once: bool = False) -> None:
        """End the processes.

        Parameters
        ----------
        at_once
            Whether they are ended before they complete what they are at; they leave nothing half done.
        """
        own, self._own = self._own, None
        if own is not None:
            own.close(at_once=at_once)

    def place(self, path: Path) -> Path:
        """Return a path as the workers are told it: in full, where they may stand in another folder."""
        return path if self._given is None else path.absolute()

    def map(
        self,
        work: Callable[[Item], Result],
        items: Sequence[Item],
        names: Sequence[str],
        *,
        progress: Callable[[str], None] = lambda _: None,
    ) -> Iterator[Result]:
        """Do one piece of work for each item, and stop at the first fault.

        Parameters
        ----------
        work
            Function that can be pickled.
        names
            Names of the items, for people.
        progress
            Function called with how many are done, and how long the others may take.

        Yields
        ------
        object
            Results, in the order of the items.

        Raises
        ------
        RecoilDaqError
            The first, in the order of the items, that the work raised; `WorkerError` if its process ended.
        """
        for one in self.outcomes(work, items, names, progress=progress):
            if isinstance(one, RecoilDaqError):
                raise one
            yield one

    def outcomes(
        self,
        work: Callable[[Item], Result],
        items: Sequence[Item],
        names: Sequence[str],
        *,
        progress: Callable[[str], None] = lambda _: None,
    ) -> Iterator[Result | RecoilDaqError]:
        """Do one piece of work for each item, as `map`, and go on past those that fail: their errors are yielded."""
        tally = _Tally(len(items), progress)
        if self._given is None and (self.number == 1 or len(items) < self._least):
            for k, (item, name) in enumerate(zip(items, names, strict=True)):
                tally.say(k, name)
                try:
                    yield work(item)
                except RecoilDaqError as error:
                    yield error
            return
        futures, whole = self._submitted(work, items), False
        own = self._own
        try:
            for k, (item, name) in enumerate(zip(items, names, strict=True)):
                tally.wait(futures, k)
                try:
                    outcome: Result | RecoilDaqError = futures[k].result()
                except RecoilDaqError as error:
                    outcome = error
                except self._lost as error:
                    outcome = self._done_alone(work, item, name, error)
                futures[k] = Future()  # a result is not kept longer than whoever asked for it does
                yield outcome
            whole = True
        finally:
            if not whole and own is not None:
                # futures that are cancelled would make trouble for a pool whose processes end
                own.close(at_once=True)
                self._own = None if self._own is own else self._own
            elif not whole:
                for future in futures:
                    future.cancel()

    def _submitted(self, work: Callable[[Item], Result], items: Sequence[Item]) -> list[Future[Result]]:
        if self._given is not None:
            given = self._given
            return [self._sent(lambda one: given.submit(_same_version, __version__, work, one), item) for item in items]
        if self._own is None or self._own.number < self.number:
            self.close()
            self._own = WorkerProcesses(self.number)
        own = self._own
        return [self._sent(lambda one: own.submit(work, one), item) for item in items]

    def _sent(self, submit: Callable[[Item], Future[Result]], item: Item) -> Future[Result]:
        """Submit an item; where one that was submitted before it has ended the executor by now, it is lost too."""
        try:
            return submit(item)
        except self._lost as error:
            lost: Future[Result] = Future()
            lost.set_exception(error)
            return lost

    def _done_alone(
        self, work: Callable[[Item], Result], item: Item, name: str, error: Exception
    ) -> Result | RecoilDaqError:
        """Do what was lost in a process of its own: so it shows whether this item or another one at a time ends it."""
        if self._given is None:
            if self._own is None or self._own.number > 1:
                self.close(at_once=True)
                self._own = WorkerProcesses(1)
            own = self._own
            future = self._sent(lambda one: own.submit(work, one), item)
            while not future.done():
                wait([future], timeout=LOOK_EVERY_S)
            try:
                return future.result()
            except RecoilDaqError as fault:
                return fault
            except self._lost as again:
                error = again
                self.close(at_once=True)
        lost = WorkerError(
            f"{name}: the process that worked on it ended before it was done",
            found=" ".join(str(error).split()) or type(error).__name__,
            remedy="look at the memory of the machine, and try it by itself with --workers 1",
        )
        lost.__cause__ = error
        return lost


@dataclass
class _Tally:
    """Counts what is done of so many, and says how long the others may take."""

    total: int
    progress: Callable[[str], None]
    since_s: float = field(default_factory=time.monotonic)

    def say(self, done: int, name: str = "") -> None:
        words = [f"{done} of {self.total} done", *([name] if name else [])]
        if 0 < done < self.total:
            left_s = (time.monotonic() - self.since_s) / done * (self.total - done)
            words.append(f"{_duration(left_s)} left")
        self.progress(", ".join(words))

    def wait(self, futures: Sequence[Future[Result]], first: int) -> None:
        """Wait for one of some futures, and count all of them meanwhile."""
        while True:
            waited_for = [future for future in futures[first:] if not future.done()]
            self.say(self.total - len(waited_for))
            if futures[first].done():
                return
            wait(waited_for, timeout=LOOK_EVERY_S, return_when=FIRST_COMPLETED)


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"


def _same_version(version: str, work: Callable[[Item], Result], item: Item) -> Result:
    """Do a piece of work on another machine, which must compute the same digits."""
    if version != __version__:
        raise WorkerError(
            "a worker has another version of recoil-daq",
            expected=version,
            found=__version__,
            remedy="install the same version on all machines",
        )
    return work(item)


@contextmanager
def workers_at(address: str) -> Iterator[Workers]:
    """Let the workers of a cluster do the work, which read and write the same files under the same names.

    What a worker was at that is lost is done again by another one.

    Parameters
    ----------
    address
        Address of the scheduler, such as ``tcp://192.0.2.1:8786``.

    Raises
    ------
    WorkerError
        If the extra is not installed, the scheduler does not answer, or it has no workers.
    """
    if not CLUSTER.is_installed:
        raise WorkerError(f"{CLUSTER.module}, which --cluster needs, is not installed", remedy=CLUSTER.remedy)
    from distributed import Client, KilledWorker
    from distributed.comm.core import CommClosedError

    # that a lost result is worked out again is what this promises, and no warning
    logging.getLogger("distributed.client").setLevel(logging.ERROR)
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise WorkerError(
            f"no scheduler answers at {address}",
            found=" ".join(str(error).split()) or type(error).__name__,
            remedy="start `dask scheduler` there, and name it as tcp://HOST:PORT",
        ) from error
    with client:
        if not client.nthreads():
            raise WorkerError(
                f"the scheduler at {address} has no workers",
                remedy="start `dask worker --nthreads 1 ADDRESS` on each machine",
            )
        # unlike a process pool's, its futures do not end with it
        with (
            client.get_executor(pure=False) as executor,
            Workers(executor=executor, lost=(KilledWorker, CommClosedError)) as workers,
        ):
            yield workers
