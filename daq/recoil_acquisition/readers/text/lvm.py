"""LabVIEW measurement files, as LabVIEW and SignalExpress write them.

Layout: NI, Specification for the LabVIEW Measurement File (.lvm): lines of a key and its values between tabs; the head
of the file ends with ``***End_of_Header***``, and so does that of each segment, which states for each channel
``Samples``, ``Date``, ``Time``, ``Y_Unit_Label``, ``X_Dimension``, ``X0`` and ``Delta_X``. A row ``X_Value`` names the
columns, the last of which holds comments; rows of numbers follow up to an empty line. ``X_Columns`` says whether there
is a column of time for all channels (``One``), one for each (``Multi``), or none (``No``): then time is ``X0`` and
``Delta_X``. By ``Time_Pref`` a column counts from its channels' date and time (``Relative``), or from 1904. With
``Multi_Headings`` ``No`` further rows follow under the first head, so that it counts too few of them.

Files leave out the tab before an empty comment, state no ``Decimal_Separator``, and date channels without samples to
1903: what a row holds decides, and what a head says of a channel without samples is not taken for its time.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import CorruptFileError, NoSignalError, ReadError
from recoil_acquisition.readers.bounded_file import most_unpacked
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.statements import Statements
from recoil_acquisition.readers.text.cells import (
    decimals,
    has_decimal_comma,
    is_number,
    number_of,
    split_cells,
    unique_names,
    whole_number,
)
from recoil_acquisition.readers.text.column_store import ColumnStore
from recoil_acquisition.readers.text.lvm_segment import X_VALUE, Segment
from recoil_acquisition.readers.text.recording import column_recording, same_times
from recoil_acquisition.readers.text.text_table import find_block
from recoil_acquisition.readers.text.time_base import TimeSource, rate_of_step
from recoil_acquisition.readers.text_file import LOOKED_AT, TextFile, read_text
from recoil_acquisition.readers.time.wall_clock import DateOrder, parse_wall_clock
from recoil_acquisition.remark import Note, NoteCode, Remark

FIRST_LINE = "LabVIEW Measurement"
_END = b"***End_of_Header***"
_SPECIAL = re.compile(rb"(?m)^\*\*\*(?:Start|(End))_Special\*\*\*[^\n]*\n?")
_FOLLOWING = rb"(?:Channels|Samples|Notes|Test_|UUT_|Model_|Date|Time|\*\*\*)"
"""Words that begin the head of another segment."""
_SEPARATORS = {"tab": "\t", "comma": ","}
_REMEDY = "copy the file again, or save it as TDMS"
MOST_SEGMENTS = 10_000
"""Segments of a file that are read at most: each takes a millisecond, whatever is in it."""
_MORE_DIGITS = re.compile(r"(\.\d{9})\d+")
"""Digits of a second beyond those of a nanosecond."""
_BEFORE = re.compile(r"190[0-4]/")
"""Begin of a date that is LabVIEW's time zero, in some zone: it dates nothing."""
_FIRST_YEAR = 1905
"""Year before which a date is that of LabVIEW's time zero, 1904, in some zone: it dates nothing."""
_SINCE_1904 = dt.datetime(1904, 1, 1, tzinfo=dt.UTC)
_ABSOLUTE_S = 1e9
"""Value of an X column from which on it counts the seconds since 1904, which it passed in 1935."""


@dataclass(frozen=True)
class _FileHead:
    """Head of a file: its keys, and how rows are written."""

    keys: Mapping[str, str]
    separator: str
    x_columns: str
    size: int
    """Number of its bytes."""


