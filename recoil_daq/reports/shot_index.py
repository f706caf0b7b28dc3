"""Shot files and reports to one index: a table of all shots that leads to their reports."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import ReadError, RecoilDaqError
from recoil_acquisition.files.strict_json import told_in_one_line
from recoil_acquisition.shot.shot import InputFile
from recoil_acquisition.store import shot_summary
from recoil_acquisition.store.shot_log import ShotLog
from recoil_acquisition.store.shot_log_row import ShotLogRow
from recoil_daq.arguments import REPORTS, SHOTS, named_report, named_shot
from recoil_daq.reports.comparison import report_fault
from recoil_daq.reports.output import Output
from recoil_daq.reports.report_folder import publish, way_to_page
from recoil_daq.reports.reproduction.places import ANEW, reports_in
from recoil_daq.terminal.result import PagedDocument, Progress
from recoil_daq.version import __version__
from recoil_identification.report.content.result_table import Row
from recoil_identification.report.document.report_files import REPORT_FILE, read_document, write_files
from recoil_identification.report.document.spreadsheet import refuse_without_workbooks, write_workbook
from recoil_identification.report.page.html import CAMPAIGN_PAGE, DAY_PAGE, INDEX_PAGE, render_results_page
from recoil_identification.report.page.page_files import write_page
from recoil_identification.report.results.shot_index import (
    INDEX,
    INDEX_TABLE,
    index_document,
    logged,
    row_of_report,
    row_of_summary,
)

if TYPE_CHECKING:
    import pandas as pd

INDEX_BOOK = "index.xlsx"
_NEAR = (
    ("Live page", ".", "live.html"), ("Day", ".", DAY_PAGE), ("Campaign", "../campaign", CAMPAIGN_PAGE),
    ("Campaign", "campaign", CAMPAIGN_PAGE),
)  # fmt: skip
"""Name, folder by that of the shot files, and file of pages that an index leads to; the last of a name counts."""
_FILES = (INDEX_PAGE, INDEX_TABLE, INDEX_BOOK)


@dataclass(frozen=True, repr=False)
class Indexed(PagedDocument):
    """An index of shots, and where it was written.

    Attributes
    ----------
    document
        Rows, how many there are of each verdict, and the files that could not be listed, in JSON types.
    page
        Page, ``index.html``; ``index.csv`` stands beside it, and ``index.xlsx`` where it was asked for.
    faults
        Errors of the files that could not be listed.
    """

    faults: tuple[RecoilDaqError, ...] = ()

    @property
    def shots(self) -> pd.DataFrame:
        """One row a shot or report, as ``index.csv``."""
        return INDEX.frame(self.document)

    def show(self) -> None:
        """Print a row a shot, and where the page is."""
        from recoil_daq.terminal.report import print_index

        print_index(self.to_json())

    def __repr__(self) -> str:
        return f"Indexed({len(self.document['shots'])} rows, {len(self.faults)} not listed -> {self.page})"


def index_shots(
    places: Sequence[str | Path] = (),
    *,
    out: str | Path = "index",
    xlsx: bool = False,
    overwrite: bool = False,
    progress: Progress = lambda _: None,
) -> Indexed:
    """List shots in one table, and write ``index.html`` and ``index.csv``.

    A report has a row, and a shot file that no report is of. What the log beside a shot file says of it now goes before
    what it said when the shot was identified. A file that cannot be read does not keep the others from their rows.

    Parameters
    ----------
    places
        Shot files, reports, and folders of either, in which the folders ``shots`` and ``reports`` are looked into, too;
        nothing for these two of the current folder.
    out
        Folder that gets the index.
    xlsx
        Whether ``index.xlsx`` is written, too; needs the extra ``xlsx``.
    overwrite
        Whether an index that is there is replaced.
    progress
        Function called with how many files are read.

    Raises
    ------
    ReadError
        If there is no shot at all.
    StoreError
        If an index is there already or cannot be written, or the extra is missing.
    """
    folder = Path(out)
    if xlsx:
        refuse_without_workbooks()
    Output(folder, overwrite=overwrite).refuse_unwritable(folder, _FILES)
    document, faults = listed([Path(one) for one in places], folder, progress)
    progress("page")
    page = render_results_page(document)

    def write(partial: Path) -> None:
        write_page(partial, page, INDEX_PAGE)
        write_files(partial, {INDEX_TABLE: INDEX.csv(document)})
        if xlsx:
            write_workbook(partial / INDEX_BOOK, {"shots": INDEX.frame(document)})

    publish(folder, write, obsolete=_FILES)
    return Indexed(document, folder / INDEX_PAGE, faults)


def listed(
    places: Sequence[Path], home: Path, progress: Progress = lambda _: None
) -> tuple[dict[str, Any], tuple[RecoilDaqError, ...]]:
    """Return the index of places, whose pages are found from a folder, and why files could not be listed."""
    found = _Files.of(places)
    rows, faults = [], []
    for number, one in enumerate(found.each(home)):
        progress(f"{number + 1} of at most {found.count} read")
        if isinstance(one, RecoilDaqError):
            faults.append(one)
        elif one is not None:
            rows.append(one)
    failed = [{"file": str(one.path), "error": str(one)} for one in faults]
    document = index_document(rows, version=__version__, failed=failed)
    near = {
        name: way
        for folder in dict.fromkeys(path.parent for path in found.shots)
        for name, inside, page in _NEAR
        if (way := way_to_page(home, folder / inside, page)) is not None and way != page
    }
    document["pages"] = [{"name": name, "page": way} for name, way in near.items()]
    if len(found.units) == 1:
        document["issued"] = {"units": [*next(iter(found.units))]}
    return document, tuple(faults)


@dataclass(frozen=True)
class _Files:
    """Shot files and reports of some places.

    Attributes
    ----------
    beside
        Reports in a folder beside one of shot files: those count that are of one of its shots.
    logs
        Shot logs by folder, as far as they were read.
    units
        Units in which reports that were read are to be read: where all agree, so is what they are listed in.
    """

    shots: tuple[Path, ...]
    reports: tuple[Path, ...]
    beside: frozenset[Path] = frozenset()
    logs: dict[Path, ShotLog] = field(default_factory=dict)
    units: set[tuple[str, ...]] = field(default_factory=set)

    @classmethod
    def of(cls, places: Sequence[Path]) -> _Files:
        """List the files of places, each once; ReadError where there is none."""
        shots: list[Path] = []
        reports: list[Path] = []
        beside: list[Path] = []
        usual = [one for one in (Path(SHOTS), Path(REPORTS)) if one.is_dir()]
        for place in places or usual:
            if place.suffix == ".json":
                reports.append(place)
                continue
            if not place.is_dir():
                report = named_report(place)
                shots += [] if report != place else [named_shot(place)]
                reports += [report / REPORT_FILE] if report != place else []
                continue
            inside = [place, *(folder for name in (SHOTS, REPORTS) if (folder := place / name).is_dir())]
            here = [path for folder in inside for path in sorted(folder.glob("*.h5"))]
            there = [path for folder in inside for path in reports_in(folder)]
            if not here and not there:
                raise ReadError(
                    "neither shot files nor reports in this folder", path=place,
                    expected=f"files that end in .h5, or folders with a {REPORT_FILE}",
                )  # fmt: skip
            shots += here
            reports += there
            beside += [] if there else reports_in(place.absolute().parent / REPORTS)
        if not shots and not reports:
            raise ReadError(
                f"no folder {SHOTS} or {REPORTS} here", path=Path(), remedy="name the folders of the shots and reports"
            )
        given = {path.absolute() for path in reports}
        near = [path for path in map(_short, dict.fromkeys(beside)) if path.absolute() not in given]
        return cls(tuple(dict.fromkeys(shots)), tuple(dict.fromkeys([*reports, *near])), frozenset(near))

    @property
    def count(self) -> int:
        """How many files there are."""
        return len(self.shots) + len(self.reports)

    def each(self, home: Path) -> Iterator[Row | RecoilDaqError | None]:
        """Yield the row of each file, or why it has none; None for a shot file whose report has one.

        Parameters
        ----------
        home
            Folder of the index, from which its pages are found.
        """
        by_digest: dict[str, Path] = {}
        if self.reports:
            for path in self.shots:
                try:
                    by_digest.setdefault(InputFile.of(path).sha256, path)
                except RecoilDaqError as error:
                    yield error
        named = {path.stem: path for path in self.shots}
        reported: set[Path] = set()
        for path in self.reports:
            try:
                document = read_document(path)
                if path in self.beside and not _is_of(document, by_digest, named):
                    continue
                yield self._of_report(path, document, by_digest, named, reported, home)
            except RecoilDaqError as error:
                yield error
        for path in self.shots:
            try:
                yield None if path in reported else self._of_shot(path)
            except RecoilDaqError as error:
                yield error

    def _of_report(
        self, path: Path, document: Mapping[str, Any], by_digest: Mapping[str, Path], named: Mapping[str, Path],
        reported: set[Path], home: Path,
    ) -> Row:  # fmt: skip
        """Return the row of a report, and note of which shot file it is."""
        with told_in_one_line("this report cannot be listed", path, remedy=ANEW):
            fault = report_fault(document)
            row = row_of_report(document)
            shot_file = by_digest.get(str(document["provenance"]["inputs"][0]["sha256"]))
            self.units.add(tuple(str(name) for name in (document.get("issued") or {}).get("units") or ()))
            INDEX.worded({"shots": [row]})  # what can be worded by itself can be worded among others
        row["report"] = way_to_page(home, path.parent)
        if fault:
            row |= {"valid": False, "reason": f"this report {fault}"}
        if shot_file is not None:
            reported.add(shot_file)
            said, now = logged(document.get("shot_log") or {}), self._log(shot_file, row["shot"])
            row |= {"file": str(shot_file), **now}
            if now["added_mass_kg"] != said["added_mass_kg"]:
                _remark(row, "the shot log states another added mass than this report: identify the shot anew")
        elif row["shot"] in named:
            _remark(row, f"this report is of another shot file than {named[row['shot']]}")
        return row

    def _of_shot(self, path: Path) -> Row:
        row = row_of_summary(shot_summary(path))
        return row | {"file": str(path), **self._log(path, row["shot"])}

    def _log(self, shot_file: Path, shot: str) -> Row:
        """Return what the log beside a shot file says of its shot."""
        folder = shot_file.parent
        if folder not in self.logs:
            self.logs[folder] = ShotLog.beside(shot_file)
        return logged((self.logs[folder].row(shot) or ShotLogRow(shot)).to_json())


def _short(path: Path) -> Path:
    """Return a path from the current folder where it is in that one."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


def _is_of(document: Mapping[str, Any], by_digest: Mapping[str, Path], named: Mapping[str, Path]) -> bool:
    """Return whether a report is of one of some shot files, by its digest or at least by its shot's name."""
    inputs = document["provenance"].get("inputs") or [{}]
    return str(inputs[0].get("sha256")) in by_digest or str(document["shot"]) in named


def _remark(row: Row, text: str) -> None:
    row["reason"] = "; ".join(one for one in (row["reason"], text) if one)
