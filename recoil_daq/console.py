"""The console through which all text of files goes to a terminal: what it would obey is shown as it is spelled."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.text import Text

from recoil_acquisition.visible_text import visible


class VisibleConsole(Console):
    """A console of rich that makes every plain text it is given visible; neither emoji nor highlights."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return text as it is to be shown; rich calls this for every plain text, cells of tables among them."""
        return super().render_str(visible(text), **options)
