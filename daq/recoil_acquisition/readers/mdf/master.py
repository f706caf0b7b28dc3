"""The times of a channel group of an MDF 4 file: its master channel, checked before a library reads it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.containers.stored_time import StoredTime, resolution_of, time_from_stamps
from recoil_acquisition.readers.mdf.channel import INTEGERS, TIME, linear, unit_of, why_no_channel
from recoil_acquisition.timebase import AbsoluteStart, TimeBase

VIRTUAL_MASTER = 3
DEFLATE_RATIO = 1032


def time_of_group(
    path: Path, mdf: Any, index: int, clock: str, start: AbsoluteStart | None, notes: list[str], label: str
) -> StoredTime | str:
    """Return the time base that all channels of a group have, or why it has none.

    Parameters
    ----------
    path : Path
        For messages.
    mdf : asammdf.MDF
        The opened file.
    index : int
        Of the group.
    clock : str
        Name of the source.
    start : AbsoluteStart or None
    notes : list of str
        Gets what is to be told of the stamps.
    label : str
        Of the group, for messages.

    Raises
    ------
    CorruptFileError
        If the group states more samples than the file holds.
    """
    group, at = mdf.groups[index], mdf.masters_db.get(index)
    count = group.channel_group.cycles_nr
    if not count:
        return "no samples"
    if at is None:
        return "no time"
    master = group.channels[at]
    if master.sync_type != TIME:
        return "its samples are not over time"
    if unit_of(master) not in ("s", "", "sec", "seconds"):
        return f"its time is in {unit_of(master)!r}, not in seconds"
    _check_size(path, group, count, label)
    gain = linear(master)
    if master.channel_type == VIRTUAL_MASTER:
        if gain is None:
            return "its time is computed by a conversion that is not linear"
        try:
            return StoredTime(TimeBase.uniform(clock, gain[1], gain[0], count, start), None, "")
        except ValueError as error:
            return f"its time is wrong ({error})"
    reason = _why_no_time(master, group, at)
    if reason:
        return f"its time is {reason}"
    times = mdf.get_master(index)
    if len(times) != count:
        raise CorruptFileError(
            "samples are missing", path=path, place=label, expected=f"{count} samples", found=f"{len(times)}"
        )
    resolution_s = abs(gain[0]) if gain and master.data_type in INTEGERS else resolution_of(times)
    try:
        time = time_from_stamps(clock, np.asarray(times, np.float64), resolution_s, start)
    except ValueError as error:
        return str(error)
    if time.note:
        notes.append(f"{label}: {time.note}")
    return time


def _why_no_time(master: Any, group: Any, at: int) -> str:
    """Say why a master cannot be read; empty if it can."""
    record = group.record[at] if group.record is not None else None
    if master.channel_type != 2:
        return "not stored"
    # A master is checked as any other channel of fixed length
    return why_no_channel(_AsData(master), record, None, group.channel_group)


class _AsData:
    """A master channel, seen as a channel of samples."""

    channel_type = 0

    def __init__(self, master: Any) -> None:
        self.data_type, self.conversion, self.flags = master.data_type, master.conversion, master.flags
        self.pos_invalidation_bit = master.pos_invalidation_bit


def _check_size(path: Path, group: Any, count: int, label: str) -> None:
    """Hold the samples that a group states against the blocks that hold them.

    Raises
    ------
    CorruptFileError
        If there are fewer, or a block is beyond the file.
    """
    size = path.stat().st_size
    width = group.channel_group.samples_byte_nr + group.channel_group.invalidation_bytes_nr
    blocks = list(group.data_blocks)
    in_file = [b for b in blocks if b.location == 0]
    beyond = [b for b in in_file if b.address + b.compressed_size > size]
    stated = [b for b in blocks if b.original_size > DEFLATE_RATIO * max(b.compressed_size, 1)]
    held = sum(b.original_size for b in blocks)
    if beyond or stated or count * width > held or not width:
        raise CorruptFileError(
            "samples are missing", path=path, place=label, expected=f"{count} records of {width} bytes",
            found=f"{held} bytes in {len(blocks)} blocks, {len(beyond)} of them beyond the end of the file",
        )  # fmt: skip
