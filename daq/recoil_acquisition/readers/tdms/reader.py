"""TDMS files of National Instruments' programs.

Time is in the waveform properties of a channel: ``wf_increment``, ``wf_start_offset`` and
``wf_start_time``; ``wf_samples`` is the length of a block and is not used. Steps are in seconds unless
``wf_xunit_string`` states another unit, as DIAdem does; an axis that is no time is refused. Time zero is the earliest
``wf_start_time``; channels that started later have the difference in their time, and so have the samples behind a
``wf_start_time`` that a later segment states anew: a second recording in the same file. A channel without
waveform properties takes the time channel of its group and length, numbers or time stamps.

Layout: National Instruments, *TDMS File Format Internal Structure* (segments, lead-in, raw data
index; time stamps count from 1904-01-01 UTC in 2^-64 s). Read by npTDMS.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.bounded_file import BoundedFile
from recoil_acquisition.readers.containers.stored_channels import container_recording, left_out_notes, note_on_starts
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel, map_to_corrupt_file
from recoil_acquisition.readers.statements import Statements
from recoil_acquisition.readers.tdms.channel import TdmsChannel, rejection_reason
from recoil_acquisition.readers.tdms.group_times import GroupTimes
from recoil_acquisition.readers.tdms.history import STATED, Stretch, TdmsStamp, how_it_ends, stretches_of
from recoil_acquisition.readers.tdms.library import tdms_library
from recoil_acquisition.readers.tdms.waveform import (
    ROUNDING,
    TdmsTime,
    absolute,
    changed,
    seconds_between,
    waveform_time,
)
from recoil_acquisition.remark import Note, NoteCode, Remark

TIME_REMEDY = "write the channels as waveforms over time, or a channel `Time` (s) into their group"


class TdmsReader:
    """Reader of TDMS files."""

    name = "TDMS"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file; time channels are read, samples are not.

        Raises
        ------
        ReadError
            If the file is an index, or no channel has a time.
        CorruptFileError
            If it is damaged.
        """
        with map_to_corrupt_file(path, "a whole TDMS file"):
            incomplete = how_it_ends(path)
            # An opened file keeps npTDMS from an index file beside it, which may be of another recording
            with BoundedFile(path) as file, tdms_library().TdmsFile.open(file, raw_timestamps=True) as tdms:
                return _recording(path, tdms, declared.clock, incomplete)


def _recording(path: Path, tdms: Any, clock: str, incomplete: str) -> Recording:
    size = path.stat().st_size
    notes: list[Remark] = [Note(NoteCode.CUT, None, incomplete)] if incomplete else []
    left_out: dict[str, str] = {}
    stretches = stretches_of(path)
    candidates: list[tuple[str, Any, GroupTimes]] = []
    for group in tdms.groups():
        times = GroupTimes(path, clock, notes)
        for channel in group.channels():
            label = f"{group.name}/{channel.name}"
            reason = rejection_reason(channel, (channel.properties, group.properties, tdms.properties), size, path)
            if times.take(channel, label, reason):
                continue
            if reason:
                left_out[label] = reason
            else:
                candidates.append((label, channel, times))
    chosen: list[_Chosen] = []
    timeless = False
    for label, channel, times in candidates:
        time = _time(channel, stretches.get(channel.path, ()), times, clock, notes, label)
        if isinstance(time, str):
            timeless = True
            left_out[label] = time
        else:
            chosen.append(_Chosen(label, channel, time))
            left_out = {name: reason for name, reason in left_out.items() if name not in times.used}
    if timeless and not chosen:
        found = [*notes, *(f"{name}: {reason}" for name, reason in left_out.items())]
        raise ReadError("no time in this file", path=path, found="; ".join(found[:4]), remedy=TIME_REMEDY)
    above = _plain(tdms.properties)
    levels = {group.name: _plain(group.properties) for group in tdms.groups() if group.properties}
    channels, start = _with_starts(path, chosen, notes, left_out, above, levels)
    metadata = {"properties": above, "groups": levels}
    rows = {one.label: one.channel.group_name for one in chosen if "wf_increment" in one.channel.properties}
    notes += left_out_notes(left_out)
    return container_recording(path, TdmsReader.name, channels, metadata, notes, incomplete, start, left_out, rows=rows)


@dataclass(frozen=True, eq=False)
class _Chosen:
    """A channel of numbers with its time."""

    label: str
    channel: Any
    time: TdmsTime


def _time(
    channel: Any, stretches: Sequence[Stretch], times: GroupTimes, clock: str, notes: list[Remark], label: str
) -> TdmsTime | str:
    if "wf_increment" in channel.properties:
        return waveform_time(clock, channel.properties, stretches, len(channel), notes, label)
    return changed(stretches, len(channel)) or times.time_of(len(channel))


def _with_starts(
    path: Path,
    chosen: Sequence[_Chosen],
    notes: list[Remark],
    left_out: dict[str, str],
    above: Mapping[str, Any],
    levels: Mapping[str, Mapping[str, Any]],
) -> tuple[list[StoredChannel], AbsoluteStart | None]:
    """Shift channels by the differences of their starts; one without a start cannot be among several."""
    starts = [one.time.started for one in chosen if one.time.started is not None]
    first = min(starts, key=lambda s: (s.seconds, s.second_fractions), default=None)
    start = None if first is None else absolute(first, "property wf_start_time")
    differ = any(_offset_s(first, one.time) for one in chosen)
    if differ:
        notes.append(note_on_starts())
    channels = []
    for one in chosen:
        channel, time = one.channel, one.time.stored
        if one.time.started is None and differ:
            left_out[one.label] = "states no start, and the others differ in theirs"
            continue
        base = time.time_base.shifted(_offset_s(first, one.time), start)
        unit = str(channel.properties.get("unit_string", ""))
        header = SignalHeader(one.label, unit, base.count, metadata={"properties": _plain(channel.properties)})
        stored = TdmsChannel(path, channel.group_name, channel.name)
        said = {**above, **levels.get(channel.group_name, {}), **_plain(channel.properties)}
        used = [name for name in said if name.startswith(STATED)]
        beside = Statements(said, used, np.dtype(channel.dtype).kind in "iu")
        samples, counts = partial(stored.samples, time.kept), partial(stored.counts, time.kept, unit)
        channels.append(StoredChannel(header, base, samples, counts, beside=beside))
    return channels, start


def _offset_s(first: TdmsStamp | None, time: TdmsTime) -> float:
    """Return how much later than the first a channel started; differences far below a sample are rounding."""
    if first is None or time.started is None:
        return 0.0
    offset_s, base = seconds_between(first, time.started), time.stored.time_base
    step_s = 1.0 / base.rate_hz if base.count > 1 else 1e-3
    return offset_s if offset_s > ROUNDING * step_s else 0.0


def _plain(properties: Mapping[str, Any]) -> dict[str, Any]:
    """Return properties as JSON types; time stamps as text."""
    plain: dict[str, Any] = {}
    for name, value in properties.items():
        own = value.item() if isinstance(value, np.generic) else value
        plain[name] = own if isinstance(own, (bool, int, float, str)) else str(own)
    return plain
