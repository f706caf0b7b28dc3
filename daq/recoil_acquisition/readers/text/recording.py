"""A recorder's text table as a recording: names, units, samples and their instants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.column_recording import ColumnRecording
from recoil_acquisition.readers.reader import SignalHeader
from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.readers.text.column_store import ColumnStore
from recoil_acquisition.readers.text.text_table import Block
from recoil_acquisition.readers.text.time_base import TimeSource, time_base
from recoil_acquisition.readers.time.wall_clock import Stamps
from recoil_acquisition.timebase import AbsoluteStart, TimeBase


class TextRecording(ColumnRecording):
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
        self.path, self.reader, self.metadata = block.file.path, reader, metadata
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
        return self._time_base.absolute_start

    @property
    def _time_base(self) -> TimeBase:
        return self._time[0]

    @cached_property
    def _time(self) -> tuple[TimeBase, tuple[str, ...]]:
        """The one time base of the file and what is to say about it."""
        return time_base(self._time_source, self._columns, self._stamps, self._clock)

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read samples of one signal in the file's unit, lost ones NaN, shape (stop - start,)."""
        return self._columns.column(self._index(name), start, stop)
