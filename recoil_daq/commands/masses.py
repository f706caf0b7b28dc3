"""Commands that identify masses, of one shot and of many, and make a report again."""

import math
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from recoil_acquisition.errors import RecoilDaqError
    from recoil_daq.reports.comparison import Beside
    from recoil_daq.reports.identify import Reported
    from recoil_daq.reports.targets import TargetReported
    from recoil_daq.workers import Workers
    from recoil_identification.calibration.methods import Method

from recoil_daq.commands.options import DebugOption, JsonOption, OverwriteOption, VerboseOption, WorkersOption, number
from recoil_daq.terminal.session import FAULT, NOT_VALID, OK, Session

CorrectedRigOption = Annotated[
    str | None,
    typer.Option(
        "--rig",
        help="A rig file with corrected calibrations or values of the mechanism.",
        show_default="that of each shot file",
    ),
]
HeaderOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="A file with the identity of the report: laboratory, customer, order, number, issue, approval, remark, "
        "logo, concession, tolerance_kg and units, as in a rig's [report].",
        show_default="the rig's [report]",
    ),
]
StandaloneOption = Annotated[
    bool, typer.Option("--standalone", help="Write each page as one file that needs no other, to send or to keep.")
]
MethodOption = Annotated[
    Literal["calibrated", "reverse", "forward", "paper", "camera", "tls"] | None,
    typer.Option(
        help="Estimator of the reported mass. `paper` is the published one: unfiltered, force on acceleration.",
        show_default="calibrated; camera without an accelerometer on the recoiling part",
    ),
]
PdfOption = Annotated[
    bool, typer.Option("--pdf", help="Write a paper copy (PDF/A-3b) beside the page. Needs the extra `pdf`.")
]
FiguresOption = Annotated[
    bool, typer.Option("--figures", help="Write each figure as SVG and PNG, too. Needs the extra `pdf`.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        metavar="tcp://HOST:PORT",
        help="A dask scheduler, whose workers share the shots. They see the same files under the same paths (a shared "
        "file system), have this version installed, and are best started with --nthreads 1.",
        show_default=False,
    ),
]


def _crew(number: int | None, cluster: str | None) -> "AbstractContextManager[Workers]":
    """Return who shares the work."""
    if cluster is None:
        from recoil_daq.workers import Workers

        return Workers(number)
    if number is not None:
        raise typer.BadParameter("give either --workers or --cluster")
    from recoil_daq.workers import workers_at

    return workers_at(cluster)


def _known_targets(names: list[str] | None) -> list[str] | None:
    if names:
        from recoil_identification.targets import target_names

        known = ("mass", *target_names())
        for name in names:
            if name not in known:
                raise typer.BadParameter(f"{name!r} is none of {', '.join(known)}")
    return names


def _known_filter(name: str) -> str:
    if name != USUAL_FILTER:
        from recoil_processing.filters.table import filter_names

        if name not in filter_names():
            raise typer.BadParameter(f"{name!r} is none of {', '.join(filter_names())}")
    return name


USUAL_FILTER = "butterworth"
"""Name of the low-pass where none is asked for: what has the others loads numpy."""

TargetOption = Annotated[
    list[str] | None,
    typer.Option(
        callback=_known_targets,
        help="What to identify; may be repeated: mass, parameters, stiffness, breech-force, inertia-force, "
        "resistance, arx, and those that other packages announce.",
        show_default="mass",
    ),
]


MEMORY = "0.02"
"""Memory of the trace where none is asked for, s."""


def _memory(text: str) -> float | None:
    """Read the memory of the trace: seconds, or None for ``auto``."""
    if text == "auto":
        return None
    if text == MEMORY:  # what reads another loads numpy, and too little memory is to be told first
        return float(text)
    from recoil_acquisition.quantities.typed_quantity import TypedError, typed_quantity

    try:
        seconds = typed_quantity(text, "s")
    except TypedError as error:
        raise typer.BadParameter(
            f"--window-s takes seconds from 0.0001 on, or auto, not {text!r}: it {error}"
        ) from None
    if not 1e-4 <= seconds < math.inf:
        raise typer.BadParameter(f"--window-s takes seconds from 0.0001 on, or auto, not {text!r}")
    return seconds


