"""Recorded files to one verified shot file, with a verdict."""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unicodedata import normalize

import numpy as np

from recoil_acquisition.capture.cut import acquisition_of_declaration
from recoil_acquisition.channel import Step
from recoil_acquisition.errors import CorruptFileError, ErrorCode, FileEnd, ReadError, StoreError, UnknownFormatError
from recoil_acquisition.files.regular_file import check_regular
from recoil_acquisition.files.shot_name import numbers_of, shot_name_fault
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.readers.acquired_span import within_the_window
from recoil_acquisition.readers.captured import LIVE, sources_of
from recoil_acquisition.readers.reader import Reader
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.serial.raw_bytes import look_into_file
from recoil_acquisition.readers.table import BY_LAYOUT, reader_by_name, recognise
from recoil_acquisition.shot.acquisition import AT_TRIGGER, Acquisition
from recoil_acquisition.shot.causes import shot_findings
from recoil_acquisition.shot.recorded_file import EXCERPTS, INGEST, RecordedFile
from recoil_acquisition.shot.shot import InputFile, Shot
from recoil_acquisition.store import write_shot
from recoil_daq.recording.doubles import made_in, refusal
from recoil_daq.recording.preview_check import compared_previews, marked_previews, replaced_previews
from recoil_daq.recording.shot_log_rows import ADDED_MASS, add_row, as_planned
from recoil_daq.recording.supposed_file import serial_source
from recoil_daq.terminal.result import Printed, Progress
from recoil_daq.version import __version__
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.verdict.mass_reasons import against_the_record
from recoil_processing.shot.verdict.shot_quality import check_shot
from recoil_rigs.rig import Rig, Source
from recoil_rigs.shots.assemble import assemble_channels, match_files
from recoil_rigs.shots.assumptions import assumptions_of
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.shots.left_out import left_out
from recoil_rigs.shots.long_recording import cut_long_recordings
from recoil_rigs.tables.calibration_day import DAY, DAY_OF, CalibrationDay, DayOf
from recoil_rigs.tables.rig_tables import SHOT_PLACE


