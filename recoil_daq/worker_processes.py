"""Processes of this machine that work for another one, and end with it: what starts them, and what happens in them."""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from importlib import import_module
from types import FrameType, ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

from recoil_acquisition.numerics.linear_algebra import LIMITS
from recoil_acquisition.processes.child_process import BELOW_NORMAL

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

Item = TypeVar("Item")
Result = TypeVar("Result")

CLEAN_UP_S = 10.0
"""Time that a process that is to end has to take away what it had half done, s."""
ENDED = 130
"""Exit code of a process that ends because the one that started it does."""

_SURROUNDINGS = {
    # the matrices of a shot are small, and each core has a process of its own
    **dict.fromkeys(LIMITS, "1"),
    # as a `ChildProcess`: no modules from the folder that the user happens to be in
    "PYTHONSAFEPATH": "1",
}
_QUIET = "ignore:resource_tracker:UserWarning"
"""Option ``-W`` of what is started: the process that takes away the pool's semaphores behind one that was killed says
so, which nobody can mend."""
_STARTING = threading.Lock()
_WORKING = threading.Lock()
"""Lock that is held, in a process of `WorkerProcesses`, while it is at work."""
_GIVE_WAY = b"give way"
"""Message to a process that its work is to be put off, if it may be."""
_asked_to_end = threading.Event()
_may_give_way = False


class WorkerProcesses:
    """Processes of this machine, started anew: what this one has in its memory or runs as a script is not theirs.

    They are tied to this process by a pipe: when that is closed, or this process is gone, they end. They are not
    of `recoil_acquisition.processes.child_process`: work and results are objects, which the standard library's pool
    carries, and no module of ours unpickles.

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
        """Have a piece of work done by the next process that is free."""
        with _surroundings():
            return self._pool.submit(_at_work, work, item)

    def give_way(self) -> None:
        """Have the work that is under way end with `GaveWay`, if it may; of one process."""
        with suppress(OSError):  # it has ended
            self._tie.send_bytes(_GIVE_WAY)

    def close(self, *, at_once: bool) -> None:
        """End all processes: at once, or when they have done what they are at."""
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
        sys.warnoptions.append(_QUIET)
        try:
            yield
        finally:
            sys.warnoptions.remove(_QUIET)
            sys.modules["__main__"] = script
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value


class GaveWay(BaseException):
    """Work that was put off: what comes before it is done first.

    It is no Exception, so that nothing that answers to faults answers to it.
    """


def named_work(task: tuple[str, Any, bool]) -> Any:
    """Do a piece of work that is named, ``module:name``, with its argument, and whether it gives way."""
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
        for name in ("SIGTSTP", "SIGQUIT"):  # typed for the process in front, which a halt of this one would hold up
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), signal.SIG_IGN)
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
        raise GaveWay


def _stand_beside() -> None:
    """Lower this process's priority, and take it off the terminal, on which a screen is shown."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    os.close(nowhere)
    if sys.platform == "win32":
        _lower_on_windows()
    else:
        os.nice(BELOW_NORMAL)


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
