"""Journals that a crash left over: every shot in them as captures, and everything that was recorded beside."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from daq.acquisition import Acquisition, read_acquisition, write_acquisition
from daq.capture.cut import Cut, write_captures
from daq.capture.engine import replayed
from daq.capture.session_record import LiveRecord, live_record_of, operator_records
from daq.capture.shot_record import acquisition_of
from daq.devices.device import EVENT
from daq.errors import CorruptFileError, ReadError, RecoilDaqError, StoreError
from daq.journal import Journal, find_journals, read_journal
from daq.trigger import Decision, ShotWindow, Trigger
from recoil_daq.ingest import ingest_files
from recoil_daq.live_shot import free_number
from rigs.rig import Rig, parse_rig

Progress = Callable[[str], None]


@dataclass(frozen=True)
class RecoveredShot:
    """One shot of a journal.

    Attributes
    ----------
    name : str
    folder : Path
        Of its captures.
    files : tuple of Path
        Its captures and the record of its acquisition.
    was_there : bool
        Whether they were written before the crash.
    shot_file : Path or None
        Written now or before; None if another instrument's file is missing.
    missing : tuple of str
        Sources that were not recorded live, whose files must be added to make a shot file.
    """

    name: str
    folder: Path
    files: tuple[Path, ...]
    was_there: bool
    shot_file: Path | None
    missing: tuple[str, ...]


@dataclass(frozen=True)
class Recovered:
    """What was in one journal.

    Attributes
    ----------
    journal : Path
    rig : Rig
    records : int
        Whole records of devices and trigger.
    lost_records : int
        Missing between two that are there.
    cut_bytes : int
        Of records that were being written, or are damaged.
    in_order : bool
        Whether the session had ended in order.
    everything : Path or None
        Folder of all that was recorded, shots and the time between them; None if the session had ended in order.
    shots : tuple of RecoveredShot
    removed : bool
        Whether the journal was removed: all that it held is in verified captures.
    """

    journal: Path
    rig: Rig
    records: int
    lost_records: int
    cut_bytes: int
    in_order: bool
    everything: Path | None
    shots: tuple[RecoveredShot, ...]
    removed: bool


def recover_folder(
    folder: Path, out: Path | None, *, keep: bool = False, progress: Progress = lambda _: None
) -> tuple[list[Recovered], list[RecoilDaqError]]:
    """Recover every journal in a folder or below it that nobody writes.

    Parameters
    ----------
    folder : Path
        A journal, or a folder of shots.
    out : Path or None
        Gets ``captures``, ``recovered`` and shot files; where the session had them if None.
    keep : bool
        Leave the journals where they are.
    progress : callable
        Told the name of each step.

    Returns
    -------
    done : list of Recovered
    failed : list of RecoilDaqError
        Why others could not be: they are left as they were.

    Raises
    ------
    ReadError
        If there is no such folder.
    """
    if not folder.is_dir():
        raise ReadError("no such folder", path=folder, expected="a journal, or a folder with journals in it")
    done: list[Recovered] = []
    failed: list[RecoilDaqError] = []
    for journal in find_journals(folder):
        try:
            done.append(
                recover_journal(journal, _out_of(journal) if out is None else out, keep=keep, progress=progress)
            )
        except RecoilDaqError as error:
            failed.append(error)
    return done, failed


def recover_journal(folder: Path, out: Path, *, keep: bool = False, progress: Progress = lambda _: None) -> Recovered:
    """Recover one journal; parameters as of `recover_folder`.

    Raises
    ------
    StoreError, RigError, ReadError
        If it cannot be read, or its captures cannot be written; it is left as it was.
    """
    progress(f"read {folder.name}")
    journal = read_journal(folder)
    record = live_record_of(journal)
    rig = parse_rig(record.rig_text, Path(record.rig_path), record.databases, refuse_doubts=False)
    if rig.trigger is None:
        raise StoreError("the rig in this journal has no trigger", path=folder)
    decisions, known, in_order = operator_records(journal)
    windows = replayed(_held(journal, record), rig.trigger, decisions)
    shots = []
    for window in windows:
        given = (s.shot for s in known if abs(s.trigger_s - window.trigger_s) < 1e-6)
        name = next(given, "") or _name_before(out, window) or f"{free_number(out):04d}"
        progress(f"shot {name}")
        # what a cut had written that the crash interrupted
        shutil.rmtree(out / "captures" / f".{name}.cut", ignore_errors=True)
        shutil.rmtree(out / "captures" / f"..{name}.cut.partial", ignore_errors=True)
        shots.append(_recover_shot(journal, record, rig, rig.trigger, name, window, out))
    everything = None
    if not in_order:
        progress("everything")
        everything = _everything(journal, record, decisions, out / "recovered" / folder.name)
    if not keep:
        journal.remove()
    return Recovered(
        journal=folder,
        rig=rig,
        records=journal.count,
        lost_records=journal.lost_records,
        cut_bytes=journal.cut_bytes,
        in_order=in_order,
        everything=everything,
        shots=tuple(shots),
        removed=not keep,
    )


def _out_of(journal: Path) -> Path:
    """Return the folder of shots that a session with this journal wrote to."""
    return journal.parent.parent if journal.parent.name == "journal" else journal.parent


def _held(journal: Journal, record: LiveRecord) -> dict[str, list[tuple[float, float]]]:
    """Return from when to when each source is in a journal."""
    held: dict[str, list[tuple[float, float]]] = {}
    for number, source in enumerate(record.sources):
        times = [r.host_ns for r in journal.records(number) if record.block(r).kind != EVENT]
        held[source.name] = [(times[0] / 1e9, times[-1] / 1e9)] if times else []
    return held


def _name_before(out: Path, window: ShotWindow) -> str:
    """Return the name under which an earlier recovery wrote this very shot; empty if none did."""
    for folder in sorted((out / "captures").glob("*")):
        if _captured_before(folder, folder.name, round(window.trigger_s * 1e9)) is not None:
            return folder.name
    return ""


def _recover_shot(
    journal: Journal, record: LiveRecord, rig: Rig, trigger: Trigger, name: str, window: ShotWindow, out: Path
) -> RecoveredShot:
    folder = out / "captures" / name
    trigger_ns = round(window.trigger_s * 1e9)
    acquisition = _captured_before(folder, name, trigger_ns)
    was_there = acquisition is not None
    if acquisition is None:
        while folder.exists():
            name = f"{name}-recovered"
            folder = out / "captures" / name
        made: list[Acquisition] = []

        def also(into: Path, cuts: Mapping[str, Cut]) -> None:
            made.append(
                acquisition_of(
                    name, record, trigger, window, cuts, {}, lost_records=journal.lost_records, recovered=True
                )
            )
            write_acquisition(made[0], into / f"{name}_acquisition.json")

        write_captures(journal, record, folder, name, round(window.start_s * 1e9), round(window.stop_s * 1e9), also)
        acquisition = made[0]
    present = [source for source in acquisition.sources if source.file]
    files = (*(folder / source.file for source in present), folder / f"{name}_acquisition.json")
    has = {source.name for source in present}
    live = {source.name for source in record.sources}
    missing = tuple(s.name for s in rig.sources if rig.channels_of(s.name) and s.name not in live)
    shot_file = out / f"{name}.h5" if (out / f"{name}.h5").exists() else None
    if shot_file is None and not missing and rig.reference_clock in has:
        shot_file = ingest_files(rig, files, shot=name, out=out).path
    return RecoveredShot(name, folder, files, was_there, shot_file, missing)


def _captured_before(folder: Path, name: str, trigger_ns: int) -> Acquisition | None:
    """Return the record of captures that the session had written of this very shot."""
    path = folder / f"{name}_acquisition.json"
    if not path.exists():
        return None
    try:
        acquisition = read_acquisition(path)
    except (ReadError, CorruptFileError):
        return None
    return acquisition if acquisition.trigger_ns == trigger_ns else None


def _everything(journal: Journal, record: LiveRecord, decisions: tuple[Decision, ...], folder: Path) -> Path:
    """Write all that was recorded, once."""
    if folder.exists():
        return folder

    def also(into: Path, cuts: Mapping[str, Cut]) -> None:
        document: dict[str, Any] = {
            "schema": "recoil-daq/recovered/1",
            "session": record.to_json(),
            "decisions": [asdict(decision) for decision in decisions],
            "events": {
                name: [{"host_ns": host_ns, **asdict(event)} for host_ns, event in cut.events]
                for name, cut in cuts.items()
            },
            "records": journal.count,
            "lost_records": journal.lost_records,
            "cut_bytes": journal.cut_bytes,
        }
        (into / f"{folder.name}.json").write_text(json.dumps(document, indent=1), encoding="utf-8")

    write_captures(journal, record, folder, folder.name, None, None, also)
    return folder