class LvmReader:
    """Reader of LabVIEW measurement files."""

    name = "LabVIEW measurement"

    def claims(self, head: Head) -> Claim:
        """Be certain of the first line."""
        return Claim.CERTAIN if head.text.startswith(FIRST_LINE) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file.

        Raises
        ------
        NoSignalError
            If nothing in it is over time.
        CorruptFileError
            If it has no head or no row, or its segments do not go together.
        """
        file = read_text(path)
        head = _file_head(file)
        segments, rest = _segments(file, head)
        if not segments:
            raise CorruptFileError(
                "there is no segment of samples", path=path,
                expected="a row `X_Value` below a second `***End_of_Header***`", remedy=_REMEDY,
            )  # fmt: skip
        parts = [_parts(segment, head, declared.clock, path) for segment in segments]
        said = {"header": dict(head.keys), "segments": len(parts)}
        return _joined(path, parts, said, "; ".join(filter(None, (file.cut, rest))), declared.clock)


def _file_head(file: TextFile) -> _FileHead:
    """Read the head of a file; CorruptFileError if it does not end."""
    end = file.data.find(_END)
    if end < 0 or not file.data.startswith(FIRST_LINE.encode()):
        raise CorruptFileError(
            "the head of the file does not end", path=file.path, expected="***End_of_Header***", remedy=_REMEDY
        )
    text = file.data[:end].decode(file.encoding, errors="replace")
    keys = {}
    for line in text.splitlines()[1:]:
        key, _, value = line.partition("\t") if "\t" in line else line.partition(",")
        if key.strip():
            keys[key.strip()] = value.strip(" \t,")
    separator = _SEPARATORS.get(keys.get("Separator", "Tab").casefold())
    x_columns = keys.get("X_Columns", "One").casefold()
    if separator is None or x_columns not in ("no", "one", "multi"):
        found = f"Separator {keys.get('Separator')!r}, X_Columns {keys.get('X_Columns')!r}"
        raise CorruptFileError("the head of the file is not understood", path=file.path, found=found, remedy=_REMEDY)
    behind = file.data.find(b"\n", end) + 1
    return _FileHead(keys, separator, x_columns, behind or file.size)


def _segments(file: TextFile, head: _FileHead) -> tuple[list[Segment], str]:
    """Return the segments of a file in its order, and what stands behind the last of them; empty if nothing does."""
    data, at, counted, line = file.data, head.size, 0, 1
    found: list[Segment] = []
    while (end := data.find(_END, at)) >= 0:
        keys = _segment_keys(_without_special(data[at:end]), file.encoding, head.separator)
        names_at = data.find(b"\n", end) + 1
        start = data.find(b"\n", names_at) + 1
        if not names_at or not start or not data.startswith(X_VALUE.encode(), names_at):
            break
        names = split_cells(data[names_at : start - 1].decode(file.encoding, errors="replace"), head.separator)
        while names and (not names[-1] or names[-1].casefold() == "comment"):
            names.pop()
        stop = _rows_end(data, start, head.separator.encode())
        line += data.count(b"\n", counted, start)
        counted = start
        rows = _of_one_width(data[start:stop], len(names), head.separator.encode(), file.path, line)
        if not rows.strip() or len(names) < 2:
            break
        if len(found) == MOST_SEGMENTS:
            raise ReadError(
                f"more than {MOST_SEGMENTS} segments", path=file.path, place=f"line {line}",
                remedy="save with one heading for all rows, or as TDMS",
            )  # fmt: skip
        found.append(Segment(keys, tuple(names), replace(file, data=rows, cut=""), line))
        at = stop
    behind = data[at:].lstrip(b" \n" + head.separator.encode())
    line = data.count(b"\n", 0, len(data) - len(behind)) + 1
    rest = f"line {line} begins what is no whole segment: it is cut off" if found and behind else ""
    return found, rest


def _without_special(text: bytes) -> bytes:
    """Return a head without its special blocks; one that does not end is none."""
    kept, at, begin = [], 0, -1
    for mark in _SPECIAL.finditer(text):
        if mark[1] is None:
            begin = mark.start() if begin < 0 else begin
        elif begin >= 0:
            kept.append(text[at:begin])
            at, begin = mark.end(), -1
    return b"".join([*kept, text[at:]])


def _segment_keys(text: bytes, encoding: str, separator: str) -> dict[str, list[str]]:
    rows = (split_cells(line, separator) for line in text.decode(encoding, errors="replace").split("\n"))
    return {row[0]: row[1:] for row in rows if row[0]}


def _rows_end(data: bytes, start: int, separator: bytes) -> int:
    """Return the byte behind the rows: before an empty line, one of separators alone, or the head that follows."""
    blank = rb"[ \r" + re.escape(separator) + rb"]*$"
    found = re.compile(rb"(?m)^(?:" + blank + rb"|" + _FOLLOWING + rb")").search(data, start)
    return len(data) if found is None else found.start()


def _of_one_width(rows: bytes, width: int, separator: bytes, path: Path, first_line: int) -> bytes:
    """Return rows without what stands behind their last column; empty cells that a row leaves out are filled in.

    Raises
    ------
    ReadError
        If they leave out so many that filled in they would take a multiple of the file.
    """
    cell = rb"[^" + re.escape(separator) + rb"\n]*"
    commented = re.compile(
        rb"(?m)^((?:" + cell + separator + rb"){%d}" % (width - 1) + cell + rb")" + separator + rb".*$"
    )
    rows = commented.sub(rb"\1", rows)
    short = re.compile(rb"(?m)^" + cell + rb"(?:" + separator + cell + rb"){0,%d}$" % max(width - 2, 0))
    *lines, last = rows.split(b"\n")
    if width < 2 or not any(short.fullmatch(line) for line in lines if line):
        return rows
    filled_bytes = len(rows) + width * len(lines) - rows.count(separator)
    if filled_bytes > most_unpacked(len(rows)):
        raise ReadError(
            "nearly all cells of its rows are left out", path=path, place=f"line {first_line}",
            expected=f"rows of {width} cells", found=f"{len(lines)} rows in {len(rows)} bytes",
            remedy="save fewer channels, or as TDMS",
        )  # fmt: skip
    filled = [line + separator * (width - 1 - line.count(separator)) if line else line for line in lines]
    return b"\n".join([*filled, last])


@dataclass(frozen=True)
class _Part:
    """The recordings of one segment, one for each time, and what dates it."""

    recordings: tuple[Recording, ...]
    start: AbsoluteStart | None
    zero_ns: int | None
    line: int
    notes: tuple[Remark, ...]
    missing: str
    """Sentence on the rows that the head states and that are not there; empty if all are."""
    shifts_s: tuple[float, ...] = ()
    """By how much the times of each recording are later than they stand in its column."""


def _parts(segment: Segment, head: _FileHead, clock: str, path: Path) -> _Part:
    """Return the channels of a segment, of which each may have a column of times."""
    found: list[_Part] = []
    none: NoSignalError | None = None
    notes: list[Remark] = []
    for one in segment.apart(head.separator) if head.x_columns == "multi" else [segment]:
        try:
            found.append(_part(one, head, clock, path))
            notes += found[-1].notes
        except NoSignalError as error:
            none = error
            notes += [one if isinstance(one, Remark) else Note(NoteCode.LEFT_OUT, None, one) for one in error.remarks]
    if not found and none is not None:
        raise none
    shifts_s = [_shift_s(part, found[0], head, path) for part in found for _ in part.recordings]
    return replace(
        found[0], recordings=tuple(one for part in found for one in part.recordings), notes=tuple(notes),
        missing="; ".join(filter(None, (part.missing for part in found))), shifts_s=tuple(shifts_s),
    )  # fmt: skip


def _shift_s(part: _Part, first: _Part, head: _FileHead, path: Path) -> float:
    """Return how much later the times of channels are than they stand in their column, which counts from their date.

    Raises
    ------
    ReadError
        If the file does not say that they count from there, and they show it by nothing.
    """
    (signal, *_), zero_ns = part.recordings[0].signals, first.zero_ns
    late_s = 0.0 if part.zero_ns is None or zero_ns is None else (part.zero_ns - zero_ns) / 1e9
    if abs(late_s) <= _SAME_STAMP_NS / 1e9 or part.recordings[0].time_base(signal.name).start_s > _ABSOLUTE_S:
        return 0.0
    if head.keys.get("Time_Pref", "").casefold() != "relative":
        raise _other_begins(signal.name, late_s, path, part.line)
    return late_s


def _other_begins(name: str, late_s: float, path: Path, line: int) -> ReadError:
    return ReadError(
        "channels of one segment begin at different times, and their columns of times do not show it",
        path=path, place=f"line {line}", expected="one Date and Time", found=f"{name} {late_s:+.6g} s from the first",
        remedy="save with relative times or without X columns, or each into its own file",
    )  # fmt: skip


def _part(segment: Segment, head: _FileHead, clock: str, path: Path) -> _Part:
    """Return the channels of a segment."""
    columns = [i for i, name in enumerate(segment.names) if name != X_VALUE]
    stated = {i: segment.value("Samples", i) for i in columns}
    empty = [i for i in columns if stated[i] == "0"]
    kept = [i for i in columns if stated[i] != "0"]
    foreign = [i for i in kept if segment.value("X_Dimension", i) not in ("", "Time")]
    used = [i for i in kept if segment.value("X_Dimension", i) in ("", "Time")]
    notes: list[Remark] = [
        Note(NoteCode.LEFT_OUT, None, f"channels without samples were left out: {_listed(segment, empty)}")
    ] if empty else []  # fmt: skip
    if foreign:
        text = f"channels over {segment.value('X_Dimension', foreign[0])}, not over time, were left out: "
        notes.append(Note(NoteCode.LEFT_OUT, None, text + _listed(segment, foreign)))
    if not used:
        raise NoSignalError(
            "no channel over time in a segment", {segment.names[i]: "not over time" for i in columns}, notes, path=path,
            place=f"line {segment.line}", found="; ".join(notes), remedy="save the signals over time",
        )  # fmt: skip
    zero_ns = next((ns for i in used if (ns := _stamp_ns(segment, i)) is not None), None)
    notes += _about_stamps(segment, used, path)
    groups: dict[tuple[Any, ...], list[int]] = {}
    x_columns = list(accumulate((i * (name == X_VALUE) for i, name in enumerate(segment.names)), max))
    for i in used:
        groups.setdefault(_time_key(segment, head, i, x_columns[i]), []).append(i)
    first_rows = [split_cells(line, head.separator) for line in segment.rows.lines(2)]
    for key, own in groups.items():
        if key[0] == "column":
            notes += _about_column(segment, first_rows, key[1], own, path)
            _refuse_other_stamps(segment, own, zero_ns, path)
    headings = _headings(segment)
    block = find_block(
        segment.rows, 0, head.separator, [name for name, _ in headings], decimal_comma=_decimal_comma(segment, head),
        thousands="",
    )  # fmt: skip
    sources = [_source(key, zero_ns, path) for key in groups]
    same_times(block, headings, sources[0])
    of_numbers = {*(source.column for source in sources), *(i for i in used if i not in block.text_columns)}
    store = ColumnStore(block, text_columns=[i for i in range(len(headings)) if i not in of_numbers], remedy=_REMEDY)
    recordings = [
        column_recording(
            LvmReader.name,
            store,
            clock,
            headings,
            source,
            own,
            {},
            beside={i: Statements({key: segment.value(key, i) for key in segment.keys}, _KEYS) for i in own},
        )
        for source, own in zip(sources, groups.values(), strict=True)
    ]
    counts = [count for i in used if (count := whole_number(stated[i])) is not None]
    missing = max(counts, default=0) - recordings[0].signals[0].sample_count
    notes += [_about_step(key[2]) for key in groups if key[0] == "step" and _coarseness(key[2]) > _COARSE]
    if missing < 0 and counts:
        text = f"the head states {max(counts)} rows, and {max(counts) - missing} are there"
        notes.append(Note(NoteCode.CONTRADICTION, None, text))
    lacks = f"{missing} of the stated {max(counts)} rows are not in the file" if missing > 0 else ""
    start = None if zero_ns is None else AbsoluteStart.since_1970(zero_ns, "unknown", "`Date` and `Time` of a segment")
    return _Part(tuple(recordings), start, zero_ns, segment.line, tuple(notes), lacks)


_KEYS = frozenset(
    {"Channels", "Samples", "Date", "Time", "Y_Unit_Label", "Y_Dimension", "X_Dimension", "X0", "Delta_X"}
)
"""Keys of a segment that the specification of the format has."""
_SAME_STAMP_NS = 1000
"""Difference of two stamps of one beginning, ns: they are printed with more digits than any clock keeps."""
_SAME_STEP = 1e-3
"""Relative difference of two statements of a step that are alike."""
_COARSE = 1e-4
"""Share of a step by which it may be wrong for its printed digits, from which on that is said."""


def _coarseness(step: str) -> float:
    """Return half of a step's last printed digit as a share of it."""
    value = number_of(step)
    return 0.5 * 10.0 ** -decimals(step.replace(",", ".")) / value if value else 0.0


