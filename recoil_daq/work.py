"""Work in a process of `recoil_daq.worker_processes`: what happens there, and what ends it or puts it off."""

from __future__ import annotations

import _thread
import os
import pickle
import signal
import sys
import threading
import traceback
from contextlib import suppress
from importlib import import_module
from queue import SimpleQueue
from types import FrameType
from typing import IO, Any

from recoil_acquisition.child_process import put, take

CLEAN_UP_S = 10.0
"""Time that a process that is to end has to take away what it had half done, s."""
ENDED = 130
"""Exit code of a process that ends because the one that started it does."""
WORK, GIVE_WAY = b"w", b"g"
"""Kinds of messages: the path of modules, then pieces of work; that the work is to be put off, if it may be."""

_WORKING = threading.Lock()
"""Lock that is held at work."""
_asked_to_end = threading.Event()
_may_give_way = False
if sys.platform == "win32":
    _PUT_OFF = signal.SIGBREAK
else:
    _PUT_OFF = signal.SIGUSR1
"""Signal by which the thread that listens tells the one that works that its work is to be put off."""


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


def serve() -> None:
    """Work until nobody asks any more: Ctrl-C is for the process that asks to answer."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end_soon)
    signal.signal(_PUT_OFF, _put_off)
    answers = os.fdopen(os.dup(1), "wb")
    with suppress(OSError):  # where there are no errors to be shown
        os.dup2(2, 1)  # what is printed is no answer
    tasks: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, tasks), daemon=True).start()
    sys.path[:] = pickle.loads(tasks.get())  # noqa: S301 - of the process that started this one
    while True:
        task = tasks.get()
        try:
            with _WORKING:
                answer = _answer(task)
        except KeyboardInterrupt:
            os._exit(ENDED)
        try:
            put(answers, WORK, answer)
            answers.flush()
        except OSError:  # nobody is there any more
            os._exit(ENDED)


def _answer(task: bytes) -> bytes:
    """Do a piece of work; return its result, the error that it raised, and the place of that, as bytes."""
    try:
        work, item = pickle.loads(task)  # noqa: S301 - of the process that started this one
        return pickle.dumps((work(item), None, ""))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # whatever it is, the process that asked answers to it
        place = traceback.format_exc()
        try:
            return pickle.dumps((None, error, place))
        except Exception:
            return pickle.dumps((None, RuntimeError(f"{type(error).__name__}: {error}"), place))


def _listen(requests: IO[bytes], tasks: SimpleQueue[bytes]) -> None:
    """Hand on what is asked; when nobody is there any more, end this process wherever it is in its work."""
    with suppress(EOFError, OSError):
        while True:
            kind, content = take(requests)
            if kind == WORK:
                tasks.put(content)
            else:
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


def _put_off(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - a signal's handler gets both
    global _may_give_way  # noqa: PLW0603 - once
    if _may_give_way:
        _may_give_way = False
        raise GaveWay


def _end_soon(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - a signal's handler gets both
    if not _WORKING.locked():
        os._exit(ENDED)
    if not _asked_to_end.is_set():
        # once: what this one lets be cleaned up is not to be interrupted by a second one
        _asked_to_end.set()
        raise KeyboardInterrupt


if __name__ == "__main__":
    import_module("recoil_daq.work").serve()  # by the name under which what it does knows it
