"""Traces of PEAK's tools.

Layout: "PEAK CAN TRC File Format", versions 1.0, 1.1, 1.3, 2.0 and 2.1. A header of lines that begin with ``;``
states the version, the start (days since 30 December 1899, local time) and, from version 2.0, the columns. Then
one entry per line, its time in ms since the start. A 29-bit identifier has more than four digits. The length
code ``L`` of an FD frame is a code (15 is 64 bytes), the data length ``l`` a number of bytes. Errors, status
changes and error counters are entries of their own types; in version 1.0 they have the identifier FFFFFFFF.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.can.frames import DATE_FAULT, FD_LENGTHS, CanLog, FrameList, is_length_of
from recoil_acquisition.readers.can.lines import CUT, split_lines
from recoil_acquisition.readers.can.second_recording import SecondRecordingError, note_on_second
from recoil_acquisition.readers.text.cells import whole_number
from recoil_acquisition.remark import Note, NoteCode, Remark

COLUMNS: Mapping[str, str] = {"1.0": "NOILD", "1.1": "NOTILD", "1.3": "NOBTIRLD"}
"""Columns of the versions that do not state them, in the letters of version 2."""

STATED = ("2.0", "2.1")
OVERRUN = 0x02
"""Bit of a status entry's last byte: the controller was read too late (``PCAN_ERROR_OVERRUN``)."""

_DATA_TYPES = frozenset({"DT", "FD", "FB", "FE", "BI", "RX", "TX"})
_FD_TYPES = frozenset({"FD", "FB", "FE", "BI"})
_ERROR_TYPES = frozenset({"ER", "ERROR"})
_STATUS_TYPES = frozenset({"ST", "WARNG"})
_NO_IDENTIFIER = "FFFFFFFF"
_EPOCH = dt.datetime(1899, 12, 30)
_TIME = re.compile(r"(-?)(\d{1,12})(?:\.(\d{1,6})\d*)?", re.ASCII)
_HEX = re.compile(r"[0-9A-Fa-f]{1,8}", re.ASCII)
_BYTE = re.compile(r"[0-9A-Fa-f]{2}", re.ASCII)
_ENTRY = re.compile(r"\s*\d+\)\s+\d+(\.\d+)?\s+[0-9A-Fa-f]{4,8}\s+\d", re.ASCII)


@dataclass(frozen=True)
class TraceHeader:
    """Header of a trace.

    Attributes
    ----------
    columns
        Letters of the columns, one each.
    start_days
        Start as it is stated, in days; empty if it is not.
    """

    version: str
    columns: str
    start_days: str


def is_trc(text: str) -> bool:
    """Return whether a text begins as a trace, which of version 1.0 states nothing but its columns."""
    if not text.lstrip().startswith(";"):
        return False
    for line in text.split("\n"):
        if line.startswith(";$FILEVERSION="):
            return True
        if line.strip() and not line.startswith(";"):
            return _ENTRY.match(line) is not None
    return False


def read_trc(path: Path, text: bytes, encoding: str = "utf-8") -> CanLog:
    r"""Read a trace.

    Parameters
    ----------
    path
        File, for messages.
    text
        Content of the trace, with ``\n`` line ends.

    Returns
    -------
    CanLog
        Time from the start of the trace.

    Raises
    ------
    ReadError
        If its version is none of those named above.
    CorruptFileError
        If it states no columns, or has no column of the time, the identifier, the length or the data.
    """
    lines = split_lines(text)
    rows = [lines.line(at).decode(encoding, errors="replace") for at in range(lines.start.size)]
    found = FrameList()
    overruns, later_ns = 0, 0
    notes: list[Remark] = []
    begins = _begins(rows)
    first = header = _header(path, rows)
    for begin, end in zip(begins, (*begins[1:], len(rows)), strict=True):
        if begin:
            header = _header(path, rows[begin:end])
            later_ns = _later_ns(first, header, begin)
            notes.append(note_on_second(begin + 1, later_ns))
        own = FrameList()
        for row in rows[begin:end]:
            words = row.split()
            if words and not words[0].startswith(";"):
                overruns += _read_entry(words, header, own)
        _check_order(found, own, later_ns, begin)
        found.take(own, begin, later_ns)
    cut = bool(lines.cut) and not lines.cut.startswith(b";")  # blanks too: entries begin with them
    if cut and lines.cut.strip():
        # a data frame states its length: with so many bytes behind it, nothing but a line end is missing
        last = FrameList()
        words = lines.cut.decode(encoding, errors="replace").split()
        _read_entry(words, header, last)
        if last.counts()["data_frames"]:
            found.take(last, len(rows), later_ns)
            cut = False
    if overruns:
        missing = f"{overruns} status entries report an overrun: frames are missing before them"
        notes.append(Note(NoteCode.LOST, None, missing))
    start = _start(first)
    said: dict[str, Any] = {"version": first.version, "columns": first.columns, "overruns": overruns}
    if start is None and first.start_days:
        said[DATE_FAULT] = f"when the trace began is not understood: {first.start_days[:80]!r} (`$STARTTIME`)"
        notes.append(Note(NoteCode.TIME, None, said[DATE_FAULT]))
    return found.log(found.frames()[0], start, CUT * cut, notes, **said)


def _begins(rows: list[str]) -> list[int]:
    """Return in which rows recordings begin, the first in row 0: a version, or a start, is stated behind an entry."""
    begins, entries = [0], False
    for at, row in enumerate(rows):
        if row.startswith((";$FILEVERSION", ";$STARTTIME")) and entries:
            begins.append(at)
            entries = False
        entries |= bool(row.strip()) and not row.startswith(";")
    return begins


