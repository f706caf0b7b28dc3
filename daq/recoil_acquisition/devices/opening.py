"""From the rig's ``device`` table to an open device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from recoil_acquisition.devices.can_device import CanDevice
from recoil_acquisition.devices.device import CAN, SERIAL, Device
from recoil_acquisition.devices.serial_commands import SerialCommands
from recoil_acquisition.devices.serial_device import SerialDevice
from recoil_acquisition.devices.stream_check import FramingCheck, StreamCheck, can_counter_check
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.readers.can.buses import BusName

_EXAMPLES = {
    CAN: '{ interface = "socketcan", channel = "can0" }',
    SERIAL: '{ port = "/dev/ttyUSB0", baudrate = 921600 }',
}


def make_device(
    source: str,
    kind: str,
    table: Mapping[str, Any] | None,
    *,
    framing: Framing | None = None,
    database: str | None = None,
    counters: Sequence[str] = (),
    bus: BusName | None = None,
    check: StreamCheck | None = None,
) -> Device:
    """Make the device of a source, which is then to be opened.

    Parameters
    ----------
    source
        Name of the source.
    kind
        Kind of the source: ``can`` or ``serial``.
    table
        Table ``device`` of the source. Everything in that of a bus goes to python-can.
    framing
        Framing of a serial source: its commands are sent, and its frames are counted.
    database
        Text of a bus's database, in which `counters` are found.
    counters
        Signals of a bus, such as ``Message.Signal``, that count the messages they are in.
    bus
        Bus of the source, where its device delivers several.
    check
        Counter that looks at the blocks in place of the one that framing or counters would give.

    Raises
    ------
    DeviceError
        If the kind cannot be read live, or the table says nothing or something unknown.
    """
    if kind not in _EXAMPLES:
        raise DeviceError(
            f"source '{source}': a {kind} source cannot be read live",
            expected="a source of kind can or serial",
            remedy="hand its file over after the shot",
        )
    if not table:
        raise DeviceError(
            f"source '{source}': the rig declares no device",
            remedy=f"write such as `device = {_EXAMPLES[kind]}` in its table",
        )
    if kind == CAN:
        if counters and database is not None and check is None:
            check = can_counter_check(source, counters, database, Path(f"source {source}"), bus)
        return CanDevice(source, table, check=check, bus=bus)
    if framing is None:
        return SerialDevice(source, table, check=check)
    return SerialDevice(source, table, commands=SerialCommands.of(framing), check=check or FramingCheck(framing))


def open_device(source: str, kind: str, table: Mapping[str, Any] | None, **options: Any) -> Device:
    """Open the device of a source; parameters as of `make_device`.

    Raises
    ------
    DeviceError
        In one line: what is wrong (unknown interface, missing port, permission, in use), and what to do.
    """
    device = make_device(source, kind, table, **options)
    device.open()
    return device
