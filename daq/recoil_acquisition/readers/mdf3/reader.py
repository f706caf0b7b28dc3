"""MDF 2 and 3 files: measured channels, read as those of MDF 4 from blocks of another build.

Layout (MDF 3.3.1), HD block: date and time as text, of the recorder's wall clock, without a zone. From version 3.20 on,
the start in ns since 1970, in local time without its summer time, and the zone in whole hours; some programs write the
former in UTC, and a zone of 0 is what they write who know none.

CC block: the range, the unit, 20 bytes, the type, the number of values or of pairs, and the values. A type 6 is a
quotient of two straight lines of what is left of a number over an offset, computed as the rational one that it is.
A type 12 has a text for ranges of numbers, and first of all one for any other number, which may be a scale of it:
``0.5*{X}+3``. Types 7 and 8, exponential and logarithmic, are named and not read: programs are at odds over
which of them is which.
"""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.containers.stored_channels import Damaged
from recoil_acquisition.readers.mdf.channel_groups import HD_AT, ChannelGroup, DataGroup, MdfChannel, MdfDamageError
from recoil_acquisition.readers.mdf.coded_conversion import BY_RANGE, CodedConversion, coded_conversion
from recoil_acquisition.readers.mdf.conversion import VIRTUAL_MASTER
from recoil_acquisition.readers.mdf.file_header import FLAGS_AT, Unfinished
from recoil_acquisition.readers.mdf.measured import MeasuredFile, check_room, mdf_errors, measured_recording
from recoil_acquisition.readers.mdf.number_conversion import (
    INTERPOLATED,
    LINEAR,
    NEAREST,
    NONE,
    RATIONAL,
    NumberConversion,
    checked_conversion,
    enumeration_of,
)
from recoil_acquisition.readers.mdf3.groups import OldBlocks, OldGroups, counted
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.remark import Note, NoteCode, Remark

_POLYNOMIAL = 6
_KINDS = {0: LINEAR, 1: INTERPOLATED, 2: NEAREST, _POLYNOMIAL: RATIONAL, 9: RATIONAL, 65535: NONE}
_OTHERS = {7: "an exponential conversion", 8: "a logarithmic conversion", 10: "a formula as text",
           11: "an enumeration (value to text)", 12: "an enumeration (range to text)", 132: "a date",
           133: "a time"}  # fmt: skip
_BY_RANGE = 12
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_SCALED = re.compile(rf'"?\s*({_NUMBER})\s*\*\s*{{X}}\s*({_NUMBER})?\s*"?')
"""Text that says how any other number is scaled, such as ``0.5*{X}+3``."""
_RATE_AT, _VALUES_AT = 210, 46
_LONGER = 0xFFFF
"""Length of a block that is longer than its length can say."""

_STAMP_AT = 164
_PEOPLE = ("author", "organisation", "project", "subject")
_HOUR_S = 3600
_FARTHEST_H = 14
"""Largest offset that any zone has, hours."""
_MARKS = (b"MDF     ", b"UnFinMF ")
_VERSIONS = (b"2.", b"3.")
_DESCRIPTION_AT, _DESCRIPTION = 58, "128s"
_BUS = "frames of a bus in this file are not read: those of MDF 4 are"
_REDUCED = "reduced samples, which this file has beside the samples themselves, are not read"


def number_conversion(blocks: OldBlocks, channel: MdfChannel) -> NumberConversion | CodedConversion | str:
    """Return the conversion of a channel to numbers, or why it has none; of a computed time, the step between two."""
    try:
        if channel.kind == VIRTUAL_MASTER:
            return checked_conversion(LINEAR, (0.0, *blocks.unpacked("d", channel.at + _RATE_AT)))
        if not channel.conversion_at:
            return NumberConversion(NONE, ())
        length, (*_, kind, count) = blocks.block(channel.conversion_at, "CC")
        if kind == _BY_RANGE:
            return _coded(blocks, channel.conversion_at, length, count)
        if kind not in _KINDS:
            return _OTHERS.get(kind, f"conversion {kind}")
        values = _values(blocks, channel.conversion_at, length, _count(_KINDS[kind], count))
    except MdfDamageError as error:
        return Damaged(f"damaged: {error}")
    return checked_conversion(_KINDS[kind], _rational(*values) if kind == _POLYNOMIAL else values)


def unit_of(blocks: OldBlocks, channel: MdfChannel) -> str:
    """Return the unit of a channel; empty if its conversion states none, or is damaged."""
    try:
        _, (*_, unit, _, _) = blocks.block(channel.conversion_at, "CC")
    except MdfDamageError:
        return ""
    return blocks.decoded(unit)


