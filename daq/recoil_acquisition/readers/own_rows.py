"""The rows of a table that hold a channel's samples, where these are regularly fewer than the rows.

A table of several rates has a row for each sample of its fastest channel; a slower one leaves most of its cells empty,
in text, or fills an array with NaN. Regular emptiness is a rate: what stands in every tenth row was measured at a tenth
of the rows' rate, and nothing of it is lost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.readers.recording import Recording
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


def own_base(recording: Recording, name: str, samples: NDArray[np.float64] | None = None) -> TimeBase:
    """Return the instants of a signal's own samples: of one that is slower than its table, those of its own rows.

    Parameters
    ----------
    samples : ndarray, shape (n_rows,), optional
        All samples of the signal, where they were read; else they are where the file's notes say that it is slower.
    """
    base = recording.time_base(name)
    if samples is None and any(one.code is NoteCode.OWN_RATE and one.about == name for one in recording.notes):
        samples = recording.read(name)
    rows = None if samples is None or samples.size != base.count else own_rows(samples)
    return base if rows is None else base.every(rows)


def about_rows(name: str, samples: NDArray[np.float64], rows: slice) -> tuple[Note, ...]:
    """Return the notes on a slower channel: its rate, and what it lost of its own samples."""
    own = samples[rows]
    text = f"{name}: 1 of {rows.step} rows holds a sample, from row {rows.start + 1} on: that is its rate, no loss"
    lost = int(np.count_nonzero(np.isnan(own)))
    told = (Note(NoteCode.OWN_RATE, name, text),)
    return told if not lost else (*told, Note(NoteCode.LOST, name, f"{name}: {lost} of {own.size} samples are lost"))
