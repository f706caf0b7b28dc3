"""Waveforms that oscilloscopes save as text.

Each maker writes a head of its own over a table of numbers; a finder per maker takes the head apart, and the table is
read as every other one. Layouts, as the makers' manuals and files that users have published show them:

- Tektronix (MSO, DPO, MDO, TBS): lines ``key,value``, among them ``Sample Interval`` and ``Vertical Units``, then
  ``TIME,CH1,CH2`` over the rows; digital channels follow behind a second ``TIME``. TDS and TBS1000 put the keys into
  the first two columns beside the first rows: key, value, unit, time, sample.
- Keysight and Agilent: InfiniiVision ``x-axis,1,2`` over ``second,Volt,Volt``; Infiniium lines ``XInc:,1e-09``, behind
  which ``Data:`` begins the rows.
- Rohde & Schwarz (RTB, RTM, HMO): one line ``in s,C1 in V,C2 in V``.
- LeCroy: ``LECROY..,serial,Waveform``, ``Segments,n,SegmentSize,m``, a line for each segment with the instant of its
  trigger since that of the first, ``Time,Ampl``. The time of each segment counts from its own trigger.
- Yokogawa (DLM, DL6000): keys in quotes, ``"HResolution"`` and ``"HOffset"`` of each trace among them; sample k is at
  ``HResolution * (k - 1) + HOffset`` (IM DLM3054-01EN, appendix 3), and the first column is empty or that time.
- PicoScope 6 and 7: ``Time,Channel A``, units in parentheses, an empty line.
- Rigol: ``X,CH1,Start,Increment`` over ``Sequence,Volt,t0,step``, where a number counts the samples from ``t0``;
  ``X,CH1`` over ``Second,Volt``; or ``CH1(V),t0 = .., tInc = ..``.
- Siglent: lines ``key,value``, then ``Source,CH1`` and ``Second,Volt``.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import CorruptFileError, FileEnd, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, StoredChannel
from recoil_acquisition.readers.text.cells import decimals, has_decimal_comma, is_number, number_of, split_cells
from recoil_acquisition.readers.text.recording import text_recording
from recoil_acquisition.readers.text.table_layout import TableLayout
from recoil_acquisition.readers.text.text_table import TextBlock
from recoil_acquisition.readers.text.time_base import TimeSource, rate_of_step
from recoil_acquisition.readers.text_file import HEADER_LINES, LOOKED_AT, LongText
from recoil_acquisition.readers.time.time_units import time_unit_s
from recoil_acquisition.readers.time.wall_clock import about_unread_start, is_dated
from recoil_acquisition.remark import Note, NoteCode, Remark

_SEPARATORS = (",", ";", "\t")
_REMEDY = "save the waveform again"
_APPLIED = frozenset(
    {"verticalscale", "verticaloffset", "probeattenuation", "horizontalscale", "horizontaloffset", "hoffset", "voffset"}
    | {"ydisprange", "ydisporg", "xdisprange", "xdisporg", "horizontalunits", "verticalunits", "xunits", "yunits"}
    | {"xunit", "yunit", "hunit", "vunit"}
)
"""Keys of heads that are of the screen and the probe: the numbers below are in the stated unit."""
_SAME_STEP = 1e-3
"""Relative difference of two statements of a step that are alike."""
MOST_SEGMENTS = 1 << 20
"""Segments of a file that are read at most."""


@dataclass(frozen=True, kw_only=True)
class WaveformTable(TableLayout):
    """Layout of the rows of a waveform, as its head states it.

    Attributes
    ----------
    count
        Number of rows that the head states; None if it states none.
    several
        Number of waveforms that follow each other.
    triggers_s
        Instants of their triggers since the first, s, from which the time column counts in each; empty where the head
        does not state them, and several waveforms are refused.
    number_column
        Column that numbers the rows, from which their instants are counted; None if there is none.
    stated_step_s
        Step that the head states beside the column of time, s; None if it states none.
    """

    count: int | None = None
    notes: tuple[Remark, ...] = ()
    several: int = 1
    triggers_s: tuple[float, ...] = ()
    number_column: int | None = None
    stated_step_s: float | None = None


def _table(
    separator: str,
    first_row: int,
    headings: Sequence[tuple[str, str]],
    *,
    column: int = 0,
    unit_s: float = 1.0,
    start: AbsoluteStart | None = None,
    **more: Any,
) -> WaveformTable:
    """Return the layout of rows with a column of time."""
    time = TimeSource(column, unit_s=unit_s, start=start, remedy=_REMEDY)
    return WaveformTable(
        separator=separator, first_row=first_row, headings=headings, time=time, applied=_APPLIED, **more
    )


def _stepped(
    separator: str, first_row: int, headings: Sequence[tuple[str, str]], start_s: float, step_s: float, **more: Any
) -> WaveformTable:
    """Return the layout of rows whose head alone states their times."""
    rate_hz = rate_of_step(step_s)
    time = TimeSource(None, rate_hz=rate_hz, rate_origin="stated above the rows", start_s=start_s, remedy=_REMEDY)
    return WaveformTable(
        separator=separator, first_row=first_row, headings=headings, time=time, applied=_APPLIED, **more
    )


Lines: TypeAlias = Sequence[str]
Finder: TypeAlias = Callable[[Lines, str], WaveformTable | None]


class OscilloscopeTextReader:
    """Reader of the text of one maker's oscilloscopes."""

    def __init__(self, maker: str, find: Finder) -> None:
        self.name, self._find = f"{maker} oscilloscope text", find

    def claims(self, head: Head) -> Claim:
        """Be certain of a head that its maker alone writes."""
        return Claim.NO if self._found(head.lines[: HEADER_LINES + 1]) is None else Claim.CERTAIN

    def _found(self, lines: Lines) -> WaveformTable | None:
        return next((one for separator in _SEPARATORS if (one := self._find(lines, separator)) is not None), None)

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a waveform.

        Raises
        ------
        ReadError
            If it holds several waveforms one after the other.
        CorruptFileError
            If its head is not there, or no complete row.
        """
        file = LongText(path)
        lines = file.lines(HEADER_LINES + LOOKED_AT)
        table = self._found(lines)
        if table is None:
            raise CorruptFileError(
                "the head of a waveform is not there", path=path, expected=f"one of {self.name}", remedy=_REMEDY
            )
        if 1 < table.several <= MOST_SEGMENTS and not table.triggers_s:
            # of many segments the headings lie beyond the lines that are looked at
            lines = file.lines(table.several + HEADER_LINES + LOOKED_AT)
            table = self._found(lines) or table
        if table.several > 1 and not table.triggers_s:
            raise ReadError(
                f"{table.several} waveforms follow each other in this file", path=path, expected="one",
                remedy="save each in a file of its own",
            )  # fmt: skip
        rows = [split_cells(line, table.separator) for line in lines[table.first_row :] if line.strip()]
        comma = table.separator != "," and has_decimal_comma(rows)
        table = replace(table, decimal_comma=comma)
        block = table.block(file)
        if table.count is not None and block.row_count < table.count:
            missing = f"{table.count - block.row_count} of the stated {table.count} rows are not in the file"
            block = replace(block, dropped="; ".join(filter(None, (block.dropped, missing))))
        if table.number_column is not None:
            _refuse_missing_rows(block, table.number_column)
        notes = (*table.notes, *_about_head(table, rows, block.row_count))
        if table.several > 1:
            return _segmented(self.name, block, declared.clock, table, table.head(lines[:HEADER_LINES]))
        return text_recording(self.name, block, table, declared.clock, table.head(lines[:HEADER_LINES]), notes=notes)


def _refuse_missing_rows(block: TextBlock, column: int) -> None:
    """Refuse rows of which some are missing by their numbers: those behind them would be dated early."""
    cells = [row[column] for row in block.some_cells() if len(row) > column and is_number(row[column])]
    first, last = (number_of(cell) for cell in (*cells[:1], *cells[-1:])) if cells else (None, None)
    if first is not None and last is not None and last - first + 1 != block.row_count:
        raise CorruptFileError(
            "rows are missing by their numbers", path=block.file.path, place=f"line {block.first_line}",
            expected=f"{last - first + 1:g} rows, from number {first:g} to {last:g}", found=f"{block.row_count}",
            remedy=_REMEDY,
        )  # fmt: skip


def _about_head(table: WaveformTable, rows: Sequence[Sequence[str]], count: int) -> list[Remark]:
    """Say where what the head states is not what stands below it: the rows count."""
    notes: list[Remark] = []
    if table.count is not None and count > table.count and table.several == 1:
        text = f"the head states {table.count} rows, and {count} are there"
        notes.append(Note(NoteCode.CONTRADICTION, None, text))
    at, unit_s = table.time.column, table.time.unit_s or 1.0
    if table.stated_step_s is None or at is None:
        return notes
    cells = [row[at].replace(",", ".") for row in rows[:2] if len(row) > at and is_number(row[at])]
    if len(cells) < 2:
        return notes
    step_s = unit_s * (float(cells[1]) - float(cells[0]))
    digit_s = unit_s * 10.0 ** -max(map(decimals, cells))
    if abs(step_s - table.stated_step_s) > _SAME_STEP * table.stated_step_s + digit_s:
        text = f"the head states a step of {table.stated_step_s:g} s, the column of time has {step_s:g} s: it counts"
        notes.append(Note(NoteCode.CONTRADICTION, None, text))
    return notes


def _segmented(
    reader: str, block: TextBlock, clock: str, table: WaveformTable, metadata: Mapping[str, Any]
) -> Recording:
    """Return the waveforms of a file as one record with gaps, each at the instant of its trigger."""
    numbered = TimeSource(None, rate_hz=1.0, rate_origin="none", remedy=_REMEDY)
    rows = text_recording(reader, block, replace(table, time=numbered), clock, metadata)
    time, *signals = rows.signals
    instants = partial(_instants_of_segments, rows, time.name, table, clock)
    channels = [
        StoredChannel(
            header, instants, partial(_read, rows, header.name),
            overloads=partial(rows.overloads, header.name), beside=rows.statements(header.name),
        )
        for header in signals
    ]  # fmt: skip
    text = f"{table.several} segments, each at the time of its trigger since the first"
    notes = [Note(NoteCode.TIME, None, text), *table.notes]
    if block.dropped:
        notes.insert(0, Note(NoteCode.CUT, None, block.dropped))
    return Recording(
        rows.path, reader, channels, metadata=dict(metadata), notes=lambda: notes, incomplete=block.dropped,
        absolute_start=table.time.start,
    )  # fmt: skip


def _read(rows: Recording, name: str, start: int, stop: int) -> NDArray[np.float64]:
    return rows.read(name, start, stop)


def _instants_of_segments(rows: Recording, time: str, table: WaveformTable, clock: str) -> TimeBase:
    """Return the instants of all segments: a time that does not go on begins the next one."""
    own_s = (table.time.unit_s or 1.0) * rows.read(time)
    if not np.all(np.isfinite(own_s)):
        row = int(np.flatnonzero(~np.isfinite(own_s))[0])
        raise CorruptFileError("a row has no time", path=rows.path, place=f"row {row + 1}", remedy=_REMEDY)
    begins = np.flatnonzero(np.diff(own_s) <= 0) + 1
    if begins.size >= table.several:
        raise CorruptFileError(
            "more segments follow each other than the head states", path=rows.path, place=f"row {begins[-1] + 1}",
            expected=f"{table.several}", found=f"{begins.size + 1}", remedy=_REMEDY,
        )  # fmt: skip
    _refuse_missing_segments(rows.path, np.diff(np.r_[0, begins, own_s.size]), table)
    segment = np.zeros(own_s.size, dtype=np.int64)
    segment[begins] = 1
    times_s = own_s + np.array(table.triggers_s)[np.cumsum(segment)]
    back = np.flatnonzero(np.diff(times_s) <= 0)
    if back.size:
        raise CorruptFileError(
            "a segment begins before the one before it ends", path=rows.path, place=f"row {back[0] + 2}",
            expected=f"more than {times_s[back[0]]:.9g} s", found=f"{times_s[back[0] + 1]:.9g} s", remedy=_REMEDY,
        )  # fmt: skip
    return TimeBase.stamped(clock, times_s, table.time.start)


def _refuse_missing_segments(path: Path, sizes: NDArray[np.int64], table: WaveformTable) -> None:
    """Refuse segments of which one between others may be missing, for those behind it would have its trigger's time.

    A file that was cut off ends within a segment, and all that it has are the first ones.
    """
    size = 0 if table.count is None else table.count // table.several
    longer = np.flatnonzero(sizes > size)
    if size and longer.size:
        raise CorruptFileError(
            "a segment is longer than the head states", path=path, place=f"segment {longer[0] + 1}",
            expected=f"{size} rows", found=f"{sizes[longer[0]]}", remedy=_REMEDY,
        )  # fmt: skip
    if sizes.size < table.several and (not size or sizes[-1] == size):
        raise CorruptFileError(
            "segments are missing, and the rows do not show which", path=path, file_end=FileEnd.MISSING,
            expected=f"{table.several}", found=f"{sizes.size}", remedy=_REMEDY,
        )  # fmt: skip


def _count(cell: str) -> int | None:
    value = number_of(cell)
    return None if value is None or not 0 < value < 1e12 else round(value)


def _first_row(lines: Lines, at: int) -> int:
    """Return the index of the next line that is not empty."""
    while at < len(lines) and not lines[at].strip():
        at += 1
    return at


def _without_empty_end(cells: list[str]) -> list[str]:
    end = len(cells)
    while end > 2 and not cells[end - 1]:
        end -= 1
    return cells[:end]


def _keys(lines: Lines, separator: str) -> Mapping[str, list[str]]:
    """Return the cells behind each key of the lines of a head, a comment sign before it taken off."""
    cells = (split_cells(line.lstrip("#"), separator) for line in lines)
    return {row[0].casefold(): row[1:] for row in cells if len(row) > 1 and row[0]}


def _tektronix(lines: Lines, separator: str) -> WaveformTable | None:
    """Find ``TIME,CH1`` below the keys; or the keys beside the first rows."""
    beside = _tektronix_beside(lines, separator)
    if beside is not None:
        return beside
    for at, line in enumerate(lines[:HEADER_LINES]):
        cells = _without_empty_end(split_cells(line.lstrip("#"), separator))
        if len(cells) < 2 or cells[0].casefold() != "time":
            continue
        keys = _keys(lines[:at], separator)
        unit = next(iter(keys.get("horizontal units", ["s"])), "s").casefold() or "s"
        if "sample interval" not in keys or "record length" not in keys or time_unit_s(unit) is None:
            return None
        units = keys.get("vertical units", [])
        again = next((i for i, cell in enumerate(cells[1:], 1) if cell.casefold() == "time"), len(cells))
        if [bool(one) for one in (*keys["sample interval"], *units)].count(True) == 2 and units[:1] != [""]:
            # each key has one value, for all channels
            units = units[:1] * (len(cells) - 1)
        headings = [(cell, units[i - 1] if 0 < i <= len(units) else "") for i, cell in enumerate(cells)]
        left_out = [i for i, cell in enumerate(cells) if i >= again or not cell]
        dropped = ", ".join(cell for cell in cells[again + 1 :] if cell)
        note = Note(NoteCode.LEFT_OUT, None, f"columns of a second time were left out: {dropped}")
        gated = keys.get("gating", ["0.0% to 100.0%"])[0].replace(" ", "") != "0.0%to100.0%"
        return _table(
            separator, _first_row(lines, at + 1), tuple(headings), unit_s=time_unit_s(unit) or 1.0,
            count=None if gated else _count(keys["record length"][0]), text_columns=tuple(left_out),
            stated_step_s=number_of(keys["sample interval"][0]) if unit == "s" else None,
            notes=(note,) if dropped else (),
        )  # fmt: skip
    return None


_KEYS_BESIDE = 20
"""Rows beside which the keys stand, of a TDS or TBS1000."""


def _tektronix_beside(lines: Lines, separator: str) -> WaveformTable | None:
    rows = [split_cells(line, separator) for line in lines[:2]]
    named = [row[0].casefold() for row in rows if len(row) >= 5 and is_number(row[3]) and is_number(row[4])]
    if named != ["record length", "sample interval"]:
        return None
    keys = _keys(lines[:HEADER_LINES], separator)
    if "source" not in keys and len(lines) < _KEYS_BESIDE:
        return None
    name, unit = keys.get("source", [""])[0] or "waveform", keys.get("vertical units", [""])[0]
    headings = (("key", ""), ("value", ""), ("unit", ""), ("time", "s"), (name, unit))
    return _table(separator, 0, headings, column=3, count=_count(rows[0][1]), text_columns=(0, 1, 2))


def _keysight(lines: Lines, separator: str) -> WaveformTable | None:
    """Find ``x-axis`` over a row of units, or the keys of Infiniium with ``Data:`` below them."""
    names = _without_empty_end(split_cells(lines[0], separator)) if lines else []
    units = _without_empty_end(split_cells(lines[1], separator)) if len(lines) > 1 else []
    if names[:1] == ["x-axis"] and len(names) == len(units) > 1 and time_unit_s(units[0]) is not None:
        headings = tuple(zip(names, units, strict=True))
        return _table(separator, _first_row(lines, 2), headings, unit_s=time_unit_s(units[0]) or 1.0)
    return _infiniium(lines, separator)


_INFINIIUM_KEY = re.compile(r"\s*([A-Za-z][A-Za-z ]*?)\s*:\s*[,;\t]?\s*(.*?)[\s,;]*")


def _infiniium(lines: Lines, separator: str) -> WaveformTable | None:
    keys: dict[str, str] = {}
    for at, line in enumerate(lines[:HEADER_LINES]):
        found = _INFINIIUM_KEY.fullmatch(line)
        if found is None:
            continue
        keys[found[1].casefold()] = found[2]
        if found[1].casefold().endswith("data") and not found[2]:
            step, start = number_of(keys.get("xinc", "")), number_of(keys.get("xorg", ""))
            unit = keys.get("x units", keys.get("xunits", "second"))
            first = _first_row(lines, at + 1)
            if step is None or start is None or time_unit_s(unit) is None or first >= len(lines):
                return None
            cells = _without_empty_end(split_cells(lines[first], separator))
            if len(cells) != 2 or not all(map(is_number, cells)):
                return None
            heading = ("waveform", keys.get("y units", keys.get("yunits", "")))
            return _table(
                separator, first, (("time", unit), heading), unit_s=time_unit_s(unit) or 1.0,
                count=_count(keys.get("points", "")), stated_step_s=step * (time_unit_s(unit) or 1.0),
            )  # fmt: skip
    return None


_ROHDE = re.compile(r"(.+?) in ([^\s].*)")


def _rohde_schwarz(lines: Lines, separator: str) -> WaveformTable | None:
    """Find ``in s`` before ``name in unit``."""
    cells = _without_empty_end(split_cells(lines[0], separator)) if lines else []
    names = [_ROHDE.fullmatch(cell) for cell in cells[1:]]
    if not names or cells[0] != "in s" or None in names:
        return None
    headings = (("time", "s"), *((one[1], one[2]) for one in names if one is not None))
    return _table(separator, _first_row(lines, 1), headings)


_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_TRIGGER = re.compile(r"(\d{1,2})-([A-Za-z]{3})-(\d{4}) (\d{1,2}):(\d{2}):(\d{2})")


def _lecroy(lines: Lines, separator: str) -> WaveformTable | None:
    """Find ``Time,Ampl`` below the segments of a file that begins with the maker's name."""
    if len(lines) < 5 or not lines[0].startswith("LECROY") or not lines[0].rstrip().endswith("Waveform"):
        return None
    counts = split_cells(lines[1], separator)
    if len(counts) < 4 or counts[0] != "Segments" or (segments := _count(counts[1])) is None:
        return None
    at = 3 + segments
    cells = _without_empty_end(split_cells(lines[at], separator)) if at < len(lines) else []
    if cells[:1] != ["Time"] or len(cells) < 2:
        # of many segments the headings lie beyond the lines that are looked at
        return None if segments <= HEADER_LINES - 4 else _many_segments(separator, segments)
    stamps = [split_cells(line, separator) for line in lines[3:at]]
    headings = tuple((cell, "s" if i == 0 else "") for i, cell in enumerate(cells))
    size = _count(counts[3])
    stated = stamps[0][1] if stamps and len(stamps[0]) > 1 else ""
    start = _trigger(stated)
    since_s = [number_of(cells[2]) if len(cells) > 2 else None for cells in stamps]
    triggers_s = tuple(one for one in since_s if one is not None)
    return _table(
        separator, _first_row(lines, at + 1), headings, count=None if size is None else size * segments,
        start=start, several=segments,
        notes=(about_unread_start("TrigTime", stated),) if start is None and is_dated(stated) else (),
        triggers_s=triggers_s if len(triggers_s) == segments else (),
    )  # fmt: skip


