"""Summary of an instrument's file, and the formats that are read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.capture.session_record import live_record_of
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import NoFrameRateError, NoSignalError, ReadError, UnknownFormatError
from recoil_acquisition.log.capture import Capture, read_capture
from recoil_acquisition.readers.can.frames import key_of
from recoil_acquisition.readers.can.messages import identifier_text
from recoil_acquisition.readers.captured import LIVE, sources_of
from recoil_acquisition.readers.own_rows import own_base
from recoil_acquisition.readers.reader import Declarations, Reader
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import BY_LAYOUT, TableReader, readers
from recoil_acquisition.remark import NoteCode
from recoil_daq.recording.ingest import explained_reader_of, reader_of
from recoil_daq.recording.supposed_file import SupposedFile, supposed_file
from recoil_rigs.rig import Rig, parse_rig, read_database

DATABASE_SUFFIXES = (".dbc", ".kcd", ".sym", ".arxml")
"""Usual endings of CAN databases, in which each format is found by its content."""

EMPTY_DATABASE = 'VERSION ""\n'
"""Database of a CAN log that is shown without a rig: every identifier is unknown to it, and so is listed."""


def formats_document() -> dict[str, Any]:
    """Return every format that is read: its kind, endings, and what it needs beside the package, in JSON types."""
    rows = []
    for reader in (*readers(), *BY_LAYOUT.values()):
        extra = reader.extra if isinstance(reader, TableReader) else None
        row = {
            "format": reader.name,
            "kind": reader.kind,
            "suffixes": list(reader.suffixes),
            "extra": None if extra is None else extra.name,
            "remedy": None if extra is None or extra.is_installed else extra.remedy,
            "installed": extra is None or extra.is_installed,
            "recognised": "by the rig" if reader in BY_LAYOUT.values() else "by its content",
        }
        rows.append(row)
    return {"schema": "recoil-daq/formats/1", "formats": rows}


def is_database(path: Path) -> bool:
    """Return whether a file is named as CAN databases are."""
    return path.suffix.casefold() in DATABASE_SUFFIXES


def summarise_database(path: Path) -> dict[str, Any]:
    """Say which messages and signals a CAN database has, in JSON types.

    Raises
    ------
    ReadError
        If it cannot be read, or is no CAN database.
    """
    _, database = read_database(path)
    return {
        "schema": "recoil-daq/database/1",
        "file": str(path),
        "bytes": path.stat().st_size,
        "messages": [
            {
                "name": name,
                "identifier": identifier_text(key_of(message)),
                "bytes": message.length,
                "signals": [{"name": f"{name}.{signal.name}", "unit": signal.unit or ""} for signal in message.signals],
            }
            for message, name in zip(database.messages, database.own_names, strict=True)
        ],
        "notes": database.notes(),
    }


def log_and_database(first: Path, second: Path) -> tuple[Path, Path]:
    """Return a CAN log and the database that explains it, in whichever order they are named.

    Raises
    ------
    ReadError
        If none of the two is a database, or both are.
    """
    databases = [path for path in (first, second) if is_database(path)]
    if len(databases) != 1:
        raise ReadError(
            "one file is shown at a time, and behind it the CAN database that explains its frames", path=second,
            expected=f"a database ({', '.join(DATABASE_SUFFIXES)})",
            found="two of them" if databases else "none", remedy="`recoil-daq show FILE DATABASE`",
        )  # fmt: skip
    return (second, first) if databases[0] == first else (first, second)


def summarise_file(path: Path, rig: Rig | None = None, database: Path | None = None) -> dict[str, Any]:
    """Say what is in an instrument's file, in JSON types; sums and samples are left to `ingest`.

    Parameters
    ----------
    rig
        Rig that declares what the file does not carry: a CAN database, a framing, a frame rate, a layout.
    database
        CAN database of a log where no rig names one.

    Raises
    ------
    ReadError
        If no reader or more than one claims the file, it is damaged, or it needs what only a rig declares; if a
        database is given with a file that holds no CAN frames.

    Notes
    -----
    Of a file of which nothing is a signal the contents are listed, with what hinders each; of a camera's without time
    the frames; of one that no reader recognises and that holds frames of a port, or a table, what these seem to be.
    """
    try:
        reader = reader_of(path, rig)
    except UnknownFormatError as error:
        supposed = None if database is not None else supposed_file(path, error)
        if supposed is None:
            raise
        return _summarise_supposed(path, supposed)
    if database is not None and reader.kind != "can":
        raise ReadError(
            "this is no CAN log", path=path, expected=f"frames that {database.name} explains", found=reader.name,
            remedy="show it alone, or with the rig that it was recorded on: --rig",
        )  # fmt: skip
    if reader.kind == LIVE:
        return _summarise_capture(path, reader, rig)
    text = None if database is None else read_database(database)[0]
    declarations = _declarations(reader, path, rig) if text is None else {"can": Declarations("can", database=text)}
    try:
        recordings = {name: reader.open(path, declared) for name, declared in declarations.items()}
    except NoSignalError as error:
        return _summarise_contents(path, reader, error)
    except NoFrameRateError:
        return _summarise_frames(path, reader, declarations)
    recording = next(iter(recordings.values()))
    start = recording.absolute_start
    # what is said of the file stands in every one of them: the buses of a log are one file
    notes = dict.fromkeys(note for one in recordings.values() for note in one.notes)
    return {
        "schema": "recoil-daq/file/1",
        "file": str(path),
        "bytes": path.stat().st_size,
        "format": recording.reader,
        "kind": reader.kind,
        "database": None if database is None else str(database),
        "absolute_start": None if start is None else {"text": start.text, "zone": start.zone, "origin": start.origin},
        "signals": _signals_of_all(recordings),
        "tracks": [track.name for track in recording.tracks()],
        "incomplete": recording.incomplete,
        "notes": list(notes),
        "metadata": dict(recording.metadata),
    }


def _summarise_contents(path: Path, reader: Reader, error: NoSignalError) -> dict[str, Any]:
    """Say what is in a file of which nothing can be read as a signal, and why."""
    return {
        **_nothing_of(path, reader.name, reader.kind),
        "incomplete": error.incomplete,
        "left_out": dict(error.contents),
        "notes": [*error.remarks, *([f"{error.problem}: {error.remedy}"] if error.remedy else [])],
    }


def _summarise_frames(path: Path, reader: Reader, declarations: Mapping[str, Declarations]) -> dict[str, Any]:
    """Say what is in a camera's file without time: its frames are known, their rate and instants are not."""
    declared = next(iter(declarations.values()))
    recording = reader.open(path, replace(declared, frame_rate_hz=1.0))
    return {
        **_nothing_of(path, reader.name, reader.kind),
        "format": recording.reader,
        "signals": [{**row, **_UNDATED} for row in _signals(recording)],
        "tracks": [track.name for track in recording.tracks()],
        "incomplete": recording.incomplete,
        "notes": ["the file has no time: its source in a rig states `frame_rate`, in Hz", *recording.notes],
        "metadata": {**recording.metadata, "frame_rate_hz": None},
    }


