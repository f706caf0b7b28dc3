"""Single keys from the terminal, without echo and without waiting."""

from __future__ import annotations

import os
import sys
from types import TracebackType
from typing import Any


class Keyboard:
    """Reads keys while it is entered; the terminal is as before afterwards. Without a terminal there are no keys."""

    def __init__(self) -> None:
        self._before: list[Any] | None = None
        self._fd = -1

    def __enter__(self) -> Keyboard:
        try:
            self._fd = sys.stdin.fileno() if sys.stdin.isatty() else -1
        except (AttributeError, OSError, ValueError):
            self._fd = -1
        if self._fd >= 0 and os.name != "nt":
            import termios
            import tty

            self._before = termios.tcgetattr(self._fd)
            tty.setcbreak(self._fd)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            import termios

            termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)
            self._before = None

    def key(self) -> str:
        """Return the key that was pressed first since the last call, in lower case; empty if none was."""
        if self._fd < 0:
            return ""
        if sys.platform == "win32":
            import msvcrt

            return msvcrt.getwch().lower() if msvcrt.kbhit() else ""
        import select

        ready, _, _ = select.select([self._fd], [], [], 0)
        return os.read(self._fd, 1).decode(errors="replace").lower() if ready else ""
