"""The rows of frames that a CAN bus delivered, as a log keeps them: the payload of its records of kind ``CAN``.

A row has `ROW_SIZE` bytes, little endian:

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

Nothing is interpreted, so that another database or another clock can be applied later.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

EXTENDED = 0x001
"""Flag of a frame with a 29-bit identifier."""
REMOTE = 0x002
ERROR = 0x004
"""Flag of an error frame."""
FD = 0x008
"""Flag of a CAN FD frame."""
BIT_RATE_SWITCH = 0x010
ERROR_STATE = 0x020
"""Flag of a frame whose sender was error passive."""
SENT = 0x040
"""Flag of a frame that this host sent."""
DEVICE_TIME = 0x080
"""Flag of a stamp that comes from the interface or the kernel, not from the driver's own look at the wall clock."""
HARDWARE_TIME = 0x100
"""Flag of such a stamp that the controller of a kernel's interface gave, not the kernel."""
STAMPED = DEVICE_TIME | HARDWARE_TIME
"""Flags that say which clock stamped a row."""
KNOWN_FLAGS = 0x1FF

LONGEST = 64
"""Most bytes of data in a frame."""

ROW_DTYPE = np.dtype(
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
ROW_SIZE = ROW_DTYPE.itemsize

ROW = struct.Struct(f"<qqIHBB{LONGEST}s")
"""The same layout for one row."""


def parse_rows(content: bytes) -> NDArray[np.void]:
    """Return the whole rows at the beginning of some bytes, shape (n_rows,)."""
    return np.frombuffer(content, dtype=ROW_DTYPE, count=len(content) // ROW_SIZE)


def clock_of(flags: NDArray[np.uint16]) -> int | None:
    """Return the flags of the one clock that stamped all of some rows; None where it is the host's, or not one."""
    stamps = flags & STAMPED
    return int(stamps[0]) or None if stamps.size and (stamps == stamps[0]).all() else None
