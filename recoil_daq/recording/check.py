"""Faults of a rig file, before the day: in itself, against its databases, and against recorded files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.errors import Fault, FaultCode, KeyPath, MissingChannelError, RecoilDaqError, RigError, Row
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.quantities.quantity import Unit
from recoil_acquisition.readers.own_rows import own_base
from recoil_acquisition.readers.reader import Reader
from recoil_acquisition.readers.recording import Recording, SignalHeader
from recoil_acquisition.remark import Caution, Note, NoteCode, ReasonCode, Severity, findings_of
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import explained_reader_of, match_sources
from recoil_daq.terminal.result import Progress
from recoil_daq.version import __version__
from recoil_processing.quality.limits import LIMITS
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.verdict.mass_reasons import against_the_record
from recoil_processing.shot.verdict.shot_quality import check_shot
from recoil_rigs.checks.plausible import unusual_peak
from recoil_rigs.rig import ChannelSpec, Rig, Source, load_rig
from recoil_rigs.shots.assemble import (
    about_unknown_unit,
    assemble_channels,
    chain_applies,
    find_signal,
    shown_unit,
    si_line,
    unit_of,
    unknown_unit,
)
from recoil_rigs.shots.assumptions import assumption_notes, assumptions_of
from recoil_rigs.shots.can_signals import faults_of_can_signals, shared_names
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.shots.long_recording import cut_long_recordings
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from recoil_rigs.tables.certificate_table import USUAL_NAME as CERTIFICATES
from recoil_rigs.tables.certificate_table import other_certificates
from recoil_rigs.tables.channel_table import range_si

_OF_A_FILE = ("unit", "samples", "rate_hz", "measured_in", "peak", "range")
_AT_ONCE = 1 << 22
"""Number of samples that are looked at at once."""
_REFUSED = (Check.ONSET, Check.FORCE, ReasonCode.ROLE, ReasonCode.NOT_IDENTIFIED)
"""Checks and reasons without which there is no number at all."""
MOST_IDENTIFIERS = 8
"""Number of a file's identifiers that a fault lists."""


