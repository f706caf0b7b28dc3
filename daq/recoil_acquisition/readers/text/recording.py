"""A recorder's text table as a recording: names, units, samples and their instants."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.overload import about_overload
from recoil_acquisition.readers.own_rows import about_rows, own_rows
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.statements import NOTHING, Statements
from recoil_acquisition.readers.text.cells import is_number, unique_names
from recoil_acquisition.readers.text.column_store import ColumnStore
from recoil_acquisition.readers.text.table_layout import TableLayout
from recoil_acquisition.readers.text.text_table import TextBlock
from recoil_acquisition.readers.text.time_base import TimeSource, time_base
from recoil_acquisition.readers.time.time_units import TIME_UNITS_S
from recoil_acquisition.readers.time.wall_clock import Stamps
from recoil_acquisition.remark import Note, NoteCode, Remark

_SAME = 1e-6
"""Relative difference of times that two prints of one may have."""


def text_recording(
    reader: str,
    block: TextBlock,
    layout: TableLayout,
    clock: str,
    metadata: Mapping[str, Any],
    *,
    notes: Sequence[Remark] = (),
    declared: Mapping[str, Any] = MappingProxyType({}),
) -> Recording:
    """Return the recording of a table; its numbers are read when the first sample is asked for.

    Parameters
    ----------
    reader
        Name of the reader.
    block
        Block of the numbers, `TableLayout.block` of a file.
    clock
        Name of the source.
    notes
        Notes that the reader has already.
    declared
        Declarations of the rig on the table, which the metadata give behind how it is written.
    """
    headings, time = layout.headings, layout.time
    left_out = {time.column, *layout.text_columns, *same_times(block, headings, time)}
    own = [i for i in range(len(headings)) if i not in left_out]
    stamps = None if time.parse is None else Stamps(time.parse)
    columns = ColumnStore(
        block, None if stamps is None else stamps.seconds, None if stamps is None else time.column,
        [i for i in range(len(headings)) if i != time.column and (i in left_out or i in block.text_columns)],
        time.remedy or None,
    )  # fmt: skip
    return column_recording(
        reader, columns, clock, headings, time, own, metadata, stamps=stamps, notes=notes, declared=declared,
        beside=dict.fromkeys(own, layout.statements(metadata)),
    )  # fmt: skip


def column_recording(
    reader: str,
    columns: ColumnStore,
    clock: str,
    headings: Sequence[tuple[str, str]],
    time: TimeSource,
    own: Sequence[int],
    metadata: Mapping[str, Any],
    *,
    stamps: Stamps | None = None,
    notes: Sequence[Remark] = (),
    declared: Mapping[str, Any] = MappingProxyType({}),
    beside: Mapping[int, Statements] = MappingProxyType({}),
) -> Recording:
    """Return the recording of some columns of a table that have one time, as `text_recording` does.

    Parameters
    ----------
    columns
        All columns of the table, which recordings of other columns may share.
    own
        Columns of the recording; those that hold text are left out.
    stamps
        Stamps of the column of time; None if it holds none.
    beside
        Statements of the file on the numbers of each column.
    """
    block = columns.block
    written = block.format
    said = {
        **metadata,
        "encoding": written.encoding,
        "separator": written.separator,
        "decimal_mark": "," if written.decimal_comma else ".",
        **declared,
    }
    of_text = {i: block.text_columns[i] for i in own if i in block.text_columns}
    at = [i for i in own if i not in of_text]
    if not at:
        raise ReadError(
            "no column holds numbers beside the time", path=block.file.path,
            found="; ".join(f"{headings[i][0]}: {cell[:40]!r}" for i, cell in of_text.items()),
            remedy="export numbers with a decimal point, or declare `[source.layout]` in the rig",
        )  # fmt: skip
    notes = (*notes, *about_text_columns([name for name, _ in headings], of_text))
    names, repeated = unique_names([headings[i][0] or f"column {i + 1}" for i in at])
    counters = {name: i for name, i in zip(names, at, strict=True) if not headings[i][1]}
    table = _Table(columns, clock, time, stamps, dict(zip(names, at, strict=True)), counters)
    count = block.row_count
    channels = [
        StoredChannel(
            SignalHeader(name, headings[i][1], count),
            table.instants,
            partial(table.columns.column, i),
            overloads=partial(table.overloads, i),
            beside=beside.get(i, NOTHING),
        )
        for name, i in table.column_of.items()
    ]
    return Recording(
        block.file.path, reader, channels, metadata=said, notes=lambda: (*notes, *repeated, *table.notes()),
        incomplete=block.dropped, absolute_start=table.absolute_start,
    )  # fmt: skip


def same_times(block: TextBlock, headings: Sequence[tuple[str, str]], time: TimeSource) -> list[int]:
    """Return the columns that repeat that of time.

    Raises
    ------
    ReadError
        If one has its name, or its name and a number, and other times: each may date the columns behind it, and the
        first alone would be used.
    """
    if time.column is None or not headings[time.column][0]:
        return []
    name, own_unit = headings[time.column]
    numbered = re.compile(re.escape(name) + r"(?:[ _#.-]*[0-9]+)?", re.IGNORECASE)
    again = [
        i
        for i, (other, unit) in enumerate(headings)
        if i > time.column and numbered.fullmatch(other) and (unit == own_unit or unit in TIME_UNITS_S)
    ]
    some_rows = block.some_cells() if again else []
    for i in again:
        unit_s = TIME_UNITS_S.get(headings[i][1], 1.0) / TIME_UNITS_S.get(own_unit, 1.0)
        rows = [(cells[time.column], cells[i]) for cells in some_rows if len(cells) > i]
        other = next((pair for pair in rows if not _same_time(*pair, unit_s)), None)
        if other is not None:
            raise ReadError(
                "several columns of time differ, and which signals each dates is not stated", path=block.file.path,
                expected=f"one column {name!r}", found=f"{other[0]!r} and {other[1]!r} in one row",
                remedy="export all signals over one time, or those of each time into a file of their own",
            )  # fmt: skip
    return again


def _same_time(one: str, other: str, unit: float) -> bool:
    """Return whether two cells are one time, the second in another unit; of stamps, whether they are alike."""
    if one == other and unit == 1.0:
        return True
    numbers = [cell.replace(",", ".") for cell in (one, other)]
    if not all(map(is_number, numbers)):
        return False
    first, second = map(float, numbers)
    return abs(unit * second - first) <= _SAME * max(abs(first), unit)


def about_text_columns(names: Sequence[str], of_text: Mapping[int, str]) -> tuple[Remark, ...]:
    """Return the notes on columns that hold text.

    Parameters
    ----------
    names
        Names of all columns.
    of_text
        Cell of each column of text, one each.
    """
    if not of_text:
        return ()
    shown = ", ".join(f"{names[i] or f'column {i + 1}'} ({cell[:40]!r})" for i, cell in of_text.items())
    return (Note(NoteCode.LEFT_OUT, None, f"columns that hold text were left out: {shown}"),)


class _Table:
    """A table once its numbers are read: their instants, and what is lost."""

    def __init__(
        self,
        columns: ColumnStore,
        clock: str,
        time: TimeSource,
        stamps: Stamps | None,
        column_of: Mapping[str, int],
        counters: Mapping[str, int],
    ) -> None:
        self.columns, self._clock, self._time_source, self.column_of = columns, clock, time, column_of
        self._counters = counters
        self._stamps, self._block = stamps, columns.block

    @cached_property
    def _time(self) -> tuple[TimeBase, tuple[Remark, ...]]:
        """The one time base of the table and what is to say about it."""
        return time_base(self._time_source, self.columns, self._stamps, self._clock, self._counters)

    def instants(self) -> TimeBase:
        return self._time[0]

    def overloads(self, column: int) -> int:
        return int(self.columns.overloads[column])

    def absolute_start(self) -> AbsoluteStart | None:
        return self._time[0].absolute_start

    def notes(self) -> tuple[Remark, ...]:
        over, count = self.columns.overloads, self._block.row_count
        empty = self.columns.lost - over
        losses = [
            note for name, i in self.column_of.items() if empty[i] for note in self._about_empty(name, i, empty[i])
        ]
        losses += [about_overload(name, over[i], count) for name, i in self.column_of.items() if over[i]]
        dropped = [Note(NoteCode.CUT, None, self._block.dropped)] if self._block.dropped else []
        return (*dropped, *losses, *self._time[1])

    def _about_empty(self, name: str, column: int, empty: int) -> tuple[Remark, ...]:
        """Return the notes on a column's empty cells: that it is slower than the table, or what it lost."""
        if 2 * empty + 1 >= (count := self._block.row_count):
            rows = own_rows(samples := self.columns.column(column))
            if rows is not None:
                return about_rows(name, samples, rows)
        return (Note(NoteCode.LOST, name, f"{name}: {empty} of {count} cells are empty: lost samples"),)
