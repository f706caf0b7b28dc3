"""A report made again from its shot file, with everything as the report says it was made."""

from __future__ import annotations

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Self

from recoil_acquisition.errors import ReadError, RecoilDaqError
from recoil_acquisition.files.regular_file import read_beginning, read_small, require_name
from recoil_acquisition.files.strict_json import read_json, told_in_one_line
from recoil_acquisition.remark import Note, NoteCode
from recoil_acquisition.shot import InputFile
from recoil_acquisition.store.shot_log import ShotLog
from recoil_acquisition.store.shot_log_row import ShotLogRow
from recoil_daq.arguments import named_report
from recoil_daq.reports.drawings import Draw, Drawings, strangers
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.identify import report_pages, reported
from recoil_daq.reports.stored_shot import BESIDE, HEADER_FILE, LOG_FILE, RIG_FILE, StoredShot, read_stored_again
from recoil_daq.reports.sweep import sweeps_again
from recoil_daq.reports.targets import files_of, find_target, target_pages, target_reported
from recoil_daq.terminal.result import Progress
from recoil_daq.version import __version__
from recoil_identification.report.html import PAGE_NAME
from recoil_identification.report.paper import FIGURES_FOLDER, PDF_FILE
from recoil_identification.report.report_files import (
    CURVES_FILE,
    LARGEST_REPORT,
    REPORT_FILE,
    SEAL,
    TRACE_FILE,
    computer,
    digest_of,
    refuse_deep,
)
from recoil_identification.report.report_files import SCHEMA as REPORT_SCHEMA
from recoil_identification.report.reproduction import Comparison, Difference, compare, compare_tables
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_identification.targets import target_function, target_names
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_document import SCHEMA as TARGET_SCHEMA
from recoil_rigs.tables.issue import Issue

BESIDES = ("provenance.version", "provenance.computer", "provenance.outputs", f"provenance.{SEAL}")
"""Key paths of a report that are compared in another way, or state what may differ."""
FINDINGS = "findings"
"""Key of a report that earlier versions did not write."""
SHOTS = "shots"
"""Usual folder of shot files."""
ANEW = "identify the shot anew"
MOST_OF_A_TABLE = 2
"""Times the size of a file made again, beyond which the one beside a report is not read: it is another one."""


@dataclass(frozen=True)
class Ingredient:
    """A file that a document was made of, by its name and digest then.

    Attributes
    ----------
    paths
        Paths at which it may be now; one with its digest is taken, else the first that is there.
    absent
        Words for its state if it is nowhere there.
    since
        Function that says more of one that has changed.
    named
        Paths that somebody named: what lies there is told, also if another copy was taken.
    """

    name: str
    sha256: str
    paths: tuple[Path, ...]
    absent: str
    since: Callable[[Path], str] = lambda _: ""
    named: tuple[Path, ...] = ()

    def states(self) -> Iterator[dict[str, Any]]:
        """Say whether it is still as it was, with ``file``, ``sha256``, ``found``, ``sha256_now`` and ``state``."""
        for path, now in _digests(self.named):
            if now != self.sha256:
                yield self._state(path, now, "another file than the report was made of")
        there = _digests(self.paths)
        same = next((found for found in there if found[1] == self.sha256), None)
        if same is not None:
            yield self._state(*same, "as it was")
        elif there:
            yield self._state(*there[0], f"changed since{self.since(there[0][0])}")
        else:
            yield self._state(None, None, self.absent)

    def _state(self, path: Path | None, now: str | None, state: str) -> dict[str, Any]:
        found = None if path is None else str(path)
        return {"file": self.name, "sha256": self.sha256, "found": found, "sha256_now": now, "state": state}


def _digests(paths: Iterable[Path]) -> list[tuple[Path, str]]:
    return [(path, InputFile.of(path).sha256) for path in paths if path.is_file()]


