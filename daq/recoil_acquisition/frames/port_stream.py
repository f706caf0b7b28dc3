"""All that a serial port delivered, with the host's time of each read.

Host time counts from 1970-01-01 UTC where the host's wall clock is known, else from any start; what lies before 2001 is
taken for the latter. Nothing is interpreted, so that a wrong framing can be corrected later.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays


@dataclass(frozen=True, eq=False)
class PortStream(ReadOnlyArrays):
    """Bytes that a port delivered.

    Attributes
    ----------
    stream
        All bytes of the port.
    host_ns : ndarray of int64, shape (n_reads,)
        Host time of each read; empty for a plain file of bytes.
    ends : ndarray of int64, shape (n_reads,)
        Byte of the stream behind each read.
    breaks
        Bytes of the stream before which it was interrupted, ascending.
    incomplete
        How it shows that something of it is missing; empty if nothing shows that.
    """

    stream: bytes
    host_ns: NDArray[np.int64]
    ends: NDArray[np.int64]
    incomplete: str = ""
    breaks: tuple[int, ...] = ()

    @classmethod
    def plain(cls, stream: bytes) -> PortStream:
        """Return a stream without host times."""
        none = np.zeros(0, dtype=np.int64)
        return cls(stream, none, none)

    @classmethod
    def of_reads(cls, reads: Iterable[tuple[int, bytes | None]], *, incomplete: str = "") -> PortStream:
        """Return the stream that some reads of a port gave, each with its host time; None where it was interrupted."""
        pieces, times, ends, breaks, total = [], [], [], [], 0
        for host_ns, piece in reads:
            if piece is None:
                breaks.append(total)
                continue
            pieces.append(piece)
            total += len(piece)
            times.append(host_ns)
            ends.append(total)
        host, behind = np.array(times, dtype=np.int64), np.array(ends, dtype=np.int64)
        return cls(b"".join(pieces), host, behind, incomplete, tuple(breaks))
