"""MDF 4 files: measured channels, one time base per channel group.

Opening reads the masters (times) alone; the samples of a group are read when its first one is asked for. Frames of a
bus in the same file are named and left to the readers of buses. Left out and named are texts, arrays, formulas and
enumerations.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.bounded_file import most_unpacked
from recoil_acquisition.readers.containers.stored_channels import container_recording
from recoil_acquisition.readers.containers.stored_time import StoredTime
from recoil_acquisition.readers.mdf.channel import INTEGERS, rejection_reason
from recoil_acquisition.readers.mdf.channel_groups import (
    HD_AT,
    VARIABLE_LENGTH,
    ChannelGroup,
    MdfChannel,
    MdfDamageError,
    MdfUnsupportedError,
    iter_groups,
)
from recoil_acquisition.readers.mdf.conversion import unit_of
from recoil_acquisition.readers.mdf.file_header import header_times
from recoil_acquisition.readers.mdf.group import NumberChannel, StoredGroups
from recoil_acquisition.readers.mdf.kind import UNFINALISED, is_mdf4
from recoil_acquisition.readers.mdf.master import master_of, time_of_group
from recoil_acquisition.readers.mdf.number_conversion import NumberConversion, number_conversion
from recoil_acquisition.readers.mdf.records import Records
from recoil_acquisition.readers.mdf.texts import text_of
from recoil_acquisition.readers.reader import Declarations, SignalHeader
from recoil_acquisition.readers.recording import Recording, StoredChannel, map_to_corrupt_file
from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.timebase import AbsoluteStart

LONGEST_COMMENT = 2000
_COMMENT_LINK = 5


class MdfReader:
    """Reader of MDF 4 files with measured channels."""

    name = "MDF 4"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file; masters are read, samples are not.

        Raises
        ------
        ReadError
            If the file holds frames of a bus alone, was never finalised, or is stored in a way that is not read.
        CorruptFileError
            If it is damaged.
        """
        with map_to_corrupt_file(path, "a whole MDF 4 file"):
            content = path.read_bytes()
            try:
                return _recording(path, content, _measured(path, content), declared.clock)
            except MdfDamageError as error:
                raise CorruptFileError(
                    "the blocks do not hang together", path=path, found=str(error), remedy="copy or export it again"
                ) from error
            except MdfUnsupportedError as error:
                raise ReadError(
                    "the file stores samples in a way that is not read", path=path, found=str(error),
                    remedy="let the program that wrote it export it as MDF 4.1",
                ) from error  # fmt: skip


def _measured(path: Path, content: bytes) -> list[ChannelGroup]:
    """Walk the chains of blocks; return all groups, of which some are measured channels."""
    if not is_mdf4(content[:128]):
        raise CorruptFileError("no MDF 4 file", path=path, place="byte 0", expected="`MDF     4.`")
    groups = list(iter_groups(content))
    _check_room(path, groups, len(content))
    is_measured = any(group.channel_count and not group.is_bus for group in groups)
    if content.startswith(UNFINALISED) and is_measured:
        raise ReadError(
            "the recording was never finalised: its counts cannot be trusted", path=path, place="byte 0",
            found="UnFinMF", remedy="finalise it with the recorder's program",
        )  # fmt: skip
    if any(group.is_bus for group in groups) and not is_measured:
        raise ReadError(
            "this is a log of a bus, without measured channels", path=path, remedy="declare its source as kind `can`"
        )
    return groups


