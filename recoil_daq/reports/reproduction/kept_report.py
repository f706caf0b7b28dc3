"""A shot's report, or a target's document, as it stands in its folder, made again from its shot file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.regular_file import require_name
from recoil_acquisition.remark import Note, NoteCode
from recoil_acquisition.shot.shot import InputFile
from recoil_acquisition.store import shot_file_of
from recoil_acquisition.store.shot_log_row import ShotLogRow
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.identify import report_pages, reported
from recoil_daq.reports.reproduction.ingredient import Ingredient, digest_differences, rows_since
from recoil_daq.reports.reproduction.kept_document import Again, KeptDocument
from recoil_daq.reports.reproduction.places import ANEW, targets_in
from recoil_daq.reports.stored_shot import BESIDE, HEADER_FILE, LOG_FILE, RIG_FILE, StoredShot, read_stored_again
from recoil_daq.reports.sweep import sweeps_again
from recoil_daq.reports.targets import files_of, find_target, target_pages, target_reported
from recoil_daq.terminal.result import Progress
from recoil_identification.report.document.report_files import (
    CURVES_FILE,
    LARGEST_REPORT,
    REPORT_FILE,
    TRACE_FILE,
)
from recoil_identification.report.document.report_files import SCHEMA as REPORT_SCHEMA
from recoil_identification.report.document.reproduction import Comparison
from recoil_identification.report.page.html import PAGE_NAME
from recoil_identification.report.paper.paper import FIGURES_FOLDER, PDF_FILE
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_identification.targets import target_function
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_document import SCHEMA as TARGET_SCHEMA
from recoil_rigs.tables.issue import Issue

FINDINGS = "findings"
"""Key of a report that earlier versions did not write."""
SHOTS = "shots"
"""Usual folder of shot files."""


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
        made = self.identified(fired, replace(shot_file_of(path), name=self.shot_file.name))
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
        around = list(folders)
        with suppress(ReadError):  # where it is not found, or is another one, that is said elsewhere
            shot_file = found_shot_file(self, folders)
            # found under another name: another file may bear its own
            around += [shot_file.parent] if shot_file.name != self.shot_file.name else []
        return digest_differences(
            (folder / one.name, (one.sha256,), one.sha256) for one in lasting for folder in around
        )

    def _ingredients(self, shot_file: Path, folders: Sequence[Path]) -> Iterator[Ingredient]:
        since = partial(rows_since, logged={self.shots[0]: self.document["shot_log"]})
        for one in self.inputs:
            path = shot_file if one == self.shot_file else shot_file.parent / one.name
            absent = (
                f"not here: what it {'said is in the report' if one.source in BESIDE else 'held is in the shot file'}"
            )
            # where the file itself has another name, what has its name is said, too
            around = dict.fromkeys((*folders, shot_file.parent))
            named = tuple(folder / one.name for folder in around if folder / one.name != path)
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


def _parameters(given: Mapping[str, Any]) -> str:
    return "".join(f", {name} {value}" for name, value in given.items() if not isinstance(value, Mapping | list))


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
