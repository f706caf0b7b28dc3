"""The records of an MDF 4 file by channel group, and the numbers that a channel has in them.

Layout (ASAM MDF 4.1): records of one channel group follow one another; where several groups are stored together, the
number of its group stands before each record, and a record of a group of variable length begins with its length, 4
bytes. A channel of variable length has an offset in its record: of its sample, 4 bytes of length and then its bytes,
in the block that the channel links to, or in the records of variable length as if they followed one another.

Where a record of several groups ends is known only once it was looked at, one after another. Loggers write the same
messages over and over, though: where the last records repeat, the next ones are taken to, many at a time, as far as
they do.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.mdf.channel_groups import (
    ALL_INVALID,
    FLOATS,
    INTEGERS,
    INVALIDATION,
    UNSIGNED,
    VARIABLE_LENGTH,
    ChannelGroup,
    MdfChannel,
    MdfDamageError,
)

_LENGTH = struct.Struct("<I")
_STEPS = 128
"""Records that are gone through one by one before it is tried whether they repeat."""
_LONGEST_PERIOD = 32
_FIRST_REPEATS, _MOST_REPEATS = 64, 1 << 14

_ID_SIZES = (1, 2, 4, 8)
_BIG_ENDIAN = frozenset({1, 3, 5})
_PIECE = 1 << 18
"""Samples of variable length that are gathered at a time."""


def record_places(
    data: NDArray[np.uint8], strides: Mapping[int, int], id_bytes: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Find the records in the data of one data group.

    Parameters
    ----------
    data : ndarray of uint8, shape (n_bytes,)
    strides
        Bytes of a record with the number before it, by the number of its channel group; 0 if each begins with its
        length.
    id_bytes
        Size of the number.

    Returns
    -------
    places : ndarray of int64, shape (n_records,)
        Byte at which each number stands.
    numbers : ndarray of int64, shape (n_records,)
        Numbers of the records' groups.
    left : int
        Bytes at the end that make no whole record.

    Raises
    ------
    MdfDamageError
        If a number is of no group.
    """
    # behind the end a number and a length can be read, of a record that is not whole
    content = data.tobytes() + bytes(16)
    places, numbers = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    at, size = 0, data.size
    while at < size:
        stepped, found, at = _stepped(content, size, at, strides, id_bytes)
        places.append(np.array(stepped, np.int64))
        numbers.append(np.array(found, np.int64))
        if at < size and (period := _period(np.stack([np.diff([*stepped, at]), numbers[-1]]))):
            repeated = _repeated(data, at, places[-1][-period:], id_bytes, numbers[-1][-period:], strides)
            places.append(repeated.ravel())
            numbers.append(np.tile(numbers[-1][-period:], len(repeated)))
            at += len(repeated) * (at - stepped[-period])
    every, number = np.concatenate(places), np.concatenate(numbers)
    left = size - int(every[-1]) if at != size else 0
    whole = every.size - bool(left)
    return every[:whole], number[:whole], left


def _stepped(
    content: bytes, size: int, at: int, strides: Mapping[int, int], id_bytes: int
) -> tuple[list[int], list[int], int]:
    """Go through some records one by one; return where they begin, their numbers, and where the last one ends."""
    places: list[int] = []
    numbers: list[int] = []
    length_at = _LENGTH.unpack_from
    while at < size and len(places) < _STEPS:
        number = int.from_bytes(content[at : at + id_bytes], "little")
        places.append(at)
        numbers.append(number)
        stride = strides.get(number)
        if stride is None:
            if at + id_bytes <= size:
                raise MdfDamageError(f"a record is of no group: number {number}, {at} bytes behind the first record")
            return places, numbers, size + 1  # the number itself is not whole
        at += stride or id_bytes + 4 + length_at(content, at + id_bytes)[0]
    return places, numbers, at


def _period(sizes_and_numbers: NDArray[np.int64]) -> int:
    """Return after how many of `_STEPS` records the last ones repeat themselves, twice at least; 0 if they do not."""
    for period in range(1, _LONGEST_PERIOD + 1):
        if (sizes_and_numbers[:, -period:] == sizes_and_numbers[:, -2 * period : -period]).all():
            return period
    return 0


