"""Descriptions of a stream as events among its blocks, so that any part of what is recorded says what it holds.

A description stands in the detail of events named `DESCRIBED`, packed, in as many parts as it takes. A device says it
at each connection and change, and again every `REPEATED_S`, because a capture may begin anywhere.
"""

from __future__ import annotations

import base64
import json
import zlib
from fractions import Fraction
from typing import Any

from recoil_acquisition.devices.device import LONGEST_DETAIL, Block, event_block
from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.streams.tick_stream import StreamDescription, TickChannel

DESCRIBED = "described"
"""Name of the event."""
REPEATED_S = 0.2
"""Longest time between two of them while samples come, s: less than what is cut behind a shot."""
_PART = LONGEST_DETAIL - 64
_MOST_PARTS = 256
_LARGEST = 1 << 24
"""Bytes of a description, unpacked."""


def described_events(source: str, host_ns: int, description: StreamDescription) -> tuple[Block, ...]:
    """Return the events that say a description."""
    document = {
        "start_utc_ns": description.start_utc_ns,
        "time_by": description.time_by,
        "channels": [
            vars(one) | {"tick_rate": [one.tick_rate.numerator, one.tick_rate.denominator], "said": dict(one.said)}
            for one in description.channels
        ],
    }
    packed = base64.b85encode(zlib.compress(json.dumps(document).encode())).decode()
    parts = [packed[at : at + _PART] for at in range(0, len(packed), _PART)]
    return tuple(
        event_block(source, host_ns, DESCRIBED, f"{number}/{len(parts)} {part}")
        for number, part in enumerate(parts, start=1)
    )


class DescribedEvents:
    """Puts the parts of descriptions together again."""

    def __init__(self) -> None:
        self._parts: list[str] = []

    def take(self, detail: str) -> StreamDescription | None:
        """Take the detail of the next event; return the description that it completes, None of any other."""
        head, _, part = detail.partition(" ")
        number, _, of = head.partition("/")
        if number == "1":
            self._parts = []
        if number != str(len(self._parts) + 1) or len(self._parts) >= _MOST_PARTS:
            self._parts = []  # its beginning is not there
            return None
        self._parts.append(part)
        if of != number:
            return None
        packed, self._parts = "".join(self._parts), []
        try:
            return _description_of(packed)
        except (ValueError, KeyError, TypeError, ZeroDivisionError, OverflowError, zlib.error):
            return None


def _description_of(packed: str) -> StreamDescription:
    unpacker = zlib.decompressobj()
    content = read_json(unpacker.decompress(base64.b85decode(packed), _LARGEST))
    start_ns = content["start_utc_ns"]
    return StreamDescription(
        tuple(_channel_of(one) for one in content["channels"]),
        None if start_ns is None else int(start_ns),
        str(content["time_by"]),
    )


def _channel_of(stated: dict[str, Any]) -> TickChannel:
    return TickChannel(
        str(stated["name"]),
        str(stated["unit"]),
        Fraction(*stated["tick_rate"]),
        int(stated["step"]),
        float(stated["factor"]),
        float(stated["offset"]),
        {str(key): str(text) for key, text in stated["said"].items()},
    )
