"""The times of a channel group of an MDF file: its master channel, in ns or as a time base."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.readers.containers.stored_time import StoredTime, resolution_of, time_from_stamps
from recoil_acquisition.readers.mdf.channel_groups import (
    INTEGERS,
    MASTERS,
    ChannelGroup,
    MdfChannel,
    MdfDamageError,
    MdfUnsupportedError,
    non_numeric_reason,
)
from recoil_acquisition.readers.mdf.contents import MdfContents
from recoil_acquisition.readers.mdf.conversion import VIRTUAL_MASTER, linear, unit_of
from recoil_acquisition.readers.mdf.records import Records
from recoil_acquisition.readers.time.time_units import time_unit_s
from recoil_acquisition.remark import Note, NoteCode, Remark

_LATEST_S = 2.0**61 / 1e9
"""Largest time, 73 years: a stamp beyond is damage, and differences of two fit 64 bits."""

TIME = 1
"""Synchronisation type of a master channel."""
_AXES = {0: "nothing", 2: "an angle", 3: "a distance", 4: "a count"}
"""Names of the other synchronisation types."""
FINE_TICKS = 10
"""Ticks between samples from which a tick is the resolution of a clock; fewer are counts of samples."""


def times_ns(content: bytes, records: Records) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the times of records, and which of them are times.

    Whole counts of whole nanoseconds are kept exactly; whatever else is rounded to one.

    Parameters
    ----------
    content
        Bytes of the whole file.

    Returns
    -------
    times_ns : ndarray of int64, shape (n_records,)
        Times, ns; without meaning where they are not sound.
    sound : ndarray of bool, shape (n_records,)
        Whether each of them is a time.

    Raises
    ------
    MdfDamageError
        If the group has no channel of times, or their conversion is damaged.
    MdfUnsupportedError
        If their conversion is not linear, or their unit none of time.
    """
    master = master_of(records.group)
    if master is None or master.sync != TIME:
        raise MdfDamageError(f"the group at byte {records.group.at} has no times")
    unit = unit_of(content, master)
    unit_s = time_unit_s(unit) if unit else 1.0
    if unit_s is None:
        raise MdfUnsupportedError(f"the times of the group at byte {records.group.at} are in {unit!r}, no unit of time")
    offset_s, factor_s = (unit_s * number for number in linear(content, master))
    valid = records.valid(master)
    with np.errstate(over="ignore", invalid="ignore"):
        counts = np.arange(len(records.rows)) if master.kind == VIRTUAL_MASTER else records.numbers(master)
    factor_ns, offset_ns = _whole(factor_s * 1e9), _whole(offset_s * 1e9)
    if counts.dtype.kind in "iu" and factor_ns is not None and offset_ns is not None:
        with np.errstate(over="ignore"):
            sound = valid & (np.abs(counts.astype(np.float64)) * abs(factor_s) + abs(offset_s) < _LATEST_S)
        return counts.astype(np.int64) * factor_ns + offset_ns, sound
    with np.errstate(over="ignore", invalid="ignore"):
        times_s = counts.astype(np.float64) * factor_s + offset_s
    sound = valid & (np.abs(times_s) < _LATEST_S)
    times_s[~sound] = 0.0
    whole_s = np.floor(times_s)
    part_s = times_s - whole_s
    return whole_s.astype(np.int64) * 1_000_000_000 + np.rint(part_s * 1e9).astype(np.int64), sound


def _whole(number: float) -> int | None:
    """Return the whole number of 64 bits that a float is but for its rounding, None if it is none."""
    if not abs(number) < _LATEST_S * 1e9:
        return None
    whole = round(number)
    return whole if abs(number - whole) <= 1e-12 * abs(number) else None


def time_of_group(
    contents: MdfContents, records: Records, clock: str, start: AbsoluteStart | None, notes: list[Remark], label: str
) -> StoredTime | str:
    """Return the time base that all channels of a group have, or why it has none.

    Parameters
    ----------
    records
        Records of the group.
    clock
        Name of the source.
    notes
        List that notes on the stamps are added to.
    label
        Name of the group, for messages.
    """
    group = records.group
    master = master_of(group)
    if not group.count:
        return "no samples"
    if master is None:
        return "no time"
    if master.sync != TIME:
        return f"its samples are not over time, but over {_AXES.get(master.sync, f'type {master.sync}')}"
    unit = contents.unit_of(master).strip()
    unit_s = time_unit_s(unit) if unit else 1.0
    if unit_s is None:
        return f"its time is in {unit!r}, which is no unit of time that is known"
    conversion = contents.conversion_of(master)
    if isinstance(conversion, str):
        return f"its time is {conversion}"
    try:
        if master.kind == VIRTUAL_MASTER:
            if conversion.linear is None:
                return "its time is computed by a conversion that is not linear"
            gain, offset = conversion.linear
            base = TimeBase.uniform(clock, unit_s * offset, unit_s * gain, group.count, start)
            return StoredTime(base, None, "")
        if reason := non_numeric_reason(master, group):
            return f"its time is {reason}"
        ticks = records.numbers(master)
        times_s = unit_s * conversion.applied(ticks)
        times_s[~records.valid(master)] = np.nan
        resolution_s = resolution_of(times_s)
        if master.data_type not in INTEGERS:
            resolution_s = max(resolution_s, unit_s * _resolution_of_float(master.bits, times_s / unit_s))
        elif conversion.linear is not None:
            steps = np.diff(ticks.astype(np.float64))
            is_clock = steps.size and np.median(steps) >= FINE_TICKS
            resolution_s = unit_s * abs(conversion.linear[0]) if is_clock else resolution_s
        time = time_from_stamps(clock, times_s, resolution_s, start)
    except ValueError as error:
        return str(error)
    if time.note:
        notes.append(Note(NoteCode.TIME, label, f"{label}: {time.note}"))
    return time


def master_of(group: ChannelGroup) -> MdfChannel | None:
    """Return the channel of a group that dates its samples; that of an angle, a way or a count where none does."""
    masters = [channel for channel in group.channels if channel.kind in MASTERS]
    return min(masters, key=lambda channel: channel.sync != TIME, default=None)


def _resolution_of_float(bits: int, times_s: NDArray[np.float64]) -> float:
    """Return the step between two neighbouring floats of a size at the largest of some times."""
    return resolution_of(times_s.astype({16: np.float16, 32: np.float32, 64: np.float64}[bits]))