def _repeated(
    data: NDArray[np.uint8],
    at: int,
    last: NDArray[np.int64],
    id_bytes: int,
    numbers: NDArray[np.int64],
    strides: Mapping[int, int],
) -> NDArray[np.int64]:
    """Return where the records begin that repeat the last ones from a place on, shape (n_repeats, n_records)."""
    size = at - int(last[0])
    lengths = [id_bytes + (0 if strides[number] else 4) for number in numbers.tolist()]
    # what must be the same in every repeat: each record's number, and its length where it states one
    same = np.concatenate([np.arange(n) + place - last[0] for place, n in zip(last, lengths, strict=True)])
    expected = data[last[0] + same]
    count, tried = 0, _FIRST_REPEATS
    while True:
        begin = at + count * size
        rows = min(tried, (data.size - begin) // size)
        block = data[begin : begin + rows * size].reshape(rows, size)[:, same]
        good = (block == expected).all(axis=1)
        count += rows if good.all() else int(np.argmin(good))
        if rows < tried or not good.all():
            begins = at + size * np.arange(count)
            return np.asarray(begins[:, None] + (last - last[0]), np.int64)
        tried = min(2 * tried, _MOST_REPEATS)


@dataclass(frozen=True, eq=False)
class Records:
    """Records of one channel group.

    Attributes
    ----------
    rows : ndarray of uint8, shape (n_records, width)
        Bytes of the records, with those of invalidation; empty for a group of variable length.
    samples
        Samples of a group of variable length; None for any other.
    last_at
        Byte at which the last record begins in the data that several groups share; -1 if there is none, or one group
        alone.
    """

    group: ChannelGroup
    rows: NDArray[np.uint8]
    samples: VariableSamples | None = None
    last_at: int = -1

    def numbers(self, channel: MdfChannel) -> NDArray[np.int64] | NDArray[np.uint64] | NDArray[np.float64]:
        """Return the numbers of a channel as they are stored, shape (n_records,).

        Raises
        ------
        MdfDamageError
            If the channel is no number of at most 64 bits.
        """
        if channel.data_type not in FLOATS:
            return self.integers(channel)
        if channel.bits not in (16, 32, 64) or channel.bit:
            raise MdfDamageError(f"the channel {channel.name} is a float of {channel.bits} bits")
        count = channel.bits // 8
        stored = np.ascontiguousarray(self.rows[:, channel.byte : channel.byte + count])
        return stored.view(f"{'>' if channel.data_type in _BIG_ENDIAN else '<'}f{count}")[:, 0].astype(np.float64)

    def integers(self, channel: MdfChannel) -> NDArray[np.int64] | NDArray[np.uint64]:
        """Return the whole numbers of a channel as they are stored, shape (n_records,); raises as `numbers` does."""
        if channel.data_type not in INTEGERS:
            raise MdfDamageError(f"the channel {channel.name} is no integer, but of data type {channel.data_type}")
        numbers = self._unsigned(channel, big_endian=channel.data_type in _BIG_ENDIAN)
        if channel.data_type in UNSIGNED:
            return numbers
        unused = np.int64(64 - channel.bits)
        return numbers.view(np.int64) << unused >> unused

    def offsets(self, channel: MdfChannel) -> NDArray[np.uint64]:
        """Return where the samples of a channel of variable length are, shape (n_records,)."""
        return self._unsigned(channel, big_endian=False)

    def _unsigned(self, channel: MdfChannel, *, big_endian: bool) -> NDArray[np.uint64]:
        count = (channel.bit + channel.bits + 7) // 8
        if not channel.bits > 0 or count > 8:
            raise MdfDamageError(f"the channel {channel.name} has {channel.bits} bits")
        stored = self.rows[:, channel.byte : channel.byte + count]
        eight = np.zeros((len(stored), 8), np.uint8)
        eight[:, :count] = stored[:, ::-1] if big_endian else stored
        numbers = eight.view("<u8")[:, 0].astype(np.uint64) >> np.uint64(channel.bit)
        return numbers if channel.bits == 64 else numbers & np.uint64((1 << channel.bits) - 1)

    def valid(self, channel: MdfChannel) -> NDArray[np.bool_]:
        """Return which samples of a channel are valid, shape (n_records,)."""
        if channel.flags & ALL_INVALID:
            return np.zeros(len(self.rows), bool)
        if not channel.flags & INVALIDATION:
            return np.ones(len(self.rows), bool)
        stored = self.rows[:, self.group.width + channel.invalid_at // 8]
        return np.asarray(stored & np.uint8(1 << channel.invalid_at % 8) == 0, bool)


@dataclass(frozen=True, eq=False)
class VariableSamples:
    """Samples of variable length.

    Attributes
    ----------
    data : ndarray of uint8, shape (n_bytes,)
        Bytes in which the samples stand.
    starts : ndarray of int64, shape (n_samples,), or None
        Byte of the data at which the length of each begins; None if offsets count in the data themselves.
    """

    data: NDArray[np.uint8]
    starts: NDArray[np.int64] | None = None

    def taken(self, offsets: NDArray[np.uint64], most: int) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """Return samples by their offsets.

        Parameters
        ----------
        offsets : ndarray of uint64, shape (n,)
        most
            Bytes of the longest sample that is taken.

        Returns
        -------
        samples : ndarray of uint8, shape (n, width)
            Samples, zero behind their lengths.
        lengths : ndarray of int64, shape (n,)
            Lengths of the samples, bytes; -1 where there is no sample, or a longer one.
        """
        return self._at(self._places(offsets), most)

    def in_order(self, count: int, most: int) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """Return the first samples as they follow one another, for records whose offsets were never written."""
        at = np.full(count, -1, np.int64)
        if self.starts is not None:
            at[: self.starts.size] = self.starts[:count]
        return self._at(at, most)

    def _at(self, at: NDArray[np.int64], most: int) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        there = at >= 0
        lengths = np.full(at.size, -1, np.int64)
        eight = self.data[at[there, None] + np.arange(4)] if there.any() else np.zeros((0, 4), np.uint8)
        lengths[there] = np.ascontiguousarray(eight).view("<u4")[:, 0]
        lengths[(lengths > most) | (at + 4 + lengths > self.data.size)] = -1
        lengths[_overlapping(at, lengths)] = -1
        samples = np.zeros((at.size, int(lengths.max(initial=0))), np.uint8)
        columns = np.arange(samples.shape[1])
        for start in range(0, at.size, _PIECE):
            piece = slice(start, start + _PIECE)
            within = columns < lengths[piece, None]
            samples[piece][within] = self.data[(at[piece, None] + 4 + columns)[within]]
        return samples, lengths

    def _places(self, offsets: NDArray[np.uint64]) -> NDArray[np.int64]:
        """Return where in the data the samples' lengths stand, -1 where there is none."""
        within = offsets <= np.uint64(max(0, self.data.size - 4))
        at = np.where(within, offsets, 0).astype(np.int64)
        if self.starts is None:
            return np.where(within & (self.data.size >= 4), at, -1)
        if not self.starts.size:
            return np.full(at.size, -1)
        lengths = np.ascontiguousarray(self.data[self.starts[:, None] + np.arange(4)]).view("<u4")[:, 0]
        ends = np.cumsum(4 + lengths.astype(np.int64))
        begins = np.concatenate([[0], ends[:-1]])
        found = np.searchsorted(begins, at).clip(max=begins.size - 1)
        return np.where(within & (begins[found] == at), self.starts[found], -1)


def _overlapping(at: NDArray[np.int64], lengths: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which samples share bytes with another one, shape (n,); several records may have the very same sample."""
    there = np.flatnonzero(lengths >= 0)
    ends_in_order = (at + 4 + lengths)[there]
    if (at[there][1:] >= ends_in_order[:-1]).all():  # one behind the other, as they are written
        return np.zeros(at.size, bool)
    begins, first, inverse = np.unique(at[there], return_index=True, return_inverse=True)
    ends = ends_in_order[first]
    into_next = np.zeros(begins.size, bool)
    into_next[:-1] = ends[:-1] > begins[1:]
    shared = into_next.copy()
    shared[1:] |= into_next[:-1]
    overlapping = np.zeros(at.size, bool)
    overlapping[there] = shared[inverse]
    return overlapping


def split(data: NDArray[np.uint8], groups: Sequence[ChannelGroup], *, counted: bool) -> tuple[list[Records], int]:
    """Split the records of one data group by their channel groups.

    Parameters
    ----------
    data : ndarray of uint8, shape (n_bytes,)
    groups
        All groups that are stored together.
    counted
        Whether the number of records is written where a group is stored alone; if not, and where several groups are
        stored together, there are as many as the data hold.

    Returns
    -------
    records : list of Records
        Records of each group, in the order of the groups.
    left : int
        Bytes at the end that make no whole record.

    Raises
    ------
    MdfDamageError
        If records have no width, or a record is of no group or could be of two.
    """
    id_bytes = groups[0].stored.id_bytes
    if not id_bytes:
        if len(groups) > 1 or groups[0].flags & VARIABLE_LENGTH:
            raise MdfDamageError("several groups are stored together without numbers before their records")
        width = _width(groups[0])
        held = data.size // width
        count = min(groups[0].count, held) if counted else held
        return [Records(groups[0], data[: count * width].reshape(-1, width))], data.size - count * width
    if id_bytes not in _ID_SIZES:
        raise MdfDamageError(f"the numbers before records have {id_bytes} bytes")
    if len({group.record_id for group in groups}) < len(groups) or max(g.record_id for g in groups) >= 2**63:
        raise MdfDamageError("groups that are stored together have no numbers of their own")
    strides = {g.record_id: 0 if g.flags & VARIABLE_LENGTH else id_bytes + _width(g) for g in groups}
    places, numbers, left = record_places(data, strides, id_bytes)
    return [_gathered(data, group, places[numbers == group.record_id] + id_bytes) for group in groups], left


def _width(group: ChannelGroup) -> int:
    width = group.width + group.invalidation_width
    if not width:
        raise MdfDamageError(f"the records of the group at byte {group.at} have no width")
    return width


def _gathered(data: NDArray[np.uint8], group: ChannelGroup, begins: NDArray[np.int64]) -> Records:
    last_at = int(begins[-1]) if begins.size else -1
    if group.flags & VARIABLE_LENGTH:
        return Records(group, np.zeros((0, 0), np.uint8), VariableSamples(data, begins), last_at)
    width = _width(group)
    if not begins.size:
        return Records(group, np.zeros((0, width), np.uint8))
    return Records(group, np.lib.stride_tricks.sliding_window_view(data, width)[begins], last_at=last_at)
