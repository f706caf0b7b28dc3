"""Workers: the processes, here or on other machines, among which shots are shared out; results in the shots' order.

The processes of other machines are those of a dask cluster, which an extra brings.
"""

from __future__ import annotations

import _thread
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from types import FrameType, ModuleType, TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

from recoil_acquisition.errors import RecoilDaqError, WorkerError
from recoil_acquisition.extras import CLUSTER
from recoil_acquisition.linear_algebra import LIMITS
from recoil_daq.version import __version__

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


Item = TypeVar("Item")
Result = TypeVar("Result")

LEAST_FOR_PROCESSES = 4
"""Number of pieces of work from which on processes pay: each of them takes longer to start than a shot takes to
identify."""
MOST_PROCESSES = 61
"""Most processes: Windows waits for no more at once."""
CLEAN_UP_S = 10.0
"""Time that a process that is to end has to take away what it had half done, s."""
LOOK_EVERY_S = 0.5
"""Time between two looks whether somebody pressed Ctrl-C, s: Windows interrupts no wait for it."""
CONNECT_S = 10.0
"""Time within which a scheduler answers, s, or does not at all."""
ENDED = 130
"""Exit code of a process that ends because the one that started it does."""

_SURROUNDINGS = {
    # the matrices of a shot are small, and each core has a process of its own
    **dict.fromkeys(LIMITS, "1"),
    # as `recoil_acquisition.child_process.own_command`: no modules from the folder that the user happens to be in
    "PYTHONSAFEPATH": "1",
}
_BELOW_NORMAL = 5
"""Nice value of the process that works on live shots: it gives way to the acquisition, and is done before the next shot
where other programs are busy too. What is done in it shares one queue, so that nothing in it may be lower: a verdict
would wait behind a mass that no other program lets go on."""
_STARTING = threading.Lock()
_WORKING = threading.Lock()
"""Lock that is held, in a process of `_Processes`, while it is at work."""
_GIVE_WAY = b"give way"
"""Message to a process that its work is to be put off, if it may be."""
_asked_to_end = threading.Event()
_may_give_way = False


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
        self._own: _Processes | None = None

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
            self._own = _Processes(self.number)
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
                self._own = _Processes(1)
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


class _Processes:
    """Processes of this machine, started anew: what this one has in its memory or runs as a script is not theirs.

    They are tied to this process by a pipe: when that is closed, or this process is gone, they end.

    Parameters
    ----------
    beside
        Whether they work beside something that must not be disturbed: below normal priority, and without a terminal.
    """

    def __init__(self, number: int, *, beside: bool = False) -> None:
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        context = get_context("spawn")
        self.number = number
        self._end, self._tie = context.Pipe(duplex=False)
        with _surroundings():  # its semaphores start a process that watches over them
            self._pool = ProcessPoolExecutor(
                number, mp_context=context, initializer=_tied, initargs=(self._end, beside)
            )

    def submit(self, work: Callable[[Item], Result], item: Item) -> Future[Result]:
        with _surroundings():
            return self._pool.submit(_at_work, work, item)

    def give_way(self) -> None:
        """Have the work that is under way end with `_GaveWay`, if it may; of one process."""
        with suppress(OSError):  # it has ended
            self._tie.send_bytes(_GIVE_WAY)

    def close(self, *, at_once: bool) -> None:
        if at_once:
            self._tie.close()
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._tie.close()
        self._end.close()


@contextmanager
def _surroundings() -> Iterator[None]:
    """Set what a process is started with: its environment, and that it does not run the user's script once more."""
    with _STARTING:
        before = {name: os.environ.get(name) for name in _SURROUNDINGS}
        script = sys.modules["__main__"]
        os.environ.update(_SURROUNDINGS)
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = script
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value


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
        self._processes: _Processes | None = None
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
                one._future = self._require().submit(_named, (one.work, one.item, one.puts_off))
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
        elif isinstance(error, _GaveWay):
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

    def _require(self) -> _Processes:
        if self._processes is None:
            self._processes = _Processes(1, beside=True)
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


class _GaveWay(BaseException):
    """Work that was put off: what comes before it is done first.

    It is no Exception, so that nothing that answers to faults answers to it.
    """


def _named(task: tuple[str, Any, bool]) -> Any:
    global _may_give_way  # noqa: PLW0603 - a signal's handler sees it
    work, item, puts_off = task
    module, name = work.split(":")
    function = getattr(import_module(module), name)
    try:
        _may_give_way = puts_off
        return function(item)
    finally:
        _may_give_way = False


def _tied(tie: Connection, beside: bool) -> None:
    """Tie this process to the one that started it: Ctrl-C is for that one to answer."""
    if beside:
        _stand_beside()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end_soon)
    signal.signal(_PUT_OFF, _put_off)
    threading.Thread(target=_end_with, args=(tie,), daemon=True).start()


if sys.platform == "win32":
    _PUT_OFF = signal.SIGBREAK
else:
    _PUT_OFF = signal.SIGUSR1
"""Signal by which the thread that listens tells the one that works that its work is to be put off."""


def _put_off(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - a signal's handler gets both
    global _may_give_way  # noqa: PLW0603 - once
    if _may_give_way:
        _may_give_way = False
        raise _GaveWay


def _stand_beside() -> None:
    """Lower this process's priority, and take it off the terminal, on which a screen is shown."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    os.close(nowhere)
    if sys.platform == "win32":
        _lower_on_windows()
    else:
        os.nice(_BELOW_NORMAL)


def _lower_on_windows() -> None:
    """Give this process a class of priorities below the normal one."""
    import ctypes

    kernel = ctypes.windll.kernel32  # type: ignore[attr-defined,unused-ignore]
    kernel.SetPriorityClass(kernel.GetCurrentProcess(), 0x4000)


def _end_with(tie: Connection) -> None:
    """Wait for the other end of the pipe to be closed, and end this process wherever it is in its work."""
    with suppress(EOFError, OSError):
        while tie.recv_bytes() == _GIVE_WAY:
            _signal_main(_PUT_OFF)
    _signal_main(signal.SIGTERM)
    _WORKING.acquire(timeout=CLEAN_UP_S)
    os._exit(ENDED)


def _signal_main(number: int) -> None:
    """Have the main thread handle a signal."""
    if sys.platform == "win32":
        _thread.interrupt_main(number)
    else:
        # which also interrupts what the main thread waits for
        signal.pthread_kill(threading.main_thread().ident or 0, number)


def _end_soon(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - a signal's handler gets both
    if not _WORKING.locked():
        os._exit(ENDED)
    if not _asked_to_end.is_set():
        # once: what this one lets be cleaned up is not to be interrupted by a second one
        _asked_to_end.set()
        raise KeyboardInterrupt


def _at_work(work: Callable[[Item], Result], item: Item) -> Result:
    with _WORKING:
        try:
            return work(item)
        except KeyboardInterrupt:
            os._exit(ENDED)


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
