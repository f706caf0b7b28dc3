"""The values of a dataset 58 that are printed as text.

Layout: a line holds fields of fixed columns: of single values 6E13.5, of double ones 4E20.12, and of double ones with
their abscissa 2(E13.5, E20.12). A field may be as wide as its columns, so that a minus sign touches the field before;
many programs print more or fewer digits than the format says, apart by blanks.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

_SINGLE, _DOUBLE = 13, 20
"""Columns of a field."""
_NO_LETTER = re.compile(rb"(?<=[0-9.])([+-][0-9]{3})$")
"""An exponent of three digits, before which Fortran leaves out the letter."""


def printed_numbers(content: bytes, expected: int, *, double: bool, even: bool) -> NDArray[np.float64]:
    """Return the numbers of a dataset as they follow one another, shape (expected,).

    Raises
    ------
    ValueError
        If there are not so many, or one is no number, with the line.
    """
    plain = content.replace(b"D", b"E").replace(b"d", b"e")
    cells = plain.split()
    if len(cells) == expected:
        try:
            return np.array(cells).astype(np.float64)
        except ValueError:
            pass
    widths = [_SINGLE, _DOUBLE] if double and not even else [_DOUBLE if double else _SINGLE]
    for columns in (widths, [_SINGLE], [_DOUBLE]):
        numbers = _by_columns(plain, columns)
        if numbers is not None and len(numbers) == expected:
            return np.array(numbers)
    if len(cells) == expected:
        line, cell = next(_no_numbers(plain))
        raise ValueError(f"{cell!r} in line {line} of the values is no number")
    raise ValueError(f"{len(cells)} values where it states {expected}")


def _by_columns(content: bytes, columns: Sequence[int]) -> list[float] | None:
    """Return the numbers in fields of so many columns, by turns; None if one field is none, or empty before others."""
    numbers: list[float] = []
    for line in content.splitlines():
        at, text = 0, line.rstrip()
        for width in cycle(columns):
            if at >= len(text):
                break
            # a blank within a field stands for the plus sign of an exponent
            field = _NO_LETTER.sub(rb"E\1", text[at : at + width].replace(b" ", b""))
            try:
                numbers.append(float(field))
            except ValueError:
                return None
            at += width
    return numbers


def _no_numbers(content: bytes) -> Iterator[tuple[int, str]]:
    """Yield the line and the text of each cell that is no number."""
    for line, text in enumerate(content.splitlines(), start=1):
        for cell in text.split():
            try:
                float(cell)
            except ValueError:
                yield line, cell.decode("latin-1")