def _about_step(step: str) -> Note:
    text = f"`Delta_X` is printed as {step}: the rate is known to {100 * _coarseness(step):.2g} % only"
    return Note(NoteCode.TIME, None, text)


def _listed(segment: Segment, columns: Sequence[int]) -> str:
    return ", ".join(segment.names[i] for i in columns)


def _headings(segment: Segment) -> list[tuple[str, str]]:
    names, _ = unique_names([name or f"column {i}" for i, name in enumerate(segment.names)])
    return [(name, segment.value("Y_Unit_Label", i)) for i, name in enumerate(names)]


def _time_key(segment: Segment, head: _FileHead, column: int, x_column: int) -> tuple[Any, ...]:
    """Return where the time of a column comes from: the X column before it, or start and step as they are printed."""
    if head.x_columns != "no":
        return "column", x_column
    return "step", segment.value("X0", column), segment.value("Delta_X", column), _stamp_ns(segment, column)


def _about_column(
    segment: Segment, first_rows: Sequence[Sequence[str]], column: int, own: Sequence[int], path: Path
) -> list[Remark]:
    """Compare a column of times with what the head states of the channels that it dates.

    Raises
    ------
    ReadError
        If the channels start at different times, or have different steps, and share it: it is that of one of them.
    """
    stated = {
        (start, step): i
        for i in own
        if (start := number_of(segment.value("X0", i))) is not None
        and (step := number_of(segment.value("Delta_X", i))) is not None
        and step > 0
    }
    if len(stated) > 1:
        (one, first), (other, second) = list(stated.items())[:2]
        raise ReadError(
            "channels of other times share one column of times", path=path, place=f"line {segment.line}",
            expected="one X0 and one Delta_X", remedy="save with one X column per channel, or each into its own file",
            found=f"{segment.names[first]} from {one[0]:g} by {one[1]:g} s, {segment.names[second]} from {other[0]:g}"
            f" by {other[1]:g} s",
        )  # fmt: skip
    cells = [row[column].replace(",", ".") for row in first_rows if len(row) > column]
    if not stated or len(cells) < 2 or not all(map(is_number, cells)):
        return []
    step_s, (_, stated_s) = float(cells[1]) - float(cells[0]), next(iter(stated))
    digit_s = 10.0 ** -max(map(decimals, cells))
    if abs(step_s - stated_s) <= _SAME_STEP * stated_s + digit_s:
        return []
    text = f"`Delta_X` states a step of {stated_s:g} s, the column of times has {step_s:g} s: the column counts"
    return [Note(NoteCode.CONTRADICTION, None, text)]


