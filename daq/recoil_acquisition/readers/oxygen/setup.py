"""Channels and storing windows of a .dmd file of DEWETRON OXYGEN, as its XML describes them.

- ``dmd_cfg``: per segment of the file its number, name, time base in Hz, and compression (``lz4`` or nothing);
- ``MeasurementConfig``: per channel the type of its samples, its name, unit, scaling, and where its samples are in
  a block of its segment. Channels without ``DMDStorageDetails`` were not stored;
- ``Events``: ``storing_start`` and ``storing_stop`` per group, in ticks of a stated frequency. Group ``FAST`` is that
  of the samples; ``SLOW`` that of the statistics.

A chain of ``Linear k d`` reads ``k * x + d``, one after the other. All that was seen has ``d = 0``.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from xml.etree import ElementTree as ET

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.readers.oxygen.blocks import MOST_TICKS, local, named, properties
from recoil_acquisition.readers.text.cells import whole_number
from recoil_acquisition.remark import Note, NoteCode, Remark

SAMPLES_GROUP = "FAST"

Windows = list[tuple[Fraction | None, Fraction | None]]
"""Begin and end of each storing window in seconds after the acquisition's start, ends excluded; None if not stated."""


@dataclass(frozen=True, order=True)
class Event:
    """One event, at an instant in seconds after the acquisition's start, exactly."""

    at_s: Fraction
    what: str
    group: str


def read_events(text: ET.Element) -> Iterable[Event]:
    """Yield the events of a text; raises ``ValueError`` if an instant is no number."""
    for event in named(text, "Event"):
        said = dict(properties(event))
        what = said.get("eventType", "").removeprefix("oxy::")
        if what in ("storing_start", "storing_stop", "recording_start", "recording_stop"):
            frequency = float(said.get("frequency", "nan"))
            if not (0 < frequency < math.inf):
                raise ValueError(f"an event's frequency is {said.get('frequency')!r}")
            yield Event(Fraction(int(said.get("ticks", ""))) / Fraction(frequency), what, said.get("groupID", ""))


def storing_windows(events: Iterable[Event], group: str) -> Windows:
    """Return the storing windows of a group."""
    windows: Windows = []
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


def choose_windows(events: list[Event], *, is_finished: bool) -> tuple[Windows, list[Remark]]:
    """Return the storing windows that hold for samples, and what is to say about them."""
    notes: list[Remark] = []
    groups = sorted({event.group for event in events if event.what.startswith("storing")})
    if not groups:
        text = "no storing window is stated: all samples in the file are given"
        return [(None, None)], [Note(NoteCode.TIME, None, text)]
    group = SAMPLES_GROUP if SAMPLES_GROUP in groups else groups[0]
    windows = storing_windows(events, group)
    if any(storing_windows(events, other) != windows for other in groups):
        text = f"groups {', '.join(groups)} were stored at different times: the times of {group} hold"
        notes.append(Note(NoteCode.CONTRADICTION, None, text))
    for (_, before), (after, _) in pairwise(windows):
        if before is not None and after is not None:
            text = f"nothing was stored from {float(before):.9g} s to {float(after):.9g} s"
            notes.append(Note(NoteCode.LOST, None, text))
    if windows[-1][1] is None:
        said = ", though the file is finished" if is_finished else ""
        text = f"the end of storing is not stated{said}: all samples to the end are given"
        notes.append(Note(NoteCode.TIME, None, text))
    return windows, notes


def window_ticks(windows: Windows, frequency_hz: float) -> list[tuple[int, int]]:
    """Return the first tick of each window and the first behind it, at a channel's frequency."""
    rate = Fraction(frequency_hz)

    def tick(at_s: Fraction | None, otherwise: int) -> int:
        return otherwise if at_s is None else min(max(math.ceil(at_s * rate), 0), MOST_TICKS)

    return [(tick(begin, 0), tick(end, MOST_TICKS)) for begin, end in windows]


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
    frequency
        Kind of its time: ``SYNC`` or ``ASYNC``.
    frequency_hz
        Frequency of its time base, Hz; NaN if it is not stated.
    gain, offset
        Numbers that make its unit of stored numbers: ``gain * stored + offset``.
    segment, bit_offset, bit_stride
        Segment of its samples, and their first bit and the bits from one to the next in a block.
    refused
        Reason why it cannot be decoded; empty if it can.
    said
        All properties of the channel.
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
    said: Mapping[str, str]


