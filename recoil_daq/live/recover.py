"""Journals that a crash left over: every shot in them as a capture, and everything that was recorded beside.

A journal is removed when all that it holds is in captures that were read back, when nothing in it is damaged, and when
nothing happened in it outside of every shot. Else it stays until a person says otherwise.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.acquisition import Acquisition
from recoil_acquisition.capture.cut import acquisition_in, capture_has, write_everything, write_shot
from recoil_acquisition.capture.late_reads import LateReads
from recoil_acquisition.capture.replay import outrun, replayed
from recoil_acquisition.capture.session_record import (
    KINDS,
    Kept,
    LiveRecord,
    OperatorRecords,
    RecordedSource,
    kept_of,
    live_record_of,
    longer,
    operator_records,
    wall_of_name,
)
from recoil_acquisition.capture.shot_record import acquisition_of
from recoil_acquisition.declaration import checked
from recoil_acquisition.devices.device import Block
from recoil_acquisition.errors import ReadError, RecoilDaqError, StoreError
from recoil_acquisition.host_clock import Anchor
from recoil_acquisition.live_kind import live_kind_of
from recoil_acquisition.log.folder import Log, find_logs, open_log
from recoil_acquisition.log.record import OWN, Kind
from recoil_acquisition.log.segment import SUFFIX
from recoil_acquisition.log.tally import Loss
from recoil_acquisition.new_file import remove_partials
from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode, Remark, findings_of
from recoil_acquisition.trigger import Decision, ShotWindow, Trigger
from recoil_acquisition.trigger.decision import MANUAL
from recoil_daq.live.shot import capture_path, free_number
from recoil_daq.recording.doubles import made_of
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.terminal.result import Progress
from recoil_rigs.live_sources import live_sources
from recoil_rigs.rig import Rig, load_rig, parse_rig

_OF_ALL = (Kind.EVENT, Kind.IDLE)
"""Kinds of records that every source may give."""


@dataclass(frozen=True)
class RecoveredShot:
    """One shot of a journal.

    Attributes
    ----------
    path
        Capture of the shot.
    was_there
        Whether the capture was written before.
    whole
        Whether the capture holds all that the journal has of the shot.
    shot_file
        Shot file, written now or before; None if another instrument's file is missing.
    missing
        Sources that were not recorded live, whose files must be added to make a shot file.
    log_fault
        Sentence on what is wrong with its row of the shot log, as in `recoil_daq.recording.ingest.Ingested`; empty if
        nothing is, or no shot file was written now.
    """

    name: str
    path: Path
    was_there: bool
    whole: bool
    shot_file: Path | None
    missing: tuple[str, ...]
    log_fault: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return its part of the document of ``recover --json``."""
        return {
            "shot": self.name,
            "capture": str(self.path),
            "was_there": self.was_there,
            "whole": self.whole,
            "shot_file": None if self.shot_file is None else str(self.shot_file),
            "missing": list(self.missing),
            "log_fault": self.log_fault or None,
        }


@dataclass(frozen=True)
class Outside:
    """A stretch of a journal in which something happened and that is in no shot.

    Attributes
    ----------
    at_s
        Time of the first event in the stretch, s from the journal's first record.
    utc
        Same time by the host's wall clock, ISO 8601.
    lasting_s
        Time from the first to the last event, s.
    """

    at_s: float
    utc: str
    lasting_s: float
    why: str