def _about_stamps(segment: Segment, used: Sequence[int], path: Path) -> list[Remark]:
    """Say that a date is not understood; refuse channels that such dates may put at different times."""
    stated = {text: _stamp_ns(segment, i) for i in used if (text := segment.stamp_text(i))}
    unknown = [text for text, stamp_ns in stated.items() if stamp_ns is None and not _BEFORE.match(text)]
    if not unknown:
        return []
    if len(stated) > 1:
        raise ReadError(
            "channels of one segment begin at times that are not understood", path=path, place=f"line {segment.line}",
            expected="a Date yyyy/mm/dd and a Time hh:mm:ss", found=", ".join(unknown[:3]), remedy=_REMEDY,
        )  # fmt: skip
    text = f"`Date` and `Time` are not understood, {unknown[0][:60]!r}: the start is not known"
    return [Note(NoteCode.TIME, None, text)]


def _refuse_other_stamps(segment: Segment, own: Sequence[int], zero_ns: int | None, path: Path) -> None:
    """Refuse channels with columns of times whose head dates them apart: from which instant each counts is a guess."""
    for i in own:
        stamp_ns = _stamp_ns(segment, i)
        if stamp_ns is not None and zero_ns is not None and abs(stamp_ns - zero_ns) > _SAME_STAMP_NS:
            raise _other_begins(segment.names[i], (stamp_ns - zero_ns) / 1e9, path, segment.line)


