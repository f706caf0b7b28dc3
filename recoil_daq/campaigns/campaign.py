"""Shot files, or their reports, to one answer."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.remark import Note, NoteCode, Remark
from recoil_acquisition.shot.recorded_file import Double, doubles
from recoil_acquisition.shot.shot import InputFile
from recoil_daq.campaigns.history import History
from recoil_daq.campaigns.in_memory import campaign_of_results, split_results
from recoil_daq.campaigns.sources import CampaignLogs, CampaignReport, Outdated, SharedCutoff, Source, sources_of
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.identify_folder import identify_shots, shared_options
from recoil_daq.reports.output import Output, Pages
from recoil_daq.reports.report_folder import way_to_page
from recoil_daq.reports.stored_shot import HEADER_FILE
from recoil_daq.terminal.result import MassDocument, Progress
from recoil_daq.version import __version__
from recoil_daq.workers import Workers
from recoil_identification.campaign.campaign import Campaign
from recoil_identification.campaign.campaign_shot import alike
from recoil_identification.campaign.changes import OUTLIER
from recoil_identification.campaign.combination import combine, refuse_too_few
from recoil_identification.campaign.overlay import Overlay, overlay
from recoil_identification.report.content.chosen_units import ChosenUnits
from recoil_identification.report.document.campaign_document import (
    CAMPAIGN_FILE,
    LARGEST_ANSWER,
    SCHEMA,
    TABLE_FILE,
    campaign_document,
    campaign_table,
    with_history,
    write_campaign,
)
from recoil_identification.report.document.report_files import CURVES_FILE, REPORT_FILE, read_curves, refuse_changed
from recoil_identification.report.figure.campaign_figures import campaign_figures
from recoil_identification.report.page.html import CAMPAIGN_PAGE, render_campaign_page
from recoil_identification.report.paper.paper import CAMPAIGN_PDF, campaign_pdf
from recoil_identification.report.results.history import history_figure
from recoil_identification.shot.identified import Options
from recoil_rigs.rig import find_rig
from recoil_rigs.tables.issue import CAMPAIGN, Issue, read_header
from recoil_rigs.tables.specification import mass_decimals

if TYPE_CHECKING:
    import pandas as pd

    from recoil_daq.reports.result import Result

REPORTS = "reports"
"""Folder, beside a campaign's answer, of the reports that were made for it."""


@dataclass(frozen=True, repr=False)
class CampaignDocument(MassDocument):
    """The answer of a campaign; its mass is the mechanism's, without what was added to it.

    Attributes
    ----------
    document
        Contents of ``campaign.json``.
    """

    @property
    def shots(self) -> pd.DataFrame:
        """One row a shot, as ``campaign.csv``."""
        import pandas as pd

        table = io.StringIO(campaign_table(self.document))
        return pd.read_csv(table, dtype={"shot": str, "configuration": str})

    @property
    def common(self) -> pd.DataFrame:
        """One row for each influence that the shots share: what was known of it and what the campaign learnt."""
        import pandas as pd

        return pd.DataFrame(self.document["common"])

    @property
    def peaks(self) -> pd.DataFrame:
        """One row for each quantity of shots that were fired alike: mean, scatter, ``u`` and U95 of the mean, SI."""
        import pandas as pd

        return pd.DataFrame(self.document.get("peaks", ()))

    def show(self) -> None:
        """Print the mass, what changed, what was learnt of the sensors, and the shots."""
        from recoil_daq.terminal.campaign import print_campaign

        print_campaign(self.to_json(), None)

    def __repr__(self) -> str:
        verdict, places = "valid" if self.valid else "not valid", mass_decimals(self.u_kg)
        return f"{type(self).__name__}({self.mass_kg:.{places}f} kg, u {self.u_kg:.{places}f} kg, {verdict})"


@dataclass(frozen=True, repr=False)
class Combined(CampaignDocument):
    """The answer of a campaign and where it was written.

    Attributes
    ----------
    folder
        Folder that holds ``campaign.json``, ``campaign.html`` with the script of its figures, and ``campaign.csv``.
    """

    folder: Path

    def show(self) -> None:
        """Print what `CampaignDocument.show` does, and where the page is."""
        from recoil_daq.terminal.campaign import print_campaign

        print_campaign(self.to_json(), self.folder)


@overload
def campaign(shots: Sequence[Result]) -> CampaignDocument: ...


