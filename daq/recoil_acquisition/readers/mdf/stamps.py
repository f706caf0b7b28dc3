"""The times of a group's records, in ns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.mdf.channel_groups import MASTERS, MdfDamageError, MdfUnsupportedError
from recoil_acquisition.readers.mdf.conversion import VIRTUAL_MASTER, linear, unit_of
from recoil_acquisition.readers.mdf.records import Records
from recoil_acquisition.readers.time.time_units import time_unit_s

_TIME = 1
_LATEST_S = 2.0**61 / 1e9
"""73 years: a stamp beyond is damage, and differences of two fit 64 bits."""


def times_ns(content: bytes, records: Records) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the times of records, and which of them are times.

    Whole counts of whole nanoseconds are kept exactly; whatever else is rounded to one.

    Parameters
    ----------
    content
        All of the file.

    Returns
    -------
    times_ns : ndarray of int64, shape (n_records,)
        Of no meaning where they are not sound.
    sound : ndarray of bool, shape (n_records,)

    Raises
    ------
    MdfDamageError
        If the group has no channel of times, or their conversion is damaged.
    MdfUnsupportedError
        If their conversion is not linear, or their unit none of time.
    """
    master = next((c for c in records.group.channels if c.kind in MASTERS and c.sync == _TIME), None)
    if master is None:
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
