"""TDMS files of National Instruments' programs.

Time is in the waveform properties of a channel: ``wf_increment``, ``wf_start_offset`` and
``wf_start_time``; ``wf_samples`` is the length of a block and is not used. Time zero is the earliest
``wf_start_time``; channels that started later have the difference in their time. A channel without
waveform properties takes the time channel of its group and length.

Layout: National Instruments, *TDMS File Format Internal Structure* (segments, lead-in, raw data
index; time stamps count from 1904-01-01 UTC in 2^-64 s). Read by npTDMS.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.bounded_file import BoundedFile
from recoil_acquisition.readers.containers.stored_channels import container_recording
from recoil_acquisition.readers.containers.stored_time import StoredTime, time_from_vector
from recoil_acquisition.readers.reader import Declarations, SignalHeader
from recoil_acquisition.readers.recording import Recording, StoredChannel, map_to_corrupt_file
from recoil_acquisition.readers.tdms.channel import TdmsChannel, rejection_reason
from recoil_acquisition.readers.tdms.segments import how_it_ends
from recoil_acquisition.readers.time.time_units import TIME_UNITS_S
from recoil_acquisition.timebase import AbsoluteStart, TimeBase

ROUNDING = 1e-6
"""Share of a sample below which two starts are the same: LabVIEW's starts of one task differ by 10^-16 s."""
TIME_NAMES = ("time", "time (s)", "time [s]", "t", "t (s)", "zeit", "time_s")
EPOCH = np.datetime64("1904-01-01T00:00:00", "ns")


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
            from nptdms import TdmsFile

            # An opened file keeps npTDMS from an index file beside it, which may be of another recording
            with BoundedFile(path) as file:
                tdms = TdmsFile.read_metadata(file, raw_timestamps=True)
                return _recording(path, tdms, declared.clock, incomplete)


def _recording(path: Path, tdms: Any, clock: str, incomplete: str) -> Recording:
    size = path.stat().st_size
    notes = [incomplete] if incomplete else []
    candidates: list[_Candidate] = []
    for group in tdms.groups():
        times: dict[str, StoredTime | str] = {}
        members = list(group.channels())
        for channel in members:
            label = f"{group.name}/{channel.name}"
            reason = rejection_reason(channel, (channel.properties, group.properties, tdms.properties), size, path)
            if reason:
                notes.append(f"{label}: {reason}: left out")
                continue
            if "wf_increment" not in channel.properties and channel.name.casefold() in TIME_NAMES:
                times[channel.name] = _read_times(path, channel, clock, notes, label)
                continue
            candidates.append(_Candidate(label, channel, times))
    chosen: list[_Candidate] = []
    timeless = 0
    for candidate in candidates:
        time = _time(candidate, clock)
        if isinstance(time, str):
            timeless += 1
            notes.append(f"{candidate.label}: {time}: left out")
        else:
            chosen.append(replace(candidate, time=time))
    if timeless and not chosen:
        raise ReadError(
            "no time in this file", path=path, found="; ".join(notes[:4]),
            remedy="write the channels as waveforms, or a channel `Time` (s) into their group",
        )  # fmt: skip
    channels, start = _with_starts(path, chosen, notes)
    metadata = {
        "properties": _plain(tdms.properties),
        "groups": {group.name: _plain(group.properties) for group in tdms.groups() if group.properties},
    }
    return container_recording(path, TdmsReader.name, channels, metadata, notes, incomplete, start)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A channel of numbers, the time channels of its group, and the time that it was given."""

    label: str
    channel: Any
    times: Mapping[str, StoredTime | str]
    time: StoredTime | None = None

    @property
    def started(self) -> Any:
        """Its `wf_start_time` as npTDMS' time stamp; None if it has none or it was never set."""
        stamp = self.channel.properties.get("wf_start_time")
        return stamp if hasattr(stamp, "second_fractions") and stamp.seconds else None


