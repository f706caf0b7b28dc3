"""Numbers by which instruments mark a sample that they could not measure.

SCPI-99, volume 1, 7.2.1.4 and 7.2.1.5, has 9.9E+37 for positive infinity, -9.9E+37 for negative infinity and 9.91E+37
for what is no number. Meters, power analysers, source-measure units and oscilloscopes write them into their files for
an overload: most the first two, some the last one; a widespread multimeter before SCPI has 1E+38. Nothing that is
measured comes near in any unit. As lost samples they count alike: the file does not say which of the two is meant.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.remark import Note, NoteCode

CODES = tuple(map(float, ("9.9E+37", "9.91E+37", "1E+38")))
"""Sizes of the marks, of either sign, as they are printed."""

LEAST = CODES[0] * (1 - 1e-6)
"""Size from which on a number may be a mark."""

_TOLERANCE = 1e-7
"""Share by which a mark may be off: as a float32 it is by 6e-8."""

Numbers = NDArray[np.float64]


def find_marks(values: Numbers) -> NDArray[np.bool_]:
    """Return which numbers are marks, shape of the values; an infinity is none."""
    size = np.abs(values)
    found = np.zeros(values.shape, dtype=bool)
    with np.errstate(all="ignore"):
        for code in CODES:
            found |= np.abs(size / code - 1) < _TOLERANCE
    return found


def may_have_marks(values: Numbers) -> bool:
    """Return whether there may be a mark, which among most numbers there is not: much faster than to find it."""
    if not values.size:
        return False
    return bool(np.fmax.reduce(values, axis=None) >= LEAST or np.fmin.reduce(values, axis=None) <= -LEAST)


def about_overload(name: str, count: int, of: int) -> Note:
    """Return the note on a signal with samples that are marked as an overload."""
    text = f"{name}: {count} of {of} samples are lost: overload, beyond the range of the instrument, as it marked them"
    return Note(NoteCode.LOST, name, text)
