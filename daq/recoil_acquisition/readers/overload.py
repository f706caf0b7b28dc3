"""Numbers by which instruments mark a sample that they could not measure.

IEEE 488.2 and SCPI (SCPI-99, volume 1, 7.2.1.4 and 7.2.1.5) write 9.9E+37 for a positive overload, -9.9E+37 for a
negative one and 9.91E+37 for what is no number, and meters, power analysers and oscilloscopes store these in their
files too; others write 1E+38, the largest float32 or float64, or an infinity. Nothing that is measured is as large in
any unit, so that all of these are lost samples, in whatever format they stand.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LEAST = 9.9e37 * (1 - 1e-6)
"""Size from which on a number is a mark; a float32 lies up to 6e-8 beside it."""

_NO_NUMBER = 9.91e37

OVERLOAD = "overload: beyond the range of the instrument"

Numbers = NDArray[np.float64]


def find_marks(values: Numbers, *, infinite: bool = True) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find the marks among numbers.

    Parameters
    ----------
    values : ndarray of float64
    infinite
        Whether an infinity is one.

    Returns
    -------
    overload, no_number : ndarray of bool, shape of the values
        Whether a number is a mark of an overload, and whether it is one of what is no number.
    """
    with np.errstate(invalid="ignore"):
        marks = (values >= LEAST) | (values <= -LEAST)
        if not infinite:
            marks &= np.isfinite(values)
        no_number = marks & (np.abs(np.abs(values) / _NO_NUMBER - 1) < 1e-6)
    return marks & ~no_number, no_number


def may_have_marks(values: Numbers) -> bool:
    """Return whether there is any mark, which of most numbers there is not: much faster than to find it."""
    if not values.size:
        return False
    return bool(np.fmax.reduce(values, axis=None) >= LEAST or np.fmin.reduce(values, axis=None) <= -LEAST)


def about_overload(name: str, count: int, of: int) -> str:
    """Return what is to be said of a signal with samples that were marked as an overload."""
    return f"{name}: {count} of {of} samples are marked as {OVERLOAD}; they are lost samples"
