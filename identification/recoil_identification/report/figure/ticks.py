"""Where an axis has its ticks, and what stands beside them: steps of 1, 2 and 5, or decades."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal

from recoil_identification.estimate.rounding import MINUS, fixed

PLAIN_POWERS = range(-3, 5)
"""Powers of ten that are written out."""
LEAST_DECADES = 2
"""Fewer have ticks between them that are labelled, too."""


@dataclass(frozen=True)
class Ticks:
    """Ticks of one axis.

    Attributes
    ----------
    values
        Ascending, within the range of the axis.
    labels
        One for each value, empty beside a small tick; ``10^3`` where the exponent is to be raised.
    exponent
        Exponent of the power of ten that the labels have to be multiplied by; 0 on a logarithmic axis.
    """

    values: tuple[float, ...]
    labels: tuple[str, ...]
    exponent: int = 0


def linear_ticks(low: float, high: float, most: int) -> Ticks:
    """Divide an axis by steps of 1, 2 or 5 times a power of ten.

    Parameters
    ----------
    low, high
        Finite, ascending.
    most
        About so many ticks at most.

    Returns
    -------
    Ticks
        Ticks, at least one, where ``low`` and ``high`` differ by more than a float's digits.
    """
    rough = high / most - low / most
    power = math.floor(math.log10(rough))
    lead = float(Decimal(rough).scaleb(-power))
    factor = next((one for one in (1, 2, 5) if one >= lead * (1 - 1e-9)), 10)
    step = float(Decimal(factor).scaleb(power))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    values = tuple(min(max(number * step, low), high) for number in range(first, last + 1))
    largest = max(abs(low), abs(high))
    exponent = 0 if 1e-2 <= largest < 1e5 else 3 * math.floor(math.log10(largest) / 3)
    decimals = max(0, exponent - power - (factor == 10))
    labels = tuple(fixed(float(Decimal(value).scaleb(-exponent)), decimals) for value in values)
    return Ticks(values, labels, exponent)


def log_ticks(low: float, high: float, most: int) -> Ticks:
    """Divide a logarithmic axis by its decades.

    Parameters
    ----------
    low, high
        Positive, ascending.
    most
        About so many labels at most.

    Returns
    -------
    Ticks
        Ticks; those between decades have no labels, unless there are hardly any decades.
    """
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    if last - first + 1 < LEAST_DECADES:
        found = [
            (value, _number(value, power))
            for power in range(first - 1, last + 1)
            for value in (lead * 10.0**power for lead in (1, 2, 5))
            if low <= value <= high
        ]
        if len(found) < LEAST_DECADES:
            return linear_ticks(low, high, most)
        return Ticks(tuple(value for value, _ in found), tuple(label for _, label in found))
    stride = -(-(last - first + 1) // most)
    written = all(power in PLAIN_POWERS for power in (first, last))
    found = []
    for power in range(first - 1, last + 1):
        if stride > 1 and power % stride:
            continue
        label = _number(10.0**power, power) if written else f"10^{power}".replace("-", MINUS)
        found += [(lead * 10.0**power, label if lead == 1 else "") for lead in (range(1, 10) if stride == 1 else (1,))]
    within = [(value, label) for value, label in found if low <= value <= high]
    return Ticks(tuple(value for value, _ in within), tuple(label for _, label in within))


def _number(value: float, power: int) -> str:
    """Write a tick of a decade; powers that are not written out as 2e6."""
    return fixed(value, max(0, -power)) if power in PLAIN_POWERS else f"{value:.0e}".replace("-", MINUS)