def _many_segments(separator: str, segments: int) -> WaveformTable:
    return _table(separator, 0, (("Time", "s"), ("Ampl", "")), several=segments)


def _trigger(text: str) -> AbsoluteStart | None:
    found = _TRIGGER.fullmatch(text)
    if found is None or found[2].casefold() not in _MONTHS:
        return None
    day, year, hour, minute, second = (int(found[i]) for i in (1, 3, 4, 5, 6))
    try:
        instant = dt.datetime(year, _MONTHS.index(found[2].casefold()) + 1, day, hour, minute, second)
    except ValueError:
        return None
    return AbsoluteStart(instant.isoformat(timespec="seconds"), "unknown", "TrigTime of the segment")


def _yokogawa(lines: Lines, separator: str) -> WaveformTable | None:
    """Find the keys of the traces; the rows begin behind the last of them."""
    keys: dict[str, list[str]] = {}
    last = -1
    for at, line in enumerate(lines[:HEADER_LINES]):
        cells = split_cells(line, separator)
        if not cells[0] or is_number(cells[0]):
            break
        keys[cells[0]] = [cell for cell in cells[1:] if cell]
        last = at
    names = keys.get("TraceName", [])
    wanted = ("Model Name", "BlockSize", "HResolution", "HOffset", "HUnit")
    if not names or any(key not in keys or (key != "Model Name" and not keys[key]) for key in wanted):
        return None
    steps, starts = [number_of(one) for one in keys["HResolution"]], [number_of(one) for one in keys["HOffset"]]
    unit_s = time_unit_s(keys["HUnit"][0])
    first = _first_row(lines, last + 1)
    if unit_s is None or first >= len(lines) or not steps[0] or starts[0] is None:
        return None
    if len(set(steps)) > 1 or len(set(starts)) > 1:
        return None
    units = keys.get("VUnit", [])
    traces = [(name, units[i] if i < len(units) else "") for i, name in enumerate(names)]
    width = len(_without_empty_end(split_cells(lines[first], separator)))
    leads = width > len(names)
    return _stepped(
        separator, first, tuple([("number", ""), *traces] if leads else traces), starts[0] * unit_s, steps[0] * unit_s,
        count=_count(keys["BlockSize"][0]), text_columns=(0,) if leads else (),
        several=_count(next(iter(keys.get("BlockNumber", [])), "")) or 1,
    )  # fmt: skip


