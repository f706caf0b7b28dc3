"""MATLAB files: one vector or one column of a matrix per channel, with a time vector or a rate.

MATLAB's variables have no units, and Dewesoft's export replaces every sign of a name but letters and
digits by ``_``. Time vectors hold seconds, serial date numbers (days), which resolve 10 us, or what a unit behind their
name (``time_ms``) or beside it (``time_unit = 'ms'``) says; a rate is in Hz unless such a unit says otherwise.

Time vectors belong to variables by name and length. Dewesoft names channels ``Data1_AI_1`` and times
``Data1_time_AI_1`` or ``Data1_time``: channels of another rate have a time of their own. Other exports put ``_TIME``
behind the channel's name, and scripts have one ``time`` or ``t``. A name decides first, then the length; where two time
vectors would do, none is taken. Fields of a structure are named behind it (``S.acc``) and have the time that is in it,
else one outside. A matrix without either has a column that rises for its time, and ``X.column_1`` is its first one.

Files of version 7.3 are HDF5 behind a block of text. Layout: MathWorks' ``save -v7.3``: each variable is a dataset of
the root with the attribute ``MATLAB_class``, axes in MATLAB's order reversed; texts are 16-bit integers.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.readers.containers.stored_channels import (
    container_recording,
    left_out_notes,
    no_signal,
    unused_time_note,
)
from recoil_acquisition.readers.containers.stored_time import (
    StoredTime,
    resolution_of,
    rising_column,
    selected,
    time_from_datenum,
    time_from_stamps,
)
from recoil_acquisition.readers.containers.time_axis import (
    STEPS,
    Stated,
    one_unit,
    stated_rate,
    stated_step,
    unit_in_time_name,
)
from recoil_acquisition.readers.hdf5.vector import Room, hdf5_file, vector_of
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.mat.v4 import is_mat_v4, read_mat_v4
from recoil_acquisition.readers.mat.v5 import HEADER_BYTES, is_mat_v5, read_mat_v5
from recoil_acquisition.readers.mat.variable import (
    CELL,
    LONGEST_TEXT,
    MOST_VARIABLES,
    STRUCTURE,
    MatContents,
    MatVariable,
)
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel, map_to_corrupt_file
from recoil_acquisition.readers.statements import Statements, folded
from recoil_acquisition.remark import Note, NoteCode, Remark

T = TypeVar("T")

_DEWESOFT_TIME = re.compile(r"(?P<data>.+?)_time(?:_(?P<channel>.+))?", re.IGNORECASE)
_UNITS = ("unit", "units")
_STEPS = STEPS | {"ts"}
HEAD_V73 = b"MATLAB 7.3 MAT-file"
DATENUMS = (693962.0, 767011.0)
"""Serial date numbers of the years 1900 and 2100; as seconds they would be more than eight days."""
SAME_STEP = 0.01
"""Share by which the step of a file's one time vector may differ from the one that is stated."""
NO_VECTORS = "save each channel, and the time, as a vector of its own"
NO_UNITS = "MATLAB variables have no units: the rig must state them"


def read_mat_v73(path: Path) -> MatContents:
    """List the variables of a file; the numbers of vectors are not read.

    Raises
    ------
    ReadError
        If it unpacks to more than a recording does.
    CorruptFileError
        If it is damaged.
    """
    room = Room(path, path.stat().st_size)
    with path.open("rb") as plain:
        contents = MatContents("7.3", plain.read(116).decode("latin-1").rstrip("\0 "))
    with hdf5_file(path) as file:
        if len(file) > MOST_VARIABLES:
            raise ValueError(f"{len(file)} variables")
        for name in file:
            if name.startswith("#"):
                continue
            link = file.get(name, getlink=True)
            item = file[name] if type(link).__name__ == "HardLink" else None
            if item is None or not hasattr(item, "shape"):
                contents.left_out[name] = "a link" if item is None else STRUCTURE.format(name=name)
                continue
            _sort(path, name, item, room, contents)
    return contents