def _check_room(path: Path, groups: Sequence[ChannelGroup], size: int) -> None:
    """Refuse groups whose blocks, or whose channels, which may lie over one another, take far more than the file."""
    measured = [group for group in groups if not group.is_bus]
    unpacked = sum(one.unpacked for one in {group.stored for group in measured})
    channels = 0
    for group in measured:
        # A count that the file has no room for is reported later, with its group
        most = (size + unpacked) // group.width if group.width else group.count
        channels += min(group.count, most) * sum(-(-one.bits // 8) or 8 for one in group.channels)
    if max(unpacked, channels) > most_unpacked(size):
        raise ReadError(
            f"the file unpacks to more than {most_unpacked(size) / 1e6:.0f} MB", path=path,
            found=f"{unpacked} bytes of records, {channels} of channels",
            remedy="export fewer channels, or without compression, if this is right",
        )  # fmt: skip


def _recording(path: Path, content: bytes, groups: Sequence[ChannelGroup], clock: str) -> Recording:
    notes = []
    if any(group.is_bus for group in groups):
        notes.append("frames of a bus in this file are not read here: read it as a source of kind `can` for those")
    start, zones = _start(content)
    stored = {
        at: StoredGroups(path, tuple(group for group in groups if group.stored.at == at))
        for at in dict.fromkeys(group.stored.at for group in groups)
    }
    numbered = [group for group in groups if not group.flags & VARIABLE_LENGTH]
    found: list[tuple[int, StoredTime, NumberChannel]] = []
    read: dict[int, Records] = {}
    for index, group in enumerate(numbered):
        label = _label(content, group, index)
        if group.is_bus:
            continue
        usable = list(_usable(content, group, label, notes))
        if not usable:
            continue
        time: StoredTime | str = "no samples"
        if group.count:
            if group.at not in read:  # groups that are stored together follow one another
                read = stored[group.stored.at].read(content)
            time = time_of_group(content, read[group.at], clock, start, notes, label)
        if isinstance(time, str):
            notes.append(f"{label}: {time}: its {len(usable)} channels are left out")
            continue
        found += [
            (index, time, NumberChannel(stored[group.stored.at], group, channel, conversion, time.kept))
            for channel, conversion in usable
        ]
    names, name_notes = unique_names([one.channel.name for _, _, one in found])
    channels = []
    for name, (index, time, one) in zip(names, found, strict=True):
        unit = unit_of(content, one.channel)
        metadata = {"group": index, "comment": text_of(content, one.channel.comment_at)[:LONGEST_COMMENT]}
        header = SignalHeader(name, unit, time.time_base.count, metadata=metadata)
        gain = one.conversion.linear if one.channel.data_type in INTEGERS else None
        counts = None if gain is None else partial(one.counts, unit, *gain)
        channels.append(StoredChannel(header, time.time_base, one.samples, counts))
    metadata_of_file = {
        "version": _printed(content, 8),
        "comment": text_of(content, _comment_at(content))[:LONGEST_COMMENT],
        "program": _printed(content, 16),
        "groups": [_label(content, group, i) for i, group in enumerate(numbered)],
        "zone_minutes": zones,
    }
    return container_recording(path, MdfReader.name, channels, metadata_of_file, [*notes, *name_notes], "", start)


def _usable(
    content: bytes, group: ChannelGroup, label: str, notes: list[str]
) -> Iterator[tuple[MdfChannel, NumberConversion]]:
    """Yield the channels of a group that are read, beside its time; say which others there are."""
    master = master_of(group)
    for channel in group.channels:
        if channel is master:
            continue
        conversion = rejection_reason(channel, group) or number_conversion(content, channel)
        if isinstance(conversion, str):
            notes.append(f"{channel.name} of {label}: {conversion}: left out")
        else:
            yield channel, conversion


def _label(content: bytes, group: ChannelGroup, index: int) -> str:
    named = text_of(content, group.name_at)
    return f"group {index} ({named})" if named else f"group {index}"


def _printed(content: bytes, at: int) -> str:
    """Return one of the texts of 8 bytes of the identification."""
    return content[at : at + 8].decode("latin-1").strip(" \0")


def _comment_at(content: bytes) -> int:
    (links,) = struct.unpack_from("<Q", content, HD_AT + 16)
    return int(struct.unpack_from("<Q", content, HD_AT + 24 + 8 * _COMMENT_LINK)[0]) if links > _COMMENT_LINK else 0


def _start(content: bytes) -> tuple[AbsoluteStart | None, list[int]]:
    """Return the start that the header block states, and its zones in minutes."""
    times = header_times(content)
    zones = [times.zone, times.summer]
    if not 0 < times.start_ns < 2**63:
        return None, zones
    zone_name = "unknown" if times.is_local else "UTC"
    return AbsoluteStart(str(np.datetime64(times.start_ns, "ns")), zone_name, "header of the file"), zones