_PICO_NAME = re.compile(r"(?:Channel|Kanal|Canal|Canale|Voie) [A-H]\b.*")


def _picoscope(lines: Lines, separator: str) -> WaveformTable | None:
    """Find names over units in parentheses over an empty line."""
    if len(lines) < 4 or lines[2].strip():
        return None
    names, units = (_without_empty_end(split_cells(line, separator)) for line in lines[:2])
    bare = [re.fullmatch(r"\((.*)\)", unit) for unit in units]
    if len(names) != len(units) or None in bare or not any(map(_PICO_NAME.fullmatch, names[1:])):
        return None
    spelled = [one[1] for one in bare if one is not None]
    unit_s = time_unit_s(spelled[0])
    if unit_s is None:
        return None
    headings = tuple(zip(names, spelled, strict=True))
    return _table(separator, 3, headings, unit_s=unit_s)


_T0 = re.compile(r"t0\s*=\s*([-+.\deE]+)\s*s?")
_T_INC = re.compile(r"tInc\s*=\s*([-+.\deE]+)\s*s?")
_NAME_AND_UNIT = re.compile(r"(.+?)\s*\(([^()]*)\)")


def _rigol(lines: Lines, separator: str) -> WaveformTable | None:
    """Find start and increment beside the names, or below them."""
    names = _without_empty_end(split_cells(lines[0], separator)) if lines else []
    below = split_cells(lines[1], separator) if len(lines) > 1 else []
    if names[:1] == ["X"] and names[-2:] == ["Start", "Increment"] and below[:1] == ["Sequence"]:
        count = len(names) - 2
        start, step = (number_of(cell) for cell in (*below[count : count + 2], "", "")[:2])
        if start is None or not step or count < 2:
            return None
        headings = tuple((name, "" if i == 0 else below[i]) for i, name in enumerate(names[:count]))
        number = number_of(split_cells(lines[2], separator)[0]) if len(lines) > 2 else None
        return _stepped(
            separator, 2, headings, start + step * (number or 0.0), step, text_columns=(0,), number_column=0
        )
    if names[:1] == ["X"] and below[:1] == ["Second"] and 1 < len(names) <= len(below):
        return _table(separator, 2, tuple(zip(names, below, strict=False)))
    if len(names) < 3 or not (first := _T0.fullmatch(names[-2])) or not (step_cell := _T_INC.fullmatch(names[-1])):
        return None
    split = [_NAME_AND_UNIT.fullmatch(name) for name in names[:-2]]
    start, step = number_of(first[1]), number_of(step_cell[1])
    if None in split or start is None or not step or names[0].casefold().startswith("time"):
        return None
    headings = tuple((one[1], one[2]) for one in split if one is not None)
    return _stepped(separator, 1, headings, start, step)