@dataclass(frozen=True, eq=False)
class Again:
    """A document made again.

    Attributes
    ----------
    files
        Texts of the files beside it, by name.
    draw
        Function that draws it.
    steps
        Steps from the recorded files to it, a line each.
    ingredients
        Files that it was made of.
    fired
        Shot as it was fired; None of a campaign, which has many.
    """

    document: Mapping[str, Any]
    files: Mapping[str, str]
    draw: Draw
    steps: tuple[str, ...] = ()
    ingredients: tuple[Ingredient, ...] = ()
    fired: StoredShot | None = None


@dataclass(frozen=True)
class KeptDocument(ABC):
    """A document as it stands in its folder, which can be made again from what it rests on.

    Attributes
    ----------
    document
        Contents of its file.
    path
        Path of that file.
    other_digits
        Numerals in it that are not the ones that their numbers are written with: a digit beyond the last one that
        tells a number from its neighbours was changed.
    """

    document: Mapping[str, Any]
    path: Path
    other_digits: tuple[str, ...] = ()

    file: ClassVar[str]
    """Name of its file."""
    schema: ClassVar[str]
    called: ClassVar[tuple[str, str]]
    """Words for it where it is too large, and where it is none."""
    largest: ClassVar[int]
    anew: ClassVar[str]
    """Words for what makes another one."""
    several_scripts: ClassVar[bool] = True
    """Whether the script of its page stands in the folder above, for all pages there."""

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read a document, of its file or of the folder that it is in.

        Raises
        ------
        ReadError
            If there is none, or it is of another schema or lacks what it takes to make it again.
        """
        path = Path(path) / cls.file if Path(path).is_dir() else Path(path)
        content = read_small(path, cls.largest, cls.called[0])
        with told_in_one_line(f"this is no {cls.called[1]} that can be made again", path, remedy=cls.anew):
            document = read_json(content)
            if document["schema"] != cls.schema:
                raise ValueError(f"schema {document['schema']!r}")
            refuse_deep(document)
            kept = cls(document, path, other_digits(content))
            kept._needed()
        return kept

    @abstractmethod
    def _needed(self) -> object:
        """Look at all that it takes to make it again; errors of many kinds if something is not there."""

    @abstractmethod
    def again(self, folders: Sequence[Path], progress: Progress) -> Again:
        """Make it again with everything as it was, from what is found in folders and around it."""

    @abstractmethod
    def drawn_as(self) -> tuple[str, str]:
        """Return the file names of its page and its paper copy."""

    @abstractmethod
    def besides(self) -> tuple[Comparison, set[str]] | None:
        """Compare what else of ours stands in its folder, and name all but its drawings; None where others do that."""

    @abstractmethod
    def changed(self, folders: Sequence[Path]) -> Comparison:
        """Compare what it was made of with what has its name in folders that were named for this."""

    @property
    @abstractmethod
    def shots(self) -> tuple[str, ...]:
        """Names of its shots."""

    @property
    def name(self) -> str:
        """Name of what it is of."""
        return self.shots[0]

    @property
    def home(self) -> Path:
        """Its folder."""
        return self.path.absolute().parent

    @property
    def same_computer(self) -> bool:
        """Whether it was made by this version, on this kind of computer and with these libraries."""
        provenance = self.document["provenance"]
        return bool(provenance["version"] == __version__ and provenance.get("computer") == computer())


def digest_differences(expected: Iterable[tuple[Path, str | Collection[str], str]]) -> Comparison:
    """Compare files with what a document states of them, as far as they are there.

    Parameters
    ----------
    expected
        Path, digests that it may have, and what a difference says that it should be.
    """
    differences = tuple(
        Difference(f"SHA-256 of {path}", stated, now)
        for one, allowed, stated in expected
        for path, now in _digests([one])
        if now not in allowed
    )
    return Comparison(0, differences, 0.0)


def rows_since(path: Path, logged: Mapping[str, Mapping[str, Any] | None]) -> str:
    """Say of a shot log that has changed whether its rows of some shots have.

    Parameters
    ----------
    logged
        Cells of each shot's row as they were; None for a shot that had none.
    """
    try:
        log = ShotLog.read(path)
        rows = {shot: log.row(shot) for shot in logged}
    except RecoilDaqError as error:
        return f", and at fault now: {error}"
    now = {shot: {} if row is None else row.to_json() for shot, row in rows.items()}
    others = [shot for shot, was in logged.items() if _said(was) != _said(now[shot])]
    if len(logged) == 1:
        return ", and so is its row of this shot" if others else ", its row of this shot is the same"
    return f", and so are its rows of {', '.join(others)}" if others else ", its rows of these shots are the same"


def _said(row: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the cells of a row that say something; no mass added is a mass of 0."""
    return {key: cell for key, cell in (row or {}).items() if cell not in (None, "", 0.0)}


