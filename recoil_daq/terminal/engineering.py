"""Numbers with their units as engineers write them, such as 1.52 MPa."""

from __future__ import annotations

import math
import re

from recoil_acquisition.quantities.quantity import find_unit

PREFIXES = {-3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}
"""Power of a thousand -> prefix."""
TAKES_PREFIX = re.compile(r"(?!kg)[^\W\d_]+(?![\^0-9])")
"""Beginning of a unit that takes a prefix: a symbol without a power, and without a prefix of its own."""
_LEAST = 1e-12
"""Value below which no prefix helps."""


def takes_prefix(unit: str) -> bool:
    """Return whether a unit is written with prefixes: those of SI are, and what was chosen instead is as it is."""
    known = find_unit(unit)
    return TAKES_PREFIX.match(unit) is not None and (known is None or known.factor == 1.0)


def engineering(value: float | None, unit: str, digits: int = 3) -> str:
    """Write a number with some significant digits and the prefix that fits it.

    Parameters
    ----------
    value
        Number to write; None, and what is not finite, gives a dash.
    unit
        SI unit; one that begins with a power or with kg takes no prefix, nor does none at all.
    """
    return " ".join(part for part in _scaled(value, unit, digits) if part)


def spelled(unit: str) -> str:
    """Write a unit as short as on an instrument: m/s2 for m/s^2."""
    return unit.replace("^", "")


def _scaled(value: float | None, unit: str, digits: int = 3) -> tuple[str, str]:
    """Write a number, and the unit with the prefix that fits it."""
    if value is None or not math.isfinite(value):
        return "-", ""
    if value == 0:
        return "0", unit
    if not takes_prefix(unit) or abs(value) < _LEAST:
        return _plain(value, digits), unit
    exponent = min(max(math.floor(math.log10(abs(value)) / 3), -3), 3)
    scaled = float(f"{value / 10.0 ** (3 * exponent):.{digits}g}")
    if abs(scaled) >= 1000 and exponent < 3:
        exponent += 1
        scaled = float(f"{value / 10.0 ** (3 * exponent):.{digits}g}")
    decimals = max(digits - 1 - math.floor(math.log10(abs(scaled))), 0)
    return f"{scaled:.{decimals}f}", f"{PREFIXES[exponent]}{unit}"


def _plain(value: float, digits: int) -> str:
    """Write digits without an exponent, as long as that is no longer than with one."""
    if 1e-3 <= abs(value) < 1e6:
        rounded = float(f"{value:.{digits}g}")
        return f"{rounded:.{max(digits - 1 - math.floor(math.log10(abs(rounded))), 0)}f}"
    return f"{value:.{digits - 1}e}"
