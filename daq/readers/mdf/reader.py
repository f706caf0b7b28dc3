"""MDF 4 files: measured channels, one time base per channel group.

Read by asammdf, a whole group in one call when its first sample is asked for. Opening reads the
masters (times) alone. Frames of a bus in the same file are named and left to the readers of buses.
"""

from __future__ import annotations

import mmap
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.channel import RawCounts
from daq.errors import CorruptFileError, ReadError
from daq.readers.bounded_file import BoundedFile
from daq.readers.containers.stored_channels import StoredChannel, StoredRecording, damage_is_reported
from daq.readers.containers.stored_time import StoredTime, resolution_of, time_from_stamps
from daq.readers.mdf.channel import INTEGERS, TIME, linear, unit_of, why_no_channel
from daq.readers.mdf.kind import (
    BUS_EVENT,
    BUS_NAMES,
    UNFINALISED,
    MdfChainError,
    is_bus_file,
    is_bus_logging,
    is_mdf4,
    iter_groups,
)
from daq.readers.reader import Declarations, SignalHeader
from daq.readers.text.text_table import unique_names
from daq.timebase import AbsoluteStart, TimeBase

LOCAL_TIME = 1
VIRTUAL_MASTER = 3
DEFLATE_RATIO = 1032


class MdfReader:
    """Reader of MDF 4 files with measured channels."""

    name = "MDF 4"
    kind = "dewetron"
    suffixes = (".mf4",)

    def claims(self, head: bytes) -> bool:
        """Tell whether the file begins as MDF 4 and its head does not show a bus log alone."""
        return is_mdf4(head) and not is_bus_logging(head)

    def confirms(self, path: Path) -> bool:
        """Tell from all of a file whether it is no bus log."""
        return not is_bus_file(path)

    def open(self, path: Path, declared: Declarations) -> StoredRecording:
        """Open a file; masters are read, samples are not.

        Raises
        ------
        ReadError
            If asammdf is not installed, or the file holds frames of a bus alone.
        CorruptFileError
            If it is damaged.
        """
        with damage_is_reported(path, "a whole MDF 4 file"):
            bus = _check_blocks(path)
            try:
                from asammdf import MDF
            except ImportError as error:
                raise ReadError("MDF needs asammdf", path=path, remedy="pip install 'recoil-daq[mdf]'") from error
            # Never from a path: asammdf's reader of mapped files trusts sizes outside Python, and a file that it
            # refused raises a second time, where nobody can catch it, when it is let go
            with BoundedFile(path) as file, closing(MDF(file)) as mdf:
                return _recording(path, mdf, declared.clock, bus)


