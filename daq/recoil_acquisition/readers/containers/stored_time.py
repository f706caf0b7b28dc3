"""Time that a container stores as numbers: one stamp per sample.

A time vector is stamps, even where its author meant a constant rate: only the rounding of its
number type lies between them and a uniform time base, which is taken where all stamps agree with one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.readers.time.printed_time import uniform_from_printed
from recoil_acquisition.readers.time.time_units import DAY_S, MOST_S
from recoil_acquisition.remark import Note, NoteCode, Remark

LEAST_UNUSUAL = 8
"""Steps of rounded stamps that are longer or shorter than the usual one: a few long ones are gaps."""
MOST_COLUMNS = 100
"""Columns of a matrix that are channels; a wider one is an image or a table of something else."""
EVEN = 0.01
"""Spread of steps, as a share of their mean, up to which a column rises evenly."""
DATENUM_OF_YEAR_1 = 367.0
"""MATLAB's serial date number of 0001-01-01 (documentation of ``datenum``)."""


@dataclass(frozen=True, eq=False)
class StoredTime:
    """Time by a stored time vector.

    Attributes
    ----------
    kept
        Indices of the samples that the time base has; None if it has all.
    note
        Sentence on the stamps; empty if there is nothing to note.
    dropped
        Number of samples that the time base leaves out.
    """

    time_base: TimeBase
    kept: NDArray[np.int64] | None
    note: str
    dropped: int = 0

    @property
    def stamp_count(self) -> int:
        """Length of the time vector, which is that of its channels as stored."""
        return self.time_base.count + self.dropped


def resolution_of(values: NDArray[Any]) -> float:
    """Return the step between two neighbouring numbers of a vector's type at its largest value."""
    if not values.size or values.dtype.kind != "f":
        return 0.0
    return float(np.spacing(max(values.max(), -values.min())))


def time_from_stamps(
    clock: str, times_s: NDArray[np.float64], resolution_s: float, start: AbsoluteStart | None = None
) -> StoredTime:
    """Make a time base of stamps.

    Stamps that all agree with one constant step, within the resolution of their number type or of the decimal tick
    that all of them are multiples of, are uniform. Of samples with equal stamps the first is kept: which of them was
    measured when cannot be known.

    Parameters
    ----------
    times_s : ndarray of float64, shape (n,)
    resolution_s
        Resolution of the numbers as stored, s.

    Raises
    ------
    ValueError
        If a stamp is no number, beyond any recording, or steps back.
    """
    times_s = np.ascontiguousarray(times_s, dtype=np.float64)
    wrong = np.flatnonzero(~np.isfinite(times_s))
    if wrong.size:
        raise ValueError(f"the time of sample {wrong[0]} is no number")
    longest_s = np.abs(times_s).max(initial=0.0)
    if not longest_s < MOST_S:
        raise ValueError(
            f"a time of {longest_s:g} s is longer than any recording: its unit is another, or it is damaged"
        )
    uniform = uniform_from_printed(times_s, 2.0 * resolution_s)
    if uniform is None and (tick_s := decimal_tick_s(times_s, resolution_s)) is not None:
        # the clock's ticks are coarser than the numbers that they are stored in
        uniform = uniform_from_printed(times_s, tick_s)
        resolution_s = tick_s if uniform is not None else resolution_s
    if uniform is not None:
        rebuilt = f"its time resolves only {resolution_s:.1g} s: rebuilt at {1 / uniform[1]:g} Hz"
        coarse = resolution_s > 0.01 * uniform[1]
        return StoredTime(TimeBase.uniform(clock, *uniform, times_s.size, start), None, rebuilt if coarse else "")
    back = np.flatnonzero(times_s[1:] < times_s[:-1])
    if back.size:
        step_s = times_s[back[0]] - times_s[back[0] + 1]
        raise ValueError(
            f"time steps back by {step_s:g} s behind sample {back[0]}: if a second recording begins there, export one "
            "recording per file"
        )
    kept = np.flatnonzero(np.concatenate(([True], times_s[1:] > times_s[:-1])))[: times_s.size].astype(np.int64)
    if kept.size == times_s.size:
        return StoredTime(TimeBase.stamped(clock, times_s, start), None, "")
    note = f"{times_s.size - kept.size} of {times_s.size} stamps repeat the one before: those samples are left out"
    return StoredTime(TimeBase.stamped(clock, times_s[kept], start), kept, note, times_s.size - kept.size)