def _later_ns(first: TraceHeader, header: TraceHeader, begin: int) -> int:
    """Return how much later than the first a further recording began; raises `SecondRecordingError` if it is unsaid."""
    zero, start = _start_time(first), _start_time(header)
    if zero is None or start is None:
        raise SecondRecordingError("and when is not understood or not said", f"line {begin + 1}")
    return round((start - zero) / dt.timedelta(microseconds=1)) * 1000


def _check_order(found: FrameList, own: FrameList, later_ns: int, begin: int) -> None:
    """Raise `SecondRecordingError` if a recording begins before the one in front of it ended."""
    before, after = found.frames()[0].time_s, own.frames()[0].time_s
    if before.size and after.size and after[0] + later_ns / 1e9 < before.max():
        raise SecondRecordingError("before the one in front of it ended", f"line {begin + 1}")


def _header(path: Path, rows: list[str]) -> TraceHeader:
    stated: dict[str, str] = {}
    for row in rows:
        if row.startswith(";$") and "=" in row:
            key, _, value = row[2:].partition("=")
            stated.setdefault(key.strip().upper(), value.strip())
        elif row.strip() and not row.startswith(";"):
            break
    version = stated.get("FILEVERSION", "1.0")
    if version in STATED:
        columns = "".join(stated.get("COLUMNS", "").split(",")).replace(" ", "")
        if not columns or not {"O", "T", "I", "D"} <= set(columns) or not {"l", "L"} & set(columns):
            raise CorruptFileError(
                "the trace's columns are missing or do not describe frames",
                path=path,
                place="header line `;$COLUMNS`",
                expected="O, T, I, D, and l or L among them",
                found=columns or "nothing",
            )
    elif version in COLUMNS:
        columns = COLUMNS[version]
    else:
        raise ReadError(
            f"version {version[:20]!r} of the trace is not known",
            path=path,
            place="header line `;$FILEVERSION`",
            expected=" or ".join([*COLUMNS, *STATED]),
            remedy="convert it to version 2.1 with PEAK-Converter",
        )
    return TraceHeader(version, columns, stated.get("STARTTIME", ""))


def _read_entry(words: list[str], header: TraceHeader, found: FrameList) -> bool:
    """Read one entry; whatever is no data frame is counted; return whether it reports an overrun."""
    columns = dict(zip(header.columns, words, strict=False))
    data = words[len(header.columns) - 1 :]
    kind = columns.get("T", "RX").upper()
    identifier = columns.get("I", "")
    if kind in _STATUS_TYPES or (identifier.upper() == _NO_IDENTIFIER and kind not in _ERROR_TYPES):
        found.other_events += 1
        return bool(data) and _BYTE.fullmatch(data[-1]) is not None and bool(int(data[-1], 16) & OVERRUN)
    if kind in _ERROR_TYPES:
        found.error_frames += 1
    elif kind == "RR" or (kind in _DATA_TYPES and data[:1] == ["RTR"]):
        found.remote_frames += 1
    elif kind not in _DATA_TYPES:
        found.add_other(kind[:8])
    else:
        _read_frame(columns, data, kind, found)
    return False


def _read_frame(columns: dict[str, str], data: list[str], kind: str, found: FrameList) -> None:
    time = _TIME.fullmatch(columns.get("O", ""))
    identifier = columns.get("I", "")
    length = whole_number(columns.get("l", columns.get("L", "")))
    if time is None or _HEX.fullmatch(identifier) is None or length is None:
        found.damaged += 1
        return
    if kind in _FD_TYPES and "l" not in columns:
        length = FD_LENGTHS[length] if length < len(FD_LENGTHS) else -1
    elif kind not in _FD_TYPES and "l" not in columns and length <= 15:
        length = min(length, 8)
    if length > FD_LENGTHS[-1]:  # a message of J1939 that the tool has put together from its frames
        found.other_events += 1
    elif len(data) != length or not all(map(_BYTE.fullmatch, data)) or not _agree(columns, length):
        found.damaged += 1
    elif kind not in _FD_TYPES and length > FD_LENGTHS[8]:
        found.other_events += 1  # such a message too, of fewer bytes
    elif length not in FD_LENGTHS:
        found.damaged += 1
    else:
        sign, whole, fraction = time.groups()
        time_ns = int(whole) * 1_000_000 + int((fraction or "").ljust(6, "0"))
        channel = whole_number(columns.get("B", "1"))
        found.add_identified(
            -time_ns if sign else time_ns,
            int(identifier, 16),
            -1 if channel is None else channel,
            bytes.fromhex("".join(data)),
            extended=len(identifier) > 4,
        )


def _agree(columns: Mapping[str, str], length: int) -> bool:
    """Return whether a length code beside a length, where a trace has both, is that of as many bytes."""
    if "l" not in columns or "L" not in columns:
        return True
    code = whole_number(columns["L"])
    return code is not None and is_length_of(length, code)


def _start(header: TraceHeader) -> AbsoluteStart | None:
    """Return the local time at which the trace began, if it is a time at all."""
    start = _start_time(header)
    if start is None:
        return None
    return AbsoluteStart(
        start.isoformat(timespec="milliseconds"),
        "unknown",
        "header line `$STARTTIME`; by its format local time of the recorder, some writers use UTC",
    )


def _start_time(header: TraceHeader) -> dt.datetime | None:
    try:
        return _EPOCH + dt.timedelta(days=float(header.start_days))
    except (ValueError, OverflowError):
        return None
