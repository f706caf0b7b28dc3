"""The data stream of a virtual OXYGEN recorder, as bytes.

Layout: what DEWETRON's own client reads (pyOxygenStream 0.0.1, MIT), version 1.5 of its protocol, little-endian. What
it skips is a guess: the text of the welcome, the padding behind it, and what follows the footer's token. Nobody here
has met a real recorder.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

WELCOME = b"OXYGEN Data Stream (virtual)".ljust(64, b"\0")
"""Bytes that the recorder sends first on every connection."""

FIRST, LAST = 1, 2
"""Bits of a packet's status."""

ValueForm = Literal["f32", "i24"]
"""Form of the numbers on the wire."""

_CODES = {"f32": 10, "i24": 4}
_TOKEN, _END = b"OXYGEN<<", b">>OXYGEN\0\0\0\0"
_VERSION = 0x01050000
_STREAM = 1
_INFO, _XML, _SYNC, _ASYNC, _FOOTER = 1, 2, 3, 5, 7
_HEAD = struct.Struct("<8sI")
_PART = struct.Struct("<2I")
_INFO_PART = struct.Struct("<8I")
_SYNC_HEAD = struct.Struct("<5IQd")
_ASYNC_HEAD = struct.Struct("<5Id")

Raw = NDArray[np.uint8]
"""Numbers of a channel as they go over the wire, shape (n_samples, n_bytes)."""


@dataclass(frozen=True)
class WireChannel:
    """One channel as the recorder describes it: ``value = factor * raw + offset`` in its unit.

    Attributes
    ----------
    own_ticks
        Whether each of its samples is sent with its own tick, as those of a slow or an irregular source are.
    """

    name: str
    unit: str
    factor: float = 1.0
    offset: float = 0.0
    own_ticks: bool = False


def raw_of(values: NDArray[Any], form: ValueForm) -> Raw:
    """Return numbers as bytes: as float32, or as whole numbers of three bytes."""
    if form == "f32":
        return np.ascontiguousarray(values, dtype="<f4").view(np.uint8).reshape(-1, 4)
    wide = np.ascontiguousarray(values, dtype="<i4").view(np.uint8).reshape(-1, 4)
    return np.ascontiguousarray(wide[:, :3])


def data_part(channel: WireChannel, raw: Raw, first: int, rate_hz: float, form: ValueForm) -> bytes:
    """Return the part of a packet that holds a channel's samples from a tick on."""
    if not channel.own_ticks:
        head = _SYNC_HEAD.pack(_SYNC_HEAD.size + raw.size, _SYNC, _CODES[form], 1, len(raw), first, rate_hz)
        return head + raw.tobytes()
    records = np.empty(len(raw), dtype=[("tick", "<u8"), ("raw", np.uint8, raw.shape[1])])
    records["tick"], records["raw"] = first + np.arange(len(raw)), raw
    head = _ASYNC_HEAD.pack(_ASYNC_HEAD.size + records.nbytes, _ASYNC, _CODES[form], 1, len(raw), rate_hz)
    return head + records.tobytes()


def xml_part(text: str) -> bytes:
    """Return the part of a packet that holds a text."""
    content = text.encode()
    return _PART.pack(_PART.size + len(content), _XML) + content


def acquisition_info(start_utc_ns: int) -> str:
    """Return what the recorder says of its acquisition: the instant of tick 0."""
    at = np.datetime_as_string(np.datetime64(start_utc_ns, "ns"))
    return (
        f'<AcquisitionInfo><AcquisitionStart><Timestamp format="ISO8061">{at}Z</Timestamp>'
        f'<Timestamp format="nanoseconds" utc_offset_seconds="0">{start_utc_ns}</Timestamp></AcquisitionStart>'
        "</AcquisitionInfo>"
    )


def channel_info(channels: Sequence[WireChannel]) -> str:
    """Return what the recorder says of the channels that it streams."""
    rows = []
    for one in channels:
        plain = (one.factor, one.offset) == (1.0, 0.0)
        scaling = "<NoScaling/>" if plain else f'<LinearScaling factor="{one.factor!r}" offset="{one.offset!r}"/>'
        rows.append(f"<Channel name={quoteattr(one.name)} unit={quoteattr(one.unit)}>{scaling}</Channel>")
    return f"<ChannelInfo>{''.join(rows)}</ChannelInfo>"


def packet(sequence: int, seed: int, parts: Sequence[bytes], status: int = 0) -> bytes:
    """Return a whole packet of some parts, with what stands before and behind them."""
    info = _INFO_PART.pack(
        _INFO_PART.size, _INFO, _VERSION, _STREAM, sequence & 0xFFFFFFFF, status, seed, len(parts) + 2
    )
    footer = _PART.pack(_PART.size + len(_END), _FOOTER) + _END
    body = b"".join((info, *parts, footer))
    return _HEAD.pack(_TOKEN, _HEAD.size + len(body)) + body
