"""The recording of the measured channels of an MDF file of any version: one time base per channel group.

Opening reads the masters (times) alone; the samples of groups that are stored together are read when the first one of
them is asked for. Left out and named are texts, arrays, formulas and enumerations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import CorruptFileError, FileEnd, ReadError
from recoil_acquisition.readers.bounded_file import most_unpacked
from recoil_acquisition.readers.containers.stored_channels import container_recording
from recoil_acquisition.readers.containers.stored_time import StoredTime
from recoil_acquisition.readers.mdf.channel_groups import (
    INTEGERS,
    UNSIGNED,
    VARIABLE_LENGTH,
    ChannelGroup,
    MdfChannel,
    MdfCutError,
    MdfDamageError,
    MdfUnsupportedError,
    rejection_reason,
)
from recoil_acquisition.readers.mdf.coded_conversion import CodedConversion
from recoil_acquisition.readers.mdf.contents import MdfContents
from recoil_acquisition.readers.mdf.master import master_of, time_of_group
from recoil_acquisition.readers.mdf.number_conversion import NumberConversion
from recoil_acquisition.readers.mdf.records import Records, split
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel, map_to_corrupt_file
from recoil_acquisition.readers.statements import MOST_SHOWN, Statements, about_codes
from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.remark import Note, NoteCode, Remark

_Conversions = dict[tuple[int, int, int], NumberConversion | CodedConversion | str]
"""Those of a file by address, data type and bits."""
Kept = NDArray[np.int64] | None
"""Indices of the samples that the time base has; None if it has all."""

LONGEST_COMMENT = 2000


class StoredGroups:
    """Channel groups whose records are stored together.

    Parameters
    ----------
    contents
        Function that reads the file again.
    """

    def __init__(self, groups: tuple[ChannelGroup, ...], contents: Callable[[], MdfContents]) -> None:
        self._groups, self._contents = groups, contents
        self._held: dict[int, Records] = {}

    def records(self, group: ChannelGroup) -> Records:
        """Return the records of a group; those of all groups are held from then on."""
        if not self._held:
            self._held = self.read(self._contents())
        return self._held[group.at]

    def read(self, contents: MdfContents) -> dict[int, Records]:
        """Return the records of each group by its address.

        Raises
        ------
        MdfDamageError
            If blocks are damaged, or hold fewer records than a group states.
        MdfUnsupportedError
            If they are stored in a way that is not read.
        """
        found, _ = split(contents.stored_bytes(self._groups[0].stored), self._groups, counted=True)
        records = {}
        for group, one in zip(self._groups, found, strict=True):
            if len(one.rows) < group.count and one.samples is None:
                raise MdfDamageError(f"samples are missing: {len(one.rows)} of {group.count} records are in the blocks")
            records[group.at] = Records(group, one.rows[: group.count], one.samples)
        return records


@dataclass(frozen=True, eq=False)
class NumberChannel:
    """A channel of numbers."""

    stored: StoredGroups
    group: ChannelGroup
    channel: MdfChannel
    conversion: NumberConversion | CodedConversion
    kept: Kept

    def _part(self, start: int, stop: int) -> Records:
        rows = self.stored.records(self.group).rows
        return Records(self.group, rows[start:stop] if self.kept is None else rows[self.kept[start:stop]])

    def samples(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return samples in the channel's unit, invalid ones NaN, shape (stop - start,)."""
        part = self._part(start, stop)
        samples = self.conversion.applied(part.numbers(self.channel))
        samples[~part.valid(self.channel)] = np.nan
        return samples

    def counts(self, unit: str, gain: float, offset: float, start: int, stop: int) -> RawCounts | None:
        """Return the integers of a channel of linear conversion; None if any of them is invalid."""
        if not self.stored.records(self.group).valid(self.channel).all():
            return None
        size = next(size for size in (1, 2, 4, 8) if 8 * size >= self.channel.bits)
        kind = "u" if self.channel.data_type in UNSIGNED else "i"
        return RawCounts(self._part(start, stop).integers(self.channel).astype(f"{kind}{size}"), gain, offset, unit)


@dataclass(frozen=True)
class MeasuredFile:
    """A file whose blocks have been walked.

    Attributes
    ----------
    path
        Place of the file, to be read again for samples.
    reader
        Name of the reader that opened it.
    groups
        All groups of the file.
    metadata, start, notes, incomplete
        Statements of the file on itself, as `Recording` has them.
    """

    path: Path
    reader: str
    groups: Sequence[ChannelGroup]
    metadata: Mapping[str, Any]
    start: AbsoluteStart | None
    notes: Sequence[Remark] = ()
    incomplete: str = ""


@contextmanager
def mdf_errors(path: Path, name: str, *, stored: str = "samples", export: str = "MDF 4.1") -> Iterator[None]:
    """Turn what blocks are refused for, and what damaged ones lead to, into the errors of a reader.

    Parameters
    ----------
    name
        Name of the format.
    stored, export
        Names of what the file holds, and of the formats in which it can be exported to be read.

    Raises
    ------
    ReadError
        If the file stores them in a way that is not read.
    CorruptFileError
        If it is damaged.
    """
    with map_to_corrupt_file(path, f"a whole {name} file"):
        try:
            yield
        except MdfDamageError as error:
            raise CorruptFileError(
                "the blocks do not hang together",
                path=path,
                found=str(error),
                remedy="copy or export it again",
                file_end=FileEnd.MISSING if isinstance(error, MdfCutError) else FileEnd.UNCLEAR,
            ) from error
        except MdfUnsupportedError as error:
            raise ReadError(
                f"the file stores {stored} in a way that is not read", path=path, found=str(error),
                remedy=f"let the program that wrote it export it as {export}",
            ) from error  # fmt: skip


