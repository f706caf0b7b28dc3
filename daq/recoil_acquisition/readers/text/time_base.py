"""The time base of a text table: printed relative time, stamps of a wall clock, or the row number."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.row_counter import CountedRows, first_counter, over_gaps
from recoil_acquisition.readers.text.column_store import ColumnStore
from recoil_acquisition.readers.text.dewesoft_time import rate_from_stamps, spread_s
from recoil_acquisition.readers.text.text_table import printed_decimals
from recoil_acquisition.readers.time.printed_time import PART_ROWS, Times, start_agreeing, uniform_from_printed
from recoil_acquisition.readers.time.time_units import DAY_S, MOST_S
from recoil_acquisition.readers.time.wall_clock import DateOrder, Stamp, Stamps, two_dates
from recoil_acquisition.remark import Note, NoteCode, Remark

FINE_STEPS = 50
"""Resolutions of a stamp that a step must be for the stamps to be taken as printed instants."""


@dataclass(frozen=True)
class TimeSource:
    """Source of the time of a table's rows.

    Attributes
    ----------
    column
        Column of time; None where the rate alone is declared.
    unit_s
        Unit of a relative time; None if the column holds stamps, or there is none.
    parse
        Function that reads a stamp; None if the column holds none.
    rate_hz
        Sample rate that the file or the rig states.
    rate_origin
        Origin of the rate, in words.
    start
        Start that the file states apart from the column.
    origin
        Origin of the stamps, in words.
    wraps
        Whether stamps are times of day, which begin anew at midnight.
    remedy
        Advice to the user if the time cannot be used.
    start_s
        Time of the first row where no column holds it, s.
    """

    column: int | None
    unit_s: float | None = None
    parse: Callable[[str], Stamp] | None = None
    rate_hz: float | None = None
    rate_origin: str = ""
    start: AbsoluteStart | None = None
    origin: str = "first row of the time column"
    wraps: bool = False
    remedy: str = ""
    start_s: float = 0.0

    def uniform(self, path: Path, clock: str, count: int, even_s: tuple[float, float] | None = None) -> TimeBase:
        """Return even instants: from its start on by its rate, or by another start and step, s.

        Raises
        ------
        CorruptFileError
            If no recording has them, or float64 does not tell them apart.
        """
        rate_hz = self.rate_hz or math.nan
        start_s, step_s = even_s or (self.start_s, 1.0 / rate_hz)
        found = f"{count} rows from {start_s:.9g} s on, {step_s:.9g} s apart"
        if not (step_s > 0 and max(abs(start_s), abs(start_s + step_s * count)) < MOST_S):
            raise CorruptFileError(
                "the stated time is that of no recording", path=path, found=found, remedy=self.remedy,
                expected=f"a step above 0 and times below {MOST_S:g} s",
            )  # fmt: skip
        try:
            return TimeBase.uniform(clock, start_s, step_s, count, self.start)
        except ValueError as error:
            raise CorruptFileError(
                "the stated times cannot be told apart", path=path, found=found, remedy=self.remedy,
                expected="a start that is nearer to 0",
            ) from error  # fmt: skip


def rate_of_step(step_s: float) -> float:
    """Return the rate of a step as it was meant, Hz: to the twelve digits that a printed step has at most."""
    return float(f"{1.0 / step_s:.12g}") if step_s else math.inf


class PrintedColumn:
    """A column of printed times in seconds, read some at a time: all of it may be more than memory should hold.

    Parameters
    ----------
    unit_s
        Unit of the print.
    """

    def __init__(self, columns: ColumnStore, column: int, unit_s: float) -> None:
        self._columns, self.column, self.unit_s = columns, column, unit_s

    @property
    def size(self) -> int:
        """Number of rows."""
        return self._columns.block.row_count

    def __getitem__(self, part: slice, /) -> NDArray[np.float64]:
        """Return the times of some rows."""
        printed = self._columns.column(self.column, part.start or 0, part.stop)
        return printed if self.unit_s == 1.0 else printed * self.unit_s


def time_base(
    source: TimeSource,
    columns: ColumnStore,
    stamps: Stamps | None,
    clock: str,
    counters: Mapping[str, int] = MappingProxyType({}),
) -> tuple[TimeBase, tuple[Remark, ...]]:
    """Find the time base of a table's rows, and what is to say about it.

    Parameters
    ----------
    counters
        Columns, by name, of which one may count rows that a rate dates.

    Raises
    ------
    ReadError
        If the rows' instants are not stated finely enough.
    CorruptFileError
        If a time is missing, time does not increase, or it contradicts the stated rate; if a counter of the rows was
        set back.
    """
    rows = columns.block.row_count
    if source.column is None:
        if source.rate_hz is None:
            raise ReadError(
                "there is no time column and no sample rate", path=columns.block.file.path, remedy=source.remedy
            )
        base, note = source.uniform(columns.block.file.path, clock, rows), _row_number(source)
        counted = _counted(columns, counters)
        if counted is None:
            return base, (note,)
        path, first_line = columns.block.file.path, columns.block.first_line
        base, about = over_gaps(
            *counted, partial(source.uniform, path, clock), path, lambda row: f"line {first_line + row}"
        )
        return base, (note, about)
    _check_complete(columns, source.column)
    if stamps is None:
        return _from_relative(source, columns, PrintedColumn(columns, source.column, source.unit_s or 1.0), clock)
    column = PrintedColumn(columns, source.column, 1.0)
    seconds: Times = np.unwrap(column[:], period=DAY_S) if source.wraps else column
    base, notes = _from_stamps(source, columns, stamps, seconds, clock)
    return base, (*notes, *_about_order(stamps.first))


def _about_order(first: Stamp | None) -> tuple[Remark, ...]:
    """Say that the start is not known, where the first stamp may be of either of two days."""
    if first is None or first.order is not DateOrder.OPEN:
        return ()
    text = f"whether the first date is {two_dates(first)} is not told: the start is not known"
    return (Note(NoteCode.TIME, None, text),)


def _row_number(source: TimeSource) -> Note:
    return Note(NoteCode.TIME, None, f"time is the row number over {source.rate_hz:g} Hz, {source.rate_origin}")


def _counted(columns: ColumnStore, counters: Mapping[str, int]) -> tuple[str, CountedRows] | None:
    whole = {name: partial(columns.column, i) for name, i in counters.items() if not columns.lost[i]}
    return first_counter(whole, columns.block.row_count)


def _check_complete(columns: ColumnStore, column: int) -> None:
    if columns.lost[column]:
        row = int(np.flatnonzero(np.isnan(columns.column(column)))[0])
        raise CorruptFileError("the time is missing", path=columns.block.file.path, place=_place(columns, row))


def _place(columns: ColumnStore, row: int) -> str:
    return f"line {columns.block.first_line + row}, time column"


def _from_relative(
    source: TimeSource, columns: ColumnStore, printed: PrintedColumn, clock: str
) -> tuple[TimeBase, tuple[Remark, ...]]:
    path = columns.block.file.path
    resolution_s = printed.unit_s * 10.0 ** -printed_decimals(columns.block, printed.column)
    _refuse_no_time(columns, printed)
    if source.rate_hz is not None:
        start_s = start_agreeing(printed, 1.0 / source.rate_hz, resolution_s)
        if start_s is not None:
            return source.uniform(path, clock, printed.size, (start_s, 1.0 / source.rate_hz)), ()
        _refuse_backwards(columns, printed)
        first_s, last_s = printed[:1][0], printed[printed.size - 1 :][0]
        raise CorruptFileError(
            "the time column contradicts the sample rate", path=path,
            expected=f"{source.rate_hz:g} Hz, {source.rate_origin}",
            found=f"rows from {first_s:g} s to {last_s:g} s", remedy=source.remedy,
        )  # fmt: skip
    uniform = uniform_from_printed(printed, resolution_s)
    if uniform is not None:
        return source.uniform(path, clock, printed.size, uniform), ()
    return _as_printed(source, columns, columns.column(printed.column), printed[:], clock)


def _refuse_no_time(columns: ColumnStore, printed: PrintedColumn) -> None:
    """Refuse a first or last time that no recording has: those between them lie between, or go back."""
    for row in (0, printed.size - 1):
        value_s = float(printed[row : row + 1][0])
        if not abs(value_s) < MOST_S:
            raise CorruptFileError(
                "the time is longer than any recording", path=columns.block.file.path, place=_place(columns, row),
                expected=f"less than {MOST_S:g} s", found=f"{value_s:g} s",
                remedy="correct the unit of the time column, or export it again",
            )  # fmt: skip


def _as_printed(
    source: TimeSource, columns: ColumnStore, printed: NDArray[np.float64], times_s: NDArray[np.float64], clock: str
) -> tuple[TimeBase, tuple[Remark, ...]]:
    """Take instants as printed, where they agree with no constant step."""
    _refuse_backwards(columns, times_s)
    steps = np.diff(times_s)
    if (steps <= 0).any():
        row = int(np.flatnonzero(steps <= 0)[0]) + 1
        raise CorruptFileError(
            "time does not increase", path=columns.block.file.path, place=_place(columns, row),
            expected=f"more than {printed[row - 1]:g}", found=f"{printed[row]:g}",
            remedy="export with more decimals, one sample rate and one recording per file",
        )  # fmt: skip
    base = TimeBase.stamped(clock, times_s, source.start)
    if times_s.size < 2:
        return base, (Note(NoteCode.TIME, None, "there is one row only: no sample rate"),)
    gaps = int((steps > 1.5 * np.median(steps)).sum())
    text = f"steps of time differ by more than their printed digits ({gaps} gaps): instants are as printed"
    return base, (Note(NoteCode.TIME, None, text),)


def _refuse_backwards(columns: ColumnStore, seconds: Times) -> None:
    """Refuse times that go back: another recording was put behind the first one, or the clock was set."""
    for at in range(0, seconds.size - 1, PART_ROWS):
        part = seconds[at : at + PART_ROWS + 1]
        back = np.flatnonzero(np.diff(part) < 0)
        if back.size:
            row = int(back[0]) + 1
            raise CorruptFileError(
                "time does not increase: a second recording begins, or the clock was set back",
                path=columns.block.file.path, place=_place(columns, at + row),
                expected=f"more than {part[row - 1]:g} s", found=f"{part[row]:g} s",
                remedy="take the recordings apart there, or export one recording per file",
            )  # fmt: skip


def _usual_step(seconds: Times) -> float:
    """Return the median step between neighbours: that of the parts' medians, where all would take too much memory."""
    parts = (seconds[at : at + PART_ROWS + 1] for at in range(0, seconds.size - 1, PART_ROWS))
    return float(np.median([np.median(np.diff(part)) for part in parts]))