def _sort(path: Path, name: str, item: Any, room: Room, contents: MatContents) -> None:
    label = item.attrs.get("MATLAB_class", b"double")
    kind = label.decode("latin-1") if isinstance(label, bytes) else str(label)
    if "MATLAB_empty" in item.attrs or kind not in {"char", "double", "single", "logical"} | {
        f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
    }:
        other = {"cell": CELL, "struct": STRUCTURE.format(name=name)}
        contents.left_out[name] = "empty" if "MATLAB_empty" in item.attrs else other.get(kind, kind)
        return
    vector = vector_of(path, item, room.size)
    if isinstance(vector, str):
        contents.left_out[name] = vector
        return
    room.take(vector, item.id.get_storage_size())
    if kind == "char":
        if vector.count > LONGEST_TEXT:
            contents.left_out[name] = f"a text of {vector.count} characters"
        else:
            codes = np.asarray(item[()]).reshape(-1)
            contents.texts[name] = codes.astype("<u2").tobytes().decode("utf-16-le", "replace")
    elif vector.count == 1:
        contents.scalars[name] = float(np.asarray(item[()]).reshape(-1)[0])
    else:
        contents.vectors.append(MatVariable(name, vector.count, vector.dtype, vector.stored))


def is_time(name: str, others: Collection[str]) -> bool:
    """Return whether a variable's name is that of a time; `others` are all names of the file."""
    folded = name.casefold()
    stem = folded.removesuffix("_t").removesuffix("_time")
    own = stem != folded and stem in {other.casefold() for other in others}
    return is_plain_time(folded) or own or _DEWESOFT_TIME.fullmatch(folded) is not None


def time_of(channel: MatVariable, times: Sequence[MatVariable]) -> MatVariable | str | None:
    """Find the time of a channel.

    Returns
    -------
    MatVariable, str or None
        Time of the channel; or why there is none; None if no time has the channel's length.
    """
    fitting = [time for time in times if time.count == channel.count]
    ranks = [(_rank(channel.own_name.casefold(), time.own_name.casefold()), time) for time in fitting]
    best = max((rank for rank, _ in ranks), default=0)
    chosen = [time for rank, time in ranks if rank == best > 0]
    if len(chosen) > 1:
        return f"{' and '.join(repr(time.name) for time in chosen)} could both be its time"
    return chosen[0] if chosen else None


def _rank(channel: str, time: str) -> int:
    """Return how much a time's name speaks for a channel: its own, that of its block, any."""
    if time in (f"{channel}_time", f"{channel}_t", f"{channel}_time_s"):
        return 1000
    match = _DEWESOFT_TIME.fullmatch(time)
    if match is None:
        return 2 if is_plain_time(time) else 0
    data, own = match["data"], match["channel"]
    if not channel.startswith(f"{data}_"):
        return 0
    rest = channel[len(data) + 1 :]
    if own is None:
        return 3
    # The longest name wins, so that AI_1 is not taken for AI_10; a group's time serves all in it
    return 10 + len(own) if rest == own or rest.startswith(f"{own}_") else 1


def is_plain_time(name: str) -> bool:
    """Return whether a name is that of a time alone, with a unit behind it or without."""
    return unit_in_time_name(name) is not None


def unit_of_time(time: str, texts: Mapping[str, str]) -> float | str | None:
    """Return the seconds of the unit of a time vector, by its name or a text beside it.

    Returns
    -------
    float, str or None
        Seconds of the unit; or why it cannot be taken, where it is none of time or stated twice; None if no unit is
        stated.
    """
    wanted = {folded(time) + ending for ending in ("unit", "units")} | {"timeunit", "timeunits", "xunit", "xunits"}
    beside = [text for name, text in texts.items() if folded(name) in wanted]
    return one_unit(time, (unit_in_time_name(time) or "", *beside))


