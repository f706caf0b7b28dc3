"""Logs of Vector's tools as text.

Layout: a header (date, number base, absolute or relative stamps) and one event per line,
``time channel id direction d length data``, or ``time CANFD channel direction id [name] brs esi code length
data``. It is parsed here because error frames, negative and relative stamps must not turn into data.
"""

from __future__ import annotations

import datetime as dt
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.readers.can.frames import DATE_FAULT, FD_LENGTHS, CanLog, FrameList, is_length_of
from recoil_acquisition.readers.can.lines import CUT, LineShape, read_uniform_lines, split_lines
from recoil_acquisition.readers.can.second_recording import SecondRecordingError, note_on_second
from recoil_acquisition.readers.text.cells import whole_number
from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode, Remark

MONTHS = {
    name: number
    for number, names in enumerate(
        (
            "jan gen ene",
            "feb fev",
            "mar mrz mrt maart",
            "apr avr abr",
            "may mai mei mag maj",
            "jun juin giu",
            "jul juil lug",
            "aug aou ago",
            "sep set",
            "oct okt ott out",
            "nov",
            "dec dez dic des",
        ),
        start=1,
    )
    for name in names.split()
}
"""Beginnings of the months' names in English, German, French, Italian, Spanish, Portuguese, Dutch, Swedish, Danish and
Norwegian, without accents: Vector's tools write them in the language of the computer."""

_USUAL = re.compile(
    rb"\s*(-?)(\d{1,9})\.(\d{1,9})\s+(\d{1,9})\s+([0-9a-f]{1,8})(x?)\s+[RT]x\s+d ([0-8])((?: [0-9a-f]{2})*)(?=\s|$)",
    re.IGNORECASE | re.ASCII,
)
_CLASSIC_BYTES = 8
_SAME_BEGIN_S = 5.0
"""Difference between the date of a trigger block and its stamps that is none: both are of its trigger."""
_NAMED, _REQUESTED = "named frame", "TxRq"
"""Kinds of entries: frames with a name for an identifier, and requests to send, which the frame itself follows."""
_LAST_LINE = b"end triggerblock"
"""Beginning of a log's last line, in small letters."""
_HEX_WORD = re.compile(rb"[0-9a-fA-F]", re.ASCII)
_NUMBER = re.compile(r"-?\d{1,9}\.\d+", re.ASCII)
_DATE = re.compile(
    r"([^\W\d_]{3,12})\.?\s+(\d{1,2})\s+(\d{1,2}):(\d\d?):(\d\d?)(?:[.,](\d{1,6})\d*)?\s*(am|pm)?\s+(\d{4})\b",
    re.IGNORECASE,
)
LEAST_OF_DAY_S, LATEST_FIRST_S = 600.0, 60.0
"""Time of day from which on stamps may be told to be of the day, and how long the first frame may be waited for."""
_HEADER = re.compile(rb"^[ \t]*(?:date\b|begin[ \t]+triggerblock\b).*$", re.IGNORECASE | re.MULTILINE)
_EVENT = re.compile(rb"^[ \t]*-?\d{1,9}\.\d", re.MULTILINE)


def is_asc(text: str) -> bool:
    """Return whether a text begins with the header of an ASC log."""
    return re.search(r"^base\s+(hex|dec)\b", text[:4000], re.IGNORECASE | re.MULTILINE) is not None and bool(
        re.match(r"\s*(date\s|//|base\s)", text, re.IGNORECASE)
    )


def read_asc(text: bytes, encoding: str = "utf-8") -> CanLog:
    r"""Read an ASC log.

    Parameters
    ----------
    text
        Content of the log, with ``\n`` line ends.

    Returns
    -------
    CanLog
        Time as the log has it; relative stamps, each from the event before, are summed up.
    """
    found, parts = FrameList(), _parts(text, encoding)
    for part in parts:
        found.take(part.found, part.first_line, part.later_ns)
    first, last = parts[0], parts[-1]
    cut = bool(last.cut.strip()) and not _ends(last.cut)
    notes: list[Remark] = []
    for part in parts:
        if not part.ended and "begin_triggerblock" in part.header and not (part is last and _ends(part.cut)):
            notes.append(Note(NoteCode.CUT, None, "the log has no `End TriggerBlock`: it may have been cut"))
        if part is not first and part.later_ns:
            notes.append(note_on_second(part.first_line + 1, part.later_ns))
        elif part is not first and (about := _dated_apart(first, part)):
            notes.append(about)
    if named := found.other_kinds[_NAMED]:
        why = f"{named} entries have a name for their identifier and were left out: save the log with numbers"
        notes.append(Caution(CautionCode.UNKNOWN_ENTRIES, None, why))
    if any(part.relative for part in parts):
        notes.append(Note(NoteCode.TIME, None, "stamps are relative to the event before: they were summed up"))
    start, fault = _asc_start(first.header)
    frames = found.frames()[0]
    if start is not None and (midnight := _of_the_day(start, frames.time_s)) is not None:
        start = midnight
        counted = "stamps begin at the time of day of the header's date: they are counted from midnight"
        notes.append(Note(NoteCode.TIME, None, counted))
    notes += [Note(NoteCode.TIME, None, fault)] if fault else []
    said = {**first.header, "base": first.base, "timestamps": "relative" if first.relative else "absolute"}
    said |= {DATE_FAULT: fault} if fault else {}
    return found.log(frames, start, CUT * cut, list(dict.fromkeys(notes)), **said)


