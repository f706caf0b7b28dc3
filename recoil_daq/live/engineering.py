"""Numbers with a unit as a range engineer reads them: 1.52 MPa, -3.4 mrad/s."""

from __future__ import annotations

import math

_PREFIXES = {-3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}


def engineering(value: float | None, unit: str, digits: int = 3) -> str:
    """Write a number with some significant digits and the prefix that fits it.

    Parameters
    ----------
    value
        None, and what is not finite, gives a dash.
    unit
        Of SI. One with a power in it takes no prefix, nor does none at all.
    """
    if value is None or not math.isfinite(value):
        return "-"
    if value == 0:
        return f"0 {unit}".strip()
    exponent = math.floor(math.log10(abs(value)) / 3)
    if not unit[:1].isalpha() or "2" in unit or "^" in unit:
        return f"{_plain(value, digits)} {unit}".strip()
    exponent = min(max(exponent, -3), 3)
    scaled = float(f"{value / 10.0 ** (3 * exponent):.{digits}g}")
    if abs(scaled) >= 1000 and exponent < 3:
        exponent += 1
        scaled = float(f"{value / 10.0 ** (3 * exponent):.{digits}g}")
    decimals = max(digits - 1 - math.floor(math.log10(abs(scaled))), 0)
    return f"{scaled:.{decimals}f} {_PREFIXES[exponent]}{unit}"


def _plain(value: float, digits: int) -> str:
    """Write digits without an exponent, as long as that is no longer than with one."""
    if 1e-3 <= abs(value) < 1e6:
        rounded = float(f"{value:.{digits}g}")
        return f"{rounded:.{max(digits - 1 - math.floor(math.log10(abs(rounded))), 0)}f}"
    return f"{value:.{digits - 1}e}"
