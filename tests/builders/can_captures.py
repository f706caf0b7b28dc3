"""CAN captures built record by record, and a reader's case of one."""

from __future__ import annotations

from collections.abc import Sequence

from recoil_acquisition.frames import can_capture_file as capture
from tests.builders import vendor_files as build

HOST_ZERO_NS = 5_000_000_000_000
WALL_ZERO_NS = 1_700_000_000_250_000_000
DEVICE_ZERO_NS = 40_000_000_000


def can_records(
    entries: Sequence[build.CanEntry], *, delay_ns: int = 300_000, device: bool = True, drift: float = 2e-5
) -> list[bytes]:
    """Give each entry the interface's stamp, and the host's a little later."""
    records = []
    for time_ns, key, data in entries:
        flags = (capture.EXTENDED if key >> 31 else 0) | (capture.DEVICE_TIME if device else 0)
        records.append(
            capture.pack_record(
                device_ns=DEVICE_ZERO_NS + time_ns if device else 0,
                host_ns=HOST_ZERO_NS + round(time_ns * (1 + drift)) + delay_ns,
                identifier=key & 0x1FFFFFFF,
                flags=flags,
                data=data,
            )
        )
    return records


def can_capture(records: Sequence[bytes], *, anchored: bool = True) -> bytes:
    anchor = capture.pack_anchor(WALL_ZERO_NS, HOST_ZERO_NS) if anchored else b""
    return capture.MAGIC + anchor + b"".join(records)


def at_record_end(cut: bytes) -> bool:
    """Whether the beginning of a capture is a whole capture by its format."""
    return len(cut) >= len(capture.MAGIC) and (len(cut) - len(capture.MAGIC)) % capture.RECORD_SIZE == 0
