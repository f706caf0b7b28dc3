"""Ctrl-C, and the system's requests to end, as something to be asked for, not as an exception in the middle."""

from __future__ import annotations

import contextlib
import ctypes
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any

_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK") if hasattr(signal, name)
)
_HANG_UP = getattr(signal, "SIGHUP", None)
_TYPED = tuple(getattr(signal, name) for name in ("SIGINT", "SIGQUIT", "SIGBREAK") if hasattr(signal, name))

_CONSOLE_ENDS = (2, 5, 6)
"""Events of a console on Windows, by their numbers there: it is closed, its person logs off, the computer goes down."""
CONSOLE_WAITS_S = 4.5
"""Time for which such an event is answered, s: Windows ends the process after 5 s, and at once when it is answered."""


@contextmanager
def as_ctrl_c() -> Iterator[None]:
    """Let the system's requests to end do what Ctrl-C does: what was begun is taken back, and the terminal given back.

    It is for the time before anything is armed and after; `Interruption` takes them while a session runs.
    """
    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for number in _SIGNALS:
            if signal.getsignal(number) != signal.SIG_IGN:
                before[number] = signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class Interruption:
    """While it is entered, such a signal is noted; it ends nothing by itself, and Ctrl-Z halts no recording.

    Attributes
    ----------
    count
        Number of interruptions so far; that a terminal is closed counts where it is the first of them.
    """

    def __init__(self) -> None:
        self.count = 0
        self._last = 0
        self._before: dict[int, Any] = {}
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> Interruption:
        self._stack.enter_context(_console_ends(lambda: self._note(_HANG_UP or 0, None)))
        if threading.current_thread() is threading.main_thread():
            for number in _SIGNALS:
                if number != signal.SIGINT and signal.getsignal(number) == signal.SIG_IGN:
                    continue  # started with nohup: it is to outlive its terminal
                self._before[number] = signal.signal(number, self._note)
            if (halt := getattr(signal, "SIGTSTP", None)) is not None:
                self._before[halt] = signal.signal(halt, signal.SIG_IGN)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before = {}
        self._stack.close()

    @property
    def asked(self) -> bool:
        """Whether the work is to be completed and ended."""
        return self.count > 0

    @property
    def by_key(self) -> bool:
        """Whether the last of them was typed, such as Ctrl-C: somebody may be there to be asked."""
        return self._last in _TYPED

    def _note(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002 - a signal's handler gets both
        if number in (_HANG_UP, 0) and self.count:
            return  # of one terminal that is closed, its shell and the kernel each send one: nobody urges
        self.count += 1
        self._last = number


def _kernel32() -> Any:
    """Return the library of Windows that knows consoles; None elsewhere."""
    windll = getattr(ctypes, "windll", None)
    return None if windll is None else windll.kernel32


@contextmanager
def _console_ends(tell: Callable[[], object]) -> Iterator[None]:
    """Say meanwhile that a console on Windows is closed, and hold its end up until this is over, or for a while.

    Nothing is to be done elsewhere: a signal says it.
    """
    system = _kernel32()
    if system is None:
        yield
        return
    over = threading.Event()

    def ends(event: int) -> int:
        """Answer an event, in a thread of the system's."""
        if event not in _CONSOLE_ENDS:
            return 0  # Ctrl-C and Ctrl-Break are signals
        tell()
        over.wait(CONSOLE_WAITS_S)
        return 1

    handler = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)(ctypes.c_int, ctypes.c_uint)(ends)
    system.SetConsoleCtrlHandler(handler, 1)
    try:
        yield
    finally:
        over.set()
        system.SetConsoleCtrlHandler(handler, 0)
