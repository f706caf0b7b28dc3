"""Bus logging of MDF 4: raw frames of CAN buses.

Layout: "ASAM MDF 4, bus logging": a group per kind of event has a channel ``CAN_DataFrame``, ``CAN_RemoteFrame``,
``CAN_ErrorFrame`` or ``CAN_OverloadFrame`` composed of ``.ID``, ``.IDE``, ``.BusChannel``, ``.DataLength`` and
``.DataBytes``, the last of fixed or variable length. A frame that says of itself what cannot be, or whose data are not
where it says, is left out and counted. Loggers store their groups together, and are often stopped before they wrote how
many records there are.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import ReadError, system_errors_as
from recoil_acquisition.readers.can.frames import (
    EXTENDED,
    FD_LENGTHS,
    ID_MASK,
    LARGEST_CHANNEL,
    CanLog,
    FrameBlock,
    FrameList,
)
from recoil_acquisition.readers.can.recording import CanRecording, declared_database
from recoil_acquisition.readers.can.second_recording import SecondRecordingError, second_begins
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.mdf.channel_groups import (
    MASTERS,
    ChannelGroup,
    MdfChannel,
    MdfDamageError,
    MdfUnsupportedError,
    iter_groups,
)
from recoil_acquisition.readers.mdf.conversion import VIRTUAL, whole_numbers
from recoil_acquisition.readers.mdf.data_blocks import DataBlocks
from recoil_acquisition.readers.mdf.file_header import (
    Unfinished,
    header_times,
    is_bus_file,
    is_bus_logging,
    is_undecided,
    unfinished,
)
from recoil_acquisition.readers.mdf.master import times_ns
from recoil_acquisition.readers.mdf.measured import mdf_errors
from recoil_acquisition.readers.mdf.records import Records, VariableSamples, split
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.remark import Note, NoteCode, Remark

FRAME = "CAN_DataFrame"
LARGEST_FRAME = 64
"""Bytes of data."""
_COLUMNS = ("ID", "DataLength", "DataBytes")
_OPTIONAL = ("IDE", "BusChannel", "DLC", "EDL")
_FIXED, _VARIABLE, _UP_TO = 0, 1, 5
"""Types of channels: in the record; of variable length, elsewhere; in the record, with a length of their own."""

_MOST_NAME = 2000
"""Bytes that are read of the name of a bus."""
_PADDING = 8
"""Bytes, fewer than which may fill up a block behind its records."""


def variable_samples(
    frames: Records, together: list[Records], blocks: DataBlocks, unwritten: Unfinished
) -> VariableSamples | None:
    """Return the samples of variable length that the frames' data are; None if the data are in the records.

    Parameters
    ----------
    together
        Records of all groups that are stored together with the frames.

    Raises
    ------
    MdfDamageError
        If the data are said to be records that they cannot be, or it is not stated whose they are.
    """
    channel = _columns(frames.group).get("DataBytes")
    if channel is None or channel.kind != _VARIABLE:
        return None
    linked = next((one for one in together if one.group.at == channel.data_at), None)
    if linked is None:
        return VariableSamples(blocks.read(channel.data_at))
    if linked.samples is None or linked.samples.starts is None:
        raise MdfDamageError(f"the data of frames are said to be the records of the group at byte {channel.data_at}")
    if unwritten.offsets:
        users = [c for one in together for c in one.group.channels if c.data_at == channel.data_at]
        more = linked.samples.starts.size - len(frames.rows)
        # one more of either is the last record that was written, and no other
        whole = more == 0 or (abs(more) == 1 and (linked.last_at > frames.last_at) == (more > 0))
        if len(users) > 1 or not whole:
            raise MdfDamageError("which data are whose is not stated: the recorder did not write their places")
    return linked.samples


def _columns(group: ChannelGroup) -> dict[str, MdfChannel]:
    """Return the first channel of each name that the standard gives to a part of a frame."""
    columns: dict[str, MdfChannel] = {}
    for channel in group.channels:
        if channel.name.startswith(f"{FRAME}."):
            columns.setdefault(channel.name.removeprefix(f"{FRAME}."), channel)
    return columns


def states_bus(group: ChannelGroup) -> bool:
    """Return whether the frames of a group say on which bus they came."""
    return "BusChannel" in _columns(group)


def frames_of(content: bytes, records: Records, samples: VariableSamples | None, unwritten: Unfinished) -> FrameBlock:
    """Return the sound frames of one group.

    Parameters
    ----------
    content
        Bytes of the whole file.
    samples
        Samples of variable length that are the data, see `variable_samples`.

    Raises
    ------
    MdfDamageError
        If a column cannot be what it is said to be.
    MdfUnsupportedError
        If columns are missing, or stored elsewhere than in the records.
    """
    columns = _columns(records.group)
    absent = [name for name in _COLUMNS if name not in columns]
    if "DLC" in columns and absent == ["DataLength"]:
        absent = []
    if absent:
        raise MdfUnsupportedError(f"frames without {', '.join(absent)}, but with {', '.join(list(columns)[:20])}")
    chosen = {name: columns[name] for name in (*_COLUMNS, *_OPTIONAL) if name in columns}
    for name, one in chosen.items():
        # the data may be of variable length, or of a largest one that is kept in the record, with a channel of lengths
        in_record = one.kind == _FIXED and not one.data_at
        nowhere = one.kind == VIRTUAL and not one.bits and not one.data_at and name != "DataBytes"
        up_to = one.kind == _UP_TO and content[one.data_at : one.data_at + 4] == b"##CN"
        if not (in_record or nowhere or (name == "DataBytes" and (up_to or one.kind == _VARIABLE))):
            raise MdfUnsupportedError(f"the channel {one.name} is of type {one.kind} with data of its own")
    whole = {name: whole_numbers(content, records, one) for name, one in chosen.items() if name != "DataBytes"}
    stored = whole["ID"].astype(np.int64)
    length = _lengths(whole)
    data, held = _data_bytes(records, chosen["DataBytes"], samples, unwritten)
    extended = whole["IDE"] != 0 if "IDE" in whole else stored & EXTENDED != 0
    channel = whole.get("BusChannel", np.zeros(stored.size, np.uint64))
    key = stored & ID_MASK
    time_ns, sound = times_ns(content, records)
    sound &= (length >= 0) & (extended | (key <= 0x7FF)) & (channel >= 0) & (channel <= LARGEST_CHANNEL)
    sound &= length == held if samples is not None and unwritten.offsets else length <= held
    sound &= _agree(whole, stored, length)
    for one in chosen.values():
        sound &= records.valid(one)
    width = max(8, data.shape[1])
    padded = np.zeros((int(sound.sum()), width), dtype=np.uint8)
    padded[:, : data.shape[1]] = data[sound]
    padded[np.arange(width) >= length[sound, None]] = 0
    return FrameBlock(
        place=np.arange(len(padded), dtype=np.int64),
        time_ns=time_ns[sound],
        key=(key[sound] | np.where(extended[sound], EXTENDED, 0)).astype(np.uint32),
        channel=channel[sound].astype(np.int64),
        length=length[sound],
        data=padded,
    )


def _lengths(whole: Mapping[str, NDArray[np.int64] | NDArray[np.uint64]]) -> NDArray[np.int64]:
    """Return the bytes of the frames' data: as stated, else by their data length codes."""
    if "DataLength" in whole:
        return whole["DataLength"].astype(np.int64)
    code = np.minimum(whole["DLC"].astype(np.uint64), 15).astype(np.int64)
    fd = whole["EDL"] != 0 if "EDL" in whole else np.zeros(code.size, bool)
    return np.where(fd, np.array(FD_LENGTHS)[code], np.minimum(code, 8))