@dataclass(frozen=True)
class Recovered:
    """Contents of one journal.

    Attributes
    ----------
    records
        Number of whole records of devices and trigger.
    released_records
        Number of records that were released while armed: watched, and nothing happened in them.
    lost_records
        Number of records missing before the last that is there.
    damaged_bytes
        Number of bytes in damaged places, or of a record that was being written.
    losses
        Sentences on what is missing of each source.
    in_order
        Whether the session had ended in order.
    everything
        Capture of all that was recorded, shots and the time between them; None if the session had ended in order.
    everything_whole
        Whether that capture holds all that the journal does.
    session_by
        Sentence on the rig file that stood in for what the journal states of its session, and on how far its times of
        day are known; empty if the journal states it itself.
    """

    journal: Path
    rig: Rig
    records: int
    released_records: int
    lost_records: int
    damaged_bytes: int
    losses: tuple[Caution, ...]
    in_order: bool
    everything: Path | None
    everything_whole: bool
    shots: tuple[RecoveredShot, ...]
    outside: tuple[Outside, ...]
    removed: bool
    session_by: str = ""

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Remarks on what is missing of it, what the shot log lacks of its shots, and who spoke for its session."""
        faults = (Caution(CautionCode.LOG_FAULT, one.name, one.log_fault) for one in self.shots if one.log_fault)
        session = (Note(NoteCode.SESSION, None, self.session_by),) if self.session_by else ()
        return (*self.losses, *faults, *session)

    @property
    def damaged(self) -> bool:
        """Whether something that was written is not there as it was written."""
        return bool(self.lost_records or self.damaged_bytes)

    @property
    def elsewhere(self) -> bool:
        """Whether all that a person may want of the journal is in captures that were read back."""
        whole = all(shot.whole for shot in self.shots) and self.everything_whole
        return whole and not self.damaged and not self.outside

    def to_json(self) -> dict[str, Any]:
        """Return its part of the document of ``recover --json``."""
        return {
            "journal": str(self.journal),
            "rig": self.rig.name,
            "rig_file": str(self.rig.path),
            "session_by": self.session_by or None,
            "records": self.records,
            "released_records": self.released_records,
            "lost_records": self.lost_records,
            "damaged_bytes": self.damaged_bytes,
            "losses": list(self.losses),
            "findings": findings_of(self.remarks),
            "damaged": self.damaged,
            "in_order": self.in_order,
            "everything": None if self.everything is None else str(self.everything),
            "everything_whole": self.everything_whole,
            "elsewhere": self.elsewhere,
            "removed": self.removed,
            "shots": [shot.to_json() for shot in self.shots],
            "outside": [asdict(stretch) for stretch in self.outside],
        }


def recovered_document(done: Sequence[Recovered]) -> dict[str, Any]:
    """Return the document of ``recover --json``."""
    return {"schema": "recoil-daq/recover/1", "journals": [one.to_json() for one in done]}


def recover_folder(
    folder: Path,
    out: Path | None,
    *,
    keep: bool = False,
    discard: bool = False,
    at_s: Sequence[float] = (),
    rig: Path | str | None = None,
    progress: Progress = lambda _: None,
) -> tuple[list[Recovered], list[RecoilDaqError]]:
    """Recover every journal in a folder or below it that nobody writes.

    Parameters
    ----------
    folder
        Journal, or folder of shots.
    out
        Folder that gets ``captures``, ``recovered`` and shot files; None for that of the session.
    keep
        Whether the journals are left where they are.
    discard
        Whether the journals are removed whatever they still hold.
    at_s
        Instants at which a shot is cut, s from the first record of the journal; there must be one journal only.
    rig
        Rig of the session, for a journal in which all that it states of its session is damaged; else it is not used.
    progress
        Function called with the name of each step.

    Returns
    -------
    done : list of Recovered
    failed : list of RecoilDaqError
        Errors of the journals that could not be recovered, which are left as they were.

    Raises
    ------
    ReadError
        If there is no such folder, or several journals for one instant.
    """
    if not folder.is_dir():
        raise ReadError("no such folder", path=folder, expected="a journal, or a folder with journals in it")
    journals = find_logs(folder)
    if at_s and len(journals) != 1:
        found = ", ".join(journal.name for journal in journals) or "no journal"
        remedy = "name the journal's own folder"
        raise ReadError("`--at` needs one journal", path=folder, expected="one", found=found, remedy=remedy)
    done: list[Recovered] = []
    failed: list[RecoilDaqError] = []
    for journal in journals:
        into = _out_of(journal) if out is None else out
        try:
            one = recover_journal(journal, into, keep=keep, discard=discard, at_s=at_s, rig=rig, progress=progress)
        except RecoilDaqError as error:
            failed.append(error)
        else:
            done.append(one)
    return done, failed


def recover_journal(
    folder: Path,
    out: Path,
    *,
    keep: bool = False,
    discard: bool = False,
    at_s: Sequence[float] = (),
    rig: Path | str | None = None,
    progress: Progress = lambda _: None,
) -> Recovered:
    """Recover one journal; parameters as of `recover_folder`.

    Raises
    ------
    StoreError, RigError, ReadError
        If it cannot be read, its captures cannot be written, or it holds nothing at an instant that is asked for; it is
        left as it was.
    """
    progress(f"read {folder.name}")
    journal = open_log(folder)
    session_by = ""
    if not journal.session:
        journal, session_by = _with_rig(journal, rig)
    record = live_record_of(journal.session, folder)
    acquired = parse_rig(record.rig_text, Path(record.rig_path), record.databases, refuse_doubts=False)
    if acquired.trigger is None:
        raise StoreError("the rig in this journal has no trigger", path=folder)
    survey = journal.survey()
    known = operator_records(journal)
    if not known.in_order:
        known = _decided_on(journal, record, acquired, acquired.trigger, known)
    held, stalls = _delivered(journal, record)
    begin_s, end_s = _extent_s(held)
    for instant_s in at_s:
        if not 0 <= instant_s <= end_s - begin_s:
            raise ReadError(
                f"holds nothing at {instant_s:g} s",
                path=folder,
                expected=f"0 to {end_s - begin_s:.3f} s from its first record",
            )
    windows = (
        *replayed(held, acquired.trigger, known.decisions, stalls, {c.name: c.source for c in acquired.channels}),
        *_earlier(record, out, held, acquired),
    )
    outside = _outside(known, windows, acquired.trigger)
    asked = [window for instant_s in at_s for window in _at(begin_s + instant_s, held, acquired.trigger)]
    shots = []
    for window in (*windows, *asked):
        name = _name_given(known, window) or _name_before(out, window) or f"{free_number(out):04d}"
        progress(f"shot {name}")
        # what a cut had written that the crash interrupted
        path = capture_path(out, name)
        remove_partials(path)
        shots.append(_recover_shot(journal, record, acquired, acquired.trigger, name, window, out, survey.lost_records))
    outside = [one for one in outside if not one.within([(window.start_s, window.stop_s) for window in asked])]
    everything = None if known.in_order else out / "recovered" / f"{folder.name}{SUFFIX}"
    if everything is not None:
        progress("everything")
        _write_everything(journal, known, everything)
    done = Recovered(
        journal=folder,
        rig=acquired,
        records=survey.records,
        released_records=survey.released_records,
        lost_records=survey.lost_records,
        damaged_bytes=survey.damaged_bytes,
        losses=tuple(_loss_in_words(record, loss) for loss in survey.losses),
        in_order=known.in_order,
        everything=everything,
        everything_whole=everything is None or capture_has(journal, everything, None, None),
        shots=tuple(shots),
        outside=tuple(
            Outside(one.first_s - begin_s, _utc(record, one.first_s), one.last_s - one.first_s, one.why)
            for one in outside
        ),
        removed=False,
        session_by=session_by,
    )
    if discard or (done.elsewhere and not keep):
        journal.remove()
        done = replace(done, removed=True)
    return done


def _with_rig(journal: Log, rig: Path | str | None) -> tuple[Log, str]:
    """Return a journal whose session a rig states in place of what is damaged, and how that came about.

    The sources of a session are those of its rig that have a device, in its order: records of another kind than their
    source's are refused.
    """
    if rig is None:
        raise StoreError(
            "what it says of its session is damaged wherever it stands", path=journal.folder,
            remedy="name the rig that it was acquired with: `recoil-daq recover FOLDER --rig FILE`",
        )  # fmt: skip
    loaded = load_rig(rig)
    live = [source for source in loaded.sources if source.device is not None]
    live = live or [source for source in loaded.sources if live_kind_of(source.kind, None) is not None]
    kinds = [live_kind_of(source.kind, source.device) for source in live]
    given = [(*_OF_ALL, *([] if kind is None else [KINDS[kind.block]])) for kind in kinds]
    for one in journal.records():
        if one.source == OWN or (one.source < len(live) and one.kind in given[one.source]):
            continue
        named = f"{live[one.source].name} ({live[one.source].kind})" if one.source < len(live) else "none"
        raise StoreError(
            f"was not acquired with rig {loaded.name!r}", path=journal.folder, place=f"record {one.number}",
            expected=f"what source {one.source} of the rig gives, {named}", found=f"a record of kind {one.kind}",
            remedy="name the rig file as it was on that day",
        )  # fmt: skip
    anchor, known = _anchor_of(journal)
    sources = tuple(RecordedSource.of(source.name, source.kind, source.device) for source in live)
    record = LiveRecord(loaded.name, loaded.text, str(loaded.path), dict(loaded.databases), anchor, sources)
    return replace(journal, session=record.to_json()), f"what it says of its session is damaged: read by {rig}{known}"


def _anchor_of(journal: Log) -> tuple[Anchor, str]:
    """Return an instant on both clocks of the host, and what is to be said of it.

    A record of the clocks states it. Without one, the folder is named after the beginning, which was before the first
    record was appended, and the last file was written at or after its last record: the truth is between the two.
    """
    first = last = None
    for one in journal.records():
        if one.source == OWN and one.kind == Kind.CLOCK:
            try:
                return checked(Anchor, one.said), ""
            except ValueError:
                continue
        # one that waited for more than an hour was read then, and no more is known of when it was appended
        seen = one.host_ns if one.logged_ns is None else one.logged_ns
        first, last = (seen if first is None else first), seen
    begun = wall_of_name(journal.folder.name)
    if begun is None or first is None or last is None:
        raise StoreError(
            "no record of the host's clocks is sound, and the folder is not named after its beginning: when it was is"
            " not known", path=journal.folder, remedy="give the folder back its name, such as 20261120T081244.120000Z",
        )  # fmt: skip
    written = max(segment.path.stat().st_mtime_ns for segment in journal.segments)
    within = max(written - begun - (last - first), 0) // 2
    note = f"; no record of the host's clocks is sound: its times of day are known within {within / 1e9:.3g} s"
    return Anchor(begun + within, first, within), note


def _out_of(journal: Path) -> Path:
    """Return the folder of shots that a session with this journal wrote to."""
    return journal.parent.parent if journal.parent.name == "journal" else journal.parent


def _decided_on(
    journal: Log, record: LiveRecord, rig: Rig, trigger: Trigger, known: OperatorRecords
) -> OperatorRecords:
    """Return what the session knew with the triggers that it had recorded and not yet decided on."""
    # a rig that was corrected since may have lost a device
    lost: dict[str, dict[str, Any]] = {
        source.name: {} for source in record.sources if rig.source(source.name).device is None
    }
    sources = live_sources(rig, lost)
    named = [source for source in sources if source.name in {one.name for one in record.sources}]
    found = outrun(named, trigger, _blocks(journal, record), known.decisions)
    return replace(known, decisions=(*known.decisions, *found))


def _blocks(journal: Log, record: LiveRecord) -> Iterator[Block | None]:
    """Yield every block of a journal in its order, and None where a record is missing."""
    following = 0
    for one in journal.records():
        if one.number != following:
            yield None
        following = one.number + 1
        if one.source != OWN:
            yield record.block(one)


def _delivered(
    journal: Log, record: LiveRecord
) -> tuple[dict[str, list[tuple[float, float]]], list[tuple[str, float, float]]]:
    """Return from when to when each source is in a journal, and what was read late: since when it may have arrived."""
    held: dict[str, list[tuple[float, float]]] = {source.name: [] for source in record.sources}
    late, stalls = LateReads(), []
    for one in journal.records():
        if one.source == OWN:
            continue
        block = record.block(one)
        since_s = late.since_s(block)
        if block.is_data:
            spans = held[block.source]
            spans[:] = [(spans[0][0] if spans else one.host_ns / 1e9, one.host_ns / 1e9)]
        if since_s is not None:
            stalls.append((block.source, since_s, one.host_ns / 1e9))
    return held, stalls


def _extent_s(held: Mapping[str, Sequence[tuple[float, float]]]) -> tuple[float, float]:
    """Return the first and the last instant of all sources together; 0 and 0 if there is none."""
    spans = [span for spans in held.values() for span in spans]
    return min((begin for begin, _ in spans), default=0.0), max((end for _, end in spans), default=0.0)


def _at(
    trigger_s: float, held: Mapping[str, Sequence[tuple[float, float]]], trigger: Trigger
) -> tuple[ShotWindow, ...]:
    """Return the window of a shot that a person asks for."""
    decision = Decision(trigger_s, "trigger", "", "", MANUAL, MANUAL, None, trigger_s)
    return replayed(held, trigger, [decision])


def _earlier(
    record: LiveRecord, out: Path, held: Mapping[str, Sequence[tuple[float, float]]], rig: Rig
) -> tuple[ShotWindow, ...]:
    """Return the windows of shots that a person had cut out of this journal before."""
    begin_s, end_s = _extent_s(held)
    windows: list[ShotWindow] = []
    for path in sorted((out / "captures").glob(f"*{SUFFIX}")):
        made = acquisition_in(path)
        if made is None or rig.trigger is None or not begin_s <= made.trigger_ns / 1e9 <= end_s:
            continue
        by_hand = made.recovered and any(d.outcome == "trigger" and not d.channel for d in made.decisions)
        if by_hand and made.trigger_utc == _utc(record, made.trigger_ns / 1e9):
            windows += _at(made.trigger_ns / 1e9, held, rig.trigger)
    return tuple(windows)


def _outside(known: OperatorRecords, windows: Sequence[ShotWindow], trigger: Trigger) -> list[Kept]:
    """Return what happened outside of all shots, in the order of time."""
    kept: list[Kept] = []
    for decision in known.decisions:
        one = kept_of(decision, trigger)
        kept = kept if one is None else longer(kept, one)
    spans = [(window.start_s, window.stop_s) for window in windows]
    return sorted((one for one in (*kept, *known.kept) if not one.within(spans)), key=lambda one: one.first_s)


def _utc(record: LiveRecord, host_s: float) -> str:
    wall_ns = record.anchor.wall_of(round(host_s * 1e9))
    utc = dt.datetime(1970, 1, 1) + dt.timedelta(microseconds=wall_ns // 1000)
    return utc.isoformat(timespec="microseconds")


def _name_given(known: OperatorRecords, window: ShotWindow) -> str:
    """Return the name that the session gave to this very shot; empty if it gave none."""
    return next((s.shot for s in known.shots if abs(s.trigger_s - window.trigger_s) < 1e-6), "")


def _name_before(out: Path, window: ShotWindow) -> str:
    """Return the name under which an earlier recovery wrote this very shot; empty if none did."""
    for path in sorted((out / "captures").glob(f"*{SUFFIX}")):
        if _captured_before(path, round(window.trigger_s * 1e9)) is not None:
            return path.stem
    return ""


def _recover_shot(
    journal: Log,
    record: LiveRecord,
    rig: Rig,
    trigger: Trigger,
    name: str,
    window: ShotWindow,
    out: Path,
    lost_records: int,
) -> RecoveredShot:
    path = capture_path(out, name)
    trigger_ns = round(window.trigger_s * 1e9)
    span_ns = round(window.start_s * 1e9), round(window.stop_s * 1e9)
    acquisition = _captured_before(path, trigger_ns)
    was_there = acquisition is not None
    if acquisition is None:
        while path.exists():
            name = f"{name}-recovered"
            path = capture_path(out, name)
        begun = acquisition_of(name, record, trigger, window, {}, lost_records=lost_records, recovered=True)
        acquisition = write_shot(journal, record, path, begun, *span_ns)
    whole = capture_has(journal, path, *span_ns)
    has = {source.name for source in acquisition.sources if source.file}
    live = {source.name for source in record.sources}
    missing = tuple(s.name for s in rig.sources if rig.channels_of(s.name) and s.name not in live)
    shot_file, log_fault = out / f"{name}.h5" if (out / f"{name}.h5").exists() else made_of(path, out), ""
    if shot_file is None and not missing and rig.reference_clock in has:
        ingested = ingest_files(rig, [path], shot=name, out=out, accept_incomplete=True)
        shot_file, log_fault = ingested.path, ingested.log_fault
    return RecoveredShot(name, path, was_there, whole, shot_file, missing, log_fault)


def _captured_before(path: Path, trigger_ns: int) -> Acquisition | None:
    """Return how this very shot was acquired, by the capture that the session had written of it."""
    acquisition = acquisition_in(path)
    return acquisition if acquisition is not None and acquisition.trigger_ns == trigger_ns else None


def _write_everything(journal: Log, known: OperatorRecords, path: Path) -> None:
    """Write a capture of all that was recorded, once."""
    if not path.exists():
        write_everything(journal, path, {"decisions": [asdict(decision) for decision in known.decisions]})


def _loss_in_words(record: LiveRecord, loss: Loss) -> Caution:
    """Say what is missing of a source, and when it arrived."""
    source = record.sources[loss.source].name if loss.source < len(record.sources) else None
    name = "the journal itself" if source is None else source
    when = ""
    if loss.from_ns is not None and loss.until_ns is not None:
        when = f", from {_utc(record, loss.from_ns / 1e9)} on for {(loss.until_ns - loss.from_ns) / 1e9:.3f} s"
    return Caution(CautionCode.LOSS, source, f"{name}: {loss.records} records, {loss.bytes} bytes{when}")