def _summarise_supposed(path: Path, supposed: SupposedFile) -> dict[str, Any]:
    """Say what is in a file that no reader recognises, and how a rig declares it."""
    recording, lacking = supposed.recording.recording, supposed.recording.lacking
    rows: list[dict[str, Any]] = [] if recording is None else _signals(recording)
    remarks = [] if recording is None else list(recording.notes)
    if lacking:
        rows = [{**row, **_UNDATED} for row in rows]
        remarks = [one for one in remarks if one.code is not NoteCode.TIME]
    unknown = [f"`{lacking}` is known from the device or its manual alone"] if lacking else []
    return {
        **_nothing_of(path, supposed.format_name, supposed.kind),
        "signals": rows,
        "tracks": [] if recording is None else [track.name for track in recording.tracks()],
        "incomplete": "" if recording is None else recording.incomplete,
        "notes": [*supposed.found, *unknown, supposed.advice, *remarks],
        "metadata": {**({} if recording is None else recording.metadata), **supposed.tables},
    }


_UNDATED = {"spacing": "frames", "rate_hz": None, "start_s": None, "end_s": None}
"""Instants of samples that nothing dates."""


def _nothing_of(path: Path, format_name: str, kind: str) -> dict[str, Any]:
    return {
        "schema": "recoil-daq/file/1",
        "file": str(path),
        "bytes": path.stat().st_size,
        "format": format_name,
        "kind": kind,
        "database": None,
        "absolute_start": None,
        "signals": [],
        "tracks": [],
        "incomplete": "",
        "notes": [],
        "metadata": {},
    }


def open_recording(path: str | Path, rig: Rig | None = None, *, source: str | None = None) -> Recording:
    """Open a file of any instrument: its signals are listed, samples are read when they are asked for.

    Parameters
    ----------
    rig
        Rig that declares what the file does not carry: a CAN database, a framing, a frame rate, a layout.
    source
        Name of the rig's source that is wanted, where several share the file.

    Raises
    ------
    ReadError
        As `summarise_file`; if several sources share the file and none of them is named.
    """
    reader = explained_reader_of(Path(path), rig)
    declared = _declarations(reader, Path(path), rig)
    if source is None and len(declared) == 1:
        return reader.open(Path(path), next(iter(declared.values())))
    if source not in declared:
        raise ReadError(
            "several sources of the rig share this file" if source is None else f"is no file of a source {source!r}",
            path=Path(path), expected=f"source = one of {', '.join(map(repr, declared))}",
        )  # fmt: skip
    return reader.open(Path(path), declared[source])


