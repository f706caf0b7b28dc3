"""Faults of a rig file, before the day: in itself, against its databases, and against recorded files."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import Fault, RecoilDaqError, RigError
from recoil_acquisition.readers.reader import Reader
from recoil_acquisition.readers.recording import Recording
from recoil_daq.ingest import match_sources, reader_of
from recoil_rigs.assemble import find_signal, unit_of
from recoil_rigs.can_signals import faults_of_can_signals
from recoil_rigs.rig import ChannelSpec, Rig, load_rig

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Checked:
    """A rig without a fault.

    Attributes
    ----------
    files
        What the recorded files have of it, in JSON types: file, source, reader, and the channels with unit, samples
        and rate.
    """

    rig: Rig
    files: tuple[dict[str, Any], ...] = ()


def check_rig(name_or_path: str | Path, files: Sequence[Path] = (), *, progress: Progress = lambda _: None) -> Checked:
    """Look for every fault of a rig, and of recorded files against it.

    Parameters
    ----------
    name_or_path
        A rig file, or the name of a bundled rig.
    files
        One shot's, one for each source, as `recoil_daq.ingest.ingest_files` takes them.
    progress
        Told the name of each file.

    Raises
    ------
    ReadError
        If the rig file cannot be read.
    RigError
        With every fault that was found. Where the rig's own tables are at fault, the files are not looked at.
    """
    rig = load_rig(name_or_path, refuse_doubts=False)
    faults = [*rig.doubts, *rig.overdue(dt.date.today())]
    for source in rig.sources:
        faults += faults_of_can_signals(rig, source)
    rows = _against_files(rig, files, faults, progress) if files else []
    if faults:
        raise RigError(rig.path, faults)
    return Checked(rig, tuple(rows))


def _against_files(rig: Rig, files: Sequence[Path], faults: list[Fault], progress: Progress) -> list[dict[str, Any]]:
    """Match files to sources, open them and look for the rig's signals; append what is wrong to `faults`."""
    claimed: list[tuple[Path, Reader]] = []
    matched: dict[str, Path] = {}
    rows = []
    for path in files:
        progress(path.name)
        try:
            reader = reader_of(path, rig)
            now = match_sources(rig, [*claimed, (path, reader)])
        except RecoilDaqError as error:
            faults.append(_fault_of_file(path, error))
            continue
        claimed.append((path, reader))
        for name in sorted(now.keys() - matched.keys()):
            rows += _row(rig, reader, path, name, faults)
        matched = now
    given = ", ".join(path.name for path in files)
    faults += [
        Fault(f"source '{source.name}'", f"none of the files is of this {source.kind} source; given: {given}")
        for source in rig.sources
        if source.name not in matched
    ]
    return rows


def _row(rig: Rig, reader: Reader, path: Path, name: str, faults: list[Fault]) -> list[dict[str, Any]]:
    """Open a file of a source and describe its channels; append what is wrong to `faults`."""
    try:
        recording = reader.open(path, rig.declarations(rig.source(name)))
    except RecoilDaqError as error:
        faults.append(_fault_of_file(path, error))
        return []
    if recording.incomplete:
        faults.append(Fault(path.name, f"the file was cut off: {recording.incomplete}; copy it again"))
    channels = [_channel_row(rig, spec, recording, faults) for spec in rig.channels_of(name)]
    return [{"file": path.name, "source": name, "reader": reader.name, "channels": channels}]


def _channel_row(rig: Rig, spec: ChannelSpec, recording: Recording, faults: list[Fault]) -> dict[str, Any]:
    """Describe a channel as its file has it; append what is wrong to `faults`."""
    row: dict[str, Any] = {"name": spec.name, "signal": spec.signal, "unit": None, "samples": None, "rate_hz": None}
    try:
        header = find_signal(recording, spec.signal)
        base = recording.time_base(header.name)
    except RecoilDaqError as error:
        faults.append(_fault_of_file(recording.path, error, f"channel '{spec.name}'.signal"))
        return row
    unit_of(spec, header, rig.source(spec.source), recording.path, faults)
    rate_hz = base.rate_hz if math.isfinite(base.rate_hz) else None
    if rate_hz is None:
        faults.append(Fault(f"channel '{spec.name}'", f"{recording.path.name} has {base.count} samples: no rate"))
    return row | {"unit": header.unit.strip() or spec.unit, "samples": base.count, "rate_hz": rate_hz}


def _fault_of_file(path: Path, error: RecoilDaqError, key: str = "") -> Fault:
    """Say an error of a file without the folder that it lies in."""
    text = str(error).removeprefix(f"{error.path}: ")
    return Fault(key or path.name, f"{path.name}: {text}" if key else text)
