"""Dewesoft's text export.

The layout, from exports that users have published: any number of preamble lines, one header row
whose first cell is the time, no unit row, then rows of numbers. A heading is
``<group>/<channel> (<unit>)`` with the unit in the last parentheses; names contain ``/``, spaces
and parentheses. Numbers have up to 15 digits and exponents such as ``E-015``. Relative time reads
``Time (s)``; absolute time reads ``Time (-)``, in whole milliseconds without a zone.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.channel import RawCounts
from daq.errors import CorruptFileError, MissingChannelError, ReadError
from daq.readers.dewesoft_time import is_absolute, rate_from_stamps, seconds_from_first
from daq.readers.printed_time import uniform_from_printed
from daq.readers.reader import Declarations, SignalHeader
from daq.readers.text_file import TextFile, decode_head, read_text
from daq.readers.text_table import (
    SEPARATORS,
    find_block,
    has_decimal_comma,
    is_number,
    printed_decimals,
    read_block,
    split_cells,
    split_unit,
    unique_names,
)
from daq.timebase import AbsoluteStart, TimeBase
from daq.track import Track

PREAMBLE_LINES = 60
"""Lines in which the header row is sought."""

TIME_UNITS_S = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6}

_TIME_HEADING = re.compile(r"time\s*(\([^()]*\)|\[[^\[\]]*\])?", re.IGNORECASE)
_RELATIVE_REMEDY = "export with relative time, column `Time (s)`, or as .dxd"


def _find_header(lines: Sequence[str]) -> tuple[int, str] | None:
    """Find the header row: its first cell is the time, and the next row is as wide and begins with one."""
    for i, (line, following) in enumerate(pairwise(lines)):
        for separator in SEPARATORS:
            cells, row = split_cells(line, separator), split_cells(following, separator)
            if (
                len(cells) > 1
                and _TIME_HEADING.fullmatch(cells[0])
                and len(row) > 1
                and (is_number(row[0]) or is_absolute(row[0]))
            ):
                return i, separator
    return None


def _is_waterfall(lines: Sequence[str]) -> bool:
    """Tell an order-tracking or FFT waterfall table, which has no time column."""
    return any("waterfall" in line.casefold() or re.search(r"/orders? \(", line.casefold()) for line in lines[:12])


class DewesoftTextReader:
    """Reader of Dewesoft's text export."""

    name = "Dewesoft text export"
    kind = "dewetron"
    suffixes = (".csv", ".txt")

    def claims(self, head: bytes) -> bool:
        """Tell whether a time heading over a row that begins with a time is in the first lines."""
        lines = decode_head(head).split("\n")[: PREAMBLE_LINES + 1]
        return _find_header(lines) is not None or _is_waterfall(lines)

    def open(self, path: Path, declared: Declarations) -> DewesoftTextRecording:
        """Open an export.

        Raises
        ------
        ReadError
            If it is not a time history, or its time column cannot be used.
        CorruptFileError
            If it has no header row or no complete row.
        """
        file = read_text(path)
        lines = file.lines(0, PREAMBLE_LINES + 1)
        found = _find_header(lines)
        if found is None and _is_waterfall(lines):
            raise ReadError(
                "this is an order-tracking or FFT waterfall table, not a time history", path=path,
                remedy="export the channels over time",
            )  # fmt: skip
        if found is None:
            raise CorruptFileError(
                "no header row",
                path=path,
                expected=f"a first cell `Time (s)` within {PREAMBLE_LINES} lines and numbers below",
            )
        return DewesoftTextRecording(file, declared.clock, *found)