@overload
def campaign(
    shots: str | Path | Sequence[str | Path],
    *,
    reports: str | Path = ...,
    log: str | Path | None = ...,
    out: str | Path = ...,
    cutoff_hz: float | None = ...,
    rig: str | Path | None = ...,
    workers: int | Workers | None = ...,
    executor: Executor | None = ...,
    pdf: bool = ...,
    figures: bool = ...,
    standalone: bool = ...,
    overwrite: bool = ...,
    header: str | Path | None = ...,
    history: str | Path | None = ...,
    progress: Progress = ...,
) -> Combined: ...


@on_one_thread
def campaign(
    shots: str | Path | Sequence[str | Path] | Sequence[Result],
    *,
    reports: str | Path = "reports",
    log: str | Path | None = None,
    out: str | Path = "campaign",
    cutoff_hz: float | None = None,
    rig: str | Path | None = None,
    workers: int | Workers | None = None,
    executor: Executor | None = None,
    pdf: bool = False,
    figures: bool = False,
    standalone: bool = False,
    overwrite: bool = False,
    header: str | Path | None = None,
    history: str | Path | None = None,
    progress: Progress = lambda _: None,
) -> CampaignDocument:
    """Combine shots of one rig to one mass, and write ``campaign.json``, ``.html`` and ``.csv``.

    A shot whose report in `reports` is not of this shot file, this version or this cut-off is identified anew, and its
    new report stands in ``out/reports``: what others made is left as it is. Of results in memory nothing is written. A
    shot that is made of recorded files of
    another one is set aside, whatever it is called. A run that was ended is taken up again by the next one, with the
    cut-off and the reports that are there.

    Parameters
    ----------
    shots
        Shot files, reports (``report.json``), and folders of either; or results in memory.
    reports
        Folder of the shots' reports, where there are any.
    log
        Shot log of all shots; None for the ``shotlog.csv`` beside each shot file, and for what a report states where
        the shot file is not at hand.
    out
        Folder that gets the answer.
    cutoff_hz
        Cut-off of the low-pass of all shots, Hz; None for that of the last time, as `out` has it, that of the reports
        where these agree, or one chosen from the spectra of all shots.
    rig
        Corrected rig file, as `recoil_daq.reports.identify.identify_file` takes it: a report that was made without it
        is not current. None takes the reports as they are, and the rig of each shot file where one is made anew.
    workers, executor
        Workers that identify the shots, as `recoil_daq.workers.Workers` takes them: the digits are the same, whoever
        does it.
    pdf, figures
        Whether the paper copy ``campaign.pdf`` is written, and each figure as SVG and PNG into ``figures``; both need
        the extra ``pdf``.
    standalone
        Whether ``campaign.html`` holds all that it shows, as one file to send. Otherwise the script of its figures is
        written beside it.
    overwrite
        Whether an answer that is there is replaced.
    header
        Header file with the identity of the answer, the keys of a rig's ``[report]``, which goes before what the
        shots' reports state alike; their numbers, issues, dates, approvals and concessions are not taken over.
    history
        Folder of earlier campaigns' answers, at any depth, with which the mass is compared; None to compare it with
        none.
    progress
        Function called with each step, how many shots are done, and how long the others may take.

    Raises
    ------
    ReadError, StoreError, RigError, WorkerError
        If a file is missing or damaged, the answer is there already or cannot be written, or an extra is
        missing.
    IdentificationError
        If the shots cannot be combined, or of one of them no number can be given at all.
    TypeError
        If a shot is neither a file nor a result, or there are both.
    ValueError
        If an argument is given with results in memory that only files have.
    """
    given = [shots] if isinstance(shots, str | Path) else list(shots)
    results, listed = split_results(given)
    if results:
        of_files = {
            "log": log, "cutoff_hz": cutoff_hz, "rig": rig, "workers": workers, "executor": executor, "pdf": pdf,
            "figures": figures, "standalone": standalone, "overwrite": overwrite, "header": header, "history": history,
            "reports": reports != "reports", "out": out != "campaign",
        }  # fmt: skip
        if stated_too := [name for name, value in of_files.items() if value not in (None, False)]:
            raise ValueError(f"{', '.join(stated_too)}: of files alone, not of results in memory")
        return CampaignDocument(campaign_of_results(results))
    output = Output(Path(out), pdf, figures, standalone, overwrite)
    output.refuse_missing_extra()
    folder = output.out
    output.refuse_unwritable(folder, (CAMPAIGN_FILE, TABLE_FILE, CAMPAIGN_PAGE, CAMPAIGN_PDF))
    sources = list(sources_of(listed, (Path(reports), folder / REPORTS)))
    # before any work: what is at fault leaves nothing behind
    stated = None if header is None else read_header(Path(header)).named(CAMPAIGN, folder.absolute().name)
    earlier = None if history is None else History.read(Path(history), folder)
    aside = _set_aside(sources)
    sources = [one for one in sources if one not in aside]
    told = [f"{one.place} is set aside: {double}" for one, double in aside.items()]
    refuse_too_few(len(sources), "; ".join([str(len(sources)), *told]))
    logs = CampaignLogs.of(None if log is None else Path(log), sources)
    kept = SharedCutoff.read(folder)
    wanted_hz = cutoff_hz if cutoff_hz is not None or kept is not None else _cutoff_hz_of(folder, sources)
    if wanted_hz is not None and (kept is None or kept.mass_cutoff_hz != wanted_hz):
        kept = SharedCutoff(None, wanted_hz)
    with Workers.of(workers, executor) as crew:
        whole, notes = current_reports(sources, kept, folder, rig, crew, progress)
    for one in whole:
        if CURVES_FILE in one.outputs:
            refuse_changed(one.path.parent / CURVES_FILE, one.outputs[CURVES_FILE])
    progress("combine")
    combined = combine([logs.applied(source, one.shot()) for source, one in zip(sources, whole, strict=True)])
    notes += logs.strangers([used.shot.name for used in combined.shots])
    notes += [Note(NoteCode.SET_ASIDE, one.name, text) for one, text in zip(aside, told, strict=True)]
    inputs: list[Mapping[str, Any]] = [
        {"file": f"{one.path.parent.name}/{one.path.name}", "sha256": one.sha256} for one in whole
    ]
    inputs += [{"file": read.path.name, "sha256": read.sha256} for read in logs.read.values()]
    if rig is not None:
        corrected = InputFile.of(find_rig(str(rig)))
        inputs.append({"file": corrected.name, "sha256": corrected.sha256})
    issued = Issue.model_validate(alike([one.shot for one in combined.shots])).of_another()
    if stated is not None and header is not None:
        issued = stated.over(issued)
        read = InputFile.of(Path(header))
        inputs.append({"file": read.name, "sha256": read.sha256, "source": HEADER_FILE})
    inputs += [] if earlier is None else earlier.inputs
    combined = replace(combined, notes=(*combined.notes, *notes))
    places = {one.shot().name: one.path.parent for one in whole}
    pages = {name: page for name, place in places.items() if (page := way_to_page(folder, place)) is not None}
    forms = output.forms
    document = campaign_document(
        combined, version=__version__, inputs=inputs, parameters={}, pages=pages, issued=issued,
        set_aside=[
            {"shot": one.name, "of": double.of, "files": list(double.files), "detail": str(double)}
            for one, double in aside.items()
        ],
        drawn=forms.to_json(),
    )  # fmt: skip
    if earlier is not None:
        document = with_history(document, earlier.beside(document, folder))
    progress("page")
    shown = campaign_pages(document, forms, combined, places)
    output.publish(folder, shown, lambda partial: write_campaign(partial, document), script_above=False)
    return Combined(document, folder)


