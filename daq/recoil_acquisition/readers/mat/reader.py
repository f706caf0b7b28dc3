"""MATLAB files: one vector per channel, with a time vector or a rate.

MATLAB's variables have no units, and Dewesoft's export replaces every sign of a name but letters and
digits by ``_``. Time vectors hold seconds, serial date numbers (days), which resolve 10 us, or what a unit behind their
name (``time_ms``) or beside it (``time_unit = 'ms'``) says; a rate is in Hz unless such a unit says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.containers.stored_channels import container_recording, left_out_notes
from recoil_acquisition.readers.containers.stored_time import (
    StoredTime,
    resolution_of,
    selected,
    time_from_datenum,
    time_from_stamps,
)
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.mat.time_vector import is_plain_time, is_time, one_step, time_of, unit_of_time
from recoil_acquisition.readers.mat.v4 import is_mat_v4, read_mat_v4
from recoil_acquisition.readers.mat.v5 import is_mat_v5, read_mat_v5
from recoil_acquisition.readers.mat.v73 import read_mat_v73
from recoil_acquisition.readers.mat.variable import MatContents, MatVariable
from recoil_acquisition.readers.reader import Declarations, SignalHeader
from recoil_acquisition.readers.recording import Recording, StoredChannel, map_to_corrupt_file
from recoil_acquisition.timebase import AbsoluteStart, TimeBase

HEAD_BYTES = 128
HEAD_V73 = b"MATLAB 7.3 MAT-file"
DATENUMS = (693962.0, 767011.0)
"""Serial date numbers of the years 1900 and 2100; as seconds they would be more than eight days."""
SAME_STEP = 0.01
"""Share by which the step of a file's one time vector may differ from the one that is stated."""
NO_VECTORS = "save each channel, and the time, as a vector of its own"
NO_UNITS = "MATLAB variables have no units: the rig must state them"


