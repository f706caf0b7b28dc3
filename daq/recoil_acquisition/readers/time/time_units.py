"""Units of time as recorders, cameras and people write them."""

from __future__ import annotations

TIME_UNITS_S = {
    "s": 1.0, "sec": 1.0, "sec.": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3, "msec.": 1e-3,
    "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0,
}  # fmt: skip
"""Unit -> seconds."""

DAY_S = 86400.0
