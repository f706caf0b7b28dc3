"""A recorded file as a source with its signals, before any rig explains it."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import ReadError, RecoilDaqError, UnknownFormatError
from recoil_acquisition.files.regular_file import check_regular, read_beginning
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.log.record import DATA
from recoil_acquisition.quantities.declaration import stated_number, unit_of_key
from recoil_acquisition.quantities.quantity import Unit, find_unit
from recoil_acquisition.quantities.typed_quantity import TypedError
from recoil_acquisition.readers.can.buses import AT
from recoil_acquisition.readers.captured import LIVE, CapturedSource, sources_of
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations, Reader
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.serial.fitting import MOST_BYTES
from recoil_acquisition.readers.serial.frame_fields import CLOCK_FIELD, CLOCK_MODULO, COUNTER_FIELD
from recoil_acquisition.readers.table import BY_LAYOUT, recognise
from recoil_acquisition.readers.text.proposed_layout import propose_layout
from recoil_acquisition.remark import NoteCode
from recoil_daq.drafting.answer import a_number, a_table, a_tick, as_text, one_of
from recoil_daq.drafting.other_rig import OtherRig
from recoil_daq.drafting.rig_draft import Entry, Question
from recoil_daq.recording.file_summary import EMPTY_DATABASE
from recoil_daq.recording.supposed_file import open_port, open_table, reader_by_shape, supposed_framing
from recoil_processing.swing import MEAN_S, Swing, cell_means, farthest_cell, swing_of
from recoil_rigs.checks.plausible import OF_SOURCE
from recoil_rigs.rig import read_database

MOST_SAMPLES = 1 << 22
"""Samples of a signal that are compared with others; of a longer record those about the shot."""
_BEFORE_SHOT = 0.25
"""Share of them that lies before the shot."""
_BLOCK = 1 << 20
"""Samples of a long record that are read at once where the shot is sought in it."""
_SAME_SHOT_S = 1.0
"""Time within which signals of one source go farthest if it is in one shot."""
_COUNTS = 0.9
"""Share of the steps of a signal that are one, of a counter."""
_UNKNOWN_RATE_HZ = 1000.0
"""Frames per second by which the signals of a camera's file are listed that does not state any."""
_USUAL_TICK_S = 1e-6
"""Tick of most clocks of inertial sensors, s."""
PIXELS = ("px", "pixel", "pixels")
_RATE = Question(
    "samples per second, as set in the recorder: no line of the file tells",
    read=a_number("Hz", positive=True),
    opens=True,
)
"""Question for the rate of a table that has no column of time."""


@dataclass(frozen=True, eq=False)
class RecordedSignal:
    """A signal of a file.

    Attributes
    ----------
    source
        Name of its source.
    unit
        Unit as the file states it; empty if it states none.
    quantity
        Quantity that it measures; empty where the unit does not tell.
    factor, offset
        Line to SI: ``factor * number + offset``; 1 and 0 where that is not known.
    recording
        Recording that it is read from.
    first
        First sample that is looked at; above zero in a record that is too long to be looked at whole.
    counts
        Whether its numbers are whole ones that were found in bytes, whose scale the device's manual tells.
    """

    source: str
    name: str
    unit: str
    quantity: str
    factor: float
    recording: Recording
    swing: Swing | None = None
    offset: float = 0.0
    first: int = 0
    counts: bool = False

    @property
    def key(self) -> str:
        """Name that tells it from all signals of the files."""
        return f"{self.source}: {self.name}"

    @property
    def base(self) -> TimeBase:
        """Instants of the samples that are looked at on its source's clock."""
        whole = self.recording.time_base(self.name)
        stop = min(self.first + MOST_SAMPLES, whole.count)
        return whole if stop - self.first == whole.count else whole.part(self.first, stop)

    @property
    def rate_hz(self) -> float:
        """Samples per second; NaN where there are too few."""
        return self.base.rate_hz

    def samples(self) -> NDArray[np.float64]:
        """Read the samples, in SI as far as that is known; of a long record those about the shot."""
        read = self.recording.read(self.name, self.first, self.first + MOST_SAMPLES)
        return self.factor * read + self.offset

    def times_s(self) -> NDArray[np.float64]:
        """Return the instants of `samples`."""
        return self.base.times_s


