"""Logs of can-utils.

Layout: ``candump -L`` writes ``(seconds.microseconds) interface id#data`` with eight digits for a 29-bit
identifier, ``##`` and a flags digit before FD data, ``#R`` for a remote frame, and the error flag 0x20000000 in
the identifier of an error frame (``linux/can.h``, can-utils' ``lib.h``). Classic frames of eight bytes may end in ``_``
and their length code, 9 to F. What candump prints on a screen, ``(stamp) interface [RX - -] id [length] data``, is
read too, if it has stamps: of seconds as in a log, or with ``-tA`` of the host's local date and time. Lines that begin
with ``#`` are remarks, which canplayer passes over.
"""

from __future__ import annotations

import datetime as dt
import io
import re
from dataclasses import replace

import numpy as np

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.readers.can.frames import BASE_ID_MASK, FD_LENGTHS, ID_MASK, CanFrames, CanLog, FrameList
from recoil_acquisition.readers.can.lines import CUT, LineShape, read_uniform_lines, split_lines

ERROR_FLAG = 0x20000000
"""Flag of an error frame, ``CAN_ERR_FLAG`` of ``linux/can.h``: whatever class of error it is, it is no data."""

FIRST_DATE_S = 946_684_800
"""Begin of 2000, s since 1970: earlier seconds count from an instant of the program's own, since SocketCAN is
younger."""
_MOST_BACKWARD = 0.1
"""Share of stamps that may go back where several interfaces are logged; of differences about half do."""

_LINE = re.compile(
    rb"\((\d{1,12})\.(\d{6}|\d{9})\)\s+(\S+)\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(\S*?)(_[9A-Fa-f])?(?:\s+[RT])?\s*",
    re.ASCII,
)
_SCREEN = re.compile(
    rb"(?:\((?:(\d{1,12})|(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d))\.(\d{6}|\d{9})\)\s+)?"
    rb"(\S+)\s+(?:[RT]X [B-] [E-]\s+)?"
    rb"([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(\d{1,2})\](\s+remote request|(?:\s+[0-9A-Fa-f]{2})*)(?:\s.*)?",
    re.ASCII,
)
_BYTES = re.compile(rb"(?:[0-9A-Fa-f]{2})*", re.ASCII)


def is_candump(text: str) -> bool:
    """Return whether a text begins with an entry of a candump log, or as candump prints it on a screen."""
    lines = (line.strip() for line in io.StringIO(text))
    first = next((line for line in lines if line and not line.startswith("#")), "").encode("utf-8", "replace")
    return _LINE.fullmatch(first) is not None or _SCREEN.fullmatch(first) is not None


def read_candump(text: bytes) -> CanLog:
    r"""Read a candump log.

    Parameters
    ----------
    text
        Content of the log, with ``\n`` line ends.

    Returns
    -------
    CanLog
        Time counts from the first data frame; its wall-clock time is the host's, UTC, unless stamps have a local date
        or count from an instant of the program's own.

    Raises
    ------
    ValueError
        If the entries have no stamps, or stamps that are differences.
    """
    found = FrameList()
    interfaces: dict[bytes, int] = {}
    lines = split_lines(text)
    local = False

    def learn(line: bytes) -> LineShape | None:
        return _shape(line, interfaces)

    for at in read_uniform_lines(lines, learn, found):
        found.place = int(at)
        line = lines.line(int(at)).strip()
        local |= _read_line(line, interfaces, found)
    frames, zero_ns = found.frames(from_first=True)
    frames, names = _in_order_of_appearance(frames, list(interfaces))
    start = None
    relative = zero_ns < FIRST_DATE_S * 1_000_000_000
    backward = np.count_nonzero(np.diff(frames.time_s) < 0)
    if relative and backward > _MOST_BACKWARD * frames.time_s.size:
        raise ValueError("stamps that are differences from one frame to the next")
    if names and not relative:
        zone = "unknown" if local else "UTC"
        start = AbsoluteStart.since_1970(zero_ns, zone, "stamp of the first frame, the host's clock")
    log = found.log(frames, start, CUT * bool(lines.cut.strip()), channels=names)
    return replace(log, bus_names=dict(enumerate(names)))