@dataclass
class _Part:
    """One recording of a log, from its header on.

    Attributes
    ----------
    first_line
        Number of its first line, from 0.
    later_ns
        Time from the begin of the first recording to that of this one, ns.
    ended
        Whether its last line states its end.
    cut
        Bytes behind its last line end.
    """

    first_line: int
    base: int = 16
    relative: bool = False
    header: dict[str, str] = field(default_factory=dict)
    found: FrameList = field(default_factory=FrameList)
    later_ns: int = 0
    ended: bool = False
    cut: bytes = b""


def _parts(text: bytes, encoding: str) -> list[_Part]:
    """Read the recordings of a log one by one: each begins with a header, or a trigger block whose stamps begin anew.

    Raises
    ------
    SecondRecordingError
        If when one began is not said, or it would have begun before the one in front of it ended.
    """
    begins = _begins(text)
    parts: list[_Part] = []
    line = 0
    for at, until in zip(begins, (*begins[1:], len(text)), strict=True):
        before = parts[-1] if parts else None
        part = _Part(line) if before is None else _Part(line, before.base, before.relative)
        _read_part(text[at:until], encoding, part)
        line += text.count(b"\n", at, until)
        if before is not None:
            part.later_ns = _later_ns(parts, part)
        parts.append(part)
    return parts


def _begins(text: bytes) -> list[int]:
    """Return where the headers of recordings begin, the first at 0: lines of a header that follow on an event."""
    begins, behind = [0], 0
    for found in _HEADER.finditer(text):
        if _EVENT.search(text, behind, found.start()) is not None:
            begins.append(found.start())
        behind = found.end()
    return begins


def _later_ns(parts: Sequence[_Part], part: _Part) -> int:
    """Return how much later than the first a further recording began."""
    before = parts[-1]
    own, last = part.found.frames()[0].time_s, before.found.frames()[0].time_s
    if "date" not in part.header and (not own.size or not last.size or own[0] >= last.max()):
        return before.later_ns  # another trigger block of one measurement
    place = f"line {part.first_line + 1}"
    start, first = _asc_start(part.header)[0], _asc_start(parts[0].header)[0]
    if start is None or first is None:
        raise SecondRecordingError("and when is not understood or not said", place)
    later = dt.datetime.fromisoformat(start.text) - dt.datetime.fromisoformat(first.text)
    later_ns = (later.days * 86_400 + later.seconds) * 1_000_000_000 + later.microseconds * 1000
    if own.size and last.size and later_ns + 1e9 * own[0] < before.later_ns + 1e9 * last.max():
        raise SecondRecordingError(f"at {start.text}, before the one in front of it ended", place)
    return later_ns


def _dated_apart(first: _Part, part: _Part) -> Note | None:
    """Return the note on a trigger block that is dated otherwise than its stamps, which go on; None if it is not."""
    start, begin = _asc_start(part.header)[0], _asc_start(first.header)[0]
    own = part.found.frames()[0].time_s
    if start is None or begin is None or not own.size:
        return None
    later_s = (dt.datetime.fromisoformat(start.text) - dt.datetime.fromisoformat(begin.text)).total_seconds()
    if min(abs(later_s), abs(later_s - float(own[0]))) < _SAME_BEGIN_S:
        return None
    text = (
        f"the trigger block in line {part.first_line + 1} is dated {start.text}, {later_s:+.9g} s from the first, and "
        f"its stamps go on from {float(own[0]):.9g} s: the stamps count"
    )
    return Note(NoteCode.CONTRADICTION, None, text)