def _source(key: tuple[Any, ...], zero_ns: int | None, path: Path) -> TimeSource:
    """Return where the instants of channels come from, counted from the date and time of the segment's first one."""
    if key[0] == "column":
        return TimeSource(key[1], unit_s=1.0, remedy=_REMEDY)
    start, step = (number_of(text) for text in key[1:3])
    if start is None or step is None or not step > 0:
        raise CorruptFileError(
            "a segment states no step of time", path=path, expected="X0 and Delta_X above 0",
            found=f"{key[1][:40]!r}, {key[2][:40]!r}", remedy=_REMEDY,
        )  # fmt: skip
    if zero_ns is not None and key[3] is not None:
        start += (key[3] - zero_ns) / 1e9
    return TimeSource(None, rate_hz=rate_of_step(step), rate_origin="from `Delta_X`", start_s=start, remedy=_REMEDY)


def _decimal_comma(segment: Segment, head: _FileHead) -> bool:
    stated = head.keys.get("Decimal_Separator", "")
    if stated in (".", ","):
        return stated == ","
    rows = segment.rows.lines(LOOKED_AT)
    return head.separator != "," and has_decimal_comma([split_cells(line, head.separator) for line in rows])


def _stamp_ns(segment: Segment, column: int) -> int | None:
    """Return the date and time that a head states of a column, ns since 1970 in its own zone; None if there is none."""
    try:
        stamp = parse_wall_clock(_MORE_DIGITS.sub(r"\1", segment.stamp_text(column).replace(",", ".")))
    except ValueError:
        return None
    if stamp.second.year < _FIRST_YEAR or stamp.order is DateOrder.OPEN:
        return None
    return round(stamp.second.replace(tzinfo=dt.UTC).timestamp()) * 10**9 + stamp.fraction_ns


