"""The console through which all text of files goes to a terminal: what it would obey is shown as it is spelled."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any

from rich.console import Console
from rich.text import Text

from recoil_acquisition.errors import visible


class VisibleConsole(Console):
    """A console of rich that makes every plain text it is given visible; neither emoji nor highlights."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return text as it is to be shown; rich calls this for every plain text, cells of tables among them."""
        return super().render_str(visible(text), **options)


PIPED_WIDTH = 140
"""Width of a table that no terminal limits, columns."""
_instead: ContextVar[VisibleConsole | None] = ContextVar("instead", default=None)


def output_console() -> Console:
    """Return the console of stdout, as wide as the terminal, or `PIPED_WIDTH` without one."""
    width = None if sys.stdout.isatty() else PIPED_WIDTH
    return _instead.get() or VisibleConsole(width=width)


def shown(show: Callable[[], None]) -> VisibleConsole:
    """Return a console that recorded what a function prints on stdout's; nothing is printed."""
    console = VisibleConsole(file=io.StringIO(), width=PIPED_WIDTH, record=True, force_jupyter=False)
    token = _instead.set(console)
    try:
        show()
    finally:
        _instead.reset(token)
    return console
