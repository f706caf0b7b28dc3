"""The file that keeps every frame of a CAN bus as it was received, with the interface's and the host's time of each.

Layout: the line `MAGIC`, then records of `RECORD_SIZE` bytes, little endian:

====== ====== ==========================================================================
offset type   meaning
====== ====== ==========================================================================
0      int64  the interface's stamp in ns from any start; 0 if it gave none
8      int64  the host's monotonic clock when the frame was received, ns
16     uint32 identifier, without flags; of an error frame, its class
20     uint16 flags, see below
22     uint8  channel of the interface
23     uint8  bytes of data; of a remote frame, the bytes it asks for
24     64     data, zero behind its length
====== ====== ==========================================================================

A record with the flag `ANCHOR` is no frame: it gives the host's wall clock (ns since 1970-01-01 UTC) in
place of the stamp, at the host's monotonic time beside it. A record with the flag `EVENT` is no frame
either: its data is a short text on what happened to the bus. Nothing is interpreted, so that another
database or another clock can be applied later.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAGIC = b"recoil-daq can capture 1\n"

EXTENDED = 0x001
"""A 29-bit identifier."""
REMOTE = 0x002
ERROR = 0x004
"""An error frame."""
FD = 0x008
"""A CAN FD frame."""
BIT_RATE_SWITCH = 0x010
ERROR_STATE = 0x020
"""The sender was error passive."""
SENT = 0x040
"""Sent by this host."""
DEVICE_TIME = 0x080
"""The stamp comes from the interface or the kernel, not from the driver's own look at the wall clock."""
EVENT = 0x100
ANCHOR = 0x200
KNOWN_FLAGS = 0x3FF

LONGEST = 64
"""Most bytes of data in a frame."""

RECORD_DTYPE = np.dtype(
    [
        ("device_ns", "<i8"),
        ("host_ns", "<i8"),
        ("id", "<u4"),
        ("flags", "<u2"),
        ("channel", "u1"),
        ("length", "u1"),
        ("data", "u1", (LONGEST,)),
    ]
)
RECORD_SIZE = RECORD_DTYPE.itemsize

RECORD = struct.Struct(f"<qqIHBB{LONGEST}s")
"""The same layout for one record."""


@dataclass(frozen=True, eq=False)
class CanCapture:
    """The content of a capture.

    Attributes
    ----------
    records : ndarray of RECORD_DTYPE, shape (n_records,)
        In the order of the file.
    cut : bool
        Whether the file ends inside a record.
    """

    records: NDArray[np.void]
    cut: bool


def pack_record(
    *,
    device_ns: int,
    host_ns: int,
    identifier: int,
    flags: int,
    data: bytes,
    channel: int = 0,
    length: int | None = None,
) -> bytes:
    """Return one record.

    Parameters
    ----------
    device_ns, host_ns : int
    identifier : int
    flags : int
    data : bytes
        At most `LONGEST`.
    channel : int
    length : int, optional
        Where it is not the number of bytes of data: in a remote frame.
    """
    if len(data) > LONGEST:
        raise ValueError(f"a record holds at most {LONGEST} bytes of data, not {len(data)}")
    return RECORD.pack(device_ns, host_ns, identifier, flags, channel, len(data) if length is None else length, data)


def pack_anchor(wall_ns: int, monotonic_ns: int) -> bytes:
    """Return the record that relates the host's two clocks."""
    return pack_record(device_ns=wall_ns, host_ns=monotonic_ns, identifier=0, flags=ANCHOR, data=b"")


def pack_event(host_ns: int, text: str) -> bytes:
    """Return the record of something that happened to the bus; a long text is cut between characters."""
    octets = text.encode()[:LONGEST].decode(errors="ignore").encode()
    return pack_record(device_ns=0, host_ns=host_ns, identifier=0, flags=EVENT, data=octets)


def parse_records(content: bytes) -> NDArray[np.void]:
    """Return the whole records at the beginning of some bytes, shape (n_records,)."""
    return np.frombuffer(content, dtype=RECORD_DTYPE, count=len(content) // RECORD_SIZE)


def parse_capture(content: bytes) -> CanCapture:
    """Take a capture apart; ValueError if it does not begin with `MAGIC`."""
    if not content.startswith(MAGIC):
        raise ValueError("this is no CAN capture")
    body = memoryview(content)[len(MAGIC) :]
    whole = len(body) // RECORD_SIZE
    records = np.frombuffer(body, dtype=RECORD_DTYPE, count=whole)
    return CanCapture(records, cut=whole * RECORD_SIZE != len(body))


def text_of(record: Any) -> str:
    """Return the text of an event's record."""
    octets: bytes = record["data"].tobytes()[: int(record["length"])]
    return octets.decode("utf-8", errors="replace")
