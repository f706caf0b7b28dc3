"""A shot file to a report."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import IdentificationError, ReadError, StoreError
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.shot.shot import InputFile, Shot
from recoil_acquisition.store import shot_file_of
from recoil_daq.arguments import named_shot
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.output import Output, Pages
from recoil_daq.reports.report_folder import refuse_unwritable
from recoil_daq.reports.stored_shot import StoredShot, read_stored
from recoil_daq.terminal.result import MassResult, OfShot, Progress
from recoil_daq.version import __version__
from recoil_identification.report.content.chosen_units import ChosenUnits
from recoil_identification.report.document.document import report_document
from recoil_identification.report.document.report_files import (
    CURVES_FILE,
    REPORT_FILE,
    TRACE_FILE,
    curves_text,
    trace_text,
    write_document,
    write_files,
)
from recoil_identification.report.figure.figures import report_figures
from recoil_identification.report.page.html import BESIDE_PAGE, PAGE_NAME, render_page
from recoil_identification.report.page.page_files import SCRIPT_NAME
from recoil_identification.report.paper.paper import PDF_FILE, report_pdf
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.firing_record import curves_of
from recoil_identification.shot.identified import Identification, Options
from recoil_rigs.tables.specification import mass_decimals

FILES = (REPORT_FILE, TRACE_FILE, CURVES_FILE, PAGE_NAME, PDF_FILE)
"""Names of a report's files; none of them is replaced unasked."""


@dataclass(frozen=True, repr=False)
class Reported(MassResult, OfShot):
    """A report and where it was written.

    Attributes
    ----------
    document
        Contents of ``report.json``.
    folder
        Folder that holds ``report.json``, ``report.html``, ``mass.csv`` and ``curves.csv``; ``report.pdf`` and
        ``figures`` where they were asked for. The script of the figures stands in the folder above it.
    """

    def show(self, told: set[str] | None = None) -> None:
        """Print the mass, its methods, and what speaks against it; what was told of methods before is left out."""
        from recoil_daq.terminal.report import print_report

        print_report(self.to_json(), self.folder, told)

    def __repr__(self) -> str:
        verdict, places = "valid" if self.valid else "not valid", mass_decimals(self.u_kg)
        mass = f"{self.mass_kg:.{places}f} kg, u {self.u_kg:.{places}f} kg"
        return f"Reported({self.shot!r}: {mass}, {verdict} -> {self.folder})"


