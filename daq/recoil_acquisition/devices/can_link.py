"""A bus as python-can and the system describe it: its messages' flags, its queue, its losses, its neighbours."""

from __future__ import annotations

import contextlib
import os
import socket
import stat
import sys
from collections.abc import Mapping
from typing import Any

from recoil_acquisition.devices.kernel_drops import dropped_by_can_link, dropped_by_udp_socket
from recoil_acquisition.frames import can_rows

RECEIVE_BUFFER = 16 << 20
"""Bytes asked for as a socket's queue: the kernel's default holds a few hundred frames, this some seconds."""

_FORCED = 33
"""SO_RCVBUFFORCE of Linux (asm-generic/socket.h): beyond the system's limit, for who may."""


def enlarge_queue(bus: Any) -> None:
    """Ask for a longer queue where the interface is a socket; a refusal is no fault."""
    with contextlib.suppress(Exception):  # many interfaces have no descriptor, each says so in its own way
        descriptor = bus.fileno()
        if descriptor >= 0 and stat.S_ISSOCK(os.fstat(descriptor).st_mode):
            # a second handle of the same socket: python-can's own is private
            with socket.socket(fileno=os.dup(descriptor)) as twin:
                twin.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
                if sys.platform == "linux":
                    twin.setsockopt(socket.SOL_SOCKET, _FORCED, RECEIVE_BUFFER)


def kernel_drops(bus: Any, interface: str, channel: str) -> int | None:
    """Return what the kernel dropped of an open bus so far; None where it does not say."""
    if interface == "socketcan":
        return dropped_by_can_link(channel)
    if interface == "udp_multicast":
        return dropped_by_udp_socket(bus.fileno())
    return None


def flags_of(message: Any) -> int:
    """Return the flags of a message of python-can, as `frames.can_rows` has them, but for its stamp's."""
    flags = can_rows.EXTENDED if message.is_extended_id else 0
    if message.is_error_frame:
        flags |= can_rows.ERROR
    if message.is_remote_frame:
        flags |= can_rows.REMOTE
    if message.is_fd:
        flags |= can_rows.FD
        flags |= can_rows.BIT_RATE_SWITCH if message.bitrate_switch else 0
        flags |= can_rows.ERROR_STATE if message.error_state_indicator else 0
    return flags if message.is_rx else flags | can_rows.SENT


def delivers_several_buses(table: Mapping[str, Any] | None) -> bool:
    """Return whether the device of a rig's table hands over frames of more than one bus, by the channels it names."""
    if table is None or "interface" not in table:
        return False
    channel = table.get("channel", "" if table["interface"] == "socketcan" else None)
    if isinstance(channel, str):
        return "," in channel or channel.strip() in ("", "any")
    return isinstance(channel, list | tuple) and len(channel) > 1


def can_links() -> list[str]:
    """Return the CAN network devices of this system."""
    try:
        return sorted(name for _, name in socket.if_nameindex() if "can" in name)
    except (OSError, AttributeError):
        return []