def check_room(path: Path, groups: Sequence[ChannelGroup], size: int) -> None:
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


def measured_recording(
    file: MeasuredFile, content: bytes, says: Callable[[bytes], MdfContents], clock: str
) -> Recording:
    """Return the recording of a file's measured channels.

    Parameters
    ----------
    content
        Bytes of the whole file, which are not kept.
    says
        Function that returns the contents of the same bytes.
    clock
        Name of the source.

    Raises
    ------
    MdfDamageError, MdfUnsupportedError
        As `MdfContents.stored_bytes` does, or if blocks hold fewer records than a group states.
    ReadError
        If there is no channel with a time.
    """
    contents, notes = says(content), list(file.notes)
    reread = cache(lambda: says(file.path.read_bytes()))
    stored = {
        at: StoredGroups(tuple(group for group in file.groups if group.stored.at == at), reread)
        for at in dict.fromkeys(group.stored.at for group in file.groups)
    }
    numbered = [group for group in file.groups if not group.flags & VARIABLE_LENGTH]
    labels = [_label(contents.name_of(group), index) for index, group in enumerate(numbered)]
    conversions: _Conversions = {}  # many channels may have the one
    left_out: dict[str, str] = {}
    found: list[tuple[int, StoredTime, NumberChannel, dict[str, int]]] = []
    read: dict[int, Records] = {}
    for index, (group, label) in enumerate(zip(numbered, labels, strict=True)):
        if group.is_bus:
            continue
        usable = list(_usable(contents, group, label, conversions, notes, left_out))
        if not usable:
            continue
        time: StoredTime | str = "no samples"
        if group.count:
            if group.at not in read:  # groups that are stored together follow one another
                read = stored[group.stored.at].read(contents)
            time = time_of_group(contents, read[group.at], clock, file.start, notes, label)
        if isinstance(time, str):
            text = f"{label}: {time}: its {len(usable)} channels are left out"
            notes.append(Note(NoteCode.LEFT_OUT, label, text))
            left_out |= {channel.name: f"{label}: {time}" for channel, _ in usable}
            continue
        for channel, conversion in usable:
            codes = _codes(read[group.at], channel, conversion)
            if sum(codes.values()) == group.count:
                left_out[channel.name] = (
                    f"an enumeration: all samples are words ({', '.join(list(codes)[:MOST_SHOWN])})"
                )
                notes.append(_left_out(channel, label, left_out[channel.name]))
                continue
            numbers = NumberChannel(stored[group.stored.at], group, channel, conversion, time.kept)
            found.append((index, time, numbers, codes))
    names, name_notes = unique_names([one.channel.name for _, _, one, _ in found])
    channels = []
    for name, (index, time, one, codes) in zip(names, found, strict=True):
        unit = contents.unit_of(one.channel)
        metadata = {"group": index, "comment": contents.comment_of(one.channel)[:LONGEST_COMMENT]}
        header = SignalHeader(name, unit, time.time_base.count, metadata=metadata)
        gain = one.conversion.linear if one.channel.data_type in INTEGERS and not codes else None
        if codes:
            notes.append(about_codes(name, codes, one.group.count))
        counts = None if gain is None else partial(one.counts, unit, *gain)
        said = {"comment": metadata["comment"]} | ({} if (limits := contents.limits_of(one.channel)) is None else {
            "limits": list(limits)
        })  # fmt: skip
        channels.append(StoredChannel(header, time.time_base, one.samples, counts, beside=Statements(said)))
    metadata_of_file = {**file.metadata, "groups": labels}
    return container_recording(
        file.path, file.reader, channels, metadata_of_file, [*notes, *name_notes], file.incomplete, file.start,
        left_out,
    )  # fmt: skip


def _usable(
    contents: MdfContents,
    group: ChannelGroup,
    label: str,
    conversions: _Conversions,
    notes: list[Remark],
    left_out: dict[str, str],
) -> Iterator[tuple[MdfChannel, NumberConversion | CodedConversion]]:
    """Yield the channels of a group that are read, beside its time; say which others there are, and why."""
    master = master_of(group)
    for channel in group.channels:
        if channel is master:
            continue
        reason = rejection_reason(channel, group)  # of a computed time too, whose conversion is no other channel's
        key = channel.conversion_at, channel.data_type, channel.bits
        if not reason and key not in conversions:
            conversions[key] = contents.conversion_of(channel)
        conversion = reason or conversions[key]
        if isinstance(conversion, str):
            notes.append(_left_out(channel, label, conversion))
            left_out[channel.name] = conversion
        else:
            yield channel, conversion


def _codes(records: Records, channel: MdfChannel, conversion: NumberConversion | CodedConversion) -> dict[str, int]:
    """Return how many valid samples stand for each word."""
    if not isinstance(conversion, CodedConversion):
        return {}
    return conversion.codes(records.numbers(channel)[records.valid(channel)])


def _left_out(channel: MdfChannel, label: str, why: str) -> Note:
    return Note(NoteCode.LEFT_OUT, channel.name, f"{channel.name} of {label}: {why}: left out")


def _label(name: str, index: int) -> str:
    return f"group {index} ({name})" if name else f"group {index}"