class MatReader:
    """Reader of MATLAB files of version 4 to 7.3."""

    name = "MATLAB"

    def claims(self, head: Head) -> Claim:
        """Say how sure it is: versions from 5 on say so themselves, of version 4 the first variable must be sound."""
        if head.content.startswith(HEAD_V73) or is_mat_v5(head.content):
            return Claim.CERTAIN
        try:
            size = head.path.stat().st_size
        except OSError:
            size = len(head.content)
        return Claim.CERTAIN if is_mat_v4(head.content, size) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file; time vectors are read, samples are not.

        Raises
        ------
        ReadError
            If it has no time, or no vectors.
        CorruptFileError
            If it is damaged.
        """
        with map_to_corrupt_file(path, "a MATLAB file"):
            with path.open("rb") as file:
                head = file.read(HEAD_BYTES)
            if head.startswith(HEAD_V73):
                contents = read_mat_v73(path)
            elif is_mat_v4(head, path.stat().st_size):
                contents = read_mat_v4(path)
            else:
                contents = read_mat_v5(path)
            return _recording(path, contents, declared.clock)


def _recording(path: Path, contents: MatContents, clock: str) -> Recording:
    notes = [*([contents.incomplete] if contents.incomplete else [])]
    left_out = dict(contents.left_out)
    names = [v.name for v in contents.vectors]
    times = [v for v in contents.vectors if is_time(v.name, names)]
    step = one_step(contents.scalars, contents.texts)
    read: dict[str, StoredTime | str] = {}
    channels: list[StoredChannel] = []
    seen: set[str] = set()
    starts: set[AbsoluteStart | None] = set()
    timeless = 0
    for vector in contents.vectors:
        if vector in times:
            continue
        if vector.name in seen:
            notes.append(f"{vector.name}: stored twice: the later one is left out")
            continue
        seen.add(vector.name)
        chosen = time_of(vector, times)
        if isinstance(chosen, MatVariable):
            if chosen.name not in read:
                read[chosen.name] = _read_time(chosen, clock, step, contents.texts, notes)
            time, source = read[chosen.name], f"variable {chosen.name}"
        elif chosen is None and isinstance(step, str) and not times:
            time, source = step, ""
        elif chosen is None and step is not None and not isinstance(step, str) and not times:
            base = TimeBase.uniform(clock, 0.0, step[1], vector.count)
            time, source = StoredTime(base, None, ""), f"variable {step[0]}"
        else:
            time, source = chosen or "no time vector has its length", ""
        if isinstance(time, str):
            left_out[vector.name] = time
            timeless += 1
            continue
        starts.add(time.time_base.absolute_start)
        header = SignalHeader(vector.name, "", time.time_base.count, metadata={"time": source})
        raw = partial(_raw, vector, time.kept) if vector.dtype.kind in "iu" else None
        channels.append(StoredChannel(header, time.time_base, partial(_samples, vector, time.kept), raw))
    notes += [f"{t.name}: a time that no channel was given: left out" for t in times if t.name not in read]
    if timeless and not channels:
        raise ReadError(
            "no time in this file", path=path, found="; ".join([*notes, *left_out_notes(left_out)][:4]),
            remedy="add a vector `time` (s) as long as the channels, or a scalar `Sample_rate` (Hz)",
        )  # fmt: skip
    metadata: dict[str, Any] = {
        "version": contents.version,
        "header": contents.header,
        "scalars": {name: value for name, value in contents.scalars.items() if np.isfinite(value)},
        "texts": contents.texts,
    }
    start = starts.pop() if len(starts) == 1 else None
    if len(starts) > 1:
        notes.append("time vectors with date numbers start at different instants: compare no channels across them")
    notes = [*([NO_UNITS] if channels else []), *notes, *left_out_notes(left_out)]
    return container_recording(
        path, MatReader.name, channels, metadata, notes, contents.incomplete, start, left_out, NO_VECTORS
    )


def _read_time(
    time: MatVariable, clock: str, step: tuple[str, float] | str | None, texts: Mapping[str, str], notes: list[str]
) -> StoredTime | str:
    """Read a time vector, in the unit that is stated, seconds or date numbers."""
    unit_s = unit_of_time(time.name, texts)
    if isinstance(unit_s, str):
        return unit_s
    values = time.read(0, time.count)
    exact = values.astype(np.float64, copy=False)
    one = step if isinstance(step, tuple) else None
    try:
        if unit_s is not None:
            stored = time_from_stamps(clock, exact * unit_s, resolution_of(values) * unit_s)
        elif _is_datenum(exact, one):
            stored = time_from_datenum(clock, exact, f"variable {time.name}")
            notes.append(f"{time.name}: serial date numbers (days), without a zone; time zero is the first of them")
        else:
            stored = time_from_stamps(clock, exact, resolution_of(values))
            notes.append(f"{time.name}: states no unit: read as seconds")
        if isinstance(step, str) and is_plain_time(time.name):
            return step
        step_s = stored.time_base.step_s
        if one and step_s and is_plain_time(time.name) and abs(step_s / one[1] - 1) > SAME_STEP:
            return (
                f"{time.name} steps by {step_s:g} s, {one[0]} says {one[1]:g} s: state the unit, "
                f"{time.name}_unit = 'ms', say"
            )
    except ValueError as error:
        return f"{time.name}: {error}"
    if stored.note:
        notes.append(f"{time.name}: {stored.note}")
    return stored


def _is_datenum(values: NDArray[np.float64], step: tuple[str, float] | None) -> bool:
    """Return whether a time vector holds days: all within two centuries of date numbers, and steps that fit."""
    if not (values.size and DATENUMS[0] < values[0] < DATENUMS[1] and DATENUMS[0] < values[-1] < DATENUMS[1]):
        return False
    if step is None or values.size < 2:
        return True
    mean = float(values[-1] - values[0]) / (values.size - 1)
    # A stated rate decides: the mean step is nearer to it in days than in seconds
    return not 0.1 < mean / step[1] < 10.0


def _samples(vector: MatVariable, kept: NDArray[np.int64] | None, start: int, stop: int) -> NDArray[np.float64]:
    return selected(kept, vector.read, start, stop).astype(np.float64, copy=False)


def _raw(vector: MatVariable, kept: NDArray[np.int64] | None, start: int, stop: int) -> RawCounts:
    return RawCounts(selected(kept, vector.read, start, stop), 1.0, 0.0, "")
