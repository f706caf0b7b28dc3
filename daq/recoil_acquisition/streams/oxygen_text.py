"""Texts of the data stream of an OXYGEN recorder about itself, XML: its start, and its channels in their order.

Structure: the parser of DEWETRON's LabVIEW client (MIT), version 1.5 of the stream. A real recorder's text was never
met: what is missing is left open, and what is there beside is let be.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass

MOST_CHANNELS = 4096
_ENTITIES = re.compile(r"<!\s*(?:DOCTYPE|ENTITY)", re.IGNORECASE)
_LONGEST_NS = 1 << 63


@dataclass(frozen=True)
class StatedChannel:
    """One channel as the text states it; ``value = factor * raw + offset`` in its unit."""

    name: str
    unit: str
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class StreamText:
    """Content of one text; None for what it does not speak of.

    Attributes
    ----------
    start_utc_ns
        Start of the acquisition, ns since 1970-01-01 UTC.
    """

    channels: tuple[StatedChannel, ...] | None = None
    start_utc_ns: int | None = None


def read_text(content: bytes) -> StreamText:
    """Read a text of the stream; ValueError, in one line, if it is none.

    The instant is that in nanoseconds; ISO 8601 is for people, and the recorder spells its number ``8061``.
    """
    text = content.rstrip(b"\0").decode("utf-8").strip()
    if _ENTITIES.search(text):
        raise ValueError("a text with entities of its own")
    try:
        root = ET.fromstring(text)  # noqa: S314 - entities were refused above
    except ET.ParseError as error:
        raise ValueError(f"a text that is no XML: {error}") from error
    if root.tag == "ChannelInfo":
        return StreamText(channels=_channels(root))
    if root.tag == "AcquisitionInfo":
        return StreamText(start_utc_ns=_start_ns(root))
    return StreamText()


def _channels(root: ET.Element) -> tuple[StatedChannel, ...]:
    rows = root.findall("Channel")
    if len(rows) > MOST_CHANNELS:
        raise ValueError(f"a text with {len(rows)} channels")
    return tuple(_channel(row) for row in rows)


def _channel(row: ET.Element) -> StatedChannel:
    scaling = row.find("LinearScaling")
    name, unit = row.get("name", ""), row.get("unit", "")
    if scaling is None:
        return StatedChannel(name, unit)
    factor, offset = (float(scaling.get(key, usual)) for key, usual in (("factor", "1"), ("offset", "0")))
    if not (math.isfinite(factor) and factor and math.isfinite(offset)):
        raise ValueError(f"a scaling of {name!r} by {factor:g} and {offset:g}")
    return StatedChannel(name, unit, factor, offset)


def _start_ns(root: ET.Element) -> int | None:
    for stamp in root.iter("Timestamp"):
        if stamp.get("format") == "nanoseconds" and (stamp.text or "").strip().isdecimal():
            start_ns = int((stamp.text or "").strip())
            return start_ns if start_ns < _LONGEST_NS else None
    return None
