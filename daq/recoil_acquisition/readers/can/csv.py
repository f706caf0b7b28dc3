"""Frames as values between separators, as python-can and the converter of CANedge loggers write them.

Layout of python-can: the header line `HEADER`, then per frame the stamp in seconds as Python prints a float, the
identifier in hexadecimal digits, three flags, the number of bytes, and the data in base64. Channel and direction are
not stored.

Layout of CANedge (CSS Electronics, mdf2csv): the header line `CANEDGE_HEADER`, then per frame the stamp in seconds
since 1970, the number of the bus, the identifier in hexadecimal digits, whether it has 29 bits, the data length code,
the number of bytes, the direction, the two flags of CAN FD, and the data in hexadecimal digits.
"""

from __future__ import annotations

import base64
import binascii
import re
from collections.abc import Callable
from decimal import Decimal

from recoil_acquisition.readers.can.frames import FD_LENGTHS, CanLog, FrameList, is_length_of, start_of_stamps
from recoil_acquisition.readers.can.lines import CUT, split_lines

HEADER = "timestamp,arbitration_id,extended,remote,error,dlc,data"

_LINE = re.compile(
    rb"(?:np\.float64\()?(-?)(\d{1,12})(?:\.(\d+))?(e[+-]?\d{1,3})?\)?"
    rb",0x([0-9a-f]{1,8}),([01]),([01]),([01]),(\d{1,2}),([A-Za-z0-9+/]*={0,2})\r?",
    re.ASCII,
)

CANEDGE_HEADER = "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;DataBytes"
_CANEDGE = re.compile(
    rb"(\d{1,12})(?:\.(\d+))?;(\d{1,9});([0-9A-Fa-f]{1,8});([01]);(\d{1,2});(\d{1,2});[01];[01];[01];([0-9A-Fa-f]*)\r?",
    re.ASCII,
)

_QUOTED = re.compile(rb'(?:(?<=[,;\n])|\A)"([^",;\r\n]*)"(?=[,;\r\n]|\Z)')


def is_can_csv(text: str) -> bool:
    """Return whether a text begins with the header of such a table."""
    return text.split("\n", 1)[0].replace('"', "").strip() == HEADER


def read_can_csv(text: bytes) -> CanLog:
    r"""Read such a table.

    Parameters
    ----------
    text
        Content of the table, with ``\n`` line ends; the first line is the header, or a frame where the writer appended.

    Returns
    -------
    CanLog
        Time counts from the first data frame if the stamps are those of a clock; else it is as stored.
    """
    found = FrameList()
    cut = _read_rows(text, HEADER, _LINE, _read_frame, found)
    frames, start = start_of_stamps(found)
    return found.log(frames, start, cut, channels="not stored by this format").without_buses()


def is_canedge_csv(text: str) -> bool:
    """Return whether a text begins with the header of a table of CANedge."""
    return text.split("\n", 1)[0].replace('"', "").strip() == CANEDGE_HEADER


def read_canedge_csv(text: bytes) -> CanLog:
    """Read a table of CANedge; the parameter and what is returned are those of `read_can_csv`."""
    found = FrameList()
    cut = _read_rows(text, CANEDGE_HEADER, _CANEDGE, _read_canedge_frame, found)
    frames, start = start_of_stamps(found)
    return found.log(frames, start, cut)


def _read_rows(
    text: bytes,
    header: str,
    row: re.Pattern[bytes],
    read: Callable[[re.Match[bytes], FrameList], None],
    found: FrameList,
) -> str:
    """Read the rows of a table into a list; return the sign by which it shows that the table was cut off."""
    # no cell has a quote or a separator in it: quotes are another program's, around cells
    lines = split_lines(_QUOTED.sub(rb"\1", text) if b'"' in text else text)
    for at in range(lines.start.size):
        line = lines.line(at)
        match = row.fullmatch(line)
        if match is not None:
            read(match, found)
        elif line.strip() and line.strip() != header.encode():
            found.damaged += 1
    return CUT * bool(lines.cut.strip())


def _nanoseconds(whole: bytes, fraction: bytes | None) -> int:
    return int(whole) * 1_000_000_000 + int((fraction or b"0")[:9].ljust(9, b"0"))


def _read_canedge_frame(match: re.Match[bytes], found: FrameList) -> None:
    whole, fraction, channel, identifier, extended, code, length, text = match.groups()
    if len(text) != 2 * int(length) or not is_length_of(int(length), int(code)):
        found.damaged += 1
        return
    time_ns, data = _nanoseconds(whole, fraction), bytes.fromhex(text.decode())
    found.add_identified(time_ns, int(identifier, 16), int(channel), data, extended=extended == b"1")


def _read_frame(match: re.Match[bytes], found: FrameList) -> None:
    sign, whole, fraction, exponent, identifier, extended, remote, error, length, text = match.groups()
    if error == b"1":
        found.error_frames += 1
        return
    if remote == b"1":
        found.remote_frames += 1
        return
    try:
        data = base64.b64decode(text, validate=True)
    except binascii.Error:
        found.damaged += 1
        return
    if len(data) != int(length) or len(data) not in FD_LENGTHS:
        found.damaged += 1
        return
    if exponent:
        time_ns = round(Decimal((whole + b"." + (fraction or b"0") + exponent).decode()) * 1_000_000_000)
    else:
        time_ns = _nanoseconds(whole, fraction)
    found.add_identified(-time_ns if sign else time_ns, int(identifier, 16), 0, data, extended=extended == b"1")
