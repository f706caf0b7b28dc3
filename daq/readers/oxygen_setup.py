"""What a .dmd file of DEWETRON OXYGEN says about its channels, in XML.

The texts are plain, or ``99 'MZX'`` (hexadecimal 99), u32 **big endian** length, and a zlib stream. Three kinds matter:

- ``dmd_cfg``: per segment of the file its number, name, time base in Hz, and compression (``lz4`` or nothing);
- ``MeasurementConfig``: per channel the type of its samples, its name, unit, scaling, and where its samples are in
  a block of its segment. Channels without ``DMDStorageDetails`` were not stored;
- ``Events``: ``storing_start`` and ``storing_stop`` per group, in ticks of a stated frequency. Group ``FAST`` is
  that of the samples; ``SLOW`` that of the statistics.

A chain of ``Linear k d`` reads ``k * x + d``, one after the other. All that was seen has ``d = 0``.
"""

from __future__ import annotations

import datetime as dt
import math
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import BinaryIO
from xml.etree import ElementTree as ET

from daq.errors import CorruptFileError
from daq.readers.oxygen_blocks import TextBlock
from daq.timebase import AbsoluteStart

MOST_TEXT = 1 << 26
"""Bytes of one XML text, decompressed: the longest of the known files has 0.3 MB."""

SAMPLES_GROUP = "FAST"
_PACKED = b"\x99MZX"


@dataclass(frozen=True)
class SegmentSetup:
    """One segment of a file: its name, its ticks per second (0 for texts), its compression (empty for none)."""

    name: str
    frequency_hz: float
    compression: str


@dataclass(frozen=True)
class ChannelSetup:
    """One stored channel, as the setup describes it.

    Attributes
    ----------
    name, unit : str
    frequency : str
        ``SYNC`` or ``ASYNC``.
    sample_format : str
    frequency_hz : float
        Of its time base; NaN if it is not stated.
    gain, offset : float
        From stored numbers to its unit.
    segment, bit_offset, bit_stride : int
        Where its samples are in a block.
    refused : str
        Why it cannot be decoded; empty if it can.
    """

    name: str
    unit: str
    frequency: str
    sample_format: str
    frequency_hz: float
    gain: float
    offset: float
    segment: int
    bit_offset: int
    bit_stride: int
    refused: str


@dataclass(frozen=True, order=True)
class Event:
    """One event, at an instant in seconds after the acquisition's start, exactly."""

    at_s: Fraction
    what: str
    group: str


@dataclass(frozen=True)
class Setup:
    """What a ``MeasurementConfig`` says: its stored channels, those that were not stored, its start."""

    channels: tuple[ChannelSetup, ...]
    not_stored: tuple[str, ...]
    properties: dict[str, str]


def read_xml(path: Path, file: BinaryIO, block: TextBlock) -> ET.Element:
    """Read and parse one text.

    Raises
    ------
    CorruptFileError
        If it is no XML of plausible length, or declares entities.
    """
    place = f"text at byte {block.offset}"
    if block.length > MOST_TEXT:
        raise CorruptFileError("a text is too long", path=path, place=place, found=f"{block.length} bytes")
    file.seek(block.offset)
    content = file.read(block.length)
    try:
        if content.startswith(_PACKED):
            content = _unpack(content)
        text = content.rstrip(b"\0").decode("utf-8")
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise ValueError("it declares entities")
        return ET.fromstring(text)  # noqa: S314  entities are refused above, and the length is bounded
    except (ValueError, LookupError, zlib.error, ET.ParseError, RecursionError) as error:
        raise CorruptFileError(f"a text is damaged: {error}", path=path, place=place) from error


def _unpack(content: bytes) -> bytes:
    length = int.from_bytes(content[4:8], "big")
    if length > MOST_TEXT:
        raise ValueError(f"{length} bytes are more than {MOST_TEXT}")
    stream = zlib.decompressobj()
    text = stream.decompress(content[8:], length + 1)
    if len(text) != length:
        raise ValueError(f"{length} bytes were promised, and at least {len(text)} came")
    return text


