"""Where a command writes its pages, in which forms, and whether what is there is replaced."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from recoil_acquisition.errors import ReadError
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.report_folder import publish, refuse_existing, refuse_unwritable
from recoil_identification.report.figure.figure import Figure
from recoil_identification.report.page.page_files import write_page, write_script
from recoil_identification.report.paper.paper import earlier_figures, figure_files, write_figures
from recoil_identification.report.paper.typeset import refuse_without_typst
from recoil_rigs.tables.issue import SHOT, read_header


@dataclass(frozen=True)
class Pages:
    """A page, its paper copy and its figures, as they are written.

    Attributes
    ----------
    name, pdf_name
        File names of page and paper copy.
    page
        Page as HTML text.
    pdf
        Bytes of the paper copy; None where none is asked for.
    figures
        Figures of the page, in reading order.
    prefix
        Beginning of the names of the figures' own files; empty where no other page of the folder has any.
    besides
        Bytes of further files that say the same for other readers, by name.
    """

    name: str
    page: str
    pdf_name: str
    pdf: bytes | None
    figures: Sequence[Figure]
    prefix: str = ""
    besides: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Output:
    """Place and forms of what a command writes.

    Attributes
    ----------
    out
        Folder that holds the folders of shots' reports, or a campaign's answer itself.
    pdf
        Whether a paper copy (PDF/A-3b) is written beside each page; needs the extra ``pdf``.
    figures
        Whether each figure is also written as SVG and PNG; needs the extra ``pdf``.
    standalone
        Whether each page holds all that it shows, as one file to send. Otherwise the script of its figures is written
        beside it, once for all pages that share it.
    overwrite
        Whether files that are there are replaced.
    header
        File with the identity of the reports, see `recoil_rigs.tables.issue`, which goes before that of the rig; None
        for the rig's alone.
    """

    out: Path = Path("reports")
    pdf: bool = False
    figures: bool = False
    standalone: bool = False
    overwrite: bool = False
    header: Path | None = None

    @property
    def forms(self) -> Forms:
        """The forms in which documents are drawn, for their provenance."""
        return Forms.now(pdf=self.pdf, figures=self.figures, standalone=self.standalone)

    def refuse_missing_extra(self) -> None:
        """Raise a StoreError where paper copies or figures are asked for and the extra ``pdf`` is not installed."""
        refuse_without_typst(pdf=self.pdf, figures=self.figures)

    def refuse_one_number(self, count: int) -> None:
        """Raise a ReadError where the header has one number for the reports of several shots."""
        number = None if self.header is None or count < 2 else read_header(self.header).number
        if number is not None and SHOT not in number:
            raise ReadError(
                f"one number would stand on the reports of {count} shots",
                path=self.header, expected=f"{SHOT} in `number`", found=number,
                remedy=f'write number = "{number}-{SHOT}", or give the shots one by one, each with its own --header',
            )  # fmt: skip

    def refuse_existing(self, folder: Path, names: Sequence[str]) -> None:
        """Raise a StoreError where a folder holds any of some files that are not to be replaced."""
        if not self.overwrite:
            refuse_existing(folder, names)

    def refuse_unwritable(self, folder: Path, names: Sequence[str]) -> None:
        """Raise a StoreError where files cannot be written into a folder, or are there and not to be replaced."""
        refuse_unwritable(folder)
        self.refuse_existing(folder, names)

    def publish(
        self,
        folder: Path,
        pages: Pages,
        write: Callable[[Path], None],
        obsolete: Sequence[str] = (),
        *,
        script_above: bool = True,
    ) -> None:
        """Write a page with what belongs to it: all of it appears in its folder together, or nothing does.

        Parameters
        ----------
        write
            Function that is given an empty folder, and writes the other files into it.
        obsolete
            Names of further files in the folder that tell of an older report, and go with it.
        script_above
            Whether the script of the figures stands in the folder above, for all pages there; else beside the page.

        Raises
        ------
        StoreError
            If it cannot be written; what was there is there still.
        """

        def write_all(partial: Path) -> None:
            write(partial)
            write_page(partial, pages.page, pages.name)
            if not self.standalone:
                write_script(folder.parent if script_above else partial)
            if pages.pdf is not None:
                (partial / pages.pdf_name).write_bytes(pages.pdf)
            if self.figures:
                write_figures(partial, pages.figures, pages.prefix)

        drawn = (*figure_files(pages.figures, pages.prefix), *earlier_figures(folder, pages.prefix))
        publish(folder, write_all, obsolete=(pages.pdf_name, *drawn, *obsolete))