def identify(
    shots: Annotated[list[Path], typer.Argument(help="Shot files, or folders of them.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder of the reports.")] = Path("reports"),
    method: MethodOption = None,
    cutoff_hz: Annotated[
        float | None,
        number("Hz", "HZ", "-3 dB point of the zero-phase low-pass.", "from the spectra, one for all shots", least=1.0),
    ] = None,
    filter_name: Annotated[
        str,
        typer.Option(
            "--filter",
            metavar="NAME",
            callback=_known_filter,
            help="Kind of that low-pass: butterworth, or one that another package announces.",
        ),
    ] = USUAL_FILTER,
    window_s: Annotated[
        str, typer.Option(metavar="SECONDS|auto", help="Memory of the trace; auto: the one that predicts best.")
    ] = MEMORY,
    compare: Annotated[bool, typer.Option("--compare", help="Compute all estimators, for comparison.")] = False,
    target: TargetOption = None,
    rig: CorrectedRigOption = None,
    beside: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="REPORT",
            help="Lay each new report beside this one, of the same shot or another, or beside that of its shot in a "
            "folder of reports: beside.html. May be repeated.",
            show_default=False,
        ),
    ] = None,
    sweep: Annotated[
        str | None,
        typer.Option(
            metavar="KEY=LO:HI:STEP",
            help="Identify one shot at each value of cutoff_hz, mass_cutoff_hz or window_s instead, and say whether "
            "its mass moves: sweep_KEY.html, .json and .csv.",
            show_default=False,
        ),
    ] = None,
    header: HeaderOption = None,
    pdf: PdfOption = False,
    figures: FiguresOption = False,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    standalone: StandaloneOption = False,
    overwrite: OverwriteOption = False,
    verbose: VerboseOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Identify the recoiling mass of shot files, or what else --target names, and write a report for each."""
    wanted = tuple(dict.fromkeys(target or ["mass"]))
    if beside and "mass" not in wanted:
        raise typer.BadParameter("--beside goes with the mass")
    memory_s = _memory(window_s)
    if sweep is not None:
        if target or beside or compare or figures or workers or cluster:
            raise typer.BadParameter(
                "--sweep goes with none of --target, --beside, --compare, --figures, --workers and --cluster"
            )
        _sweep(
            shots, sweep, out, (method, cutoff_hz, memory_s, filter_name), rig, header, pdf, standalone, overwrite,
            json, debug,
        )  # fmt: skip
        return
    with Session(json, debug) as session:
        if workers == 1 or (len(shots) == 1 and shots[0].is_file()):
            from recoil_acquisition.processes.reader_process import READER

            READER.start()  # it loads its libraries while this process loads its own
        from recoil_daq.arguments import refuse_no_rig
        from recoil_daq.recording.doubles import set_aside
        from recoil_daq.reports.identify import find_shot_files
        from recoil_daq.reports.identify_folder import (
            identify_document,
            identify_shots,
            outlined,
            repeatability,
            shared_options,
        )
        from recoil_daq.reports.output import Output
        from recoil_daq.terminal.report import print_target, print_together
        from recoil_identification.shot.identified import Options

        output = Output(out, pdf, figures, standalone, overwrite, header)
        output.refuse_missing_extra()
        refuse_no_rig(rig or "", "recoil-daq identify SHOTS... --rig RIG")
        paths = find_shot_files(shots)
        aside = set_aside(paths, shots)
        paths = [path for path in paths if path not in aside]
        output.refuse_one_number(len(paths))
        reports: list[Reported] = []
        found: list[TargetReported] = []
        without: list[RecoilDaqError] = []
        pages: list[Beside] = []
        told: set[str] = set()

        def miss(_: Path, error: "RecoilDaqError") -> None:
            without.append(error)

        others = None
        if beside:
            from recoil_daq.reports.comparison import Others
            from recoil_daq.reports.comparison import beside as lay_beside

            others = Others.read(beside)
            others.refuse_before(paths, output)
        with _crew(workers, cluster) as crew:
            asked = Options(method, cutoff_hz, memory_s, compare=compare, filter=filter_name)
            with session.steps("one cut-off for all shots") as progress:
                shared = shared_options(paths, asked, rig=rig, workers=crew, progress=progress)
            start = partial(
                identify_shots, shared, output, wanted, rig=rig, workers=crew,
                without_mass=miss if len(paths) > 1 else None,
            )  # fmt: skip
            for done in session.each("identify", lambda tell: start(progress=tell)):
                found += done.targets
                if done.report is not None:
                    reports.append(done.report if json else outlined(done.report))
                if done.report is not None and not json:
                    done.report.show(told, whole=verbose or compare)
                for one in done.targets if not json else ():
                    print_target(one.document, one.folder)
                if done.report is not None and others is not None:
                    pages.append(lay_beside(done.report.folder, others, standalone=standalone, overwrite=overwrite))
                    if not json:
                        pages[-1].show()
        if without and not (reports or found):
            raise without[0]
        repeats = repeatability([report.document for report in reports])
        document = identify_document(reports, found, repeats=repeats, aside=aside, without_mass=without, besides=pages)
        if not json:
            print_together(document)
        valid = all(one["valid"] for one in (*document["reports"], *document["targets"]))
        for error in without:
            session.warn(error)
        session.finish(document, lambda: None, FAULT if without else OK if valid else NOT_VALID)


def _sweep(
    shots: list[Path], text: str, out: Path, asked: "tuple[Method | None, float | None, float | None, str]",
    rig: str | None, header: Path | None, pdf: bool, standalone: bool, overwrite: bool, json: bool, debug: bool,
) -> None:  # fmt: skip
    if len(shots) != 1 or shots[0].is_dir():
        raise typer.BadParameter("--sweep takes one shot")
    with Session(json, debug) as session:
        from recoil_acquisition.processes.reader_process import READER

        READER.start()
        from recoil_daq.arguments import named_shot, refuse_no_rig
        from recoil_daq.reports.sweep import Sweep, sweep_shot
        from recoil_identification.shot.identified import Options

        method, cutoff_hz, memory_s, filter_name = asked
        refuse_no_rig(rig or "", "recoil-daq identify SHOT --sweep KEY=LO:HI:STEP --rig RIG")
        try:
            swept = Sweep.of(text)
        except ValueError as error:
            raise typer.BadParameter(f"--sweep: {error}") from error
        with session.steps("sweep") as progress:
            done = sweep_shot(
                named_shot(shots[0]), swept, out=out, rig=rig,
                options=Options(method, cutoff_hz, memory_s, filter=filter_name), pdf=pdf,
                standalone=standalone, overwrite=overwrite, header=header, progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, OK if done.valid else NOT_VALID)


def explain(
    report: Annotated[
        Path,
        typer.Argument(
            help="A report.json, a target's or a campaign's .json, their folder, or with --check a folder of them or "
            "an archive of `pack`.",
            show_default=False,
        ),
    ],
    key: Annotated[
        str | None,
        typer.Argument(
            help="What to explain: mass, rpe, budget, peaks, alignment, or any key of the report, such as mass.u or "
            "'budget.packing friction'.",
            show_default="the first five",
        ),
    ] = None,
    shots: Annotated[
        Path | None,
        typer.Option(help="Folder in which to look for the shot files first.", show_default="around the reports"),
    ] = None,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Make every report of a folder again, or compare each file of an archive with its digest; exit code 1 "
            "if one differs.",
        ),
    ] = False,
    signer: Annotated[
        Path | None,
        typer.Option(
            metavar="PEM",
            help="With --check: the X.509 certificate of who must have signed the certificates, or of who issued it.",
            show_default=False,
        ),
    ] = None,
    verify_with: Annotated[
        str,
        typer.Option(
            metavar="COMMAND",
            help="With --check: your own program that verifies signatures, such as 'gpg --verify {signature} {file}'.",
            show_default=False,
        ),
    ] = "",
    workers: WorkersOption = None,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Say where the numbers of a report, a target or a campaign come from, make it again, and compare every number."""
    if check and key is not None:
        raise typer.BadParameter("--check takes no KEY")
    if (signer is not None or verify_with) and not check:
        raise typer.BadParameter("--signer and --verify-with go with --check")
    if workers is not None and not check:
        raise typer.BadParameter("--workers goes with --check")
    with Session(json, debug) as session:
        if check:
            from recoil_daq.handover.archive import check_archive, is_archive

            if is_archive(report):
                with session.steps("explain --check") as progress:
                    archive = check_archive(report, progress=progress)
                session.finish(archive.to_json(), archive.show, OK if archive.whole else NOT_VALID)
            from recoil_daq.campaigns.reproduction import check_reports
            from recoil_daq.certificates.signature import Trust

            with session.steps("explain --check") as progress:
                checked = check_reports(
                    report, shots=shots, workers=workers, trust=Trust(signer, verify_with), progress=progress
                )
            code = FAULT if checked.faults else OK if checked.again else NOT_VALID
            session.finish(checked.to_json(), checked.show, code)
        from recoil_acquisition.processes.reader_process import READER

        READER.start()
        from recoil_daq.campaigns.reproduction import explain as explain_document

        with session.steps("explain") as progress:
            done = explain_document(report, key, shots=shots, progress=progress)
        session.finish(done.to_json(), done.show, OK if done.again else NOT_VALID)


