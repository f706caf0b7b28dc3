"""A shot file to the pages of targets beside the mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.shot import InputFile
from recoil_daq.reports.identify import Progress
from recoil_daq.reports.report_folder import publish, refuse_existing, refuse_unwritable
from recoil_daq.reports.stored_shot import read_stored
from recoil_daq.version import __version__
from recoil_identification.report.html import render_target_page
from recoil_identification.report.page_files import write_page, write_script
from recoil_identification.report.paper import earlier_figures, figure_files, target_pdf, write_figures
from recoil_identification.report.typeset import refuse_without_typst
from recoil_identification.shot.identified import Options
from recoil_identification.targets import target_function
from recoil_identification.targets.finding import Finding
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_document import target_document, write_series, write_target_document


@dataclass(frozen=True)
class TargetReported:
    """Finding of one target, and where it was written.

    Attributes
    ----------
    document
        The contents of ``<target>.json``.
    folder
        Holds ``<target>.json``, ``<target>.html``, and ``<target>.csv`` where there is a series; ``<target>.pdf`` and
        ``figures`` where they were asked for.
    """

    document: dict[str, Any]
    folder: Path


def files_of(target: str) -> tuple[str, ...]:
    """Return the names of a target's files; none of them is replaced unasked."""
    return tuple(f"{target}.{suffix}" for suffix in ("json", "html", "csv", "pdf"))


def identify_targets(
    path: str | Path,
    targets: Sequence[str],
    *,
    out: str | Path = "reports",
    options: Options | None = None,
    rig: str | Path | None = None,
    pdf: bool = False,
    figures: bool = False,
    standalone: bool = False,
    overwrite: bool = False,
    progress: Progress = lambda _: None,
) -> list[TargetReported]:
    """Identify targets of one shot file and write their pages into ``out/<shot>``.

    What targets share is computed once. Each target's files appear together or not at all.

    Parameters
    ----------
    targets
        Names of `recoil_identification.targets.TARGETS`.
    rig, pdf, figures, standalone
        As of `recoil_daq.reports.identify.identify_file`.
    progress
        Told the name of each step.

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
    refuse_without_typst(pdf=pdf, figures=figures)
    source = Path(path)
    progress("read")
    fired = read_stored(source, rig)
    shot = fired.shot
    folder = Path(out) / shot.name
    refuse_unwritable(folder)
    if not overwrite:
        refuse_existing(folder, [file for name in targets for file in files_of(name)])
    recorded = Case(fired, options or Options())
    case = recorded.with_agreeing_gauges()
    left_out = [
        f"{name} is set aside, as for the mass" for name in shot.channels if name not in case.fired.shot.channels
    ]
    done = []
    for name in targets:
        find = target_function(name)
        progress(name)
        found = find(case)
        found = replace(found, notes=(*fired.notes, *left_out, *found.notes))
        document = target_document(
            shot, found, version=__version__, shot_file=InputFile.of(source), row=fired.row, beside=fired.beside,
            corrections=fired.corrections,
        )  # fmt: skip
        _publish(folder, found, document, pdf=pdf, figures=figures, standalone=standalone)
        done.append(TargetReported(document, folder))
    return done


def _publish(
    folder: Path, found: Finding, document: dict[str, Any], *, pdf: bool, figures: bool, standalone: bool
) -> None:
    page = render_target_page(document, found.figures, standalone=standalone)
    paper, prefix = target_pdf(document, found.figures) if pdf else None, f"{found.target}-"

    def write(partial: Path) -> None:
        write_target_document(partial, document)
        if found.series is not None:
            write_series(partial, found.target, found.series)
        write_page(partial, page, f"{found.target}.html")
        if not standalone:
            write_script(folder.parent)
        if paper is not None:
            (partial / f"{found.target}.pdf").write_bytes(paper)
        if figures:
            write_figures(partial, found.figures, prefix)

    publish(
        folder,
        write,
        obsolete=(f"{found.target}.pdf", *figure_files(found.figures, prefix), *earlier_figures(folder, prefix)),
    )