def _from_stamps(
    source: TimeSource, columns: ColumnStore, stamps: Stamps, seconds: Times, clock: str
) -> tuple[TimeBase, tuple[Remark, ...]]:
    path, resolution_s = columns.block.file.path, stamps.resolution_s
    _refuse_backwards(columns, seconds)
    if source.start is None and stamps.start is not None and not source.wraps:
        source = replace(source, start=AbsoluteStart(stamps.start.text, stamps.start.zone, source.origin))
    if source.rate_hz is not None:
        spread = spread_s(seconds, source.rate_hz)
        if spread > resolution_s * (1 + 1e-6) + 1e-9:
            raise CorruptFileError(
                "the time column contradicts the sample rate", path=path, place="time column",
                expected=f"{source.rate_hz:g} Hz, {source.rate_origin}", found=f"stamps up to {spread:g} s off",
                remedy=source.remedy,
            )  # fmt: skip
        return source.uniform(path, clock, seconds.size, (0.0, 1.0 / source.rate_hz)), (_row_number(source),)
    if seconds.size > 1 and _usual_step(seconds) >= FINE_STEPS * resolution_s:
        uniform = uniform_from_printed(seconds, resolution_s)
        if uniform is None:
            return _as_printed(source, columns, seconds[:], seconds[:], clock)
        return source.uniform(path, clock, seconds.size, uniform), ()
    try:
        rate_hz, others = rate_from_stamps(seconds, resolution_s)
    except ValueError as error:
        over_gaps = _over_gaps(source, columns, seconds[:], resolution_s, clock)
        if over_gaps is not None:
            return over_gaps
        raise ReadError(
            f"absolute time is not fine enough: {error}", path=path, place="time column", remedy=source.remedy
        ) from error
    texts = [f"absolute time resolves only {resolution_s:g} s: time was rebuilt from the row number at {rate_hz:g} Hz"]
    if others:
        texts.append(f"the record is too short to exclude {', '.join(f'{rate:g}' for rate in others)} Hz")
    base = source.uniform(path, clock, seconds.size, (0.0, 1.0 / rate_hz))
    return base, tuple(Note(NoteCode.TIME, None, text) for text in texts)


