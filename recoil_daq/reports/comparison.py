"""A report beside others, of the same shot evaluated in another way or of another shot: one page."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.regular_file import read_small, require_name
from recoil_acquisition.files.strict_json import told_in_one_line
from recoil_acquisition.store import shot_summary
from recoil_daq.reports.output import Output
from recoil_daq.reports.report_folder import publish, refuse_existing, way_to_page
from recoil_daq.reports.reproduction.places import ANEW, find_reports
from recoil_daq.terminal.result import PagedDocument
from recoil_daq.version import __version__
from recoil_identification.report.document.report_files import (
    LARGEST_REPORT,
    REPORT_FILE,
    SEAL,
    read_curves,
    read_document,
    read_trace,
    refuse_changed,
    seal_fault,
)
from recoil_identification.report.page.html import BESIDE_PAGE, render_results_page
from recoil_identification.report.page.page_files import write_page, write_script
from recoil_identification.report.results.beside import Laid, beside_document, beside_figures


@dataclass(frozen=True, repr=False)
class Beside(PagedDocument):
    """Reports beside one another, and where their page was written.

    Attributes
    ----------
    document
        Rows of what differs and of what is equal, in JSON types.
    page
        Page, ``beside.html`` in the folder of the first report.
    """

    def show(self) -> None:
        """Print what differs, and where the page is."""
        from recoil_daq.terminal.report import print_beside

        print_beside(self.to_json())

    def __repr__(self) -> str:
        return f"Beside({len(self.document['reports'])} reports -> {self.page})"


@dataclass(frozen=True)
class Others:
    """Reports that new ones are to be laid beside.

    Attributes
    ----------
    of_places
        Places that were given, each with the files of the reports in it and, where there are several, the shot of each.
    """

    of_places: tuple[tuple[Path, Mapping[Path, str]], ...]

    @classmethod
    def read(cls, places: Sequence[str | Path]) -> Others:
        """Find the reports of places: report files, their folders, or folders of reports.

        Raises
        ------
        ReadError
            If there is none, or one of several is damaged.
        """
        of_places = []
        for place in places:
            found = find_reports(place)
            # one that stands alone is taken whatever its shot is
            shots = [str(read_document(path)["shot"]) for path in found] if len(found) > 1 else [""]
            of_places.append((Path(place), dict(zip(found, shots, strict=True))))
        return cls(tuple(of_places))

    def beside(self, folder: Path, shot: str) -> list[Path]:
        """Return those that are laid beside the report of a shot: of a folder of several the one of that shot.

        Raises
        ------
        ReadError
            If a folder of several has none of it, or the report itself would replace one of them.
        """
        found: dict[str, Path] = {}
        for place, reports in self.of_places:
            taken = [path for path, of_shot in reports.items() if len(reports) == 1 or of_shot == shot]
            if not taken:
                raise ReadError(
                    f"no report of shot {shot} in this folder of reports", path=place, remedy="name the report itself"
                )
            for path in taken:
                found.setdefault(os.path.realpath(path.parent), path)
        if os.path.realpath(folder) in found:
            other = found[os.path.realpath(folder)].parent
            raise ReadError(
                "this report is to be laid beside itself", path=other, remedy="give another --out for the new one"
            )
        return list(found.values())

    def refuse_before(self, shot_files: Sequence[Path], output: Output) -> None:
        """Raise, before any shot is identified, what `beside` would raise of their new reports."""
        sound: set[Path] = set()
        for path in shot_files:
            shot = str(shot_summary(path)["shot"])
            for report in self.beside(output.out / shot, shot):
                if report not in sound:
                    read_laid(report)
                    sound.add(report)
            output.refuse_existing(output.out / shot, (BESIDE_PAGE,))


def beside(
    report: str | Path,
    others: Sequence[str | Path] | Others,
    *,
    standalone: bool = False,
    overwrite: bool = False,
) -> Beside:
    """Lay a report beside others, and write ``beside.html`` into its folder.

    Parameters
    ----------
    report
        Folder of a report, or its ``report.json``.
    others
        Reports, of this or of other shots, or folders of reports, of which the one of this shot is taken.
    standalone
        Whether the page holds all that it shows, as one file to send. Otherwise the script of its figures stands in the
        folder above, once for all reports there.
    overwrite
        Whether the page that is there is replaced.

    Raises
    ------
    ReadError
        If a report is missing or damaged.
    StoreError
        If the page is there already or cannot be written.
    """
    path = Path(report) / REPORT_FILE if Path(report).is_dir() else Path(report)
    home, own = path.parent, read_laid(path)
    read = others if isinstance(others, Others) else Others.read(others)
    all_of_them = [(home, own)]
    all_of_them += [(one.parent, read_laid(one)) for one in read.beside(home, str(own.document["shot"]))]
    if not overwrite:
        refuse_existing(home, (BESIDE_PAGE,))
    names = _names([folder for folder, _ in all_of_them])

    def write(partial: Path) -> None:
        write_page(partial, page, BESIDE_PAGE)
        if not standalone:
            write_script(home.parent)

    laid = [
        replace(one, name=name, page=way_to_page(home, folder))
        for name, (folder, one) in zip(names, all_of_them, strict=True)
    ]  # fmt: skip
    document = beside_document(laid, version=__version__)
    page = render_results_page(document, beside_figures(laid), standalone=standalone)
    publish(home, write)
    return Beside(document, home / BESIDE_PAGE)


def read_laid(path: Path) -> Laid:
    """Read a report and the files beside it; ReadError if one is damaged."""
    folder, content = path.parent, read_small(path, LARGEST_REPORT, "a report")
    one = Laid(
        name=folder.name,
        document=_vouched(path, read_document(path, content)),
        sha256=hashlib.sha256(content).hexdigest(),
        trace=read_trace(folder),
        curves=read_curves(folder),
    )
    with told_in_one_line("this report cannot be laid beside others", path, remedy=ANEW):
        # what can be laid beside itself can be laid beside others: a text where a number belongs shows before any work
        json.dumps(beside_document([one], version=__version__), ensure_ascii=False).encode()
        beside_figures([one])
    return one


def report_fault(document: Mapping[str, Any]) -> str:
    """Say why a report is not what was written; empty if it is, or an earlier version wrote no digest into it.

    Raises
    ------
    LookupError, TypeError, AttributeError
        If it has no provenance.
    """
    provenance = document["provenance"]
    earlier = SEAL not in provenance and provenance["version"] != __version__
    return "" if earlier else seal_fault(document)


def _vouched(path: Path, document: dict[str, Any]) -> dict[str, Any]:
    """Return a report that is what was written; of an earlier version, which wrote no digest, nothing vouches for it.

    Raises
    ------
    ReadError
        If it was changed since, or a file beside it was.
    """
    with told_in_one_line("this is no report of a shot", path):
        fault = report_fault(document)
        listed = {str(one["file"]): str(one["sha256"]) for one in document["provenance"].get("outputs", ())}
        for name in listed:
            require_name(name)
    if fault:
        raise ReadError(f"this report {fault}", path=path, remedy=ANEW)
    for name, sha256 in listed.items():
        refuse_changed(path.parent / name, sha256)
    return document


def _names(folders: Sequence[Path]) -> list[str]:
    """Name folders by as much of the end of their paths as tells them apart."""
    parts = [Path(os.path.realpath(folder)).parts for folder in folders]
    count = next(n for n in range(1, 1000) if len({one[-n:] for one in parts}) == len(set(parts)))
    return ["/".join(one[-count:]) for one in parts]