def _read_part(text: bytes, encoding: str, part: _Part) -> None:
    """Read one recording; a base, or relative stamps, may have been stated before it."""
    lines, found = split_lines(text), part.found
    part.cut = lines.cut
    # a base or relative stamps may be stated anew where logs were joined: then every line is read in turn
    stated = [line.lower().split() for line in re.findall(rb"^[ \t]*base\b.*$", text, re.IGNORECASE | re.MULTILINE)]
    plain = all(line[1:2] == [b"hex"] and b"relative" not in line for line in stated)
    plain &= bool(stated) or (part.base == 16 and not part.relative)
    left = read_uniform_lines(lines, _shape, found) if plain else range(lines.start.size)
    now_ns = 0
    for at in left:
        found.place = int(at)
        words = lines.line(int(at)).decode(encoding, errors="replace").split()
        if not words:
            continue
        if not _NUMBER.fullmatch(words[0]):
            first = words[0].casefold()
            if first == "date":
                part.header["date"] = " ".join(words[1:])
            elif first == "base" and len(words) > 1:
                part.base = 10 if words[1].casefold() == "dec" else 16
                part.relative = "relative" in (word.casefold() for word in words)
            elif first == "begin" and len(words) > 2:
                part.header.setdefault("begin_triggerblock", " ".join(words[2:]))
            part.ended = first == "end"
            continue
        stamp_ns = _nanoseconds(*words[0].split("."))
        now_ns = now_ns + stamp_ns if part.relative else stamp_ns
        _read_event(words, now_ns, part.base, found)


def _ends(line: bytes) -> bool:
    return line.strip().lower().startswith(_LAST_LINE)


def _shape(line: bytes) -> LineShape | None:
    """Learn where the digits of a data frame stand; None if the line is anything else."""
    match = _USUAL.match(line)
    if match is None or len(match[8]) != 3 * int(match[7]) or (match[6] and len(match[5]) > 8):
        return None
    count = int(match[7])
    data = match.start(8)
    end = data + 3 * count
    if line[end + 1 : end + 2].isalnum() and _HEX_WORD.match(line, end + 1):
        return None  # may be more data than stated, which only a look at the whole line tells
    return LineShape(
        whole=match.span(2),
        fraction=match.span(3),
        negative=bool(match[1]),
        identifier=match.span(5),
        extended=bool(match[6]),
        data=tuple(range(data + 1, end, 3)),
        channel=int(match[4]),
        end=min(end + 2, len(line)),
    )


def _nanoseconds(whole: str, fraction: str) -> int:
    nanoseconds = int(fraction[:9].ljust(9, "0"))
    return int(whole) * 1_000_000_000 + (-nanoseconds if whole.startswith("-") else nanoseconds)


def _read_event(words: Sequence[str], time_ns: int, base: int, found: FrameList) -> None:
    """Read one event; whatever is no data frame is counted."""
    lowered = [w.casefold() for w in words[1:5]]
    if "errorframe" in lowered:
        found.error_frames += 1
    elif lowered[:1] == ["canfd"]:
        _read_fd(words, time_ns, base, found)
    elif len(words) > 4 and whole_number(words[1]) is not None and lowered[2] == _REQUESTED.casefold():
        found.add_other(_REQUESTED)
    elif len(words) > 4 and whole_number(words[1]) is not None and lowered[2] in ("rx", "tx"):
        _read_classic(words, time_ns, base, found)
    elif lowered[:1] and lowered[0][:1].isalpha():
        found.add_other(words[1][:16])
    else:
        found.other_events += 1


def _read_classic(words: Sequence[str], time_ns: int, base: int, found: FrameList) -> None:
    """Read ``time channel id direction d length data ...``."""
    kind = words[4].casefold()
    if kind == "r":
        found.remote_frames += 1
        return
    try:
        if kind != "d":
            raise ValueError(kind)
        length = _classic_length(words, base)
        if len(words) > 6 + length and _is_data(words[6 + length], base):
            raise ValueError("more data bytes than stated")
        _add(words[2], words[1], time_ns, _bytes(words[6 : 6 + length], length, base), base, found)
    except (ValueError, IndexError):
        found.damaged += 1


def _classic_length(words: Sequence[str], base: int) -> int:
    """Return how many bytes an entry has whose length may be a code of CAN FD.

    A code from 9 on stands for 8 bytes of a classic frame, or for 12 to 64 of an FD frame; which, the bytes decide.
    """
    code = int(words[5], base)
    if code <= _CLASSIC_BYTES:
        return code
    there = 0
    for word in words[6:]:
        if not _is_data(word, base):
            break
        there += 1
    stated = {_CLASSIC_BYTES, FD_LENGTHS[code]} if code < len(FD_LENGTHS) else {int(words[5])} & set(FD_LENGTHS)
    if there not in stated:
        raise ValueError(f"{there} bytes")
    return there


