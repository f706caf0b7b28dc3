"""Frames as comma-separated values, as python-can writes them.

Layout: the header line `HEADER`, then per frame the stamp in seconds as Python prints a float, the identifier in
hexadecimal digits, three flags, the number of bytes, and the data in base64. Channel and direction are not stored.
"""

from __future__ import annotations

import base64
import binascii
import re
from decimal import Decimal

from recoil_acquisition.readers.can.frames import FD_LENGTHS, CanLog, FrameList, start_of_stamps
from recoil_acquisition.readers.can.lines import CUT, split_lines

HEADER = "timestamp,arbitration_id,extended,remote,error,dlc,data"

_LINE = re.compile(
    rb"(?:np\.float64\()?(-?)(\d{1,12})(?:\.(\d+))?(e[+-]?\d{1,3})?\)?"
    rb",0x([0-9a-f]{1,8}),([01]),([01]),([01]),(\d{1,2}),([A-Za-z0-9+/]*={0,2})\r?",
    re.ASCII,
)

_QUOTED = re.compile(rb'(?:(?<=[,\n])|\A)"([^",\r\n]*)"(?=[,\r\n]|\Z)')


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
    # no cell has a quote or a separator in it: quotes are another program's, around cells
    lines = split_lines(_QUOTED.sub(rb"\1", text) if b'"' in text else text)
    for at in range(lines.start.size):
        line = lines.line(at)
        match = _LINE.fullmatch(line)
        if match is not None:
            _read_frame(match, found)
        elif line.strip() and line.strip() != HEADER.encode():
            found.damaged += 1
    frames, start = start_of_stamps(found)
    log = found.log(frames, start, CUT * bool(lines.cut.strip()), channels="not stored by this format")
    return log.without_buses()


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
        time_ns = int(whole) * 1_000_000_000 + int((fraction or b"0")[:9].ljust(9, b"0"))
    found.add_identified(-time_ns if sign else time_ns, int(identifier, 16), 0, data, extended=extended == b"1")