@dataclass(frozen=True, eq=False)
class RecordedSource:
    """A file as a source of the rig.

    Attributes
    ----------
    name, kind
        Name that the source gets, and its kind.
    format_name
        Name of the file's format.
    entries
        Keys of the source that its bytes, its database or its times tell.
    tables
        Tables in it by their keys: the ``framing`` of a port's bytes, the ``layout`` of a table of text.
    signals
        Signals of the file.
    found_in_bytes
        Whether its signals have no names and units of their own: fields that were found in bytes.
    dated
        Whether the instants of its samples are known; if not, their rate is asked for.
    notes
        Sentences on what was found.
    """

    name: str
    kind: str
    file: Path
    format_name: str
    entries: tuple[Entry, ...] = ()
    tables: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    signals: tuple[RecordedSignal, ...] = ()
    found_in_bytes: bool = False
    dated: bool = True
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Database:
    """A CAN database that was given.

    Attributes
    ----------
    name
        Path from the rig file's folder, as the rig names it.
    """

    path: Path
    name: str
    text: str


def read_source(
    path: Path, databases: Sequence[Database], taken: Sequence[str], other: OtherRig | None
) -> tuple[RecordedSource, ...]:
    """Read what a file tells of the source, or the sources of a capture, that it is of.

    Parameters
    ----------
    databases
        CAN databases of which one may explain it.
    taken
        Names of the sources that there are already.
    other
        Another rig, by whose names and keys of the source the file is read.

    Raises
    ------
    ReadError
        If nobody reads the file, or it is damaged.
    """
    check_regular(path)
    kind, laid_out = ("", {}) if other is None else other.laid_out(path.name)
    if laid_out:
        return (_laid_out_source(path, kind, _name_of(path, kind, taken, other), laid_out),)
    try:
        reader: Reader = _recognised(path)
    except UnknownFormatError as error:
        if error.candidates or error.foreign:
            raise
        return (_unknown_source(path, taken, other, error),)
    if reader.kind == LIVE:
        return tuple(_captured_sources(path, reader, databases, other))
    name, stated = _name_of(path, reader.kind, taken, other), _stated(path, reader.kind, other)
    if _layout_of(stated) is not None:
        return (_laid_out_source(path, reader.kind, name, stated),)
    if reader.kind == "can":
        return (_bus_source(path, reader, name, _of_bus(databases, stated, other), stated),)
    if reader.kind == "camera":
        return (_camera_source(path, reader, name, stated),)
    return (_opened(reader.open(path, Declarations(name)), name, reader.kind, reader.name),)


def _stated(path: Path, kind: str, other: OtherRig | None) -> Mapping[str, Any]:
    return {} if other is None else other.source_of(path.name, kind)


def _layout_of(stated: Mapping[str, Any]) -> Mapping[str, Any] | None:
    layout = stated.get("layout")
    return layout if isinstance(layout, dict) else None


def _number_of(stated: Mapping[str, Any], key: str) -> float | None:
    """Return what another rig states as a number; None where it states none."""
    try:
        value = stated_number(stated.get(key), unit_of_key(key))
    except TypedError:
        return None
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and math.isfinite(value) and value > 0.0 else None


def _laid_out_source(path: Path, kind: str, name: str, stated: Mapping[str, Any]) -> RecordedSource:
    """Read a table of text by the layout that another rig declares of it; what is open in that is asked for again."""
    reader = BY_LAYOUT[kind]
    if kind == "camera":
        return _camera_source(path, reader, name, stated)
    layout = _layout_of(stated) or {}
    opened = open_table(path, name, layout, lacks_unit=False)
    asked = dict(layout) | ({"rate_hz": _RATE} if opened.lacking else {})
    if opened.recording is None:
        raise ReadError("cannot be read by the layout of the other rig", path=path)
    more: dict[str, Any] = {"tables": {"layout": asked}, "dated": not opened.lacking}
    return _opened(opened.recording, name, kind, reader.name, **more)


def _name_of(path: Path, kind: str, taken: Sequence[str], other: OtherRig | None) -> str:
    """Return the name of a file's source: that of the other rig, else one after its kind."""
    name = _stated(path, kind, other).get("name")
    if isinstance(name, str) and name not in taken:
        return name
    return _free_name({"dewetron": "recorder"}.get(kind, kind), taken)


def _recognised(path: Path) -> Reader:
    """Return the reader of a file; of a table that only its shape speaks for, a recorder's, then a camera's."""
    try:
        return recognise(path)
    except UnknownFormatError as error:
        try:
            return reader_by_shape(path)
        except UnknownFormatError:
            raise error from None


