"""Compiled reading of plain numbers: rows of one width, every number exact by one operation.

A number whose digits are below 2^53 without its decimal mark, and whose power of ten is between -22 and 22,
is its digits times or over a power of ten that is itself exact: one rounding, so the nearest float64
(Clinger, "How to read floating point numbers accurately", 1990). A few beyond that are read by `float`; text
with many of them, with words or with a fault is left to other parsers. Needs numba, the extra ``fast``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

POWERS = np.array([10.0**k for k in range(23)])

HARD_SHARE = 16
"""One cell in so many may take more than one operation; beyond, the parser of pandas is as fast."""

Kernel = Callable[..., int]


@cache
def kernel_at_hand() -> bool:
    """Tell whether numba is installed."""
    return find_spec("numba") is not None


def _read_rows(text: Any, separator: int, mark: int, powers: Any, table: Any, hard: Any) -> int:
    """Fill a table of shape (columns, rows) from rows of text.

    Numbers that take more than one operation are listed in ``hard``, shape (most, 4), by column, row, first byte
    and the byte behind; their count is returned, or -1 where a row or cell is not plain.
    """
    n_columns, n_rows = table.shape
    at, size, n_hard = 0, text.size, 0
    for row in range(n_rows):
        for column in range(n_columns):
            while at < size and text[at] == 32:
                at += 1
            if at >= size:
                return -1
            first = at
            exact = True
            negative = text[at] == 45
            if negative or text[at] == 43:
                at += 1
            digits: Any = np.int64(0)
            count = places = 0
            begin = at
            while at < size and 48 <= text[at] <= 57:
                exact = exact and digits <= 900719925474098
                digits = digits * 10 + (text[at] - 48)
                at += 1
            count = at - begin
            if at < size and text[at] == mark:
                at += 1
                begin = at
                while at < size and 48 <= text[at] <= 57:
                    exact = exact and digits <= 900719925474098
                    digits = digits * 10 + (text[at] - 48)
                    at += 1
                places = at - begin
                count += places
            if count == 0:
                if at > first:
                    return -1
                table[column, row] = np.nan
            else:
                power = -places
                if at < size and (text[at] == 69 or text[at] == 101):
                    at += 1
                    down = at < size and text[at] == 45
                    if at < size and (down or text[at] == 43):
                        at += 1
                    exponent = 0
                    begin = at
                    while at < size and 48 <= text[at] <= 57:
                        exponent = min(exponent * 10 + (text[at] - 48), 100000)
                        at += 1
                    if at == begin:
                        return -1
                    power += -exponent if down else exponent
                if exact and -22 <= power <= 22:
                    value = float(digits)
                    value = value / powers[-power] if power < 0 else value * powers[power]
                    table[column, row] = -value if negative else value
                elif n_hard < hard.shape[0]:
                    hard[n_hard, 0], hard[n_hard, 1], hard[n_hard, 2], hard[n_hard, 3] = column, row, first, at
                    n_hard += 1
                else:
                    return -1
            while at < size and text[at] == 32:
                at += 1
            if column < n_columns - 1:
                if at >= size or text[at] != separator:
                    return -1
                at += 1
        if at < size and text[at] == 13:
            at += 1
        if at >= size or text[at] != 10:
            return -1
        at += 1
    return n_hard if at == size else -1


@cache
def load_kernel() -> Kernel:
    """Compile the kernel, or load it from where an earlier process kept it."""
    import numba

    types: Any = numba.types  # its own types of the constructor leave out what it takes
    signature = types.int64(
        types.Array(types.uint8, 1, "C", readonly=True), types.int64, types.int64,
        types.Array(types.float64, 1, "C", readonly=True), types.float64[:, ::1],
        types.int64[:, ::1],
    )  # fmt: skip
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "boundscheck": False}
    try:
        compiled = numba.njit(signature, cache=True, **options)(_read_rows)
    except (RuntimeError, OSError):
        # there is no folder where compiled code could be kept: it is compiled for this process alone
        compiled = numba.njit(signature, **options)(_read_rows)
    return cast("Kernel", compiled)


def read_plain(
    text: bytes, rows: int, columns: int, separator: str, *, decimal_comma: bool
) -> NDArray[np.float64] | None:
    r"""Read rows of plain numbers.

    Parameters
    ----------
    text : bytes
        Rows that are ended by ``\n`` or ``\r\n``.
    rows, columns : int
    separator : str
    decimal_comma : bool

    Returns
    -------
    ndarray of float64, shape (rows, columns), or None
        NaN where a cell is empty; None if any row or cell is not plain.
    """
    table = np.empty((columns, rows))
    mark = ord("," if decimal_comma else ".")
    powers = POWERS.copy()
    powers.flags.writeable = False
    hard = np.empty((rows * columns // HARD_SHARE + 8, 4), dtype=np.int64)
    n_hard = load_kernel()(np.frombuffer(text, dtype=np.uint8), ord(separator), mark, powers, table, hard)
    if n_hard < 0:
        return None
    for column, row, start, stop in hard[:n_hard].tolist():
        value = float(text[start:stop].replace(b",", b"."))
        table[column, row] = value if np.isfinite(value) else np.nan
    return table.T
