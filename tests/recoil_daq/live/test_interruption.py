"""Ctrl-C is noted while it is asked for, and is what it was before and afterwards."""

from __future__ import annotations

import importlib
import signal
import threading
import time
from typing import Any

import pytest

from recoil_daq.live import interruption as module
from recoil_daq.live.interruption import Interruption, as_ctrl_c


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_before_anything_is_armed_a_request_to_end_is_ctrl_c(name: str) -> None:
    number = getattr(signal, name, signal.SIGTERM)
    outside = signal.signal(number, signal.SIG_DFL)
    try:
        with as_ctrl_c():
            with Interruption() as interruption:
                signal.raise_signal(number)
            assert interruption.count == 1
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(number)
        assert signal.getsignal(number) == signal.SIG_DFL
    finally:
        signal.signal(number, outside)


def test_what_is_ignored_from_outside_stays_so_before_anything_is_armed() -> None:
    number = getattr(signal, "SIGHUP", signal.SIGTERM)
    outside = signal.signal(number, signal.SIG_IGN)
    try:
        with as_ctrl_c():
            signal.raise_signal(number)
    finally:
        signal.signal(number, outside)


@pytest.mark.skipif(not hasattr(signal, "SIGTSTP"), reason="Windows halts no process by a key")
def test_ctrl_z_halts_no_recording_and_ctrl_backslash_asks_for_an_orderly_end() -> None:
    # a shell without job control has what it starts in the background ignore Ctrl-\
    outside = signal.signal(signal.SIGQUIT, signal.SIG_DFL)
    try:
        with Interruption() as interruption:
            signal.raise_signal(signal.SIGTSTP)  # would halt this test
            assert not interruption.asked
            signal.raise_signal(signal.SIGQUIT)
            assert (interruption.count, interruption.by_key) == (1, True)
        assert signal.getsignal(signal.SIGTSTP) == signal.SIG_DFL
    finally:
        signal.signal(signal.SIGQUIT, outside)


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows hangs nobody up")
def test_a_terminal_that_is_closed_asks_once_however_many_say_so() -> None:
    """The kernel tells the process, and so does the shell that started it: that is no second request."""
    outside = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        with Interruption() as interruption:
            signal.raise_signal(signal.SIGHUP)
            signal.raise_signal(signal.SIGHUP)
            assert (interruption.count, interruption.by_key) == (1, False)
            signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGHUP)
            assert interruption.count == 2
    finally:
        signal.signal(signal.SIGHUP, outside)


def test_signals_are_counted_and_raise_nothing() -> None:
    with Interruption() as interruption:
        assert not interruption.asked
        signal.raise_signal(signal.SIGINT)
        assert interruption.asked
        assert (interruption.count, interruption.by_key) == (1, True)
        signal.raise_signal(signal.SIGTERM)
        assert (interruption.count, interruption.by_key) == (2, False)


def test_afterwards_ctrl_c_is_an_exception_again() -> None:
    # a program that was started in the background ignores it, and so would this test
    before = signal.default_int_handler
    outside = signal.signal(signal.SIGINT, before)
    try:
        _enter_and_leave(before)
    finally:
        signal.signal(signal.SIGINT, outside)


def _enter_and_leave(before: object) -> None:
    with Interruption():
        assert signal.getsignal(signal.SIGINT) != before
    assert signal.getsignal(signal.SIGINT) == before
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_in_another_thread_no_handler_is_touched() -> None:
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def enter() -> None:
        with Interruption() as interruption:
            seen.append((signal.getsignal(signal.SIGINT) == before, interruption.asked))

    thread = threading.Thread(target=enter)
    thread.start()
    thread.join()
    assert seen == [(True, False)]


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows hangs no terminal up")
def test_a_session_that_was_started_with_nohup_outlives_its_terminal() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interruption() as interruption:
            signal.raise_signal(signal.SIGHUP)
            assert not interruption.asked
    finally:
        signal.signal(signal.SIGHUP, before)


class Console:
    """Console of Windows, as its library answers."""

    def __init__(self) -> None:
        self.handlers: list[Any] = []

    def SetConsoleCtrlHandler(self, handler: Any, add: int) -> int:
        self.handlers.append(handler) if add else self.handlers.remove(handler)
        return 1


def test_a_console_that_is_closed_asks_once_and_waits_for_the_session_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    console = Console()
    monkeypatch.setattr(module, "_kernel32", lambda: console)
    with Interruption() as interruption:
        (handler,) = console.handlers
        assert handler(0) == 0  # Ctrl-C is a signal
        assert not interruption.asked
        answered = threading.Thread(target=handler, args=(2,))
        answered.start()
        until_s = time.monotonic() + 5.0
        while not interruption.asked and time.monotonic() < until_s:
            time.sleep(0.01)
        assert (interruption.count, interruption.by_key) == (1, False)
        answered.join(0.05)
        assert answered.is_alive()  # Windows would end the process as soon as it is answered
    answered.join(5.0)
    assert not answered.is_alive()
    assert not console.handlers


def test_ctrl_break_asks_as_ctrl_c_does(monkeypatch: pytest.MonkeyPatch) -> None:
    number = signal.SIGUSR1 if hasattr(signal, "SIGUSR1") else signal.SIGBREAK  # type: ignore[attr-defined,unused-ignore]
    monkeypatch.setattr(signal, "SIGBREAK", number, raising=False)
    again = importlib.reload(module)
    try:
        with again.Interruption() as interruption:
            signal.raise_signal(number)
            assert (interruption.count, interruption.by_key) == (1, True)
    finally:
        monkeypatch.undo()
        importlib.reload(module)
