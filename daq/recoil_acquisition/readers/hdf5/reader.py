"""HDF5 files with one dataset per channel, as recorders and scripts export them.

No layout is standard. A channel is a dataset of real numbers along one axis. Its time is, in this
order: its own attributes (rate or step, start offset), its dimension scale, a time dataset in its
group of its length, the attributes of the groups above it. The fields of a dataset of records are datasets in a group
of its name. Which was used stands in the channel's
metadata under ``time``. Dewesoft's exports (group ``AI``, one dataset per channel) are of this kind.
External links, virtual datasets and references are not followed.

Layout of the container: The HDF Group, *HDF5 File Format Specification*; ``scale_factor``,
``add_offset`` and ``_FillValue``: NetCDF Users Guide, attribute conventions.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.containers.stored_channels import (
    container_recording,
    left_out_notes,
    note_on_starts,
    unused_time_note,
)
from recoil_acquisition.readers.containers.stored_time import StoredTime, selected
from recoil_acquisition.readers.hdf5 import attributes as attribute
from recoil_acquisition.readers.hdf5.attributes import find, find_start, plain_attributes
from recoil_acquisition.readers.hdf5.contents import Contents, Dataset, contents_of
from recoil_acquisition.readers.hdf5.dataset_time import UNIT_OF_TIMES, DatasetTimes
from recoil_acquisition.readers.hdf5.vector import Hdf5Vector, hdf5_file
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.statements import Statements
from recoil_acquisition.remark import Note, NoteCode, Remark

OWN_SCHEMA = "recoil-daq/"
TIME_REMEDY = (
    "give each dataset the attribute `sample_rate` (Hz), or put a dataset `time` (s) of its length into its group"
)


class Hdf5Reader:
    """Reader of HDF5 files with one dataset per channel."""

    name = "HDF5"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file; time vectors are read, samples are not.

        Raises
        ------
        ReadError
            If it is a shot file of this package, or states no time at all.
        CorruptFileError
            If it is damaged.
        """
        with hdf5_file(path) as file:
            schema = plain_attributes(file, ("schema",)).get("schema")
            if isinstance(schema, str) and schema.startswith(OWN_SCHEMA):
                raise ReadError(
                    f"this is a file of recoil-daq itself ({schema}), not a recording", path=path,
                    remedy="see it with `recoil-daq show`, or analyse it with `recoil-daq identify`",
                )  # fmt: skip
            return _recording(path, contents_of(path, file), declared.clock)


def _recording(path: Path, contents: Contents, clock: str) -> Recording:
    """Give each dataset its time; those without any are named and left out."""
    notes: list[Remark] = []
    left_out = dict(contents.left_out)
    times = DatasetTimes(contents, clock, notes)
    chosen: list[tuple[Dataset, StoredTime, str, frozenset[str], tuple[str, datetime] | None]] = []
    timeless = 0
    for data in contents.datasets:
        if data.vector.name in contents.time_names:
            continue
        time, source, dated_by = times.time_of(data)
        if isinstance(time, str):
            timeless += 1
            left_out[data.label] = time
            continue
        start = next((s for a in (data.own, *data.above) if (s := find_start(a)) is not None), None)
        since = time.time_base.absolute_start
        if start is None and since is not None and since.moment is not None:
            start = since.origin, since.moment
        chosen.append((data, time, source, dated_by, start))
    if timeless and not chosen:
        raise ReadError(
            "no time in this file",
            path=path,
            found="; ".join([*notes, *left_out_notes(left_out)][:4]),
            remedy=TIME_REMEDY,
        )
    notes += [unused_time_note(name.lstrip("/")) for name in sorted(contents.time_names - times.used)]
    first, offsets = _starts([start for *_, start in chosen], notes)
    channels, rows = [], {}
    for (data, time, source, dated_by, _), offset_s in zip(chosen, offsets, strict=True):
        if data.vector.name in times.columns:
            continue
        if offset_s is None:
            left_out[data.label] = "states no start, and the others differ in theirs"
            continue
        if dated_by:
            rows[data.label] = data.group
        channels.append(_channel(data, time, source, offset_s, first, dated_by, notes))
    metadata = {"attributes": contents.groups[""], "groups": {n: a for n, a in contents.groups.items() if n and a}}
    notes += left_out_notes(left_out)
    return container_recording(path, Hdf5Reader.name, channels, metadata, notes, "", first, left_out, rows=rows)


def _starts(
    starts: Sequence[tuple[str, datetime] | None], notes: list[Remark]
) -> tuple[AbsoluteStart | None, list[float | None]]:
    """Return the earliest absolute start and each channel's offset to it, None where its start is open."""
    stated = [s for s in starts if s is not None]
    zones = {s.utcoffset() is None for _, s in stated}
    differ = len(zones) > 1 or len({s for _, s in stated}) > 1
    if not stated or len(zones) > 1 or (len(stated) < len(starts) and not differ):
        if stated:
            text = "not every channel states an absolute start with or without a zone: none is used"
            notes.append(Note(NoteCode.TIME, None, text))
        return None, [0.0] * len(starts)
    name, earliest = min(stated, key=lambda s: s[1])
    offsets = [None if s is None else (s[1] - earliest).total_seconds() for s in starts]
    if any(offsets):
        notes.append(note_on_starts())
    return AbsoluteStart.at(earliest, name if name == UNIT_OF_TIMES else f"attribute {name}"), offsets


def _channel(
    data: Dataset,
    time: StoredTime,
    source: str,
    offset_s: float,
    start: AbsoluteStart | None,
    dated_by: frozenset[str],
    notes: list[Remark],
) -> StoredChannel:
    vector, base = data.vector, time.time_base
    scaling, lost = attribute.Scaling.of(data.own), attribute.lost_numbers(data.own)
    unit = find(data.own, attribute.UNIT)
    if unit is None:
        notes.append(Note(NoteCode.UNITS, data.label, f"{data.label}: no unit is stated"))
    gain, zero = scaling.gain, scaling.zero
    base = base.shifted(offset_s, start)
    text = str(unit.value) if unit else ""
    header = SignalHeader(data.label, text, base.count, metadata={"time": source, "attributes": dict(data.own)})
    missing = np.unique([number for numbers in lost.values() for number in numbers])
    is_counted = vector.dtype.kind in "iu"
    raw = partial(_raw, vector, time.kept, gain, zero, text) if is_counted and not missing.size else None
    said = {name: value for level in (*reversed(data.above), data.own) for name, value in level.items()}
    used = {*scaling.used, *lost, *dated_by, *([unit.name] if unit else [])}
    samples = partial(_samples, vector, time.kept, gain, zero, missing)
    return StoredChannel(header, base, samples, raw, beside=Statements(said, used, is_counted))


def _samples(
    vector: Hdf5Vector,
    kept: NDArray[np.int64] | None,
    gain: float,
    zero: float,
    lost: NDArray[np.float64],
    start: int,
    stop: int,
) -> NDArray[np.float64]:
    stored = selected(kept, vector.stored, start, stop).astype(np.float64)
    values = gain * stored + zero
    if lost.size:
        values[np.isin(stored, lost)] = np.nan
    return values


def _raw(
    vector: Hdf5Vector, kept: NDArray[np.int64] | None, gain: float, zero: float, unit: str, start: int, stop: int
) -> RawCounts:
    return RawCounts(selected(kept, vector.stored, start, stop), gain, zero, unit)
