"""The time that the waveform properties of a TDMS channel state, of one recording or of several in a row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.readers.containers.stored_time import StoredTime
from recoil_acquisition.readers.containers.time_axis import axis_unit_s
from recoil_acquisition.readers.tdms.history import Stretch, TdmsStamp
from recoil_acquisition.remark import Note, NoteCode, Remark

ROUNDING = 1e-6
"""Share of a sample below which two starts are the same: LabVIEW's starts of one task differ by 10^-16 s."""
FOLLOWS = 0.5
"""Share of a sample by which a stated start may be off the samples before: a host's clock states it."""
EPOCH = np.datetime64("1904-01-01T00:00:00", "ns")
_PREFERENCES = ("", "relative", "absolute")
_STEP, _OFFSET, _START = "wf_increment", "wf_start_offset", "wf_start_time"
_LATEST_S = 2**33


@dataclass(frozen=True, eq=False)
class TdmsTime:
    """The time of a channel.

    Attributes
    ----------
    started
        Instant of its zero; None if it states none.
    """

    stored: StoredTime
    started: TdmsStamp | None


def waveform_time(
    clock: str, properties: Mapping[str, Any], stretches: Sequence[Stretch], count: int, notes: list[Remark], label: str
) -> TdmsTime | str:
    """Return the time of a channel by its waveform properties, or why it has none.

    Parameters
    ----------
    properties
        Properties of the channel as they hold at the end.
    stretches
        Stretches of samples over which the properties hold, where these change.
    count
        Number of samples.
    notes, label
        List that notes are added to, and name of the channel for them.
    """
    if reason := changed(stretches, count):
        return reason
    stretches = [one for one in stretches if one.first < count]
    if len(stretches) < 2:  # what is stated behind the last sample was corrected later
        found = _line(properties)
        if isinstance(found, str):
            return found
        try:
            base = TimeBase.uniform(clock, found.offset_s, found.step_s, count)
        except ValueError as error:
            return f"its waveform properties are wrong ({error})"
        return TdmsTime(StoredTime(base, None, ""), found.started)
    lines: list[_Line] = []
    for stretch in stretches:
        found = _line(stretch.properties)
        if isinstance(found, str):
            return f"{found}, from sample {stretch.first} on"
        if lines and (found.started is None) != (lines[0].started is None):
            return f"its {_START} is not stated of all its samples, but up to, or from, sample {stretch.first}"
        lines.append(found)
    return _joined(clock, lines, [one.first for one in stretches], count, notes, label)


def changed(stretches: Sequence[Stretch], count: int) -> str:
    """Say which statement on the values of a channel changes between two of them; empty if none does."""
    stretches = [one for one in stretches if one.first < count]
    for before, behind in pairwise(stretches):
        for name in sorted({*before.properties, *behind.properties}):
            old, new = before.properties.get(name), behind.properties.get(name)
            if old != new and not name.startswith("wf_"):
                return (
                    f"its {name} changes from {old!r} to {new!r} at sample {behind.first}: "
                    "a second recording begins there, which has to be stored as a file of its own"
                )
    return ""


def started_at(properties: Mapping[str, Any]) -> TdmsStamp | None:
    """Return the ``wf_start_time`` of a channel; None if it has none or it was never set."""
    stamp = properties.get(_START)
    seconds, fractions = getattr(stamp, "seconds", 0), getattr(stamp, "second_fractions", 0)
    return TdmsStamp(int(seconds), int(fractions)) if seconds else None


def seconds_between(first: TdmsStamp, later: TdmsStamp) -> float:
    """Return how much later one instant is than another."""
    return float(later.seconds - first.seconds + (later.second_fractions - first.second_fractions) * 2.0**-64)