@dataclass(frozen=True, repr=False)
class Ingested(Printed):
    """A shot, its rig, and where it was written.

    Attributes
    ----------
    rig
        Rig with the mass that the shot log adds for this shot.
    log_fault
        Sentence on why the shot log has no row of the shot, or why that row is not used; empty otherwise.
    """

    shot: Shot
    rig: Rig
    path: Path
    log_fault: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``ingest --json``."""
        shot = self.shot
        return {
            "schema": "recoil-daq/ingest/1",
            "shot": shot.name,
            "rig": shot.rig_name,
            "file": str(self.path),
            "log_fault": self.log_fault or None,
            "usable": shot.usable,
            "state": shot.state.value,
            "reasons": list(shot.reasons),
            "findings": shot_findings(shot.quality, shot.against_mass, shot.subjects),
            "against_mass": [reason.to_json() for reason in shot.against_mass],
            "assumptions": assumptions_of(self.rig),
            "channels": [
                {
                    "name": c.name,
                    "role": c.role,
                    "clock": c.time_base.clock,
                    "quantity": c.quantity,
                    "unit": c.unit,
                    "samples": c.time_base.count,
                    "lost": int(c.lost.sum()),
                    "rate_hz": c.time_base.rate_hz if math.isfinite(c.time_base.rate_hz) else None,
                    "low": _sample(np.fmin.reduce(c.samples, initial=np.inf)),
                    "high": _sample(np.fmax.reduce(c.samples, initial=-np.inf)),
                }
                for c in shot.channels.values()
            ],
            "alignment": [a.to_json() for a in shot.alignments],
            "quality": [c.to_json() for c in shot.quality],
        }

    def show(self) -> None:
        """Print the verdict: a row per channel and clock, what is taken for granted, usable or not."""
        from recoil_daq.terminal.ingest import print_verdict

        print_verdict(self.to_json())

    def __repr__(self) -> str:
        return f"Ingested({self.shot!r} -> {self.path})"


@on_one_thread
def ingest_files(
    rig: Rig,
    files: Sequence[str | Path],
    *,
    shot: str | None = None,
    out: str | Path = "shots",
    overwrite: bool = False,
    accept_incomplete: bool = False,
    at_s: float | None = None,
    on: dt.date | None = None,
    replaces: str = "",
    log: bool = True,
    doubles: bool = False,
    without: Sequence[str] = (),
    progress: Progress = lambda _: None,
) -> Ingested:
    """Turn one shot's recorded files into a verified shot file, and add its row to the shot log beside it.

    Parameters
    ----------
    files
        Recorded files, one per source of the rig, in any order; recognised by their content. The capture of a live shot
        holds several sources, and how it was acquired.
    shot
        Identifier of the shot; that of the acquisition, the one number that the names of all files share, as
        `recoil_daq.recording.ingest_folder.ingest_folder` names it, or the name of the reference clock's file without
        ending, if left out.
    out
        Folder of the shot file.
    accept_incomplete
        Whether what is there of a file that was cut off is taken, and stated in the verdict.
    at_s
        Instant of the shot on the reference clock, where the recorder's file is longer than the shot. The rig's
        trigger finds it if left out, in a file that is too long to be held whole.
    on
        Day of the shot, which calibrations must cover; that of its start if left out, and that of the ingest where
        nothing states one.
    replaces
        Line on why the shot file that is there is made anew, which its history keeps; empty if none is. It is replaced
        in one step, when the new one is verified.
    log
        Whether the row is added to the shot log; whoever does not adds it later.
    doubles
        Whether the caller has looked for another shot in the folder that was made of the same files; if not, it is
        looked for here.
    without
        Sources that are left out of the shot: they did not fire, or what they recorded is not to be taken. The verdict
        says so, and whether there is a mass without them.
    progress
        Function called with the name of each step.

    Returns
    -------
    Ingested
        Shot with its verdict; a shot that is not usable is written all the same, and so is one whose row cannot be
        added.

    Raises
    ------
    ReadError, RigError, StoreError
        If the data or the rig are at fault, or another shot file of the folder was made of one of the files; nothing
        is written then.
    """
    if shot is not None:
        _check_name(shot)
    progress("recognise")
    left = left_out(rig, without)
    given = [Path(f) for f in files]
    # a file that by its name is of nothing else is not looked at, whatever is in it
    named = {path: {source.name for source in rig.matching(path.name)} for path in given}
    passed = {next(iter(named[path])): path.name for path in given if named[path] and named[path] <= left}
    given = [path for path in given if not named[path] or not named[path] <= left]
    were = {path: _state(path) for path in given}
    claimed = [(path, explained_reader_of(path, rig)) for path in given]
    # held until all of its sources are read
    captures = {path: read_capture(path) for path, reader in claimed if reader.kind == LIVE}
    matched = match_sources(rig, claimed)
    passed |= {source: matched.pop(source).name for source in left if source in matched}
    readers = dict(claimed)
    acquisition = _acquisition_of(list(captures), rig)
    if rig.reference_clock not in matched:
        raise ReadError(
            f"no file of the reference source {rig.reference_clock!r} among those given",
            path=rig.path,
            found=", ".join(f"{path.name} ({reader.name})" for path, reader in readers.items()) or "no files",
            remedy="add its file: all other clocks are aligned to it",
        )
    name = shot or (acquisition.shot if acquisition is not None else _own_name(rig, matched))
    _check_name(name)
    target = Path(out) / f"{name}.h5"
    overwrite = overwrite or bool(replaces)
    if target.exists() and not overwrite:
        # of a long recording that is cut at a given time, another part may be another shot
        made_of = RecordedFile.of_shot(map(InputFile.of, matched.values() if at_s is None else ()), ())
        exists = StoreError.exists(target, "give another --shot, or --overwrite", "the shot file")
        raise refusal(made_of, made_in(target.parent)) or exists
    captured = [source for source, path in matched.items() if path in captures]
    progress("read")
    recordings: dict[str, Recording] = {}
    for source, path in matched.items():
        recordings[source] = readers[path].open(path, rig.declarations(rig.source(source)))
        if recordings[source].incomplete and not accept_incomplete:
            raise CorruptFileError(
                f"the file was cut off: {recordings[source].incomplete}",
                path=path,
                file_end=FileEnd.MISSING,
                remedy="copy it again, or take what is there with --accept-incomplete",
            )
    opened = dict(recordings)
    progress("find the shot")
    recordings = cut_long_recordings(rig, recordings, at_s)
    if acquisition is not None:
        recordings = _of_the_shot(rig, recordings, captured, acquisition)
        matched = {source: matched[source] for source in recordings}
    excerpts = {source: part for source, r in recordings.items() if (part := r.metadata.get("excerpt")) is not None}
    started, started_source = _started(
        acquisition, sorted(recordings.values(), key=lambda r: r is not recordings[rig.reference_clock])
    )
    day = CalibrationDay.of_start(started, DayOf.INGEST) if on is None else CalibrationDay(on, DayOf.GIVEN)
    parameters: dict[str, Any] = {
        "rig": rig.path.name,
        DAY: day.on.isoformat(),
        DAY_OF: day.of.value,
        **({EXCERPTS: excerpts} if excerpts else {}),
        **({"without": sorted(left)} if left else {}),
    }
    inputs = tuple(InputFile.of(path, source, recordings[source].reader) for source, path in matched.items())
    # a capture of which the instruments' own files have all says how the shot was acquired
    inputs += tuple(InputFile.of(path, "", "acquisition") for path in captures if path not in matched.values())
    if not doubles:
        made_of = RecordedFile.of_shot(inputs, (Step(INGEST, __version__, parameters),))
        others = {path: files for path, files in made_in(target.parent).items() if path != target}
        if fault := refusal(made_of, others):
            raise fault
    progress("take the channels")
    channels = assemble_channels(rig, recordings, __version__)
    assembled = Shot(
        name=name,
        rig_name=rig.name,
        rig_text=rig.text,
        reference_clock=rig.reference_clock,
        channels=channels,
        inputs=inputs,
        started=started,
        started_source=started_source,
        databases=rig.databases,
        acquisition=acquisition,
        history=_replacing(target, replaces),
        clock_fits={s: fit for s, r in recordings.items() if (fit := r.metadata.get("clock_fit")) is not None},
    )
    progress("align")
    rig, log_fault = as_planned(rig, target, name)
    alignments = align_clocks(FiredShot(assembled, rig))
    progress("check")
    quality = check_shot(
        FiredShot(assembled, rig), alignments, recordings, day, {name: passed.get(name, "") for name in left},
        replaced_previews(captures, matched),
    )  # fmt: skip
    parameters |= {ADDED_MASS: rig.added_mass_kg} if rig.added_mass_kg else {}
    compared = compared_previews(rig, captures, readers, matched, opened, recordings)
    quality += (*marked_previews(captures, matched), *(check for one in compared for check in one.checks))
    assembled = replace(assembled, history=(*assembled.history, *(one.step(__version__) for one in compared)))
    against_mass = against_the_record(FiredShot(replace(assembled, alignments=alignments, quality=quality), rig))
    finished = assembled.with_results(alignments, quality, Step(INGEST, __version__, parameters), against_mass)
    progress("write")
    _refuse_changed(were)
    written = write_shot(finished, target, overwrite=overwrite)
    return Ingested(written, rig, target, (log and add_row(target, name, started)) or log_fault)


def _of_the_shot(
    rig: Rig, recordings: Mapping[str, Recording], captured: Sequence[str], acquisition: Acquisition
) -> dict[str, Recording]:
    """Leave out what captured sources delivered of times outside the shot's window, and sources with nothing else."""
    found: dict[str, Recording] = {}
    for source, recording in recordings.items():
        if source not in captured:
            found[source] = recording
            continue
        wanted = {recording.aliases.get(spec.signal, spec.signal) for spec in rig.channels_of(source)}
        names = [header.name for header in recording.signals if header.name in wanted]
        part = within_the_window(recording, acquisition, names)
        if part is not None:
            found[source] = part
        elif source == rig.reference_clock:
            raise ReadError(
                f"the reference source {source!r} delivered nothing within the shot's window",
                path=recording.path,
                remedy="find what keeps the host from reading it, and fire again",
            )
    return found


