"""The page, the paper copy and the figures of a document drawn again, and compared byte by byte with those beside it.

What a reader holds is a page or a paper copy: that the numbers of the document come again says nothing of these.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.files.regular_file import read_beginning
from recoil_acquisition.packages.extras import PDF
from recoil_acquisition.shot.shot import InputFile
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.output import Pages
from recoil_identification.report.document.report_files import SEAL
from recoil_identification.report.document.reproduction import Comparison, Difference, NotCompared
from recoil_identification.report.page.page_files import SCRIPT_NAME, script_sha256
from recoil_identification.report.paper.paper import FIGURES_FOLDER, drawings_of, figure_files
from recoil_identification.report.paper.typeset import png_bytes

Draw = Callable[[Mapping[str, Any], Forms], Pages]
"""Function that draws a document in some forms."""
OF_THE_DAY = ("version", "computer", "outputs", SEAL)
"""Keys of the provenance that a document made again has anew, and that its page and paper copy bear as they were."""


@dataclass(frozen=True)
class Drawings:
    """Surroundings of a document's drawings.

    Attributes
    ----------
    folder
        Folder of the document.
    page, pdf
        File names of page and paper copy.
    script_in
        Folder of the script that the page refers to.
    draw
        Function that draws the document.
    """

    folder: Path
    page: str
    pdf: str
    script_in: Path
    draw: Draw

    def compared(
        self, stored: Mapping[str, Any], again: Mapping[str, Any], *, exact: bool
    ) -> tuple[Comparison, frozenset[str]]:
        """Draw a document again, and compare what stands beside it.

        Parameters
        ----------
        stored, again
            Document as it stands, and made again.
        exact
            Whether both were made by this version, on this kind of computer: else other bytes are no sign of a change.

        Returns
        -------
        Comparison
            With the names of what was compared, and of what was not, each with the reason.
        frozenset of str
            Names, in the folder, of all drawings of the document.
        """
        forms = Forms.of_document(stored)
        if forms is None:
            there = [name for name in (self.page, self.pdf) if (self.folder / name).exists()]
            why = "its document was written before documents stated how they are drawn: identify anew"
            return Comparison.of(NotCompared(name, why, stated=False) for name in there), frozenset(there)
        made, was = dict(again["provenance"]), stored["provenance"]
        made |= {
            key: was[key] for key in OF_THE_DAY if isinstance(was.get(key), type(made[key])) and was[key] != made[key]
        }
        can_typeset = PDF.is_installed
        try:
            drawn = self.draw({**again, "provenance": made}, replace(forms, pdf=forms.pdf and can_typeset))
        except (StoreError, ReadError) as error:
            names = [self.page, *([self.pdf] if forms.pdf else [])]
            return Comparison.of(NotCompared(name, str(error), stated=True) for name in names), frozenset(names)
        loose = "" if exact else "it was drawn by another version, or on another kind of computer"
        now = Forms.now(pdf=forms.pdf, figures=forms.figures)
        of_script = loose or (
            "it holds plotly's script of another version" if forms.standalone and now.script != forms.script else ""
        )
        of_typst = loose or ("" if now.typst == forms.typst else f"it was typeset by typst {forms.typst}")
        missing = f"{PDF.module}, which typesets it, is not installed: {PDF.remedy}"
        found = [self._file(self.page, drawn.page.encode("utf-8"), of_script)]
        if forms.pdf:
            found.append(self._file(self.pdf, drawn.pdf, of_typst, missing))
        elif (self.folder / self.pdf).exists():
            found.append(Difference(self.pdf, "a file", None))
        files = figure_files(drawn.figures, drawn.prefix)
        if forms.figures:
            svg = drawings_of(drawn.figures)
            png = png_bytes(svg) if can_typeset else [None] * len(svg)
            for name, vector, picture in zip(files[::2], svg, png, strict=True):
                found.append(self._file(name, vector.encode("utf-8"), loose))
                found.append(self._file(f"{name[:-4]}.png", picture, of_typst, missing))
        found += [self._file(name, content, loose) for name, content in drawn.besides.items()]
        if not forms.standalone:
            found += self._script(forms)
        return Comparison.of(found), frozenset((self.page, self.pdf, *files, *drawn.besides))

    def _file(self, name: str, content: bytes | None, loose: str, missing: str = "") -> Difference | NotCompared | str:
        """Compare a file with what it should hold: its name if it does.

        Parameters
        ----------
        content
            None where it could not be drawn, for what `missing` says.
        loose
            Reason why other bytes tell nothing; empty where they do.
        """
        path = self.folder / name
        if not path.is_file():
            return Difference(name, None, "a file")
        if content is None:
            return NotCompared(name, missing, stated=True)
        if read_beginning(path, len(content) + 1) == content:
            return name
        if loose:
            return NotCompared(name, f"{loose}, and its bytes are others", stated=True)
        return Difference(f"SHA-256 of {name}", InputFile.of(path).sha256, hashlib.sha256(content).hexdigest())

    def _script(self, forms: Forms) -> Iterator[Difference | str]:
        """Compare the script; where there is none, the page shows its drawings."""
        path = self.script_in / SCRIPT_NAME
        if path.is_file():
            digest = InputFile.of(path).sha256
            # that of another report in the folder may have been written by a newer version
            known = digest in (forms.script, script_sha256())
            yield SCRIPT_NAME if known else Difference(f"SHA-256 of {SCRIPT_NAME}", digest, forms.script)


def strangers(folder: Path, known: Collection[str]) -> Comparison:
    """Name the files of a document's folder that are none of its own."""
    figures = [f"{FIGURES_FOLDER}/{path.name}" for path in _files(folder / FIGURES_FOLDER)]
    names = [*(path.name for path in _files(folder)), *figures]
    why = "it is no part of the document"
    return Comparison.of(NotCompared(name, why, stated=False) for name in names if name not in known)


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.glob("*") if not path.is_dir()) if folder.is_dir() else []
