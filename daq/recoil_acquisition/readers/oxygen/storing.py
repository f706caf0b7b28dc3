"""Storing of a .dmd file of DEWETRON OXYGEN: its events, in XML.

``Events`` hold ``storing_start`` and ``storing_stop`` per group, in ticks of a stated frequency. Group ``FAST`` is
that of the samples; ``SLOW`` that of the statistics.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from xml.etree import ElementTree as ET

from recoil_acquisition.readers.oxygen.blocks import MOST_TICKS
from recoil_acquisition.readers.oxygen.embedded_text import named, properties

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


def choose_windows(events: list[Event], *, is_finished: bool) -> tuple[Windows, list[str]]:
    """Return the storing windows that hold for samples, and what is to say about them."""
    notes = []
    groups = sorted({event.group for event in events if event.what.startswith("storing")})
    if not groups:
        return [(None, None)], ["no storing window is stated: all samples in the file are given"]
    group = SAMPLES_GROUP if SAMPLES_GROUP in groups else groups[0]
    windows = storing_windows(events, group)
    if any(storing_windows(events, other) != windows for other in groups):
        notes.append(f"groups {', '.join(groups)} were stored at different times: the times of {group} hold")
    for (_, before), (after, _) in pairwise(windows):
        if before is not None and after is not None:
            notes.append(f"nothing was stored from {float(before):.9g} s to {float(after):.9g} s")
    if windows[-1][1] is None:
        said = ", though the file is finished" if is_finished else ""
        notes.append(f"the end of storing is not stated{said}: all samples to the end are given")
    return windows, notes


def window_ticks(windows: Windows, frequency_hz: float) -> list[tuple[int, int]]:
    """Return the first tick of each window and the first behind it, at a channel's frequency."""
    rate = Fraction(frequency_hz)

    def tick(at_s: Fraction | None, otherwise: int) -> int:
        return otherwise if at_s is None else min(max(math.ceil(at_s * rate), 0), MOST_TICKS)

    return [(tick(begin, 0), tick(end, MOST_TICKS)) for begin, end in windows]
