"""A stored shot as it was fired: its file, its row of the shot log beside it, and what was corrected of its rig."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.remark import Note, NoteCode
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.shot import ClockAlignment, InputFile, Shot
from recoil_acquisition.store import read_shot
from recoil_acquisition.store.shot_log import ShotLog
from recoil_acquisition.store.shot_log_row import ShotLogRow
from recoil_daq.recording.shot_log_rows import ADDED_MASS, as_fired
from recoil_daq.version import __version__
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.verdict.corrected_quality import judged_anew
from recoil_processing.shot.verdict.motion_quality import against_specification
from recoil_processing.shot.verdict.shot_quality import calibration_checks
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.shots.rig_correction import Correction, corrected_channels, corrections
from recoil_rigs.tables.calibration_day import DAY_OF, CalibrationDay
from recoil_rigs.tables.issue import NOTHING_STATED, SHOT, Issue, read_header

RIG_FILE = "rig file"
"""Source of a corrected rig file among the inputs of a report."""
HEADER_FILE = "header file"
"""Source of a header file among the inputs of a report."""
LOG_FILE = "shot log"
"""Source of the shot log among the inputs of a report."""
BESIDE = (LOG_FILE, RIG_FILE, HEADER_FILE)
"""Sources of what is read beside a shot file."""
ROUNDING = 1e-6
"""Share of its standard uncertainty by which an offset may differ and still be the same."""


@dataclass(frozen=True, eq=False)
class StoredShot(FiredShot):
    """A stored shot as it was fired, with the row of the shot log beside its file.

    Channels are as the corrected rig has them, where one is given; the rig has the mass that was added for the shot.

    Attributes
    ----------
    row
        Row of the shot log; None if the log has none of the shot.
    log_file
        Shot log; None if there is none.
    notes
        Remarks on the row and on the corrections for a reader.
    rig_file
        Corrected rig file; None if the rig is the one that the shot was recorded with.
    rig_text
        Text of the corrected rig file.
    corrections
        Differences of the corrected rig from the stored one.
    header, header_file
        Identity of the report by a header file, and that file; nothing and None where there is none.
    """

    row: ShotLogRow | None
    log_file: InputFile | None
    notes: tuple[Note, ...]
    rig_file: InputFile | None = None
    rig_text: str | None = None
    corrections: tuple[Correction, ...] = ()
    header: Issue = NOTHING_STATED
    header_file: InputFile | None = None

    @property
    def issued(self) -> Issue:
        """Identity of the report: that of the header file, and of the rig what that leaves out.

        ReadError as of `recoil_rigs.tables.issue.Issue.named`.
        """
        return self.header.over(self.rig.report).named(SHOT, self.shot.name)

    @property
    def beside(self) -> tuple[InputFile, ...]:
        """Files that were read beside the shot file, for the provenance."""
        return tuple(file for file in (self.log_file, self.rig_file, self.header_file) if file is not None)


def read_stored(
    path: Path, rig_file: str | Path | None = None, *, header: Path | None = None, judge: bool = True
) -> StoredShot:
    """Read a shot file and its row of the shot log, and correct its rig.

    Parameters
    ----------
    rig_file
        Corrected rig file; None for the rig that is in the shot file.
    header
        Header file with the identity of the report, see `recoil_rigs.tables.issue`; None for that of the rig.
    judge
        Whether the verdict is made anew where added mass or corrections change what it hangs on.

    Raises
    ------
    StoreError
        If the file is no shot file.
    ReadError
        If the shot log is at fault.
    RigError
        If the rig stored in the shot file or the corrected one is at fault, the log leaves no recoiling part of it, or
        the corrected one differs by more than corrections: with every such difference.
    ReadError
        If there is no such rig file.
    """
    shot, bare = _stored(path)
    log = ShotLog.beside(path)
    fired = _as_logged(shot, bare, log.row(shot.name), judge=judge)
    if log.sha256 is not None:
        log_file = InputFile(log.path.name, log.sha256, len(log.sheet.content()), LOG_FILE, "spreadsheet")
        fired = replace(fired, log_file=log_file, notes=(*fired.notes, *_notes_on_log(shot.name, log)))
    if header is not None:
        fired = replace(fired, header=read_header(header), header_file=InputFile.of(header, HEADER_FILE, "TOML"))
    if rig_file is None:
        return fired
    corrected = load_rig(rig_file)
    return _corrected(fired, bare, corrected, InputFile.of(corrected.path, RIG_FILE, "TOML"), judge=judge)


def read_stored_again(
    path: Path, row: ShotLogRow | None, log_file: InputFile | None, rig_file: InputFile | None, rig_text: str | None
) -> StoredShot:
    """Read a shot file with the row of the shot log and the corrected rig that an earlier report says of it.

    Parameters
    ----------
    log_file, rig_file
        Shot log and corrected rig file, as that report describes them; None where there was none.
    rig_text
        Text of the corrected rig file.

    Raises
    ------
    StoreError
        If the file is no shot file.
    RigError
        If the rig stored in the shot file or the corrected one is at fault.
    """
    shot, bare = _stored(path)
    fired = replace(_as_logged(shot, bare, row, judge=True), log_file=log_file)
    if rig_file is None or rig_text is None:
        return fired
    # the CAN databases are no correction: they are those of the shot file
    corrected = parse_rig(rig_text, Path(rig_file.name), shot.databases or {})
    return _corrected(fired, bare, corrected, rig_file, judge=True)


def fired_in_memory(
    shot: Shot, corrected: Rig | None = None, row: ShotLogRow | None = None, header: Path | None = None
) -> StoredShot:
    """Return a shot as it was fired that is in memory, by its own rig or a corrected one.

    Parameters
    ----------
    row
        Row of a shot log that says what was added; None if nothing was added to it.
    header
        Header file with the identity of the report; None for that of the rig.

    Raises
    ------
    RigError
        If the shot's rig is at fault, no recoiling part is left, or the corrected rig differs by more than corrections.
    ReadError
        If the header file is at fault.
    """
    bare = parse_rig(shot.rig_text, Path(f"rig of shot {shot.name}"), shot.databases or {}, refuse_doubts=False)
    fired = _as_logged(shot, bare, row, judge=True)
    if header is not None:
        fired = replace(fired, header=read_header(header), header_file=InputFile.of(header, HEADER_FILE, "TOML"))
    if corrected is None:
        return fired
    text = corrected.text.encode("utf-8")
    file = InputFile(corrected.path.name, hashlib.sha256(text).hexdigest(), len(text), RIG_FILE, "TOML")
    return _corrected(fired, bare, corrected, file, judge=True)


def _stored(path: Path) -> tuple[Shot, Rig]:
    shot = read_shot(path)
    rig = parse_rig(shot.rig_text, path, shot.databases or {}, refuse_doubts=False)
    if DAY_OF not in _checked(shot):  # an earlier version judged calibrations by the day of the ingest
        others = tuple(one for one in shot.quality if one.check is not Check.CALIBRATION)
        shot = replace(shot, quality=(*others, *calibration_checks(rig, CalibrationDay.of_shot(shot))))
    return shot, rig


def _as_logged(shot: Shot, bare: Rig, row: ShotLogRow | None, *, judge: bool) -> StoredShot:
    """Take what the shot log's row says of a shot."""
    rig = as_fired(bare, row)
    if judge and rig.added_mass_kg != _checked(shot).get(ADDED_MASS, 0.0):
        shot = against_specification(FiredShot(shot, rig))
    return StoredShot(shot, rig, row, None, tuple(_notes_on_row(bare, row)))