def decimal_tick_s(times_s: NDArray[np.float64], resolution_s: float) -> float | None:
    """Return the coarsest power of ten of seconds, from 0.1 s to 1 us, that all stamps are whole multiples of.

    None where it is no coarser than the number type, or hides the stamps' own steps: where fewer than `LEAST_UNUSUAL`
    of them are unlike the usual one, these may as well be gaps.
    """
    if times_s.size < 2 * LEAST_UNUSUAL:
        return None
    for power in range(1, 7):
        tick_s = 10.0**-power
        if tick_s <= 4.0 * resolution_s:
            return None
        ticks = times_s[:: max(1, times_s.size // 1000)] / tick_s
        slack = 1e-6 + resolution_s / tick_s
        if np.any(np.abs(ticks - np.round(ticks)) > slack):
            continue
        ticks = times_s / tick_s
        whole = np.round(ticks)
        if np.any(np.abs(ticks - whole) > slack):
            continue
        steps = np.diff(whole)
        unusual = np.count_nonzero(steps != np.median(steps))
        return tick_s if unusual >= LEAST_UNUSUAL else None
    return None


def time_from_vector(
    clock: str, values: NDArray[Any], unit_s: float, label: str, notes: list[Remark]
) -> StoredTime | str:
    """Make a time base of a stored vector of times in some unit, or say why it is none; notes are appended."""
    try:
        time = time_from_stamps(clock, values.astype(np.float64) * unit_s, resolution_of(values) * unit_s)
    except ValueError as error:
        return f"{label}: {error}"
    if time.note:
        notes.append(Note(NoteCode.TIME, label, f"{label}: {time.note}"))
    return time


def rising_column(columns: Mapping[str, Callable[[], NDArray[Any]]]) -> tuple[str | None, str]:
    """Find the column of a matrix that is its time: its name; or None and why none is.

    It is the one that rises, of several the one that rises evenly. Whole numbers that rise by one count samples.

    Parameters
    ----------
    columns
        Functions that read each column, by its name.
    """
    rising: list[tuple[str, float]] = []
    for name, read in columns.items():
        steps = np.diff(read().astype(np.float64))
        if np.all(steps > 0) and np.isfinite(steps).all() and not np.all(steps == 1.0):
            rising.append((name, float(np.ptp(steps) / np.mean(steps))))
    found = rising if len(rising) < 2 else [(name, spread) for name, spread in rising if spread <= EVEN]
    if len(found) == 1:
        return found[0][0], ""
    names = " and ".join(name.rpartition("/")[2] for name, _ in rising)
    return None, f"{names} could both be its time" if rising else "none of its columns is a time, which rises"


def selected(
    kept: NDArray[np.int64] | None, read: Callable[[int, int], NDArray[Any]], start: int, stop: int
) -> NDArray[Any]:
    """Return samples that a time base has, read as one stretch of what is stored.

    Parameters
    ----------
    kept : ndarray of int64 or None
        Indices of the stored samples that the time base has; None if it has all.
    read
        Function that reads stored samples from one index to before another.
    start, stop
        First and end of the samples, counted among those that the time base has.
    """
    if kept is None or start == stop:
        return read(start, stop)
    first = int(kept[start])
    return read(first, int(kept[stop - 1]) + 1)[kept[start:stop] - first]


def time_from_datenum(clock: str, days: NDArray[np.float64], origin: str) -> StoredTime:
    """Make a time base of MATLAB serial date numbers, whose zero is the first of them.

    A float64 date number of this century resolves 10 us; a constant rate beyond that is found again
    where all stamps agree with it.

    Parameters
    ----------
    days : ndarray of float64, shape (n,)
    origin
        Place where the numbers were read, for `AbsoluteStart`.

    Raises
    ------
    ValueError
        As `time_from_stamps`.
    """
    if days.size and not np.isfinite(days).all():
        raise ValueError(f"the time of sample {np.flatnonzero(~np.isfinite(days))[0]} is no number")
    start = start_from_datenum(float(days[0]), origin)
    seconds = (days - days[0]) * DAY_S
    return time_from_stamps(clock, seconds, resolution_of(days) * DAY_S, start)


def start_from_datenum(day: float, origin: str) -> AbsoluteStart:
    """Return the instant of a MATLAB serial date number, which has no zone.

    Raises
    ------
    ValueError
        If it is no date.
    """
    try:
        instant = datetime(1, 1, 1) + timedelta(days=day - DATENUM_OF_YEAR_1)
    except OverflowError as error:
        raise ValueError(f"{day:g} is no date number") from error
    return AbsoluteStart(instant.isoformat(timespec="microseconds"), "unknown", origin)