def find_shot_files(paths: list[Path]) -> list[Path]:
    """Expand folders to the shot files in them, in order of their names, and names of shots to their files.

    Raises
    ------
    ReadError
        If a path does not exist and is no shot's name, is no shot file, or a folder holds none.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(path.glob("*.h5"))
            if not inside:
                raise ReadError("no shot file in this folder", path=path, expected="files that end in .h5")
            found += inside
        else:
            found.append(named_shot(path))
    return found


def identify_file(
    path: str | Path,
    *,
    out: str | Path = "reports",
    options: Options | None = None,
    rig: str | Path | None = None,
    truth: Mapping[str, Any] | None = None,
    pdf: bool = False,
    figures: bool = False,
    standalone: bool = False,
    overwrite: bool = False,
    header: str | Path | None = None,
    progress: Progress = lambda _: None,
) -> Reported:
    """Identify the mass of one shot file and write its report into ``out/<shot>``.

    The specification is the rig's, with the mass that the shot log beside the file adds for this shot.
    The report appears complete or not at all: it is written beside its place and then renamed.

    Parameters
    ----------
    rig
        Rig file that corrects the one in the shot file, which is left as it is: calibrations, and values of the
        mechanism. The corrections are in the report. None if nothing is to be corrected.
    truth
        Hidden values of a virtual shot, for comparison in the report.
    pdf, figures
        Whether the paper copy ``report.pdf`` is written, and each figure as SVG and PNG into ``figures``; both need the
        extra ``pdf``.
    standalone
        Whether ``report.html`` holds all that it shows, as one file to send. Otherwise the script of its figures is
        written into `out`, once for all reports there.
    header
        Header file with the identity of the report, the keys of a rig's ``[report]``, which goes before the rig's.
    progress
        Function called with the name of each step.

    Raises
    ------
    StoreError
        If the file is no shot file, the report exists or cannot be written, or an extra is missing.
    ReadError
        If the shot log is at fault.
    RigError
        If the rig stored in the shot file is at fault, or the corrected one differs by more than corrections.
    IdentificationError
        If no number can be given at all.
    """
    output = Output(Path(out), pdf, figures, standalone, overwrite, None if header is None else Path(header))
    return write_report(Path(path), output, options=options or Options(), rig=rig, truth=truth, progress=progress)


@on_one_thread
def write_report(
    path: Path,
    output: Output,
    *,
    options: Options,
    rig: str | Path | None = None,
    truth: Mapping[str, Any] | None = None,
    progress: Progress = lambda _: None,
    identified: Callable[[Identification], None] = lambda _: None,
) -> Reported:
    """Identify the mass of one shot file and write its report; parameters and errors as of `identify_file`.

    Parameters
    ----------
    identified
        Function called with what was found, before its report is made.
    """
    output.refuse_missing_extra()
    progress("read")
    fired = read_stored(path, rig, header=output.header)
    shot = fired.shot
    folder = output.out / shot.name
    refuse_unwritable(folder)
    try:
        output.refuse_existing(folder, FILES)
    except StoreError:
        _refuse_longer_memory(options, shot)
        raise
    progress("identify")
    found = identify_shot(fired, options)
    identified(found)
    progress("report")
    forms = output.forms
    document, files = reported(fired, found, shot_file_of(path), truth, forms)
    pages = report_pages(document, forms, found)

    def write(partial: Path) -> None:
        write_document(partial, document)
        write_files(partial, files)

    output.publish(folder, pages, write, obsolete=(BESIDE_PAGE, SCRIPT_NAME))
    return Reported(document, folder)


def report_pages(document: Mapping[str, Any], forms: Forms, found: Identification) -> Pages:
    """Draw the report of what was found of a shot."""
    drawn = ChosenUnits.of(document).figures(report_figures(found))
    return Pages(
        PAGE_NAME, render_page(document, drawn, standalone=forms.standalone),
        PDF_FILE, report_pdf(document, drawn) if forms.pdf else None, drawn,
    )  # fmt: skip


def reported(
    fired: StoredShot,
    found: Identification,
    shot_file: InputFile,
    truth: Mapping[str, Any] | None = None,
    forms: Forms | None = None,
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the report of what was found of a shot, and the texts of the files beside it, by name.

    Parameters
    ----------
    forms
        Forms in which it is drawn; None of an earlier version, which did not state them.
    """
    found = replace(found, notes=(*fired.notes, *found.notes))
    files = {TRACE_FILE: trace_text(found.chosen), CURVES_FILE: curves_text(curves_of(found))}
    document = report_document(
        fired.shot, found, version=__version__, shot_file=shot_file, truth=truth, row=fired.row, beside=fired.beside,
        corrections=fired.corrections, rig_text=fired.rig_text, files=files, rig=fired.rig, issued=fired.issued,
        drawn=None if forms is None else forms.to_json(),
    )  # fmt: skip
    return document, files


def _refuse_longer_memory(options: Options, shot: Shot) -> None:
    """Refuse a memory that no interval of the shot can have: that is said before what is there already."""
    spans_s = [c.time_base.end_s - c.time_base.start_s for c in shot.channels.values() if c.time_base.count]
    longest_s = max(spans_s, default=0.0)
    if isinstance(options.window_s, float) and options.window_s > longest_s:
        raise IdentificationError(
            "the memory of the trace is longer than the identification interval",
            expected=f"less than the shot's record, {longest_s:.3g} s",
            found=f"--window-s {options.window_s:g}",
            remedy="give a shorter --window-s, or auto",
        )