def _summarise_capture(path: Path, reader: Reader, rig: Rig | None) -> dict[str, Any]:
    """Say what is in a capture, by the rig that is named, else by the one that the capture holds."""
    capture = read_capture(path)
    sources = sources_of(capture)
    declared = rig or _rig_in(capture)
    known = {} if declared is None else {source.name: source for source in declared.sources}
    recordings: dict[str, Recording] = {}
    empty: list[str] = []
    for source in sources:
        if declared is None or source.name not in known or not source.delivered:
            continue
        try:
            recordings[source.name] = reader.open(path, declared.declarations(known[source.name]))
        except NoSignalError as error:
            empty.append(f"{source.name}: {error.without_path()}")
    start = next((one.absolute_start for one in recordings.values() if one.absolute_start is not None), None)
    prefix = len(recordings) > 1
    return {
        "schema": "recoil-daq/file/1",
        "file": str(path),
        "bytes": path.stat().st_size,
        "format": reader.name,
        "kind": ", ".join(dict.fromkeys(source.kind for source in sources)),
        "absolute_start": None if start is None else {"text": start.text, "zone": start.zone, "origin": start.origin},
        "signals": _signals_of_all(recordings),
        "tracks": [],
        "incomplete": next((source.incomplete for source in sources if source.incomplete), ""),
        "notes": [
            *(f"{name}: {note}" if prefix else note for name, one in recordings.items() for note in one.notes),
            *empty,
            *([] if declared else ["no rig is named: its sources are not decoded; --rig RIG decodes them"]),
        ],
        "metadata": {
            "acquired": dict(capture.declaration),
            "sources": [
                {
                    "name": source.name,
                    "kind": source.kind,
                    "records": len(source.records),
                    "bytes": sum(len(record.payload) for record in source.records),
                    "events": [asdict(event) for event in source.events],
                }
                for source in sources
            ],
            **{name: dict(recording.metadata) for name, recording in recordings.items()},
        },
    }


def _rig_in(capture: Capture) -> Rig | None:
    """Return the rig that a capture was acquired on; None if it does not hold it, as one of a virtual sensor."""
    if "rig_text" not in capture.session:
        return None
    record = live_record_of(capture.session, capture.path)
    return parse_rig(record.rig_text, Path(record.rig_path), record.databases, refuse_doubts=False)


def _declarations(reader: Reader, path: Path, rig: Rig | None) -> dict[str, Declarations]:
    """Take what a rig declares of the source whose pattern fits, or of the only one of the kind; of all that share it.

    Returns
    -------
    dict of str to Declarations
        Declarations; keys are sources, or the kind where the rig states nothing of the file.
    """
    if rig is not None and reader.kind == LIVE:
        held = {source.name for source in sources_of(read_capture(path))}
        of_capture = {source.name: rig.declarations(source) for source in rig.sources if source.name in held}
        if of_capture:
            return of_capture
    if rig is not None:
        of_kind = [source for source in rig.sources if source.kind == reader.kind]
        fitting = [source for source in rig.matching(path.name) if source.kind == reader.kind] or of_kind
        if len(fitting) == 1 or (fitting and all(source.bus is not None for source in fitting)):
            return {source.name: rig.declarations(source) for source in fitting}
    return {reader.kind: Declarations(reader.kind, database=EMPTY_DATABASE if reader.kind == "can" else None)}


def _signals_of_all(recordings: Mapping[str, Recording]) -> list[dict[str, Any]]:
    """Describe the signals of several sources of one file, each with its source before it; of one without."""
    prefix = len(recordings) > 1
    return [
        {**row, "name": f"{name}: {row['name']}" if prefix else row["name"]}
        for name, recording in recordings.items()
        for row in _signals(recording)
    ]


def _signals(recording: Recording) -> list[dict[str, Any]]:
    """Describe the signals and their instants."""
    rows = []
    for header in recording.signals:
        base = own_base(recording, header.name)
        rows.append(
            {
                "name": header.name,
                "unit": header.unit,
                "samples": base.count,
                "dtype": header.dtype,
                **_instants(base),
                "metadata": dict(header.metadata),
            }
        )
    return rows


def _instants(base: TimeBase) -> Mapping[str, Any]:
    """Describe a time base: even or stamped, its rate, its ends."""
    return {
        "spacing": "even" if base.step_s is not None else "stamped",
        "rate_hz": base.rate_hz if math.isfinite(base.rate_hz) else None,
        "start_s": base.start_s if base.count else None,
        "end_s": base.end_s if base.count else None,
    }
