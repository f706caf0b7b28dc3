"""Figures within a text, as values with their units, and where in the text their words stand.

::

    Worded     a text that knows its figures
    +-- Measured   one figure: value, unit, and the place of its words

A text is put together of pieces (`worded`), so that a figure's place is known and never looked for: a name that looks
like a figure is none. At the edge each figure may be worded again, in another unit, and nothing else of the text is.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self


@dataclass(frozen=True)
class Measured:
    """A figure of a text.

    Attributes
    ----------
    value, unit
        Number, and its unit as the text spells it.
    start, end
        Place of its words in the text, in characters: the number, and the unit unless that follows with another figure.
    """

    value: float
    unit: str
    start: int
    end: int

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types, as an entry of ``figures``."""
        return {"value": self.value, "unit": self.unit, "at": [self.start, self.end]}


class Worded(str):
    """A text with its figures, in the order of their places.

    Attributes
    ----------
    figures
        The figures; those that were not given stay a part of the text.
    """

    __slots__ = ("figures",)
    figures: tuple[Measured, ...]

    def __new__(cls, text: str, figures: Iterable[Measured] = ()) -> Self:
        """Attach figures to a text."""
        self = super().__new__(cls, text)
        self.figures = tuple(figures)
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Keep the figures where it is given to another process."""
        return type(self), (str(self), self.figures)


def measured(value: float, unit: str, form: str | Callable[[float], str], *, unit_follows: bool = False) -> Worded:
    """Word a figure: its number and its unit.

    Parameters
    ----------
    value, unit
        Number, and its unit as the text is to spell it; what is no number, or has no unit, is a text alone.
    form
        Format of the number, or the function that writes it.
    unit_follows
        Whether the unit is left to a later figure of the same text: ``0.30`` of "0.30 to 0.50 MPa".

    >>> measured(12.5, "MPa", ".3g")
    '12.5 MPa'
    """
    number = form(value) if callable(form) else format(value, form)
    text = number if unit_follows else f"{number} {unit}"
    known = math.isfinite(value) and bool(unit)
    return Worded(text, (Measured(float(value), unit, 0, len(text)),) if known else ())


def worded(*pieces: str) -> Worded:
    """Put a text together; the figures of its pieces keep their words.

    >>> worded("channel p 20 MPa reads ", measured(12.5, "MPa", ".3g")).figures
    (Measured(value=12.5, unit='MPa', start=23, end=31),)
    """
    figures, at = list[Measured](), 0
    for piece in pieces:
        figures += [replace(one, start=at + one.start, end=at + one.end) for one in figures_of(piece)]
        at += len(piece)
    return Worded("".join(pieces), figures)


def joined(between: str, texts: Iterable[str]) -> Worded:
    """Put texts together with another between them, as ``between.join(texts)``; their figures keep their words."""
    return worded(*[piece for text in texts for piece in (between, text)][1:])


def figures_of(text: str) -> tuple[Measured, ...]:
    """Return the figures of a text; none of one that does not know them."""
    return text.figures if isinstance(text, Worded) else ()


def beside(text: str) -> dict[str, Any]:
    """Return what a document states beside a text: its ``figures``; nothing where it has none."""
    figures = [one.to_json() for one in figures_of(text)]
    return {"figures": figures} if figures else {}


def with_figures(text: str, row: Mapping[str, Any]) -> Worded:
    """Return a text with the figures that a document states beside it.

    What is no place in the text, or overlaps another, is none of its figures: the text stays as it is.
    """
    found, at = list[Measured](), 0
    entries = row.get("figures")
    for entry in entries if isinstance(entries, list) else ():
        match entry:
            case {"value": int() | float() as value, "unit": str(unit), "at": [int(start), int(end)]}:
                if not at <= start < end <= len(text) or not abs(value) <= sys.float_info.max:
                    return Worded(text)
                found, at = [*found, Measured(float(value), unit, start, end)], end
            case _:
                return Worded(text)
    return Worded(text, found)