def _check_blocks(path: Path) -> bool:
    """Walk the chains of blocks; tell whether frames of a bus are among the groups."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if not is_mdf4(data[:128]):
            raise CorruptFileError("no MDF 4 file", path=path, place="byte 0", expected="`MDF     4.`")
        unfinalised = data[:10] == UNFINALISED
        try:
            groups = list(iter_groups(data))
        except MdfChainError as error:
            raise CorruptFileError(
                "the blocks do not hang together", path=path, found=str(error), remedy="copy or export it again"
            ) from error
    buses = [g.is_bus for g in groups]
    if unfinalised and any(g.channel_count and not g.is_bus for g in groups):
        raise ReadError(
            "the recording was never finalised: its counts cannot be trusted", path=path, place="byte 0",
            found="UnFinMF", remedy="finalise it with the recorder's program",
        )  # fmt: skip
    if any(buses) and not any(g.channel_count and not g.is_bus for g in groups):
        raise ReadError(
            "this is a log of a bus, without measured channels", path=path, remedy="declare its source as kind `can`"
        )
    return any(buses)


@dataclass(eq=False)
class _Group:
    """The channels of one group, read in one call when the first of them is asked for."""

    path: Path
    index: int
    channels: tuple[int, ...]
    count: int
    signals: dict[int, Any] = field(default_factory=dict)

    def signal(self, channel: int) -> Any:
        """Return one channel as stored, with its conversion."""
        if not self.signals:
            from asammdf import MDF

            with BoundedFile(self.path) as file, closing(MDF(file)) as mdf:
                wanted = [(None, self.index, c) for c in self.channels]
                read = mdf.select(wanted, raw=True, copy_master=False, ignore_value2text_conversions=True)
            if any(len(signal.samples) != self.count for signal in read):
                raise ValueError(f"group {self.index} has not the {self.count} samples that it states")
            self.signals = dict(zip(self.channels, read, strict=True))
        return self.signals[channel]


def _recording(path: Path, mdf: Any, clock: str, bus: bool) -> StoredRecording:
    notes = ["frames of a bus in this file are not read here: read it as a source of kind `can` for those"] * bus
    start = _absolute_start(mdf.header)
    found: list[tuple[str, _Group, int, Any, StoredTime]] = []
    for index, group in enumerate(mdf.groups):
        master = mdf.masters_db.get(index)
        label = _group_label(group, index)
        if group.channel_group.flags & BUS_EVENT or any(c.name.startswith(BUS_NAMES) for c in group.channels):
            continue
        usable = [
            j for j, channel in enumerate(group.channels)
            if j != master and not _left_out(channel, group, j, label, notes)
        ]  # fmt: skip
        time = _time(path, mdf, index, clock, start, notes, label) if usable else "no channel of numbers"
        if isinstance(time, str):
            if usable:
                notes.append(f"{label}: {time}: its {len(usable)} channels are left out")
            continue
        held = _Group(path, index, tuple(usable), group.channel_group.cycles_nr)
        found += [(group.channels[j].name, held, j, group.channels[j], time) for j in usable]
    names, name_notes = unique_names([name for name, *_ in found])
    channels = []
    for name, (_, held, j, channel, time) in zip(names, found, strict=True):
        unit = unit_of(channel)
        metadata = {"group": held.index, "comment": str(channel.comment or "")[:2000]}
        header = SignalHeader(name, unit, time.time_base.count, metadata=metadata)
        raw = partial(_raw, held, j, time.kept, unit)
        samples = partial(_samples, held, j, time.kept)
        gain = linear(channel) if channel.data_type in INTEGERS else None
        channels.append(
            StoredChannel(header, time.time_base, samples)
            if gain is None
            else StoredChannel(header, time.time_base, samples, partial(raw, *gain))
        )
    metadata_of_file: Mapping[str, Any] = {
        "version": str(mdf.version),
        "comment": str(mdf.header.comment or "")[:2000],
        "program": str(mdf.identification.program_identification.decode("latin-1").strip(" \0")),
        "groups": [_group_label(group, i) for i, group in enumerate(mdf.groups)],
        "zone_minutes": [int(mdf.header.tz_offset), int(mdf.header.daylight_save_time)],
    }
    return StoredRecording(path, MdfReader.name, channels, metadata_of_file, [*notes, *name_notes], "", start)


def _group_label(group: Any, index: int) -> str:
    named = str(group.channel_group.acq_name or "")
    return f"group {index} ({named})" if named else f"group {index}"


def _left_out(channel: Any, group: Any, index: int, label: str, notes: list[str]) -> bool:
    width = group.channel_group.samples_byte_nr
    record = group.record[index] if group.record is not None else None
    reason = why_no_channel(channel, record, group.channel_dependencies[index], width)
    if reason:
        notes.append(f"{channel.name} of {label}: {reason}: left out")
    return bool(reason)


def _absolute_start(header: Any) -> AbsoluteStart | None:
    if not 0 < header.abs_time < 2**63:
        return None
    text = str(np.datetime64(int(header.abs_time), "ns"))
    # The stamp counts in UTC unless the flag says that it is local time without a zone
    return AbsoluteStart(text, "unknown" if header.time_flags & LOCAL_TIME else "UTC", "header of the file")


def _time(
    path: Path, mdf: Any, index: int, clock: str, start: AbsoluteStart | None, notes: list[str], label: str
) -> StoredTime | str:
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
    return why_no_channel(_AsData(master), record, None, group.channel_group.samples_byte_nr)


class _AsData:
    """A master channel, seen as a channel of samples."""

    channel_type = 0

    def __init__(self, master: Any) -> None:
        self.data_type, self.conversion, self.flags = master.data_type, master.conversion, master.flags


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


def _samples(held: _Group, channel: int, kept: NDArray[np.int64] | None, start: int, stop: int) -> NDArray[np.float64]:
    signal = held.signal(channel)
    chosen = slice(start, stop) if kept is None else kept[start:stop]
    stored = np.array(signal.samples[chosen])
    values = stored if signal.conversion is None else signal.conversion.convert(stored)
    samples = np.array(values, dtype=np.float64)
    if signal.invalidation_bits is not None:
        samples[np.asarray(signal.invalidation_bits, bool)[chosen]] = np.nan
    return samples


def _raw(
    held: _Group,
    channel: int,
    kept: NDArray[np.int64] | None,
    unit: str,
    gain: float,
    offset: float,
    start: int,
    stop: int,
) -> RawCounts | None:
    signal = held.signal(channel)
    if signal.invalidation_bits is not None and np.any(signal.invalidation_bits):
        return None
    chosen = slice(start, stop) if kept is None else kept[start:stop]
    return RawCounts(np.array(signal.samples[chosen]), gain, offset, unit)
