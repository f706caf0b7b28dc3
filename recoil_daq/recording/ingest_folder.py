"""A folder of many shots' recorded files to shot files: which file is of which shot, by its name or its folder's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ErrorCode, ReadError, RecoilDaqError, StoreError, UnknownFormatError
from recoil_acquisition.files.shot_name import numbers_of
from recoil_acquisition.readers.captured import LIVE
from recoil_acquisition.shot.quality_check import Verdict
from recoil_acquisition.shot.usability import Usability
from recoil_acquisition.store import is_shot_file
from recoil_acquisition.store.shot_log import SHOT_LOG
from recoil_daq.recording.doubles import refused_twice
from recoil_daq.recording.ingest import ingest_files, reader_of, shot_place
from recoil_daq.recording.shot_log_rows import TakenRows, add_row, take_rows
from recoil_daq.terminal.result import Printed, Progress
from recoil_daq.terminal.verdict_line import VerdictLine
from recoil_daq.workers import Workers
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.shots.assemble import match_files
from recoil_rigs.shots.left_out import left_out
from recoil_rigs.tables.rig_tables import SHOT_PLACE

_NO_FILE = "neither a file nor a folder"

FAILED = "failed"
"""State of a shot of which no shot file could be made; all others are those of `Usability`."""


@dataclass(frozen=True)
class ShotOutcome:
    """Outcome of the files of one shot.

    Attributes
    ----------
    files
        Recorded files of the shot.
    path
        Shot file; None if there is none.
    verdict
        Verdict on what the shot is good for, and why; None if there is no shot file.
    started
        Time at which the shot began, ISO 8601; empty if nothing states it.
    error
        Error for which there is no shot file; None if there is one.
    log_fault
        Sentence on why the shot log has no row of the shot, or why that row is not used; empty otherwise.
    """

    shot: str
    files: tuple[Path, ...]
    path: Path | None = None
    verdict: VerdictLine | None = None
    started: str = ""
    error: RecoilDaqError | None = None
    log_fault: str = ""

    @property
    def state(self) -> str:
        """`FAILED`, or a word of `Usability`."""
        return FAILED if self.verdict is None else self.verdict.state.value

    @property
    def worst(self) -> Verdict:
        """Verdict of the worst of its checks."""
        return "fail" if self.verdict is None else self.verdict.worst

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it is not usable, the first reason first."""
        return () if self.verdict is None else self.verdict.reasons

    @property
    def warned(self) -> tuple[str, ...]:
        """Texts of its warnings."""
        return () if self.verdict is None else self.verdict.warned

    @property
    def findings(self) -> list[Mapping[str, Any]]:
        """Findings of its verdict, or its error as the one that there is."""
        found = [] if self.verdict is None else list(self.verdict.findings)
        return found if self.error is None else [*found, self.error.finding()]

    @property
    def first(self) -> str:
        """The first reason, or the first warning where there is none; empty if there is neither."""
        return "" if self.verdict is None else self.verdict.first

    def to_json(self) -> dict[str, Any]:
        """Return its part of the document of ``ingest --batch --json``."""
        return {
            "shot": self.shot,
            "files": [str(file) for file in self.files],
            "file": None if self.path is None else str(self.path),
            "state": self.state,
            "verdict": self.worst,
            "warnings": list(self.warned),
            "reasons": list(self.reasons),
            "findings": self.findings,
            "error": None if self.error is None else str(self.error),
            "log_fault": self.log_fault or None,
        }


