"""Dewesoft's text export.

The layout, from exports that users have published: any number of preamble lines, one header row
whose first cell is the time, no unit row, then rows of numbers. A heading is
``<group>/<channel> (<unit>)`` with the unit in the last parentheses; names contain ``/``, spaces
and parentheses. Numbers have up to 15 digits and exponents such as ``E-015``. Relative time reads
``Time (s)``; absolute time reads ``Time (-)``, in whole milliseconds without a zone. Other programs
write the same with a time of day, ``hh:mm:ss.sss``, whose date is not stated: no start is taken from it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import SEPARATORS, has_decimal_comma, is_number, split_cells, split_unit
from recoil_acquisition.readers.text.dewesoft_time import is_absolute, parse_dewesoft_stamp
from recoil_acquisition.readers.text.recording import text_recording
from recoil_acquisition.readers.text.table_layout import TableLayout
from recoil_acquisition.readers.text.time_base import TimeSource
from recoil_acquisition.readers.text_file import HEADER_LINES, LOOKED_AT, LongText
from recoil_acquisition.readers.time.time_units import TIME_UNITS_S
from recoil_acquisition.readers.time.wall_clock import is_time_of_day, parse_time_of_day

_WATERFALL = re.compile(r"waterfall|/orders? \(", re.IGNORECASE)
"""Words in the head of an order-tracking or FFT table."""
_TIME_HEADING = re.compile(r"time\s*(\([^()]*\))?", re.IGNORECASE)
_IN_TIME = re.compile(r"[^()]*[^\W\d_][^()]*\((?:s|ms|us|µs)\)")
_RELATIVE_REMEDY = "export with relative time, column `Time (s)`, or declare its layout in the rig: `[source.layout]`"
_STAMP_REMEDY = "export with relative time, column `Time (s)`, or as .dxd"


def _find_header(lines: Sequence[str]) -> tuple[int, str] | None:
    """Find the header row: its first cell is the time, and the next row is as wide and begins with one.

    Where none is so called, as in another language, a first cell is the time by its unit, over a number.
    """
    return _header(lines, _TIME_HEADING) or _header(lines, _IN_TIME)


def _header(lines: Sequence[str], heading: re.Pattern[str]) -> tuple[int, str] | None:
    for i, (line, following) in enumerate(pairwise(lines)):
        for separator in SEPARATORS:
            cells, row = split_cells(line, separator), split_cells(following, separator)
            if (
                len(cells) > 1
                and heading.fullmatch(cells[0])
                and len(row) > 1
                and (is_number(row[0]) or is_absolute(row[0]) or is_time_of_day(row[0]))
            ):
                return i, separator
    return None


def _is_waterfall(lines: Sequence[str]) -> bool:
    """Return whether it is an order-tracking or FFT waterfall table, which has no time column."""
    return any(_WATERFALL.search(line) for line in lines[:12])


class DewesoftTextReader:
    """Reader of Dewesoft's text export."""

    name = "Dewesoft text export"

    def claims(self, head: Head) -> Claim:
        """Be certain of a time heading over a row that begins with a time, and of a waterfall table.

        A heading of time without a unit, over numbers, is what many programs write; one that the unit alone tells has
        the shape.
        """
        lines = head.lines[: HEADER_LINES + 1]
        if _is_waterfall(lines):
            return Claim.CERTAIN
        found = _find_header(lines)
        if found is None:
            return Claim.NO
        heading, first = (split_cells(lines[found[0] + i], found[1])[0] for i in (0, 1))
        if not _TIME_HEADING.fullmatch(heading):
            return Claim.SHAPE if is_number(first) else Claim.NO
        return Claim.NO if "(" not in heading and is_number(first) else Claim.CERTAIN

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open an export.

        Raises
        ------
        ReadError
            If it is not a time history, or its time column cannot be used.
        CorruptFileError
            If it has no header row or no complete row.
        """
        file = LongText(path)
        lines = file.lines(HEADER_LINES + 1)
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
                expected=f"a first cell `Time (s)` within {HEADER_LINES} lines and numbers below",
            )
        row, separator = found
        lines = file.lines(row + 1 + LOOKED_AT)
        headings = split_cells(lines[row], separator)
        while len(headings) > 2 and not headings[-1]:
            headings.pop()
        rows = [split_cells(line, separator) for line in lines[row + 1 :] if line]
        absolute, of_day = is_absolute(rows[0][0]), is_time_of_day(rows[0][0])
        comma = has_decimal_comma([cells[int(absolute or of_day) :] for cells in rows])
        split = [split_unit(heading) for heading in headings]
        if absolute:
            time = TimeSource(0, parse=parse_dewesoft_stamp, remedy=_STAMP_REMEDY)
        elif of_day:
            time = TimeSource(0, parse=parse_time_of_day, wraps=True, remedy=_RELATIVE_REMEDY)
        else:
            if split[0][1] not in TIME_UNITS_S:
                raise ReadError(
                    "the unit of the time column is unknown", path=path, place=f"line {row + 1}",
                    expected="`Time (s)` or `Time (ms)`", found=repr(headings[0]), remedy=_RELATIVE_REMEDY,
                )  # fmt: skip
            time = TimeSource(0, unit_s=TIME_UNITS_S[split[0][1]], remedy=_RELATIVE_REMEDY)
        layout = TableLayout(
            separator=separator, first_row=row + 1, headings=split, time=time, header_row=row, labels=headings,
            decimal_comma=comma,
        )  # fmt: skip
        return text_recording(self.name, layout.block(file), layout, declared.clock, layout.head(lines))
