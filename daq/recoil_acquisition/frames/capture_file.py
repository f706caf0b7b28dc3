"""The file that keeps everything a serial port delivered, with the host's time of each read.

Layout, little endian: the line `MAGIC`, then one record per read: host time as int64 in nanoseconds, the
number of bytes as uint32, the bytes. A record without bytes says that the device was lost there or opened again: what
stands before it is not continued behind it. Host time counts from 1970-01-01 UTC where the host stamps with
its wall clock, else from any start; what lies before 2001 is taken for the latter. Nothing is
interpreted, so that a wrong framing can be corrected later.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAGIC = b"recoil-daq serial capture 1\n"

WALL_CLOCK_NS = 10**18
"""Host time from which on it is taken for a wall clock: September 2001."""

_RECORD = struct.Struct("<qI")


@dataclass(frozen=True, eq=False)
class Capture:
    """The content of a capture.

    Attributes
    ----------
    stream : bytes
        All bytes of the port.
    host_ns : ndarray of int64, shape (n_reads,)
        Host time of each read; empty for a plain file of bytes.
    ends : ndarray of int64, shape (n_reads,)
        Byte of the stream behind each read.
    breaks : tuple of int
        Bytes of the stream before which it was interrupted, ascending.
    cut : bool
        Whether the file ends inside a record.
    """

    stream: bytes
    host_ns: NDArray[np.int64]
    ends: NDArray[np.int64]
    cut: bool
    breaks: tuple[int, ...] = ()


def pack_record(host_ns: int, data: bytes) -> bytes:
    """Return one record of a capture: a read of the port at a host time; without data, an interruption of it."""
    return _RECORD.pack(host_ns, len(data)) + data


def parse_capture(content: bytes) -> Capture:
    """Take a capture apart; a file without `MAGIC` is a plain stream without host times.

    The bytes of a record that is cut are kept, its host time is not.
    """
    if not content.startswith(MAGIC):
        none = np.zeros(0, dtype=np.int64)
        return Capture(content, none, none, cut=False)
    at, size = len(MAGIC), len(content)
    pieces, times, ends, breaks, total, cut = [], [], [], [], 0, False
    while at < size:
        if at + _RECORD.size > size:
            cut = True
            break
        host_ns, count = _RECORD.unpack_from(content, at)
        at += _RECORD.size
        piece = content[at : at + count]
        pieces.append(piece)
        at += count
        if len(piece) < count:
            cut = True
            break
        if not count:
            breaks.append(total)
            continue
        total += count
        times.append(host_ns)
        ends.append(total)
    return Capture(
        b"".join(pieces), np.array(times, dtype=np.int64), np.array(ends, dtype=np.int64), cut, tuple(breaks)
    )