def _in_order_of_appearance(frames: CanFrames, interfaces: list[bytes]) -> tuple[CanFrames, list[str]]:
    """Give the interfaces their numbers as the log's frames name them first."""
    numbers, first = np.unique(frames.channel, return_index=True)
    order = numbers[np.argsort(first)]
    rank = np.zeros(len(interfaces), dtype=np.int64)
    rank[order] = np.arange(order.size)
    names = [interfaces[number].decode("utf-8", "replace") for number in order.tolist()]
    return replace(frames, channel=rank[frames.channel] if order.size else frames.channel), names


def _read_line(line: bytes, interfaces: dict[bytes, int], found: FrameList) -> bool:
    """Read one entry; whatever is no data frame is counted; return whether its stamp is a local date."""
    if line.startswith(b"#"):
        return False
    match = _LINE.fullmatch(line)
    if match is None:
        return _read_screen(line, interfaces, found)
    seconds, fraction, interface, identifier, payload, code = match.groups()
    if code is not None and not payload.startswith((b"R", b"r")) and len(payload) != 16:
        found.damaged += 1  # only eight bytes have a length code of their own
        return False
    _add(int(seconds), fraction, interface, identifier, payload, interfaces, found)
    return False


def _read_screen(line: bytes, interfaces: dict[bytes, int], found: FrameList) -> bool:
    """Read one entry as candump prints it on a screen, or count it as damaged."""
    match = _SCREEN.fullmatch(line)
    if match is None:
        found.damaged += bool(line)
        return False
    seconds, date, fraction, interface, identifier, length, data = match.groups()
    if fraction is None:
        raise ValueError("entries without stamps")
    octets = b"R" if data.endswith(b"request") else b"".join(data.split())
    if octets != b"R" and len(octets) != 2 * int(length):
        found.damaged += 1
        return False
    try:
        whole_s = int(seconds) if date is None else _local_s(date)
    except ValueError:
        found.damaged += 1
        return False
    # two digits of a length are those of a CAN FD frame
    flagged = octets if octets == b"R" or len(length) == 1 else b"#0" + octets
    _add(whole_s, fraction, interface, identifier, flagged, interfaces, found)
    return date is not None


def _local_s(date: bytes) -> int:
    """Return a local date and time as if it were UTC, s since 1970."""
    return int((dt.datetime.fromisoformat(date.decode()) - dt.datetime(1970, 1, 1)).total_seconds())


def _add(
    seconds: int,
    fraction: bytes,
    interface: bytes,
    identifier: bytes,
    payload: bytes,
    interfaces: dict[bytes, int],
    found: FrameList,
) -> None:
    number = int(identifier, 16)
    if len(identifier) == 8 and number & ERROR_FLAG:
        found.error_frames += 1
        return
    if payload[:1] in (b"R", b"r"):
        found.remote_frames += 1
        return
    octets = payload[2:] if payload.startswith(b"#") else payload
    lengths = FD_LENGTHS if payload.startswith(b"#") else FD_LENGTHS[:9]
    is_data = _BYTES.fullmatch(octets) is not None and len(octets) // 2 in lengths
    if not is_data or (len(identifier) == 3 and number > BASE_ID_MASK):
        found.damaged += 1
        return
    time_ns = seconds * 1_000_000_000 + int(fraction.ljust(9, b"0"))
    channel = interfaces.setdefault(interface, len(interfaces))
    found.add_identified(
        time_ns, number & ID_MASK, channel, bytes.fromhex(octets.decode()), extended=len(identifier) == 8
    )


def _shape(line: bytes, interfaces: dict[bytes, int]) -> LineShape | None:
    """Learn where the digits of a data frame stand; None if the line is anything else."""
    match = _LINE.fullmatch(line)
    if match is None or len(match[1]) > 10:
        return None
    begin, end = match.span(5)
    begin += 2 if match[5].startswith(b"#") else 0
    lengths = FD_LENGTHS if match[5].startswith(b"#") else FD_LENGTHS[:9]
    if begin > end or _BYTES.fullmatch(line, begin, end) is None or (end - begin) // 2 not in lengths:
        return None
    if match[6] is not None and end - begin != 16:
        return None
    extended = len(match[4]) == 8
    return LineShape(
        whole=match.span(1),
        fraction=match.span(2),
        negative=False,
        identifier=match.span(4),
        extended=extended,
        data=tuple(range(begin, end, 2)),
        channel=interfaces.setdefault(match[3], len(interfaces)),
        end=len(line),
    )
