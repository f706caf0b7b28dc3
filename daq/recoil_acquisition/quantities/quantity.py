"""Physical quantities, their SI units, and the units that instruments write.

All samples inside the project are SI. Units occur at the edges only: in the headers of the
instruments' files and in the rig file. Spellings are normalised first, because ``m/s2``,
``m/s^2``, ``m/s²`` and ``m/s**2`` all occur in exports of one and the same recorder.

Conversion factors: the SI brochure (BIPM, 9th edition) and NIST SP 811, appendix B.

A pressure is that above the surrounding air, which is what drives a piston: gauges without another mark read it.
Absolute ones (bara, psia) lose the standard atmosphere on the way to SI; a rig that uses one is told so.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from types import MappingProxyType
from typing import overload

import numpy as np
from numpy.typing import NDArray

STANDARD_GRAVITY_M_S2 = 9.80665
"""Standard acceleration of gravity, exact by definition (3rd CGPM, 1901)."""

STANDARD_ATMOSPHERE_PA = 101325.0
"""Standard atmosphere, exact by definition (10th CGPM, 1954)."""

_POUND_KG = 0.45359237
_INCH_M = 0.0254

SI_UNITS = MappingProxyType(
    {
        "acceleration": "m/s^2",
        "angle": "rad",
        "angular_acceleration": "rad/s^2",
        "angular_rate": "rad/s",
        "charge": "C",
        "count": "1",
        "current": "A",
        "displacement": "m",
        "force": "N",
        "frequency": "Hz",
        "mass": "kg",
        "pressure": "Pa",
        "strain": "1",
        "temperature": "K",
        "time": "s",
        "torque": "N*m",
        "velocity": "m/s",
        "voltage": "V",
        "voltage_ratio": "V/V",
    }
)
"""Quantity -> its SI unit, in the spelling that UDUNITS and pint both read."""


@dataclass(frozen=True)
class Unit:
    """One unit: ``SI value = factor * value + offset``.

    Attributes
    ----------
    quantities
        The quantities that it may express.
    factor
        Number of SI units in one unit.
    offset
        Zero of the unit, in SI units; nonzero only for temperatures, and for absolute pressures, whose zero is
        a vacuum.
    """

    quantities: frozenset[str]
    factor: float
    offset: float = 0.0

    @overload
    def to_si(self, value: float) -> float: ...
    @overload
    def to_si(self, value: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def to_si(self, value: float | NDArray[np.float64]) -> float | NDArray[np.float64]:
        """Convert a number, or an array of any shape, from this unit to SI."""
        return self.factor * value + self.offset

    @property
    def is_absolute_pressure(self) -> bool:
        """Whether it counts a pressure from a vacuum; SI counts it from the air's."""
        return bool(self.offset) and "pressure" in self.quantities

    def from_si(self, value: float) -> float:
        """Convert a number from SI to this unit."""
        return (value - self.offset) / self.factor


_ABSOLUTE = {
    "bara": "bar", "mbara": "mbar", "Paa": "Pa", "kPaa": "kPa", "MPaa": "MPa", "psia": "psi", "ksia": "ksi",
    "ata": "kgf/cm^2",
}  # fmt: skip
"""Units of absolute pressure -> the unit of the same size above the surrounding air."""