def _over_gaps(
    source: TimeSource, columns: ColumnStore, times_s: NDArray[np.float64], resolution_s: float, clock: str
) -> tuple[TimeBase, tuple[Remark, ...]] | None:
    """Rebuild instants of rows of which some are missing; None if the stamps are not those of one rate with gaps.

    The longest stretch without a gap tells the rate, and every stamp must be of a row of it.

    Raises
    ------
    CorruptFileError
        If a gap is one of whole hours: then the clock was set, as at the begin of summer time.
    """
    steps, usual_s = np.diff(times_s), _usual_step(times_s)
    gaps = np.flatnonzero(steps > 1.5 * usual_s)
    if usual_s < 2.0 * resolution_s or not gaps.size:
        return None
    ends = np.array([0, *(gaps + 1), times_s.size])
    longest = int(np.argmax(np.diff(ends)))
    try:
        rate_hz, _ = rate_from_stamps(times_s[ends[longest] : ends[longest + 1]], resolution_s)
    except ValueError:
        return None
    row = np.rint((times_s - times_s[0]) * rate_hz)
    if np.ptp(times_s - row / rate_hz) > resolution_s * (1 + 1e-6) + 1e-9 or (np.diff(row) < 1).any():
        return None
    lost_s = steps[gaps] - usual_s
    hours = np.rint(lost_s / 3600.0)
    set_at = np.flatnonzero((hours > 0) & (np.abs(lost_s - 3600.0 * hours) <= 2.0 * resolution_s))
    if set_at.size:
        gap = int(set_at[0])
        raise CorruptFileError(
            f"the clock jumps by {lost_s[gap]:g} s, as at the begin of summer time", path=columns.block.file.path,
            place=_place(columns, int(gaps[gap]) + 1), expected="stamps of a clock that is not set",
            remedy="export with time in UTC or from the start, or take the recordings apart there",
        )  # fmt: skip
    first, lost = int(gaps[0]), int(row[-1]) + 1 - row.size
    several = "gap" if gaps.size == 1 else f"gaps, the first of {steps[first]:g} s"
    text = (
        f"{lost} rows are missing in {gaps.size} {several} before {_place(columns, first + 1)}: absolute time resolves "
        f"{resolution_s:g} s, and instants are those of {rate_hz:g} Hz"
    )
    return TimeBase.stamped(clock, row / rate_hz, source.start), (Note(NoteCode.LOST, None, text),)
