"""What is in an instrument's file, and which formats there are."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.readers.reader import Declarations, Reader
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import BY_LAYOUT, TableReader, readers
from recoil_acquisition.timebase import TimeBase
from recoil_daq.ingest import reader_of
from recoil_rigs.rig import Rig

EMPTY_DATABASE = 'VERSION ""\n'
"""Of a CAN log that is shown without a rig: every identifier is unknown to it, and so is listed."""


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
    path : Path
    rig : Rig, optional
        Declares what the file does not carry: a CAN database, a framing, a frame rate, a layout.

    Raises
    ------
    ReadError
        If no reader or more than one claims the file, it is damaged, or it needs what only a rig declares.
    """
    recording, kind = _opened(path, rig)
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
    path : path
    rig : Rig, optional
        Declares what the file does not carry: a CAN database, a framing, a frame rate, a layout.

    Raises
    ------
    ReadError
        As `summarise_file`.
    """
    return _opened(Path(path), rig)[0]


def _opened(path: Path, rig: Rig | None) -> tuple[Recording, str]:
    reader = reader_of(path, rig)
    return reader.open(path, _declarations(reader, path, rig)), reader.kind


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
    span_s = base.end_s - base.start_s if base.count else 0.0
    rate_hz = (base.count - 1) / span_s if base.count > 1 and span_s > 0 else None
    return {
        "spacing": "even" if base.step_s is not None else "stamped",
        "rate_hz": 1.0 / base.step_s if base.step_s is not None else rate_hz,
        "start_s": base.start_s if base.count else None,
        "end_s": base.end_s if base.count else None,
    }
