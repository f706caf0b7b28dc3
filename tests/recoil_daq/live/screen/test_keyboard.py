"""Single keys: which of what a terminal sends is a key, and that the terminal is as before afterwards."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import select
import sys
import time
from collections.abc import Iterator
from types import ModuleType

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_daq.live.screen import keyboard as module
from recoil_daq.live.screen.keyboard import Keyboard

posix = pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[int, int]]:
    """Both ends of a pseudo-terminal, the second of which is stdin."""
    master, slave = os.openpty()
    with os.fdopen(slave, "r") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        yield master, slave
    os.close(master)


def keys(keyboard: Keyboard) -> str:
    """Return what was typed, once the kernel has handed it on."""
    if keyboard.available:
        with contextlib.suppress(OSError, ValueError):  # no descriptor, or the terminal is gone
            select.select([sys.stdin], [], [], 5.0)
    return "".join(keyboard.key() for _ in range(20))


@posix
@pytest.mark.parametrize(
    "sent",
    [
        b"\x1b[A", b"\x1b[D", b"\x1bOA", b"\x1bOD", b"\x1b[1;5D", b"\x1b[[A", b"\x1b[[D", b"\x1b[15~", b"\x1bO2Q",
        b"\x1bt", b"\x1b\x1b[A", b"\x1b[<0;10;20M", b"\x1b[A\x1b[A\x1b[D",
    ],
)  # fmt: skip
def test_a_key_that_is_no_character_does_nothing_of_what_its_last_letter_would_do(terminal, sent) -> None:
    with Keyboard() as keyboard:
        os.write(terminal[0], sent)
        assert keys(keyboard) == ""
        os.write(terminal[0], b"q")
        assert keys(keyboard) == "q"


@settings(deadline=None, max_examples=100)
@given(st.lists(st.sampled_from([b"\x1b[A", b"\x1bOD", b"\x1b[1;5D", b"\x1b[[A", b"t", b"A"]), max_size=7), st.data())
def test_it_does_not_matter_in_which_pieces_keys_arrive(parts: list[bytes], data) -> None:
    sent = b"".join(parts)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=4)))
    keyboard = Keyboard()
    pieces = [sent[a:b] for a, b in zip([0, *cuts], [*cuts, len(sent)], strict=True)]
    assert "".join(keyboard._keys_in(piece) for piece in pieces) == b"".join(p for p in parts if len(p) == 1).decode()


@pytest.mark.real_time
@posix
def test_the_escape_key_alone_does_not_swallow_a_later_key(terminal, monkeypatch) -> None:
    with Keyboard() as keyboard:
        os.write(terminal[0], b"\x1b")
        assert keys(keyboard) == ""
        later_s = time.monotonic() + 1
        monkeypatch.setattr(module.time, "monotonic", lambda: later_s)
        os.write(terminal[0], b"t")
        assert keys(keyboard) == "t"


@posix
def test_what_is_pasted_counts_as_no_key(terminal) -> None:
    with Keyboard() as keyboard:
        os.write(terminal[0], b"recoil-daq ingest data")
        assert keys(keyboard) == ""
        os.write(terminal[0], "дT".encode())
        assert keys(keyboard) == "дT"
        os.write(terminal[0], b"Wind from the left")
        assert keyboard.key(typed=True) == "W"


@posix
def test_the_terminal_gives_single_keys_and_is_as_before_after_an_error(terminal) -> None:
    import termios

    before = termios.tcgetattr(terminal[1])
    keyboard = Keyboard()
    with contextlib.suppress(ZeroDivisionError), keyboard:
        mode = termios.tcgetattr(terminal[1])
        assert not mode[3] & (termios.ECHO | termios.ICANON)
        assert mode[3] & termios.ISIG  # Ctrl-C still interrupts
        assert not mode[0] & termios.IXON  # Ctrl-S does not halt the output
        assert {mode[6][key] for key in (termios.VSUSP, termios.VQUIT)} == {b"\0"}  # nor Ctrl-Z the recording
        assert mode[6][termios.VINTR] == b"\x03"
        assert keyboard.available
        raise ZeroDivisionError("as anything may fail meanwhile")
    assert termios.tcgetattr(terminal[1]) == before
    assert not keyboard.available
    assert keyboard.key() == ""


@posix
def test_what_was_typed_before_or_is_left_over_is_forgotten(terminal) -> None:
    os.write(terminal[0], b"a\n")
    select.select([terminal[1]], [], [], 5.0)
    with Keyboard() as keyboard:
        assert [keyboard.key() for _ in range(5)] == [""] * 5
        os.write(terminal[0], b"q\n")
        select.select([terminal[1]], [], [], 5.0)
    assert select.select([terminal[1]], [], [], 0.01)[0] == []


@posix
def test_a_terminal_that_is_gone_sends_no_keys_and_raises_nothing(monkeypatch) -> None:
    master, slave = os.openpty()
    with os.fdopen(slave, "r") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        with Keyboard() as keyboard:
            os.close(master)
            assert keys(keyboard) == ""


@pytest.mark.parametrize("closed", [False, True])
def test_stdin_that_is_no_terminal_has_no_keys(monkeypatch, closed: bool) -> None:
    stdin = io.StringIO("q")
    if closed:
        stdin.close()
    monkeypatch.setattr(sys, "stdin", stdin)
    with Keyboard() as keyboard:
        assert not keyboard.available
        assert keyboard.key() == ""
    monkeypatch.setattr(sys, "stdin", None)
    with Keyboard() as keyboard:
        assert keyboard.key() == ""


class Console(ModuleType):
    """What the keyboard uses of Windows' msvcrt, for text that was typed."""

    def __init__(self, typed: str) -> None:
        super().__init__("msvcrt")
        self.typed = list(typed)

    def kbhit(self) -> bool:
        return bool(self.typed)

    def getwch(self) -> str:
        return self.typed.pop(0)  # IndexError where the real one would wait


def test_on_windows_arrow_keys_come_in_two_parts_and_do_nothing(monkeypatch) -> None:
    console = Console("a")
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setitem(sys.modules, "msvcrt", console)
    spec = importlib.util.spec_from_file_location("keyboard_on_windows", module.__file__)
    assert spec is not None
    assert spec.loader is not None
    windows = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(windows)
    stdin = io.StringIO()
    monkeypatch.setattr(stdin, "isatty", lambda: True)
    monkeypatch.setattr(stdin, "fileno", lambda: 0)
    monkeypatch.setattr(sys, "stdin", stdin)
    with windows.Keyboard() as keyboard:
        assert keyboard.key() == ""  # typed before
        console.typed += ["\xe0", "t", "\x00", "D", "T", "q", "\xe0"]
        assert keys(keyboard) == "Tq"
        assert not console.typed
