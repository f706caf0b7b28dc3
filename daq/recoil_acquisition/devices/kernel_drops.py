"""Losses that the kernel reports, before a program could read it, where the platform says it at all.

Sources: the statistics of a network device, ``/sys/class/net/<name>/statistics`` (Linux,
Documentation/ABI/testing/sysfs-class-net-statistics); the last column of ``/proc/net/udp``; the ioctl TIOCGICOUNT
with ``struct serial_icounter_struct`` of ``linux/serial.h``.
"""

from __future__ import annotations

import os
import struct
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

_CAN_STATISTICS = ("rx_dropped", "rx_over_errors", "rx_fifo_errors", "rx_missed_errors")
_TIOCGICOUNT = 0x545D
_ICOUNTER = struct.Struct("20i")
_NETWORK = Path("/sys/class/net")
_UDP_TABLES = (Path("/proc/net/udp"), Path("/proc/net/udp6"))


def dropped_by_can_link(name: str, network: Path = _NETWORK) -> int | None:
    """Return the frames that a SocketCAN link lost since it came up; None if the system does not say.

    The socket's own queue is not in it: the kernel states its losses with each frame only, and
    python-can refuses frames that carry that.
    """
    counts = []
    for statistic in _CAN_STATISTICS:
        try:
            counts.append(int((network / name / "statistics" / statistic).read_text()))
        except (OSError, ValueError):
            return None
    return sum(counts)


def dropped_by_udp_socket(descriptor: int, tables: tuple[Path, ...] = _UDP_TABLES) -> int | None:
    """Return the datagrams that a socket's full queue lost; None if the system does not say."""
    try:
        inode = str(os.fstat(descriptor).st_ino)
    except OSError:
        return None
    for table in tables:
        try:
            rows = table.read_text().splitlines()[1:]
        except OSError:
            continue
        for row in rows:
            columns = row.split()
            if len(columns) >= 13 and columns[9] == inode:
                return int(columns[12])
    return None


class GrowingCount:
    """Growth of a count of the system while a device was open, over all its openings; any thread may ask."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._seen: int | None = None
        self._total: int | None = None

    @property
    def total(self) -> int | None:
        """The sum so far; None if the system never said."""
        return self._total

    def restart(self) -> None:
        """Count from the next look on: the device was opened anew."""
        with self._lock:
            self._seen = None

    def see(self, count: int | None) -> None:
        """Take a look's result; None if the system did not say."""
        if count is None:
            return
        with self._lock:
            before = count if self._seen is None else self._seen
            self._total = (self._total or 0) + max(count - before, 0)
            self._seen = count


@dataclass(frozen=True)
class LineErrors:
    """Counts of a serial port since the system started.

    Attributes
    ----------
    damaged
        Bytes with a framing or parity error.
    dropped
        Bytes lost in the port's or the kernel's buffer.
    """

    damaged: int
    dropped: int


def line_errors(descriptor: int) -> LineErrors | None:
    """Ask the kernel for a port's error counts; None where there is no such port or no such question."""
    if not sys.platform.startswith("linux"):
        return None
    import fcntl

    try:
        answer = fcntl.ioctl(descriptor, _TIOCGICOUNT, bytes(_ICOUNTER.size))
    except OSError:
        return None  # a pseudo-terminal counts nothing
    return line_errors_of(answer)


def line_errors_of(answer: bytes) -> LineErrors:
    """Take the kernel's answer to TIOCGICOUNT apart."""
    frame, overrun, parity, _, buffer_overrun = _ICOUNTER.unpack(answer)[6:11]
    return LineErrors(damaged=frame + parity, dropped=overrun + buffer_overrun)