def campaign(
    shots: Annotated[
        list[Path], typer.Argument(help="Shot files, their reports, or folders of either.", show_default=False)
    ],
    reports: Annotated[Path, typer.Option(help="Folder of the reports that are there.")] = Path("reports"),
    log: Annotated[
        Path | None, typer.Option(help="The shot log.", show_default="shotlog.csv beside the shot files")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the answer.")] = Path("campaign"),
    cutoff_hz: Annotated[
        float | None,
        number("Hz", "HZ", "-3 dB point of the low-pass of all shots.", "that of the last time, or chosen", least=1.0),
    ] = None,
    rig: CorrectedRigOption = None,
    header: HeaderOption = None,
    history: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="A folder of earlier campaigns, at any depth, with whose masses this one is compared.",
            show_default=False,
        ),
    ] = None,
    pdf: PdfOption = False,
    figures: FiguresOption = False,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    standalone: StandaloneOption = False,
    overwrite: OverwriteOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Combine shots of one rig to one mass, and say what changed among them and what they tell of the sensors."""
    with Session(json, debug) as session:
        from recoil_daq.arguments import refuse_no_rig
        from recoil_daq.campaigns.campaign import campaign as combine

        refuse_no_rig(rig or "", "recoil-daq campaign SHOTS... --rig RIG")
        with _crew(workers, cluster) as crew, session.steps("campaign") as progress:
            done = combine(
                shots, reports=reports, log=log, out=out, cutoff_hz=cutoff_hz, rig=rig, pdf=pdf, figures=figures,
                workers=crew, standalone=standalone, overwrite=overwrite, header=header, history=history,
                progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, OK if done.valid else NOT_VALID)


def index(
    places: Annotated[
        list[Path] | None,
        typer.Argument(help="Shot files, reports, or folders of either.", show_default="the folders shots and reports"),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the index.")] = Path("index"),
    xlsx: Annotated[bool, typer.Option("--xlsx", help="Write a workbook, too. Needs the extra `xlsx`.")] = False,
    overwrite: OverwriteOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """List shots and their reports in one table: recording, mass, verdict, first reason, with links to the reports."""
    with Session(json, debug) as session:
        from recoil_daq.reports.shot_index import index_shots

        with session.steps("index") as progress:
            done = index_shots(places or (), out=out, xlsx=xlsx, overwrite=overwrite, progress=progress)
        for error in done.faults:
            session.warn(error)
        session.finish(done.to_json(), done.show, FAULT if done.faults else OK)
