"""The conversions of MDF 4 channels: what a stored number stands for.

Layout (ASAM MDF 4.1): a conversion block has its type behind its links, the numbers of its references and its values,
8 bytes in all, the range, 16 bytes, and its values: of a linear one the offset and the factor, of a table a key and a
value by turns. The values of a virtual channel are stored nowhere: they are its conversion of the number of the record.
"""

from __future__ import annotations

import math
import struct

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.mdf.channel_groups import MdfChannel, MdfDamageError, MdfUnsupportedError, text_of
from recoil_acquisition.readers.mdf.records import Records

VIRTUAL_MASTER, VIRTUAL = 3, 6
"""Types of channels that take no bits of a record."""
_NONE, _LINEAR = 0, 1
_TABLES = (4, 5)
"""Types of tables from value to value; they differ only between their keys, where nothing is read here."""
_TEXTS = (7, 8)
"""Types of tables from value, and from range, to text: the number itself is what the standard of bus logging means."""
_CONVERSION = struct.Struct("<B3xHH16x")
"""Type, numbers of links beyond the first four and of values, range."""


def linear(content: bytes, channel: MdfChannel) -> tuple[float, float]:
    """Return the offset and the factor of a channel.

    Raises
    ------
    MdfDamageError
        If the conversion is damaged.
    MdfUnsupportedError
        If it is not linear.
    """
    kind, values = conversion_values(content, channel)
    if kind == _NONE:
        return 0.0, 1.0
    if kind != _LINEAR:
        raise MdfUnsupportedError(f"the channel {channel.name} has a conversion that is not linear, but of type {kind}")
    if len(values) < 2 or not all(map(math.isfinite, values)):
        raise MdfDamageError(f"the conversion at byte {channel.conversion_at} is linear and has the numbers {values}")
    return values[0], values[1]


def whole_numbers(content: bytes, records: Records, channel: MdfChannel) -> NDArray[np.int64] | NDArray[np.uint64]:
    """Return what a channel of whole numbers says, shape (n_records,).

    Parameters
    ----------
    content
        Bytes of the whole file.
    channel
        Channel that is stored in the records, or virtual.

    Raises
    ------
    MdfDamageError
        If it has other numbers than whole ones of 64 bits, or its conversion is damaged.
    MdfUnsupportedError
        If its conversion is of a type that is not read.
    """
    virtual = channel.kind in (VIRTUAL_MASTER, VIRTUAL)
    stored = np.arange(len(records.rows)) if virtual else records.integers(channel)
    kind, values = conversion_values(content, channel)
    if kind == _NONE or kind in _TEXTS:
        return stored
    if kind in _TABLES:
        return _looked_up(stored, values, channel)
    offset, factor = linear(content, channel)
    if (offset, factor) == (0.0, 1.0):
        return stored
    return _whole(stored.astype(np.float64) * factor + offset, channel)


def _looked_up(
    stored: NDArray[np.int64] | NDArray[np.uint64], values: tuple[float, ...], channel: MdfChannel
) -> NDArray[np.int64]:
    """Return the values of keys that a table has."""
    keys, index = np.unique(stored, return_inverse=True)
    table = dict(zip(values[::2], values[1::2], strict=False))
    unknown = [key for key in keys.tolist() if key not in table]
    if unknown:
        raise MdfDamageError(f"the channel {channel.name} has the number {unknown[0]}, which its conversion has not")
    return _whole(np.array([table[key] for key in keys.tolist()]), channel)[index]


def _whole(numbers: NDArray[np.float64], channel: MdfChannel) -> NDArray[np.int64]:
    if not (np.abs(numbers) < 2.0**53).all() or (numbers != np.floor(numbers)).any():
        raise MdfDamageError(f"the channel {channel.name} has numbers that are not whole")
    return numbers.astype(np.int64)


def conversion_values(content: bytes, channel: MdfChannel) -> tuple[int, tuple[float, ...]]:
    """Return the type and the values of a channel's conversion; raises `MdfDamageError` if it is damaged."""
    at = channel.conversion_at
    if not at:
        return _NONE, ()
    if content[at : at + 4] != b"##CC" or at + 24 > len(content):
        raise MdfDamageError(f"the link to byte {at} leads to no conversion")
    length, links = struct.unpack_from("<QQ", content, at + 8)
    body_at, end = at + 24 + 8 * links, min(at + length, len(content))
    if body_at + _CONVERSION.size > end:
        raise MdfDamageError(f"the conversion at byte {at} ends early")
    kind, references, values = _CONVERSION.unpack_from(content, body_at)
    if links != 4 + references or body_at + _CONVERSION.size + 8 * values > end:
        raise MdfDamageError(f"the conversion at byte {at} has not the {links} links and {values} values it states")
    return kind, struct.unpack_from(f"<{values}d", content, body_at + _CONVERSION.size)


def unit_of(content: bytes, channel: MdfChannel) -> str:
    """Return the unit of a channel: that of its conversion, else its own."""
    at = channel.conversion_at
    linked = at and content[at : at + 4] == b"##CC" and at + 40 <= len(content)
    (unit_at,) = struct.unpack_from("<Q", content, at + 32) if linked else (0,)
    return text_of(content, unit_at) or text_of(content, channel.unit_at)
