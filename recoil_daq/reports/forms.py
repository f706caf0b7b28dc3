"""In which forms a document is drawn, as its provenance states it, so that its page can be drawn again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from importlib.metadata import version
from typing import Any

from recoil_acquisition.packages.extras import PDF
from recoil_identification.report.document.report_files import DRAWN
from recoil_identification.report.page.page_files import script_sha256


@dataclass(frozen=True)
class Forms:
    """Forms in which a document is drawn: its units, header and logo are in the document's ``issued``.

    Attributes
    ----------
    pdf, figures, standalone
        Whether there is a paper copy, a file of each figure, and the script in the page itself, as
        `recoil_daq.reports.output.Output` has them.
    script
        SHA-256 of the script that draws the figures on a screen.
    typst
        Version of the library that typesets paper copy and pictures; None where neither is drawn.
    """

    pdf: bool
    figures: bool
    standalone: bool
    script: str
    typst: str | None

    @classmethod
    def now(cls, *, pdf: bool = False, figures: bool = False, standalone: bool = False) -> Forms:
        """Return forms as they are drawn by what is installed.

        Raises
        ------
        StoreError
            If the script is not installed.
        """
        typesets = (pdf or figures) and PDF.is_installed
        return cls(pdf, figures, standalone, script_sha256(), version(PDF.module) if typesets else None)

    def to_json(self) -> dict[str, Any]:
        """Return them as the provenance states them."""
        return asdict(self)

    @classmethod
    def of_document(cls, document: Mapping[str, Any]) -> Forms | None:
        """Return the forms that a document states; None of one that an earlier version wrote.

        Raises
        ------
        ValueError, LookupError, TypeError
            If it states something else.
        """
        stated = document["provenance"].get(DRAWN)
        if stated is None:
            return None
        found = cls(*(stated[one.name] for one in fields(cls)))
        flags = (found.pdf, found.figures, found.standalone)
        if not all(isinstance(one, bool) for one in flags) or not isinstance(found.script, str):
            raise TypeError(f"provenance.{DRAWN} with something else than forms of a page")
        return found