def _corrected(fired: StoredShot, bare: Rig, corrected: Rig, rig_file: InputFile, *, judge: bool) -> StoredShot:
    """Apply a corrected rig to a shot.

    Parameters
    ----------
    bare
        Rig as the shot file has it, without what was added.
    rig_file
        File of the corrected rig.
    """
    found = corrections(bare, corrected)
    file = rig_file.name
    fired = replace(fired, rig_file=rig_file, rig_text=corrected.text, corrections=found)
    if not found:
        text = f"{file} says nothing but what the shot file's rig says: nothing was corrected"
        return replace(fired, notes=(Note(NoteCode.CORRECTION, file, text), *fired.notes))
    rig = as_fired(corrected, fired.row)
    shot = replace(fired.shot, channels=corrected_channels(fired.shot.channels, bare, corrected, __version__))
    notes = [Note(NoteCode.CORRECTION, file, f"corrected by {file}: {one}") for one in found]
    shot = replace(shot, alignments=align_clocks(FiredShot(shot, rig)))
    were = {alignment.clock: alignment for alignment in fired.shot.alignments}
    moved = [one.clock for one in shot.alignments if one.clock not in were or _moved(were[one.clock], one)]
    if moved:
        text = f"aligned anew with what was corrected: {', '.join(moved)}"
        notes.append(Note(NoteCode.CORRECTION, file, text))
    if judge:
        shot, kept = judged_anew(fired, FiredShot(shot, rig), CalibrationDay.of_shot(shot))
        if kept:
            text = f"of the verdict these are kept as ingest found them, with the rig as it was: {', '.join(kept)}"
            notes.append(Note(NoteCode.CORRECTION, file, text))
    return replace(fired, shot=shot, rig=rig, notes=(*notes, *fired.notes))


def _moved(one: ClockAlignment, other: ClockAlignment) -> bool:
    """Whether two alignments of a clock differ by more than rounding."""
    return one.status != other.status or abs(other.offset_s - one.offset_s) > ROUNDING * other.u_offset_s


def _checked(shot: Shot) -> Mapping[str, Any]:
    """Return with which parameters a shot was checked when it was ingested."""
    return next((step.parameters for step in reversed(shot.history) if step.what == "ingest"), {})


def _notes_on_row(bare: Rig, row: ShotLogRow | None) -> Iterator[Note]:
    if row is not None:
        for doubt in row.doubts:
            yield Note(NoteCode.LOG_ROW, row.shot, f"the shot log of shot {row.shot}: {doubt}")
    if row is not None and row.exclude:
        yield Note(NoteCode.LOG_ROW, row.shot, f"excluded in the shot log: {row.exclude}")
    u = bare.mechanism.u
    if row is not None and row.u_added_mass_kg and "m3" not in u and not u.get("carried_mass"):
        text = "the rig declares no u_m3: the specification is taken as uncertain by the added mass alone"
        yield Note(NoteCode.SPECIFICATION, "m3", text)


def _notes_on_log(shot: str, log: ShotLog) -> Iterator[Note]:
    if log.row(shot) is None:
        others = ", ".join(log.without_shot()[:8])
        beside = f"; its rows {others} are of no shot here" if others else ""
        nothing = "nothing is taken as added to the recoiling part"
        yield Note(NoteCode.NO_LOG_ROW, log.path.name, f"{log.path.name} has no row of shot {shot}: {nothing}{beside}")
