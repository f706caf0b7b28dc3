"""Rows of CAN frames, as a log keeps them, one at a time."""

from __future__ import annotations

from recoil_acquisition.frames.can_rows import ROW


def pack_row(
    *,
    device_ns: int,
    host_ns: int,
    identifier: int,
    flags: int,
    data: bytes,
    channel: int = 0,
    length: int | None = None,
) -> bytes:
    """Return one row; ``length`` is stated where it is not the number of bytes of data: in a remote frame."""
    return ROW.pack(device_ns, host_ns, identifier, flags, channel, len(data) if length is None else length, data)