def _joined(path: Path, parts: Sequence[_Part], said: Mapping[str, Any], cut: str, clock: str) -> Recording:
    """Return the recording of all segments, each at its own time."""
    first = parts[0]
    offsets = _offsets(path, parts)
    units = [[{one.name: one.unit for one in recording.signals} for recording in part.recordings] for part in parts]
    channels = [
        _channel(
            header,
            [_matching(part, own, at, header, path) for part, own in zip(parts, units, strict=True)],
            [offset + part.shifts_s[at] for part, offset in zip(parts, offsets, strict=True)],
            clock,
            partial(_zero_s, first.recordings[0]),
            first.start,
            path,
        )
        for at, recording in enumerate(first.recordings)
        for header in recording.signals
    ]
    ends = [parts[-1].missing, *(recording.incomplete for recording in parts[-1].recordings)]
    incomplete = "; ".join(dict.fromkeys(filter(None, (cut, *ends))))
    notes: list[Remark] = [Note(NoteCode.CUT, None, incomplete)] if incomplete else []
    for part in parts:
        notes += part.notes
        if part.missing and part is not parts[-1]:
            notes.append(Note(NoteCode.LOST, None, f"line {part.line}: {part.missing}"))
    return Recording(
        path, LvmReader.name, channels, metadata={**said, **first.recordings[0].metadata},
        notes=lambda: [*dict.fromkeys([*notes, *(n for p in parts for r in p.recordings for n in r.notes)])],
        incomplete=incomplete, absolute_start=first.start,
    )  # fmt: skip


