"""CAN captures built row by row."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from recoil_acquisition.frames import can_rows as capture
from tests.builders import rdlog_bytes
from tests.builders import vendor_files as build
from tests.builders.can_rows import pack_row

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
            pack_row(
                device_ns=DEVICE_ZERO_NS + time_ns if device else 0,
                host_ns=HOST_ZERO_NS + round(time_ns * (1 + drift)) + delay_ns,
                identifier=key & 0x1FFFFFFF,
                flags=flags,
                data=data,
            )
        )
    return records


def can_capture(records: Sequence[bytes | tuple[int, bytes]], *, anchored: bool = True, per_read: int = 7) -> bytes:
    """Return a capture of rows, several in a record, and of events, each with its host time."""
    session: dict[str, Any] = {"sources": [{"name": "can", "kind": "can"}]}
    if anchored:
        session["anchor"] = {"wall_ns": WALL_ZERO_NS, "monotonic_ns": HOST_ZERO_NS, "within_ns": 0}
    reads: list[tuple[int, int, int, bytes]] = []
    rows: list[bytes] = []
    for one in [*records, None]:
        if rows and (not isinstance(one, bytes) or len(rows) == per_read):
            reads.append((0, rdlog_bytes.CAN, int.from_bytes(rows[-1][8:16], "little"), b"".join(rows)))
            rows = []
        if isinstance(one, bytes):
            rows.append(one)
        elif one is not None:
            reads.append((0, rdlog_bytes.EVENT, *one))
    return rdlog_bytes.rdlog(session, reads)