def _agree(
    whole: Mapping[str, NDArray[np.int64] | NDArray[np.uint64]], stored: NDArray[np.int64], length: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return which frames say the same where they say something twice: their length, and whether they have 29 bits."""
    agree = np.ones(length.size, dtype=bool)
    if "IDE" in whole:
        agree &= (stored & EXTENDED == 0) | (whole["IDE"] != 0)
    if "EDL" in whole:
        agree &= (length <= FD_LENGTHS[8]) | (whole["EDL"] != 0)
    if "DLC" in whole and "DataLength" in whole:
        code = np.minimum(whole["DLC"].astype(np.uint64), 255).astype(np.int64)
        of_code = np.array(FD_LENGTHS)[np.minimum(code, len(FD_LENGTHS) - 1)]
        # some write the number of bytes in the place of its code
        agree &= (length == np.minimum(code, FD_LENGTHS[8])) | (length == of_code) | (length == code)
    return agree


def _data_bytes(
    records: Records, channel: MdfChannel, samples: VariableSamples | None, unwritten: Unfinished
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Return the data of the frames, and how many bytes of them are there."""
    if samples is None:
        if channel.bits % 8 or channel.bit or not 0 < channel.bits <= 8 * LARGEST_FRAME:
            raise MdfDamageError(f"the data of CAN frames are no bytes: {channel.bits} bits from bit {channel.bit}")
        count = channel.bits // 8
        data = records.rows[:, channel.byte : channel.byte + count]
        return data, np.full(len(data), count, np.int64)
    if unwritten.offsets and samples.starts is not None:
        return samples.in_order(len(records.rows), LARGEST_FRAME)
    return samples.taken(records.offsets(channel), LARGEST_FRAME)


class MdfBusReader:
    """Reader of bus logging in MDF 4."""

    name = "MDF4 bus logging"

    def claims(self, head: Head) -> Claim:
        """Be certain of frames of a bus alone; where the head does not show the channels, the whole file does."""
        is_own = is_bus_logging(head.content) or (is_undecided(head.content) and is_bus_file(head.path))
        return Claim.CERTAIN if is_own else Claim.NO

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a log; raises `ReadError` if it is damaged, or the database is missing or wrong."""
        database = declared_database(declared, path)
        return CanRecording(path, self.name, read_mdf(path), database, declared)


def read_mdf(path: Path) -> CanLog:
    """Read the frames of all buses in a file.

    Returns
    -------
    CanLog
        Time counts from the first data frame.

    Raises
    ------
    ReadError
        If the file cannot be read, or stores frames in a way that is not read here.
    CorruptFileError
        If its blocks do not fit together.
    """
    with system_errors_as(ReadError, path, "read", "check its permissions"):
        content = path.read_bytes()
    with mdf_errors(path, MdfBusReader.name, stored="frames", export="MDF 4.1, ASC or BLF"):
        try:
            return _read_groups(content)
        except SecondRecordingError as error:
            raise error.of(path) from error


def _read_groups(content: bytes) -> CanLog:
    not_closed = unfinished(content)
    unwritten = not_closed or Unfinished(0)
    groups = list(iter_groups(content))
    by_data: dict[int, list[ChannelGroup]] = {}
    for group in groups:
        by_data.setdefault(group.stored.at, []).append(group)
    blocks = DataBlocks(content, _open_block(content, groups) if unwritten.last_length else 0)
    found, cuts, frames, missing = FrameList(), [], [], 0
    notes: list[Remark] = []
    unnumbered: dict[str, int] = {}
    for together in by_data.values():
        if not any(group.is_bus for group in together):
            found.other_events += sum(group.count for group in together)
            notes += [_note_of_others(group, group.count) for group in together if group.count]
            continue
        records, left = split(blocks.read(together[0].stored.data_at), together, counted=not unwritten.counts)
        cuts += _cut(together, left, unwritten)
        for one in records:
            names = _event_names(one.group)
            count = len(one.rows)
            if FRAME in names:
                missing += 0 if unwritten.counts else max(0, one.group.count - count)
                if count:
                    block = frames_of(content, one, variable_samples(one, records, blocks, unwritten), unwritten)
                    found.damaged += count - block.key.size
                    if not states_bus(one.group):
                        # one bus for each source of records: what they do not number is told apart by its name
                        number = unnumbered.setdefault(_source_name(content, one.group.source_at), len(unnumbered))
                        block = replace(block, channel=np.full(block.key.size, number, dtype=np.int64))
                    if (at := second_begins(block.time_ns, block.channel)) is not None:
                        place = f"frame {at + 1} of the group at byte {one.group.at}"
                        raise SecondRecordingError("or a clock was set back: stamps go back", place)
                    frames.append(block)
            elif "CAN_ErrorFrame" in names:
                found.error_frames += count
            elif "CAN_RemoteFrame" in names:
                found.remote_frames += count
            elif count:
                found.other_events += count
                notes.append(_note_of_others(one.group, count))
    for block in _by_time(frames):
        found.add_block(block)
    can_frames, zero_ns = found.frames(from_first=True)
    if missing:
        cuts.append(f"the file is cut: {missing} frames that it states are not there")
    incomplete = "; ".join(cuts)
    if not_closed:
        cuts.append("the recorder did not close the file: its last frames may be missing")
    times = header_times(content)
    metadata = {
        **found.counts(),
        "version": content[8:16].split(b"\0")[0].decode("latin-1").strip(),
        "first_stamp_s": zero_ns / 1e9,
        "recorder_did_not_close_the_file": not_closed is not None,
    }
    start = _start(times.start_ns + zero_ns, times.is_local)
    bus_names = {number: name for name, number in unnumbered.items() if name} if len(unnumbered) > 1 else {}
    notes = [*found.notes(), *notes, *(Note(NoteCode.CUT, None, cut) for cut in cuts)]
    return CanLog(can_frames, start, tuple(notes), incomplete, metadata, bus_names)


def _source_name(content: bytes, at: int) -> str:
    """Return the name of where a group's records came from; empty if none is stated, or it cannot be read."""
    if content[at : at + 4] != b"##SI" or at + 32 > len(content):
        return ""
    (text_at,) = struct.unpack_from("<Q", content, at + 24)
    if content[text_at : text_at + 4] != b"##TX" or text_at + 24 > len(content):
        return ""
    (length,) = struct.unpack_from("<Q", content, text_at + 8)
    text = content[text_at + 24 : text_at + min(length, _MOST_NAME)]
    return text.split(b"\0")[0].decode("utf-8", errors="replace").strip()


def _open_block(content: bytes, groups: list[ChannelGroup]) -> int:
    """Return the address of the last block of records, whose length the recorder did not write; 0 if there is none."""
    blocks = DataBlocks(content)
    lasts = [places[-1] for at in {group.stored.data_at for group in groups} if (places := blocks.places(at))]
    return max((at for at in lasts if content[at : at + 4] == b"##DT"), default=0)


def _cut(together: list[ChannelGroup], left: int, unwritten: Unfinished) -> list[str]:
    """Say what the bytes behind the records mean, if they are no frame that the recorder had not finished.

    Raises
    ------
    MdfDamageError
        If the recorder closed the file, and the bytes of one group are not whole records.
    """
    group = together[0]
    width = group.width + group.invalidation_width
    alone = not group.stored.id_bytes
    if alone and not unwritten.flags:
        if left % width >= _PADDING:
            raise MdfDamageError(f"the group at byte {group.at} has {left % width} bytes more than records of {width}")
        several = f"{left} bytes behind the {group.count} records that a group states were not read"
        return [several] if left >= width else []
    widest = max(one.width + one.invalidation_width for one in together) + 8 + 4 + LARGEST_FRAME
    if not left or (unwritten.flags and left <= widest):
        return []
    return [f"the file is cut or damaged: {left} bytes behind the last whole record could not be read"]


def _event_names(group: ChannelGroup) -> set[str]:
    return {channel.name.partition(".")[0] for channel in group.channels}


def _note_of_others(group: ChannelGroup, count: int) -> Note:
    name = next((channel.name for channel in group.channels if channel.kind not in MASTERS), None)
    shown = "no channels" if name is None else name
    return Note(NoteCode.LEFT_OUT, name, f"{count} records of {shown}: no CAN frames, not read")


def _by_time(blocks: list[FrameBlock]) -> list[FrameBlock]:
    """Give the frames of several groups their places in time; one group keeps its order."""
    if len(blocks) < 2:
        return blocks
    time_ns = np.concatenate([block.time_ns for block in blocks])
    place = np.empty(time_ns.size, dtype=np.int64)
    place[np.argsort(time_ns, kind="stable")] = np.arange(time_ns.size)
    placed, at = [], 0
    for block in blocks:
        end = at + block.key.size
        placed.append(FrameBlock(place[at:end], block.time_ns, block.key, block.channel, block.length, block.data))
        at = end
    return placed


def _start(start_ns: int, local: bool) -> AbsoluteStart | None:
    """Return the wall-clock time of the first frame, to the nearest microsecond."""
    origin = "MDF header block and stamp of the first frame" + (", local time of the recorder" if local else "")
    return AbsoluteStart.since_1970(start_ns + 500, "unknown" if local else "UTC", origin)
