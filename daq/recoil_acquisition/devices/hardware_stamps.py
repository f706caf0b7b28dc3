"""Stamps that a CAN controller gave its frames itself, where its driver hands them to the kernel.

python-can asks the kernel for its own stamp of a frame (SO_TIMESTAMPNS), which is as late as an interrupt may be: on
one controller by up to .9 ms, where its raw stamps of a periodic message kept to 5 us (python-can's issue 1881). Linux
hands over both where SO_TIMESTAMPING asks for them (Documentation/networking/timestamping.rst, 1.3 and 2.1.1):
``scm_timestamping`` holds three instants, the kernel's own, one that is deprecated, and the controller's raw one, on
the controller's own clock; one that was not given is zero.
"""

from __future__ import annotations

import socket
import struct
import sys
from typing import Any

SO_TIMESTAMPING = 37
"""Option, and type of its message (asm-generic/socket.h)."""
ASKED_FOR = 1 << 2 | 1 << 6
"""SOF_TIMESTAMPING_RX_HARDWARE and SOF_TIMESTAMPING_RAW_HARDWARE of linux/net_tstamp.h."""
_THREE_INSTANTS = struct.Struct("@6l")
_MORE = 64 + struct.calcsize("@16x6l")
"""Bytes of a further message, with room for its head."""


class StampedSocket:
    """A socket whose datagrams are stamped by the hardware too, beside what its reader asks for.

    Everything but reading goes to the socket itself.

    Attributes
    ----------
    hardware_ns
        Raw stamp of the datagram that was read last, ns of the hardware's own clock; 0 where it gave none.
    """

    def __init__(self, of: socket.socket) -> None:
        self._of = of
        self.hardware_ns = 0

    def __getattr__(self, name: str) -> Any:
        """Return what the socket itself has."""
        return getattr(self._of, name)

    def fileno(self) -> int:
        """Return the socket's descriptor."""
        return self._of.fileno()

    def recvmsg(self, size: int, ancillary_size: int = 0, flags: int = 0) -> tuple[Any, ...]:
        """Read as the socket does, and keep the hardware's stamp: the reader has what it asked for alone."""
        data, ancillary, *rest = self._of.recvmsg(size, ancillary_size + _MORE, flags)
        self.hardware_ns, kept = 0, []
        for level, kind, content in ancillary:
            if (level, kind) != (socket.SOL_SOCKET, SO_TIMESTAMPING):
                kept.append((level, kind, content))
            elif len(content) >= _THREE_INSTANTS.size:
                *_, seconds, nanoseconds = _THREE_INSTANTS.unpack_from(content)
                self.hardware_ns = 1_000_000_000 * seconds + nanoseconds
        return (data, kept, *rest)


def stamp_by_hardware(bus: Any) -> StampedSocket | None:
    """Let a bus of python-can that reads a socket keep the hardware's stamps.

    Returns
    -------
    StampedSocket or None
        Socket that tells them; None where the system has no such stamps, and the bus is as it was.
    """
    of = getattr(bus, "socket", None)
    if sys.platform != "linux" or not isinstance(of, socket.socket):
        return None
    try:
        of.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPING, ASKED_FOR)
    except OSError:
        return None
    bus.socket = stamped = StampedSocket(of)
    return stamped