def one_step(scalars: Mapping[str, float], texts: Mapping[str, str]) -> tuple[str, float] | str | None:
    """Find a scalar that states the one rate of a file: its name and the step, s; or why it cannot be taken."""
    positive = {**texts, **{name: value for name, value in scalars.items() if value > 0}}
    found: Stated | str | None = stated_rate(positive)
    if isinstance(found, Stated):
        return found.name, 1.0 / found.value
    if found is None:
        found = stated_step(positive, _STEPS)
    return (found.name, found.value) if isinstance(found, Stated) else found


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
        NoSignalError
            If it has no time, or no vectors.
        CorruptFileError
            If it is damaged.
        """
        with map_to_corrupt_file(path, "a MATLAB file"):
            with path.open("rb") as file:
                head = file.read(HEADER_BYTES)
            if head.startswith(HEAD_V73):
                contents = read_mat_v73(path)
            elif is_mat_v4(head, path.stat().st_size):
                contents = read_mat_v4(path)
            else:
                contents = read_mat_v5(path)
            return _recording(path, contents, declared.clock)


def _recording(path: Path, contents: MatContents, clock: str) -> Recording:
    notes: list[Remark] = [Note(NoteCode.CUT, None, contents.incomplete)] if contents.incomplete else []
    left_out = dict(contents.left_out)
    names = [v.own_name for v in contents.vectors]
    times = [v for v in contents.vectors if not v.is_column and is_time(v.own_name, names)]
    columns: dict[str, MatVariable | str] = {}
    read: dict[str, StoredTime | str] = {}
    channels: list[StoredChannel] = []
    seen: set[str] = set()
    rows: dict[str, str] = {}
    starts: set[AbsoluteStart | None] = set()
    timeless = 0
    for vector in contents.vectors:
        if vector in times:
            continue
        if vector.name in seen:
            text = f"{vector.name}: stored twice: the later one is left out"
            notes.append(Note(NoteCode.LEFT_OUT, vector.name, text))
            continue
        seen.add(vector.name)
        chosen = _stated_time(contents, vector, times)
        if chosen is None and vector.is_column:
            matrix = vector.groups[0]
            if matrix not in columns:
                own = {v.own_name: v for v in contents.vectors if v.is_column and v.groups[0] == matrix}
                found, reason = rising_column({name: partial(v.read, 0, v.count) for name, v in own.items()})
                columns[matrix] = reason if found is None else own[found]
            chosen = columns[matrix]
        if chosen is vector:
            continue
        if isinstance(chosen, MatVariable):
            if chosen.name not in read:
                read[chosen.name] = _read_time(chosen, clock, contents, notes)
            time, source = read[chosen.name], f"variable {chosen.name}"
        elif isinstance(chosen, tuple):
            base = TimeBase.uniform(clock, 0.0, chosen[1], vector.count)
            time, source = StoredTime(base, None, ""), f"variable {chosen[0]}"
        else:
            time, source = chosen or "no time vector has its length", ""
        if isinstance(time, str):
            left_out[vector.name] = time
            timeless += 1
            continue
        starts.add(time.time_base.absolute_start)
        said = _said_of(vector, contents, names)
        own_units = {folded(vector.own_name + ending) for ending in _UNITS}
        unit = next(
            (name for name, value in said.items() if folded(name) in own_units and isinstance(value, str)), None
        )
        text = "" if unit is None else str(said[unit]).strip()
        if isinstance(chosen, tuple):
            rows[vector.name] = vector.groups[0]
        header = SignalHeader(vector.name, text, time.time_base.count, metadata={"time": source})
        raw = partial(_raw, vector, time.kept, text) if vector.dtype.kind in "iu" else None
        used = [*([] if unit is None else [unit]), *([chosen[0]] if isinstance(chosen, tuple) else [])]
        beside = Statements(said, used, raw is not None)
        channels.append(StoredChannel(header, time.time_base, partial(_samples, vector, time.kept), raw, beside=beside))
    notes += [unused_time_note(t.name) for t in times if t.name not in read]
    if timeless and not channels:
        raise no_signal(
            "no time in this file", path, left_out, [*notes, *left_out_notes(left_out)], contents.incomplete,
            "add a vector `time` (s) as long as the channels, or a scalar `Sample_rate` (Hz)",
        )  # fmt: skip
    metadata: dict[str, Any] = {
        "version": contents.version,
        "header": contents.header,
        "scalars": {name: value for name, value in contents.scalars.items() if np.isfinite(value)},
        "texts": contents.texts,
    }
    start = starts.pop() if len(starts) == 1 else None
    if len(starts) > 1:
        text = "time vectors with date numbers start at different instants: compare no channels across them"
        notes.append(Note(NoteCode.TIME, None, text))
    of_units = [Note(NoteCode.UNITS, None, NO_UNITS)] if any(not one.header.unit for one in channels) else []
    notes = [*of_units, *notes, *left_out_notes(left_out)]
    return container_recording(
        path, MatReader.name, channels, metadata, notes, contents.incomplete, start, left_out, NO_VECTORS, rows
    )


def _stated_time(
    contents: MatContents, channel: MatVariable, times: Sequence[MatVariable]
) -> MatVariable | tuple[str, float] | str | None:
    """Find the time vector of a channel, or its rate, in the structure that it is in, else in one around that."""
    for group in channel.groups:
        near = [time for time in times if time.groups[0] == group]
        chosen: MatVariable | tuple[str, float] | str | None = time_of(channel, near)
        if chosen is None and not near:
            chosen = one_step(_beside(contents.scalars, group), _beside(contents.texts, group))
        if chosen is not None:
            return chosen
    return None


def _said_of(channel: MatVariable, contents: MatContents, names: Collection[str]) -> dict[str, Any]:
    """Return the numbers and texts that may be of a channel: behind its name, or behind that of none, where it is."""
    said: dict[str, Any] = {}
    for group in reversed(channel.groups):
        for name, value in (_beside(contents.scalars, group) | _beside(contents.texts, group)).items():
            owner = max((one for one in names if name.startswith(f"{one}_")), key=len, default=None)
            if owner in (None, channel.own_name):
                said[name] = value
    return said


def _beside(values: Mapping[str, T], group: str) -> dict[str, T]:
    """Return what is directly in a structure, by its name there; of the group without a name what is in none."""
    return {name.rpartition(".")[2]: value for name, value in values.items() if name.rpartition(".")[0] == group}


def _read_time(time: MatVariable, clock: str, contents: MatContents, notes: list[Remark]) -> StoredTime | str:
    """Read a time vector, in the unit that is stated, seconds or date numbers."""
    texts = _beside(contents.texts, time.groups[0])
    step = one_step(_beside(contents.scalars, time.groups[0]), texts)
    unit_s = unit_of_time(time.own_name, texts)
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
            text = f"{time.name}: serial date numbers (days), without a zone; time zero is the first of them"
            notes.append(Note(NoteCode.TIME, time.name, text))
        else:
            stored = time_from_stamps(clock, exact, resolution_of(values))
            notes.append(Note(NoteCode.TIME, time.name, f"{time.name}: states no unit: read as seconds"))
        if isinstance(step, str) and is_plain_time(time.own_name):
            return step
        step_s = stored.time_base.step_s
        if one and step_s and is_plain_time(time.own_name) and abs(step_s / one[1] - 1) > SAME_STEP:
            return (
                f"{time.name} steps by {step_s:g} s, {one[0]} says {one[1]:g} s: state the unit, "
                f"{time.name}_unit = 'ms', say"
            )
    except ValueError as error:
        return f"{time.name}: {error}"
    if stored.note:
        notes.append(Note(NoteCode.TIME, time.name, f"{time.name}: {stored.note}"))
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


def _raw(vector: MatVariable, kept: NDArray[np.int64] | None, unit: str, start: int, stop: int) -> RawCounts:
    return RawCounts(selected(kept, vector.read, start, stop), 1.0, 0.0, unit)
