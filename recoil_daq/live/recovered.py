"""Results of recovering journals that a crash left over."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from recoil_rigs.rig import Rig


@dataclass(frozen=True)
class RecoveredShot:
    """One shot of a journal.

    Attributes
    ----------
    path
        Its capture.
    was_there
        Whether it was written before.
    whole
        Whether it holds all that the journal has of the shot.
    shot_file
        Written now or before; None if another instrument's file is missing.
    missing
        Sources that were not recorded live, whose files must be added to make a shot file.
    log_fault
        As of `recoil_daq.ingest.Ingested`; empty if no shot file was written now.
    """

    name: str
    path: Path
    was_there: bool
    whole: bool
    shot_file: Path | None
    missing: tuple[str, ...]
    log_fault: str = ""


@dataclass(frozen=True)
class Outside:
    """A stretch of a journal in which something happened and that is in no shot.

    Attributes
    ----------
    at_s
        What happened first, from the journal's first record.
    utc
        The same by the host's wall clock, ISO 8601.
    lasting_s
        Until what happened last.
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
        Whole records of devices and trigger.
    released_records
        Released while armed: watched, and nothing happened in them.
    lost_records
        Missing before the last that is there.
    damaged_bytes
        In damaged places, or of a record that was being written.
    losses
        What is missing of each source, in words.
    in_order
        Whether the session had ended in order.
    everything
        Capture of all that was recorded, shots and the time between them; None if the session had ended in order.
    everything_whole
        Whether it holds all that the journal does.
    session_by
        The rig file that stood in for what the journal said of its session, and how far its times of day are known;
        empty if the journal says it itself.
    """

    journal: Path
    rig: Rig
    records: int
    released_records: int
    lost_records: int
    damaged_bytes: int
    losses: tuple[str, ...]
    in_order: bool
    everything: Path | None
    everything_whole: bool
    shots: tuple[RecoveredShot, ...]
    outside: tuple[Outside, ...]
    removed: bool
    session_by: str = ""

    @property
    def damaged(self) -> bool:
        """Whether something that was written is not there as it was written."""
        return bool(self.lost_records or self.damaged_bytes)

    @property
    def elsewhere(self) -> bool:
        """Whether all that a person may want of the journal is in captures that were read back."""
        whole = all(shot.whole for shot in self.shots) and self.everything_whole
        return whole and not self.damaged and not self.outside
