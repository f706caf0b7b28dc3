"""The command line: each command of `recoil_daq.commands` with an example.

Exit codes: 0 done; 1 done, but a result is not valid (its reasons are printed); 2 wrong usage; 3 the
data or the rig are at fault (one line says where and what to do); 4 done, but the output could not be printed (a pipe
that its reader closed is no fault); 130 interrupted.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from recoil_daq.commands import files, masses, shots, virtual
from recoil_daq.terminal.session import INTERRUPTED, OK
from recoil_daq.terminal.standard_streams import StandardStreams

app = typer.Typer(
    name="recoil-daq",
    help="From a test-fired recoiling mechanism's recordings to its recoiling mass, with its uncertainty.",
    epilog="Start with: recoil-daq demo",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from recoil_daq.version import __version__

        typer.echo(f"recoil-daq {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    """From a test-fired recoiling mechanism's recordings to its recoiling mass, with its uncertainty."""


for command, example in (
    (
        shots.ingest,
        (
            "recoil-daq ingest rig.toml daq.csv camera.csv --shot 0001, or at the range "
            "recoil-daq ingest rig.toml --live --watch incoming"
        ),
    ),
    (shots.recover, "recoil-daq recover shots"),
    (shots.log, "recoil-daq log 0001 configuration=ring added_mass_kg=120 u_added_mass_kg=0.05"),
    (masses.identify, "recoil-daq identify shots/0001.h5 --out reports"),
    (
        masses.explain,
        "recoil-daq explain reports/0001 mass.u, or of all reports of a folder: recoil-daq explain reports --check",
    ),
    (masses.campaign, "recoil-daq campaign shots --out campaign"),
    (masses.index, "recoil-daq index, or of other folders: recoil-daq index day1 day2/reports --xlsx"),
    (
        virtual.predict,
        (
            "recoil-daq predict mixed --shots 16 --added-mass 120 --with p_breech.u_rel=0.002, or of a stand "
            "that has fired: recoil-daq predict rig.toml --from shots/0001.h5"
        ),
    ),
    (
        virtual.simulate,
        (
            "recoil-daq simulate mixed --seed 7 --shots 3, or a campaign whose even shots carry a known mass: "
            "recoil-daq simulate mixed --shots 8 --campaign-seed 3 --added-mass 120 --charges 1,1,0.8,0.8"
        ),
    ),
    (virtual.demo, "recoil-daq demo --out demo"),
    (
        files.init,
        (
            "recoil-daq init 0001_daq.csv 0001_can.blf 0001_camera.csv --database rig.dbc --sensors sensors.csv, or "
            "with a draft, or another stand's rig file: recoil-daq init 0001_* --from rig.toml --out new.toml"
        ),
    ),
    (files.check, "recoil-daq check rig.toml daq.csv camera.csv, or recoil-daq check rig.toml --devices"),
    (files.formats, "recoil-daq formats"),
    (files.show, "recoil-daq show shots/0001.h5, or of a bus and its database: recoil-daq show bus.blf bus.dbc"),
    (files.export, "recoil-daq export shots/0001.h5 --format mdf4 --out exports"),
):
    app.command(epilog=f"Example: {example}")(command)


def main() -> None:
    """Run the command line; the entry point of ``recoil-daq``."""
    # the matrices of a shot are small: threads of the linear algebra cost more than they save, unless asked for
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    streams, code = StandardStreams(), OK
    try:
        app()
    except KeyboardInterrupt:
        code = INTERRUPTED
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else OK
    sys.exit(streams.exit_code(code))


if __name__ == "__main__":
    main()
