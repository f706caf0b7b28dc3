"""MDF 4 files: measured channels. Frames of a bus in the same file are named and left to the readers of buses."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.mdf.channel_groups import (
    HD_AT,
    ChannelGroup,
    DataGroup,
    MdfChannel,
    iter_groups,
    text_of,
)
from recoil_acquisition.readers.mdf.coded_conversion import CodedConversion, conversion_of, unit_of_any
from recoil_acquisition.readers.mdf.data_blocks import DataBlocks
from recoil_acquisition.readers.mdf.file_header import UNFINALISED, header_times, is_mdf4
from recoil_acquisition.readers.mdf.measured import (
    LONGEST_COMMENT,
    MeasuredFile,
    check_room,
    mdf_errors,
    measured_recording,
)
from recoil_acquisition.readers.mdf.number_conversion import NumberConversion
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.remark import Note, NoteCode

_COMMENT_LINK = 5
_HAS_LIMITS, _LIMITS_AT = 1 << 4, 40
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
        Bytes of the whole file.
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
        return unit_of_any(self.content, channel)

    def comment_of(self, channel: MdfChannel) -> str:
        """Return the text of a channel's comment."""
        return text_of(self.content, channel.comment_at)

    def limits_of(self, channel: MdfChannel) -> tuple[float, float] | None:
        """Return the limits of a channel's values in its unit, where its flags say that it has them."""
        if not channel.flags & _HAS_LIMITS:
            return None
        (links,) = struct.unpack_from("<Q", self.content, channel.at + 16)
        at = channel.at + 24 + 8 * links + _LIMITS_AT
        return struct.unpack_from("<2d", self.content, at) if at + 16 <= len(self.content) else None

    def conversion_of(self, channel: MdfChannel) -> NumberConversion | CodedConversion | str:
        """Return the conversion to numbers of a channel's block, or why it has none."""
        return conversion_of(self.content, channel)


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
    notes = (Note(NoteCode.LEFT_OUT, None, _BUS),) if has_bus else ()
    return MeasuredFile(path, MdfReader.name, groups, metadata, start, notes)


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
