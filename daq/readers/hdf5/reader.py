"""HDF5 files with one dataset per channel, as recorders and scripts export them.

No layout is standard. A channel is a dataset of real numbers along one axis. Its time is, in this
order: its own attributes (rate or step, start offset), its dimension scale, a time dataset in its
group of its length, the attributes of the groups above it. Which was used stands in the channel's
metadata under ``time``. Dewesoft's exports (group ``AI``, one dataset per channel) are of this kind.
External links, virtual datasets and references are not followed.

Layout of the container: The HDF Group, *HDF5 File Format Specification*; ``scale_factor``,
``add_offset`` and ``_FillValue``: NetCDF Users Guide, attribute conventions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.channel import RawCounts
from daq.errors import ReadError
from daq.readers.containers.stored_channels import StoredChannel, StoredRecording
from daq.readers.containers.stored_time import StoredTime, resolution_of, time_from_stamps
from daq.readers.hdf5 import attributes as attribute
from daq.readers.hdf5.attributes import find, find_number, find_start, is_time_name, plain_attributes
from daq.readers.hdf5.kind import is_sleap_file, shows_tracks
from daq.readers.hdf5.vector import Hdf5Vector, hdf5_file, vector_of
from daq.readers.reader import Declarations, SignalHeader
from daq.timebase import AbsoluteStart, TimeBase

SIGNATURE = b"\x89HDF\r\n\x1a\n"
MATLAB = b"MATLAB 7.3 MAT-file"
OWN_SCHEMA = "recoil-daq/"
MOST_OBJECTS = 20000
TIME_REMEDY = (
    "give each dataset the attribute `sample_rate` (Hz), or put a dataset `time` (s) of its length into its group"
)


def is_hdf5(head: bytes) -> bool:
    """Tell whether a file is HDF5 and not one of MATLAB's: the signature may stand behind a user block."""
    return not head.startswith(MATLAB) and any(
        head[at : at + 8] == SIGNATURE for at in (0, *(512 << i for i in range(7)))
    )


class Hdf5Reader:
    """Reader of HDF5 files with one dataset per channel."""

    name = "HDF5"
    kind = "dewetron"
    suffixes = (".h5", ".hdf5")

    def claims(self, head: bytes) -> bool:
        """Tell whether the file has HDF5's signature, is not MATLAB's, and does not name a camera's tracks."""
        return is_hdf5(head) and not shows_tracks(head)

    def confirms(self, path: Path) -> bool:
        """Tell by all of its names whether a file holds something else than a camera's tracks."""
        return not is_sleap_file(path)

    def open(self, path: Path, declared: Declarations) -> StoredRecording:
        """Open a file; time vectors are read, samples are not.

        Raises
        ------
        ReadError
            If it is a shot file of this package, or states no time at all.
        CorruptFileError
            If it is damaged.
        """
        with hdf5_file(path) as file:
            schema = file.attrs.get("schema")
            if isinstance(schema, str) and schema.startswith(OWN_SCHEMA):
                raise ReadError(
                    f"this is a file of recoil-daq itself ({schema}), not a recording", path=path,
                    remedy="see it with `recoil-daq show`, or analyse it with `recoil-daq identify`",
                )  # fmt: skip
            contents = _Contents(path, file, declared.clock)
            return contents.recording()


@dataclass(frozen=True, eq=False)
class _Dataset:
    """A dataset of numbers, with what its attributes and those above say."""

    vector: Hdf5Vector
    own: Mapping[str, Any]
    above: Sequence[Mapping[str, Any]]
    scale: str | None

    @property
    def group(self) -> str:
        return self.vector.name.rpartition("/")[0]

    @property
    def label(self) -> str:
        return self.vector.name.lstrip("/")


