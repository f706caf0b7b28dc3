"""The time of each dataset of an HDF5 file: its attributes, its scale, a dataset of times, or the groups above it."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.readers.containers.stored_time import StoredTime, rising_column, time_from_vector
from recoil_acquisition.readers.containers.time_axis import (
    OFFSETS,
    Stated,
    one_unit,
    stated_rate,
    stated_step,
    unit_in_time_name,
)
from recoil_acquisition.readers.hdf5 import attributes as attribute
from recoil_acquisition.readers.hdf5.attributes import find
from recoil_acquisition.readers.hdf5.contents import Contents, Dataset
from recoil_acquisition.readers.statements import Statements
from recoil_acquisition.remark import Note, NoteCode, Remark

UNIT_OF_TIMES = "unit of the times"
"""Origin of a start that stands in a unit, as in CF."""
_NONE: frozenset[str] = frozenset()
SAME_STEP = 0.01
"""Share by which the step of a vector of times may differ from the one that is stated beside it."""


class DatasetTimes:
    """The times of a file's datasets; each dataset of times is read once.

    Parameters
    ----------
    clock
        Name of the source.
    notes
        List that notes on the times that are read are added to.

    Attributes
    ----------
    used
        Full names of the datasets of times by which others were dated.
    columns
        Full names of the columns by which the others of their matrices were dated.
    """

    def __init__(self, contents: Contents, clock: str, notes: list[Remark]) -> None:
        self._clock, self._notes = clock, notes
        self._datasets = [d for d in contents.datasets if d.vector.name in contents.time_names]
        self._read: dict[str, StoredTime | str] = {}
        self._all, self._columns = contents.datasets, dict[str, Dataset | str]()
        self.used: set[str] = set()
        self.columns: set[str] = set()

    def time_of(self, data: Dataset) -> tuple[StoredTime | str, str, frozenset[str]]:
        """Return the time of a dataset, or why it has none; where the time is from, and by which attributes."""
        uniform = self._uniform(data, data.own)
        if uniform is not None:
            return uniform
        if data.scale:
            candidates = [d for d in self._datasets if d.vector.name == data.scale]
        else:
            groups = {data.group} if data.vector.column is None else {data.group.rpartition("/")[0]}
            candidates = [d for d in self._datasets if d.group in groups]
        fitting = [d for d in candidates if d.vector.count == data.vector.count]
        if len(fitting) > 1:
            return f"{len(fitting)} time datasets have its length ({', '.join(d.label for d in fitting)})", "", _NONE
        if fitting:
            time = self._stamps(fitting[0])
            if not isinstance(time, str):
                if reason := self._contradiction(data, time, fitting[0].label):
                    return reason, "", _NONE
                self.used.add(fitting[0].vector.name)
            return time, f"dataset {fitting[0].label}", _NONE
        for above in data.above:
            uniform = self._uniform(data, above)
            if uniform is not None:
                return uniform
        if data.vector.column is not None:
            return self._by_column(data)
        return "neither a rate, nor a time dataset of its length", "", _NONE

    def _by_column(self, data: Dataset) -> tuple[StoredTime | str, str, frozenset[str]]:
        """Date a column of a matrix by the one of it that is a time."""
        if data.group not in self._columns:
            own = [d for d in self._all if d.group == data.group]
            found, reason = rising_column({d.vector.name: d.vector.stored for d in own})
            self._columns[data.group] = next((d for d in own if d.vector.name == found), None) or reason
        chosen = self._columns[data.group]
        if isinstance(chosen, str):
            return chosen, "", _NONE
        self.columns.add(chosen.vector.name)
        return self._stamps(chosen), f"column {chosen.label}", _NONE

    def _uniform(
        self, data: Dataset, attributes: Mapping[str, Any]
    ) -> tuple[StoredTime | str, str, frozenset[str]] | None:
        rate, step = stated_rate(attributes), stated_step(attributes)
        first = rate or step
        for stated in (rate, step):
            if isinstance(stated, str):
                return stated, "", _NONE
        if not isinstance(first, Stated):
            return None
        if not first.value > 0:
            return f"its {first.name} is {first.value:g}", "", _NONE
        step_s = 1.0 / first.value if rate else first.value
        if isinstance(rate, Stated) and isinstance(step, Stated) and abs(rate.value * step.value - 1) > 1e-6:
            return f"{rate.name} {rate.value:g} contradicts {step.name} {step.value:g}", "", _NONE
        offset = stated_step(data.own, OFFSETS) or stated_step(attributes, OFFSETS)
        if isinstance(offset, str):
            return offset, "", _NONE
        try:
            base = TimeBase.uniform(self._clock, offset.value if offset else 0.0, step_s, data.vector.count)
        except ValueError as error:
            return str(error), "", _NONE
        source = f"attribute {first.name}" + (f" and {offset.name}" if offset else "")
        used = frozenset(one.name for one in (rate, step, offset) if isinstance(one, Stated))
        return StoredTime(base, None, ""), source, used

    def _contradiction(self, data: Dataset, time: StoredTime, label: str) -> str:
        """Say that a group's rate is not that of a dataset of times in it; empty if it is, or either is not even."""
        stated = next((found for above in data.above[:1] if (found := self._uniform(data, above))), None)
        if stated is None or isinstance(stated[0], str):
            return ""
        step_s, stated_s = time.time_base.step_s, stated[0].time_base.step_s
        if step_s is None or stated_s is None or abs(step_s / stated_s - 1) < SAME_STEP:
            return ""
        return f"{label} steps by {step_s:g} s, {stated[1]} says {stated_s:g} s: state the unit of {label}"

    def _stamps(self, time: Dataset) -> StoredTime | str:
        if time.vector.name not in self._read:
            self._read[time.vector.name] = self._read_stamps(time)
        return self._read[time.vector.name]

    def _read_stamps(self, time: Dataset) -> StoredTime | str:
        unit = find(time.own, attribute.UNIT)
        written, start = _since(str(unit.value).strip() if unit else "")
        stated = [written, unit_in_time_name(time.vector.name.rpartition("/")[2]) or ""]
        factor = one_unit(time.label, stated)
        if isinstance(factor, str):
            return factor
        if factor is None:
            text = f"{time.label}: no unit is stated: read as seconds"
            self._notes.append(Note(NoteCode.TIME, time.label, text))
        scaling, stored = attribute.Scaling.of(time.own), time.vector.stored()
        if doubtful := Statements(time.own, scaling.used).scaling:
            return f"{time.label} has the attribute {doubtful}, whose meaning is open"
        if scaling.zero and scaling.gain:
            stored = stored + scaling.zero / scaling.gain
        found = time_from_vector(self._clock, stored, scaling.gain * (factor or 1.0), time.label, self._notes)
        if isinstance(found, str) or start is None:
            return found
        return replace(found, time_base=found.time_base.shifted(0.0, start))


def _since(unit: str) -> tuple[str, AbsoluteStart | None]:
    """Return the unit of ``milliseconds since 2026-08-03 12:23:05``, as CF has it, and the instant of its zero."""
    spelled, word, since = unit.partition(" since ")
    if not word:
        return unit, None
    try:
        start = dt.datetime.fromisoformat(since.strip())
    except ValueError:
        return unit, None
    return spelled.strip(), AbsoluteStart.at(start, UNIT_OF_TIMES)