def campaign_pages(document: Mapping[str, Any], forms: Forms, combined: Campaign, places: Mapping[str, Path]) -> Pages:
    """Draw the answer of a campaign.

    Parameters
    ----------
    places
        Folder of each shot's report, by shot, with the curves beside it.

    Raises
    ------
    ReadError
        If the curves of a shot cannot be read.
    """
    drawn = campaign_figures(combined, _curves(combined, places))
    season = history_figure(document)
    drawn[1:1] = [] if season is None else [season]
    drawn = ChosenUnits.of(document).figures(drawn)
    return Pages(
        CAMPAIGN_PAGE, render_campaign_page(document, drawn, standalone=forms.standalone),
        CAMPAIGN_PDF, campaign_pdf(document, drawn) if forms.pdf else None, drawn,
    )  # fmt: skip


def _set_aside(sources: Sequence[Source]) -> dict[Source, Double]:
    """Return the shots that are made of recorded files of one before them, which counts once; one name is one shot."""
    found = doubles((one.name, one.recorded) for one in sources)
    return {sources[place]: double for place, double in found.items() if double.of != sources[place].name}


def _curves(combined: Campaign, places: Mapping[str, Path]) -> Overlay | None:
    """Lay the shots' curves over one another, as far as they stand beside their reports."""
    standing_out = [shot for change in combined.changes if change.kind == OUTLIER for shot in change.shots]
    read = ((used.shot.name, read_curves(places[used.shot.name])) for used in combined.shots)
    return overlay(((name, curves) for name, curves in read if curves is not None), standing_out)