def _table() -> dict[str, Unit]:
    lengths = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "km": 1e3, "in": _INCH_M, "ft": 12 * _INCH_M}
    angles = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "rev": 2 * math.pi}
    g = STANDARD_GRAVITY_M_S2
    psi = _POUND_KG * g / _INCH_M**2
    factors: dict[str, dict[str, float]] = {
        "displacement": lengths,
        "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
        "angle": angles,
        "velocity": _per(lengths, "s") | {"km/h": 1 / 3.6, "mph": 5280 * 12 * _INCH_M / 3600},
        "acceleration": _per(lengths, "s^2")
        | {"g": g, "gn": g, "g_n": g, "g0": g, "mg": 1e-3 * g, "kg_n": 1e3 * g},
        "angular_rate": _per(angles, "s") | {"dps": angles["deg"], "rpm": 2 * math.pi / 60},
        "angular_acceleration": _per(angles, "s^2"),
        "pressure": {
            "Pa": 1.0, "hPa": 1e2, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5, "mbar": 1e2,
            "kbar": 1e8, "atm": 101325.0, "psi": psi, "ksi": 1e3 * psi, "kgf/cm^2": g * 1e4,
            "N/mm^2": 1e6, "N/cm^2": 1e4, "kN/m^2": 1e3, "kgf/mm^2": g * 1e6, "Torr": STANDARD_ATMOSPHERE_PA / 760,
            "mmHg": 133.322387415, "inHg": 25.4 * 133.322387415, "mmH2O": g, "cmH2O": 10 * g, "inH2O": 25.4 * g,
        },
        "force": {
            "N": 1.0, "mN": 1e-3, "daN": 10.0, "kN": 1e3, "MN": 1e6, "kgf": g, "lbf": _POUND_KG * g,
            "ozf": _POUND_KG * g / 16, "klbf": 1e3 * _POUND_KG * g,
        },
        "voltage": {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "kV": 1e3},
        "voltage_ratio": {"V/V": 1.0, "mV/V": 1e-3, "uV/V": 1e-6},
        "current": {"A": 1.0, "mA": 1e-3, "uA": 1e-6},
        "charge": {"C": 1.0, "pC": 1e-12, "nC": 1e-9},
        "mass": {"kg": 1.0, "t": 1e3, "lb": _POUND_KG, "oz": _POUND_KG / 16, "slug": _POUND_KG * g / (12 * _INCH_M)},
        "frequency": {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6},
        "torque": {
            "N*m": 1.0, "kN*m": 1e3, "lbf*ft": _POUND_KG * g * 12 * _INCH_M, "lbf*in": _POUND_KG * g * _INCH_M,
        },
        "count strain": {"1": 1.0, "%": 0.01},
        "strain": {"um/m": 1e-6},
        "temperature": {"K": 1.0, "degR": 5 / 9},
    }  # fmt: skip
    units = {
        spelling: Unit(frozenset(quantities.split()), factor)
        for quantities, own in factors.items()
        for spelling, factor in own.items()
    }
    absolute = {
        name: Unit(frozenset({"pressure"}), factors["pressure"][above], -STANDARD_ATMOSPHERE_PA)
        for name, above in _ABSOLUTE.items()
    }
    temperature = frozenset({"temperature"})
    zeros = {"degC": Unit(temperature, 1.0, 273.15), "degF": Unit(temperature, 5 / 9, 273.15 - 32 * 5 / 9)}
    return units | absolute | zeros


def _per(factors: dict[str, float], time: str) -> dict[str, float]:
    return {f"{spelling}/{time}": factor for spelling, factor in factors.items()}


UNITS = MappingProxyType(_table())
"""Normalised spelling -> unit."""

_SYMBOLS = {
    "Nm": "N*m", "kNm": "kN*m", "N/m^2": "Pa", "m/s/s": "m/s^2",
    "ms^-2": "m/s^2", "ms-2": "m/s^2", "m*s^-2": "m/s^2", "m*s-2": "m/s^2",
    # accelerometers' makers write the multiple of gravity as a capital too; a gauss is no unit of a quantity here
    "G": "g",
    # pressure above that of the air, which is what a gauge without another mark reads; an absolute one is not the same
    "barg": "bar", "mbarg": "mbar", "Pag": "Pa", "kPag": "kPa", "MPag": "MPa", "psig": "psi", "ksig": "ksi",
    "bar_g": "bar", "psi_g": "psi", "barü": "bar", "atü": "kgf/cm^2",
    "bar_a": "bara", "psi_a": "psia", "kPa_a": "kPaa", "barabs": "bara", "mbarabs": "mbara", "kPaabs": "kPaa",
    "MPaabs": "MPaa", "psiabs": "psia", "Paabs": "Paa",
    # pounds, feet and inches of force and pressure, as American labs write them
    "kip": "klbf", "kips": "klbf", "kipf": "klbf", "lbf/in^2": "psi", "lb/in^2": "psi", "lbs/in^2": "psi",
    "kip/in^2": "ksi", "kips/in^2": "ksi",
    "ft*lbf": "lbf*ft", "ft*lb": "lbf*ft", "ft-lb": "lbf*ft", "ft-lbf": "lbf*ft", "ft-lbs": "lbf*ft",
    "lbf-ft": "lbf*ft", "lb-ft": "lbf*ft", "lb*ft": "lbf*ft", "in*lbf": "lbf*in", "in-lbf": "lbf*in", "in-lb": "lbf*in",
    "lbf-in": "lbf*in", "lb-in": "lbf*in",
    # what hangs on a spring balance, and its pressure
    "kp": "kgf", "kp/cm^2": "kgf/cm^2", "kg/cm^2": "kgf/cm^2", "kp/mm^2": "kgf/mm^2", "kg/mm^2": "kgf/mm^2",
    "in/sec^2": "in/s^2", "ft/sec^2": "ft/s^2", "N-m": "N*m", "kN-m": "kN*m",
    # turns, as DIN 1301 and German labs write them: a sampling rate or a frequency in 1/min is met nowhere
    "1/min": "rpm", "U/min": "rpm", "r/min": "rpm", "rev/min": "rpm", "min^-1": "rpm", "min-1": "rpm",
}  # fmt: skip
"""Symbols that mean the same as others; their case counts, because Nm is not nm."""

