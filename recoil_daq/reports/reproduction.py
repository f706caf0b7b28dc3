"""A report made again from its shot file, with everything as the report says it was made."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from functools import partial
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.regular_file import read_beginning, read_small
from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.remark import Note, NoteCode
from recoil_acquisition.shot import InputFile
from recoil_acquisition.store.shot_log import ShotLogRow
from recoil_daq.arguments import named_report
from recoil_daq.reports.drawings import Draw, Drawings, strangers
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.identify import report_pages, reported
from recoil_daq.reports.stored_shot import BESIDE, HEADER_FILE, LOG_FILE, RIG_FILE, StoredShot, read_stored_again
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
    read_document,
)
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
LONGEST_NAME_BYTES = 255
"""Bytes of a file's longest name, on any usual file system."""


@dataclass(frozen=True, eq=False)
class Again:
    """A document made again.

    Attributes
    ----------
    files
        Texts of the files beside it, by name.
    draw
        Function that draws it.
    """

    document: Mapping[str, Any]
    files: Mapping[str, str]
    draw: Draw


@dataclass(frozen=True)
class Kept:
    """A report as it stands in its folder.

    Attributes
    ----------
    document
        Contents of the ``report.json``.
    path
        Path of that file.
    other_digits
        Numerals in it that are not the ones that their numbers are written with: a digit beyond the last one that
        tells a number from its neighbours was changed.
    """

    document: Mapping[str, Any]
    path: Path
    other_digits: tuple[str, ...] = ()

    @classmethod
    def read(cls, path: str | Path) -> Kept:
        """Read a report, of a file or of the folder that it is in.

        Raises
        ------
        ReadError
            If there is none, or it is of another schema or lacks what it takes to make it again.
        """
        path = Path(path)
        path = path / REPORT_FILE if path.is_dir() else path
        content = read_small(path, LARGEST_REPORT, "a report")
        kept = cls(read_document(path, content), path, other_digits(content))
        try:
            kept._needed()
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            raise ReadError(
                "this is no report of a shot that can be made again",
                path=path,
                found=f"no {error}" if isinstance(error, LookupError) else str(error),
                remedy=ANEW,
            ) from error
        return kept

    def again(self, fired: StoredShot, shot_file: InputFile) -> Again:
        """Identify the shot with everything as it was."""
        found = identify_shot(fired, self.options)
        document, files = reported(fired, found, shot_file, self.truth, Forms.of_document(self.document))
        return Again(document, files, partial(report_pages, found=found))

    def drawings(self, draw: Draw) -> Drawings:
        """Return what belongs to its drawings."""
        home = self.path.absolute().parent
        return Drawings(home, PAGE_NAME, PDF_FILE, home.parent, draw)

    def own_files(self) -> set[str]:
        """Return the names of all files of its folder that are compared but for its drawings, with other documents."""
        targets = [path.stem for path in targets_in(self.path.parent) if path.parent == self.path.parent]
        others = {name for target in targets for name in files_of(target)}
        figures = {
            f"{FIGURES_FOLDER}/{path.name}"
            for target in targets
            for path in (self.path.parent / FIGURES_FOLDER).glob(f"{target}-*")
        }
        return {self.path.name, TRACE_FILE, CURVES_FILE} | others | figures

    def _needed(self) -> tuple[object, ...]:
        """Look at all that it takes to make it again."""
        provenance = self.document["provenance"]
        if not all(isinstance(note, str) for note in self.document["notes"]):
            raise TypeError("notes that are no texts")
        self.notes_on_log(0)
        Forms.of_document(self.document)
        return provenance["corrected_rig"], provenance["version"], self.truth, self.options, self.row, self.shot_file

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
            # no file is looked for, and none is read, but beside the shot file
            if Path(one.name).name != one.name or len(os.fsencode(one.name)) > LONGEST_NAME_BYTES:
                raise ValueError(f"an input called {one.name[:40]!r}, which is no name of a file")
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

    @property
    def same_computer(self) -> bool:
        """Whether it was made by this version, on this kind of computer and with these libraries."""
        return made_here(self.document)