@dataclass(frozen=True, repr=False)
class IngestedFolder(Printed):
    """The shots of a folder, and where they were written.

    Attributes
    ----------
    shots
        Outcomes of the shots, in the order of their names.
    left_alone
        Files that are of no shot or of no source, each with a line on why.
    rows
        Rows taken from the shot log beside the recorded files; None if there is no such log.
    """

    rig: Rig
    shots: tuple[ShotOutcome, ...]
    left_alone: Mapping[Path, str]
    rows: TakenRows | None = None

    @property
    def failed(self) -> tuple[ShotOutcome, ...]:
        """Those without a shot file."""
        return tuple(one for one in self.shots if one.state == FAILED)

    @property
    def usable(self) -> bool:
        """Whether all of them are."""
        return all(one.state == Usability.USABLE for one in self.shots)

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``ingest --batch --json``."""
        return {
            "schema": "recoil-daq/ingest-folder/1",
            "rig": self.rig.name,
            "shots": [one.to_json() for one in self.shots],
            "left_alone": [{"file": str(path), "why": why} for path, why in self.left_alone.items()],
            "shot_log": None if self.rows is None else self.rows.to_json(),
        }

    def show(self) -> None:
        """Print a row a shot, the files left alone, and at the end the shots that failed."""
        from recoil_daq.terminal.ingest import print_ingested_folder

        print_ingested_folder(self.to_json())

    def __repr__(self) -> str:
        return f"IngestedFolder({len(self.shots)} shots, {len(self.failed)} failed)"


def ingest_folder(
    rig: Rig,
    folder: str | Path,
    *,
    out: str | Path = "shots",
    overwrite: bool = False,
    accept_incomplete: bool = False,
    without: Sequence[str] = (),
    workers: int | Workers | None = None,
    executor: Executor | None = None,
    progress: Progress = lambda _: None,
) -> IngestedFolder:
    """Turn the recorded files of many shots into a shot file each, and go on past a shot that fails.

    A file that lies in a folder of `folder` is of the shot which that folder is named after, as `simulate` writes
    them. Any other is of the shot whose number is in its name: where its source's ``match`` has ``{shot}``, or as a
    number that stands alone; shot 7 is named ``0007``, as a live one.

    Parameters
    ----------
    out
        Folder of the shot files. Their rows are added to the shot log there; where one has none, and a shot log stands
        in `folder`, the row is taken from that.
    accept_incomplete
        Whether what is there of files that were cut off is taken, as by `recoil_daq.recording.ingest.ingest_files`.
    without
        Sources that are left out of every shot, as there.
    workers, executor
        Workers that share the shots, as `recoil_daq.workers.Workers` takes them.
    progress
        Function called with how many shots are done, and how long the others may take.

    Returns
    -------
    IngestedFolder
        Outcome of every shot, those that failed among them, and each file that is of no shot.

    Raises
    ------
    ReadError
        If there is no such folder, no file of a shot in it, or a shot log in it is at fault.
    """
    place, target = Path(folder), Path(out)
    left_out(rig, without)
    progress("sort the files")
    files = _SortedFiles.of(rig, place, target)
    outcomes = {name: ShotOutcome(name, tuple(files.shots[name]), error=fault) for name, fault in files.faults.items()}
    with Workers.of(workers, executor) as crew:
        if crew.may_repeat and not overwrite:
            # before the first of them is done: a shot file that is there when one is done again is of this run
            for name in files.shots:
                if (there := target / f"{name}.h5").exists():
                    fault = StoreError.exists(there, "choose --out, or --overwrite", "the shot file")
                    outcomes.setdefault(name, ShotOutcome(name, tuple(files.shots[name]), error=fault))
        sound = {name: of_shot for name, of_shot in files.shots.items() if name not in outcomes}
        for name, twice in refused_twice(sound, target, overwrite=overwrite or crew.may_repeat).items():
            outcomes[name] = ShotOutcome(name, tuple(files.shots[name]), error=twice)
        given = [name for name in files.shots if name not in outcomes]
        # what was added decides what a mass is checked against
        rows = take_rows(place, target, given)
        tasks = [
            _Task(
                name, tuple(crew.place(file) for file in files.shots[name]), crew.place(target), rig.text, rig.path,
                tuple(rig.databases.items()), overwrite or crew.may_repeat, accept_incomplete,
                tuple(without),
            )
            for name in given
        ]  # fmt: skip
        for name, done in zip(given, crew.outcomes(_Task.ingested, tasks, given, progress=progress), strict=True):
            if isinstance(done, RecoilDaqError):
                outcomes[name] = ShotOutcome(name, tuple(files.shots[name]), error=done)
                continue
            path = target / f"{name}.h5"
            # the log has one writer
            log_fault = add_row(path, name, done.started) or done.log_fault
            outcomes[name] = replace(done, files=tuple(files.shots[name]), path=path, log_fault=log_fault)
    return IngestedFolder(rig, tuple(outcomes[name] for name in files.shots), files.left_alone, rows)


@dataclass(frozen=True)
class _Task:
    """The files of one shot, and the rig as what can be given to another process."""

    name: str
    files: tuple[Path, ...]
    out: Path
    rig_text: str
    rig_path: Path
    databases: tuple[tuple[str, str], ...]
    overwrite: bool
    accept_incomplete: bool
    without: tuple[str, ...]

    def ingested(self) -> ShotOutcome:
        done = ingest_files(
            _rig(self.rig_text, self.rig_path, self.databases), self.files, shot=self.name, out=self.out,
            overwrite=self.overwrite, accept_incomplete=self.accept_incomplete, log=False, doubles=True,
            without=self.without,
        )  # fmt: skip
        verdict = VerdictLine.of(done.to_json())
        return ShotOutcome(self.name, self.files, done.path, verdict, done.shot.started, None, done.log_fault)


@lru_cache(maxsize=1)
def _rig(text: str, path: Path, databases: tuple[tuple[str, str], ...]) -> Rig:
    return parse_rig(text, path, dict(databases), refuse_doubts=False)


@dataclass(frozen=True)
class _SortedFiles:
    """Files by their shots.

    Attributes
    ----------
    shots
        Files of each shot; keys are the shots' names, in their order.
    faults
        Errors of shots whose files leave a doubt of which shot, or of what, they are; keys are the shots' names.
    left_alone
        Files of no shot or no source, each with a line on why.
    """

    shots: dict[str, list[Path]]
    faults: dict[str, RecoilDaqError]
    left_alone: dict[Path, str]

    @classmethod
    def of(cls, rig: Rig, folder: Path, out: Path) -> _SortedFiles:
        """Sort the files of a folder and of the folders in it.

        Parameters
        ----------
        out
            Folder of the shot files: if it is in there, what is in it is no shot's.

        Raises
        ------
        ReadError
            If the folder cannot be read, or holds no file of a shot.
        """
        found = cls({}, {}, {})
        try:
            entries = [one for one in sorted(folder.iterdir()) if _is_looked_at(one) and not _same(one, out)]
            folders = [one for one in entries if one.is_dir()]
            for one in entries:
                if one.is_file():
                    found._sort(rig, one, folders)
                elif not one.is_dir():
                    found.left_alone[one] = _NO_FILE
            for inside in folders:
                there = [one for one in sorted(inside.iterdir()) if _is_looked_at(one)]
                for one in there:
                    if one.is_file():
                        found._sort(rig, one, folders, inside.name)
                    else:
                        found.left_alone[one] = "a folder in a shot's folder" if one.is_dir() else _NO_FILE
                if not there:
                    found.left_alone[inside] = "an empty folder"
        except OSError as error:
            raise ReadError(f"cannot be read: {error.strerror or error}", path=folder, expected="a folder") from error
        if not found.shots:
            raise ReadError(
                f"no file of a shot of rig {rig.name!r} in this folder",
                path=folder,
                expected=", ".join(f"{source.name} ({source.match or source.kind})" for source in rig.sources),
                found=", ".join(path.name for path in list(found.left_alone)[:8]) or "no files",
                remedy="numbers in the files' names tell their shots, or a folder for each shot",
            )
        return cls({name: found.shots[name] for name in sorted(found.shots)}, found.faults, found.left_alone)

    def _sort(self, rig: Rig, path: Path, folders: Sequence[Path], inside: str | None = None) -> None:
        """Give a file to its shots, of which there should be one; `inside` is the folder that it is in."""
        fault: RecoilDaqError | None = None
        source = None
        if path.suffix == ".h5" and is_shot_file(path):
            self.left_alone[path] = "a shot file"
            return
        if rig.is_own_file(path):
            return
        try:
            kind = reader_of(path, rig).kind
            if kind != LIVE:
                source = rig.source(next(iter(match_files(rig, [(path, kind)]))))
        except RecoilDaqError as error:
            known = bool(rig.matching(path.name)) or not isinstance(error, UnknownFormatError)
            if not known or error.code is ErrorCode.NO_SOURCE:
                self.left_alone[path] = f"{error.problem}{f', {error.found}' if error.found else ''}"
                return
            fault, source = error, next(iter(rig.matching(path.name)), None)
        place = None if source is None else shot_place(source)
        numbers = numbers_of(path, place)
        of_folders = {int(one.name): one.name for one in folders if one.name.isdecimal()}
        names = {of_folders.get(number, f"{number:04d}") for number in numbers}
        if inside is not None:
            # what a folder is named after is no guess, and a number that is in no certain place is one
            names = {inside, *names} if place is not None and inside.isdecimal() else {inside}
        if not names:
            self.left_alone[path] = "no number of a shot in its name"
        if len(names) > 1:
            fault = ReadError(
                f"by its name this file is of the shots {' and '.join(sorted(names))}",
                path=path,
                remedy=f"rename it, or let `match` of its source say where the number stands, with `{SHOT_PLACE}`",
            )
        for name in names:
            self.shots.setdefault(name, []).append(path)
            if fault is not None:
                self.faults.setdefault(name, fault)


def _is_looked_at(path: Path) -> bool:
    return not path.name.startswith((".", SHOT_LOG))


def _same(one: Path, other: Path) -> bool:
    return other.exists() and one.samefile(other)
