"""The conversions of MDF 4 channels of numbers: which physical value a stored number stands for.

Layout (ASAM MDF 4.1, CC block): of a linear conversion the offset and the factor; of a rational one six coefficients;
of a table from value to value a key and a value by turns, between which is interpolated (type 4) or the nearest key
taken (type 5); of ranges a lower key, an upper key and a value by turns, and a value for what is in none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.containers.stored_channels import Damaged
from recoil_acquisition.readers.mdf.channel_groups import MdfChannel, MdfDamageError
from recoil_acquisition.readers.mdf.conversion import conversion_values

NONE, LINEAR, RATIONAL, INTERPOLATED, NEAREST, RANGES = 0, 1, 2, 4, 5, 6
_NUMERIC = frozenset({NONE, LINEAR, RATIONAL, INTERPOLATED, NEAREST, RANGES})
_OTHERS = {3: "a formula as text", 7: "an enumeration (value to text)", 8: "an enumeration (range to text)",
           9: "text to value", 10: "text to text", 11: "a bit field as text"}  # fmt: skip

Stored = NDArray[np.int64] | NDArray[np.uint64] | NDArray[np.float64]


@dataclass(frozen=True)
class NumberConversion:
    """From stored numbers to physical values.

    Attributes
    ----------
    kind
        Type of the conversion, as the standard numbers it.
    """

    kind: int
    values: tuple[float, ...]

    @property
    def linear(self) -> tuple[float, float] | None:
        """Gain and offset; None if it is not linear."""
        if self.kind == NONE:
            return 1.0, 0.0
        return (self.values[1], self.values[0]) if self.kind == LINEAR else None

    def applied(self, stored: Stored) -> NDArray[np.float64]:
        """Return the physical values of stored numbers, shape (n,)."""
        x = stored.astype(np.float64)
        if self.kind == NONE:
            return x
        if self.kind == LINEAR:
            return np.asarray(x * self.values[1] + self.values[0])
        with np.errstate(all="ignore"):
            if self.kind == RATIONAL:
                a, b, c, d, e, f = self.values
                return np.asarray((a * x * x + b * x + c) / (d * x * x + e * x + f))
            if self.kind == RANGES:
                return self._by_range(x, is_whole=stored.dtype.kind in "iu")
        keys, values = self._table
        if self.kind == INTERPOLATED:
            return np.asarray(np.interp(x, keys, values), np.float64)
        above = np.searchsorted(keys, x).clip(max=keys.size - 1)
        below = (above - 1).clip(min=0)
        return np.asarray(np.where(x - keys[below] <= keys[above] - x, values[below], values[above]))

    @cached_property
    def _table(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Keys and values of a table."""
        return np.array(self.values[::2]), np.array(self.values[1::2])

    def _by_range(self, x: NDArray[np.float64], *, is_whole: bool) -> NDArray[np.float64]:
        """Return the values of ranges, the first that fits; the upper key belongs to it where numbers are whole."""
        found = np.full(x.shape, self.values[-1])
        for at in reversed(range(0, len(self.values) - 1, 3)):
            low, high, value = self.values[at : at + 3]
            found[(x >= low) & ((x <= high) if is_whole else (x < high))] = value
        return found


def number_conversion(content: bytes, channel: MdfChannel) -> NumberConversion | str:
    """Return the conversion of a channel to numbers, or why it has none.

    Parameters
    ----------
    content
        Bytes of the whole file.
    """
    try:
        kind, values = conversion_values(content, channel)
    except MdfDamageError as error:
        return Damaged(f"damaged: {error}")
    return checked_conversion(kind, values) if kind in _NUMERIC else enumeration_of(kind)


def enumeration_of(kind: int) -> str:
    """Return the name of a kind of conversion that gives no number."""
    return _OTHERS.get(kind, f"conversion {kind}")


def checked_conversion(kind: int, values: tuple[float, ...]) -> NumberConversion | str:
    """Return the conversion of a numeric kind with its values, or why they are damaged."""
    fits = {
        NONE: True, LINEAR: len(values) >= 2 and all(map(math.isfinite, values)), RATIONAL: len(values) == 6,
        RANGES: len(values) % 3 == 1, INTERPOLATED: _is_table(values), NEAREST: _is_table(values),
    }  # fmt: skip
    if not fits[kind]:
        return f"damaged: a conversion of type {kind} with the numbers {', '.join(f'{v:g}' for v in values[:8])}"
    return NumberConversion(kind, values)


def _is_table(values: tuple[float, ...]) -> bool:
    return len(values) >= 2 and len(values) % 2 == 0 and bool((np.diff(values[::2]) > 0).all())
