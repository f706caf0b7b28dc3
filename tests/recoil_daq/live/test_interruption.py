"""Ctrl-C is noted while it is asked for, and is what it was before and afterwards."""

from __future__ import annotations

import signal
import threading

import pytest

from recoil_daq.live.interruption import Interruption


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