def absolute(stamp: TdmsStamp, origin: str) -> AbsoluteStart | None:
    """Return an instant as a start; None if no calendar of 64 bits has it."""
    if not -(2**32) < stamp.seconds < _LATEST_S:
        return None
    nanoseconds = round(stamp.second_fractions * 1e9 * 2.0**-64)
    instant = EPOCH + np.timedelta64(stamp.seconds, "s") + np.timedelta64(nanoseconds, "ns")
    return AbsoluteStart(str(instant), "UTC", origin)


@dataclass(frozen=True)
class _Line:
    """The instants of a stretch: an offset from its start, and a step, s."""

    offset_s: float
    step_s: float
    started: TdmsStamp | None


def _line(properties: Mapping[str, Any]) -> _Line | str:
    unit_s = axis_unit_s(str(properties.get("wf_xname", "")), str(properties.get("wf_xunit_string", "")))
    if isinstance(unit_s, str):
        return f"{unit_s} (wf_xname, wf_xunit_string)"
    preference = str(properties.get("wf_time_pref", "")).strip().casefold()
    if preference not in _PREFERENCES:
        return f"its wf_time_pref is {preference!r}, neither relative nor absolute"
    if _STEP not in properties:
        return f"no {_STEP} is stated"
    try:
        step_s, offset_s = (unit_s * float(properties.get(name, 0.0)) for name in (_STEP, _OFFSET))
        TimeBase.uniform("", offset_s, step_s, 1)
    except (TypeError, ValueError) as error:
        return f"its waveform properties are wrong ({error})"
    return _Line(offset_s, step_s, started_at(properties))


def _joined(
    clock: str, lines: Sequence[_Line], firsts: Sequence[int], count: int, notes: list[Remark], label: str
) -> TdmsTime | str:
    """Return the time of stretches that each state a start, a step or an offset of their own."""
    zero, step_s = lines[0].started, lines[0].step_s
    begins_s = [
        line.offset_s if zero is None or line.started is None else line.offset_s + seconds_between(zero, line.started)
        for line in lines
    ]
    off_s = max(abs(begin_s - begins_s[0] - first * step_s) for begin_s, first in zip(begins_s, firsts, strict=True))
    if all(abs(line.step_s - step_s) <= ROUNDING * step_s / count for line in lines) and off_s < FOLLOWS * step_s:
        if off_s > ROUNDING * step_s:
            text = (
                f"{label}: the starts that its segments state are up to {off_s:.1g} s off those that follow the samples"
                " before: the samples are taken one behind the other"
            )
            notes.append(Note(NoteCode.CONTRADICTION, label, text))
        return TdmsTime(StoredTime(TimeBase.uniform(clock, begins_s[0], step_s, count), None, ""), zero)
    ends = [*firsts[1:], count]
    parts = [
        begin_s + np.arange(end - first) * line.step_s
        for line, begin_s, first, end in zip(lines, begins_s, firsts, ends, strict=True)
    ]
    for index in range(1, len(parts)):
        if parts[index][0] <= parts[index - 1][-1]:
            return (
                f"a second recording begins at {_instant(zero, begins_s[index])}, sample {firsts[index]}, before the "
                f"samples in front of it end, {_instant(zero, float(parts[index - 1][-1]))}: store each as a file of "
                "its own"
            )
    more = f", {len(parts) - 1} more in all" if len(parts) > 2 else ""
    text = (
        f"{label}: a second recording begins at {_instant(zero, begins_s[1])}, sample {firsts[1]}{more}: each is at "
        "its own time"
    )
    notes.append(Note(NoteCode.SECOND_RECORDING, label, text))
    try:
        base = TimeBase.stamped(clock, np.concatenate(parts))
    except ValueError as error:
        return f"its waveform properties are wrong ({error})"
    return TdmsTime(StoredTime(base, None, ""), zero)


def _instant(zero: TdmsStamp | None, seconds: float) -> str:
    start = None if zero is None else absolute(zero, "")
    if start is None:
        return f"{seconds:g} s"
    return str(np.datetime64(start.text) + np.timedelta64(round(seconds * 1e6), "us"))