def _offsets(path: Path, parts: Sequence[_Part]) -> list[float]:
    """Return by how much each segment's time zero is behind that of the first, s."""
    if len(parts) == 1:
        return [0.0]
    stamps = [part.zero_ns for part in parts]
    if None in stamps:
        raise CorruptFileError(
            f"a second recording begins in line {parts[1].line}, and nothing says when it was", path=path,
            expected="`Date` and `Time` in the head of each segment",
            remedy="take the segments apart there, and give the one that is meant",
        )  # fmt: skip
    return [(stamp - stamps[0]) / 1e9 for stamp in stamps if stamp is not None and stamps[0] is not None]


def _matching(part: _Part, units: Sequence[Mapping[str, str]], at: int, header: SignalHeader, path: Path) -> Recording:
    """Return the recording of a segment that holds a channel as the first segment has it; it has units by names."""
    own = units[at] if at < len(units) else {}
    if own.get(header.name) != header.unit:
        raise CorruptFileError(
            f"a second recording begins in line {part.line}: it has other channels", path=path,
            expected=f"{header.name!r} in {header.unit!r}", found=", ".join(own) or "none",
            remedy="take the segments apart there, and give the one that is meant",
        )  # fmt: skip
    return part.recordings[at]


def _channel(
    header: SignalHeader, pieces: Sequence[Recording], offsets: Sequence[float], clock: str,
    zero_s: Callable[[], float], start: AbsoluteStart | None, path: Path,
) -> StoredChannel:  # fmt: skip
    counts = [piece.header(header.name).sample_count for piece in pieces]
    ends = np.cumsum(counts)
    return StoredChannel(
        replace(header, sample_count=int(ends[-1])),
        partial(_instants, header.name, pieces, offsets, clock, zero_s, start, path),
        partial(_samples, header.name, pieces, ends),
        overloads=lambda: sum(piece.overloads(header.name) for piece in pieces),
    )


def _samples(
    name: str, pieces: Sequence[Recording], ends: NDArray[np.int64], start: int, stop: int
) -> NDArray[np.float64]:
    found = [np.empty(0)]
    for piece, end, begin in zip(pieces, ends, np.r_[0, ends[:-1]], strict=True):
        if start < end and stop > begin:
            found.append(piece.read(name, max(start - begin, 0), stop - begin))
    return np.concatenate(found)


def _zero_s(first: Recording) -> float:
    """Return the first time of a column that counts the seconds since 1904; 0 of one that does not."""
    start_s = first.time_base(first.signals[0].name).start_s
    return start_s if start_s > _ABSOLUTE_S else 0.0


def _instants(
    name: str,
    pieces: Sequence[Recording],
    offsets: Sequence[float],
    clock: str,
    zero: Callable[[], float],
    start: AbsoluteStart | None,
    path: Path,
) -> TimeBase:
    """Return the instants of a channel, those of each segment behind those of the one before.

    Times since 1904 begin at zero with the first channel, and date themselves.
    """
    bases, zero_s = [piece.time_base(name) for piece in pieces], zero()
    if zero_s:
        since = (_SINCE_1904 + dt.timedelta(seconds=zero_s)).replace(tzinfo=None).isoformat()
        start, offsets = AbsoluteStart(since, "UTC", "seconds since 1904 in the column X_Value"), [-zero_s] * len(bases)
    if len(bases) == 1 and bases[0].step_s is not None:
        return TimeBase.uniform(clock, bases[0].start_s + offsets[0], bases[0].step_s, bases[0].count, start)
    times_s = np.concatenate([base.times_s + offset for base, offset in zip(bases, offsets, strict=True)])
    back = np.flatnonzero(np.diff(times_s) <= 0)
    if back.size:
        raise CorruptFileError(
            "a segment begins before the one before it ends", path=path, place=f"sample {back[0] + 2}",
            expected=f"more than {times_s[back[0]]:.9g} s", found=f"{times_s[back[0] + 1]:.9g} s",
            remedy="take the segments apart, and give the one that is meant",
        )  # fmt: skip
    return TimeBase.stamped(clock, times_s, start)