def _local(element: ET.Element) -> str:
    return element.tag.rpartition("}")[2]


def _named(element: ET.Element, name: str) -> Iterator[ET.Element]:
    return (child for child in element.iter() if _local(child) == name)


def _properties(element: ET.Element) -> Iterator[tuple[str, str]]:
    """Yield the properties below an element that have a plain value, strings without their quotes."""
    for found in _named(element, "Property"):
        value = next(iter(found), None)
        if value is None:
            continue
        text = (value.text or "") if not len(value) else (value[0].text or "")
        if _local(value) == "StringValue" and len(text) > 1 and text[0] == text[-1] == '"':
            text = text[1:-1]
        yield found.get("name", ""), text


def read_segments(config: ET.Element) -> dict[int, SegmentSetup]:
    """Return the segments that a ``dmd_cfg`` describes; raises ``ValueError`` if it is not one, or big endian."""
    if _local(config) != "dmd_cfg":
        raise ValueError(f"expected dmd_cfg, found {_local(config)!r}")
    if any((e.text or "0") != "0" for e in _named(config, "big_endian_file_layout")):
        raise ValueError("the file is big endian, which was never seen")
    segments = {}
    for segment in _named(config, "segment"):
        values = {_local(child): (child.text or "") for child in segment}
        segments[int(values["identifier"])] = SegmentSetup(
            values.get("name", ""), float(values.get("time_base_frequency_hz", "nan")), values.get("compression", "")
        )
    return segments


def read_setup(config: ET.Element) -> Setup:
    """Return the channels and the times that a ``MeasurementConfig`` describes."""
    channels, not_stored = [], []
    for channel in _named(config, "Channel"):
        sample_type = next((child for child in channel if _local(child) == "DataFormat"), None)
        if sample_type is None:
            continue  # the topology names its channels alike
        properties = dict(_properties(channel))  # of equal names the last one stands
        name = properties.get("Neon/Name") or properties.get("DefaultName") or channel.get("id") or ""
        storage = next(_named(channel, "DMDStorageDetails"), None)
        if storage is None:
            not_stored.append(name)
        else:
            channels.append(_channel(channel, sample_type, properties, name, storage))
    header = next(_named(config, "MeasurementHeader"), None)
    return Setup(tuple(channels), tuple(not_stored), dict(_properties(header)) if header is not None else {})


def _channel(
    channel: ET.Element, sample_type: ET.Element, properties: dict[str, str], name: str, storage: ET.Element
) -> ChannelSetup:
    refused, gain, offset = "", 1.0, 0.0
    time_base = next((child for child in channel if _local(child) == "TimeBase"), None)
    chain = next((c for c in _named(channel, "ChannelStorage")), None)
    numbers = {}
    for key in ("segment_id", "raw_offset", "raw_stride"):
        text = storage.get(key, "")
        numbers[key] = int(text) if text.isdecimal() and len(text) < 16 else -1
    frequency_hz = _number(time_base.get("frequency", "") if time_base is not None else "")
    try:
        gain, offset = read_scaling(properties.get("Scaling", ""))
        user = _user_scaling(properties)
        if user and _chains_are_equal(channel):
            refused = f"its own scaling ({user}) does not show in its chain of scalings"
    except ValueError as error:
        refused = str(error)
    if sample_type.get("sample_dimension", "1") != "1":
        refused = f"each sample has {sample_type.get('sample_dimension')} numbers"
    elif chain is not None and chain.get("chain_step", "0") != "0":
        refused = f"it was stored at step {chain.get('chain_step')} of its chain"
    elif min(numbers.values()) < 0:
        refused = "its place in the file is not stated"
    return ChannelSetup(
        name, properties.get("Neon/PhysicalUnit", properties.get("Unit", "")), sample_type.get("frequency", ""),
        sample_type.get("sample_format", ""), frequency_hz, gain, offset,
        numbers["segment_id"], numbers["raw_offset"], numbers["raw_stride"], refused,
    )  # fmt: skip


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _user_scaling(properties: dict[str, str]) -> str:
    """Tell how the user scaled a channel himself; empty if he did not."""
    neutral = {"Factor": 1.0, "Sensitivity": 1.0, "Offset": 0.0}
    found = [
        f"{key.casefold()} {properties[f'Neon/PhysicalScale{key}']}"
        for key, value in neutral.items()
        if _number(properties.get(f"Neon/PhysicalScale{key}", str(value))) != value
    ]
    if properties.get("Neon/PhysicalScaleType", "Scale") != "Scale":
        found.append(f"type {properties['Neon/PhysicalScaleType']}")
    if properties.get("Neon/PhysicalScaleZeroActive", "False") != "False":
        found.append("zeroed")
    return ", ".join(found)


