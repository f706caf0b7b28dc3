"""A stored shot as it was fired: its file, and its row of the shot log beside it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.shot import InputFile, Shot
from recoil_acquisition.store import read_shot
from recoil_acquisition.store.shot_log import ShotLog, ShotLogRow
from recoil_daq.logged import ADDED_MASS, as_fired
from recoil_processing.shot.verdict.motion_quality import against_specification
from recoil_rigs.rig import Rig, parse_rig


@dataclass(frozen=True)
class Fired:
    """A stored shot as it was fired: with what the shot log beside its file says of it.

    Attributes
    ----------
    rig
        With the mass that was added for this shot.
    row
        None if the log has none of it.
    log_file
        None if there is no log.
    notes
        What a reader should know of the row.
    """

    shot: Shot
    rig: Rig
    row: ShotLogRow | None
    log_file: InputFile | None
    notes: tuple[str, ...]


def read_fired(path: Path) -> Fired:
    """Read a shot file and its row of the shot log.

    Raises
    ------
    StoreError
        If the file is no shot file.
    ReadError
        If the shot log is at fault.
    RigError
        If the rig stored in the shot file is at fault, or the log leaves no recoiling part of it.
    """
    shot = read_shot(path)
    log = ShotLog.beside(path)
    row = log.row(shot.name)
    bare = parse_rig(shot.rig_text, path, shot.databases or {}, refuse_doubts=False)
    rig = as_fired(bare, row)
    checked = next(
        (step.parameters.get(ADDED_MASS, 0.0) for step in reversed(shot.history) if step.what == "ingest"), 0.0
    )
    if rig.added_mass_kg != checked:
        shot = against_specification(shot, rig)
    log_file = None
    if log.sha256 is not None:
        log_file = InputFile(log.path.name, log.sha256, len(log.sheet.content()), "shot log", "spreadsheet")
    return Fired(shot, rig, row, log_file, tuple(_notes_on(shot.name, bare, log, row)))


def _notes_on(shot: str, bare: Rig, log: ShotLog, row: ShotLogRow | None) -> Iterator[str]:
    if row is not None and row.exclude:
        yield f"excluded in the shot log: {row.exclude}"
    if row is not None and row.u_added_mass_kg and "m3" not in bare.mechanism.u:
        yield "the rig declares no u_m3: the specification is taken as uncertain by the added mass alone"
    if row is None and log.sha256 is not None:
        others = ", ".join(log.without_shot()[:8])
        beside = f"; its rows {others} are of no shot here" if others else ""
        yield f"{log.path.name} has no row of shot {shot}: nothing is taken as added to the recoiling part{beside}"


def described(path: Path) -> InputFile:
    """Describe a shot file for the provenance of what is made of it."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return InputFile(path.name, digest, path.stat().st_size, "", "shot file")