_WORDS = {
    "1": "- counts count strain", "deg": "° degree degrees", "degC": "°c degc celsius",
    "degF": "degf °f fahrenheit", "K": "kelvin", "degR": "rankine", "bar": "bar barg", "bara": "bara",
    "psi": "psi psig", "psia": "psia", "ksi": "ksi", "Torr": "torr", "mmHg": "mmhg", "inHg": "inhg", "lbf": "lbf",
    "%": "percent", "um/m": "microstrain ue uε ustrain", "V": "volt volts", "mV": "millivolt millivolts",
    "A": "amp amps ampere amperes", "N": "newton newtons", "Pa": "pascal", "m": "meter meters metre metres",
    "in": "inch inches", "ft": "feet foot", "lb": "lbs", "Hz": "hertz", "km/h": "kph kmh", "rpm": "rpm",
    "s": "sec second seconds", "ms": "millisecond milliseconds", "min": "minute minutes", "h": "hour hours",
}  # fmt: skip
"""Unit -> words for it, in letters of any size."""

_SPELLINGS = {"": "1"} | {word: unit for unit, words in _WORDS.items() for word in words.split()}

_SECONDS = re.compile(r"/sec(?=(\^?2)?$)")
"""Pattern of the seconds by which labs spell out a rate."""


def normalise_unit(spelling: str) -> str:
    """Reduce a unit's spelling to the one used in `UNITS`, as far as that is unambiguous.

    Parameters
    ----------
    spelling
        Unit as it stands in a file's header or a rig file.

    Returns
    -------
    str
        Unit in one spelling: ``m/s²``, ``m/s2``, ``m/s**2`` ``m/(s^2)`` and ``ms⁻²`` all give ``m/s^2``; ``µ`` and
        ``μ`` give ``u``.
    """
    text = spelling.strip().replace("⁻²", "^-2").replace("²", "^2").replace("**", "^").replace("·", "*")
    text = "".join(text.replace("µ", "u").replace("μ", "u").replace("(", "").replace(")", "").split())
    text = _SECONDS.sub("/s", text)
    if text.endswith(("/s2", "/m2", "/cm2", "/mm2", "/in2")):
        text = f"{text[:-1]}^2"
    if text in UNITS:
        return text
    text = text.replace("°", "deg") if len(text) > 1 and text.casefold() not in ("°c", "°f") else text
    text = _SYMBOLS.get(text, text)
    return text if text in UNITS else _SPELLINGS.get(text.casefold(), text)


def find_unit(spelling: str) -> Unit | None:
    """Look up a unit by any of its spellings.

    Returns
    -------
    Unit or None
        None if the spelling is unknown; nothing is guessed.
    """
    return UNITS.get(normalise_unit(spelling))


_BY_TIME = MappingProxyType(
    {
        "displacement": "velocity",
        "velocity": "acceleration",
        "angle": "angular_rate",
        "angular_rate": "angular_acceleration",
    }
)
"""Quantity -> the one that it changes by."""


def find_rate_unit(spelling: str, quantity: str) -> Unit | None:
    """Look up a unit in which a quantity changes, such as ``MPa/ms``, ``m/s``; None if there is none such."""
    whole = find_unit(spelling)
    if whole is not None and _BY_TIME.get(quantity) in whole.quantities:
        return whole
    of, _, by = spelling.rpartition("/")
    unit, time = find_unit(of) if of.strip() else None, find_unit(by)
    if unit is None or time is None or "time" not in time.quantities or quantity not in unit.quantities:
        return None
    return Unit(frozenset({f"{quantity} per time"}), unit.factor / time.factor)