def _chains_are_equal(channel: ET.Element) -> bool:
    """Whether the channel's last scaling is no other than the one before it, or the only one."""
    chains = [text for name, text in _properties(channel) if name == "Scaling"]
    return len(chains) < 2 or chains[-1] == chains[-2]


def read_scaling(text: str) -> tuple[float, float]:
    """Return gain and offset of a chain of linear scalings.

    Raises
    ------
    ValueError
        If it holds another kind of scaling, or no numbers.
    """
    gain, offset = 1.0, 0.0
    if not text:
        return gain, offset
    if "<!" in text:
        raise ValueError("its scaling declares entities")
    try:
        steps = ET.fromstring(text)  # noqa: S314  entities are refused above
    except ET.ParseError as error:
        raise ValueError("its scaling is damaged") from error
    for step in steps:
        if step.tag != "Linear" or len(step):
            raise ValueError(f"its scaling is {step.tag!r}, not linear")
        k, d = _number(step.get("k", "")), _number(step.get("d", ""))
        if not math.isfinite(k * gain) or not math.isfinite(k * offset + d):
            raise ValueError(f"its scaling is no number: k {step.get('k')!r}, d {step.get('d')!r}")
        gain, offset = k * gain, k * offset + d
    return gain, offset


def read_events(text: ET.Element) -> Iterable[Event]:
    """Yield the events of a text; raises ``ValueError`` if an instant is no number."""
    for event in _named(text, "Event"):
        properties = dict(_properties(event))
        what = properties.get("eventType", "").removeprefix("oxy::")
        if what in ("storing_start", "storing_stop", "recording_start", "recording_stop"):
            frequency = float(properties.get("frequency", "nan"))
            if not (0 < frequency < math.inf):
                raise ValueError(f"an event's frequency is {properties.get('frequency')!r}")
            yield Event(
                Fraction(int(properties.get("ticks", ""))) / Fraction(frequency), what, properties.get("groupID", "")
            )


def storing_windows(events: Iterable[Event], group: str) -> list[tuple[Fraction | None, Fraction | None]]:
    """Return begin and end of each storing window of a group, ends excluded; None where it is not stated."""
    windows: list[tuple[Fraction | None, Fraction | None]] = []
    opened: Fraction | None = None
    is_open = False
    # a stop sorts before the start of the next window at the same instant
    for event in sorted(events, key=lambda e: (e.at_s, e.what == "storing_start")):
        if event.group != group:
            continue
        if event.what == "storing_start" and not is_open:
            opened, is_open = event.at_s, True
        elif event.what == "storing_stop" and (is_open or not windows):
            windows.append((opened, event.at_s))
            opened, is_open = None, False
    if is_open or not windows:
        windows.append((opened, None))
    return windows


def read_start(properties: dict[str, str]) -> AbsoluteStart | None:
    """Return the wall-clock time of tick 0; raises ``ValueError`` if it is none."""
    text = properties.get("AcquisitionStartTime")
    if not text:
        return None
    start = dt.datetime.fromisoformat(text)
    offset = start.utcoffset()
    zone = "unknown" if offset is None else "UTC" if not offset else str(start.tzinfo).removeprefix("UTC")
    resolution = "microseconds" if start.microsecond % 1000 else "milliseconds"
    return AbsoluteStart(start.replace(tzinfo=None).isoformat(timespec=resolution), zone, "AcquisitionStartTime")