def _count(kind: int, stated: int) -> int:
    return {NONE: 0, LINEAR: 2, RATIONAL: 6}.get(kind, 2 * stated)


def _values(blocks: OldBlocks, at: int, length: int, count: int) -> tuple[float, ...]:
    if length < _VALUES_AT + 8 * count and length != _LONGER:
        raise MdfDamageError(f"the conversion at byte {at} has {length} bytes for {count} numbers")
    return blocks.unpacked(f"{count}d", at + _VALUES_AT)


def _coded(blocks: OldBlocks, at: int, length: int, count: int) -> CodedConversion | str:
    """Return the conversion of a table of texts by range, of which the first is that of any other number."""
    if length < _VALUES_AT + 20 * count and length != _LONGER:
        raise MdfDamageError(f"the conversion at byte {at} has {length} bytes for {count} ranges")
    rows = [blocks.unpacked("2dI", at + _VALUES_AT + 20 * row) for row in range(count)]
    if not rows:
        return enumeration_of(BY_RANGE)
    (_, _, default), *rows = rows
    found = _SCALED.fullmatch(blocks.text(default))
    other = "" if found is None else checked_conversion(LINEAR, (float(found[2] or 0.0), float(found[1])))
    meanings = [*(blocks.text(text) for _, _, text in rows), other]
    return coded_conversion(BY_RANGE, [key for low, high, _ in rows for key in (low, high)], meanings)


def _rational(p1: float, p2: float, p3: float, p4: float, p5: float, p6: float) -> tuple[float, ...]:
    """Return the coefficients of ``(p2 - p4 (x - p5 - p6)) / (p3 (x - p5 - p6) - p1)`` as those of a rational one."""
    return 0.0, -p4, p2 + p4 * (p5 + p6), 0.0, p3, -p1 - p3 * (p5 + p6)


class OldHeader:
    """The header of a file.

    Attributes
    ----------
    first_at
        Address of the first data group, or 0.
    start
        Start of the recording; None if the file states none.
    metadata
        Other statements of the header, JSON types only.
    notes
        Notes on contradictions.
    """

    def __init__(self, blocks: OldBlocks) -> None:
        length, fields = blocks.block(HD_AT, "HD")
        self.first_at, comment_at, _, _, date, time, *people = fields
        self.linked = {self.first_at, comment_at, fields[2]}
        has_stamp = length >= _STAMP_AT + 10
        stamp_ns, offset_h = blocks.unpacked("Qh", HD_AT + _STAMP_AT) if has_stamp else (0, 0)
        self.start, self.notes = _start(f"{blocks.decoded(date)} {blocks.decoded(time)}", stamp_ns, offset_h)
        stated = zip(_PEOPLE, map(blocks.decoded, people), strict=True)
        self.metadata: dict[str, Any] = {
            "version": blocks.decoded(blocks.content[8:16]),
            "program": blocks.decoded(blocks.content[16:24]),
            "comment": blocks.text(comment_at),
            "utc_offset_h": offset_h if has_stamp else None,
            **{name: text for name, text in stated if text},
        }


def _start(printed: str, stamp_ns: int, offset_h: int) -> tuple[AbsoluteStart | None, list[Remark]]:
    try:
        local = datetime.strptime(printed, "%d:%m:%Y %H:%M:%S")
    except ValueError:
        return None, []
    local_s = round((local - datetime(1970, 1, 1)).total_seconds())
    if not 0 < local_s < 2**63 // 10**9:
        return None, []
    whole_s, part_ns = divmod(stamp_ns, 10**9)
    zone = "unknown"
    notes: list[Remark] = []
    if stamp_ns and local_s - whole_s not in (0, _HOUR_S, _HOUR_S * offset_h):
        text, part_ns = "the header states two starts that are at odds: that of date and time is taken", 0
        notes.append(Note(NoteCode.CONTRADICTION, None, text))
    elif stamp_ns and (hours := _zone_h(local_s - whole_s, offset_h)) is not None:
        zone = f"{hours:+03d}:00"
    return AbsoluteStart(str(np.datetime64(10**9 * local_s + part_ns, "ns")), zone, "header of the file"), notes


def _zone_h(ahead_s: int, offset_h: int) -> int | None:
    """Return by how many hours date and time are ahead of UTC; None if that is open.

    Parameters
    ----------
    ahead_s
        Seconds by which date and time are ahead of the other start: 0 or an hour of summer time if that is local, the
        offset if it is UTC. Where the offset is one hour, an hour may be either.
    offset_h
        Offset as stated, hours.
    """
    if not 0 < abs(offset_h) <= _FARTHEST_H or (offset_h == 1 and ahead_s):
        return None
    return offset_h + 1 if ahead_s == _HOUR_S else offset_h


