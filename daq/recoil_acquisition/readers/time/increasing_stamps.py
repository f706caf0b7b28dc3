"""Stamps that repeat or go back, made to increase strictly.

Sources that stamp each sample as it comes write equal stamps, and now and then one that goes back. A time base
must increase strictly, so samples are left out: of equal stamps the last one is kept, because it is what the source
knew at that instant in the end; a stamp below the largest so far is left out, because where it belongs is not known.
A single stamp ahead of both that follow it, which go on where those before it ended, is a wrong one: it is left out
itself, for all that follow would be below it. All are counted, for a reader's notes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.remark import Note, NoteCode, Remark


def keep_increasing(stamps: NDArray[Any]) -> tuple[NDArray[np.bool_], int, int]:
    """Choose the samples whose stamps increase strictly.

    Parameters
    ----------
    stamps : ndarray, shape (n_samples,)
        Stamps, integers or floats; those that are not finite are left out as if they went back.

    Returns
    -------
    kept : ndarray of bool, shape (n_samples,)
    repeated, backward : int
        Numbers of stamps that were left out because a later one is the same, and because they are out of order.
    """
    if stamps.size < 2 and bool(np.isfinite(stamps).all()):
        return np.ones(stamps.size, bool), 0, 0
    finite = np.isfinite(stamps) & ~single_ahead(stamps)
    # what is not finite must not become the largest so far
    lowest: Any = np.iinfo(stamps.dtype).min if stamps.dtype.kind in "iu" else -np.inf
    largest = np.maximum.accumulate(np.where(finite, stamps, lowest))
    forward = finite & (stamps >= largest)
    kept = forward.copy()
    places = np.flatnonzero(forward)
    again = stamps[places[1:]] == stamps[places[:-1]]
    kept[places[:-1][again]] = False
    return kept, int(again.sum()), int(stamps.size - forward.sum())


def increasing(times_s: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which instants are later than all before them; NaN never is. Shape (n,)."""
    seen = np.where(np.isnan(times_s) | single_ahead(times_s), -np.inf, times_s)
    newest = np.maximum.accumulate(np.r_[-np.inf, seen])[:-1]
    return seen > newest


def single_ahead(stamps: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which stamps are single ones ahead of both that follow, which go on from those before. Shape (n,)."""
    ahead = np.zeros(stamps.size, dtype=bool)
    if stamps.size < 3:
        return ahead
    beyond = (stamps[:-2] > stamps[1:-1]) & (stamps[:-2] > stamps[2:]) & (stamps[1:-1] <= stamps[2:])
    beyond[1:] &= stamps[:-3] <= stamps[1:-2]
    ahead[:-2] = beyond
    return ahead


def left_out_note(name: str, count: int, repeated: int, backward: int) -> tuple[Remark, ...]:
    """Say how many samples of a signal were left out; nothing if none was."""
    notes = []
    if repeated:
        text = f"{name}: {repeated} of {count} samples share their stamp with a later one: the last is kept"
        notes.append(Note(NoteCode.LEFT_OUT, name, text))
    if backward:
        text = f"{name}: {backward} of {count} samples are stamped out of order: left out"
        notes.append(Note(NoteCode.LEFT_OUT, name, text))
    return tuple(notes)
