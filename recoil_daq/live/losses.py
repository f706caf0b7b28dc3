"""Losses of a device, in words."""

from __future__ import annotations

from recoil_acquisition.devices.device import Counters

NONE = "none"

NOT_COUNTED = "none seen"
"""Nothing is wrong that can be seen, but the source counts no frames: what is missing between two leaves no trace."""

_WORDS = (
    ("counter_gaps", "gap", "gaps"),
    ("kernel_drops", "dropped by the kernel", "dropped by the kernel"),
    ("bad", "damaged", "damaged"),
    ("skipped_bytes", "byte skipped", "bytes skipped"),
    ("reopened", "reconnect", "reconnects"),
    ("error_frames", "error frame", "error frames"),
)


def losses_of(counters: Counters) -> str:
    """Name everything that is not zero, the worst first; else `NONE`, or `NOT_COUNTED` where no counter is read."""
    found = []
    for name, one, many in _WORDS:
        count = getattr(counters, name)
        if count:
            found.append(f"{count} {one if count == 1 else many}")
    return ", ".join(found) or (NOT_COUNTED if counters.counter_gaps is None else NONE)