_SIGLENT_UNIT = re.compile(r"(CH\d+|Math|F\d)\s*:\s*(\S+?)(?=[\s,]|$)")


def _siglent(lines: Lines, separator: str) -> WaveformTable | None:
    """Find ``Second`` before the words for the channels, below lines of keys."""
    for at, line in enumerate(lines[:HEADER_LINES]):
        cells = _without_empty_end(split_cells(line, separator))
        if len(cells) < 2 or cells[0] != "Second" or is_number(cells[1]):
            continue
        keys = _keys(lines[:at], separator)
        stated = " ".join(" ".join(keys.get(key, [])) for key in ("vertical units", "vertical scale"))
        names = [one for one in keys.get("source", []) if one] or re.findall(r"CH\d+(?=\s*:)", stated)
        length = next(iter(keys.get("record length", [])), "")
        if len(names) != len(cells) - 1 or not ("source" in keys or length.startswith("Analog:")):
            return None
        units = dict(_SIGLENT_UNIT.findall(" ".join(keys.get("vertical units", []))))
        headings = [("time", "s")]
        for name, word in zip(names, cells[1:], strict=True):
            headings.append((name, units.get(name, "" if word == "Value" else word)))
        interval = next(iter(keys.get("sample interval", [])), "").removeprefix("Analog:")
        return _table(
            separator, _first_row(lines, at + 1), tuple(headings),
            count=_count(length.removeprefix("Analog:")), stated_step_s=number_of(interval),
        )  # fmt: skip
    return None


TEKTRONIX = OscilloscopeTextReader("Tektronix", _tektronix)
KEYSIGHT = OscilloscopeTextReader("Keysight", _keysight)
ROHDE_SCHWARZ = OscilloscopeTextReader("Rohde & Schwarz", _rohde_schwarz)
LECROY = OscilloscopeTextReader("LeCroy", _lecroy)
YOKOGAWA = OscilloscopeTextReader("Yokogawa", _yokogawa)
PICOSCOPE = OscilloscopeTextReader("PicoScope", _picoscope)
RIGOL = OscilloscopeTextReader("Rigol", _rigol)
SIGLENT = OscilloscopeTextReader("Siglent", _siglent)
