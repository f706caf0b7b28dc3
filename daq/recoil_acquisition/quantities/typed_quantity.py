"""Quantities as people type them: a number with a decimal point or a decimal comma, perhaps with its unit behind it.

Whatever asks a person for a number reads it here: prompts, cells, options of a command line, and texts of a rig file.
What may be a thousand and more or a number with three decimals is refused, with both readings.
"""

from __future__ import annotations

import math
import re
from types import MappingProxyType

from recoil_acquisition.errors import nearest_first
from recoil_acquisition.quantities.quantity import UNITS, Unit, normalise_unit

POINT, COMMA = ".", ","
"""Decimal marks."""
_NUMBER = re.compile(r"\s*([+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.ASCII | re.DOTALL)
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}([.,])\d{3}", re.ASCII)
"""Numbers that may be a thousand and more, or have three decimals."""
_MORE_DIGITS = re.compile(r"[.,_'’]*\d|[.,]", re.ASCII)
"""What behind a number is more of it: a second mark, thousands, another number."""
_MINUS = str.maketrans("−", "-")

_POUND_KG, _INCH_M = 0.45359237, 0.0254
_FACTORS = {
    "area": {
        "m^2": 1.0, "dm^2": 1e-2, "cm^2": 1e-4, "mm^2": 1e-6, "in^2": _INCH_M**2, "ft^2": (12 * _INCH_M) ** 2,
    },
    "moment of inertia": {
        "kgm^2": 1.0, "kgcm^2": 1e-4, "kgmm^2": 1e-6, "gcm^2": 1e-7, "tm^2": 1e3,
        "lbft^2": _POUND_KG * (12 * _INCH_M) ** 2, "lbin^2": _POUND_KG * _INCH_M**2,
    },
    "viscous friction": {"Ns/m": 1.0, "kNs/m": 1e3, "Ns/mm": 1e3, "Ns/cm": 1e2},
    "scale": {"m/px": 1.0, "mm/px": 1e-3, "um/px": 1e-6},
    "mass": {"g": 1e-3, "mg": 1e-6},
    "frequency": {"1/s": 1.0, "fps": 1.0, "S/s": 1.0, "kS/s": 1e3, "MS/s": 1e6},
    "count": {"ppm": 1e-6, "‰": 1e-3},
}  # fmt: skip
_OF_PARAMETERS = MappingProxyType(
    {
        (quantity, spelling): Unit(frozenset({quantity}), factor)
        for quantity, own in _FACTORS.items()
        for spelling, factor in own.items()
    }
)
"""Units of what is typed and no channel measures; a gram among masses, which of an acceleration is gravity."""


class TypedError(ValueError):
    """A typed text is no quantity that is wanted.

    Attributes
    ----------
    problem, remedy
        Fault of the text, and how to write it instead; the remedy is empty where the problem says it.
    """

    def __init__(self, problem: str, remedy: str = "") -> None:
        super().__init__(f"{problem}: {remedy}" if remedy else problem)
        self.problem, self.remedy = problem, remedy


class NoNumberError(TypedError):
    """A typed text has no number at its beginning, or none that a float holds."""


def number_and_unit(text: str, mark: str = POINT) -> tuple[float, str]:
    """Divide a text such as ``40 mV/MPa`` into its number and what stands behind it.

    Parameters
    ----------
    mark
        Decimal mark of the place: of a number with the other one and three digits behind it nobody knows whether they
        are decimals. Empty where it is not known.

    Raises
    ------
    TypedError
        If it does not begin with a number, may be thousands or decimals, or is too large; it says what of it.
    """
    found = _NUMBER.fullmatch(text.translate(_MINUS))
    if found is None:
        raise NoNumberError("does not begin with a number")
    written, behind = found[1], found[2]
    if _MORE_DIGITS.match(behind):
        raise TypedError("is not one number", "write one decimal mark, and thousands without any")
    grouped = _GROUPED.fullmatch(written)
    if grouped is not None and grouped[1] != mark:
        whole = written.replace(grouped[1], "")
        decimal = f"{float(written.replace(COMMA, POINT)):.15g}"
        raise TypedError(f"may be thousands or decimals, {whole} or {decimal}", f"write {whole} or {written}0")
    number = float(written.replace(COMMA, POINT))
    if not math.isfinite(number):
        raise NoNumberError("has a number that is too large")
    return number, behind


def typed_quantity(text: str, unit: str | None, mark: str = POINT, *, difference: bool = False) -> float:
    """Read a number, which may have its unit behind it, in one unit.

    >>> typed_quantity("113,1 cm2", "m2")
    0.01131

    Parameters
    ----------
    unit
        Unit of the value returned, and of a number without any; empty for a share, of which percent may be written;
        None for a plain number, which has none.
    mark
        Decimal mark of the place, as for `number_and_unit`.
    difference
        Whether it is one of two values, such as a standard uncertainty: degrees and absolute pressures then have no
        zero of their own.

    Raises
    ------
    TypedError
        As `number_and_unit`, and if the unit is none of the quantity's; it says what of the text.
    """
    number, spelling = number_and_unit(text, mark)
    if not spelling:
        return number
    if unit is None:
        raise TypedError(f"has the unit {spelling[:40]!r}, and is a plain number", "leave the unit out")
    if _key(spelling) == _key(unit):
        return number
    known = _units_like(unit)
    given, own = known.get(_key(spelling)), known.get(_key(unit))
    if given is None or own is None:
        nearest = ", ".join(nearest_first(_key(spelling), sorted(known))[:3])
        wanted = f"a value in {unit}" if unit else "a share"
        problem = f"has the unit {spelling[:40]!r}, which is none of {wanted}"
        raise TypedError(problem, nearest and f"nearest: {nearest}")
    value = number * (given.factor / own.factor) if difference else own.from_si(given.to_si(number))
    # without what binary fractions add behind the fifteenth digit
    return float(f"{value:.15g}")


def _units_like(unit: str) -> dict[str, Unit]:
    """Return the units of the quantity that a unit is of, by their spellings."""
    key = _key(unit)
    of_parameters = {quantity for quantity, spelling in _OF_PARAMETERS if spelling == key}
    quantities = UNITS[key].quantities if key in UNITS else of_parameters
    found = {name: one for name, one in UNITS.items() if one.quantities & quantities}
    return found | {name: one for (quantity, name), one in _OF_PARAMETERS.items() if quantity in quantities}


def _key(spelling: str) -> str:
    """Return a unit in the spelling of `UNITS`, or in that of `_FACTORS`, which has no signs between factors."""
    known = normalise_unit(spelling)
    if known in UNITS:
        return known
    return re.sub(r"(?<=[a-z])2$", "^2", known.replace("*", ""))