@dataclass(frozen=True)
class Checked:
    """A rig without a fault.

    Attributes
    ----------
    rig
        Rig as its file states it.
    files
        Recorded files, each in JSON types: file, source, reader, and the channels of the rig in it with unit, samples,
        rate, largest value and range; the last two in the unit of what is measured.
    warnings
        Values that are unusual, in the rig file and in the recorded files.
    notes
        Parts that were not checked, and why.
    absolute
        Names of the channels whose files state a unit of absolute pressure.
    """

    rig: Rig
    files: tuple[dict[str, Any], ...] = ()
    warnings: tuple[Fault, ...] = ()
    notes: tuple[Note, ...] = ()
    absolute: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``check --json``."""
        warned = [one.finding(Severity.WARN) for one in self.warnings]
        return {
            "schema": "recoil-daq/check/1",
            "rig": self.rig.name,
            "file": str(self.rig.path),
            "faults": [],
            "warnings": [one.to_json() for one in self.warnings],
            "findings": [*warned, *findings_of(self.notes, assumption_notes(self.rig, self.absolute))],
            "notes": list(self.notes),
            "assumptions": assumptions_of(self.rig, self.absolute),
            "sources": [{"name": s.name, "kind": s.kind} for s in self.rig.sources],
            "channels": [
                {
                    "name": c.name,
                    "source": c.source,
                    "signal": c.signal,
                    "role": c.role,
                    "unit": c.unit or None,
                    "u_rel": c.sensor.u_scale_rel if c.sensor.states_u_rel else None,
                    "due": None if c.sensor.due is None else str(c.sensor.due),
                }
                for c in self.rig.channels
            ],
            "files": list(self.files),
        }

    def show(self) -> None:
        """Print the channels, what the recorded files have of them, and what is unusual."""
        from recoil_daq.terminal.check import print_rig

        print_rig(self.to_json())


@on_one_thread
def check_rig(name_or_path: str | Path, files: Sequence[Path] = (), *, progress: Progress = lambda _: None) -> Checked:
    """Look for every fault of a rig, and of recorded files against it.

    A table of certificates that lies beside the rig file is compared with what that states: see
    `recoil_rigs.tables.certificate_table`.

    Parameters
    ----------
    name_or_path
        Rig file, or name of a bundled rig.
    files
        Recorded files of one shot, as `recoil_daq.recording.ingest.ingest_files` takes them; of some sources only, if
        that is all there is.
    progress
        Function called with the name of each file.

    Raises
    ------
    ReadError
        If the rig file cannot be read.
    RigError
        With every fault that was found. Where the rig's own tables are at fault, the files are not looked at.
    """
    rig = load_rig(name_or_path, refuse_doubts=False)
    faults = list(rig.doubts)
    for source in rig.sources:
        faults += faults_of_can_signals(rig, source)
    against = _AgainstFiles(rig, faults, progress)
    if files:
        against.look(files)
    faults += rig.not_calibrated(CalibrationDay.of_start(against.started(), DayOf.TODAY))
    if faults:
        raise RigError(rig.path, faults)
    against.foretell()
    warnings = [*rig.warnings, *(w for source in rig.sources for w in shared_names(rig, source)), *against.warnings]
    table = rig.path.with_name(CERTIFICATES)
    warnings += other_certificates(rig.channels, table) if table.is_file() else []
    return Checked(rig, tuple(against.rows), tuple(warnings), tuple(against.notes), tuple(against.absolute))


class _AgainstFiles:
    """Recorded files against a rig: what is wrong is appended to the faults given."""

    def __init__(self, rig: Rig, faults: list[Fault], progress: Progress) -> None:
        self._rig, self._faults, self._progress = rig, faults, progress
        self.rows: list[dict[str, Any]] = []
        self.warnings: list[Fault] = []
        self.notes: list[Note] = []
        self.absolute: list[str] = []
        self._starts: dict[str, str] = {}
        self._recordings: dict[str, Recording] = {}

    def started(self) -> str:
        """Return when the shot of the files began, as ingest would have it; empty if none of them says."""
        reference = self._starts.get(self._rig.reference_clock, "")
        return reference or next((start for start in self._starts.values() if start), "")

    def look(self, files: Sequence[Path]) -> None:
        """Match files to sources, open them and look for the rig's signals."""
        claimed: list[tuple[Path, Reader]] = []
        matched: dict[str, Path] = {}
        for path in files:
            self._progress(path.name)
            try:
                reader = explained_reader_of(path, self._rig)
                now = match_sources(self._rig, [*claimed, (path, reader)])
            except RecoilDaqError as error:
                self._faults.append(_fault_of_file(path, error))
                continue
            claimed.append((path, reader))
            for name in sorted(now.keys() - matched.keys()):
                self._open(reader, path, self._rig.source(name))
            matched = now
        missing = [source for source in self._rig.sources if source.name not in matched]
        if missing and len(claimed) < len(files):
            # a file that belongs nowhere may be the one that is missing
            given = ", ".join(path.name for path in files)
            for source in missing:
                problem = f"none of the files is of this {source.kind} source; given: {given}"
                self._faults.append(Fault((Row("source", source.name),), problem, FaultCode.FILE))
        elif missing:
            named = ", ".join(f"{source.name} ({source.kind})" for source in missing)
            about = missing[0].name if len(missing) == 1 else None
            text = f"not checked, no file of it was given: {named}"
            self.notes.append(Note(NoteCode.NOT_CHECKED, about, text))

    def _open(self, reader: Reader, path: Path, source: Source) -> None:
        """Open a file of a source and describe its channels."""
        try:
            recording = reader.open(path, self._rig.declarations(source))
        except RecoilDaqError as error:
            self._faults.append(_fault_of_file(path, error))
            return
        self._recordings[source.name] = recording
        start = recording.absolute_start
        self._starts[source.name] = "" if start is None or start.is_doubtful else start.text
        if recording.incomplete:
            self._faults.append(_of_file(path, f"the file was cut off: {recording.incomplete}; copy it again"))
        self.warnings += [_of_file(path, str(note)) for note in recording.notes if isinstance(note, Caution)]
        self._compare_frame_rate(recording, source)
        read = {spec.signal: spec.name for spec in self._rig.channels_of(source.name)}
        self.notes += [
            Note(NoteCode.OWN_RATE, read[note.about], f"{path.name}: {note}")
            for note in recording.notes
            if note.code is NoteCode.OWN_RATE and note.about in read
        ]
        wanted = self._rig.channels_of(source.name)
        if source.database is not None and wanted and not recording.signals:
            self._faults.append(_no_frame_fits(source, recording))
            wanted = ()
        channels = [self._channel(spec, source, recording) for spec in wanted]
        self.rows.append({"file": path.name, "source": source.name, "reader": reader.name, "channels": channels})

    def foretell(self) -> None:
        """Warn of what identification would refuse the shot of the files for, where all that it needs was given."""
        if self._rig.reference_clock not in self._recordings:
            return
        self._progress("verdict")
        try:
            shot = self._judged()
        except RecoilDaqError:
            return  # ingest says it, with its options: a recording of several shots, say
        if any(check.check is Check.FILE for check in shot.failed):
            return
        path = self._recordings[self._rig.reference_clock].path
        failed = (check.remark() for check in shot.failed if check.check in _REFUSED)
        refused = dict.fromkeys(map(str, (*failed, *(one for one in shot.against_mass if one.code in _REFUSED))))
        self.warnings += [_of_file(path, f"identify would find no valid mass: {reason}") for reason in refused]

    def _judged(self) -> Shot:
        """Judge the shot of the files as ingest does."""
        rig, recordings = self._rig, cut_long_recordings(self._rig, self._recordings, None)
        channels = assemble_channels(rig, recordings, __version__)
        shot = Shot("check", rig.name, rig.text, rig.reference_clock, channels, databases=rig.databases)
        alignments = align_clocks(FiredShot(shot, rig))
        day = CalibrationDay.of_start(self.started(), DayOf.TODAY)
        quality = check_shot(FiredShot(shot, rig), alignments, recordings, day)
        judged = replace(shot, alignments=alignments, quality=quality)
        return replace(judged, against_mass=against_the_record(FiredShot(judged, rig)))

    def _compare_frame_rate(self, recording: Recording, source: Source) -> None:
        """Compare the frame rate that the rig declares with that of the file's own times."""
        found_hz = recording.metadata.get("frame_rate_hz")
        if source.frame_rate is None or not isinstance(found_hz, float):
            return
        off, limit = abs(found_hz / source.frame_rate - 1.0), LIMITS["frame_rate_share"]
        if limit.verdict(off) != "ok":
            problem = f"the rig says {source.frame_rate:g} Hz, the times in {recording.path.name} {found_hz:.6g} Hz"
            remedy = "correct it, or export the times of the recording where those are a playback's"
            key = (Row("source", source.name), "frame_rate")
            self._faults.append(Fault(key, f"{problem}; {remedy}", FaultCode.CONTRADICTION))

    def _channel(self, spec: ChannelSpec, source: Source, recording: Recording) -> dict[str, Any]:
        """Describe a channel as its file has it."""
        row: dict[str, Any] = {"name": spec.name, "signal": spec.signal, **dict.fromkeys(_OF_A_FILE)}
        key = (Row("channel", spec.name),)
        try:
            header = find_signal(recording, spec.signal)
            base = own_base(recording, header.name)
        except RecoilDaqError as error:
            self._faults.append(_fault_of_file(recording.path, error, (*key, "signal")))
            return row
        unit = unit_of(spec, header, source, recording.path, self._faults)
        if unit is not None and unknown_unit(spec, header):
            text = about_unknown_unit(spec, header, recording.path)
            self.warnings.append(Fault((*key, "unit"), text, FaultCode.UNIT))
        if unit is not None and unit.is_absolute_pressure:
            self.absolute.append(spec.name)
        rate_hz = base.rate_hz if math.isfinite(base.rate_hz) else None
        if rate_hz is None:
            problem = f"{recording.path.name} has {base.count} samples: no rate"
            self._faults.append(Fault(key, problem, FaultCode.FILE))
        row |= {"unit": header.unit.strip() or spec.unit, "samples": base.count, "rate_hz": rate_hz}
        return row if unit is None else row | self._peak(spec, header, unit, recording)

    def _peak(self, spec: ChannelSpec, header: SignalHeader, unit: Unit, recording: Recording) -> dict[str, Any]:
        """Find the largest value, and lay it beside the range, in the unit of what is measured."""
        if spec.sensitivity is not None and not chain_applies(spec, unit):
            shown = header.unit.strip() or spec.unit
            text = f"{spec.name}: `sensitivity` is not applied: {recording.path.name} is in {shown} already"
            self.notes.append(Note(NoteCode.SENSITIVITY, spec.name, text))
        try:
            peak = _largest(recording, header.name, *si_line(spec, unit))
        except RecoilDaqError as error:
            self._faults.append(_fault_of_file(recording.path, error, (Row("channel", spec.name),)))
            return {}
        (name, own), limits = shown_unit(spec, header.unit, unit, self._rig.read_in), range_si(spec)
        found = {
            "measured_in": name,
            "peak": None if peak is None else own.from_si(peak),
            "range": None if limits is None else [own.from_si(limit) for limit in limits],
        }
        if peak is not None and (problem := unusual_peak(spec, peak, self._rig.mechanism)):
            text = f"{recording.path.name}: {problem}"
            self.warnings.append(Fault((Row("channel", spec.name),), text, FaultCode.UNUSUAL))
        return found