def _sample(value: float) -> float | None:
    """Return an extreme as a number of JSON; None where there is no sample at all."""
    return float(value) if math.isfinite(value) else None


def _own_name(rig: Rig, files: Mapping[str, Path]) -> str:
    """Return the shot's name by its files: the one number that all of them share, else the reference clock's name."""
    shared = frozenset.intersection(
        *(numbers_of(path, shot_place(rig.source(source))) for source, path in files.items())
    )
    # macOS spells a file's name with signs on their own over letters, which no shot's name has
    return f"{min(shared):04d}" if len(shared) == 1 else normalize("NFC", files[rig.reference_clock].stem)


def shot_place(source: Source) -> re.Pattern[str] | None:
    """Return the pattern that says where the number of a shot stands in the names of a source's files, if it does."""
    return source.pattern if SHOT_PLACE in (source.match or "") else None


def _state(path: Path) -> tuple[int, int] | None:
    """Return size and time of change of a file; None if there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def _refuse_changed(were: Mapping[Path, tuple[int, int] | None]) -> None:
    """Refuse files that somebody wrote while they were read: a part of each may be of before."""
    for path, state in were.items():
        if _state(path) != state:
            raise ReadError(
                "was written while it was read", path=path, expected="a file that is complete",
                remedy="ingest it again when it is copied",
            )  # fmt: skip


def _check_name(name: str) -> None:
    """Refuse a name that no shot can bear, before any work is done for it."""
    if fault := shot_name_fault(name):
        raise StoreError(f"the shot's name {name!r} {fault}", remedy="choose another with --shot")


def _replacing(target: Path, why: str) -> tuple[Step, ...]:
    """Return the line of history that says which shot file is made anew, and why; nothing if none is."""
    if not why or not target.exists():
        return ()
    return (Step("replace shot file", __version__, {"why": why, "sha256_before": InputFile.of(target).sha256}),)


def match_sources(rig: Rig, files: Sequence[tuple[Path, Reader]]) -> dict[str, Path]:
    """Match files to the rig's sources: captures by the names of the sources in them, others as `match_files` does.

    An instrument's own file takes the place of what a capture has of it.

    Returns
    -------
    dict of str to Path
        Files in their order; keys are the sources' names.

    Raises
    ------
    ReadError
        If a file fits no source or several, or a source gets two files.
    """
    matched = match_files(rig, [(path, reader.kind) for path, reader in files if reader.kind != LIVE])
    for path in (path for path, reader in files if reader.kind == LIVE):
        there = sources_of(read_capture(path))
        held = {source.name: source for source in there if source.delivered}
        fitting = [s.name for s in rig.sources if s.name in held and held[s.name].kind == s.kind]
        if not fitting:
            raise ReadError(
                f"this capture holds no source of rig {rig.name!r}",
                code=ErrorCode.NO_SOURCE,
                path=path,
                expected=", ".join(f"{source.name} ({source.kind})" for source in rig.sources),
                found=", ".join(f"{source.name} ({source.kind})" for source in there) or "no session that is sound",
                remedy="name the rig that it was acquired on",
            )
        for name in fitting:
            kind = held[name].live_kind
            if name in matched and kind is not None and kind.is_preview:
                continue  # the instrument's own file has all of what was read live
            if name in matched:
                raise ReadError(
                    f"source {name!r} already has {matched[name].name}", path=path, remedy="give one file per source"
                )
            matched[name] = path
    given = [path for path, _ in files]
    return dict(sorted(matched.items(), key=lambda item: given.index(item[1])))


def _acquisition_of(captures: Sequence[Path], rig: Rig) -> Acquisition | None:
    """Return how the shot of a capture was acquired, which must be on the rig; None if no capture says so."""
    found: dict[Path, Acquisition] = {}
    for path in captures:
        try:
            acquisition = acquisition_of_declaration(read_capture(path).declaration)
        except ValueError as error:
            raise CorruptFileError(
                f"its record of the acquisition is damaged: {error}", path=path, remedy="copy the capture again"
            ) from error
        if acquisition is None:
            continue
        if acquisition.rig != rig.name:
            raise ReadError(
                "the shot was acquired on another rig",
                path=path,
                place="rig",
                expected=repr(rig.name),
                found=repr(acquisition.rig),
                remedy="name the rig that it was acquired on",
            )
        found[path] = acquisition
    if len(found) > 1:
        raise ReadError(
            "captures of more than one live shot among the files",
            path=list(found)[1],
            expected="the files of one shot",
            found=", ".join(path.name for path in found),
            remedy="give the one that belongs to the shot",
        )
    return next(iter(found.values()), None)


def _started(acquisition: Acquisition | None, recordings: Sequence[Recording]) -> tuple[str, str]:
    """Return when the shot was, ISO 8601, and where that comes from; both empty if nothing does.

    A live shot was when the host saw its trigger. Any other was when the time of its files began, the first file that
    says so, and that an instrument can have; a date without a zone stays without one.
    """
    if acquisition is not None:
        return acquisition.trigger_utc, AT_TRIGGER
    for recording in recordings:
        start = recording.absolute_start
        if start is None or start.is_doubtful:
            continue
        source = f"{recording.path.name}, {start.origin}"
        moment = start.moment
        if moment is None or moment.tzinfo is None:
            return start.text, f"{source}, unknown zone"
        if dt.datetime.fromisoformat(start.text).tzinfo is None:
            return start.text + ("+00:00" if start.zone == "UTC" else start.zone), source
        return start.text, source
    return "", ""


def reader_of(path: Path, rig: Rig | None) -> Reader:
    """Return the reader of a file: its source's declared layout decides, then the file's name and content.

    Where the name fits the pattern of sources of one kind alone, a reader of that kind that can read the file is taken,
    though the file begins as one of another kind does: a camera's table may begin with time as a recorder's does. A
    table that only its shape speaks for is of the kind of the sources whose pattern fits, or, where none does, of those
    that have no pattern. Raw serial bytes are known by their source's pattern alone, and so is a table whose layout is
    declared; a file that no reader recognises, or one of a kind that no source of the rig is, is of the one source that
    declares a layout and has no pattern.
    """
    check_regular(path)
    matching = () if rig is None else rig.matching(path.name)
    if len(matching) == 1 and matching[0].layout is not None:
        return BY_LAYOUT[matching[0].kind]
    unnamed = [s for s in (() if rig is None else rig.sources) if s.match is None]
    laid_out = [s for s in unnamed if s.layout is not None and not matching]
    try:
        reader = recognise(path, {s.kind for s in matching or unnamed})
        if len(laid_out) == 1 and reader.kind not in (LIVE, *(s.kind for s in unnamed)):
            return BY_LAYOUT[laid_out[0].kind]
        if not matching or reader.kind in (LIVE, *(s.kind for s in matching)):
            return reader
        return reader_by_name(path, {s.kind for s in matching}) or reader
    except UnknownFormatError as error:
        if matching and (named := reader_by_name(path, {s.kind for s in matching})) is not None:
            return named
        if error.candidates:
            raise
        if any(s.kind == "serial" for s in matching):
            return BY_LAYOUT["serial"]
        if len(laid_out) == 1:
            return BY_LAYOUT[laid_out[0].kind]
        raise


def explained_reader_of(path: Path, rig: Rig | None) -> Reader:
    """Return the reader of a file as `reader_of` does; of unknown bytes the error says which framing fits them."""
    try:
        return reader_of(path, rig)
    except UnknownFormatError as error:
        held = None if error.candidates or error.foreign or error.shapes else look_into_file(path)
        if held is None or not held.found:
            raise
        framing = held.framings[0].advice if held.framings else "the `framing` that the device's manual tells"
        remedy = f"declare {serial_source(path, framing)}"
        raise UnknownFormatError(path, [], error.known, found=held.found, remedy=remedy) from error
