"""Look at the armed screen: the terminal's size and what somebody wants to see, and styles that it shares."""

from __future__ import annotations

from dataclasses import dataclass

NARROW, LOW = 72, 20
"""Columns and rows of the terminal below which the sources share one line."""
WARNING = "bold red on white not reverse"
CAUTION = "bold yellow"


@dataclass(frozen=True)
class Look:
    """How the range is looked at.

    Attributes
    ----------
    width, height
        Size of the terminal, cells; the last row stays free for the cursor.
    has_keys
        Whether somebody can press keys.
    ascii_only
        Whether the terminal shows no other characters.
    words
        Whether the warnings of the shots are to be read in words, in place of the channels.
    brief
        Whether sources have one line together, so that there is room for something else.
    printed
        Number of the newest notice that is printed above the picture, and is not in it again.
    """

    width: int
    height: int
    has_keys: bool = True
    ascii_only: bool = False
    words: bool = False
    printed: int = 0
    brief: bool = False

    @property
    def narrow(self) -> bool:
        """Whether there is no room for the wide layout."""
        return self.width < NARROW or self.height < LOW
