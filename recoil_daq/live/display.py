"""Display of a live session: what it is told, and the keys that it reads."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any, Protocol

from recoil_daq.live.notice_board import Notice
from recoil_daq.live.range_state import RangeState


class Display(Protocol):
    """Display of a live session."""

    def show(self, state: RangeState) -> None:
        """Show how it is doing; called about five times per second."""
        ...

    def notice(self, text: str, same: Hashable = None) -> None:
        """Say in one line what happened; lines that are the same but for their numbers have one `same`."""
        ...

    def verdict(self, document: Mapping[str, Any]) -> None:
        """Show the verdict on a shot: what ``ingest --json`` prints."""
        ...

    @property
    def noticed(self) -> tuple[Notice, ...]:
        """The newest notices that it was given, the oldest first: the range's state has them."""
        ...

    @property
    def has_keys(self) -> bool:
        """Whether somebody can answer with a key."""
        ...

    def key(self, *, typed: bool = False) -> str:
        """Return the key that was pressed since the last call, in lower case; empty if none.

        Parameters
        ----------
        typed
            Whether it belongs to a text that is typed: then it is as it was pressed, and means nothing else.
        """
        ...