class OldMdfReader:
    """Reader of MDF 2 and 3 files."""

    name = "MDF 3"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file; masters are read, samples are not.

        Raises
        ------
        ReadError
            If a file that was never finalised does not show how many records it has.
        CorruptFileError
            If it is damaged.
        """
        with mdf_errors(path, self.name):
            content = path.read_bytes()
            return measured_recording(_measured(path, content), content, OldContents, declared.clock)


class OldContents:
    """Contents of an MDF 2 or 3 file by its blocks.

    Parameters
    ----------
    content
        Bytes of the whole file.
    """

    def __init__(self, content: bytes) -> None:
        self._blocks = OldBlocks(content)

    def stored_bytes(self, stored: DataGroup) -> NDArray[np.uint8]:
        """Return the bytes behind the link of a data group, as far as there are any."""
        content = np.frombuffer(self._blocks.content, np.uint8)
        return content[stored.data_at : stored.data_at + stored.size * bool(stored.data_at)]

    def name_of(self, group: ChannelGroup) -> str:
        """Return the comment of a group, which has no name."""
        return self._blocks.text(group.name_at)

    def unit_of(self, channel: MdfChannel) -> str:
        """Return the unit of a channel's conversion."""
        return unit_of(self._blocks, channel)

    def comment_of(self, channel: MdfChannel) -> str:
        """Return the comment of a channel, else its description."""
        (description,) = self._blocks.unpacked(_DESCRIPTION, channel.at + _DESCRIPTION_AT)
        return self._blocks.text(channel.comment_at) or self._blocks.decoded(description)

    def limits_of(self, channel: MdfChannel) -> tuple[float, float] | None:
        """Return the range of values of a channel's conversion, where it says that it has one."""
        try:
            if not channel.conversion_at or not self._blocks.unpacked("H", channel.conversion_at + 4)[0]:
                return None
            low, high = self._blocks.unpacked("2d", channel.conversion_at + 6)
        except MdfDamageError:
            return None
        return low, high

    def conversion_of(self, channel: MdfChannel) -> NumberConversion | CodedConversion | str:
        """Return the conversion to numbers of a channel's block, or why it has none."""
        return number_conversion(self._blocks, channel)


def _measured(path: Path, content: bytes) -> MeasuredFile:
    """Walk the chains of blocks; return the file with all groups."""
    if not content.startswith(_MARKS) or content[8:10] not in _VERSIONS:
        raise CorruptFileError("no MDF 3 file", path=path, place="byte 0", expected="`MDF     3.`")
    blocks = OldBlocks(content)
    header = OldHeader(blocks)
    walked = OldGroups(blocks, header.first_at)
    groups, incomplete = walked.groups, ""
    if content.startswith(_MARKS[1]):
        groups, incomplete = _of_unfinished(path, blocks, groups, walked.linked | header.linked)
    stated = walked.blocks_size + sum(stored.size for stored in {group.stored for group in groups})
    if stated > len(content):
        raise MdfDamageError(f"samples are missing: blocks and records state {stated} of {len(content)} bytes")
    check_room(path, groups, len(content))
    notes = [*header.notes, *([Note(NoteCode.CUT, None, incomplete)] if incomplete else [])]
    unread = {_BUS: any(group.is_bus for group in groups), _REDUCED: walked.has_reduced_samples}
    notes += [Note(NoteCode.LEFT_OUT, None, text) for text, is_there in unread.items() if is_there]
    return MeasuredFile(path, OldMdfReader.name, groups, header.metadata, header.start, notes, incomplete)


def _of_unfinished(
    path: Path, blocks: OldBlocks, groups: list[ChannelGroup], linked: set[int]
) -> tuple[list[ChannelGroup], str]:
    """Return the groups of a file that the recorder did not close, and the sign by which that shows."""
    flags, own_flags = blocks.unpacked("2H", FLAGS_AT)
    if not own_flags and flags and not Unfinished(flags).counts:
        return groups, "the recording was never finalised"
    if len(groups) != 1 or own_flags:
        raise ReadError(
            "the recording was never finalised: its counts cannot be trusted", path=path, place="byte 0",
            found="UnFinMF", remedy="finalise it with the recorder's program",
        )  # fmt: skip
    group = counted(groups[0], linked, len(blocks.content))
    return [group], f"the recording was never finalised: its {group.count} records are counted by their bytes"
