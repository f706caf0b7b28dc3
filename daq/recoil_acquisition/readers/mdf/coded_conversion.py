"""The conversions of MDF channels that hold words among numbers: a number that stands for a word is no measurement.

Layout (ASAM MDF 4.1, CC block): a table from value (type 7) or from range (type 8) has a link for each of its keys, or
pairs of keys, and a last one for any other number. A link leads to a text, or to another conversion, by which the
number is one; without the last link any other number stands for an empty text. The upper key belongs to a range where
numbers are whole.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.containers.stored_channels import Damaged
from recoil_acquisition.readers.mdf.channel_groups import INTEGERS, UNSIGNED, MdfChannel, MdfDamageError, text_of
from recoil_acquisition.readers.mdf.conversion import conversion_values, unit_of
from recoil_acquisition.readers.mdf.number_conversion import (
    NONE,
    NumberConversion,
    Stored,
    enumeration_of,
    number_conversion,
)
from recoil_acquisition.readers.statements import last_of_all

BY_VALUE, BY_RANGE = 7, 8
_MOST_TEXT = 400
"""Bytes that are looked at of a text that names a number."""


@dataclass(frozen=True, eq=False)
class CodedConversion:
    """From stored numbers to physical values, but where they stand for words.

    Attributes
    ----------
    kind
        Type of the conversion, as MDF 4 numbers it.
    lower, upper : ndarray of float64, shape (n_ranges,)
        Keys, increasing; ranges do not lie over one another.
    meanings
        Word or conversion of each range, and of any other number: n_ranges + 1.
    """

    kind: int
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    meanings: tuple[NumberConversion | str, ...]

    @property
    def linear(self) -> tuple[float, float] | None:
        """Gain and offset of all numbers that stand for none; None if they differ, or are not linear."""
        found = {one.linear for one in self.meanings if not isinstance(one, str)}
        return found.pop() if len(found) == 1 else None

    def applied(self, stored: Stored) -> NDArray[np.float64]:
        """Return the physical values of stored numbers, NaN where they stand for words, shape (n,)."""
        values = np.full(stored.shape, np.nan)
        for place, chosen in self._chosen(stored).items():
            meaning = self.meanings[place]
            if not isinstance(meaning, str):
                values[chosen] = meaning.applied(stored[chosen])
        return values

    def codes(self, stored: Stored) -> dict[str, int]:
        """Return how many numbers stand for each word, by number and word."""
        return {
            self._called(place): chosen.size
            for place, chosen in self._chosen(stored).items()
            if isinstance(self.meanings[place], str)
        }

    def _called(self, place: int) -> str:
        if place == self.lower.size:
            return f"any other number {self.meanings[place]!r}"
        low, high = self.lower[place], self.upper[place]
        return f"{low:.15g}{f' to {high:.15g}' if high > low else ''} {self.meanings[place]!r}"

    def _chosen(self, stored: Stored) -> Mapping[int, NDArray[np.intp]]:
        """Return where the numbers of each range are, and of none."""
        x = stored.astype(np.float64)
        is_closed = self.kind == BY_VALUE or stored.dtype.kind in "iu"
        place = np.searchsorted(self.upper, x, side="left" if is_closed else "right")
        place[~(x >= np.append(self.lower, np.inf)[place])] = self.lower.size
        order = np.argsort(place, kind="stable")
        found, begins = np.unique(place[order], return_index=True)
        return dict(zip(found.tolist(), np.split(order, begins[1:]), strict=True)) if found.size else {}


def coded_conversion(
    kind: int, keys: Sequence[float], meanings: Sequence[NumberConversion | str]
) -> CodedConversion | str:
    """Return the conversion of a table of ranges, lower and upper keys by turns, or why its channel has no numbers."""
    lower, upper = np.array(keys[::2]), np.array(keys[1::2])
    order = np.lexsort((upper, lower))
    lower, upper = lower[order], upper[order]
    if len(keys) != 2 * len(meanings) - 2 or not (lower <= upper).all() or (upper[:-1] > lower[1:]).any():
        return Damaged(f"damaged: a table of the {len(meanings)} texts and the ranges {', '.join(map(repr, keys[:8]))}")
    if all(isinstance(one, str) for one in meanings):
        return enumeration_of(kind)
    return CodedConversion(kind, lower, upper, (*(meanings[at] for at in order), meanings[-1]))


def conversion_of(content: bytes, channel: MdfChannel) -> NumberConversion | CodedConversion | str:
    """Return the conversion of a channel, or why it has no numbers.

    Parameters
    ----------
    content
        Bytes of the whole file.
    """
    try:
        kind, values = conversion_values(content, channel)
        if kind not in (BY_VALUE, BY_RANGE):
            return number_conversion(content, channel)
        links = _links(content, channel)
    except MdfDamageError as error:
        return Damaged(f"damaged: {error}")

    @cache
    def meaning_of(link: int) -> NumberConversion | str:
        return number_conversion(content, replace(channel, conversion_at=link))

    meanings: list[NumberConversion | str] = []
    units = dict.fromkeys([unit_of(content, channel)])
    for link in links:
        if content[link : link + 4] != b"##CC":
            meanings.append(text_of(content, link, _MOST_TEXT))
            continue
        meaning = meaning_of(link)
        if isinstance(meaning, str):
            return meaning
        meanings.append(meaning)
        units[unit_of(content, replace(channel, conversion_at=link))] = None
    units.pop("", None)
    if len(units) > 1:
        return f"its ranges have the units {', '.join(units)}"
    if links and not links[-1] and _has_numbers(channel, kind, values, meanings):
        meanings[-1] = NumberConversion(NONE, ())
    keys = values if kind == BY_RANGE else [key for key in values for _ in "<>"]
    return coded_conversion(kind, keys, meanings)


def unit_of_any(content: bytes, channel: MdfChannel) -> str:
    """Return the unit of a channel, or that of the conversions to which the links of its own lead."""
    unit = unit_of(content, channel)
    try:
        links = () if unit or not channel.conversion_at else _links(content, channel)
    except MdfDamageError:
        return unit
    units = (unit_of(content, replace(channel, conversion_at=at)) for at in dict.fromkeys(links) if at)
    return next(filter(None, units), unit)


def _links(content: bytes, channel: MdfChannel) -> tuple[int, ...]:
    """Return the links of a conversion to what its keys stand for; raises `MdfDamageError` if it is damaged."""
    conversion_values(content, channel)
    at = channel.conversion_at
    (count,) = struct.unpack_from("<Q", content, at + 16)
    return struct.unpack_from(f"<{count - 4}Q", content, at + 24 + 8 * 4)


def _has_numbers(
    channel: MdfChannel, kind: int, keys: Sequence[float], meanings: Sequence[NumberConversion | str]
) -> bool:
    """Return whether any other number of a table is what it is: all that it says are words for the largest ones."""
    if kind != BY_VALUE or channel.data_type not in INTEGERS or not all(isinstance(one, str) for one in meanings):
        return False
    is_signed = channel.data_type not in UNSIGNED
    most = (1 << channel.bits - is_signed) - 1
    named = {int(key): "" for key in keys if key == round(key)} if all(map(np.isfinite, keys)) else {}
    return bool(last_of_all(named, -most - 1 if is_signed else 0, most)) and len(named) == len(keys)
