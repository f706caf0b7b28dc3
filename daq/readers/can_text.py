"""Text logs of CAN traffic: Vector ASC and candump.

Layouts: ``candump -L`` of can-utils writes ``(seconds.microseconds) interface id#data`` with eight
digits for a 29-bit identifier, ``##`` and a flags digit before FD data, ``#R`` for a remote frame, and
the error flag 0x20000000 in the identifier of an error frame. Vector ASC has a header (date, number base,
absolute or relative stamps) and one event per line, ``time channel id direction d length data``.
Both are parsed here because error frames, negative and relative stamps must not turn into data.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Sequence

from daq.readers.can_frames import EXTENDED, FD_LENGTHS, ID_MASK, CanLog, FrameList
from daq.timebase import AbsoluteStart

ERROR_FLAG = 0x20000000
MONTHS = {
    name: number
    for number, names in enumerate(
        ("jan", "feb", "mar mär mrz", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov", "dec dez"),
        start=1,
    )
    for name in names.split()
}

CUT = "the last line has no line end and may be cut: it was left out"

_CANDUMP = re.compile(r"\((\d{1,12})\.(\d{6}|\d{9})\)\s+(\S+)\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(\S*)(?:\s+[RT])?\s*")
_USUAL = re.compile(
    r"\s*(-?\d{1,9})\.(\d{1,9})\s+(\d{1,9})\s+([0-9a-f]{1,8}x?)\s+[RT]x\s+d ([0-8])((?: [0-9a-f]{2})*)(?:\s.*)?",
    re.IGNORECASE | re.ASCII,
)
_NUMBER = re.compile(r"-?\d{1,9}\.\d+", re.ASCII)
_DATE = re.compile(r"(\w{3})\w*\.?\s+(\d+)\s+(\d+):(\d+):(\d+)(?:\.(\d{1,6}))?\s*(am|pm)?\s+(\d{4})", re.IGNORECASE)


def is_candump(text: str) -> bool:
    """Tell whether a text begins with an entry of a candump log."""
    return _CANDUMP.fullmatch(text.lstrip("\n").split("\n", 1)[0].strip()) is not None


def is_asc(text: str) -> bool:
    """Tell whether a text begins with the header of an ASC log."""
    return re.search(r"^base\s+(hex|dec)\b", text[:4000], re.IGNORECASE | re.MULTILINE) is not None and bool(
        re.match(r"\s*(date\s|//|base\s)", text, re.IGNORECASE)
    )


def _complete_lines(text: str) -> tuple[list[str], bool]:
    """Split a text into the lines that have a line end, and tell whether one was left out."""
    lines = text.split("\n")
    last = lines.pop().strip()
    return lines, bool(last) and not last.casefold().startswith("end triggerblock")


def read_candump(text: str) -> CanLog:
    r"""Read a candump log.

    Parameters
    ----------
    text : str
        With ``\n`` line ends.

    Returns
    -------
    CanLog
        Time counts from the first data frame; its wall-clock time is the host's, UTC.
    """
    lines, cut = _complete_lines(text)
    found = FrameList()
    interfaces: dict[str, int] = {}
    for line in lines:
        match = _CANDUMP.fullmatch(line.strip())
        if match is None:
            found.damaged += bool(line.strip())
            continue
        seconds, fraction, interface, identifier, payload = match.groups()
        number = int(identifier, 16)
        if len(identifier) == 8 and number & ERROR_FLAG:
            found.error_frames += 1
            continue
        if payload[:1] in ("R", "r"):
            found.remote_frames += 1
            continue
        try:
            data = bytes.fromhex(payload[2:] if payload.startswith("#") else payload)
        except ValueError:
            found.damaged += 1
            continue
        time_ns = int(seconds) * 1_000_000_000 + int(fraction.ljust(9, "0"))
        key = number & ID_MASK | (EXTENDED if len(identifier) == 8 else 0)
        found.add(time_ns, key, interfaces.setdefault(interface, len(interfaces)), data)
    zero_ns = found.first_time_ns()
    notes = found.notes() + [CUT] * cut
    start = None
    if interfaces:
        try:
            instant = dt.datetime(1970, 1, 1) + dt.timedelta(microseconds=zero_ns // 1000)
            start = AbsoluteStart(
                instant.isoformat(timespec="microseconds"), "UTC", "stamp of the first frame, the host's clock"
            )
        except OverflowError:
            notes.append("the first stamp is beyond the calendar: the absolute start is unknown")
    return CanLog(
        found.frames(zero_ns), start, tuple(notes), CUT * cut, {**found.counts(), "channels": list(interfaces)}
    )


def read_asc(text: str) -> CanLog:
    r"""Read an ASC log.

    Parameters
    ----------
    text : str
        With ``\n`` line ends.

    Returns
    -------
    CanLog
        Time as the log has it; relative stamps, each from the event before, are summed up.
    """
    lines, cut = _complete_lines(text)
    found = FrameList()
    header: dict[str, str] = {}
    base, relative, ended, now_ns = 16, False, False, 0
    for line in lines:
        usual = _USUAL.fullmatch(line) if base == 16 else None
        if usual is not None and len(usual[6]) >= 3 * int(usual[5]):
            stamp_ns = _nanoseconds(usual[1], usual[2])
            now_ns = now_ns + stamp_ns if relative else stamp_ns
            _add(usual[4], usual[3], now_ns, bytes.fromhex(usual[6][: 3 * int(usual[5])]), base, found)
            continue
        words = line.split()
        if not words:
            continue
        if not _NUMBER.fullmatch(words[0]):
            first = words[0].casefold()
            if first == "date":
                header["date"] = " ".join(words[1:])
            elif first == "base" and len(words) > 1:
                base = 10 if words[1].casefold() == "dec" else 16
                relative = "relative" in line.casefold()
            elif first == "begin" and len(words) > 2:
                header.setdefault("begin_triggerblock", " ".join(words[2:]))
            ended = first == "end"
            continue
        stamp_ns = _nanoseconds(*words[0].split("."))
        now_ns = now_ns + stamp_ns if relative else stamp_ns
        _read_event(words, now_ns, base, found)
    notes = found.notes() + [CUT] * cut
    if not ended and "begin_triggerblock" in header and not text.rstrip().casefold().endswith("end triggerblock"):
        notes.append("the log has no `End TriggerBlock`: it may have been cut")
    if relative:
        notes.append("stamps are relative to the event before: they were summed up")
    metadata = {**found.counts(), **header, "base": base, "timestamps": "relative" if relative else "absolute"}
    return CanLog(found.frames(), _asc_start(header), tuple(notes), CUT * cut, metadata)


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
        length = min(8, int(words[5], base))
        _add(words[2], words[1], time_ns, _bytes(words[6 : 6 + length], length, base), base, found)
    except (ValueError, IndexError):
        found.damaged += 1


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
    if 0 <= number <= (ID_MASK if extended else 0x7FF) and len(channel) < 10:
        found.add(time_ns, number | (EXTENDED if extended else 0), int(channel), data)
    else:
        found.damaged += 1


def _bytes(words: Sequence[str], length: int, base: int) -> bytes:
    if len(words) != length:
        raise ValueError("fewer data bytes than stated")
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