class Kept(KeptDocument):
    """A report as it stands in its folder."""

    file, schema, largest, anew = REPORT_FILE, REPORT_SCHEMA, LARGEST_REPORT, ANEW
    called = ("a report", "report of a shot")

    def again(self, folders: Sequence[Path], progress: Progress) -> Again:
        """Identify the shot of its shot file anew.

        Raises
        ------
        ReadError
            If the shot file is not found, or has changed.
        StoreError, RigError, IdentificationError
            As of `recoil_daq.reports.identify.identify_file`.
        """
        progress("find the shot file")
        path = found_shot_file(self, folders)
        progress("read")
        fired = read_stored_again(
            path, self.row, self.beside(LOG_FILE), self.beside(RIG_FILE), self.document["provenance"]["corrected_rig"]
        )
        header = self.beside(HEADER_FILE)
        if header is not None:
            fired = replace(fired, header=Issue.model_validate(self.document["issued"]), header_file=header)
        # what other rows the log had is in the note on the missing one alone
        fired = replace(fired, notes=(*fired.notes, *self.notes_on_log(len(fired.notes))))
        progress("identify")
        made = self.identified(fired, replace(InputFile.of(path), name=self.shot_file.name))
        before = [f"{one.what}, recoil-daq {one.version}{_parameters(one.parameters)}" for one in fired.shot.history]
        steps = (*before, f"identify, recoil-daq {self.document['provenance']['version']}, {self.what}")
        return replace(made, steps=steps, ingredients=tuple(self._ingredients(path, folders)), fired=fired)

    def identified(self, fired: StoredShot, shot_file: InputFile) -> Again:
        """Identify the shot with everything as it was."""
        found = identify_shot(fired, self.options)
        document, files = reported(fired, found, shot_file, self.truth, Forms.of_document(self.document))
        return Again(document, files, partial(report_pages, found=found))

    def drawn_as(self) -> tuple[str, str]:
        """Return the file names of its page and its paper copy."""
        return PAGE_NAME, PDF_FILE

    def besides(self) -> tuple[Comparison, set[str]] | None:
        """Draw the sweeps in its folder again, and name all files but its drawings, with those of other documents."""
        targets = [path.stem for path in targets_in(self.path.parent) if path.parent == self.path.parent]
        others = {name for target in targets for name in files_of(target)}
        figures = {
            f"{FIGURES_FOLDER}/{path.name}"
            for target in targets
            for path in (self.path.parent / FIGURES_FOLDER).glob(f"{target}-*")
        }
        swept, sweeps = sweeps_again(self.home)
        return swept, {self.path.name, TRACE_FILE, CURVES_FILE} | others | figures | sweeps

    def changed(self, folders: Sequence[Path]) -> Comparison:
        """Compare files in folders with those of their names that it was made of.

        Shot log, rig file and header file go on, and what they said is in the report.
        """
        lasting = [one for one in self.inputs if one.source not in BESIDE]
        return digest_differences(
            (folder / one.name, (one.sha256,), one.sha256) for one in lasting for folder in folders
        )

    def _ingredients(self, shot_file: Path, folders: Sequence[Path]) -> Iterator[Ingredient]:
        since = partial(rows_since, logged={self.shots[0]: self.document["shot_log"]})
        for one in self.inputs:
            path = shot_file if one == self.shot_file else shot_file.parent / one.name
            absent = (
                f"not here: what it {'said is in the report' if one.source in BESIDE else 'held is in the shot file'}"
            )
            named = tuple(folder / one.name for folder in folders if folder != shot_file.parent)
            of_log = {"since": since} if one.source == LOG_FILE else {}
            yield Ingredient(one.name, one.sha256, (path,), absent, named=named, **of_log)

    @property
    def shots(self) -> tuple[str, ...]:
        """Name of its shot."""
        return (str(self.document["shot"]),)

    def _needed(self) -> object:
        provenance = self.document["provenance"]
        if not all(isinstance(note, str) for note in self.document["notes"]):
            raise TypeError("notes that are no texts")
        self.notes_on_log(0)
        Forms.of_document(self.document)
        stated = provenance["corrected_rig"], provenance["version"], self.document["rig"], self.shots
        return stated, self.truth, self.options, self.row, self.shot_file

    @property
    def what(self) -> str:
        """Name of the method, or of the target, for a line of the steps."""
        return f"method {self.document['provenance']['parameters']['method']}"

    @property
    def options(self) -> Options:
        """With which it was made."""
        return Options.of_json(self.document["provenance"]["parameters"]["options"])

    @property
    def row(self) -> ShotLogRow | None:
        """Row of the shot log, as it was then."""
        cells = self.document["shot_log"]
        return None if cells is None else ShotLogRow.of_json(cells)

    @property
    def inputs(self) -> list[InputFile]:
        """Files that it was made of, the shot file first; ValueError if one is named by more than its name."""
        found = [
            InputFile(one["file"], one["sha256"], int(one["size"]), one["source"], one["reader"])
            for one in self.document["provenance"]["inputs"]
        ]
        for one in found:
            require_name(one.name)  # no file is looked for, and none is read, but beside the shot file
        return found

    @property
    def shot_file(self) -> InputFile:
        """The shot file as it was."""
        return self.inputs[0]

    def beside(self, source: str) -> InputFile | None:
        """Return what was read beside the shot file, a shot log or a corrected rig file; None where there was none."""
        return next((one for one in self.inputs[1:] if one.source == source), None)

    def notes_on_log(self, after: int) -> list[Note]:
        """Return the note that the shot log had no row of the shot; none where it had one, or there was no log.

        Parameters
        ----------
        after
            Number of the notes that stand before it. An earlier version wrote no findings: its note is known by its
            place, the last of those on shot log and rig file.
        """
        log = self.beside(LOG_FILE)
        if log is None or self.row is not None:
            return []
        if FINDINGS not in self.document:
            return [Note(NoteCode.NO_LOG_ROW, log.name, note) for note in self.document["notes"][after : after + 1]]
        return [
            Note(NoteCode.NO_LOG_ROW, log.name, str(one["text"]))
            for one in self.document[FINDINGS]
            if one["code"] == NoteCode.NO_LOG_ROW
        ]

    @property
    def truth(self) -> dict[str, Any] | None:
        """Hidden values of a virtual shot."""
        stated = self.document.get("truth")
        return None if stated is None else {"m3": float(stated["mass_kg"])}


