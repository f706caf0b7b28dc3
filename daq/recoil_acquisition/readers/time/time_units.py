"""Units of time, and of sample rates, as recorders, cameras and people write them."""

from __future__ import annotations

TIME_UNITS_S = {
    "s": 1.0, "sec": 1.0, "sec.": 1.0, "second": 1.0, "seconds": 1.0, "sek": 1.0, "ms": 1e-3, "msec": 1e-3,
    "msec.": 1e-3, "millisecond": 1e-3, "milliseconds": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "usec": 1e-6,
    "µsec": 1e-6, "μsec": 1e-6, "microsecond": 1e-6, "microseconds": 1e-6, "ns": 1e-9, "nsec": 1e-9,
    "nanosecond": 1e-9, "nanoseconds": 1e-9, "min": 60.0, "min.": 60.0, "minute": 60.0, "minutes": 60.0, "h": 3600.0,
    "hr": 3600.0, "hour": 3600.0, "hours": 3600.0, "d": 86400.0, "day": 86400.0, "days": 86400.0,
}  # fmt: skip
"""Unit -> seconds."""

MOST_S = 1e11
"""Time that no recording lasts, and no clock's epoch is away: some 3000 years."""

RATE_UNITS_HZ = {
    "hz": 1.0, "hertz": 1.0, "1/s": 1.0, "s^-1": 1.0, "s-1": 1.0, "/s": 1.0, "s/s": 1.0, "sa/s": 1.0, "sps": 1.0,
    "samples/s": 1.0, "samples/sec": 1.0, "samples/second": 1.0, "samples per second": 1.0, "fps": 1.0,
    "khz": 1e3, "ks/s": 1e3, "ksa/s": 1e3, "ksps": 1e3, "1/ms": 1e3, "ms/s": 1e6, "msa/s": 1e6, "msps": 1e6,
    "1/min": 1.0 / 60.0,
}  # fmt: skip
"""Unit in small letters -> hertz; but for MHz and mHz, which only the first letter's size tells apart."""

DAY_S = 86400.0
_BRACKETS = {"[": "]", "(": ")"}


def time_unit_s(spelling: str) -> float | None:
    """Return the seconds of a unit of time, with or without brackets, in letters of any size; None if it is none."""
    return TIME_UNITS_S.get(_bare(spelling).casefold())


def rate_unit_hz(spelling: str) -> float | None:
    """Return the hertz of a unit of sample rates, with or without brackets; None if it is none."""
    unit = _bare(spelling)
    if unit.casefold() == "mhz":
        return {"MHz": 1e6, "MHZ": 1e6, "mHz": 1e-3}.get(unit)
    return RATE_UNITS_HZ.get(unit.casefold())


def _bare(spelling: str) -> str:
    text = spelling.strip()
    if len(text) > 2 and _BRACKETS.get(text[0]) == text[-1]:
        return text[1:-1].strip()
    return text