class DewesoftTextRecording:
    """One opened text export; its numbers are read when the first sample is asked for.

    Parameters
    ----------
    file : TextFile
    clock : str
        Name of the source.
    header_row : int
        Index of the header row among the lines.
    separator : str
    """

    reader = DewesoftTextReader.name

    def __init__(self, file: TextFile, clock: str, header_row: int, separator: str) -> None:
        lines = file.lines(0, header_row + 4)
        headings = split_cells(lines[header_row], separator)
        while len(headings) > 2 and not headings[-1]:
            headings.pop()
        self._clock = clock
        rows = [split_cells(line, separator) for line in lines[header_row + 1 :] if line]
        start = 0
        for _ in range(header_row + 1):
            start = file.data.find(b"\n", start) + 1
        self._absolute = is_absolute(rows[0][0])
        comma = has_decimal_comma([row[int(self._absolute) :] for row in rows], separator)
        self._block = find_block(file, start, separator, headings, decimal_comma=comma)
        split = [split_unit(heading) for heading in headings]
        names, self._name_notes = unique_names([name for name, _ in split[1:]])
        self.signals = tuple(
            SignalHeader(name, unit, self._block.row_count) for name, (_, unit) in zip(names, split[1:], strict=True)
        )
        self._column = {name: i for i, name in enumerate(names, start=1)}
        self._time_heading, self._time_unit = headings[0], split[0][1]
        self.metadata: Mapping[str, Any] = {
            "preamble": lines[:header_row],
            "header": lines[header_row],
            "encoding": file.encoding,
            "separator": separator,
            "decimal_mark": "," if comma else ".",
        }

    @property
    def path(self) -> Path:
        """The file."""
        return self._block.file.path

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user must know: repeated names, a row left out, lost samples, how time was found."""
        lost = np.isnan(self._table[0][:, 1:]).sum(axis=0)
        losses = tuple(
            f"{header.name}: {count} of {header.sample_count} cells are empty: lost samples"
            for header, count in zip(self.signals, lost.tolist(), strict=True)
            if count
        )
        dropped = (self._block.dropped,) if self._block.dropped else ()
        return (*self._name_notes, *dropped, *losses, *self._time[1])

    @property
    def incomplete(self) -> str:
        """How it shows that the file was cut off; empty if nothing shows that."""
        return self._block.dropped

    @property
    def absolute_start(self) -> AbsoluteStart | None:
        """Wall-clock time of the first row, if the time column is absolute."""
        return self._time[0].absolute_start

    @cached_property
    def _table(self) -> tuple[NDArray[np.float64], list[str]]:
        return read_block(self._block, text_first_column=self._absolute)

    @cached_property
    def _time(self) -> tuple[TimeBase, tuple[str, ...]]:
        """The one time base of the file and what is to say about it."""
        return self._absolute_time() if self._absolute else self._relative_time()

    def _absolute_time(self) -> tuple[TimeBase, tuple[str, ...]]:
        cells = self._table[1]
        try:
            seconds, first, resolution_s = seconds_from_first(cells)
        except ValueError as error:
            row = error.args[1] if len(error.args) > 1 else 0
            raise CorruptFileError(
                str(error.args[0]), path=self.path, place=f"line {self._block.first_line + row}, time column",
                remedy=_RELATIVE_REMEDY,
            ) from error  # fmt: skip
        try:
            rate_hz, others = rate_from_stamps(seconds, resolution_s)
        except ValueError as error:
            raise ReadError(
                f"absolute time is not fine enough: {error}",
                path=self.path,
                place="time column",
                remedy=_RELATIVE_REMEDY,
            ) from error
        start = AbsoluteStart(first.isoformat(timespec="milliseconds"), "unknown", "first row of the time column")
        note = f"absolute time resolves only {resolution_s:g} s: time was rebuilt from the row number at {rate_hz:g} Hz"
        doubt = f"the record is too short to exclude {', '.join(f'{rate:g}' for rate in others)} Hz"
        return TimeBase.uniform(self._clock, 0.0, 1.0 / rate_hz, seconds.size, start), (note, doubt) if others else (
            note,
        )

    def _relative_time(self) -> tuple[TimeBase, tuple[str, ...]]:
        if self._time_unit not in TIME_UNITS_S:
            raise ReadError(
                "the unit of the time column is unknown", path=self.path, place=f"line {self._block.first_line - 1}",
                expected="`Time (s)` or `Time (ms)`", found=repr(self._time_heading),
                remedy=_RELATIVE_REMEDY,
            )  # fmt: skip
        factor = TIME_UNITS_S[self._time_unit]
        printed = self._table[0][:, 0]
        if np.isnan(printed).any():
            row = int(np.flatnonzero(np.isnan(printed))[0])
            raise CorruptFileError(
                "the time is missing", path=self.path, place=f"line {self._block.first_line + row}, time column"
            )
        times_s = printed * factor
        resolution_s = factor * 10.0 ** -printed_decimals(self._block, 0)
        uniform = uniform_from_printed(times_s, resolution_s)
        if uniform is not None:
            return TimeBase.uniform(self._clock, *uniform, times_s.size), ()
        steps = np.diff(times_s)
        if (steps <= 0).any():
            row = int(np.flatnonzero(steps <= 0)[0]) + 1
            raise CorruptFileError(
                "time does not increase", path=self.path, place=f"line {self._block.first_line + row}, time column",
                expected=f"more than {printed[row - 1]:g}", found=f"{printed[row]:g}",
                remedy="export with more decimals, one sample rate and one recording per file",
            )  # fmt: skip
        base = TimeBase.stamped(self._clock, times_s)
        if times_s.size < 2:
            return base, ("there is one row only: no sample rate",)
        gaps = int((steps > 1.5 * np.median(steps)).sum())
        note = f"steps of time differ by more than their printed digits ({gaps} gaps): instants are as printed"
        return base, (note,)

    def _index(self, name: str) -> int:
        try:
            return self._column[name]
        except KeyError:
            raise MissingChannelError(name, tuple(self._column), path=self.path) from None

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read samples of one signal in the file's unit, lost ones NaN, shape (stop - start,)."""
        column = self._index(name)
        return np.ascontiguousarray(self._table[0][start:stop, column])

    def raw(self, name: str) -> RawCounts | None:
        """Return None: a text export holds no raw counts."""
        self._index(name)
        return None

    def time_base(self, name: str) -> TimeBase:
        """Return the one time base of the file."""
        self._index(name)
        return self._time[0]

    def tracks(self) -> tuple[Track, ...]:
        """Return nothing: this is no camera."""
        return ()