class KeptTarget(Kept):
    """A target's document as it stands in its folder."""

    schema, called = TARGET_SCHEMA, ("a target's document", "document of a target")

    def _needed(self) -> object:
        return super()._needed(), target_function(self.target)

    @property
    def what(self) -> str:
        """Name of the target, for a line of the steps."""
        return f"target {self.target}"

    @property
    def target(self) -> str:
        """Name of the target."""
        return str(self.document["target"])

    @property
    def options(self) -> Options:
        """With which it was identified."""
        return Options.of_json(self.document["provenance"]["options"])

    def identified(self, fired: StoredShot, shot_file: InputFile) -> Again:
        """Identify the target with everything as it was."""
        case = Case(fired, self.options).with_agreeing_gauges()
        found = find_target(self.target, fired, case)
        forms = Forms.of_document(self.document)
        document, files = target_reported(fired, found, shot_file, self.options, forms)
        return Again(document, files, partial(target_pages, found=found))

    def drawn_as(self) -> tuple[str, str]:
        """Return the file names of its page and its paper copy."""
        return f"{self.target}.html", f"{self.target}.pdf"

    def besides(self) -> None:
        """Return nothing: what else stands there is the report's."""


def other_digits(content: bytes) -> tuple[str, ...]:
    """Return the numerals of a JSON text that another number of digits, or other digits, would be written for."""
    found = []

    def look(numeral: str) -> float:
        number = float(numeral)
        try:
            same = Decimal(numeral) == Decimal(repr(number))
        except InvalidOperation:  # an exponent of twenty digits
            same = False
        if not same:
            found.append(numeral)
        return number

    json.loads(content, parse_float=look)
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Recomputed:
    """A document and what came of it again.

    Attributes
    ----------
    kept
        Document as it stands.
    again
        Document made again.
    comparison
        Comparison of all numbers of the document and of the tables beside it.
    """

    kept: KeptDocument
    again: Again
    comparison: Comparison

    @property
    def document(self) -> Mapping[str, Any]:
        """The document made again."""
        return self.again.document

    def whole(self, folders: Sequence[Path] = ()) -> Comparison:
        """Compare page, paper copy and figures, too, and what it was made of in folders that were named for this.

        Parameters
        ----------
        folders
            Folders in which to look for what it was made of first.
        """
        kept, home = self.kept, self.kept.home
        drawings = Drawings(home, *kept.drawn_as(), home.parent if kept.several_scripts else home, self.again.draw)
        drawn, names = drawings.compared(kept.document, self.document, exact=kept.same_computer)
        whole = self.comparison.joined(drawn).joined(kept.changed(folders))
        if (found := kept.besides()) is None:
            return whole
        besides, own = found
        return whole.joined(besides).joined(strangers(home, {*names, *own}))


