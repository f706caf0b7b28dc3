"""The rows of a table that hold a channel's samples, where these are regularly fewer than the rows.

A table of several rates has a row for each sample of its fastest channel; a slower one leaves most of its cells empty,
in text, or fills an array with NaN. Regular emptiness is a rate: what stands in every tenth row was measured at a tenth
of the rows' rate, and nothing of it is lost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.remark import Note, NoteCode

LEAST_SAMPLES = 8
"""Samples below which their places show no rate."""
LEAST_SHARE = 0.5
"""Share of its own rows that a channel must hold: fewer may stand regularly by chance."""


def own_rows(samples: NDArray[np.float64]) -> slice | None:
    """Return the rows of a slower channel, those among them whose samples are lost included.

    Parameters
    ----------
    samples : ndarray, shape (n_rows,)
        Samples of all rows; lost ones are NaN.

    Returns
    -------
    slice or None
        First of its rows and their distance; None where each row may hold a sample.
    """
    present = np.flatnonzero(~np.isnan(samples))
    if present.size < LEAST_SAMPLES or 2 * present.size > samples.size + 1:
        return None
    apart = int(np.gcd.reduce(np.diff(present)))
    rows = slice(int(present[0]) % apart, None, apart)
    if apart < 2 or present.size < LEAST_SHARE * len(range(*rows.indices(samples.size))):
        return None
    return rows


def about_rows(name: str, samples: NDArray[np.float64], rows: slice) -> tuple[Note, ...]:
    """Return the notes on a slower channel: its rate, and what it lost of its own samples."""
    own = samples[rows]
    text = f"{name}: 1 of {rows.step} rows holds a sample, from row {rows.start + 1} on: that is its rate, no loss"
    lost = int(np.count_nonzero(np.isnan(own)))
    told = (Note(NoteCode.TIME, name, text),)
    return told if not lost else (*told, Note(NoteCode.LOST, name, f"{name}: {lost} of {own.size} samples are lost"))