def _read_times(path: Path, channel: Any, clock: str, notes: list[str], label: str) -> StoredTime | str:
    unit = str(channel.properties.get("unit_string", "")).strip()
    if unit and unit not in TIME_UNITS_S:
        return f"the unit {unit!r} of the time channel {label} is no unit of time"
    if not unit and not channel.name.endswith(("(s)", "[s]", "_s")):
        notes.append(f"{label}: no unit is stated: read as seconds")
    factor = TIME_UNITS_S.get(unit, 1.0)
    values = TdmsChannel(path, channel.group_name, channel.name).read(0, len(channel))
    return time_from_vector(clock, values, factor, label, notes)


def _time(candidate: _Candidate, clock: str) -> StoredTime | str:
    properties, count = candidate.channel.properties, len(candidate.channel)
    if "wf_increment" in properties:
        try:
            step_s, offset_s = float(properties["wf_increment"]), float(properties.get("wf_start_offset", 0.0))
            return StoredTime(TimeBase.uniform(clock, offset_s, step_s, count), None, "")
        except (TypeError, ValueError) as error:
            return f"its waveform properties are wrong ({error})"
    faulty = [time for time in candidate.times.values() if isinstance(time, str)]
    fitting = [
        time for time in candidate.times.values()
        if not isinstance(time, str) and time.stamp_count == count
    ]  # fmt: skip
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        return f"{len(fitting)} time channels have its length"
    return faulty[0] if faulty else "no waveform properties, and no time channel of its length"


def _with_starts(
    path: Path, chosen: list[_Candidate], notes: list[str]
) -> tuple[list[StoredChannel], AbsoluteStart | None]:
    """Shift channels by the differences of their starts; one without a start cannot be among several."""
    starts = [c.started for c in chosen if c.started is not None]
    first = min(starts, key=lambda s: (s.seconds, s.second_fractions), default=None)
    absolute = None if first is None else _absolute(first)
    differ = any(_offset_s(first, c) for c in chosen)
    if differ:
        notes.append("channels start at different absolute times: their differences are in their time")
    channels = []
    for candidate in chosen:
        time, channel, properties = candidate.time, candidate.channel, candidate.channel.properties
        if time is None:
            continue
        if candidate.started is None and differ:
            notes.append(f"{candidate.label}: states no start, and the others differ in theirs: left out")
            continue
        offset_s = _offset_s(first, candidate)
        base = time.time_base.shifted(offset_s, absolute)
        unit = str(properties.get("unit_string", ""))
        header = SignalHeader(candidate.label, unit, base.count, metadata={"properties": _plain(properties)})
        stored = TdmsChannel(path, channel.group_name, channel.name)
        channels.append(
            StoredChannel(header, base, partial(stored.samples, time.kept), partial(stored.counts, time.kept, unit))
        )
    return channels, absolute


def _offset_s(first: Any, candidate: _Candidate) -> float:
    """Return how much later than the first a channel started; differences far below a sample are rounding."""
    later, time = candidate.started, candidate.time
    if later is None or time is None:
        return 0.0
    offset_s = later.seconds - first.seconds + (later.second_fractions - first.second_fractions) * 2.0**-64
    step_s = 1.0 / time.time_base.rate_hz if time.time_base.count > 1 else 1e-3
    return float(offset_s) if offset_s > ROUNDING * step_s else 0.0


def _absolute(stamp: Any) -> AbsoluteStart | None:
    if not -(2**32) < stamp.seconds < 2**33:
        return None
    nanoseconds = round(stamp.second_fractions * 1e9 * 2.0**-64)
    instant = EPOCH + np.timedelta64(stamp.seconds, "s") + np.timedelta64(nanoseconds, "ns")
    return AbsoluteStart(str(instant), "UTC", "property wf_start_time")


def _plain(properties: Mapping[str, Any]) -> dict[str, Any]:
    """Return properties as JSON types; time stamps as text."""
    plain: dict[str, Any] = {}
    for name, value in properties.items():
        own = value.item() if isinstance(value, np.generic) else value
        plain[name] = own if isinstance(own, (bool, int, float, str)) else str(own)
    return plain
