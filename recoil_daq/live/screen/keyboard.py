"""Single keys from the terminal, without echo and without waiting."""

from __future__ import annotations

import contextlib
import os
import re
import select
import sys
import time
from types import TracebackType
from typing import Any

if sys.platform == "win32":
    import msvcrt
else:
    import termios
    import tty

# what a terminal sends for a key that is no character, after ECMA-48, 5.4 and 8.3.118, and the Linux console's F1 to F5
# (ESC [ [ A): the last letter of an arrow key would else be taken for a key of the screen
_ESCAPED = re.compile(rb"\x1b+(?:\[\[?+[0-?]*[ -/]*[@-~]|O[0-9;]*[@-~]|[^\x1b\[O])")
_UNFINISHED = re.compile(rb"\x1b+(?:\[\[?+[0-?]*[ -/]*|O[0-9;]*)?\Z")
_UNFINISHED_FOR_S = 0.5
"""Time after which a lone escape was the key itself, s, and what comes next does not belong to it."""

_MOST_AT_ONCE = 8
"""Most characters that are pressed at once: more that wait were pasted."""
_LONGEST_PASTE = 500
"""Most characters that are pasted into a text."""


class Keyboard:
    """Reads keys while it is entered; the terminal is as before afterwards. Without a terminal there are no keys.

    Arrow and function keys, and text that is pasted, count as no key: none may arm, disarm or end a session.
    """

    def __init__(self) -> None:
        self._before: list[Any] | None = None
        self._fd = -1
        self._pressed = ""
        self._unfinished = b""
        self._unfinished_s = 0.0

    def __enter__(self) -> Keyboard:
        try:
            self._fd = sys.stdin.fileno() if sys.stdin.isatty() else -1
        except (AttributeError, OSError, ValueError):  # no stdin at all, none of the system's, or a closed one
            self._fd = -1
        if self._fd >= 0:
            self._before = _listen(self._fd)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        fd, self._fd = self._fd, -1
        before, self._before = self._before, None
        if before is not None:
            _restore(fd, before)

    @property
    def available(self) -> bool:
        """Whether there is a terminal whose keys are read."""
        return self._fd >= 0

    def key(self, *, typed: bool = False) -> str:
        """Return the key that was pressed first since the last call; empty if none was.

        Parameters
        ----------
        typed
            Whether it belongs to a text, into which others may be pasted.
        """
        if self._fd < 0:
            return ""
        self._pressed += self._keys_in(_sent(self._fd), _LONGEST_PASTE if typed else _MOST_AT_ONCE)
        key, self._pressed = self._pressed[:1], self._pressed[1:]
        return key

    def _keys_in(self, sent: bytes, most: int = _MOST_AT_ONCE) -> str:
        """Return the characters among what the terminal sent; none where more than so many came at once."""
        now_s = time.monotonic()
        if self._unfinished and now_s - self._unfinished_s > _UNFINISHED_FOR_S:
            self._unfinished = b""
        if not sent:
            return ""
        rest = _ESCAPED.sub(b"", self._unfinished + sent)
        unfinished = _UNFINISHED.search(rest)
        self._unfinished = b"" if unfinished is None else unfinished.group()
        self._unfinished_s = now_s
        keys = rest[: len(rest) - len(self._unfinished)].decode(errors="replace")
        return keys if len(keys) <= most else ""


if sys.platform == "win32":

    def _listen(_fd: int) -> list[Any] | None:
        """Forget what was typed before; the console hands over single keys as it is."""
        while msvcrt.kbhit():
            msvcrt.getwch()
        return None

    def _restore(_fd: int, _before: list[Any]) -> None:
        """Do nothing: nothing was changed."""

    def _sent(_fd: int) -> bytes:
        """Return what was typed since the last call."""
        typed = ""
        while msvcrt.kbhit():
            key = msvcrt.getwch()
            if key not in ("\x00", "\xe0"):
                typed += key
            elif msvcrt.kbhit():
                msvcrt.getwch()  # an arrow or function key: its code follows, and may be a letter
        return typed.encode(errors="replace")

else:

    def _listen(fd: int) -> list[Any] | None:
        """Have keys come one by one and without echo; return the terminal's mode before that."""
        before = termios.tcgetattr(fd)
        tty.setcbreak(fd)  # forgets what was typed before
        mode = termios.tcgetattr(fd)
        mode[0] &= ~termios.IXON  # Ctrl-S would halt the output, and with it whoever writes
        for key in (termios.VSUSP, termios.VQUIT):  # Ctrl-Z would halt the recording
            mode[6][key] = bytes([os.fpathconf(fd, "PC_VDISABLE")])
        termios.tcsetattr(fd, termios.TCSADRAIN, mode)
        return before

    def _restore(fd: int, before: list[Any]) -> None:
        """Set the terminal's mode, and forget what was typed and not read: it was not meant for the shell."""
        # the terminal may be gone: then there is nothing to restore
        with contextlib.suppress(OSError, termios.error):
            termios.tcsetattr(fd, termios.TCSAFLUSH, before)

    def _sent(fd: int) -> bytes:
        """Return what the terminal sent since the last call."""
        try:
            ready, _, _ = select.select([fd], [], [], 0)
            return os.read(fd, 4096) if ready else b""
        except OSError:
            return b""  # the terminal is gone; a session goes on without keys