def _largest(recording: Recording, signal: str, factor: float, offset: float) -> float | None:
    """Return the value that lies furthest from zero, SI; None if there is none."""
    largest: float | None = None
    count = recording.time_base(signal).count
    for start in range(0, count, _AT_ONCE):
        values = factor * recording.read(signal, start, min(start + _AT_ONCE, count)) + offset
        values = values[np.isfinite(values)]
        if values.size:
            extreme = float(values[np.abs(values).argmax()])
            largest = extreme if largest is None or abs(extreme) > abs(largest) else largest
    return largest


def _no_frame_fits(source: Source, recording: Recording) -> Fault:
    """Say that a database knows no frame of a file, and which identifiers those have."""
    unknown = recording.metadata.get("unknown_identifiers", {})
    shown = ", ".join(list(unknown)[:MOST_IDENTIFIERS]) + (" .." if len(unknown) > MOST_IDENTIFIERS else "")
    problem = f"{source.database} knows no frame of {recording.path.name}, whose identifiers are {shown}"
    remedy = "it is another bus's database, or another bus's file: `recoil-daq show` lists the messages of a database"
    return Fault((Row("source", source.name), "database"), f"{problem}; {remedy}", FaultCode.CONTRADICTION)


def _fault_of_file(path: Path, error: RecoilDaqError, key: KeyPath = ()) -> Fault:
    """Say an error of a file without the folder that it lies in."""
    if not key:
        return _of_file(path, error.without_path())
    code = FaultCode.UNKNOWN if isinstance(error, MissingChannelError) else FaultCode.FILE
    return Fault(key, f"{path.name}: {error.without_path()}", code)


def _of_file(path: Path, problem: str) -> Fault:
    return Fault((path.name,), problem, FaultCode.FILE, path.name)
