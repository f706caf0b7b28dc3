"""Descriptions of streams as bytes: JSON, compressed."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.streams.tick_stream import StreamDescription, TickChannel

_LARGEST = 1 << 24
"""Bytes of a description, unpacked."""


def packed_description(description: StreamDescription) -> bytes:
    """Return a description as bytes."""
    document = {
        "start_utc_ns": description.start_utc_ns,
        "time_by": description.time_by,
        "channels": [
            vars(one) | {"tick_rate": [one.tick_rate.numerator, one.tick_rate.denominator], "said": dict(one.said)}
            for one in description.channels
        ],
    }
    return zlib.compress(json.dumps(document).encode())


def description_of(packed: bytes) -> StreamDescription:
    """Return the description that bytes hold; ValueError if they hold none."""
    try:
        content = read_json(zlib.decompressobj().decompress(packed, _LARGEST))
        start_ns = content["start_utc_ns"]
        return StreamDescription(
            tuple(_channel_of(one) for one in content["channels"]),
            None if start_ns is None else int(start_ns),
            str(content["time_by"]),
        )
    except (KeyError, TypeError, AttributeError, ArithmeticError, RecursionError, zlib.error) as error:
        raise ValueError(f"no description: {error!r}") from error


def _channel_of(stated: Mapping[str, Any]) -> TickChannel:
    return TickChannel(
        str(stated["name"]),
        str(stated["unit"]),
        Fraction(*stated["tick_rate"]),
        int(stated["step"]),
        float(stated["factor"]),
        float(stated["offset"]),
        {str(key): str(text) for key, text in stated["said"].items()},
    )
