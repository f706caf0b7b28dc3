"""Contents of a journal that was left over, as they were recovered: its shots, losses, and what is in no shot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode, Remark, findings_of
from recoil_rigs.rig import Rig


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
    problem
        Sentence on why no shot file can be made of its capture alone; empty if one was, or files must be added first.
    """

    name: str
    path: Path
    was_there: bool
    whole: bool
    shot_file: Path | None
    missing: tuple[str, ...]
    log_fault: str = ""
    problem: str = ""

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
            "problem": self.problem or None,
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
    removal_fault
        Sentence on why the journal, of which everything is in captures, cannot be removed; empty if it can, or is kept.
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
    removal_fault: str = ""

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
            "removal_fault": self.removal_fault or None,
            "shots": [shot.to_json() for shot in self.shots],
            "outside": [asdict(stretch) for stretch in self.outside],
        }


def recovered_document(done: Sequence[Recovered]) -> dict[str, Any]:
    """Return the document of ``recover --json``."""
    return {"schema": "recoil-daq/recover/1", "journals": [one.to_json() for one in done]}
