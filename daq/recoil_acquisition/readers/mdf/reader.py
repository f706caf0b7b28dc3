"""MDF 4 files: measured channels. Frames of a bus in the same file are named and left to the readers of buses.

Start of a recording by the header block (HD) of an MDF 4 file.

Kind of recording in an MDF 4 file: measured channels, a bus log, or both.

From the head of a file alone its groups are walked as far as the head reaches.
"""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.mdf.channel_groups import (
    HD_AT,
    ChannelGroup,
    DataGroup,
    MdfChannel,
    MdfDamageError,
    iter_groups,
    text_of,
)
from recoil_acquisition.readers.mdf.conversion import unit_of
from recoil_acquisition.readers.mdf.data_blocks import DataBlocks
from recoil_acquisition.readers.mdf.measured import (
    LONGEST_COMMENT,
    MeasuredFile,
    check_room,
    mdf_errors,
    measured_recording,
)
from recoil_acquisition.readers.mdf.number_conversion import NumberConversion, number_conversion
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.timebase import AbsoluteStart

UNFINALISED = b"UnFinMF 4."
"""Beginning of a file whose recorder has not yet, or never, put its counts in order."""

_FLAGS_AT = 60


@dataclass(frozen=True)
class Unfinished:
    """Parts that a recorder did not write before it was stopped, by the flags in the identification of its file."""

    flags: int

    @property
    def counts(self) -> bool:
        """Return whether the numbers of records are not written."""
        return bool(self.flags & 0x0001)

    @property
    def last_length(self) -> bool:
        """Return whether the length of the last block of records is not written."""
        return bool(self.flags & 0x0004)

    @property
    def offsets(self) -> bool:
        """Return whether the offsets of samples of variable length are not written."""
        return bool(self.flags & 0x0040)


def unfinished(head: bytes) -> Unfinished | None:
    """Return what the recorder left unwritten; None if it closed the file."""
    if not head.startswith(UNFINALISED):
        return None
    return Unfinished(int.from_bytes(head[_FLAGS_AT : _FLAGS_AT + 2], "little"))


def is_mdf4(head: bytes) -> bool:
    """Return whether a file begins as MDF of version 4, finalised or not."""
    return head.startswith((b"MDF     4.", UNFINALISED)) and len(head) > HD_AT


def is_bus_logging(head: bytes) -> bool:
    """Return whether a file's head shows bus frames and no measured channel beside them.

    A file whose channels are described behind its first samples shows neither in its head; it is taken
    for measured channels.

    Parameters
    ----------
    head
        The first `recoil_acquisition.readers.head.HEAD_BYTES` bytes, or all of the file.
    """
    return is_mdf4(head) and _is_bus_alone(head)


def is_undecided(head: bytes) -> bool:
    """Return whether a file begins as MDF 4 and describes its first channels behind the bytes given."""
    if not is_mdf4(head):
        return False
    groups = iter_groups(head, strict=False)
    return next(groups, None) is None


def is_bus_file(path: Path) -> bool:
    """Return whether all of a file shows what `is_bus_logging` looks for in its head."""
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _is_bus_alone(data)
    except (OSError, ValueError):
        return False


def _is_bus_alone(data: Any) -> bool:
    groups = list(iter_groups(data, strict=False))
    return any(g.is_bus for g in groups) and not any(g.channel_count and not g.is_bus for g in groups)


_BLOCK = struct.Struct("<16xQ")
"""Number of links, behind the block's marker and length (ASAM MDF 4.1, block header)."""
_TIMES = struct.Struct("<QhhB")
"""Start in ns, two zones in minutes, flags: behind the links of the header block (ASAM MDF 4.1, HDBLOCK)."""
_LOCAL_TIME = 0x01


class HeaderTimes(NamedTuple):
    """Start in ns since 1970, its zone and the summer time's shift in minutes, and the flags."""

    start_ns: int
    zone: int
    summer: int
    flags: int

    @property
    def is_local(self) -> bool:
        """Return whether the start counts in local time without a zone; else it counts in UTC."""
        return bool(self.flags & _LOCAL_TIME)


def header_times(content: bytes) -> HeaderTimes:
    """Read when a recording began; raises `MdfDamageError` if the block ends before it says so."""
    (links,) = _BLOCK.unpack_from(content, HD_AT)
    at = HD_AT + 24 + 8 * links
    if at + _TIMES.size > len(content):
        raise MdfDamageError("the header block ends early")
    return HeaderTimes(*_TIMES.unpack_from(content, at))


_COMMENT_LINK = 5
_BUS = "frames of a bus in this file are not read here: read it as a source of kind `can` for those"


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
        with mdf_errors(path, self.name):
            content = path.read_bytes()
            return measured_recording(_measured(path, content), content, Mdf4Contents, declared.clock)


@dataclass(frozen=True, eq=False)
class Mdf4Contents:
    """Contents of an MDF 4 file by its blocks.

    Attributes
    ----------
    content
        All of the file.
    """

    content: bytes

    def stored_bytes(self, stored: DataGroup) -> NDArray[np.uint8]:
        """Return the bytes of a data group's blocks."""
        return DataBlocks(self.content).read(stored.data_at)

    def name_of(self, group: ChannelGroup) -> str:
        """Return the text that is a group's name."""
        return text_of(self.content, group.name_at)

    def unit_of(self, channel: MdfChannel) -> str:
        """Return the unit of a channel's conversion, else its own."""
        return unit_of(self.content, channel)

    def comment_of(self, channel: MdfChannel) -> str:
        """Return the text of a channel's comment."""
        return text_of(self.content, channel.comment_at)

    def conversion_of(self, channel: MdfChannel) -> NumberConversion | str:
        """Return the conversion to numbers of a channel's block, or why it has none."""
        return number_conversion(self.content, channel)


def _measured(path: Path, content: bytes) -> MeasuredFile:
    """Walk the chains of blocks; return the file with all groups, of which some are measured channels."""
    if not is_mdf4(content[:128]):
        raise CorruptFileError("no MDF 4 file", path=path, place="byte 0", expected="`MDF     4.`")
    groups = list(iter_groups(content))
    check_room(path, groups, len(content))
    is_measured = any(group.channel_count and not group.is_bus for group in groups)
    if content.startswith(UNFINALISED) and is_measured:
        raise ReadError(
            "the recording was never finalised: its counts cannot be trusted", path=path, place="byte 0",
            found="UnFinMF", remedy="finalise it with the recorder's program",
        )  # fmt: skip
    has_bus = any(group.is_bus for group in groups)
    if has_bus and not is_measured:
        raise ReadError(
            "this is a log of a bus, without measured channels", path=path, remedy="declare its source as kind `can`"
        )
    start, zones = _start(content)
    metadata = {
        "version": _printed(content, 8),
        "comment": text_of(content, _comment_at(content))[:LONGEST_COMMENT],
        "program": _printed(content, 16),
        "zone_minutes": zones,
    }
    return MeasuredFile(path, MdfReader.name, groups, metadata, start, (_BUS,) if has_bus else ())


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