def recompute(kept: KeptDocument, folders: Sequence[Path] = (), *, progress: Progress = lambda _: None) -> Recomputed:
    """Make a document anew, with everything as it was, and compare every number, every text, every digest.

    Parameters
    ----------
    folders
        Folders in which to look for what it was made of before the usual ones.
    progress
        Function called with the name of each step.

    Raises
    ------
    ReadError
        If what it was made of is not found, or has changed.
    StoreError, RigError, IdentificationError
        As of `recoil_daq.reports.identify.identify_file`.
    """
    again = kept.again(folders, progress)
    progress("compare")
    stored, exact = kept.document, kept.same_computer
    besides = BESIDES if FINDINGS in stored else (*BESIDES, FINDINGS)
    comparison = compare(stored, again.document, exact=exact, besides=besides)
    for name, text in again.files.items():
        comparison = comparison.joined(_compared(kept.path.parent / name, stored, text, exact=exact))
    odd = [Difference(f"a number of {kept.path.name}", one, repr(float(one))) for one in kept.other_digits]
    seal, digest = stored["provenance"].get(SEAL), digest_of(stored)
    odd += [Difference(f"provenance.{SEAL}", seal, digest)] if seal != digest else []
    return Recomputed(kept, again, comparison.joined(Comparison(0, tuple(odd), 0.0)))


def _parameters(given: Mapping[str, Any]) -> str:
    return "".join(f", {name} {value}" for name, value in given.items() if not isinstance(value, Mapping | list))


