"""A campaign's answer made again from its shots' reports, and every document of a folder checked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError, RecoilDaqError, quoted
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.remark import Note, NoteCode
from recoil_daq.campaigns.campaign import campaign_pages
from recoil_daq.campaigns.sources import CUTOFF_FILE, CampaignReport
from recoil_daq.certificates.kept_certificate import KeptCertificate
from recoil_daq.certificates.signature import NOBODY, Trust
from recoil_daq.reports.explanation import (
    CheckedReport,
    CheckedReports,
    Explained,
    explained_again,
    folders_of,
)
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.report_folder import way_inside
from recoil_daq.reports.reproduction.ingredient import Ingredient, digest_differences, rows_since
from recoil_daq.reports.reproduction.kept_document import Again, KeptDocument
from recoil_daq.reports.reproduction.kept_report import SHOTS, Kept, KeptTarget
from recoil_daq.reports.reproduction.places import DAY_DEPTH, find_reports, named_in, reports_in, targets_in
from recoil_daq.reports.reproduction.recomputed import recompute
from recoil_daq.terminal.result import Progress
from recoil_daq.version import __version__
from recoil_daq.workers import Workers
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.combination import combine
from recoil_identification.report.document.campaign_document import (
    CAMPAIGN_FILE,
    LARGEST_ANSWER,
    SCHEMA,
    TABLE_FILE,
    campaign_document,
    campaign_table,
    with_history,
)
from recoil_identification.report.document.certificate_document import CERTIFICATE_FILE
from recoil_identification.report.document.report_files import DRAWN, REPORT_FILE
from recoil_identification.report.document.reproduction import Comparison
from recoil_identification.report.page.html import CAMPAIGN_PAGE
from recoil_identification.report.page.page_files import SCRIPT_NAME
from recoil_identification.report.paper.paper import CAMPAIGN_PDF
from recoil_identification.report.results.history import history_again
from recoil_rigs.tables.issue import Issue

OF_THE_RUN = frozenset({NoteCode.IDENTIFIED_ANEW, NoteCode.LOG_ROW, NoteCode.SET_ASIDE})
"""Codes of notes that tell of the run that made an answer, and that no report tells again."""


class KeptCampaign(KeptDocument):
    """A campaign's answer as it stands in its folder."""

    file, schema, largest, anew = CAMPAIGN_FILE, SCHEMA, LARGEST_ANSWER, "combine the shots anew"
    called = ("a campaign's answer", "answer of a campaign")
    several_scripts = False

    def _needed(self) -> object:
        provenance = self.document["provenance"]
        digests = [str(one["sha256"]) for one in provenance["inputs"]]
        shots = [(str(one["shot"]), dict(one["shot_log"]), one["report"]) for one in self.document["shots"]]
        if "history" in self.document:
            history_again(self.document["history"], self.document)
        Forms.of_document(self.document)
        return digests, shots, self.issued, self.notes, self.set_aside, provenance["version"]

    @property
    def issued(self) -> Issue:
        """Identity of the answer."""
        return Issue.model_validate(self.document.get("issued") or {})

    @property
    def set_aside(self) -> list[dict[str, Any]]:
        """Shots that are not in it because they are made of the files of another one."""
        return [dict(one) for one in self.document.get("set_aside") or ()]

    @property
    def notes(self) -> list[Note]:
        """Notes of the run that made it; an earlier version did not state which these are."""
        return [
            Note(NoteCode(one["code"]), one["about"], str(one["text"]))
            for one in self.document.get("findings") or ()
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

    def again(self, folders: Sequence[Path], progress: Progress) -> Again:
        """Combine its shots again from their reports.

        Raises
        ------
        ReadError
            If a report that it was made of is not found or has changed.
        IdentificationError
            As of `recoil_identification.campaign.combination.combine`.
        """
        progress("combine")
        reports, stated = self.reports(folders), self.document
        combined = combine(self.combined_shots(reports))
        combined = replace(combined, notes=(*combined.notes, *self.notes))
        again = campaign_document(
            combined,
            version=__version__,
            inputs=stated["provenance"]["inputs"],
            parameters={},
            pages={one["shot"]: one["report"] for one in stated["shots"] if one["report"] is not None},
            issued=self.issued,
            set_aside=self.set_aside,
            drawn=stated["provenance"].get(DRAWN),
        )
        if "history" in stated:
            again = with_history(again, history_again(stated["history"], again))
        places = {report.shot().name: report.path.parent for report in reports}
        count, version = len(self.shots), stated["provenance"]["version"]
        return Again(
            again, {TABLE_FILE: campaign_table(again)}, partial(campaign_pages, combined=combined, places=places),
            (f"combine {count} shots by their reports, recoil-daq {version}",), tuple(self._ingredients(folders)),
        )  # fmt: skip

    def drawn_as(self) -> tuple[str, str]:
        """Return the file names of its page and its paper copy."""
        return CAMPAIGN_PAGE, CAMPAIGN_PDF

    def besides(self) -> tuple[Comparison, set[str]]:
        """Name all files of its folder that are known but for its drawings."""
        return Comparison(), {self.path.name, TABLE_FILE, SCRIPT_NAME, CUTOFF_FILE}

    @property
    def shots(self) -> tuple[str, ...]:
        """Names of its shots."""
        return tuple(str(one["shot"]) for one in self.document["shots"])

    @property
    def name(self) -> str:
        """Name of its rig."""
        return str(self.document["rig"])

    def combined_shots(self, reports: Sequence[CampaignReport]) -> list[CampaignShot]:
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

    def changed(self, folders: Sequence[Path]) -> Comparison:
        """Compare the reports of these shots in folders that were named with those that the answer was made of."""
        wanted = {str(one["sha256"]) for one in self.document["provenance"]["inputs"]}
        return digest_differences(
            (folder / shot / REPORT_FILE, wanted, "one of the inputs") for shot in self.shots for folder in folders
        )

    def _reports(self, shot: str, page: object, folders: Sequence[Path]) -> Iterator[CampaignReport]:
        """Yield the reports that may be those of a shot, as far as they can be read."""
        home = self.home
        beside = [found.parent for found in [way_inside(home, page, _root(home))] if found is not None]
        places = [*beside, *(folder / shot for folder in (*folders, home / "reports", home.parent / "reports"))]
        for place in dict.fromkeys(places):
            if (place / REPORT_FILE).is_file():
                yield CampaignReport.read(place / REPORT_FILE)

    def _ingredients(self, folders: Sequence[Path]) -> Iterator[Ingredient]:
        """Yield the reports, which were found by their digests, and the shot log.

        That is looked for beside the answer, in a folder of shots beside it, and in `folders`.
        """
        places = (*folders, *(up / inside for up in (self.home, self.home.parent) for inside in ("", SHOTS)))
        since = partial(rows_since, logged={str(one["shot"]): one["shot_log"] for one in self.document["shots"]})
        for one in self.document["provenance"]["inputs"]:
            name = Path(one["file"]).name
            if name == REPORT_FILE:
                yield Ingredient(one["file"], one["sha256"], (), "as it was")
            else:
                paths = tuple(place / name for place in places)
                yield Ingredient(one["file"], one["sha256"], paths, "not here: what it said is in the answer", since)


def _root(home: Path) -> Path:
    """Return the folder beyond which an answer's reports are not looked for: the third above, as of a shot file."""
    return [home.absolute(), *home.absolute().parents][:4][-1]


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
        Key path of what is to be explained: ``mass``, ``rpe``, ``budget``, ``peaks``, ``alignment``, ``mass.u``,
        ``peaks.breech_pressure_pa``, ``budget.packing friction``, any other key of the document. None for the first
        five.
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
    if path.name == CAMPAIGN_FILE or (path / CAMPAIGN_FILE).is_file():
        return explained_again(KeptCampaign.read(path), key, folders_of(shots), progress)
    if path.name == CERTIFICATE_FILE or (path / CERTIFICATE_FILE).is_file():
        return explained_again(KeptCertificate.read(path), key, folders_of(shots), progress)
    found = find_reports(path)
    if len(found) > 1:
        raise ReadError(
            f"{len(found)} reports in this folder", path=path, expected="one",
            remedy=f"name one of them, or check them all: `recoil-daq explain {quoted(path)} --check`, in Python "
            "`check_reports`",
        )  # fmt: skip
    return explained_again(kept_document(found[0]), key, folders_of(shots), progress)


def kept_document(path: Path) -> KeptDocument:
    """Read a document that can be made again, by the name of its file; ReadError if it is none."""
    kinds: dict[str, type[KeptDocument]] = {
        CAMPAIGN_FILE: KeptCampaign, REPORT_FILE: Kept, CERTIFICATE_FILE: KeptCertificate,
    }  # fmt: skip
    return kinds.get(path.name, KeptTarget).read(path)


def documents_in(folder: Path) -> list[Path]:
    """Return what can be made again in a folder, as of a day: reports, targets, campaigns, certificates."""
    return [
        *reports_in(folder, depth=DAY_DEPTH),
        *targets_in(folder, depth=DAY_DEPTH),
        *named_in(folder, CAMPAIGN_FILE, CERTIFICATE_FILE, depth=DAY_DEPTH),
    ]


@on_one_thread
def check_reports(
    place: str | Path,
    *,
    shots: str | Path | None = None,
    workers: int | Workers | None = None,
    executor: Executor | None = None,
    trust: Trust = NOBODY,
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
    trust
        Knowledge of whose the signatures of certificates should be.
    progress
        Function called with how many are done, and how long the others may take.

    Raises
    ------
    ReadError
        If there is none at all.
    """
    paths, folders = find_reports(place, documents_in), folders_of(shots)
    with Workers.of(workers, executor) as crew:
        work = partial(_checked, shots=[crew.place(folder) for folder in folders], trust=trust)
        names = [path.parent.name for path in paths]
        done = crew.outcomes(work, [crew.place(path) for path in paths], names, progress=progress)
        found = [
            CheckedReport(path, fault=str(one)) if isinstance(one, RecoilDaqError) else replace(one, report=path)
            for path, one in zip(paths, done, strict=True)
        ]
    return CheckedReports(tuple(found))


def _checked(path: Path, shots: Sequence[Path], trust: Trust) -> CheckedReport:
    kept = kept_document(path)
    if isinstance(kept, KeptCertificate):
        kept = replace(kept, trust=trust)
    return CheckedReport(path, kept.name, kept.same_computer, recompute(kept, shots).whole(shots))