def _free_name(name: str, taken: Sequence[str]) -> str:
    """Return a name that no source has yet."""
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name}_{number}"
    return free


def _opened(recording: Recording, name: str, kind: str, format_name: str, **more: Any) -> RecordedSource:
    """Describe an opened file; of fields that were found in bytes those that hold values."""
    shot_s = _shot_in(recording)
    signals, undated = _signals(recording, name, shot_s)
    if more.get("found_in_bytes"):
        framing = more["tables"]["framing"]
        own = {COUNTER_FIELD, CLOCK_FIELD}
        whole = {one["name"] for one in framing["fields"] if one["type"] != "f32"}
        signals = tuple(replace(one, counts=one.name in whole) for one in signals if one.name not in own)
    longest = max((one.sample_count for one in recording.signals), default=0)
    long: tuple[str, ...] = ()
    if longest > MOST_SAMPLES:
        which = f"the first {MOST_SAMPLES:,}"
        if shot_s is not None:
            which = f"the {MOST_SAMPLES:,} about {shot_s:.6g} s, where it goes farthest,"
        long = (f"{recording.path.name}: of {longest:,} samples {which} were compared",)
    cut = (f"{recording.path.name} was cut off: {recording.incomplete}",) if recording.incomplete else ()
    slower = (str(note) for note in recording.notes if note.code is NoteCode.OWN_RATE)
    notes = (*more.pop("notes", ()), *cut, *long, *undated, *(f"{recording.path.name}: {text}" for text in slower))
    return RecordedSource(name, kind, recording.path, format_name, signals=signals, notes=notes, **more)


def _shot_in(recording: Recording) -> float | None:
    """Return the instant at which most signals of a long record go farthest, s; None of a short one, or without any.

    All of it is read, a block at a time; signals that are short enough are not needed for it.
    """
    found = []
    for header in recording.signals:
        if header.sample_count > MOST_SAMPLES:
            try:
                at_s = _farthest_s(recording, header.name, header.sample_count)
            except RecoilDaqError:
                continue
            found += [] if at_s is None else [at_s]
    if not found:
        return None
    together = [sum(abs(one - other) <= _SAME_SHOT_S for other in found) for one in found]
    return found[together.index(max(together))]