def _cutoff_hz_of(folder: Path, sources: Sequence[Source]) -> float | None:
    """Return the cut-off of the last time, or the one that all shots' reports agree on; None if there is none."""
    earlier = folder / CAMPAIGN_FILE
    if earlier.exists():
        try:
            stated = read_json(read_small(earlier, LARGEST_ANSWER, "a campaign's answer"))
            cutoff_hz = stated["provenance"]["parameters"]["cutoff_hz"]
            if stated["schema"] == SCHEMA and cutoff_hz is not None:
                return float(cutoff_hz)
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise ReadError(
                "this is no answer of a campaign", path=earlier, found=str(error), remedy="remove it, or choose --out"
            ) from error
    agreed = {one.report.cutoff_hz if one.report else None for one in sources}
    (cutoff_hz,) = agreed if len(agreed) == 1 else (None,)
    return cutoff_hz


def current_reports(
    sources: Sequence[Source],
    kept: SharedCutoff | None,
    folder: Path,
    rig: str | Path | None,
    workers: Workers,
    progress: Progress,
) -> tuple[list[CampaignReport], list[Note]]:
    """Return a current report of each shot, and which had to be made anew and why.

    Parameters
    ----------
    kept
        Cut-off of all shots; None if none is chosen.
    folder
        Folder of the answer.
    rig
        Corrected rig file; None if nothing is corrected.
    """
    doubts = _doubts(sources, kept, rig)
    anew = [one.shot_file for one, doubt in zip(sources, doubts, strict=True) if doubt and one.shot_file is not None]
    made = _made_anew(anew, sources, kept, folder, rig, workers, progress) if anew else {}
    whole, notes = [], []
    for source, doubt in zip(sources, doubts, strict=True):
        if doubt and source.report is not None:
            text = f"{source.report.path} {doubt}: the shot was identified anew"
            notes.append(Note(NoteCode.IDENTIFIED_ANEW, source.name, text))
        report = source.report if not doubt or source.shot_file is None else made[source.shot_file]
        whole += [] if report is None else [report]
    return whole, notes


def _doubts(sources: Sequence[Source], kept: SharedCutoff | None, rig: str | Path | None) -> list[Remark | None]:
    """Say of each shot why its report is to be made anew; None where it is current.

    Raises
    ------
    ReadError
        If one cannot be made anew from what is given.
    """
    rig_sha256 = "" if rig is None else InputFile.of(find_rig(str(rig))).sha256
    cutoff_hz = None if kept is None else kept.mass_cutoff_hz
    doubts = [one.why_not(cutoff_hz, rig_sha256) for one in sources]
    sound = {one.report.cutoff_hz for one, doubt in zip(sources, doubts, strict=True) if one.report and not doubt}
    if kept is None and (len(sound) > 1 or any(doubts)):
        own = Remark(Outdated.CUTOFF, None, "was found with a cut-off of its own")
        doubts = [doubt or own for doubt in doubts]
    for source, doubt in zip(sources, doubts, strict=True):
        if doubt and source.shot_file is None:
            raise ReadError(
                f"this report {doubt}, and its shot file is not given",
                path=source.place,
                remedy="give the shot file, or identify the shot anew",
            )
        report = None if doubt is None or doubt.code is Outdated.OTHER_SHOT else source.report
        if report is not None and rig is None and report.rig_sha256:
            raise ReadError(
                f"this report {doubt}, and was made with a corrected rig file",
                path=report.path,
                remedy="give that rig file with --rig, or remove the report",
            )
    return doubts


def _made_anew(
    anew: Sequence[Path],
    sources: Sequence[Source],
    kept: SharedCutoff | None,
    folder: Path,
    rig: str | Path | None,
    workers: Workers,
    progress: Progress,
) -> dict[Path, CampaignReport]:
    """Identify shot files with the cut-off that is kept, or with one that is chosen from all shots and kept."""
    files = [one.shot_file for one in sources if one.shot_file is not None]
    if kept is None:
        options = shared_options(
            files, Options(), rig=rig, workers=workers,
            progress=lambda done: progress(f"one cut-off for all shots, {done}"),
        )  # fmt: skip
        kept = SharedCutoff.of(list(options.values()))
    else:
        options = dict.fromkeys(files, kept.options)
    if kept is not None:
        # before the first report: a run that is ended here has chosen
        kept.write(folder)
    output = Output(folder / REPORTS, overwrite=True)
    done = identify_shots({path: options[path] for path in anew}, output, rig=rig, workers=workers, progress=progress)
    return {path: CampaignReport.read(one.folder / REPORT_FILE) for path, one in zip(anew, done, strict=True)}
