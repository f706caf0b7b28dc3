"""What recordings of columns have in common: one time base for all signals, and no raw counts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import MissingChannelError
from recoil_acquisition.timebase import TimeBase
from recoil_acquisition.track import Track


class ColumnRecording(ABC):
    """One opened file whose signals are columns of scaled numbers beside one time; the subclass reads them.

    Attributes
    ----------
    path : Path
        The file.
    """

    path: Path
    _column: Mapping[str, int]
    """Name of a signal -> its column."""

    @property
    @abstractmethod
    def _time_base(self) -> TimeBase:
        """The instants of every column."""

    def _index(self, name: str) -> int:
        try:
            return self._column[name]
        except KeyError:
            raise MissingChannelError(name, tuple(self._column), path=self.path) from None

    def raw(self, name: str, start: int = 0, stop: int | None = None) -> RawCounts | None:  # noqa: ARG002 - of the protocol
        """Return None: the columns hold scaled numbers, no raw counts."""
        self._index(name)
        return None

    def time_base(self, name: str) -> TimeBase:
        """Return the one time base of the file."""
        self._index(name)
        return self._time_base

    def tracks(self) -> tuple[Track, ...]:
        """Return nothing, unless this is a camera's file."""
        return ()
