"""Display of a live session: what it is told, and the keys that it reads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from recoil_daq.live.range_state import RangeState


class Display(Protocol):
    """Display of a live session."""

    def show(self, state: RangeState) -> None:
        """Show how it is doing; called about five times per second."""
        ...

    def notice(self, text: str) -> None:
        """Say in one line what happened."""
        ...

    def verdict(self, document: Mapping[str, Any]) -> None:
        """Show the verdict on a shot: what ``ingest --json`` prints."""
        ...

    @property
    def has_keys(self) -> bool:
        """Whether somebody can answer with a key."""
        ...

    def key(self) -> str:
        """Return the key that was pressed since the last call, in lower case; empty if none."""
        ...
