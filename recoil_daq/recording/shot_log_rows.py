"""Rows of the shot log: added when a shot is ingested, shown and set by people, applied to the rig."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import ReadError, RecoilDaqError, StoreError, nearest_first
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog, meant_shot, shots_beside
from recoil_acquisition.store.shot_log_row import KNOWN, ShotLogRow
from recoil_daq.terminal.result import Printed

if TYPE_CHECKING:
    from recoil_rigs.rig import Rig

ADDED_MASS = "added_mass_kg"
"""Parameter in a shot's history: mass that was added to the specification when the shot was checked, kg."""


def as_fired(rig: Rig, row: ShotLogRow | None) -> Rig:
    """Return the rig with what a shot's row says: the mass added to the recoiling part, and the muzzle velocity.

    Raises
    ------
    RigError
        If no recoiling part is left, or its muzzle velocity is none.
    """
    if row is None:
        return rig
    if row.muzzle_velocity_m_s is not None:
        rig = rig.with_muzzle_velocity(row.muzzle_velocity_m_s, row.u_muzzle_velocity_m_s)
    if not (row.added_mass_kg or row.u_added_mass_kg):
        return rig
    return rig.with_added_mass(row.added_mass_kg, None if row.added_mass_is_exact else row.u_added_mass_kg)


def as_planned(rig: Rig, shot_file: Path, shot: str) -> tuple[Rig, str]:
    """Return the rig as a shot's row has it that was there before the shot, and why that row cannot be used.

    Returns
    -------
    rig : Rig
        Rig with what the row adds; as it was given where the log has no row of the shot, or is at fault.
    fault : str
        Sentence on why the row cannot be used; empty if it could be, or there is none.
    """
    try:
        return as_fired(rig, ShotLog.beside(shot_file).row(shot)), ""
    except RecoilDaqError as error:
        return rig, f"what it says of shot {shot} is not used: {error}"


def add_row(shot_file: Path, shot: str, started: str) -> str:
    """Add the row of a shot to the log beside its file; rows of other shots are theirs who fired or wrote them.

    What is in the log stays as it is; only an empty time is filled.

    Parameters
    ----------
    started
        Time at which the shot began, ISO 8601; empty if nothing states it.

    Returns
    -------
    str
        Sentence on why the row could not be added; empty if it is there.
    """

    def with_shot(log: ShotLog) -> ShotLog:
        row = log.row(shot)
        if row is None:
            log = log.with_cells(shot, {})
        if started and "time" in log.columns and not (row and row.time):
            log = log.with_cells(shot, {"time": started})
        return log

    try:
        ShotLog.changed(shot_file.parent / SHOT_LOG, with_shot)
    except RecoilDaqError as error:
        return f"the row of shot {shot} is not added: {error}"
    return ""


@dataclass(frozen=True)
class TakenRows:
    """Rows of the shot log beside recorded files, as the log beside the shot files took them.

    Attributes
    ----------
    path
        Log beside the recorded files.
    taken
        Shots whose rows were taken.
    kept
        Cells of rows that were not taken, because the shot has a row that states something else or nothing of them;
        keys are the shots' names.
    """

    path: Path
    taken: tuple[str, ...]
    kept: Mapping[str, Mapping[str, Any]]

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types."""
        kept = {shot: dict(cells) for shot, cells in self.kept.items()}
        return {"file": str(self.path), "taken": list(self.taken), "kept": kept}


def take_rows(beside: Path, folder: Path, shots: Sequence[str]) -> TakenRows | None:
    """Take rows of a log beside recorded files into the log of a folder of shots, where a shot has none there.

    Parameters
    ----------
    beside
        Folder of the recorded files.
    folder
        Folder of the shot files.
    shots
        Names of the shots whose rows are wanted.

    Returns
    -------
    TakenRows or None
        Rows that were taken, and those that were not; None if there is no such log, or it is the one of the folder.

    Raises
    ------
    ReadError, StoreError
        If one of the logs is at fault, or cannot be written.
    """
    given, log = beside / SHOT_LOG, folder / SHOT_LOG
    if not given.exists() or (log.exists() and log.samefile(given)):
        return None
    source = ShotLog.read(given, shots)
    rows = {shot: row for shot in shots if (row := source.row(shot)) is not None and len(row.to_json()) > 1}
    there = ShotLog.read(log, known := shots_beside(log) | set(shots))
    missing = [row for shot, row in rows.items() if there.row(shot) is None]
    if missing:
        folder.mkdir(parents=True, exist_ok=True)
        ShotLog.changed(log, lambda now: _with_rows(now, missing), known)
    kept = {}
    for shot, row in rows.items():
        if (own := there.row(shot)) is not None:
            cells = own.to_json()
            kept[shot] = {name: value for name, value in row.to_json().items() if cells.get(name) != value}
    return TakenRows(given, tuple(row.shot for row in missing), {shot: cells for shot, cells in kept.items() if cells})


def _with_rows(log: ShotLog, rows: Sequence[ShotLogRow]) -> ShotLog:
    for row in rows:
        log = log if log.row(row.shot) is not None else log.with_row(row)
    return log


@dataclass(frozen=True, repr=False)
class Logged(Printed):
    """A shot's row of the shot log.

    Attributes
    ----------
    row
        Row of the shot; None if the log has none.
    columns
        Names of the log's columns.
    cells
        Texts of the row's cells that are not empty; keys are columns.
    before
        Texts that stood in the cells that changed, empty where a cell was; keys are columns.
    """

    path: Path
    shot: str
    row: ShotLogRow | None
    columns: tuple[str, ...]
    cells: Mapping[str, str]
    before: Mapping[str, str]

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``log --json``."""
        return {
            "schema": "recoil-daq/log/1",
            "shot": self.shot,
            "file": str(self.path),
            "columns": list(self.columns),
            "row": None if self.row is None else self.row.to_json(),
            "cells": dict(self.cells),
            "before": dict(self.before),
            "doubts": [] if self.row is None else list(self.row.doubts),
        }

    def show(self) -> None:
        """Print a line for each column, and what was there before."""
        from recoil_daq.terminal.ingest import print_logged

        print_logged(self.to_json())

    def __repr__(self) -> str:
        return f"Logged({self.row!r} in {self.path})"


