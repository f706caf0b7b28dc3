"""A file that no reader recognises, by the framing of its bytes or the layout of its table that it seems to have.

Nothing of it is taken for granted: a rig declares the framing or the layout before a shot is made of such a file. What
is found is shown, and proposed to whoever writes the rig.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError, UnknownFormatError
from recoil_acquisition.files.regular_file import read_beginning
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations, Reader
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.serial.fitting import MOST_BYTES
from recoil_acquisition.readers.serial.frame_fields import find_fields
from recoil_acquisition.readers.serial.raw_bytes import RawBytes, look_into
from recoil_acquisition.readers.table import BY_LAYOUT, recognise
from recoil_acquisition.readers.text.proposed_layout import propose_layout

_UNKNOWN_RATE_HZ = 1000.0
"""Samples per second by which signals are listed whose rate nothing tells."""


@dataclass(frozen=True)
class SupposedFraming:
    """Framing that the bytes of a port seem to have.

    Attributes
    ----------
    table
        Framing as a rig has it, without ``fields`` where only a manual tells them; None where none was found.
    found_in_bytes
        Whether its fields were found in the bytes alone, and so have no names and units of their own.
    found
        Sentences on what was found; empty if nothing was.
    held
        Framings and marks that were found.
    """

    table: Mapping[str, Any] | None
    found_in_bytes: bool
    found: tuple[str, ...]
    held: RawBytes


def supposed_framing(stream: bytes, duration_s: float | None = None) -> SupposedFraming:
    """Find the framing of the bytes of a port.

    Parameters
    ----------
    duration_s
        Time that the host took to read them; None if that is not known.
    """
    held = look_into(stream)
    found = (held.found,) if held.found else ()
    best = next(iter(held.framings), None)
    if best is None or best.is_ready_made:
        return SupposedFraming(None if best is None else best.table, False, found, held)
    fields = find_fields(best.table, stream, duration_s)
    if fields is None:
        lacking = (
            "neither values, a counter nor a clock are found in the frames: the device's manual tells the `fields`"
        )
        return SupposedFraming(best.table, False, (*found, lacking), held)
    return SupposedFraming(fields.framing, True, (*found, fields.found), held)


@dataclass(frozen=True)
class SupposedRecording:
    """Recording of a file as it seems to be.

    Attributes
    ----------
    recording
        Opened file; None where no signal is known.
    lacking
        Key of the framing or layout that no byte tells: ``fields``, ``rate_hz`` or ``time_unit``; empty if none lacks.
        Where a rate or a unit of time lacks, the instants of the samples are not known.
    """

    recording: Recording | None
    lacking: str = ""


def open_port(path: Path, reader: Reader, clock: str, framing: Mapping[str, Any]) -> SupposedRecording:
    """Open the bytes of a port by a framing.

    Raises
    ------
    ReadError
        If not one frame fits, or the file is damaged.
    """
    if not ({"ready_made", "fields", "frames"} & framing.keys()):
        return SupposedRecording(None, "fields")
    try:
        recording = reader.open(path, Declarations(clock, framing=framing))
        _ = [recording.time_base(one.name) for one in recording.signals]
    except ReadError as error:
        if "rate_hz" in framing:
            raise
        try:
            recording = reader.open(path, Declarations(clock, framing={**framing, "rate_hz": _UNKNOWN_RATE_HZ}))
        except ReadError:
            raise error from None
        return SupposedRecording(recording, "rate_hz")
    return SupposedRecording(recording)


def open_table(path: Path, clock: str, layout: Mapping[str, Any], *, lacks_unit: bool) -> SupposedRecording:
    """Open a table of text by a layout that may lack what no line of it tells.

    Parameters
    ----------
    lacks_unit
        Whether the unit of the column of time is not known.

    Raises
    ------
    ReadError
        If the rows do not fit, or the file is damaged.
    """
    known, lacking = dict(layout), ""
    if "time_column" not in layout and "rate_hz" not in layout:
        known["rate_hz"], lacking = _UNKNOWN_RATE_HZ, "rate_hz"
    elif lacks_unit:
        known["time_unit"], lacking = "s", "time_unit"
    return SupposedRecording(BY_LAYOUT["dewetron"].open(path, Declarations(clock, layout=known)), lacking)


@dataclass(frozen=True)
class SupposedFile:
    """A file that no reader recognises, as it seems to be.

    Attributes
    ----------
    kind
        Kind of its source.
    format_name
        Name of what it seems to be.
    recording
        Signals, see `SupposedRecording`.
    tables
        ``framing`` or ``layout`` by which it is read.
    advice
        Declaration of a rig by which it is read, in a sentence.
    found
        Sentences on what was found.
    """

    kind: str
    format_name: str
    recording: SupposedRecording
    tables: Mapping[str, Any]
    advice: str
    found: tuple[str, ...]


def supposed_file(path: Path, error: UnknownFormatError) -> SupposedFile | None:
    """Look what a file seems to be that no reader recognises; None if nothing useful is found in it.

    Parameters
    ----------
    error
        Error by which it was not recognised; a file of a format that is known and not read seems nothing.
    """
    if error.candidates or error.foreign:
        return None
    try:
        return _by_shape(path) if error.shapes else _port_file(path) or _table_file(path)
    except ReadError:
        return None


def reader_by_shape(path: Path) -> Reader:
    """Return the reader of a table that its shape alone speaks for: a recorder's, then a camera's.

    Raises
    ------
    UnknownFormatError
        If it is of neither.
    """
    try:
        return recognise(path, {"dewetron"})
    except UnknownFormatError:
        return recognise(path, {"camera"})


def _by_shape(path: Path) -> SupposedFile:
    reader = reader_by_shape(path)
    recording = SupposedRecording(reader.open(path, Declarations(reader.kind)))
    advice = f'a rig says whose it is: a source with `kind = "{reader.kind}"` and a `match` of the file\'s name'
    return SupposedFile(reader.kind, reader.name, recording, {}, advice, ("its shape alone says what it is",))


def _port_file(path: Path) -> SupposedFile | None:
    framing = supposed_framing(read_beginning(path, MOST_BYTES))
    if not framing.held.found:
        return None
    best = next(iter(framing.held.framings), None)
    declared = "the `framing` that the device's manual tells" if best is None else best.advice
    recording = SupposedRecording(None, "fields")
    if framing.table is not None:
        recording = open_port(path, BY_LAYOUT["serial"], "serial", framing.table)
    advice = f"a rig declares {serial_source(path, declared)}"
    tables = {} if framing.table is None else {"framing": framing.table}
    return SupposedFile("serial", "bytes of a port", recording, tables, advice, framing.found)


def serial_source(path: Path, framing: str) -> str:
    """Return the declaration of a source of bytes, as a part of a sentence."""
    match = f"*{path.suffix}" if path.suffix else path.name
    return f'a source with `kind = "serial"`, `match = "{match}"` and {framing}'


def _table_file(path: Path) -> SupposedFile | None:
    proposed = propose_layout(Head.of(path).lines)
    if proposed is None:
        return None
    recording = open_table(path, "recorder", proposed.table, lacks_unit=bool(proposed.lacking))
    found = ("nothing in it says what program wrote it; its layout as found here",)
    tables = {"layout": proposed.table}
    return SupposedFile("dewetron", "table of text", recording, tables, f"a rig declares {proposed}", found)