def _farthest_s(recording: Recording, name: str, count: int) -> float | None:
    base = recording.time_base(name)
    length = max(round(MEAN_S * base.rate_hz), 1) if math.isfinite(base.rate_hz) else 1
    block = max(_BLOCK // length, 1) * length
    means = [cell_means(recording.read(name, at, at + block), length) for at in range(0, count, block)]
    cell = farthest_cell(np.concatenate(means))
    return None if cell is None else base.part(cell * length, cell * length + 1).start_s


def _first_looked_at(base: TimeBase, shot_s: float | None) -> int:
    """Return the first sample that is looked at: that of a whole record, or of one about the shot."""
    if shot_s is None or base.count <= MOST_SAMPLES:
        return 0
    at, _ = base.span(shot_s, shot_s)
    return min(max(at - round(_BEFORE_SHOT * MOST_SAMPLES), 0), base.count - MOST_SAMPLES)


def _signals(
    recording: Recording, source: str, shot_s: float | None
) -> tuple[tuple[RecordedSignal, ...], tuple[str, ...]]:
    """Return the signals of a recording, and a sentence on each that has no instants.

    Raises
    ------
    ReadError
        If none has any.
    """
    signals: list[RecordedSignal] = []
    undated: list[str] = []
    for header in recording.signals:
        try:
            base = recording.time_base(header.name)
        except ReadError as error:
            if len(undated) + 1 == len(recording.signals):
                raise
            undated.append(f"{recording.path.name}: {header.name!r} is left out: {error.without_path()}")
            continue
        unit = find_unit(header.unit) if header.unit.strip() else None
        quantity = _quantity(unit, header.unit)
        factor, offset = (1.0, 0.0) if unit is None or not quantity else (unit.factor, unit.offset)
        one = RecordedSignal(source, header.name, header.unit.strip(), quantity, factor, recording, offset=offset)
        if header.sample_count > MOST_SAMPLES:
            one = replace(one, first=_first_looked_at(base, shot_s))
        signals.append(with_swing(one))
    return tuple(signals), tuple(undated)


def with_swing(signal: RecordedSignal) -> RecordedSignal:
    """Look at what a signal does; one that cannot be read does nothing."""
    try:
        rate_hz = signal.rate_hz
        samples = signal.samples() if math.isfinite(rate_hz) else np.zeros(0)
    except RecoilDaqError:
        return signal
    return replace(signal, swing=swing_of(samples, rate_hz))


def _quantity(unit: Unit | None, spelling: str) -> str:
    """Return the one quantity that a unit is of; empty where it is none, or of several."""
    if unit is None:
        return "displacement" if spelling.strip().casefold() in PIXELS else ""
    return next(iter(unit.quantities)) if len(unit.quantities) == 1 else ""


def _bus_source(
    path: Path, reader: Reader, name: str, databases: Sequence[Database], stated: Mapping[str, Any]
) -> RecordedSource:
    """Read a bus log with the database that explains most of its signals."""
    bus = stated.get("bus")
    declared = Declarations(name, bus=bus if isinstance(bus, int | str) else None)
    opened = [(reader.open(path, replace(declared, database=one.text)), one) for one in databases]
    opened = [one for one in opened if one[0].signals]
    least = min((_unexplained(recording) for recording, _ in opened), default=0)
    best = [one for one in opened if _unexplained(one[0]) == least]
    if not best:
        recording = reader.open(path, replace(declared, database=EMPTY_DATABASE))
        unknown = recording.metadata.get("unknown_identifiers", {})
        shown = ", ".join(f"{key} ({count} frames)" for key, count in list(unknown.items())[:8])
        question = Question(
            f"file of the bus's messages: DBC, KCD, SYM or ARXML; identifiers in {path.name}: {shown}",
            read=as_text,
            opens=True,
        )
        return _opened(recording, name, "can", reader.name, entries=(Entry("database", question),))
    if any(_differ(recording, best[0][0]) for recording, _ in best[1:]):
        names = [database.name for _, database in best]
        text = f"{' and '.join(names)} explain {path.name} equally well, with other values: write the one of this bus"
        question = Question(text, read=one_of(names), opens=True)
        recording = reader.open(path, replace(declared, database=EMPTY_DATABASE))
        return _opened(recording, name, "can", reader.name, entries=(Entry("database", question),))
    recording, best_database = best[0]
    unknown = recording.metadata.get("unknown_identifiers", {})
    entries = [Entry("database", best_database.name, f"explains {len(recording.signals)} signals of {path.name}")]
    # a counter is that of its message on every bus: each is counted for itself
    counted = [one.name.partition(AT)[0] for one in recording.signals if _counts(recording, one.name)]
    counters = list(dict.fromkeys(counted))
    if counters and "counters" not in stated:
        entries.append(Entry("counters", counters, "goes up by one from message to message: a gap is a lost one"))
    notes = (
        [f"{path.name}: identifiers that {best_database.name} does not explain: {', '.join(unknown)}"]
        if unknown
        else []
    )
    return _opened(recording, name, "can", reader.name, entries=tuple(entries), notes=tuple(notes))


def _of_bus(databases: Sequence[Database], stated: Mapping[str, Any], other: OtherRig | None) -> Sequence[Database]:
    """Return the database that another rig states of a bus, where it is at hand; else all."""
    name = stated.get("database")
    if other is None or not isinstance(name, str):
        return databases
    path = (other.path.parent / name).resolve()
    return [one for one in databases if one.path.resolve() == path] or databases


def _unexplained(recording: Recording) -> int:
    """Return the number of a bus's frames that a database does not explain."""
    return sum(int(count) for count in recording.metadata.get("unknown_identifiers", {}).values())


def _differ(one: Recording, other: Recording) -> bool:
    """Whether two databases make other signals of a bus, in their names, units or values."""
    if [(s.name, s.unit, s.sample_count) for s in one.signals] != [
        (s.name, s.unit, s.sample_count) for s in other.signals
    ]:
        return True
    pairs = ((one.read(s.name, 0, MOST_SAMPLES), other.read(s.name, 0, MOST_SAMPLES)) for s in one.signals)
    return not all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


def _counts(recording: Recording, name: str) -> bool:
    """Return whether a signal counts messages: whole numbers that go up by one and begin anew."""
    values = recording.read(name, 0, MOST_SAMPLES)
    values = values[np.isfinite(values)]
    if values.size < 16 or np.any(values != np.round(values)):
        return False
    steps = np.diff(values)
    return bool(np.mean((steps == 1) | (steps < 0)) >= _COUNTS and np.mean(steps == 1) >= 0.5)


def _camera_source(path: Path, reader: Reader, name: str, stated: Mapping[str, Any]) -> RecordedSource:
    """Read tracks; where the file has no times, its frame rate is asked for."""
    entries: list[Entry] = []
    dated = True
    rate_hz, scale = _number_of(stated, "frame_rate"), _number_of(stated, "scale_mm_per_px")
    declared = Declarations(name, scale_mm_per_px=scale, layout=_layout_of(stated))
    try:
        recording = reader.open(path, declared)
        found = recording.metadata.get("frame_rate_hz")
        if rate_hz is None and isinstance(found, float) and math.isfinite(found):
            rate_hz = round(found) if abs(found / max(round(found), 1) - 1.0) < 1e-3 else found
            entries.append(Entry("frame_rate", float(rate_hz), "frames per second by the file's times"))
    except RecoilDaqError:
        recording = reader.open(path, replace(declared, frame_rate_hz=rate_hz or _UNKNOWN_RATE_HZ))
        if rate_hz is None:
            meaning = f"frames per second, as set at the camera: {path.name} has no times; 500 to 1e6"
            question = Question(meaning, read=a_number("Hz", OF_SOURCE["frame_rate"]), opens=True)
            entries.append(Entry("frame_rate", question))
            dated = False
    if scale is None and any(one.unit.casefold() in PIXELS for one in recording.signals):
        meaning = "millimetres per pixel: from a scale in the plane of the motion; 1e-3 to 50"
        question = Question(meaning, read=a_number("mm/px", OF_SOURCE["scale_mm_per_px"]), opens=True)
        entries.append(Entry("scale_mm_per_px", question))
    return _opened(recording, name, "camera", reader.name, entries=tuple(entries), dated=dated)


def _unknown_source(
    path: Path, taken: Sequence[str], other: OtherRig | None, error: UnknownFormatError
) -> RecordedSource:
    """Read bytes of a port by the framing that another rig states or that fits them, else a table of text."""
    stated = _stated(path, "serial", other)
    framing = _framing_of(read_beginning(path, MOST_BYTES), path.name, stated.get("framing"), None)
    if framing.table is None:
        name = _name_of(path, "dewetron", taken, other)
        return _table_source(path, name, _stated(path, "dewetron", other), error)
    return _port(path, BY_LAYOUT["serial"], _name_of(path, "serial", taken, other), framing)


@dataclass(frozen=True)
class _Framing:
    """Framing of a port's bytes, stated or found, and sentences on it."""

    table: Mapping[str, Any] | None
    found_in_bytes: bool
    notes: tuple[str, ...]


def _port(path: Path, reader: Reader, name: str, framing: _Framing) -> RecordedSource:
    """Open a port's bytes by a framing; where nothing dates its frames their rate is asked for."""
    table = framing.table or {}
    opened = open_port(path, reader, name, table)
    if opened.recording is None:
        meaning = "fields of a frame, from the device's manual: [{ name = .., at = .., type = .., unit = .. }]"
        fields = Question(meaning, read=a_table("fields", kinds=(list,)), opens=True)
        return RecordedSource(
            name, "serial", path, reader.name, tables=_framed({**table, "fields": fields}), notes=framing.notes
        )
    more: dict[str, Any] = {"found_in_bytes": framing.found_in_bytes, "notes": framing.notes}
    if opened.lacking:
        clock = _clock_question(opened.recording) if framing.found_in_bytes else None
        meaning = "frames per second, as set in the device: nothing in the bytes says when a frame was"
        rate = Question(meaning, read=a_number("Hz", positive=True), opens=True)
        table = {**table, "rate_hz": rate} if clock is None else {**table, "device_time": clock}
        more["dated"] = False
    return _opened(opened.recording, name, "serial", reader.name, tables=_framed(table), **more)


def _clock_question(recording: Recording) -> Question | None:
    """Ask for a tick of the clock that was found in the bytes; None if none was."""
    if CLOCK_FIELD not in {one.name for one in recording.signals}:
        return None
    step = float(np.median(np.diff(recording.read(CLOCK_FIELD, 0, MOST_SAMPLES))))
    proposal = {"field": CLOCK_FIELD, "tick_s": _USUAL_TICK_S, "modulo": CLOCK_MODULO}
    meaning = (
        f"duration of a tick of the device's clock, which goes up by {step:.6g} from frame to frame: device's manual; "
        f"of {_USUAL_TICK_S:g} s it makes {1.0 / (_USUAL_TICK_S * step):.6g} frames per second"
    )
    return Question(meaning, proposal, a_tick(proposal), opens=True)


def _framed(framing: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    return {"framing": framing}


def _table_source(path: Path, name: str, stated: Mapping[str, Any], error: UnknownFormatError) -> RecordedSource:
    """Read a table of text that does not say what program wrote it, by the layout that it seems to have."""
    reader = BY_LAYOUT["dewetron"]
    if _layout_of(stated) is not None:
        return _laid_out_source(path, "dewetron", name, stated)
    proposed = propose_layout(Head.of(path).lines)
    if proposed is None:
        raise error
    asked = dict(proposed.table)
    opened = open_table(path, name, proposed.table, lacks_unit=bool(proposed.lacking))
    if opened.recording is None:
        raise error
    if opened.lacking == "rate_hz":
        asked["rate_hz"] = _RATE
        if proposed.rate_line:
            meaning = f"samples per second, as line {proposed.rate_line} of the file seems to say"
            asked["rate_hz"] = replace(_RATE, meaning=meaning, proposal=proposed.rate_hz)
    elif opened.lacking:
        meaning = "unit of the column of time, which the file does not state: s, ms, us, ns, min, h"
        asked["time_unit"] = Question(meaning, read=one_of(("s", "ms", "us", "ns", "min", "h")), opens=True)
    note = f"{path.name}: a table of text that does not say what program wrote it; its layout as found here"
    more: dict[str, Any] = {"tables": {"layout": asked}, "dated": not opened.lacking, "notes": (note,)}
    return _opened(opened.recording, name, "dewetron", reader.name, **more)


def _captured_sources(
    path: Path, reader: Reader, databases: Sequence[Database], other: OtherRig | None
) -> Iterator[RecordedSource]:
    """Read the sources of a capture, whose names stay."""
    for source in sources_of(read_capture(path)):
        if source.kind == "serial":
            yield _captured_port(path, reader, source, _stated(path, "serial", other))
        elif source.kind == "can":
            stated = _stated(path, "can", other)
            yield _bus_source(path, reader, source.name, _of_bus(databases, stated, other), stated)


def _captured_port(path: Path, reader: Reader, source: CapturedSource, stated: Mapping[str, Any]) -> RecordedSource:
    data = [record for record in source.records if record.kind in DATA]
    stream = b"".join(record.payload for record in data)
    duration_s = (data[-1].host_ns - data[0].host_ns) / 1e9 if len(data) > 1 else None
    framing = _framing_of(stream, path.name, stated.get("framing"), duration_s)
    if framing.table is None:
        meaning = f"framing of the bytes in {path.name}: ready-made, or as the device's manual has it"
        question = Question(meaning, read=a_table("framing"), opens=True)
        entries = (Entry("framing", question),)
        return RecordedSource(source.name, "serial", path, reader.name, entries=entries, notes=framing.notes)
    return _port(path, reader, source.name, framing)


def _framing_of(stream: bytes, file: str, stated: Mapping[str, Any] | None, duration_s: float | None) -> _Framing:
    """Return the framing of a port's bytes that another rig states, else the one that they seem to have."""
    found = supposed_framing(stream, duration_s)
    if stated is not None:
        # fields that were found here, and of which nobody said more since, have as little of a name as they had then
        as_found = found.table is not None and found.found_in_bytes and found.table["fields"] == stated.get("fields")
        return _Framing(stated, as_found, (f"{file}: its framing as stated",))
    return _Framing(found.table, found.found_in_bytes, tuple(f"{file}: {one}" for one in found.found))


def database_of(path: Path, beside: Path) -> Database:
    """Read a CAN database, named from the folder of the rig file.

    Raises
    ------
    ReadError
        If it is none.
    """
    text, _ = read_database(path)
    try:
        name = os.path.relpath(path.resolve(), beside.resolve()).replace(os.sep, "/")
    except ValueError:  # on another drive of Windows
        name = path.resolve().as_posix()
    return Database(path, name, text)
