"""From blocks to the capture files that the readers open."""

from __future__ import annotations

from recoil_acquisition.devices.device import CAN, EVENT, SERIAL, Block, event_of, interrupts
from recoil_acquisition.frames import can_capture_file, capture_file
from recoil_acquisition.host_clock import Anchor


def capture_header(kind: str, anchored: Anchor) -> bytes:
    """Return what a capture of a source of one kind begins with.

    Parameters
    ----------
    kind : str
        ``can`` or ``serial``.
    anchored : Anchor
        The host's two clocks, taken when the device was opened.
    """
    if kind == CAN:
        return can_capture_file.MAGIC + can_capture_file.pack_anchor(anchored.wall_ns, anchored.monotonic_ns)
    if kind == SERIAL:
        return capture_file.MAGIC
    raise ValueError(f"a source of kind {kind!r} has no capture")


def capture_bytes(kind: str, block: Block, anchored: Anchor) -> bytes:
    """Return what a block adds to the capture of its source.

    Parameters
    ----------
    kind : str
        Of the source: ``can`` or ``serial``.
    block : Block
        Of that source. Of its events a serial capture keeps where the device was lost or opened again.
    anchored : Anchor
        As for the header: a serial capture states the wall clock's time of each read.
    """
    if kind == CAN:
        if block.kind == EVENT:
            event = event_of(block)
            return can_capture_file.pack_event(block.host_ns, f"{event.name}: {event.detail}")
        return block.payload
    if kind != SERIAL:
        raise ValueError(f"a source of kind {kind!r} has no capture")
    if block.kind == EVENT:
        return capture_file.pack_record(anchored.wall_of(block.host_ns), b"") if interrupts(block) else b""
    return capture_file.pack_record(anchored.wall_of(block.host_ns), block.payload)
