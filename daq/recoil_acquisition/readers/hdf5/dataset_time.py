"""The time of each dataset of an HDF5 file: its attributes, its scale, a dataset of times, or the groups above it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from recoil_acquisition.readers.containers.stored_time import StoredTime, time_from_vector
from recoil_acquisition.readers.hdf5 import attributes as attribute
from recoil_acquisition.readers.hdf5.attributes import find, find_number
from recoil_acquisition.readers.hdf5.contents import Contents, Dataset
from recoil_acquisition.readers.time.time_units import TIME_UNITS_S
from recoil_acquisition.timebase import TimeBase


class DatasetTimes:
    """The times of a file's datasets; each dataset of times is read once.

    Parameters
    ----------
    clock
        Name of the source.
    notes
        Gets notes on the times that are read.
    """

    def __init__(self, contents: Contents, clock: str, notes: list[str]) -> None:
        self._clock, self._notes = clock, notes
        self._datasets = [d for d in contents.datasets if d.vector.name in contents.time_names]
        self._read: dict[str, StoredTime | str] = {}

    def time_of(self, data: Dataset) -> tuple[StoredTime | str, str]:
        """Return the time of a dataset, or why it has none; and where the time is from."""
        uniform = self._uniform(data, data.own)
        if uniform is not None:
            return uniform
        if data.scale:
            candidates = [d for d in self._datasets if d.vector.name == data.scale]
        else:
            candidates = [d for d in self._datasets if d.group == data.group]
        fitting = [d for d in candidates if d.vector.count == data.vector.count]
        if len(fitting) > 1:
            return f"{len(fitting)} time datasets have its length ({', '.join(d.label for d in fitting)})", ""
        if fitting:
            return self._stamps(fitting[0]), f"dataset {fitting[0].label}"
        for above in data.above:
            uniform = self._uniform(data, above)
            if uniform is not None:
                return uniform
        return "neither a rate, nor a time dataset of its length", ""

    def _uniform(self, data: Dataset, attributes: Mapping[str, Any]) -> tuple[StoredTime | str, str] | None:
        rate, step = find_number(attributes, attribute.RATE_HZ), find_number(attributes, attribute.STEP_S)
        used = rate or step
        if used is None:
            return None
        if not used.value > 0:
            return f"its {used.name} is {used.value:g}", ""
        step_s = 1.0 / used.value if rate else used.value
        if rate and step and abs(rate.value * step.value - 1) > 1e-6:
            return f"{rate.name} {rate.value:g} contradicts {step.name} {step.value:g}", ""
        offset = find_number(data.own, attribute.OFFSET_S) or find_number(attributes, attribute.OFFSET_S)
        try:
            base = TimeBase.uniform(self._clock, offset.value if offset else 0.0, step_s, data.vector.count)
        except ValueError as error:
            return str(error), ""
        source = f"attribute {used.name}" + (f" and {offset.name}" if offset else "")
        return StoredTime(base, None, ""), source

    def _stamps(self, time: Dataset) -> StoredTime | str:
        if time.vector.name not in self._read:
            self._read[time.vector.name] = self._read_stamps(time)
        return self._read[time.vector.name]

    def _read_stamps(self, time: Dataset) -> StoredTime | str:
        own = attribute.folded(time.vector.name.rpartition("/")[2])
        unit = find(time.own, attribute.UNIT)
        ending = next((u for u in ("ms", "us") if own.endswith(u) and own != "times"), "")
        text = str(unit.value).strip() if unit else ending
        if text and text not in TIME_UNITS_S:
            return f"the unit {text!r} of {time.label} is no unit of time"
        if not text:
            self._notes.append(f"{time.label}: no unit is stated: read as seconds")
        factor = TIME_UNITS_S.get(text, 1.0)
        return time_from_vector(self._clock, time.vector.stored(), factor, time.label, self._notes)
