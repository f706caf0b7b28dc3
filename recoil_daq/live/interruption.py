"""Ctrl-C, and the system's requests to end, as something to be asked for, not as an exception in the middle."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT") if hasattr(signal, name))
_HANG_UP = getattr(signal, "SIGHUP", None)
_TYPED = tuple(getattr(signal, name) for name in ("SIGINT", "SIGQUIT") if hasattr(signal, name))


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

    def __enter__(self) -> Interruption:
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

    @property
    def asked(self) -> bool:
        """Whether the work is to be completed and ended."""
        return self.count > 0

    @property
    def by_key(self) -> bool:
        """Whether the last of them was typed, such as Ctrl-C: somebody may be there to be asked."""
        return self._last in _TYPED

    def _note(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002 - a signal's handler gets both
        if number == _HANG_UP and self.count:
            return  # of one terminal that is closed, its shell and the kernel each send one: nobody urges
        self.count += 1
        self._last = number
