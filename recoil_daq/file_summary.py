"""Summary of an instrument's file, and the formats that are read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from recoil_acquisition.capture.session_record import live_record_of
from recoil_acquisition.log.capture import Capture, read_capture
from recoil_acquisition.readers.captured import LIVE, sources_of
from recoil_acquisition.readers.reader import Declarations, Reader
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import BY_LAYOUT, TableReader, readers
from recoil_acquisition.timebase import TimeBase
from recoil_daq.ingest import reader_of
from recoil_rigs.rig import Rig, parse_rig

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


def summarise_file(path: Path, rig: Rig | None = None) -> dict[str, Any]:
    """Say what is in an instrument's file, in JSON types; sums and samples are left to `ingest`.

    Parameters
    ----------
    rig
        Declares what the file does not carry: a CAN database, a framing, a frame rate, a layout.

    Raises
    ------
    ReadError
        If no reader or more than one claims the file, it is damaged, or it needs what only a rig declares.
    """
    reader = reader_of(path, rig)
    if reader.kind == LIVE:
        return _summarise_capture(path, reader, rig)
    recording, kind = reader.open(path, _declarations(reader, path, rig)), reader.kind
    start = recording.absolute_start
    return {
        "schema": "recoil-daq/file/1",
        "file": str(path),
        "bytes": path.stat().st_size,
        "format": recording.reader,
        "kind": kind,
        "absolute_start": None if start is None else {"text": start.text, "zone": start.zone, "origin": start.origin},
        "signals": _signals(recording),
        "tracks": [track.name for track in recording.tracks()],
        "incomplete": recording.incomplete,
        "notes": list(recording.notes),
        "metadata": dict(recording.metadata),
    }


def open_recording(path: str | Path, rig: Rig | None = None) -> Recording:
    """Open a file of any instrument: its signals are listed, samples are read when they are asked for.

    Parameters
    ----------
    rig
        Declares what the file does not carry: a CAN database, a framing, a frame rate, a layout.

    Raises
    ------
    ReadError
        As `summarise_file`.
    """
    reader = reader_of(Path(path), rig)
    return reader.open(Path(path), _declarations(reader, Path(path), rig))


def _summarise_capture(path: Path, reader: Reader, rig: Rig | None) -> dict[str, Any]:
    """Say what is in a capture, by the rig that is named, else by the one that the capture holds."""
    capture = read_capture(path)
    sources = sources_of(capture)
    declared = rig or _rig_in(capture)
    known = {} if declared is None else {source.name: source for source in declared.sources}
    recordings = {
        source.name: reader.open(path, declared.declarations(known[source.name]))
        for source in sources
        if declared is not None and source.name in known and source.delivered
    }
    start = next((one.absolute_start for one in recordings.values() if one.absolute_start is not None), None)
    prefix = len(recordings) > 1
    return {
        "schema": "recoil-daq/file/1",
        "file": str(path),
        "bytes": path.stat().st_size,
        "format": reader.name,
        "kind": ", ".join(dict.fromkeys(source.kind for source in sources)),
        "absolute_start": None if start is None else {"text": start.text, "zone": start.zone, "origin": start.origin},
        "signals": [
            {**row, "name": f"{name}: {row['name']}" if prefix else row["name"]}
            for name, recording in recordings.items()
            for row in _signals(recording)
        ],
        "tracks": [],
        "incomplete": next((source.incomplete for source in sources if source.incomplete), ""),
        "notes": [
            *(f"{name}: {note}" if prefix else note for name, one in recordings.items() for note in one.notes),
            *([] if declared else ["no rig is named: its sources are not decoded"]),
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


def _declarations(reader: Reader, path: Path, rig: Rig | None) -> Declarations:
    """Take what a rig declares of the source whose pattern fits, or of the only one of the kind."""
    if rig is not None:
        of_kind = [source for source in rig.sources if source.kind == reader.kind]
        fitting = [source for source in rig.matching(path.name) if source.kind == reader.kind] or of_kind
        if len(fitting) == 1:
            return rig.declarations(fitting[0])
    return Declarations(reader.kind, database=EMPTY_DATABASE if reader.kind == "can" else None)


def _signals(recording: Recording) -> list[dict[str, Any]]:
    """Describe the signals and their instants."""
    rows = []
    for header in recording.signals:
        base = recording.time_base(header.name)
        rows.append(
            {
                "name": header.name,
                "unit": header.unit,
                "samples": header.sample_count,
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
