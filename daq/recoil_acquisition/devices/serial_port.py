"""A serial port: which one is meant, how it is set, and how it is found again when it comes back under another name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import DeviceError, nearest_first

_KEYS = (
    "port",
    "baudrate",
    "bytesize",
    "parity",
    "stopbits",
    "xonxoff",
    "rtscts",
    "dsrdtr",
    "low_latency",
)
_USB = re.compile(r"usb:([0-9a-f]{4}):([0-9a-f]{4})(?::(.+))?", re.IGNORECASE)


@dataclass(frozen=True)
class PortIdentity:
    """Properties of a port that stay the same when it is unplugged and plugged in again.

    Attributes
    ----------
    path
        Path as declared; a link such as those of ``/dev/serial/by-id`` is followed anew at each opening.
    vendor, product
        USB identifiers; None for a port that is no USB device.
    serial_number
        Serial number of the USB device; empty for any.
    location
        Socket of the computer that it is plugged into, as the system names it; empty if it is not known. It tells
        devices apart that have no serial number.
    """

    path: str
    vendor: int | None = None
    product: int | None = None
    serial_number: str = ""
    location: str = ""


def identity_of(declared: str) -> PortIdentity:
    """Return the identity that a rig declares: a path, or ``usb:VID:PID`` or ``usb:VID:PID:SERIAL`` in hexadecimal."""
    match = _USB.fullmatch(declared)
    if match is None:
        return PortIdentity(declared)
    return PortIdentity("", int(match.group(1), 16), int(match.group(2), 16), match.group(3) or "")


def learn(identity: PortIdentity, opened: str = "") -> PortIdentity:
    """Add what the system knows of the port that was opened, while it is plugged in.

    Parameters
    ----------
    opened
        Path of the port; that which was declared if left out.
    """
    from serial.tools.list_ports import comports

    for port in comports():
        if port.vid is not None and _same(port.device, opened or identity.path):
            # one that was declared by its kind may be another one of it the next time
            number = identity.serial_number if identity.vendor is not None else port.serial_number or ""
            return PortIdentity(identity.path, port.vid, port.pid, number, port.location or "")
    return identity


def find(identity: PortIdentity) -> str:
    """Return the path under which a port is to be opened now.

    Of a device that was there before, the one with the same identifiers in the same socket is taken; else the declared
    path if it is there, which may be a link made for this very purpose; else the device with the same identifiers.

    Raises
    ------
    FileNotFoundError
        If there is none.
    DeviceError
        If there are several, and nothing says which is meant.
    """
    from serial.tools.list_ports import comports

    if identity.vendor is None and identity.path:
        return identity.path
    kind = identity.vendor, identity.product
    alike = [port for port in comports() if (port.vid, port.pid) == kind]
    found = [port for port in alike if identity.serial_number in ("", port.serial_number)]
    there = [port for port in found if identity.location and port.location == identity.location]
    if not there and identity.path and Path(identity.path).exists():
        return identity.path
    found = there or found
    if len(found) == 1:
        return str(found[0].device)
    named = f"{identity.vendor:04x}:{identity.product:04x}" if identity.vendor is not None else "?"
    if found:
        raise DeviceError(
            f"{len(found)} USB devices {named} are plugged in, and nothing says which is meant",
            found=", ".join(_told_apart(port) for port in found),
            remedy="write `port` as one of these paths, or with the serial number behind: usb:VID:PID:SERIAL; on Linux "
            "a path of /dev/serial/by-path stays with the socket",
        )
    if identity.path:
        return identity.path
    raise FileNotFoundError(2, f"no USB device {named} {identity.serial_number}".rstrip())


def _told_apart(port: Any) -> str:
    """Write a port with what tells it from others."""
    number = f"serial number {port.serial_number}" if port.serial_number else "no serial number"
    return f"{port.device} ({number}{f', at {port.location}' if port.location else ''})"


def port_names() -> list[str]:
    """Return the serial ports of this system."""
    from serial.tools.list_ports import comports

    return sorted(str(port.device) for port in comports())


def _same(one: str, other: str) -> bool:
    if one == other:
        return True
    try:
        return Path(one).resolve() == Path(other).resolve()
    except OSError:
        return False


def checked_options(name: str, table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a serial ``device`` table if it has what it needs and nothing else; `DeviceError` if not."""
    for key in table:
        if key not in _KEYS:
            raise DeviceError(
                f"source '{name}': a serial `device` has no key {key!r}",
                expected=", ".join(nearest_first(key, _KEYS)[:4]),
                remedy="correct `device` in the rig file, nearest names first",
            )
    port, baudrate = table.get("port"), table.get("baudrate")
    if not isinstance(port, str) or not port:
        raise DeviceError(
            f"source '{name}': a serial `device` needs a port",
            found=", ".join(port_names()) or "no serial port on this computer",
            remedy='write such as `device = { port = "/dev/ttyUSB0", baudrate = 921600 }`',
        )
    if isinstance(baudrate, bool) or not isinstance(baudrate, int) or baudrate <= 0:
        raise DeviceError(
            f"source '{name}': a serial `device` needs a baud rate",
            expected="a positive whole number",
            found=repr(baudrate),
            remedy="write `baudrate` as it is set in the device",
        )
    return dict(table)