def _is_data(word: str, base: int) -> bool:
    if not (word.isascii() and word.isalnum() and len(word) <= 3):
        return False
    try:
        return int(word, base) <= 0xFF
    except ValueError:
        return False


def _read_fd(words: Sequence[str], time_ns: int, base: int, found: FrameList) -> None:
    """Read ``time CANFD channel direction id [name] brs esi code length data ...``."""
    try:
        at = 5 if words[5] in ("0", "1") and words[6] in ("0", "1") else 6
        if words[at] not in ("0", "1") or words[at + 1] not in ("0", "1"):
            raise ValueError(words[at])
        length = int(words[at + 3])
        codes = {int(words[at + 2], one) for one in {16, base} if one == 16 or whole_number(words[at + 2]) is not None}
        if length == 0 and any(codes):
            found.remote_frames += 1
            return
        if not any(is_length_of(length, code) for code in codes):
            raise ValueError(f"{length} bytes by the code {words[at + 2]}")
        _add(words[4], words[2], time_ns, _bytes(words[at + 4 : at + 4 + length], length, base), base, found)
    except (ValueError, IndexError):
        found.damaged += 1


def _add(identifier: str, channel: str, time_ns: int, data: bytes, base: int, found: FrameList) -> None:
    """Add a data frame unless its identifier is none."""
    extended = identifier[-1] in "xX"
    try:
        number = int(identifier[:-1] if extended else identifier, base)
    except ValueError:
        if identifier[:1].isalpha() and identifier.replace("_", "").isalnum():
            found.add_other(_NAMED)
            return
        number = -1
    bus = whole_number(channel)
    found.add_identified(time_ns, number, -1 if bus is None else bus, data, extended=extended)


def _bytes(words: Sequence[str], length: int, base: int) -> bytes:
    if len(words) != length:
        raise ValueError("fewer data bytes than stated")
    if not all(word.isascii() and word.isalnum() for word in words):
        raise ValueError("no number")  # int() would take 0_1 and +1
    return bytes(int(word, base) for word in words)


def _asc_start(header: dict[str, str]) -> tuple[AbsoluteStart | None, str]:
    """Read the local time at which the log begins.

    Returns
    -------
    start : AbsoluteStart or None
    fault : str
        Fault of the header's date, in words, where it is not understood; empty if it is, or none is stated.
    """
    fault = ""
    for key, origin in (("begin_triggerblock", "Begin Triggerblock"), ("date", "header line `date`")):
        start = _date(header[key]) if key in header else None
        if start is not None:
            text = start.isoformat(timespec="milliseconds")
            return AbsoluteStart(text, "unknown", f"{origin}, local time of the recorder"), ""
        if header.get(key):
            fault = f"when the log began is not understood: {header[key][:80]!r} ({origin})"
    return None, fault


def _of_the_day(start: AbsoluteStart, times_s: NDArray[np.float64]) -> AbsoluteStart | None:
    """Return the midnight from which stamps count that are seconds of the day, as BUSMASTER writes them; else None.

    A log that counts from its begin has a first stamp of hours only by chance within a minute behind the time of day.
    """
    begin = dt.datetime.fromisoformat(start.text)
    midnight = begin.replace(hour=0, minute=0, second=0, microsecond=0)
    of_day_s = (begin - midnight).total_seconds()
    if not times_s.size or of_day_s < LEAST_OF_DAY_S or not -1.0 <= float(times_s[0]) - of_day_s <= LATEST_FIRST_S:
        return None
    return replace(start, text=midnight.isoformat(timespec="milliseconds"))


def _date(text: str) -> dt.datetime | None:
    """Read a date as Vector's tools write it; None if it is not understood."""
    match = _DATE.search(text)
    if match is None:
        return None
    name, day, hour, minute, second, fraction, half, year = match.groups()
    month = month_of(name)
    hours = int(hour) % 12 + 12 * (half.casefold() == "pm") if half else int(hour)
    microseconds = int((fraction or "0").ljust(6, "0"))
    if month is None:
        return None
    try:
        return dt.datetime(int(year), month, int(day), hours, int(minute), int(second), microseconds)
    except ValueError:
        return None


def month_of(name: str) -> int | None:
    """Return the number of a month by its name, whole or shortened, in one of the languages of `MONTHS`."""
    folded = unicodedata.normalize("NFKD", name.casefold())
    plain = "".join(letter for letter in folded if not unicodedata.combining(letter))
    fitting = {number for known, number in MONTHS.items() if plain.startswith(known)}
    return fitting.pop() if len(fitting) == 1 else None
