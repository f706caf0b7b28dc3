"""Rows of plain numbers, compiled: a long table is mostly digits, and they are read where they stand.

A cell is ``[sign] digits [mark digits] [e [sign] digits]`` with spaces around it, or empty. A number of at most
2^53 beside a power of ten of at most 22 is one exact product or quotient of two float64, and so the nearest to what
is printed (W. D. Clinger, How to read floating point numbers accurately, 1990); the few others are left to `float`.
Whatever is written otherwise is not read here at all, but by a parser that says what is wrong. Needs numba, the
extra ``fast``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

LEAST_BYTES = 1 << 28
"""Size of a table from which reading it so saves more time than it takes to load the compiler and what it compiled."""

PLAIN_SEPARATORS = ",;\t|"
"""Between cells that are read here; a space could be either a separator or beside one."""

INEXACT_SHARE = 16
"""One cell of so many may need `float`; where more do, the rows are not read here."""

_EXACT_POWERS = 10.0 ** np.arange(23)

Kernel = Callable[..., int]


@cache
def kernel_at_hand() -> bool:
    """Tell whether numba is installed."""
    return find_spec("numba") is not None


def read_plain_rows(text: bytes, separator: str, point: str, width: int, count: int) -> NDArray[np.float64] | None:
    r"""Read rows that are plainly numbers.

    Parameters
    ----------
    text : bytes
        Complete rows, each ended by ``\n`` or ``\r\n``.
    separator, point : str
        Between cells, and before the fraction: one ASCII character each.
    width, count : int
        Cells of a row, and rows.

    Returns
    -------
    ndarray of float64, shape (width, count), or None
        Column by column, NaN where a cell is empty; None if anything is written otherwise.
    """
    if len(separator) != 1 or separator not in PLAIN_SEPARATORS or separator == point or not text.endswith(b"\n"):
        return None
    columns = np.empty((width, count))
    inexact = np.empty((width * count // INEXACT_SHARE + 16, 4), dtype=np.int64)
    found = _kernel()(np.frombuffer(text, np.uint8), ord(separator), ord(point), columns, inexact, _EXACT_POWERS)
    if found < 0:
        return None
    for start, stop, column, row in inexact[:found].tolist():
        value = float(text[start:stop].replace(point.encode(), b"."))
        columns[column, row] = value if math.isfinite(value) else np.nan
    return columns


@cache
def _kernel() -> Kernel:
    """Compile the kernel, or load it from where an earlier process kept it."""
    import numba

    types: Any = numba.types
    signature = types.int64(
        types.Array(types.uint8, 1, "C", readonly=True), types.int64, types.int64, types.float64[:, ::1],
        types.int64[:, ::1], types.float64[::1],
    )  # fmt: skip
    options: dict[str, Any] = {"nogil": True, "boundscheck": False, "error_model": "numpy"}
    try:
        compiled = numba.njit(signature, cache=True, **options)(_read_rows)
    except (RuntimeError, OSError):
        # there is no folder where compiled code could be kept: it is compiled for this process alone
        compiled = numba.njit(signature, **options)(_read_rows)
    return cast("Kernel", compiled)


def _read_rows(  # pragma: no cover - runs compiled
    text: NDArray[np.uint8],
    separator: int,
    point: int,
    columns: NDArray[np.float64],
    inexact: NDArray[np.int64],
    powers: NDArray[np.float64],
) -> int:
    """Fill columns; return how many cells are left to `float`, or -1 if the rows are not plainly numbers.

    No index leaves the text: every loop over characters ends at a line end, which the last character is.
    """
    width, count = columns.shape
    # without a sign, so that no index is taken to count from the end
    i, end, one, n_inexact = np.uint64(0), np.uint64(text.size), np.uint64(1), 0
    zero, ten = np.uint8(48), np.uint64(10)
    for row in range(count):
        if i >= end:
            return -1
        for column in range(width):
            while text[i] == 32:
                i += one
            start = i
            negative = text[i] == 45
            if negative or text[i] == 43:
                i += one
            first = i
            while text[i] == zero:
                i += one
            significant = i
            mantissa, exponent = np.uint64(0), np.int64(0)
            digit = np.uint8(text[i] - zero)
            while digit < 10:
                mantissa = mantissa * ten + digit
                i += one
                digit = np.uint8(text[i] - zero)
            n_digits, n_significant = np.int64(i - first), np.int64(i - significant)
            if text[i] == point:
                i += one
                fraction = i
                if n_significant == 0:
                    while text[i] == zero:
                        i += one
                significant = i
                digit = np.uint8(text[i] - zero)
                while digit < 10:
                    mantissa = mantissa * ten + digit
                    i += one
                    digit = np.uint8(text[i] - zero)
                exponent = -np.int64(i - fraction)
                n_digits -= exponent
                n_significant += np.int64(i - significant)
                if n_digits == 0:
                    return -1
            if n_digits > 0 and (text[i] == 101 or text[i] == 69):
                i += one
                down = text[i] == 45
                if down or text[i] == 43:
                    i += one
                power, first = np.int64(0), i
                digit = np.uint8(text[i] - zero)
                while digit < 10:
                    # beyond this any number is infinite or zero
                    power = power * 10 + np.int64(digit) if power < 100000 else power
                    i += one
                    digit = np.uint8(text[i] - zero)
                if i == first:
                    return -1
                exponent += -power if down else power
            stop = i
            while text[i] == 32:
                i += one
            if column < width - 1:
                if text[i] != separator:
                    return -1
            else:
                if text[i] == 13:
                    i += one
                if text[i] != 10:
                    return -1
            i += one
            if n_digits == 0:
                if stop > start:
                    return -1
                columns[column, row] = np.nan
            elif n_significant < 20 and mantissa <= np.uint64(9007199254740992) and -23 < exponent < 23:
                value = np.float64(mantissa)
                value = value / powers[-exponent] if exponent < 0 else value * powers[exponent]
                columns[column, row] = -value if negative else value
            elif n_inexact < inexact.shape[0]:
                inexact[n_inexact, 0] = np.int64(start)
                inexact[n_inexact, 1] = np.int64(stop)
                inexact[n_inexact, 2] = column
                inexact[n_inexact, 3] = row
                n_inexact += 1
            else:
                return -1
    return n_inexact if i == end else -1
