"""The time channels of a group of a TDMS file: numbers in a unit of time, or time stamps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.readers.containers.stored_time import StoredTime, time_from_stamps, time_from_vector
from recoil_acquisition.readers.tdms.channel import MayBeTime, TdmsChannel
from recoil_acquisition.readers.tdms.history import TdmsStamp
from recoil_acquisition.readers.tdms.waveform import TdmsTime
from recoil_acquisition.readers.text.cells import split_unit
from recoil_acquisition.readers.time.time_units import time_unit_s
from recoil_acquisition.remark import Note, NoteCode, Remark

TIME_NAMES = ("time", "t", "zeit", "temps")
"""Names of time channels; a unit in brackets, or behind a low line, may follow."""
STAMP_RESOLUTION_S = 2.0**-21
"""Resolution of time stamps that were floats of this century's seconds since 1904 once, s."""


class GroupTimes:
    """The times of a group; each channel of times is read once, time stamps when they are asked for.

    Parameters
    ----------
    clock
        Name of the source.
    notes
        List that notes on the times that are read are added to.
    """

    def __init__(self, path: Path, clock: str, notes: list[Remark]) -> None:
        self._path, self._clock, self._notes = path, clock, notes
        self._numbers: dict[str, StoredTime | str] = {}
        self._stamps: dict[str, Any] = {}
        self._read: dict[str, TdmsTime | str] = {}

    @property
    def used(self) -> frozenset[str]:
        """Labels of the channels of time stamps that were read."""
        return frozenset(self._read)

    def take(self, channel: Any, label: str, reason: str) -> bool:
        """Take a channel if it is a time; return whether it is one of numbers or texts, which is no signal.

        Parameters
        ----------
        channel
            Channel of npTDMS.
        reason
            Reason why it is no channel of numbers; empty if it is one.
        """
        if reason is MayBeTime.TIME_STAMPS:
            self._stamps[label] = channel
            return False
        plain, bracketed = _split(channel.name)
        is_text = reason is MayBeTime.TEXTS
        if "wf_increment" in channel.properties or plain not in TIME_NAMES or (reason and not is_text):
            return False
        if is_text:
            self._numbers[label] = f"the time channel {label} holds texts, not numbers or time stamps"
            return True
        stated = str(channel.properties.get("unit_string", "")).strip()
        units = [unit for unit in (stated, bracketed) if unit]
        factors = {time_unit_s(unit) for unit in units}
        if foreign := next((unit for unit in units if time_unit_s(unit) is None), ""):
            self._numbers[label] = f"the unit {foreign!r} of the time channel {label} is no unit of time"
        elif len(factors) > 1:
            self._numbers[label] = f"the time channel {label} states its unit as {' and as '.join(units)}"
        else:
            if not units:
                text = f"{label}: no unit is stated: read as seconds"
                self._notes.append(Note(NoteCode.TIME, label, text))
            values = TdmsChannel(self._path, channel.group_name, channel.name).read(0, len(channel))
            factor = factors.pop() if factors else 1.0
            self._numbers[label] = time_from_vector(self._clock, values, factor or 1.0, label, self._notes)
        return True

    def time_of(self, count: int) -> TdmsTime | str:
        """Return the one time of so many samples, or why there is none: numbers first, then time stamps."""
        fitting = [time for time in self._numbers.values() if not isinstance(time, str) and time.stamp_count == count]
        if len(fitting) == 1:
            return TdmsTime(fitting[0], None)
        if fitting:
            return f"{len(fitting)} time channels have its length"
        stamps = {label: channel for label, channel in self._stamps.items() if len(channel) == count}
        if len(stamps) > 1:
            return f"{len(stamps)} channels of time stamps have its length"
        for label, channel in stamps.items():
            if label not in self._read:
                self._read[label] = self._read_stamps(channel, label)
            return self._read[label]
        faulty = [time for time in self._numbers.values() if isinstance(time, str)]
        return faulty[0] if faulty else "no waveform properties, and no time channel of its length"

    def _read_stamps(self, channel: Any, label: str) -> TdmsTime | str:
        stamps = channel.read_data()
        seconds, fractions = stamps["seconds"], stamps["second_fractions"]
        first = TdmsStamp(int(seconds[0]), int(fractions[0]))
        with np.errstate(over="ignore"):
            times_s = (seconds - seconds[0]).astype(np.float64) + (
                fractions.astype(np.float64) - float(first.second_fractions)
            ) * 2.0**-64
        try:
            time = time_from_stamps(self._clock, times_s, STAMP_RESOLUTION_S)
        except ValueError as error:
            return f"{label}: {error}"
        if time.note:
            self._notes.append(Note(NoteCode.TIME, label, f"{label}: {time.note}"))
        return TdmsTime(time, first)


def _split(name: str) -> tuple[str, str]:
    """Split a channel's name in small letters from the unit in brackets, or behind a low line, that follows it."""
    plain, unit = split_unit(name)
    stem, _, ending = plain.rpartition("_")
    if not unit and stem and time_unit_s(ending) is not None:
        plain, unit = stem, ending
    return plain.strip().casefold(), unit
