"""Journals that a crash left over: every shot in them as a capture, and everything that was recorded beside.

A journal is removed when all that it holds is in captures that were read back, when nothing in it is damaged, and when
nothing happened in it outside of every shot. Else it stays until a person says otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from recoil_acquisition.capture.cut import acquisition_in, capture_has, write_everything, write_shot
from recoil_acquisition.capture.replay import replayed
from recoil_acquisition.capture.session_record import (
    LiveRecord,
    OperatorRecords,
    live_record_of,
    operator_records,
)
from recoil_acquisition.capture.shot_record import acquisition_of
from recoil_acquisition.errors import ReadError, RecoilDaqError, StoreError
from recoil_acquisition.files.new_file import remove_partials
from recoil_acquisition.log.folder import Log, find_logs, open_log
from recoil_acquisition.log.segment import SUFFIX, is_being_written
from recoil_acquisition.log.tally import Loss
from recoil_acquisition.remark import Caution, CautionCode
from recoil_acquisition.shot.acquisition import Acquisition
from recoil_acquisition.trigger import ShotWindow, Trigger
from recoil_daq.live.journal_windows import (
    delivered,
    extent_s,
    outside_of,
    utc_of,
    window_at,
    windows_by_hand,
    with_outrun,
)
from recoil_daq.live.recovered import Outside, Recovered, RecoveredShot
from recoil_daq.live.shot import capture_path, free_number
from recoil_daq.live.stand_in_session import with_rig
from recoil_daq.recording.doubles import made_of
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.terminal.result import Progress
from recoil_rigs.rig import Rig, parse_rig


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
            _refuse_in_use(into)
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
        journal, session_by = with_rig(journal, rig)
    record = live_record_of(journal.session, folder)
    acquired = parse_rig(record.rig_text, Path(record.rig_path), record.databases, refuse_doubts=False)
    if acquired.trigger is None:
        raise StoreError("the rig in this journal has no trigger", path=folder)
    survey = journal.survey()
    known = operator_records(journal)
    if not known.in_order:
        known = with_outrun(journal, record, acquired, acquired.trigger, known)
    held, stalls = delivered(journal, record)
    begin_s, end_s = extent_s(held)
    for instant_s in at_s:
        if not 0 <= instant_s <= end_s - begin_s:
            raise ReadError(
                f"holds nothing at {instant_s:g} s",
                path=folder,
                expected=f"0 to {end_s - begin_s:.3f} s from its first record",
            )
    windows = (
        *replayed(held, acquired.trigger, known.decisions, stalls, {c.name: c.source for c in acquired.channels}),
        *windows_by_hand(record, out, held, acquired),
    )
    outside = outside_of(known, windows, acquired.trigger)
    asked = [window for instant_s in at_s for window in window_at(begin_s + instant_s, held, acquired.trigger)]
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
            Outside(one.first_s - begin_s, utc_of(record, one.first_s), one.last_s - one.first_s, one.why)
            for one in outside
        ),
        removed=False,
        session_by=session_by,
    )
    if discard or (done.elsewhere and not keep):
        try:
            journal.remove()
        except StoreError as error:
            if discard:
                raise
            return replace(done, removal_fault=str(error))  # on a disk that is only read: it is recovered all the same
        done = replace(done, removed=True)
    return done


def _refuse_in_use(out: Path) -> None:
    """Refuse a folder that a live session writes to: its shots take the same numbers, and their captures those names.

    Raises
    ------
    StoreError
        If there is one.
    """
    if is_being_written(out / "journal"):
        raise StoreError(
            "a live session writes to this folder", path=out,
            remedy="end it first, or give what is recovered a folder of its own with --out",
        )  # fmt: skip


def _out_of(journal: Path) -> Path:
    """Return the folder of shots that a session with this journal wrote to."""
    return journal.parent.parent if journal.parent.name == "journal" else journal.parent


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
    missing = tuple(s.name for s in rig.sources if rig.channels_of(s.name) and s.required and s.name not in live)
    shot_file, log_fault = out / f"{name}.h5" if (out / f"{name}.h5").exists() else made_of(path, out), ""
    problem = ""
    if shot_file is None and not missing and rig.reference_clock in has:
        try:
            ingested = ingest_files(rig, [path], shot=name, out=out, accept_incomplete=True)
        except RecoilDaqError as error:  # it ends this shot file; the capture is there, and so are the other shots
            problem = str(error)
        else:
            shot_file, log_fault = ingested.path, ingested.log_fault
    return RecoveredShot(name, path, was_there, whole, shot_file, missing, log_fault, problem)


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
        when = f", from {utc_of(record, loss.from_ns / 1e9)} on for {(loss.until_ns - loss.from_ns) / 1e9:.3f} s"
    return Caution(CautionCode.LOSS, source, f"{name}: {loss.records} records, {loss.bytes} bytes{when}")
