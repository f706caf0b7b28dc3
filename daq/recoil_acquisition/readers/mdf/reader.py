"""MDF 4 files: measured channels, one time base per channel group.

Read by asammdf, a whole group in one call when its first sample is asked for. Opening reads the
masters (times) alone. Frames of a bus in the same file are named and left to the readers of buses.
"""

from __future__ import annotations

import mmap
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.bounded_file import BoundedFile, most_unpacked
from recoil_acquisition.readers.containers.stored_channels import container_recording
from recoil_acquisition.readers.containers.stored_time import StoredTime
from recoil_acquisition.readers.mdf.channel import INTEGERS, linear, unit_of, why_no_channel
from recoil_acquisition.readers.mdf.channel_groups import (
    BUS_EVENT,
    BUS_NAMES,
    ChannelGroup,
    MdfDamageError,
    iter_groups,
)
from recoil_acquisition.readers.mdf.group import HeldGroup
from recoil_acquisition.readers.mdf.kind import UNFINALISED, is_mdf4
from recoil_acquisition.readers.mdf.library import opened
from recoil_acquisition.readers.mdf.master import time_of_group
from recoil_acquisition.readers.reader import Declarations, SignalHeader
from recoil_acquisition.readers.recording import Recording, StoredChannel, damage_is_reported
from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.timebase import AbsoluteStart

LOCAL_TIME = 1


class MdfReader:
    """Reader of MDF 4 files with measured channels."""

    name = "MDF 4"

    def open(self, path: Path, declared: Declarations) -> Recording:
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
            with BoundedFile(path) as file, opened(file) as mdf:
                return _recording(path, mdf, declared.clock, bus)


def _check_blocks(path: Path) -> bool:
    """Walk the chains of blocks; tell whether frames of a bus are among the groups."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if not is_mdf4(data[:128]):
            raise CorruptFileError("no MDF 4 file", path=path, place="byte 0", expected="`MDF     4.`")
        unfinalised = data[:10] == UNFINALISED
        try:
            groups = list(iter_groups(data))
        except MdfDamageError as error:
            raise CorruptFileError(
                "the blocks do not hang together", path=path, found=str(error), remedy="copy or export it again"
            ) from error
        _check_room(path, groups, len(data))
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


def _check_room(path: Path, groups: Sequence[ChannelGroup], size: int) -> None:
    """Refuse groups whose blocks, or whose channels, which may lie over one another, take far more than the file."""
    measured = [group for group in groups if not group.is_bus]
    unpacked = sum(one.unpacked for one in {group.stored for group in measured})
    channels = 0
    for group in measured:
        # A count that the file has no room for is told later, with its group
        most = (size + unpacked) // group.width if group.width else group.count
        channels += min(group.count, most) * sum(-(-one.bits // 8) or 8 for one in group.channels)
    if max(unpacked, channels) > most_unpacked(size):
        raise ReadError(
            f"the file unpacks to more than {most_unpacked(size) / 1e6:.0f} MB", path=path,
            found=f"{unpacked} bytes of records, {channels} of channels",
            remedy="export fewer channels, or without compression, if this is right",
        )  # fmt: skip


def _recording(path: Path, mdf: Any, clock: str, bus: bool) -> Recording:
    notes = ["frames of a bus in this file are not read here: read it as a source of kind `can` for those"] * bus
    start = _absolute_start(mdf.header)
    found: list[tuple[str, HeldGroup, int, Any, StoredTime]] = []
    for index, group in enumerate(mdf.groups):
        master = mdf.masters_db.get(index)
        label = _group_label(group, index)
        if group.channel_group.flags & BUS_EVENT or any(c.name.startswith(BUS_NAMES) for c in group.channels):
            continue
        usable = [
            j for j, channel in enumerate(group.channels)
            if j != master and not _left_out(channel, group, j, label, notes)
        ]  # fmt: skip
        time = time_of_group(path, mdf, index, clock, start, notes, label) if usable else "no channel of numbers"
        if isinstance(time, str):
            if usable:
                notes.append(f"{label}: {time}: its {len(usable)} channels are left out")
            continue
        held = HeldGroup(path, index, tuple(usable), group.channel_group.cycles_nr)
        found += [(group.channels[j].name, held, j, group.channels[j], time) for j in usable]
    names, name_notes = unique_names([name for name, *_ in found])
    channels = []
    for name, (_, held, j, channel, time) in zip(names, found, strict=True):
        unit = unit_of(channel)
        metadata = {"group": held.index, "comment": str(channel.comment or "")[:2000]}
        header = SignalHeader(name, unit, time.time_base.count, metadata=metadata)
        raw = partial(held.counts, j, time.kept, unit)
        samples = partial(held.samples, j, time.kept)
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
    return container_recording(path, MdfReader.name, channels, metadata_of_file, [*notes, *name_notes], "", start)


def _group_label(group: Any, index: int) -> str:
    named = str(group.channel_group.acq_name or "")
    return f"group {index} ({named})" if named else f"group {index}"


def _left_out(channel: Any, group: Any, index: int, label: str, notes: list[str]) -> bool:
    record = group.record[index] if group.record is not None else None
    reason = why_no_channel(channel, record, group.channel_dependencies[index], group.channel_group)
    if reason:
        notes.append(f"{channel.name} of {label}: {reason}: left out")
    return bool(reason)


def _absolute_start(header: Any) -> AbsoluteStart | None:
    if not 0 < header.abs_time < 2**63:
        return None
    text = str(np.datetime64(int(header.abs_time), "ns"))
    # The stamp counts in UTC unless the flag says that it is local time without a zone
    return AbsoluteStart(text, "unknown" if header.time_flags & LOCAL_TIME else "UTC", "header of the file")
