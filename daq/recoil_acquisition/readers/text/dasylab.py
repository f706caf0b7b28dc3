"""DASYLab's ASCII files.

The layout, as published readers of them know it: ``DASYLab - V ...``, keys padded before ``:``, among them
``Recording date``, ``Delta`` (the step of the samples) and ``Number of channels``, a row of headings
``name [unit];`` with a separator at its end, and rows of numbers. A variant has the headings alone, between
tabs, its first column ``Measurement time[s]``. The stated number of channels may be wrong: the headings count.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import has_decimal_comma, split_cells, split_unit
from recoil_acquisition.readers.text.recording import text_recording
from recoil_acquisition.readers.text.table_layout import TableLayout
from recoil_acquisition.readers.text.time_base import TimeSource, rate_of_step
from recoil_acquisition.readers.text_file import HEADER_LINES, LOOKED_AT, LongText
from recoil_acquisition.readers.time.time_units import TIME_UNITS_S
from recoil_acquisition.readers.time.wall_clock import DateOrder, parse_time_of_day, parse_wall_clock
from recoil_acquisition.remark import Note, NoteCode, Remark

_NAME = "DASYLab"
_DATE, _TIME = "date", "measurement time"
"""Names of the first columns, in small letters."""
_DELTA_KEY, _DATE_KEY, _CHANNELS_KEY = "delta", "recording date", "number of channels"
"""Keys of the preamble, in small letters."""
_TIME_OF_DAY = "hh:mm:ss"
_KEY = re.compile(r"([^:;\t]{1,60}?)\s*:\s*(.*)")
_DELTA = re.compile(r"([\d.,]+(?:[eE][+-]?\d+)?)\s*(\S+)")
_REMEDY = "export relative time in seconds"


def find_headings(lines: Sequence[str]) -> tuple[int, str] | None:
    """Find the row of headings: it has a column of measurement time, with a date at most before it."""
    for i, line in enumerate(lines[:HEADER_LINES]):
        for separator in ("\t", ";", ","):
            names = [split_unit(cell)[0].casefold() for cell in split_cells(line, separator)]
            if len(names) > 1 and (names[0] == _TIME or names[:2] == [_DATE, _TIME]):
                return i, separator
    return None


def _keys(lines: Sequence[str]) -> dict[str, str]:
    """Return the keys of the preamble, in lower case, and their texts."""
    matches = (_KEY.fullmatch(line.strip()) for line in lines)
    return {match[1].casefold(): match[2].strip() for match in matches if match is not None}


def step_from(text: str) -> float | None:
    """Return the step in seconds that ``Delta`` states, such as ``0.2 sec.``; None if it states none that is known."""
    match = _DELTA.fullmatch(text.strip())
    if match is None or match[2].casefold() not in TIME_UNITS_S:
        return None
    try:
        step_s = float(match[1].replace(",", ".")) * TIME_UNITS_S[match[2].casefold()]
    except ValueError:
        return None
    return step_s if 1e-12 < step_s < 1e12 else None


def start_from(text: str) -> AbsoluteStart | None:
    """Return the start that ``Recording date`` states; None if it states none, or not which number is the day."""
    try:
        stamp = parse_wall_clock(text)
    except ValueError:
        return None
    if stamp.order is DateOrder.OPEN:
        return None
    return AbsoluteStart(stamp.text, stamp.zone, "`Recording date` of the preamble")


class DasylabTextReader:
    """Reader of DASYLab's ASCII files."""

    name = "DASYLab ASCII"

    def claims(self, head: Head) -> Claim:
        """Be certain of a text that begins with DASYLab's name, or with a heading of measurement time."""
        is_own = head.text.startswith(_NAME) or find_headings(head.lines[:2]) is not None
        return Claim.CERTAIN if is_own else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file.

        Raises
        ------
        ReadError
            If neither ``Delta`` nor the column of time states the rate.
        CorruptFileError
            If it has no row of headings or no complete row, or its time contradicts ``Delta``.
        """
        file = LongText(path)
        lines = file.lines(HEADER_LINES + LOOKED_AT)
        found = find_headings(lines)
        if found is None:
            raise CorruptFileError(
                "no row of headings", path=path, remedy="export with headings",
                expected=f"a column `Measurement time[...]` within {HEADER_LINES} lines",
            )  # fmt: skip
        row, separator = found
        cells = split_cells(lines[row], separator)
        while len(cells) > 2 and not cells[-1]:
            cells.pop()
        headings = [split_unit(cell) for cell in cells]
        has_date = headings[0][0].casefold() == _DATE
        if len(headings) < 2 + has_date:
            raise CorruptFileError(
                "there is no channel", path=path, place=f"line {row + 1}", found=repr(lines[row][:60])
            )
        keys, at = _keys(lines[:row]), int(has_date)
        samples = [split_cells(line, separator) for line in lines[row + 1 : row + 1 + LOOKED_AT] if line.strip()]
        timed = headings[at][1].casefold() == _TIME_OF_DAY
        comma = has_decimal_comma([cells[at + timed :] for cells in samples])
        time, notes = self._time(keys, headings[at], at, path)
        channels = len(headings) - 1 - at
        stated = keys.get(_CHANNELS_KEY)
        if stated is not None and stated != str(channels):
            text = f"the preamble states {stated} channels, the headings name {channels}: the headings count"
            notes.append(Note(NoteCode.CONTRADICTION, None, text))
        layout = TableLayout(
            separator=separator, first_row=row + 1, headings=headings, time=time, header_row=row,
            labels=[f"{n} [{u}]" if u else n for n, u in headings], text_columns=range(at), decimal_comma=comma,
        )  # fmt: skip
        return text_recording(self.name, layout.block(file), layout, declared.clock, layout.head(lines), notes=notes)

    def _time(
        self, keys: dict[str, str], heading: tuple[str, str], at: int, path: Path
    ) -> tuple[TimeSource, list[Remark]]:
        """Return where time comes from, and what to say about the preamble."""
        step_s: float | None = None
        notes: list[Remark] = []
        if _DELTA_KEY in keys:
            step_s = step_from(keys[_DELTA_KEY])
            if step_s is None:
                text = f"`Delta` states no step that is known: {keys[_DELTA_KEY]!r}"
                notes.append(Note(NoteCode.TIME, None, text))
        start = start_from(keys.get(_DATE_KEY, ""))
        if _DATE_KEY in keys and start is None:
            text = f"the order of day and month of `Recording date` is not stated: {keys[_DATE_KEY]!r}"
            notes.append(Note(NoteCode.TIME, None, text))
        rate_hz = None if step_s is None else rate_of_step(step_s)
        origin = "from `Delta` of the preamble"
        unit = heading[1]
        if unit.casefold() == _TIME_OF_DAY:
            return TimeSource(
                at, parse=parse_time_of_day, rate_hz=rate_hz, rate_origin=origin, start=start, wraps=True,
                remedy=_REMEDY,
            ), notes  # fmt: skip
        if unit not in TIME_UNITS_S:
            raise ReadError(
                "the unit of the time column is unknown", path=path, expected="`Measurement time[s]` or `[hh:mm:ss]`",
                found=repr(unit), remedy=_REMEDY,
            )  # fmt: skip
        return TimeSource(
            at, unit_s=TIME_UNITS_S[unit], rate_hz=rate_hz, rate_origin=origin, start=start, remedy=_REMEDY
        ), notes