@dataclass(frozen=True)
class KeptTarget(Kept):
    """A target's document as it stands in its folder."""

    @classmethod
    def read(cls, path: str | Path) -> KeptTarget:
        """Read the document of a target, of its file.

        Raises
        ------
        ReadError
            If there is none, or it lacks what it takes to make it again.
        """
        path = Path(path)
        content = read_small(path, LARGEST_REPORT, "a target's document")
        try:
            document = read_json(content)
            if document["schema"] != TARGET_SCHEMA:
                raise ValueError(f"schema {document['schema']!r}")
            kept = cls(document, path, other_digits(content))
            kept._needed()
            target_function(kept.target)
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            raise ReadError(
                "this is no document of a target that can be made again",
                path=path,
                found=f"no {error}" if isinstance(error, LookupError) else str(error),
                remedy=ANEW,
            ) from error
        return kept

    @property
    def what(self) -> str:
        """Name of the method, or of the target, for a line of the steps."""
        return f"target {self.target}"

    @property
    def target(self) -> str:
        """Name of the target."""
        return str(self.document["target"])

    @property
    def options(self) -> Options:
        """With which it was identified."""
        return Options.of_json(self.document["provenance"]["options"])

    def again(self, fired: StoredShot, shot_file: InputFile) -> Again:
        """Identify the target with everything as it was."""
        case = Case(fired, self.options).with_agreeing_gauges()
        found = find_target(self.target, fired, case)
        forms = Forms.of_document(self.document)
        document, files = target_reported(fired, found, shot_file, self.options, forms)
        return Again(document, files, partial(target_pages, found=found))

    def drawings(self, draw: Draw) -> Drawings:
        """Return what belongs to its drawings."""
        home = self.path.absolute().parent
        return Drawings(home, f"{self.target}.html", f"{self.target}.pdf", home.parent, draw)


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
    """A report and what came of it again.

    Attributes
    ----------
    kept
        Report as it stands.
    shot_file
        Place where its shot file was found.
    again
        Report made again.
    fired
        Shot as it was fired.
    comparison
        Comparison of all numbers of the report and of the tables beside it.
    """

    kept: Kept
    shot_file: Path
    again: Again
    fired: StoredShot
    comparison: Comparison

    @property
    def document(self) -> Mapping[str, Any]:
        """The report made again."""
        return self.again.document

    def whole(self, shots: Sequence[Path] = ()) -> Comparison:
        """Compare page, paper copy and figures, too, and the recorded files in folders that were named for this.

        Parameters
        ----------
        shots
            Folders in which to look for the shot file first.
        """
        kept = self.kept
        drawings = kept.drawings(self.again.draw)
        drawn, names = drawings.compared(kept.document, self.document, exact=kept.same_computer)
        whole = self.comparison.joined(drawn).joined(changed_files(kept.inputs, shots))
        if isinstance(kept, KeptTarget):
            return whole
        return whole.joined(strangers(drawings.folder, {*names, *kept.own_files()}))


def recompute(kept: Kept, shots: Sequence[Path] = (), *, progress: Progress = lambda _: None) -> Recomputed:
    """Identify the shot of a report anew, with everything as it was, and compare every number.

    Parameters
    ----------
    shots
        Folders in which to look for its shot file before the usual ones.
    progress
        Function called with the name of each step.

    Raises
    ------
    ReadError
        If the shot file is not found, or has changed.
    StoreError, RigError, IdentificationError
        As of `recoil_daq.reports.identify.identify_file`.
    """
    progress("find the shot file")
    path = found_shot_file(kept, shots)
    progress("read")
    fired = read_stored_again(
        path, kept.row, kept.beside(LOG_FILE), kept.beside(RIG_FILE), kept.document["provenance"]["corrected_rig"]
    )
    header = kept.beside(HEADER_FILE)
    if header is not None:
        fired = replace(fired, header=Issue.model_validate(kept.document["issued"]), header_file=header)
    # what other rows the log had is in the note on the missing one alone
    fired = replace(fired, notes=(*fired.notes, *kept.notes_on_log(len(fired.notes))))
    progress("identify")
    again = kept.again(fired, replace(InputFile.of(path), name=kept.shot_file.name))
    progress("compare")
    comparison = compared_again(kept.path, kept.document, kept.other_digits, again.document, again.files)
    return Recomputed(kept, path, again, fired, comparison)


def changed_files(inputs: Sequence[InputFile], folders: Sequence[Path]) -> Comparison:
    """Compare files in folders with those of their names that a report was made of.

    Shot log, rig file and header file go on, and what they said is in the report.
    """
    differences = tuple(
        Difference(f"SHA-256 of {path}", one.sha256, now)
        for one in inputs
        for path in (folder / one.name for folder in folders if one.source not in BESIDE)
        if path.is_file() and (now := InputFile.of(path).sha256) != one.sha256
    )
    return Comparison(0, differences, 0.0)


def compared_again(
    path: Path,
    stored: Mapping[str, Any],
    other_digits: Sequence[str],
    again: Mapping[str, Any],
    files: Mapping[str, str],
) -> Comparison:
    """Compare a document and the files beside it with the same made again: every number, every text, every digest.

    Parameters
    ----------
    path
        File of the stored document.
    other_digits
        Numerals in it that its numbers are not written with, see `Kept.other_digits`.
    files
        Texts of the files beside it as they were made again, by name.
    """
    exact = made_here(stored)
    besides = BESIDES if FINDINGS in stored else (*BESIDES, FINDINGS)
    comparison = compare(stored, again, exact=exact, besides=besides)
    for name, text in files.items():
        comparison = comparison.joined(_compared(path.parent / name, stored, text, exact=exact))
    odd = tuple(Difference(f"a number of {path.name}", one, repr(float(one))) for one in other_digits)
    comparison = comparison.joined(Comparison(0, odd, 0.0))
    seal = stored["provenance"].get(SEAL)
    if seal != digest_of(stored):
        changed = Difference(f"provenance.{SEAL}", seal, digest_of(stored))
        comparison = comparison.joined(Comparison(0, (changed,), 0.0))
    return comparison


def made_here(document: Mapping[str, Any]) -> bool:
    """Return whether a document was made by this version, on this kind of computer and with these libraries."""
    provenance = document["provenance"]
    return bool(provenance["version"] == __version__ and provenance.get("computer") == computer())


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
