"""Frames of a CAN bus out of the records of an MDF 4 channel group.

Layout: "ASAM MDF 4, bus logging": the parts of a frame are channels that are composed to ``CAN_DataFrame``. A frame
that says of itself what cannot be, or whose data are not where it says, is left out and counted.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.can.frames import EXTENDED, FD_LENGTHS, ID_MASK, LARGEST_CHANNEL, FrameBlock
from recoil_acquisition.readers.mdf.channel_groups import ChannelGroup, MdfChannel, MdfDamageError, MdfUnsupportedError
from recoil_acquisition.readers.mdf.conversion import VIRTUAL, whole_numbers
from recoil_acquisition.readers.mdf.data_blocks import DataBlocks
from recoil_acquisition.readers.mdf.kind import Unfinished
from recoil_acquisition.readers.mdf.records import Records, VariableSamples
from recoil_acquisition.readers.mdf.stamps import times_ns

FRAME = "CAN_DataFrame"
LARGEST_FRAME = 64
"""Bytes of data."""
_COLUMNS = ("ID", "DataLength", "DataBytes")
_OPTIONAL = ("IDE", "BusChannel", "DLC", "EDL")
_FIXED, _VARIABLE, _UP_TO = 0, 1, 5
"""Types of channels: in the record; of variable length, elsewhere; in the record, with a length of their own."""


def variable_samples(
    frames: Records, together: list[Records], blocks: DataBlocks, unwritten: Unfinished
) -> VariableSamples | None:
    """Return the samples of variable length that the frames' data are; None if the data are in the records.

    Parameters
    ----------
    together
        All that are stored together with the frames.

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
        All of the file.
    samples
        See `variable_samples`.

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
