"""A recorder's text table as a recording: names, units, samples and their instants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.channel import RawCounts
from daq.errors import MissingChannelError
from daq.readers.reader import SignalHeader
from daq.readers.text.cells import unique_names
from daq.readers.text.column_store import ColumnStore
from daq.readers.text.text_table import Block
from daq.readers.text.time_base import TimeSource, time_base
from daq.readers.time.wall_clock import Stamps
from daq.timebase import AbsoluteStart, TimeBase
from daq.track import Track


class TextRecording:
    """One opened table; its numbers are read when the first sample is asked for.

    Parameters
    ----------
    reader : str
        Name of the reader.
    block : Block
        Where the numbers are.
    clock : str
        Name of the source.
    headings : sequence of (str, str)
        Name and unit of every column of the block.
    time : TimeSource
    metadata : mapping
    text_columns : sequence of int
        Columns that hold no numbers; they are left out, as is the column of time.
    notes : sequence of str
        What the reader has to say already.
    """

    def __init__(
        self,
        reader: str,
        block: Block,
        clock: str,
        headings: Sequence[tuple[str, str]],
        time: TimeSource,
        metadata: Mapping[str, Any],
        *,
        text_columns: Sequence[int] = (),
        notes: Sequence[str] = (),
    ) -> None:
        self.reader, self.metadata = reader, metadata
        self._block, self._clock, self._time_source, self._first_notes = block, clock, time, tuple(notes)
        left_out = {time.column, *text_columns}
        at = [i for i in range(len(headings)) if i not in left_out]
        names, self._name_notes = unique_names([headings[i][0] or f"column {i + 1}" for i in at])
        self._column = dict(zip(names, at, strict=True))
        self.signals = tuple(
            SignalHeader(name, headings[i][1], block.row_count) for name, i in zip(names, at, strict=True)
        )
        self._stamps = None if time.parse is None else Stamps(time.parse)
        stamp_column = None if self._stamps is None else time.column
        seconds = None if self._stamps is None else self._stamps.seconds
        self._columns = ColumnStore(block, seconds, stamp_column, text_columns, time.remedy or None)

    @property
    def path(self) -> Path:
        """The file."""
        return self._block.file.path

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user must know: repeated names, a row left out, lost samples, how time was found."""
        lost = self._columns.lost
        losses = tuple(
            f"{header.name}: {lost[i]} of {header.sample_count} cells are empty: lost samples"
            for header, i in zip(self.signals, self._column.values(), strict=True)
            if lost[i]
        )
        dropped = (self._block.dropped,) if self._block.dropped else ()
        return (*self._first_notes, *self._name_notes, *dropped, *losses, *self._time[1])

    @property
    def incomplete(self) -> str:
        """How it shows that the file was cut off; empty if nothing shows that."""
        return self._block.dropped

    @property
    def absolute_start(self) -> AbsoluteStart | None:
        """Wall-clock time of the first row, if the file states it."""
        return self._time[0].absolute_start

    @cached_property
    def _time(self) -> tuple[TimeBase, tuple[str, ...]]:
        """The one time base of the file and what is to say about it."""
        return time_base(self._time_source, self._columns, self._stamps, self._clock)

    def _index(self, name: str) -> int:
        try:
            return self._column[name]
        except KeyError:
            raise MissingChannelError(name, tuple(self._column), path=self.path) from None

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read samples of one signal in the file's unit, lost ones NaN, shape (stop - start,)."""
        return self._columns.column(self._index(name), start, stop)

    def raw(self, name: str, start: int = 0, stop: int | None = None) -> RawCounts | None:  # noqa: ARG002 - of the protocol
        """Return None: a text table holds no raw counts."""
        self._index(name)
        return None

    def time_base(self, name: str) -> TimeBase:
        """Return the one time base of the file."""
        self._index(name)
        return self._time[0]

    def tracks(self) -> tuple[Track, ...]:
        """Return nothing: this is no camera."""
        return ()
