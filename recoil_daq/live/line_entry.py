"""A line that somebody at the range types, key by key, while the session goes on."""

from __future__ import annotations

from collections.abc import Collection

_ENTER, _BACK = "\r\n", "\b\x7f"


class LineEntry:
    """Answer to a question.

    Parameters
    ----------
    question
        Question, in words.
    takes
        Characters that belong into the answer; every one that can be printed if left out.
    longest
        Most characters of it.

    Attributes
    ----------
    typed
        Text so far.
    """

    def __init__(self, question: str, takes: Collection[str] | None = None, longest: int = 200) -> None:
        self.question, self._takes, self._longest = question, takes, longest
        self.typed = ""

    def press(self, key: str) -> bool:
        """Take a key; return whether the answer is complete."""
        if key and key in _ENTER:
            return True
        if key and key in _BACK:
            self.typed = self.typed[:-1]
        elif key and self.takes(key) and len(self.typed) < self._longest:
            self.typed += key
        return False

    def takes(self, key: str) -> bool:
        """Return whether a character belongs into the answer."""
        return key.isprintable() if self._takes is None else key in self._takes

    def __str__(self) -> str:
        return f"{self.question}: {self.typed}"
