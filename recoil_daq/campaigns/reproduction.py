"""A campaign's answer made again from its shots' reports, and every document of a folder checked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError, RecoilDaqError
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.linear_algebra import on_one_thread
from recoil_acquisition.remark import Note, NoteCode
from recoil_acquisition.shot import InputFile
from recoil_acquisition.store.shot_log import ShotLog
from recoil_daq.arguments import named_report
from recoil_daq.campaigns.campaign import campaign_pages
from recoil_daq.campaigns.sources import CUTOFF_FILE, CampaignReport
from recoil_daq.reports.drawings import Drawings, strangers
from recoil_daq.reports.explanation import (
    CheckedReport,
    CheckedReports,
    Explained,
    checked_report,
    entries_of,
    explain_report,
    folders_of,
)
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.reproduction import SHOTS, compared_again, made_here, other_digits, reports_in, targets_in
from recoil_daq.terminal.result import Progress
from recoil_daq.version import __version__
from recoil_daq.workers import Workers
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.combination import combine
from recoil_identification.report.campaign_document import (
    CAMPAIGN_FILE,
    LARGEST_ANSWER,
    SCHEMA,
    TABLE_FILE,
    campaign_document,
    campaign_table,
    with_history,
)
from recoil_identification.report.history import history_again
from recoil_identification.report.html import CAMPAIGN_PAGE
from recoil_identification.report.page_files import SCRIPT_NAME
from recoil_identification.report.paper import CAMPAIGN_PDF
from recoil_identification.report.report_files import DRAWN, REPORT_FILE, computer
from recoil_identification.report.reproduction import Comparison, Difference
from recoil_rigs.tables.issue import Issue

OF_THE_RUN = frozenset({NoteCode.IDENTIFIED_ANEW, NoteCode.LOG_ROW, NoteCode.SET_ASIDE})
"""Codes of notes that tell of the run that made an answer, and that no report tells again."""


@dataclass(frozen=True)
class KeptCampaign:
    """A campaign's answer as it stands in its folder.

    Attributes
    ----------
    document
        Contents of ``campaign.json``.
    path
        Path of that file.
    other_digits
        Numerals in it that its numbers are not written with.
    """

    document: Mapping[str, Any]
    path: Path
    other_digits: tuple[str, ...]

    @classmethod
    def read(cls, path: Path) -> KeptCampaign:
        """Read an answer, of its file or of the folder that it is in.

        Raises
        ------
        ReadError
            If there is none, or it lacks what it takes to make it again.
        """
        path = path / CAMPAIGN_FILE if path.is_dir() else path
        content = read_small(path, LARGEST_ANSWER, "a campaign's answer")
        try:
            document = read_json(content)
            if document["schema"] != SCHEMA:
                raise ValueError(f"schema {document['schema']!r}")
            kept = cls(document, path, other_digits(content))
            kept._needed()
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
            raise ReadError(
                "this is no answer of a campaign that can be made again",
                path=path,
                found=f"no {error}" if isinstance(error, LookupError) else str(error),
                remedy="combine the shots anew",
            ) from error
        return kept

    def _needed(self) -> tuple[object, ...]:
        """Look at all that it takes to make it again."""
        provenance = self.document["provenance"]
        digests = [str(one["sha256"]) for one in provenance["inputs"]]
        shots = [(str(one["shot"]), dict(one["shot_log"]), one["report"]) for one in self.document["shots"]]
        if "history" in self.document:
            history_again(self.document["history"], self.document)
        Forms.of_document(self.document)
        return digests, shots, self.issued, self.notes, self.document["set_aside"], provenance["version"]

    @property
    def issued(self) -> Issue:
        """Identity of the answer."""
        return Issue.model_validate(self.document["issued"])

    @property
    def notes(self) -> list[Note]:
        """Notes of the run that made it."""
        return [
            Note(NoteCode(one["code"]), one["about"], str(one["text"]))
            for one in self.document["findings"]
            if one["code"] in OF_THE_RUN
        ]

    def reports(self, folders: Sequence[Path] = ()) -> list[CampaignReport]:
        """Return the report of each shot, the one whose digest the answer states.

        Parameters
        ----------
        folders
            Folders in which to look for reports before those beside the answer.

        Raises
        ------
        ReadError
            If a report is not found, or is another one.
        """
        wanted = {str(one["sha256"]) for one in self.document["provenance"]["inputs"]}
        found = []
        for one in self.document["shots"]:
            name = str(one["shot"])
            report = next((r for r in self._reports(name, one["report"], folders) if r.sha256 in wanted), None)
            if report is None:
                raise ReadError(
                    f"the report of shot {name} that this answer was made of is not found",
                    path=self.path,
                    expected="a report.json whose SHA-256 is among the `inputs`",
                    remedy="give the folder of the reports with --shots, or combine the shots anew",
                )
            found.append(report)
        return found

    def shots(self, reports: Sequence[CampaignReport]) -> list[CampaignShot]:
        """Return the shots as they were combined, by their reports."""
        logs = [one["shot_log"] for one in self.document["shots"]]
        return [
            replace(
                report.shot(),
                configuration=str(log.get("configuration", "")),
                added_mass_kg=float(log.get("added_mass_kg", 0.0)),
                u_added_mass_kg=float(log.get("u_added_mass_kg", 0.0)),
                excluded=str(log.get("exclude", "")),
                log=dict(log),
            )
            for report, log in zip(reports, logs, strict=True)
        ]

    def changed_reports(self, folders: Sequence[Path]) -> Comparison:
        """Compare the reports of these shots in folders that were named with those that the answer was made of."""
        wanted = {str(one["sha256"]) for one in self.document["provenance"]["inputs"]}
        differences = tuple(
            Difference(f"SHA-256 of {path}", "one of the inputs", now)
            for one in self.document["shots"]
            for path in (folder / str(one["shot"]) / REPORT_FILE for folder in folders)
            if path.is_file() and (now := InputFile.of(path).sha256) not in wanted
        )
        return Comparison(0, differences, 0.0)

    def _reports(self, shot: str, page: str | None, folders: Sequence[Path]) -> Iterator[CampaignReport]:
        """Yield the reports that may be those of a shot, as far as they can be read."""
        home = self.path.absolute().parent
        beside = [] if page is None else [(home / page).parent]
        places = [*beside, *(folder / shot for folder in (*folders, home / "reports", home.parent / "reports"))]
        for place in dict.fromkeys(places):
            if (place / REPORT_FILE).is_file():
                yield CampaignReport.read(place / REPORT_FILE)

    def files(self, folders: Sequence[Path] = ()) -> Iterator[dict[str, Any]]:
        """Say of each file that the answer was made of whether it is still as it was.

        The reports are there, for they were found by their digests; the shot log is looked for beside the answer, in a
        folder of shots beside it, and in `folders`.
        """
        for one in self.document["provenance"]["inputs"]:
            if Path(one["file"]).name == REPORT_FILE:
                yield {**_stated_file(one), "state": "as it was"}
            else:
                yield self._log(one, folders)

    def _log(self, one: Mapping[str, Any], folders: Sequence[Path]) -> dict[str, Any]:
        """Say of the shot log whether it is still as it was, and if not, whether its rows of these shots are."""
        home = self.path.absolute().parent
        places = (*folders, *(up / inside for up in (home, home.parent) for inside in ("", SHOTS)))
        there = [place / Path(one["file"]).name for place in places if (place / Path(one["file"]).name).is_file()]
        digests = [(path, InputFile.of(path).sha256) for path in there]
        if not digests:
            return {**_stated_file(one), "state": "not here: what it said is in the answer"}
        path, now = next((found for found in digests if found[1] == one["sha256"]), digests[0])
        state = "as it was" if now == one["sha256"] else f"changed since{self._rows_since(path)}"
        return {**_stated_file(one), "found": str(path), "sha256_now": now, "state": state}

    def _rows_since(self, path: Path) -> str:
        try:
            log = ShotLog.read(path)
            rows = {str(one["shot"]): log.row(str(one["shot"])) for one in self.document["shots"]}
        except RecoilDaqError as error:
            return f", and at fault now: {error}"
        others = [
            str(one["shot"])
            for one in self.document["shots"]
            if _cells(one["shot_log"]) != _cells({} if (row := rows[str(one["shot"])]) is None else row.to_json())
        ]
        return f", and so are its rows of {', '.join(others)}" if others else ", its rows of these shots are the same"


def _stated_file(one: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a document states of a file, before it was looked for."""
    return {"file": one["file"], "sha256": one["sha256"], "found": None, "sha256_now": None}


