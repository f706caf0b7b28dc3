"""Numbers as a report writes them: a value has as many digits as its uncertainty justifies.

Two significant digits of the uncertainty, and the value to the same decimal place (JCGM 100:2008, 7.2.6).
"""

from __future__ import annotations

import math
import re

from recoil_acquisition.measured import Worded, measured

NO_NUMBER = "–"
MINUS = "\N{MINUS SIGN}"
THIN = "\N{NARROW NO-BREAK SPACE}"
"""Space between groups of digits."""
PREFIXED = ("N", "Pa", "J", "W")
"""Units that take a prefix, alone or as the first of several."""
PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"))
"""Factor and sign of each prefix, from ten of which on it is taken."""
_DIGITS = re.compile(r"(?<![\w.])[1-9]\d{4,}(?!\w)")


def rounded(value: float | None, u: float | None) -> tuple[str, str]:
    """Round a value and its uncertainty for print.

    Parameters
    ----------
    value, u
        Value and its standard uncertainty in one unit. None and NaN are "no number".

    Returns
    -------
    value, u : str
        Texts, with U+2212 as minus sign. Without a usable uncertainty the value is as of `plain`.
    """
    if u is None or not math.isfinite(u) or u <= 0.0:
        return plain(value), significant(u, 2)
    # the exponent is read off the rounded number, so that 0.0996 becomes 0.10 and not 0.100
    decimals = 1 - int(f"{u:.1e}".partition("e")[2])
    return fixed(value, decimals), fixed(u, decimals)


def in_kg(mass_kg: float | None, u_kg: float | None) -> str:
    """Write a mass with its standard uncertainty and the unit, with the digits that this justifies; ASCII alone."""
    mass, u = rounded(mass_kg, u_kg)
    return f"{mass} kg (u {u} kg)".replace(MINUS, "-")


def fixed(value: float | None, decimals: int) -> str:
    """Write a number to a decimal place, which may be left of the point (negative)."""
    if value is None or not math.isfinite(value):
        return NO_NUMBER
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    if float(text) == 0.0:
        text = text.removeprefix("-")
    return text.replace("-", MINUS)


MEANINGFUL_PERCENT = 1000.0
"""RPE beyond which it says nothing but that the trace tells no mass."""


def percentage(value: float | None, text: str) -> str:
    """Return a text of a relative percentage error, or that it is beyond what has a meaning.

    >>> percentage(6.3e25, "63000000000000000000000000"), percentage(0.5, "0.50")
    ('> 1000', '0.50')
    """
    return text if value is None or not value > MEANINGFUL_PERCENT else f"> {MEANINGFUL_PERCENT:.0f}"


def significant(value: float | None, digits: int) -> str:
    """Write a number to so many significant digits, plainly where its size allows."""
    if value is None or not math.isfinite(value):
        return NO_NUMBER
    if value == 0.0:
        return "0"
    exponent = int(f"{value:.{digits - 1}e}".partition("e")[2])
    if not -5 <= exponent <= 7:
        return f"{value:.{digits - 1}e}".replace("-", MINUS)
    return fixed(value, digits - 1 - exponent)


def plain(value: float | None) -> str:
    """Write a number that has no uncertainty: five significant digits, without trailing zeros."""
    mantissa, e, exponent = significant(value, 5).partition("e")
    return (mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa) + e + exponent


def grouped(text: str) -> str:
    """Part five and more digits before the point into groups of three, for people alone (ISO 80000-1:2022, 7.3.1).

    >>> grouped("29560 to 1234567.8").replace(THIN, "_")
    '29_560 to 1_234_567.8'
    """
    return _DIGITS.sub(lambda found: f"{int(found[0]):,}".replace(",", THIN), text)


def signed(text: str) -> str:
    """Put a plus sign before a positive number that is written already."""
    return f"+{text}" if text[:1].isdigit() and text.strip("0.") else text


def prefixed(value: float | None, unit: str) -> tuple[float, str]:
    """Return the factor and the unit in which a number of many digits is read at a glance; 1 and its own where none is.

    >>> prefixed(29.4e6, "N/m")
    (1e-06, 'MN/m')
    """
    takes_one = any(unit == one or unit.startswith((f"{one} ", f"{one}/")) for one in PREFIXED)
    if value is None or not math.isfinite(value) or not takes_one:
        return 1.0, unit
    size = abs(value)
    return next(((1.0 / step, f"{prefix}{unit}") for step, prefix in PREFIXES if size >= 10 * step), (1.0, unit))


def in_unit(value: float, digits: int, unit: str) -> Worded:
    """Write a number to so many significant digits with its unit, prefixed as it reads best; none is written of 1.

    >>> in_unit(58.1e6, 2, "N m/rad")
    '58 MN m/rad'
    """
    factor, name = prefixed(value, unit)
    if name == "1":
        return Worded(significant(value, digits))
    return measured(factor * value, name, lambda number: significant(number, digits))
