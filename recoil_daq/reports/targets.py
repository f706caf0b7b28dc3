"""A shot file to the pages of targets beside the mass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.remark import Note, NoteCode
from recoil_acquisition.shot.shot import InputFile
from recoil_acquisition.store import shot_file_of
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.output import Output, Pages
from recoil_daq.reports.stored_shot import StoredShot, read_stored
from recoil_daq.terminal.result import Progress
from recoil_daq.version import __version__
from recoil_identification.report.content.chosen_units import ChosenUnits
from recoil_identification.report.document.report_files import write_files
from recoil_identification.report.page.html import render_target_page
from recoil_identification.report.paper.paper import target_pdf
from recoil_identification.shot.identified import Options
from recoil_identification.targets import target_function
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_document import (
    series_file,
    series_text,
    target_document,
    write_target_document,
)
from recoil_identification.targets.target_result import TargetResult


@dataclass(frozen=True)
class TargetReported:
    """Result of one target, and where it was written.

    Attributes
    ----------
    document
        Contents of ``<target>.json``.
    folder
        Folder that holds ``<target>.json``, ``<target>.html``, and ``<target>.csv`` where there is a series;
        ``<target>.pdf`` and ``figures`` where they were asked for.
    """

    document: dict[str, Any]
    folder: Path


def files_of(target: str) -> tuple[str, ...]:
    """Return the names of a target's files; none of them is replaced unasked."""
    return tuple(f"{target}.{suffix}" for suffix in ("json", "html", "csv", "pdf"))


@on_one_thread
def identify_targets(
    path: Path,
    targets: Sequence[str],
    output: Output,
    *,
    options: Options,
    rig: str | Path | None = None,
    progress: Progress = lambda _: None,
) -> list[TargetReported]:
    """Identify targets of one shot file and write their pages into the folder of the shot.

    What targets share is computed once. Each target's files appear together or not at all.

    Parameters
    ----------
    targets
        Names of `recoil_identification.targets.target_names`.
    rig
        Corrected rig file, as `recoil_daq.reports.identify.identify_file` takes it; None if nothing is corrected.
    progress
        Function called with the name of each step.

    Raises
    ------
    ValueError
        If a target is unknown.
    StoreError
        If the file is no shot file, a target's files exist or cannot be written, or an extra is missing.
    ReadError
        If the shot log is at fault.
    RigError
        If the rig stored in the shot file is at fault, or the corrected one differs by more than corrections.
    IdentificationError
        If a target can give no number at all.
    """
    output.refuse_missing_extra()
    progress("read")
    fired = read_stored(path, rig, header=output.header)
    folder = output.out / fired.shot.name
    output.refuse_unwritable(folder, [file for name in targets for file in files_of(name)])
    case = Case(fired, options).with_agreeing_gauges()
    done = []
    for name in targets:
        progress(name)
        found = find_target(name, fired, case)
        forms = output.forms
        document, files = target_reported(fired, found, shot_file_of(path), options, forms)
        _publish(folder, target_pages(document, forms, found), document, files, output)
        done.append(TargetReported(document, folder))
    return done


def find_target(name: str, fired: StoredShot, case: Case) -> TargetResult:
    """Identify one target of a shot, with the notes on how the shot was fired.

    Parameters
    ----------
    fired
        Shot as it is stored.
    case
        The same without the gauges that the mass sets aside.
    """
    found = target_function(name)(case)
    left_out = [
        Note(NoteCode.SET_ASIDE, channel, f"{channel} is set aside, as for the mass")
        for channel in fired.shot.channels
        if channel not in case.fired.shot.channels
    ]
    return replace(found, notes=(*fired.notes, *left_out, *found.notes))


def target_reported(
    fired: StoredShot, found: TargetResult, shot_file: InputFile, options: Options, forms: Forms | None = None
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the document of what was found of a target, and the texts of the files beside it, by name."""
    files = {} if found.series is None else {series_file(found.target): series_text(found.series)}
    document = target_document(
        fired.shot, found, version=__version__, shot_file=shot_file, row=fired.row, beside=fired.beside,
        corrections=fired.corrections, rig=fired.rig, issued=fired.issued, rig_text=fired.rig_text, options=options,
        files=files, drawn=None if forms is None else forms.to_json(),
    )  # fmt: skip
    return document, files


def target_pages(document: Mapping[str, Any], forms: Forms, found: TargetResult) -> Pages:
    """Draw the document of what was found of a target."""
    name, drawn = found.target, ChosenUnits.of(document).figures(found.figures)
    return Pages(
        f"{name}.html", render_target_page(document, drawn, standalone=forms.standalone),
        f"{name}.pdf", target_pdf(document, drawn) if forms.pdf else None, drawn, f"{name}-",
    )  # fmt: skip


def _publish(folder: Path, pages: Pages, document: dict[str, Any], files: Mapping[str, str], output: Output) -> None:
    def write(partial: Path) -> None:
        write_target_document(partial, document)
        write_files(partial, files)

    output.publish(folder, pages, write)