class _Contents:
    """What an open file holds."""

    def __init__(self, path: Path, file: Any, clock: str) -> None:
        self.path, self.clock = path, clock
        self.notes: list[str] = []
        self.root = plain_attributes(file)
        self.groups: dict[str, dict[str, Any]] = {"": self.root}
        self.datasets: list[_Dataset] = []
        self._times: dict[str, StoredTime | str] = {}
        found: list[tuple[str, Any]] = []

        def visit(name: str, item: Any) -> bool | None:
            found.append((name, item))
            return True if len(found) > MOST_OBJECTS else None

        if file.visititems(visit):
            raise ReadError(f"more than {MOST_OBJECTS} groups and datasets", path=path, remedy="export channels alone")
        size = path.stat().st_size
        for name, item in found:
            if not hasattr(item, "dtype"):
                self.groups["/" + name] = plain_attributes(item)
        for name, item in found:
            # A committed datatype has a dtype, too, but no shape
            if hasattr(item, "dtype") and hasattr(item, "shape"):
                self._add(name, item, size)
        self.time_names = {d.vector.name for d in self.datasets if is_time_name(d.vector.name.rpartition("/")[2])}
        self.time_names |= {d.scale for d in self.datasets if d.scale}

    def _add(self, name: str, item: Any, size: int) -> None:
        vector = vector_of(self.path, item, size)
        if isinstance(vector, str):
            self.notes.append(f"{name}: {vector}: left out")
            return
        scales = [s.name for s in item.dims[vector.axis].values() if s.name] if len(item.dims) else []
        parts = vector.name.split("/")[:-1]
        above = [self.groups.get("/".join(parts[:n]), {}) for n in range(len(parts), 0, -1)]
        scale = scales[0] if scales and scales[0] != vector.name else None
        self.datasets.append(_Dataset(vector, plain_attributes(item), above, scale))

    def recording(self) -> StoredRecording:
        """Give each dataset its time; those without any are named and left out."""
        chosen: list[tuple[_Dataset, StoredTime, str, tuple[str, datetime] | None]] = []
        timeless = 0
        for data in self.datasets:
            if data.vector.name in self.time_names:
                continue
            time, source = self._time(data)
            if isinstance(time, str):
                timeless += 1
                self.notes.append(f"{data.label}: {time}: left out")
                continue
            start = next((s for a in (data.own, *data.above) if (s := find_start(a)) is not None), None)
            chosen.append((data, time, source, start))
        if timeless and not chosen:
            raise ReadError("no time in this file", path=self.path, found="; ".join(self.notes[:4]), remedy=TIME_REMEDY)
        unused = self.time_names - {f"/{source.removeprefix('dataset ')}" for _, _, source, _ in chosen}
        self.notes += [f"{name.lstrip('/')}: a time that no channel was given: left out" for name in sorted(unused)]
        first, offsets = self._starts([start for *_, start in chosen])
        channels = []
        for (data, time, source, _), offset_s in zip(chosen, offsets, strict=True):
            channel = self._channel(data, time, source, offset_s, first)
            if channel is not None:
                channels.append(channel)
        metadata = {"attributes": self.root, "groups": {n: a for n, a in self.groups.items() if n and a}}
        return StoredRecording(self.path, Hdf5Reader.name, channels, metadata, self.notes, "", first)

    def _starts(self, starts: Sequence[tuple[str, datetime] | None]) -> tuple[AbsoluteStart | None, list[float]]:
        """Return the earliest absolute start and each channel's offset to it."""
        stated = [s for s in starts if s is not None]
        zones = {s.utcoffset() is None for _, s in stated}
        if not stated or len(zones) > 1 or len(stated) < len(starts):
            if stated:
                self.notes.append("not every channel states an absolute start with or without a zone: none is used")
            return None, [0.0] * len(starts)
        name, earliest = min(stated, key=lambda s: s[1])
        offsets = [(s - earliest).total_seconds() for _, s in stated]
        if any(offsets):
            self.notes.append("channels start at different absolute times: their differences are in their time")
        offset = earliest.utcoffset()
        zone = "unknown" if offset is None else ("UTC" if not offset else earliest.isoformat()[-6:])
        text = earliest.replace(tzinfo=None).isoformat()
        return AbsoluteStart(text, zone, f"attribute {name}"), offsets

    def _time(self, data: _Dataset) -> tuple[StoredTime | str, str]:
        uniform = self._uniform(data, data.own)
        if uniform is not None:
            return uniform
        candidates = [d for d in self.datasets if d.vector.name in self.time_names]
        if data.scale:
            candidates = [d for d in candidates if d.vector.name == data.scale]
        else:
            candidates = [d for d in candidates if d.group == data.group]
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

    def _uniform(self, data: _Dataset, attributes: Mapping[str, Any]) -> tuple[StoredTime | str, str] | None:
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
            base = TimeBase.uniform(self.clock, offset.value if offset else 0.0, step_s, data.vector.count)
        except ValueError as error:
            return str(error), ""
        source = f"attribute {used.name}" + (f" and {offset.name}" if offset else "")
        return StoredTime(base, None, ""), source

    def _stamps(self, time: _Dataset) -> StoredTime | str:
        if time.vector.name not in self._times:
            self._times[time.vector.name] = self._read_stamps(time)
        return self._times[time.vector.name]

    def _read_stamps(self, time: _Dataset) -> StoredTime | str:
        own = attribute.folded(time.vector.name.rpartition("/")[2])
        unit = find(time.own, attribute.UNIT)
        ending = next((u for u in ("ms", "us") if own.endswith(u) and own != "times"), "")
        text = str(unit.value).strip() if unit else ending
        if text and text not in attribute.TIME_UNITS_S:
            return f"the unit {text!r} of {time.label} is no unit of time"
        if not text:
            self.notes.append(f"{time.label}: no unit is stated: read as seconds")
        factor = attribute.TIME_UNITS_S.get(text, 1.0)
        values = time.vector.stored()
        try:
            stored = time_from_stamps(self.clock, values.astype(np.float64) * factor, resolution_of(values) * factor)
        except ValueError as error:
            return f"{time.label}: {error}"
        if stored.note:
            self.notes.append(f"{time.label}: {stored.note}")
        return stored

    def _channel(
        self, data: _Dataset, time: StoredTime, source: str, offset_s: float, start: AbsoluteStart | None
    ) -> StoredChannel | None:
        vector, base = data.vector, time.time_base
        other = find(data.own, attribute.OTHER_SCALING)
        if other is not None and vector.dtype.kind in "iu":
            self.notes.append(
                f"{data.label}: integers with the attribute {other.name}, whose meaning is open: left out"
            )
            return None
        if other is not None:
            self.notes.append(f"{data.label}: the attribute {other.name} = {other.value} is not applied")
        scale, shift = find_number(data.own, attribute.SCALE), find_number(data.own, attribute.SHIFT)
        lost = find_number(data.own, attribute.LOST)
        unit = find(data.own, attribute.UNIT)
        if unit is None:
            self.notes.append(f"{data.label}: no unit is stated")
        gain, zero = scale.value if scale else 1.0, shift.value if shift else 0.0
        if base.step_s is None:
            base = TimeBase.stamped(self.clock, base.times_s + offset_s, start)
        else:
            base = TimeBase.uniform(self.clock, base.start_s + offset_s, base.step_s, base.count, start)
        text = str(unit.value) if unit else ""
        header = SignalHeader(data.label, text, base.count, metadata={"time": source, "attributes": dict(data.own)})
        missing = lost.value if lost else None
        samples = partial(_samples, vector, time.kept, gain, zero, missing)
        raw = partial(_raw, vector, time.kept, gain, zero, text)
        if vector.dtype.kind in "iu" and missing is None:
            return StoredChannel(header, base, samples, raw)
        return StoredChannel(header, base, samples)


def _samples(
    vector: Hdf5Vector,
    kept: NDArray[np.int64] | None,
    gain: float,
    zero: float,
    lost: float | None,
    start: int,
    stop: int,
) -> NDArray[np.float64]:
    stored = vector.samples(start, stop) if kept is None else vector.samples()[kept[start:stop]]
    values = gain * stored + zero
    if lost is not None:
        values[stored == lost] = np.nan
    return values


def _raw(
    vector: Hdf5Vector, kept: NDArray[np.int64] | None, gain: float, zero: float, unit: str, start: int, stop: int
) -> RawCounts:
    stored = vector.stored(start, stop) if kept is None else vector.stored()[kept[start:stop]]
    return RawCounts(stored, gain, zero, unit)
