"""The command line: parse, call one function, print, exit code.

Exit codes: 0 done; 1 done, but a result is not valid (its reasons are printed); 2 wrong usage; 3 the
data or the rig are at fault (one line says where and what to do); 130 interrupted.
"""

from __future__ import annotations

import io
import math
import os
import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from recoil_daq.session import Session

if TYPE_CHECKING:
    from recoil_daq.identify import Reported
    from recoil_daq.laid_beside import Beside
    from recoil_daq.targets import TargetReported
    from recoil_daq.workers import Workers
    from recoil_rigs.twin import CampaignPlan

OK, NOT_VALID, FAULT, INTERRUPTED = 0, 1, 3, 130

app = typer.Typer(
    name="recoil-daq",
    help="From a test-fired recoiling mechanism's recordings to its recoiling mass, with its uncertainty.",
    epilog="Start with: recoil-daq demo",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

RigArgument = Annotated[str, typer.Argument(help="A rig file (TOML) or the name of a bundled rig.", show_default=False)]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout and nothing else there.")]
DebugOption = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
CorrectedRigOption = Annotated[
    str | None,
    typer.Option(
        "--rig",
        help="A rig file with corrected calibrations or values of the mechanism.",
        show_default="that of each shot file",
    ),
]
StandaloneOption = Annotated[
    bool, typer.Option("--standalone", help="Write each page as one file that needs no other, to send or to keep.")
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace what exists.")]
MethodOption = Annotated[
    Literal["calibrated", "reverse", "forward", "paper", "camera", "tls", "ar-gls", "weak"] | None,
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
WorkersOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Processes that share the shots; 1: this one alone.",
        show_default="one for each core, from 4 shots on",
    ),
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


def _crew(number: int | None, cluster: str | None) -> AbstractContextManager[Workers]:
    """Return who shares the work."""
    if cluster is None:
        from recoil_daq.workers import Workers

        return Workers(number)
    if number is not None:
        raise typer.BadParameter("give either --workers or --cluster")
    from recoil_daq.cluster import workers_at

    return workers_at(cluster)


def _known_targets(names: list[str] | None) -> list[str] | None:
    from recoil_identification.targets import TARGETS

    for name in names or ():
        if name not in ("mass", *TARGETS):
            raise typer.BadParameter(f"{name!r} is none of mass, {', '.join(TARGETS)}")
    return names


TargetOption = Annotated[
    list[str] | None,
    typer.Option(
        callback=_known_targets,
        help="What to identify; may be repeated: mass, parameters, stiffness, breech-force, inertia-force, "
        "resistance, arx.",
        show_default="mass",
    ),
]


def _memory(text: str) -> float | None:
    """Read the memory of the trace: seconds, or None for `auto`."""
    if text == "auto":
        return None
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 1e-4 <= seconds < math.inf:
        raise typer.BadParameter(f"--window-s takes seconds from 0.0001 on, or auto, not {text!r}")
    return seconds


def _version(wanted: bool) -> None:
    if wanted:
        from recoil_daq import __version__

        typer.echo(f"recoil-daq {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    """From a test-fired recoiling mechanism's recordings to its recoiling mass, with its uncertainty."""


@app.command(
    epilog="Example: recoil-daq ingest rig.toml daq.csv camera.csv --shot 0001, or at the range "
    "recoil-daq ingest rig.toml --live --watch incoming"
)
def ingest(
    rig: RigArgument,
    files: Annotated[
        list[Path] | None, typer.Argument(help="One shot's recorded files, in any order.", show_default=False)
    ] = None,
    shot: Annotated[
        str | None,
        typer.Option(
            help="Identifier of the shot; with --live the number of the first.",
            show_default="name of the reference file, or the next number",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the shot files.")] = Path("shots"),
    live: Annotated[
        bool, typer.Option("--live", help="Armed acquisition from the rig's devices, shot after shot.")
    ] = False,
    shots: Annotated[
        int | None, typer.Option(min=1, help="With --live: end after so many shots.", show_default="no end")
    ] = None,
    watch: Annotated[
        Path | None,
        typer.Option(help="With --live: folder into which other instruments drop their files.", show_default=False),
    ] = None,
    spare: Annotated[
        Path | None,
        typer.Option(
            help="With --live: folder on another disk, where the journal goes on if the first one fails.",
            show_default=False,
        ),
    ] = None,
    files_within_s: Annotated[
        float, typer.Option(min=0.0, help="With --live: wait so long for those files after a shot, seconds.")
    ] = 120.0,
    no_screen: Annotated[bool, typer.Option("--no-screen", help="With --live: print plain lines, for a log.")] = False,
    overwrite: OverwriteOption = False,
    accept_incomplete: Annotated[
        bool, typer.Option("--accept-incomplete", help="Take what is there of a file that was cut off.")
    ] = False,
    at: Annotated[
        float | None,
        typer.Option(
            help="The shot is a part of the recorder's file: seconds at which it was triggered, on its clock.",
            show_default="the rig's trigger finds it in a long file",
        ),
    ] = None,
    batch: Annotated[
        bool,
        typer.Option(
            "--batch",
            help="FILES is one folder of many shots' files, whose numbers are in their names, or with a folder a shot.",
        ),
    ] = False,
    workers: WorkersOption = None,
    replaces: Annotated[str, typer.Option(hidden=True)] = "",
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Turn one shot's recorded files, or a live shot, into a verified shot file and say whether it is usable."""
    if live:
        if files:
            raise typer.BadParameter("give either FILES or --live")
        if overwrite or accept_incomplete or batch or at is not None:
            raise typer.BadParameter(
                "--overwrite, --accept-incomplete, --batch and --at go with FILES, not with --live"
            )
        if shot is not None and not (shot.isdecimal() and len(shot) <= 9):
            raise typer.BadParameter("with --live, --shot is the number of the first shot")
        first = None if shot is None else int(shot)
        _live(rig, out, first, shots, watch, spare, files_within_s, no_screen, json, debug)
        return
    if not files:
        raise typer.BadParameter("give one shot's FILES, or --live")
    if shots is not None or watch is not None or spare is not None or no_screen:
        raise typer.BadParameter("--shots, --watch, --spare and --no-screen go with --live")
    if batch:
        if len(files) != 1 or shot is not None or at is not None:
            raise typer.BadParameter("--batch takes one folder, and neither --shot nor --at")
        _batch(rig, files[0], out, overwrite, accept_incomplete, workers, json, debug)
        return
    if workers is not None:
        raise typer.BadParameter("--workers goes with --batch")
    with Session(json, debug) as session:
        from recoil_daq.ingest import ingest_files
        from recoil_rigs.rig import load_rig

        with session.steps("ingest") as progress:
            done = ingest_files(
                load_rig(rig), files, shot=shot, out=out, overwrite=overwrite,
                accept_incomplete=accept_incomplete, at_s=at, replaces=replaces, progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, OK if done.shot.usable else NOT_VALID)


def _batch(
    rig: str, folder: Path, out: Path, overwrite: bool, accept_incomplete: bool, workers: int | None, json: bool,
    debug: bool,
) -> None:  # fmt: skip
    with Session(json, debug) as session:
        from recoil_daq.shot_folder import ingest_folder
        from recoil_rigs.rig import load_rig

        with session.steps("ingest") as progress:
            done = ingest_folder(
                load_rig(rig), folder, out=out, overwrite=overwrite, accept_incomplete=accept_incomplete,
                workers=workers, progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, FAULT if done.failed else OK if done.usable else NOT_VALID)


def _live(
    rig: str, out: Path, first: int | None, shots: int | None, watch: Path | None, spare: Path | None,
    files_within_s: float, no_screen: bool, json: bool, debug: bool,
) -> None:  # fmt: skip
    with Session(json, debug) as session:
        from recoil_daq.live import run_live
        from recoil_daq.live_shot import LiveOptions
        from recoil_daq.live_tables import live_display, print_outcome
        from recoil_rigs.rig import load_rig

        loaded = load_rig(rig)
        options = LiveOptions(out, shots, first, watch, files_within_s, spare)
        with live_display(loaded.name, plain=no_screen, as_json=json) as display:
            done = run_live(loaded, options, display)
        if done.error is not None and not json:
            print_outcome(done)
        if done.error is not None:
            raise done.error
        code = INTERRUPTED if done.interrupted else OK if done.usable else NOT_VALID
        session.finish(done.to_json(), lambda: print_outcome(done), code)


@app.command(epilog="Example: recoil-daq recover shots")
def recover(
    folder: Annotated[
        Path, typer.Argument(help="A journal that was left over, or a folder of shots.", show_default=False)
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder that gets what is recovered.", show_default="where the session wrote")
    ] = None,
    keep: Annotated[bool, typer.Option("--keep", help="Keep the journal when all of it is recovered.")] = False,
    at: Annotated[
        list[float] | None,
        typer.Option(help="Cut a shot at this instant, s from the journal's first record.", show_default=False),
    ] = None,
    discard: Annotated[
        bool, typer.Option("--discard", help="Remove the journal with what is nowhere else, after listing it.")
    ] = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Recover what a live acquisition recorded before it crashed or lost its power."""
    with Session(json, debug) as session:
        from recoil_daq.live_tables import print_recovered, recovered_document
        from recoil_daq.recover import recover_folder

        with session.steps("recover") as progress:
            done, failed = recover_folder(folder, out, keep=keep, discard=discard, at_s=at or (), progress=progress)
        if failed and not json:
            print_recovered(folder, done)
        if failed:
            raise failed[0]
        code = OK if all(one.elsewhere or one.removed for one in done) else NOT_VALID
        session.finish(recovered_document(done), lambda: print_recovered(folder, done), code)


def _cells(words: list[str]) -> dict[str, str]:
    """Read KEY=VALUE words."""
    cells: dict[str, str] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key.strip():
            raise typer.BadParameter(f"{word!r} is not KEY=VALUE")
        if key.strip() in cells:
            raise typer.BadParameter(f"{key.strip()} is given twice")
        cells[key.strip()] = value
    return cells


@app.command(epilog="Example: recoil-daq log 0001 configuration=ring added_mass_kg=120 u_added_mass_kg=0.05")
def log(
    shot: Annotated[
        str, typer.Argument(help="A shot file, or the name of a shot in the folder of --dir.", show_default=False)
    ],
    cells: Annotated[
        list[str] | None,
        typer.Argument(help="Cells to set; KEY= empties one.", metavar="KEY=VALUE", show_default="show the row"),
    ] = None,
    folder: Annotated[Path, typer.Option("--dir", help="Folder of the shot files.")] = Path("shots"),
    new_column: Annotated[
        bool, typer.Option("--new-column", help="Add the columns that the shot log does not have.")
    ] = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Show a shot's row of the shot log, or set cells of it: configuration, added mass, charge, why it is excluded."""
    given = _cells(cells or [])
    with Session(json, debug) as session:
        from recoil_daq.logged import log_row

        done = log_row(shot, given, folder=folder, new_column=new_column)
        session.finish(done.to_json(), done.show, OK)


@app.command(epilog="Example: recoil-daq identify shots/0001.h5 --out reports")
def identify(
    shots: Annotated[list[Path], typer.Argument(help="Shot files, or folders of them.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder of the reports.")] = Path("reports"),
    method: MethodOption = None,
    cutoff_hz: Annotated[
        float | None,
        typer.Option(
            min=1.0, help="-3 dB point of the zero-phase low-pass.", show_default="from the spectra, one for all shots"
        ),
    ] = None,
    window_s: Annotated[
        str, typer.Option(metavar="SECONDS|auto", help="Memory of the trace; auto: the one that predicts best.")
    ] = "0.02",
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
    pdf: PdfOption = False,
    figures: FiguresOption = False,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    standalone: StandaloneOption = False,
    overwrite: OverwriteOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Identify the recoiling mass of shot files, or what else --target names, and write a report for each."""
    wanted = tuple(dict.fromkeys(target or ["mass"]))
    if beside and "mass" not in wanted:
        raise typer.BadParameter("--beside goes with the mass")
    memory_s = _memory(window_s)
    with Session(json, debug) as session:
        if workers == 1 or (len(shots) == 1 and shots[0].is_file()):
            from recoil_acquisition.reader_process import READER

            READER.start()  # it loads its libraries while this process loads its own
        from recoil_daq.identify import find_shot_files
        from recoil_daq.report_tables import print_repeatability, print_target, reports_document
        from recoil_daq.several_shots import identify_shots, repeatability, shared_options
        from recoil_identification.analysis import Options
        from recoil_identification.report.typeset import refuse_without_typst

        refuse_without_typst(pdf=pdf, figures=figures)
        paths = find_shot_files(shots)
        reports: list[Reported] = []
        found: list[TargetReported] = []
        pages: list[Beside] = []
        others = None
        if beside:
            from recoil_daq.laid_beside import Others
            from recoil_daq.laid_beside import beside as lay_beside

            others = Others.read(beside)
            others.refuse_before(paths, out, overwrite=overwrite)
        with _crew(workers, cluster) as crew:
            asked = Options(method, cutoff_hz, memory_s, compare=compare)
            with session.steps("one cut-off for all shots") as progress:
                shared = shared_options(paths, asked, rig=rig, workers=crew, progress=progress)
            for done in session.each(
                "identify",
                lambda tell: identify_shots(
                    shared,
                    wanted,
                    out=out,
                    rig=rig,
                    pdf=pdf,
                    figures=figures,
                    standalone=standalone,
                    overwrite=overwrite,
                    workers=crew,
                    progress=tell,
                ),
            ):
                found += done.targets
                if done.report is not None:
                    reports.append(done.report)
                if done.report is not None and not json:
                    done.report.show()
                for one in done.targets if not json else ():
                    print_target(one)
                if done.report is not None and others is not None:
                    pages.append(lay_beside(done.report.folder, others, standalone=standalone, overwrite=overwrite))
                    if not json:
                        pages[-1].show()
        repeats = repeatability([report.document for report in reports])
        if not json:
            print_repeatability(repeats)
        documents = [*(one.document for one in reports), *(one.document for one in found)]
        valid = all(document["valid"] for document in documents)
        document = reports_document(reports, found, repeats)
        if pages:
            document["beside"] = [one.to_json() for one in pages]
        session.finish(document, lambda: None, OK if valid else NOT_VALID)


@app.command(
    epilog="Example: recoil-daq explain reports/0001 mass.u, or of all reports of a folder: "
    "recoil-daq explain reports --check"
)
def explain(
    report: Annotated[
        Path, typer.Argument(help="A report.json, its folder, or with --check a folder of reports.", show_default=False)
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
        bool, typer.Option("--check", help="Make every report of a folder again; exit code 1 if a number differs.")
    ] = False,
    workers: WorkersOption = None,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Say where a report's numbers come from, make it again from its shot file, and compare every number."""
    if check and key is not None:
        raise typer.BadParameter("--check takes no KEY")
    if workers is not None and not check:
        raise typer.BadParameter("--workers goes with --check")
    with Session(json, debug) as session:
        if check:
            from recoil_daq.explained import check_reports

            with session.steps("explain --check") as progress:
                checked = check_reports(report, shots=shots, workers=workers, progress=progress)
            code = FAULT if checked.faults else OK if checked.again else NOT_VALID
            session.finish(checked.to_json(), checked.show, code)
        from recoil_acquisition.reader_process import READER

        READER.start()
        from recoil_daq.explained import explain as explain_report

        with session.steps("explain") as progress:
            done = explain_report(report, key, shots=shots, progress=progress)
        session.finish(done.to_json(), done.show, OK if done.again else NOT_VALID)


@app.command(epilog="Example: recoil-daq campaign shots --out campaign")
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
        typer.Option(
            min=1.0, help="-3 dB point of the low-pass of all shots.", show_default="that of the last time, or chosen"
        ),
    ] = None,
    rig: CorrectedRigOption = None,
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
        from recoil_daq.combined import campaign as combine

        with _crew(workers, cluster) as crew, session.steps("campaign") as progress:
            done = combine(
                shots, reports=reports, log=log, out=out, cutoff_hz=cutoff_hz, rig=rig, pdf=pdf, figures=figures,
                workers=crew, standalone=standalone, overwrite=overwrite, progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, OK if done.valid else NOT_VALID)


def _uncertainties(words: list[str]) -> dict[str, float]:
    """Read KEY=U words."""
    stated: dict[str, float] = {}
    for key, text in _cells(words).items():
        try:
            stated[key] = float(text)
        except ValueError:
            raise typer.BadParameter(f"--with takes KEY=NUMBER, not {key}={text}") from None
    return stated


@app.command(
    epilog="Example: recoil-daq predict mixed --shots 16 --added-mass 120 --with p_breech.u_rel=0.002, or of a stand "
    "that has fired: recoil-daq predict rig.toml --from shots/0001.h5"
)
def predict(
    rig: RigArgument,
    from_shot: Annotated[
        Path | None,
        typer.Option(
            "--from", help="A shot file of this rig: shots to come move as it did.", show_default="the rig's [twin]"
        ),
    ] = None,
    shots: Annotated[int, typer.Option(min=1, max=1000, help="How many shots.")] = 8,
    added_mass: Annotated[
        float | None, typer.Option(metavar="KG", help="Every second shot carries so much more.", show_default="none")
    ] = None,
    u_added_mass: Annotated[
        float | None, typer.Option(metavar="KG", help="Its standard uncertainty.", show_default="0.05")
    ] = None,
    charges: Annotated[
        str | None,
        typer.Option(
            metavar="FACTOR,...", help="Of the peak breech pressure, shot by shot, and over again.", show_default="1"
        ),
    ] = None,
    stated: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="KEY=U",
            help="Another standard uncertainty than the rig's: p_breech.u_rel=0.002 (a channel's, as a share), "
            "u_friction=75 (a value of [mechanism], in its unit); may be repeated.",
            show_default=False,
        ),
    ] = None,
    friction_scatter: Annotated[
        float | None,
        typer.Option(
            metavar="REL", help="Relative standard deviation of the friction from shot to shot.", show_default="0.015"
        ),
    ] = None,
    repeatability: Annotated[
        float | None,
        typer.Option(
            metavar="REL", help="Relative standard deviation of gains from shot to shot.", show_default="0.00015"
        ),
    ] = None,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Say before the day how well shots and campaigns will tell the mass, and what would make it better."""
    uncertainties = _uncertainties(stated or [])
    options = {
        "added_mass_kg": added_mass, "u_added_mass_kg": u_added_mass, "charges": charges,
        "friction_scatter": friction_scatter, "repeatability": repeatability,
    }  # fmt: skip
    plan = _campaign_plan({key: value for key, value in options.items() if value is not None}, shots)
    with Session(json, debug) as session:
        from recoil_daq.predicted import check_expected
        from recoil_daq.predicted import predict as foretell
        from recoil_rigs.rig import load_rig

        if plan is not None:
            try:
                check_expected(shots, plan, recorded=from_shot is not None)
            except ValueError as error:
                raise typer.BadParameter(str(error)) from error

        with session.steps("predict") as progress:
            done = foretell(
                load_rig(rig), from_shot=from_shot, shots=shots, plan=plan, uncertainties=uncertainties,
                progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, OK if done.valid else NOT_VALID)


@app.command(
    epilog="Example: recoil-daq simulate mixed --seed 7 --shots 3, or a campaign whose even shots carry a known mass: "
    "recoil-daq simulate mixed --shots 8 --campaign-seed 3 --added-mass 120 --charges 1,1,0.8,0.8"
)
def simulate(
    rig: RigArgument,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same bytes.")] = 1,
    shots: Annotated[int, typer.Option(min=1, max=9999, help="How many shots.")] = 1,
    campaign_seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Of the sensors' errors, which the shots then share; the shot log is written, too. "
            "What follows down to --outlier needs it.",
            show_default="each its own",
        ),
    ] = None,
    added_mass: Annotated[
        float | None,
        typer.Option(
            metavar="KG",
            help="Every second shot carries so much more: the first is bare, the second has it, and so on.",
            show_default="none",
        ),
    ] = None,
    u_added_mass: Annotated[
        float | None,
        typer.Option(metavar="KG", help="Its standard uncertainty: it is truly off by one draw.", show_default="0.05"),
    ] = None,
    charges: Annotated[
        str | None,
        typer.Option(
            metavar="FACTOR,...",
            help="Of the peak breech pressure, shot by shot, and over again. Name each twice in a row if every second "
            "shot carries more: else each charge is fired either with it or without.",
            show_default="1",
        ),
    ] = None,
    friction_scatter: Annotated[
        float | None,
        typer.Option(help="Relative standard deviation of the friction from shot to shot.", show_default="0"),
    ] = None,
    repeatability: Annotated[
        float | None,
        typer.Option(
            help="Relative standard deviation from shot to shot of the gains of force gauges and recoil accelerometer.",
            show_default="0",
        ),
    ] = None,
    mass_step: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KG@SHOT",
            help="From that shot on (counted from 1) the recoiling mass is so much more, and the log does not tell; "
            "may be repeated.",
            show_default=False,
        ),
    ] = None,
    configuration: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME@SHOT", help="What the log states from that shot on; may be repeated.", show_default=False
        ),
    ] = None,
    drift: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CHANNEL=REL",
            help="The channel's gain drifts by that share from the first shot to the last; may be repeated.",
            show_default=False,
        ),
    ] = None,
    outlier: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CHANNEL=REL@SHOT",
            help="The channel's gain is off by that share in that shot; may be repeated.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the shots, one folder each.")] = Path("simulated"),
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Fire the virtual rig: write the instruments' own files, and truth.json, for every shot."""
    options = {
        "added_mass_kg": added_mass, "u_added_mass_kg": u_added_mass, "charges": charges,
        "friction_scatter": friction_scatter, "repeatability": repeatability, "mass_steps": mass_step,
        "configurations": configuration, "drifts": drift, "outliers": outlier,
    }  # fmt: skip
    plan = _campaign_plan({key: value for key, value in options.items() if value not in (None, [])}, shots)
    if plan is not None and campaign_seed is None:
        raise typer.BadParameter("a campaign needs --campaign-seed: its shots share their sensors")
    with Session(json, debug) as session:
        from recoil_daq.simulated import simulate as fire
        from recoil_rigs.rig import load_rig

        with session.steps("simulate") as progress:
            done = fire(
                load_rig(rig), out, seed=seed, shots=shots, campaign_seed=campaign_seed, plan=plan, progress=progress
            )
        session.finish(done.to_json(), done.show, OK)


def _campaign_plan(given: Mapping[str, Any], shots: int) -> CampaignPlan | None:
    """Return the plan of a campaign, or None if nothing is planned."""
    if not given:
        return None
    from recoil_daq.campaign_options import plan_of_options

    try:
        return plan_of_options(given, shots)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


@app.command(epilog="Example: recoil-daq demo --out demo")
def demo(
    out: Annotated[Path, typer.Option(help="Folder of everything that the demonstration writes.")] = Path("demo"),
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated shot.")] = 1,
    live: Annotated[
        bool, typer.Option("--live", help="A range day of three shots with virtual devices, in real time.")
    ] = False,
    campaign: Annotated[
        bool, typer.Option("--campaign", help="Eight shots of one set of sensors, combined to one mass.")
    ] = False,
    no_screen: Annotated[bool, typer.Option("--no-screen", help="With --live: print plain lines.")] = False,
    overwrite: OverwriteOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Simulate a shot on the rig `mixed`, ingest its four files, identify its mass, and compare with the truth."""
    if live and campaign:
        raise typer.BadParameter("give either --live or --campaign")
    if campaign:
        with Session(json, debug) as session:
            from recoil_daq.campaign_tables import campaign_demo_document, print_campaign_demo
            from recoil_daq.demo import run_campaign_demo

            with session.steps("demo") as progress:
                combined = run_campaign_demo(out, seed=seed, overwrite=overwrite, progress=progress)
            code = OK if combined.combined.valid else NOT_VALID
            session.finish(campaign_demo_document(combined), lambda: print_campaign_demo(combined), code)
        return
    if live:
        _demo_live(out, seed, no_screen, overwrite, json, debug)
        return
    with Session(json, debug) as session:
        from recoil_daq.demo import run_demo
        from recoil_daq.report_tables import demo_document, print_demo

        with session.steps("demo") as progress:
            done = run_demo(out, seed=seed, overwrite=overwrite, progress=progress)
        session.finish(
            demo_document(done), lambda: print_demo(done), OK if done.report.document["valid"] else NOT_VALID
        )


def _demo_live(out: Path, seed: int, no_screen: bool, overwrite: bool, json: bool, debug: bool) -> None:
    with Session(json, debug) as session:
        from recoil_daq.demo import run_live_demo
        from recoil_daq.live_tables import live_demo_document, live_display, print_live_demo

        with live_display("mixed", plain=no_screen, as_json=json) as display:
            done = run_live_demo(out, display, seed=seed, overwrite=overwrite)
        if done.outcome.error is not None:
            raise done.outcome.error
        code = INTERRUPTED if done.outcome.interrupted else OK if done.valid else NOT_VALID
        session.finish(live_demo_document(done), lambda: print_live_demo(done), code)


@app.command(epilog="Example: recoil-daq check rig.toml daq.csv camera.csv, or recoil-daq check rig.toml --devices")
def check(
    rig: RigArgument,
    files: Annotated[
        list[Path] | None,
        typer.Argument(help="Recorded files, one for each source, to check the rig against.", show_default=False),
    ] = None,
    devices: Annotated[
        bool, typer.Option("--devices", help="Open each device, listen, and judge each channel.")
    ] = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Report every fault of a rig file, of calibrations, of recorded files against it, and of devices."""
    if files and devices:
        raise typer.BadParameter("give either FILES or --devices")
    with Session(json, debug) as session:
        from recoil_daq.check import check_rig
        from recoil_daq.check_tables import print_rig, rig_document

        with session.steps("check") as progress:
            checked = check_rig(rig, files or (), progress=progress)
        loaded = checked.rig
        if devices:
            from recoil_daq.device_check import check_devices
            from recoil_daq.live_tables import device_document, print_devices

            with session.steps("listen") as progress:
                heard = check_devices(loaded, progress=progress)
            sound = all(one.verdict != "fail" for one in heard)
            session.finish(
                device_document(loaded, heard), lambda: print_devices(loaded, heard), OK if sound else NOT_VALID
            )
        document = rig_document(checked)
        session.finish(document, lambda: print_rig(checked, document), OK)


@app.command(epilog="Example: recoil-daq formats")
def formats(json: JsonOption = False, debug: DebugOption = False) -> None:
    """List the formats of files that are read, and what each needs."""
    with Session(json, debug) as session:
        from recoil_daq.file_summary import formats_document
        from recoil_daq.file_tables import print_formats

        document = formats_document()
        session.finish(document, lambda: print_formats(document), OK)


@app.command(epilog="Example: recoil-daq show shots/0001.h5")
def show(
    file: Annotated[Path, typer.Argument(help="A shot file, or a file of any instrument.", show_default=False)],
    rig: Annotated[
        str | None,
        typer.Option(help="Rig that declares what an instrument's file does not carry.", show_default=False),
    ] = None,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Print what is in a shot file, or in a file of any instrument; exit code 1 if that one was cut off."""
    with Session(json, debug) as session:
        if file.suffix == ".h5":
            from recoil_acquisition.reader_process import READER

            READER.start()
        from recoil_acquisition.store import is_shot_file, shot_summary
        from recoil_daq.file_tables import print_summary
        from recoil_daq.live_tables import print_acquisition

        if not is_shot_file(file):
            from recoil_daq.file_summary import summarise_file
            from recoil_daq.file_tables import print_file
            from recoil_rigs.rig import load_rig

            document = summarise_file(file, None if rig is None else load_rig(rig))
            session.finish(document, lambda: print_file(document), NOT_VALID if document["incomplete"] else OK)
        summary = shot_summary(file)

        def print_all() -> None:
            print_summary(summary)
            print_acquisition(summary)

        session.finish(summary, print_all, OK)


@app.command(epilog="Example: recoil-daq export shots/0001.h5 --format mdf4 --out exports")
def export(
    shot: Annotated[Path, typer.Argument(help="A shot file.", show_default=False)],
    format_name: Annotated[
        str,
        typer.Option(
            "--format",
            help="Or what another package adds; csv and parquet are read again by `ingest`.",
            metavar="mdf4|mat|uff58|tdms|parquet|csv|dewesoft-text",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder of the files.")] = Path("exports"),
    channel: Annotated[
        list[str] | None, typer.Option(help="A channel to export; may be repeated.", show_default="all")
    ] = None,
    aligned: Annotated[
        bool, typer.Option("--aligned", help="Map all instants to the reference clock; else each source keeps its own.")
    ] = False,
    class_filter: Annotated[
        Literal["cfc-60", "cfc-180", "cfc-600", "cfc-1000"] | None,
        typer.Option(
            "--filter", help="Channel frequency class of SAE J211-1 and ISO 6487.", show_default="as recorded"
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Write a shot's channels in another format, verified, and say what is exact and what is lost."""
    from recoil_acquisition.exporters.table import exporter_names

    if format_name not in (names := exporter_names()):
        raise typer.BadParameter(f"{format_name!r} is none of {', '.join(names)}")
    with Session(json, debug) as session:
        from recoil_acquisition.reader_process import READER

        READER.start()
        from recoil_daq.exported import export as write_export

        with session.steps(f"export {shot.name}") as progress:
            done = write_export(
                shot, format_name, out=out, channels=channel or (), aligned=aligned, overwrite=overwrite,
                frequency_class=None if class_filter is None else int(class_filter.removeprefix("cfc-")),
                progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, OK if done.complete else NOT_VALID)


def main() -> None:
    """Run the command line; the entry point of ``recoil-daq``."""
    # the matrices of a shot are small: threads of the linear algebra cost more than they save, unless asked for
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # a pipe on Windows takes code page 1252 only: what it has no sign for is spelled, as stderr does
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
