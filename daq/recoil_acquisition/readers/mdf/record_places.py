"""Places of records that are stored together, each with the number of its channel group before it.

Where a record ends is known only once it was looked at, one after another. Loggers write the same messages over and
over, though: where the last records repeat, the next ones are taken to, many at a time, as far as they do.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.mdf.channel_groups import MdfDamageError

_LENGTH = struct.Struct("<I")
_STEPS = 128
"""Records that are gone through one by one before it is tried whether they repeat."""
_LONGEST_PERIOD = 32
_FIRST_REPEATS, _MOST_REPEATS = 64, 1 << 14


def record_places(
    data: NDArray[np.uint8], strides: Mapping[int, int], id_bytes: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Find the records in the data of one data group.

    Parameters
    ----------
    data : ndarray of uint8, shape (n_bytes,)
    strides
        By the number of a channel group, the bytes of its records with the number; 0 if each begins with its length.
    id_bytes
        Size of the number.

    Returns
    -------
    places : ndarray of int64, shape (n_records,)
        Where each number stands.
    numbers : ndarray of int64, shape (n_records,)
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