def log_row(
    shot: str,
    cells: Mapping[str, str] | None = None,
    *,
    folder: Path = Path("shots"),
    new_column: bool = False,
    sure: Callable[[Sequence[str]], bool] = lambda _: True,
) -> Logged:
    """Show or set cells of a shot's row.

    Parameters
    ----------
    shot
        Path of a shot file, or name of a shot in `folder`.
    cells
        Texts to set; keys are columns, an empty text empties the cell. None changes nothing.
    new_column
        Whether a column may be added that the log does not have.
    sure
        Function called with the doubts that the row would have; returns whether the cells are set all the same.

    Raises
    ------
    ReadError, StoreError
        If there is no such shot or column, the log is at fault or cannot be written, or somebody is not sure.
    """
    named = Path(shot)
    is_path = named.suffix == ".h5" or len(named.parts) > 1
    name, folder = (named.stem, named.parent) if is_path else (shot, folder)
    path, were = folder / SHOT_LOG, dict[str, str]()
    there = ShotLog.read(path)
    name = meant_shot(name, {*there.shots, *(row.shot for row in there.rows)})

    def with_given(log: ShotLog) -> ShotLog:
        nonlocal were
        were = log.cells(name)
        _refuse_unknown(log, name, cells or {}, new_column=new_column)
        try:
            return log.with_cells(name, cells) if cells else log
        except ValueError as error:
            raise StoreError(str(error), path=path) from error

    if cells:
        row = with_given(there).row(name)
        # asked before the log is held: others may change it while somebody thinks
        if row is not None and row.doubts and not sure(row.doubts):
            raise StoreError("nothing is set", path=path, remedy="correct what is in doubt")
    log = ShotLog.changed(path, with_given) if cells else with_given(there)
    are = log.cells(name)
    changed = [column for column in log.columns if column != "shot" and were.get(column) != are.get(column)]
    before = {column: were.get(column, "") for column in changed}
    return Logged(log.path, name, log.row(name), log.columns, are, before)


def accept_log(folder: Path) -> None:
    """Take the log of a folder as it is: what it lacks of what a command last saw was taken out.

    Raises
    ------
    ReadError, StoreError
        If it is at fault, or cannot be written.
    """
    ShotLog.changed(folder / SHOT_LOG, lambda log: log, as_it_is=True)


def restore_log(folder: Path) -> None:
    """Put back into the log of a folder what it lacks of what a command last saw.

    Raises
    ------
    ReadError, StoreError
        If it is at fault, or cannot be written, or no command has looked at it.
    """
    ShotLog.restored(folder / SHOT_LOG)


@dataclass(frozen=True, repr=False)
class LoggedShots(Printed):
    """All rows of a shot log.

    Attributes
    ----------
    without_row
        Names of shots that have a file here and no row.
    """

    path: Path
    columns: tuple[str, ...]
    rows: tuple[ShotLogRow, ...]
    cells: tuple[Mapping[str, str], ...]
    without_row: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``log --json`` without a shot."""
        return {
            "schema": "recoil-daq/log/1",
            "file": str(self.path),
            "columns": list(self.columns),
            "rows": [row.to_json() for row in self.rows],
            "cells": [dict(cells) for cells in self.cells],
            "without_row": list(self.without_row),
        }

    def show(self) -> None:
        """Print a row a shot, of the columns that are filled."""
        from recoil_daq.terminal.ingest import print_log

        print_log(self.to_json())

    def __repr__(self) -> str:
        return f"LoggedShots({len(self.rows)} rows in {self.path})"


def log_rows(folder: Path = Path("shots")) -> LoggedShots:
    """List all rows of the shot log of a folder.

    Raises
    ------
    ReadError
        If there is no such folder, or the log is at fault.
    """
    if not folder.is_dir():
        raise ReadError("no such folder", path=folder, remedy="name the folder of the shot files with --dir")
    log = ShotLog.read(folder / SHOT_LOG)
    cells = tuple(log.cells(row.shot) for row in log.rows)
    without = sorted(log.shots - {row.shot for row in log.rows})
    return LoggedShots(log.path, log.columns, log.rows, cells, tuple(without))


def _refuse_unknown(log: ShotLog, shot: str, cells: Mapping[str, str], *, new_column: bool) -> None:
    """Refuse a shot and columns that a log does not have."""
    if not log.cells(shot) and shot not in log.shots:
        known = [*sorted(log.shots), *log.without_shot()]
        raise StoreError(
            f"no shot {shot!r} in this folder, and no row of it in the shot log", path=log.path.parent,
            found=_first(nearest_first(shot, known)) or "no shot", remedy="name its file, or its folder with --dir",
        )  # fmt: skip
    known = list(dict.fromkeys((*KNOWN[1:], *log.columns)))
    for column in cells:
        if column not in known and not new_column:
            raise StoreError(
                f"the shot log has no column {column!r}", path=log.path,
                found=_first(nearest_first(column, [one for one in known if one != "shot"])),
                remedy="correct it, or add the column with --new-column",
            )  # fmt: skip


def _first(names: Sequence[str]) -> str:
    return f"{', '.join(names[:8])}{' and more' if len(names) > 8 else ''}"