def _compared(path: Path, stored: Mapping[str, Any], text: str, *, exact: bool) -> Comparison:
    """Compare a file beside a document, and its digest, with the same file made again."""
    name = path.name
    if not path.is_file():
        return Comparison(0, (Difference(name, None, "a table"),), 0.0)
    most = MOST_OF_A_TABLE * len(text.encode())
    content = read_beginning(path, most + 1)
    if len(content) > most:
        larger = Difference(f"size of {name}", f"over {most:,} bytes", f"{most // MOST_OF_A_TABLE:,} bytes")
        return Comparison(0, (larger,), 0.0)
    found = compare_tables(name, content.decode("utf-8", "replace"), text, exact=exact)
    listed = {one.get("file"): one.get("sha256") for one in stored["provenance"].get("outputs", ())}
    digest = hashlib.sha256(content).hexdigest()
    if listed.get(name) != digest and not found.differences:
        return found.joined(Comparison(0, (Difference(f"SHA-256 of {name}", listed.get(name), digest),), 0.0))
    return found


def found_shot_file(kept: Kept, shots: Sequence[Path] = ()) -> Path:
    """Find the shot file of a report: by its name, else by its digest.

    Parameters
    ----------
    shots
        Folders in which to look first; then in the report's own, in the three above it, in the folder ``shots`` of
        each, and where the program was started.

    Raises
    ------
    ReadError
        If it is not there, or what has its name is another file.
    """
    wanted, home = kept.shot_file, kept.path.absolute().parent
    around = [home, *home.parents[:3], Path.cwd()]
    folders = [*shots, *dict.fromkeys(folder for place in around for folder in (place, place / SHOTS))]
    changed: Path | None = None
    for folder in folders:
        path = folder / wanted.name
        if path.is_file():
            if InputFile.of(path).sha256 == wanted.sha256:
                return path
            changed = changed or path
    for path in _of_size(folders, wanted.size):
        if InputFile.of(path).sha256 == wanted.sha256:
            return path
    if changed is not None:
        raise ReadError(
            "the shot file is not the one that this report was made of",
            path=changed,
            expected=f"SHA-256 {wanted.sha256}",
            found=InputFile.of(changed).sha256,
            remedy=f"give the folder of the one that was with --shots, or {ANEW}",
        )
    raise ReadError(
        "the shot file of this report is not found",
        path=kept.path,
        expected=f"{wanted.name} with SHA-256 {wanted.sha256}",
        remedy="give its folder with --shots",
    )


def _of_size(folders: Sequence[Path], size: int) -> Iterator[Path]:
    """Yield the shot files of folders that are as large as one that is looked for under another name."""
    for folder in folders:
        if folder.is_dir():
            yield from (path for path in sorted(folder.glob("*.h5")) if path.is_file() and path.stat().st_size == size)


def find_reports(place: str | Path) -> list[Path]:
    """Return the reports of a place: a ``report.json``, the folder of one, or a folder of such folders.

    Raises
    ------
    ReadError
        If there is none.
    """
    place = named_report(Path(place))
    if not place.is_dir():
        if not place.exists():
            raise ReadError("no such file or folder", path=place, remedy="check the name and the folder")
        return [place]
    found = reports_in(place)
    if not found:
        raise ReadError("no report in this folder", path=place, expected=f"a {REPORT_FILE}, or folders with one each")
    return found


def targets_in(folder: Path) -> list[Path]:
    """Return the documents of targets in a folder and in those in it, in the order of their names."""
    names = [f"{target}.json" for target in target_names()]
    return sorted(path for name in names for path in (*folder.glob(name), *folder.glob(f"*/{name}")))


def reports_in(folder: Path) -> list[Path]:
    """Return the ``report.json`` of a folder and of those in it, in the order of their names."""
    return sorted([*folder.glob(REPORT_FILE), *folder.glob(f"*/{REPORT_FILE}")])
