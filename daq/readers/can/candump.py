"""Logs of can-utils.

Layout: ``candump -L`` writes ``(seconds.microseconds) interface id#data`` with eight digits for a 29-bit
identifier, ``##`` and a flags digit before FD data, ``#R`` for a remote frame, and the error flag 0x20000000 in
the identifier of an error frame (`linux/can.h`, can-utils' `lib.h`).
"""

from __future__ import annotations

import datetime as dt
import re
from dataclasses import replace

import numpy as np

from daq.readers.can.frames import EXTENDED, ID_MASK, CanFrames, CanLog, FrameList
from daq.readers.can.lines import CUT, LineShape, split_lines, take_alike
from daq.timebase import AbsoluteStart

ERROR_FLAG = 0x20000000
"""`CAN_ERR_FLAG` of ``linux/can.h``: whatever class of error it is, such a frame is no data."""

_LINE = re.compile(
    rb"\((\d{1,12})\.(\d{6}|\d{9})\)\s+(\S+)\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(\S*)(?:\s+[RT])?\s*", re.ASCII
)
_BYTES = re.compile(rb"(?:[0-9A-Fa-f]{2})*", re.ASCII)


def is_candump(text: str) -> bool:
    """Tell whether a text begins with an entry of a candump log."""
    first = text.lstrip("\n").split("\n", 1)[0].strip()
    return _LINE.fullmatch(first.encode("utf-8", "replace")) is not None


def read_candump(text: bytes) -> CanLog:
    r"""Read a candump log.

    Parameters
    ----------
    text : bytes
        With ``\n`` line ends.

    Returns
    -------
    CanLog
        Time counts from the first data frame; its wall-clock time is the host's, UTC.
    """
    found = FrameList()
    interfaces: dict[bytes, int] = {}
    lines = split_lines(text)

    def learn(line: bytes) -> LineShape | None:
        return _shape(line, interfaces)

    for at in take_alike(lines, learn, found):
        found.place = int(at)
        _read_line(lines.line(int(at)).strip(), interfaces, found)
    frames, zero_ns = found.frames(from_first=True)
    frames, names = _in_order_of_appearance(frames, list(interfaces))
    cut = bool(lines.cut.strip())
    notes = found.notes() + [CUT] * cut
    start = None
    if names:
        instant = dt.datetime(1970, 1, 1) + dt.timedelta(microseconds=zero_ns // 1000)
        start = AbsoluteStart(
            instant.isoformat(timespec="microseconds"), "UTC", "stamp of the first frame, the host's clock"
        )
    return CanLog(frames, start, tuple(notes), CUT * cut, {**found.counts(), "channels": names})


def _in_order_of_appearance(frames: CanFrames, interfaces: list[bytes]) -> tuple[CanFrames, list[str]]:
    """Give the interfaces their numbers as the log's frames name them first."""
    numbers, first = np.unique(frames.channel, return_index=True)
    order = numbers[np.argsort(first)]
    rank = np.zeros(len(interfaces), dtype=np.int64)
    rank[order] = np.arange(order.size)
    names = [interfaces[number].decode("utf-8", "replace") for number in order.tolist()]
    return replace(frames, channel=rank[frames.channel] if order.size else frames.channel), names


def _read_line(line: bytes, interfaces: dict[bytes, int], found: FrameList) -> None:
    """Read one entry; whatever is no data frame is counted."""
    match = _LINE.fullmatch(line)
    if match is None:
        found.damaged += bool(line)
        return
    seconds, fraction, interface, identifier, payload = match.groups()
    number = int(identifier, 16)
    if len(identifier) == 8 and number & ERROR_FLAG:
        found.error_frames += 1
        return
    if payload[:1] in (b"R", b"r"):
        found.remote_frames += 1
        return
    octets = payload[2:] if payload.startswith(b"#") else payload
    if _BYTES.fullmatch(octets) is None or len(octets) > 128 or (len(identifier) == 3 and number > 0x7FF):
        found.damaged += 1
        return
    time_ns = int(seconds) * 1_000_000_000 + int(fraction.ljust(9, b"0"))
    key = number & ID_MASK | (EXTENDED if len(identifier) == 8 else 0)
    found.add(time_ns, key, interfaces.setdefault(interface, len(interfaces)), bytes.fromhex(octets.decode()))


def _shape(line: bytes, interfaces: dict[bytes, int]) -> LineShape | None:
    """Learn where the digits of a data frame stand; None if the line is anything else."""
    match = _LINE.fullmatch(line)
    if match is None or len(match[1]) > 10:
        return None
    begin, end = match.span(5)
    begin += 2 if match[5].startswith(b"#") else 0
    if begin > end or _BYTES.fullmatch(line, begin, end) is None or end - begin > 128:
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