@dataclass(frozen=True)
class Setup:
    """Content of a ``MeasurementConfig``: its stored channels, those that were not stored, its start."""

    channels: tuple[ChannelSetup, ...]
    not_stored: tuple[str, ...]
    properties: dict[str, str]


def read_segments(config: ET.Element) -> dict[int, SegmentSetup]:
    """Return the segments that a ``dmd_cfg`` describes; raises ``ValueError`` if it is not one, or big endian."""
    if local(config) != "dmd_cfg":
        raise ValueError(f"expected dmd_cfg, found {local(config)!r}")
    if any((e.text or "0") != "0" for e in named(config, "big_endian_file_layout")):
        raise ValueError("the file is big endian, which was never seen")
    segments = {}
    for segment in named(config, "segment"):
        values = {local(child): (child.text or "") for child in segment}
        segments[int(values["identifier"])] = SegmentSetup(
            values.get("name", ""), float(values.get("time_base_frequency_hz", "nan")), values.get("compression", "")
        )
    return segments


def read_setup(config: ET.Element) -> Setup:
    """Return the channels and the times that a ``MeasurementConfig`` describes."""
    channels, not_stored = [], []
    for channel in named(config, "Channel"):
        sample_type = next((child for child in channel if local(child) == "DataFormat"), None)
        if sample_type is None:
            continue  # the topology names its channels alike
        said = dict(properties(channel))  # of equal names the last one stands
        name = said.get("Neon/Name") or said.get("DefaultName") or channel.get("id") or ""
        storage = next(named(channel, "DMDStorageDetails"), None)
        if storage is None:
            not_stored.append(name)
        else:
            channels.append(_channel(channel, sample_type, said, name, storage))
    header = next(named(config, "MeasurementHeader"), None)
    return Setup(tuple(channels), tuple(not_stored), dict(properties(header)) if header is not None else {})


def _channel(
    channel: ET.Element, sample_type: ET.Element, said: dict[str, str], name: str, storage: ET.Element
) -> ChannelSetup:
    refused, gain, offset = "", 1.0, 0.0
    time_base = next((child for child in channel if local(child) == "TimeBase"), None)
    chain = next((c for c in named(channel, "ChannelStorage")), None)
    numbers = {}
    for key in ("segment_id", "raw_offset", "raw_stride"):
        number = whole_number(storage.get(key, ""))
        numbers[key] = -1 if number is None else number
    frequency_hz = _number(time_base.get("frequency", "") if time_base is not None else "")
    try:
        gain, offset = read_scaling(said.get("Scaling", ""))
        user = _user_scaling(said)
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
        name, said.get("Neon/PhysicalUnit", said.get("Unit", "")), sample_type.get("frequency", ""),
        sample_type.get("sample_format", ""), frequency_hz, gain, offset,
        numbers["segment_id"], numbers["raw_offset"], numbers["raw_stride"], refused, said,
    )  # fmt: skip


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _user_scaling(said: dict[str, str]) -> str:
    """Return how the user scaled a channel himself; empty if he did not."""
    neutral = {"Factor": 1.0, "Sensitivity": 1.0, "Offset": 0.0}
    found = [
        f"{key.casefold()} {said[f'Neon/PhysicalScale{key}']}"
        for key, value in neutral.items()
        if _number(said.get(f"Neon/PhysicalScale{key}", str(value))) != value
    ]
    if said.get("Neon/PhysicalScaleType", "Scale") != "Scale":
        found.append(f"type {said['Neon/PhysicalScaleType']}")
    if said.get("Neon/PhysicalScaleZeroActive", "False") != "False":
        found.append("zeroed")
    return ", ".join(found)


def _chains_are_equal(channel: ET.Element) -> bool:
    """Whether the channel's last scaling is no other than the one before it, or the only one."""
    chains = [text for name, text in properties(channel) if name == "Scaling"]
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


def read_start(properties: dict[str, str]) -> AbsoluteStart | None:
    """Return the wall-clock time of tick 0; raises ``ValueError`` if it is none."""
    text = properties.get("AcquisitionStartTime")
    if not text:
        return None
    start = dt.datetime.fromisoformat(text)
    resolution = "microseconds" if start.microsecond % 1000 else "milliseconds"
    return AbsoluteStart.at(start, "AcquisitionStartTime", resolution)