def _cells(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the cells of a row that say something; no mass added is a mass of 0."""
    return {key: cell for key, cell in row.items() if cell not in (None, "", 0.0)}


def _made_again(kept: KeptCampaign, shots: Sequence[Path]) -> Comparison:
    """Combine a campaign's shots again from their reports, and compare every number of the answer."""
    reports = kept.reports(shots)
    combined = combine(kept.shots(reports))
    combined = replace(combined, notes=(*combined.notes, *kept.notes))
    again = campaign_document(
        combined,
        version=__version__,
        inputs=kept.document["provenance"]["inputs"],
        parameters={},
        pages={one["shot"]: one["report"] for one in kept.document["shots"] if one["report"] is not None},
        issued=kept.issued,
        set_aside=kept.document["set_aside"],
        drawn=kept.document["provenance"].get(DRAWN),
    )
    if "history" in kept.document:
        again = with_history(again, history_again(kept.document["history"], again))
    files = {TABLE_FILE: campaign_table(again)}
    found = compared_again(kept.path, kept.document, kept.other_digits, again, files)
    home, places = kept.path.absolute().parent, {report.shot().name: report.path.parent for report in reports}
    draw = partial(campaign_pages, combined=combined, places=places)
    drawn, names = Drawings(home, CAMPAIGN_PAGE, CAMPAIGN_PDF, home, draw).compared(
        kept.document, again, exact=made_here(kept.document)
    )
    others = strangers(home, {*names, kept.path.name, TABLE_FILE, SCRIPT_NAME, CUTOFF_FILE})
    return found.joined(drawn).joined(kept.changed_reports(shots)).joined(others)


def checked_campaign(path: Path, shots: Sequence[Path] = ()) -> CheckedReport:
    """Combine a campaign's shots again from their reports, and compare every number of the answer.

    Parameters
    ----------
    shots
        Folders in which to look for reports first.

    Raises
    ------
    ReadError
        If the answer, or a report that it was made of, is not found or has changed.
    IdentificationError
        As of `recoil_identification.campaign.combination.combine`.
    """
    kept = KeptCampaign.read(path)
    return CheckedReport(kept.path, str(kept.document["rig"]), made_here(kept.document), _made_again(kept, shots))


@on_one_thread
def explain(
    report: str | Path,
    key: str | None = None,
    *,
    shots: str | Path | None = None,
    progress: Progress = lambda _: None,
) -> Explained:
    """Explain the numbers of a report, of a target or of a campaign's answer, and make it again.

    Parameters
    ----------
    report
        Path of a ``report.json``, of the document of a target, of a ``campaign.json``, or the folder of a report or of
        an answer.
    key
        Key path of what is to be explained, as `recoil_daq.reports.explanation.explain_report` takes it.
    shots
        Folder in which to look for the shot file, or for a campaign's reports, first.
    progress
        Function called with the name of each step.

    Raises
    ------
    ReadError
        If there is no such document or key, or what it was made of is not found or has changed.
    StoreError, RigError, IdentificationError
        As of `recoil_daq.reports.identify.identify_file`.
    """
    path = Path(report)
    if path.name != CAMPAIGN_FILE and not (path / CAMPAIGN_FILE).is_file():
        return explain_report(report, key, shots=shots, progress=progress)
    kept = KeptCampaign.read(path)
    progress("combine")
    comparison = _made_again(kept, folders_of(shots))
    entries = entries_of(kept.path, kept.document, key, None, comparison)
    provenance, used = kept.document["provenance"], kept.document["shots"]
    return Explained(
        report=kept.path,
        shot=", ".join(str(one["shot"]) for one in used),
        rig=str(kept.document["rig"]),
        key=key,
        entries=entries,
        steps=(f"combine {len(used)} shots by their reports, recoil-daq {provenance['version']}",),
        parameters=provenance["parameters"],
        made={"recoil-daq": provenance["version"], **provenance.get("computer", {})},
        now={"recoil-daq": __version__, **computer()},
        files=tuple(kept.files(folders_of(shots))),
        exact=made_here(kept.document),
        comparison=comparison,
    )


def find_documents(place: str | Path) -> list[Path]:
    """Return what can be made again of a place: reports, documents of targets, and campaigns' answers.

    Raises
    ------
    ReadError
        If there is none.
    """
    place = named_report(Path(place))
    if place.is_file():
        return [place]
    if not place.is_dir():
        raise ReadError("no such file or folder", path=place, remedy="check the name and the folder")
    answers = sorted([*place.glob(CAMPAIGN_FILE), *place.glob(f"*/{CAMPAIGN_FILE}")])
    found = [*reports_in(place), *targets_in(place), *answers]
    if not found:
        raise ReadError(
            "no report in this folder",
            path=place,
            expected=f"a {REPORT_FILE}, or folders with one each",
        )
    return found


@on_one_thread
def check_reports(
    place: str | Path,
    *,
    shots: str | Path | None = None,
    workers: int | Workers | None = None,
    executor: Executor | None = None,
    progress: Progress = lambda _: None,
) -> CheckedReports:
    """Make every document of a folder again, and compare every number: reports and targets from their shot files.

    The answer of a campaign is made again from its shots' reports, whose digests it states.

    Parameters
    ----------
    place
        Folder of reports or of a campaign, the folder of one report, or a file of them.
    shots
        Folder in which to look for shot files, and for the reports of a campaign, first.
    workers, executor
        Workers that share the documents, as `recoil_daq.workers.Workers` takes them.
    progress
        Function called with how many are done, and how long the others may take.

    Raises
    ------
    ReadError
        If there is none at all.
    """
    paths, folders = find_documents(place), folders_of(shots)
    with Workers.of(workers, executor) as crew:
        work = partial(_checked, shots=[crew.place(folder) for folder in folders])
        names = [path.parent.name for path in paths]
        done = crew.outcomes(work, [crew.place(path) for path in paths], names, progress=progress)
        found = [
            CheckedReport(path, fault=str(one)) if isinstance(one, RecoilDaqError) else replace(one, report=path)
            for path, one in zip(paths, done, strict=True)
        ]
    return CheckedReports(tuple(found))


def _checked(path: Path, shots: Sequence[Path]) -> CheckedReport:
    return checked_campaign(path, shots) if path.name == CAMPAIGN_FILE else checked_report(path, shots)
