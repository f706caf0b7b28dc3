"""Declarations of a rig that a device needs beside its ``device`` table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.readers.can.buses import BusName


@dataclass(frozen=True)
class DeviceDeclarations:
    """Declarations about one source.

    Attributes
    ----------
    framing
        Framing of a serial source, whose commands are sent and whose frames are counted; None of any other.
    database
        Text of a bus's database, in which `counters` are found; None of any other source.
    counters
        Signals of a bus that count the messages they are in.
    bus
        Bus of the source, where its device delivers several.
    signals
        Signals of the source that have a channel: what a device that tells its signals is to send.
    heard
        Function that is given all that passes, of a device whose talk can be kept: on which connection, who said it,
        and its bytes.
    """

    framing: Framing | None = None
    database: str | None = None
    counters: tuple[str, ...] = ()
    bus: BusName | None = None
    signals: tuple[str, ...] = ()
    heard: Callable[[str, str, bytes], None] | None = None
