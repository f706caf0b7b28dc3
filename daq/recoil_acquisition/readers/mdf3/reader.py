"""MDF 2 and 3 files: measured channels, read as those of MDF 4 from blocks of another build."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.mdf.channel_groups import ChannelGroup, DataGroup, MdfChannel, MdfDamageError
from recoil_acquisition.readers.mdf.kind import Unfinished
from recoil_acquisition.readers.mdf.measured import MeasuredFile, check_room, mdf_errors, measured_recording
from recoil_acquisition.readers.mdf.number_conversion import NumberConversion
from recoil_acquisition.readers.mdf3.blocks import OldBlocks
from recoil_acquisition.readers.mdf3.conversion import number_conversion, unit_of
from recoil_acquisition.readers.mdf3.groups import OldGroups, counted
from recoil_acquisition.readers.mdf3.header import OldHeader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording

_MARKS = (b"MDF     ", b"UnFinMF ")
_FLAGS_AT = 60
_DESCRIPTION_AT, _DESCRIPTION = 58, "128s"
_BUS = "frames of a bus in this file are not read: those of MDF 4 are"
_REDUCED = "reduced samples, which this file has beside the samples themselves, are not read"


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
        All of the file.
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

    def conversion_of(self, channel: MdfChannel) -> NumberConversion | str:
        """Return the conversion to numbers of a channel's block, or why it has none."""
        return number_conversion(self._blocks, channel)


def _measured(path: Path, content: bytes) -> MeasuredFile:
    """Walk the chains of blocks; return the file with all groups."""
    if not content.startswith(_MARKS) or content[8:10] not in (b"2.", b"3."):
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
    said = {incomplete: incomplete, _BUS: any(group.is_bus for group in groups), _REDUCED: walked.has_reduced_samples}
    notes = [*header.notes, *(note for note, holds in said.items() if holds)]
    return MeasuredFile(path, OldMdfReader.name, groups, header.metadata, header.start, notes, incomplete)


def _of_unfinished(
    path: Path, blocks: OldBlocks, groups: list[ChannelGroup], linked: set[int]
) -> tuple[list[ChannelGroup], str]:
    """Return the groups of a file that the recorder did not close, and what is to be said of it."""
    flags, own_flags = blocks.unpacked("2H", _FLAGS_AT)
    if not own_flags and flags and not Unfinished(flags).counts:
        return groups, "the recording was never finalised"
    if len(groups) != 1 or own_flags:
        raise ReadError(
            "the recording was never finalised: its counts cannot be trusted", path=path, place="byte 0",
            found="UnFinMF", remedy="finalise it with the recorder's program",
        )  # fmt: skip
    group = counted(groups[0], linked, len(blocks.content))
    return [group], f"the recording was never finalised: its {group.count} records are counted by their bytes"
