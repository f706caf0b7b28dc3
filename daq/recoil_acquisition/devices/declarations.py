"""Declarations of a rig that a device needs beside its ``device`` table."""

from __future__ import annotations

from dataclasses import dataclass

from recoil_acquisition.devices.stream_check import StreamCheck
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.readers.can.buses import BusName


@dataclass(frozen=True)
class DeviceDeclarations:
    """Declarations about one source.

    Attributes
    ----------
    framing
        Framing of a serial source; None of any other.
    database
        Text of a bus's database; None of any other source.
    counters
        Signals of a bus that count the messages they are in.
    bus
        Bus of the source, where its device delivers several.
    check
        Counter that looks at the blocks in place of the one that framing or counters would give.
    """

    framing: Framing | None = None
    database: str | None = None
    counters: tuple[str, ...] = ()
    bus: BusName | None = None
    check: StreamCheck | None = None
