"""Logs of Vector's tools as text.

Layout: a header (date, number base, absolute or relative stamps) and one event per line,
``time channel id direction d length data``, or ``time CANFD channel direction id [name] brs esi code length
data``. It is parsed here because error frames, negative and relative stamps must not turn into data.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Sequence

from recoil_acquisition.readers.can.frames import FD_LENGTHS, CanLog, FrameList
from recoil_acquisition.readers.can.lines import CUT, LineShape, TextLines, read_uniform_lines, split_lines
from recoil_acquisition.timebase import AbsoluteStart

MONTHS = {
    name: number
    for number, names in enumerate(
        ("jan", "feb", "mar mär mrz", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov", "dec dez"),
        start=1,
    )
    for name in names.split()
}

_USUAL = re.compile(
    rb"\s*(-?)(\d{1,9})\.(\d{1,9})\s+(\d{1,9})\s+([0-9a-f]{1,8})(x?)\s+[RT]x\s+d ([0-8])((?: [0-9a-f]{2})*)(?=\s|$)",
    re.IGNORECASE | re.ASCII,
)
_CLASSIC_BYTES = 8
_NUMBER = re.compile(r"-?\d{1,9}\.\d+", re.ASCII)
_DATE = re.compile(r"(\w{3})\w*\.?\s+(\d+)\s+(\d+):(\d+):(\d+)(?:\.(\d{1,6}))?\s*(am|pm)?\s+(\d{4})", re.IGNORECASE)


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
        With ``\n`` line ends.

    Returns
    -------
    CanLog
        Time as the log has it; relative stamps, each from the event before, are summed up.
    """
    found = FrameList()
    header: dict[str, str] = {}
    lines = split_lines(text)
    # a base or relative stamps may be stated anew where logs were joined: then every line is read in turn
    stated = [line.lower().split() for line in re.findall(rb"^[ \t]*base\b.*$", text, re.IGNORECASE | re.MULTILINE)]
    plain = all(line[1:2] == [b"hex"] and b"relative" not in line for line in stated)
    left = read_uniform_lines(lines, _shape, found) if plain else range(lines.start.size)
    base, relative, ended, now_ns = 16, False, False, 0
    for at in left:
        found.place = int(at)
        words = lines.line(int(at)).decode(encoding, errors="replace").split()
        if not words:
            continue
        if not _NUMBER.fullmatch(words[0]):
            first = words[0].casefold()
            if first == "date":
                header["date"] = " ".join(words[1:])
            elif first == "base" and len(words) > 1:
                base = 10 if words[1].casefold() == "dec" else 16
                relative = "relative" in (word.casefold() for word in words)
            elif first == "begin" and len(words) > 2:
                header.setdefault("begin_triggerblock", " ".join(words[2:]))
            ended = first == "end"
            continue
        stamp_ns = _nanoseconds(*words[0].split("."))
        now_ns = now_ns + stamp_ns if relative else stamp_ns
        _read_event(words, now_ns, base, found)
    notes = []
    if not ended and "begin_triggerblock" in header and not _ends(lines.cut):
        notes.append("the log has no `End TriggerBlock`: it may have been cut")
    if relative:
        notes.append("stamps are relative to the event before: they were summed up")
    said = {**header, "base": base, "timestamps": "relative" if relative else "absolute"}
    return found.log(found.frames()[0], _asc_start(header), CUT * _is_cut(lines), notes, **said)


def _ends(line: bytes) -> bool:
    return line.strip().lower().startswith(b"end triggerblock")


def _is_cut(lines: TextLines) -> bool:
    """Return whether something was left out behind the last line end."""
    return bool(lines.cut.strip()) and not _ends(lines.cut)


def _shape(line: bytes) -> LineShape | None:
    """Learn where the digits of a data frame stand; None if the line is anything else."""
    match = _USUAL.match(line)
    if match is None or len(match[8]) < 3 * int(match[7]) or (match[6] and len(match[5]) > 8):
        return None
    count = int(match[7])
    data = match.start(8)
    end = data + 3 * count
    return LineShape(
        whole=match.span(2),
        fraction=match.span(3),
        negative=bool(match[1]),
        identifier=match.span(5),
        extended=bool(match[6]),
        data=tuple(range(data + 1, end, 3)),
        channel=int(match[4]),
        end=min(end + 1, len(line)),
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
    elif len(words) > 4 and words[1].isdigit() and lowered[2] in ("rx", "tx", "txrq"):
        _read_classic(words, time_ns, base, found)
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
        if not (word.isascii() and word.isalnum() and len(word) <= 3 and _is_byte(word, base)):
            break
        there += 1
    stated = {_CLASSIC_BYTES, FD_LENGTHS[code]} if code < len(FD_LENGTHS) else {int(words[5])} & set(FD_LENGTHS)
    if there not in stated:
        raise ValueError(f"{there} bytes")
    return there


def _is_byte(word: str, base: int) -> bool:
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
        if length not in FD_LENGTHS:
            raise ValueError(length)
        if length == 0 and int(words[at + 2], base):
            found.remote_frames += 1
            return
        _add(words[4], words[2], time_ns, _bytes(words[at + 4 : at + 4 + length], length, base), base, found)
    except (ValueError, IndexError):
        found.damaged += 1


def _add(identifier: str, channel: str, time_ns: int, data: bytes, base: int, found: FrameList) -> None:
    """Add a data frame unless its identifier is none."""
    extended = identifier[-1] in "xX"
    try:
        number = int(identifier[:-1] if extended else identifier, base)
    except ValueError:
        number = -1
    found.add_identified(time_ns, number, int(channel) if len(channel) < 10 else -1, data, extended=extended)


def _bytes(words: Sequence[str], length: int, base: int) -> bytes:
    if len(words) != length:
        raise ValueError("fewer data bytes than stated")
    if not all(word.isascii() and word.isalnum() for word in words):
        raise ValueError("no number")  # int() would take 0_1 and +1
    return bytes(int(word, base) for word in words)


def _asc_start(header: dict[str, str]) -> AbsoluteStart | None:
    """Read the local time at which the log begins, in English or German month names."""
    for key, origin in (("begin_triggerblock", "Begin Triggerblock"), ("date", "header line `date`")):
        match = _DATE.search(header.get(key, ""))
        if match is None or match.group(1).casefold() not in MONTHS:
            continue
        month, day, hour, minute, second, fraction, half, year = match.groups()
        hours = int(hour) % 12 + 12 * (half.casefold() == "pm") if half else int(hour)
        try:
            start = dt.datetime(
                int(year),
                MONTHS[month.casefold()],
                int(day),
                hours,
                int(minute),
                int(second),
                int((fraction or "0").ljust(6, "0")),
            )
        except ValueError:
            continue
        return AbsoluteStart(
            start.isoformat(timespec="milliseconds"), "unknown", f"{origin}, local time of the recorder"
        )
    return None
