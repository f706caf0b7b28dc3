"""The command line: parse, call one function, print, exit code.

Exit codes: 0 done; 1 done, but a result is not valid (its reasons are printed); 2 wrong usage; 3 the
data or the rig are at fault (one line says where and what to do); 130 interrupted.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from recoil_daq.session import Session

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
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace what exists.")]
MethodOption = Annotated[
    Literal["calibrated", "reverse", "forward", "paper"],
    typer.Option(
        help="Estimator of the reported mass. `paper` is the published one: unfiltered, force on acceleration."
    ),
]


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


@app.command(epilog="Example: recoil-daq ingest rig.toml daq.csv camera.csv --shot 0001")
def ingest(
    rig: RigArgument,
    files: Annotated[list[Path], typer.Argument(help="One shot's recorded files, in any order.", show_default=False)],
    shot: Annotated[
        str | None, typer.Option(help="Identifier of the shot.", show_default="name of the reference file")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the shot file.")] = Path("shots"),
    overwrite: OverwriteOption = False,
    accept_incomplete: Annotated[
        bool, typer.Option("--accept-incomplete", help="Take what is there of a file that was cut off.")
    ] = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Turn one shot's recorded files into a verified shot file and say whether it is usable."""
    with Session(json, debug) as session:
        from recoil_daq.ingest import ingest_files
        from recoil_daq.tables import print_verdict, verdict_document
        from rigs.rig import load_rig

        with session.steps("ingest") as progress:
            done = ingest_files(
                load_rig(rig), files, shot=shot, out=out, overwrite=overwrite,
                accept_incomplete=accept_incomplete, progress=progress,
            )  # fmt: skip
        session.finish(verdict_document(done), lambda: print_verdict(done), OK if done.shot.usable else NOT_VALID)


@app.command(epilog="Example: recoil-daq identify shots/0001.h5 --out reports")
def identify(
    shots: Annotated[list[Path], typer.Argument(help="Shot files, or folders of them.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder of the reports.")] = Path("reports"),
    method: MethodOption = "calibrated",
    cutoff_hz: Annotated[
        float | None,
        typer.Option(min=1.0, help="-3 dB point of the zero-phase low-pass.", show_default="300, less for slow buses"),
    ] = None,
    window_s: Annotated[float, typer.Option(min=1e-4, help="Memory of the trace, seconds.")] = 0.02,
    overwrite: OverwriteOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Identify the recoiling mass of shot files and write a report for each."""
    with Session(json, debug) as session:
        from identification.analysis import Options
        from recoil_daq.identify import find_shot_files, identify_file
        from recoil_daq.tables import print_report, reports_document

        reports = []
        for path in find_shot_files(shots):
            with session.steps(f"identify {path.name}") as progress:
                options = Options(method, cutoff_hz, window_s)
                reports.append(identify_file(path, out=out, options=options, overwrite=overwrite, progress=progress))
            if not json:
                print_report(reports[-1])
        valid = all(report.document["valid"] for report in reports)
        session.finish(reports_document(reports), lambda: None, OK if valid else NOT_VALID)


@app.command(epilog="Example: recoil-daq simulate mixed --seed 7 --shots 3")
def simulate(
    rig: RigArgument,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same bytes.")] = 1,
    shots: Annotated[int, typer.Option(min=1, max=9999, help="How many shots.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder of the shots, one folder each.")] = Path("simulated"),
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Fire the virtual rig: write the instruments' own files, and truth.json, for every shot."""
    with Session(json, debug) as session:
        from recoil_daq.simulate import simulate_shots
        from recoil_daq.tables import print_simulated, simulated_document
        from rigs.rig import load_rig

        with session.steps("simulate") as progress:
            done = simulate_shots(load_rig(rig), out, seed=seed, shots=shots, progress=progress)
        session.finish(simulated_document(done), lambda: print_simulated(done), OK)


@app.command(epilog="Example: recoil-daq demo --out demo")
def demo(
    out: Annotated[Path, typer.Option(help="Folder of everything that the demonstration writes.")] = Path("demo"),
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated shot.")] = 1,
    overwrite: OverwriteOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Simulate a shot on the rig `mixed`, ingest its four files, identify its mass, and compare with the truth."""
    with Session(json, debug) as session:
        from recoil_daq.demo import run_demo
        from recoil_daq.tables import demo_document, print_demo

        with session.steps("demo") as progress:
            done = run_demo(out, seed=seed, overwrite=overwrite, progress=progress)
        session.finish(
            demo_document(done), lambda: print_demo(done), OK if done.report.document["valid"] else NOT_VALID
        )


@app.command(epilog="Example: recoil-daq check rig.toml")
def check(rig: RigArgument, json: JsonOption = False, debug: DebugOption = False) -> None:
    """Report every fault of a rig file, and every calibration that is overdue."""
    with Session(json, debug) as session:
        import datetime as dt

        from daq.errors import RigError
        from recoil_daq.tables import print_rig, rig_document
        from rigs.rig import load_rig

        loaded = load_rig(rig)
        overdue = loaded.overdue(dt.date.today())
        if overdue:
            raise RigError(loaded.path, overdue)
        session.finish(rig_document(loaded), lambda: print_rig(loaded), OK)


@app.command(epilog="Example: recoil-daq show shots/0001.h5")
def show(
    shot: Annotated[Path, typer.Argument(help="A shot file.", show_default=False)],
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Print what is in a shot file."""
    with Session(json, debug) as session:
        from daq.store import shot_summary
        from recoil_daq.tables import print_summary

        summary = shot_summary(shot)
        session.finish(summary, lambda: print_summary(summary), OK)


def main() -> None:
    """Run the command line; the entry point of ``recoil-daq``."""
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
