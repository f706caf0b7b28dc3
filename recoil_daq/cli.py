"""The command line: each command of `recoil_daq.commands` with an example.

Exit codes: 0 done; 1 done, but a result is not valid (its reasons are printed); 2 wrong usage; 3 the
data or the rig are at fault (one line says where and what to do); 4 done, but the output could not be printed (a pipe
that its reader closed is no fault); 130 interrupted.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperGroup

from recoil_daq.terminal.session import INTERRUPTED, OK
from recoil_daq.terminal.standard_streams import StandardStreams


class Command(NamedTuple):
    """A command: the module of `recoil_daq.commands` that defines it, what it does, and an example."""

    module: str
    does: str
    example: str


COMMANDS = {
    "ingest": Command(
        "shots",
        "Turn one shot's recorded files, or a live shot, into a verified shot file and say whether it is usable.",
        "recoil-daq ingest rig.toml daq.csv camera.csv --shot 0001, or at the range recoil-daq ingest "
        "rig.toml --live --watch incoming",
    ),
    "recover": Command(
        "shots",
        "Recover what a live acquisition recorded before it crashed or lost its power.",
        "recoil-daq recover shots",
    ),
    "log": Command(
        "shots",
        "Show a shot's row of the shot log, or set cells of it: configuration, added mass, charge, why it is excluded.",
        "recoil-daq log 0001 configuration=ring added_mass_kg=310 u_added_mass_kg=0.05",
    ),
    "day": Command(
        "handover",
        "Write the page of a day: its shots, their campaign, the shot log, what was lost, and what to copy.",
        "recoil-daq day shots",
    ),
    "certificate": Command(
        "handover",
        "Write the certificate of a shot or a campaign: identity, results, decision rule, calibrations, signature.",
        "recoil-daq certificate campaign --header header.toml --sign signer.pem, and who holds it: recoil-daq explain "
        "certificate --check",
    ),
    "pack": Command(
        "handover",
        "Pack a day into one archive with the digest of each file, which `explain` compares.",
        "recoil-daq pack shots --out day.zip, and where it was copied to: recoil-daq explain day.zip --check",
    ),
    "identify": Command(
        "masses",
        "Identify the recoiling mass of shot files, or what else --target names, and write a report for each.",
        "recoil-daq identify shots/0001.h5 --out reports",
    ),
    "explain": Command(
        "masses",
        "Say where the numbers of a report, a target or a campaign come from, make it again, and compare every number.",
        "recoil-daq explain reports/0001 mass.u, or of all reports of a folder: recoil-daq explain reports --check",
    ),
    "campaign": Command(
        "masses",
        "Combine shots of one rig to one mass, and say what changed among them and what they tell of the sensors.",
        "recoil-daq campaign shots --out campaign",
    ),
    "index": Command(
        "masses",
        "List shots and their reports in one table: recording, mass, verdict, first reason, with links to the reports.",
        "recoil-daq index, or of other folders: recoil-daq index day1 day2/reports --xlsx",
    ),
    "serve": Command(
        "pages",
        "Show the pages of a day at the range, read-only, to another screen or a phone; prints its address first.",
        "recoil-daq serve shots, or to a phone in the same network: recoil-daq serve shots --listen 0.0.0.0",
    ),
    "predict": Command(
        "virtual",
        "Say before the day how well shots and campaigns will tell the mass, and what would make it better.",
        "recoil-daq predict mixed --shots 16 --added-mass 310 --with p_breech.u_rel=0.002, or of a stand"
        " that has fired: recoil-daq predict rig.toml --from shots/0001.h5",
    ),
    "simulate": Command(
        "virtual",
        "Fire the virtual rig: write the instruments' own files, and truth.json, for every shot.",
        "recoil-daq simulate mixed --seed 7 --shots 3, or a campaign whose even shots carry a known "
        "mass: recoil-daq simulate mixed --shots 8 --campaign-seed 3 --added-mass 310 --charges "
        "1,1,0.8,0.8",
    ),
    "demo": Command(
        "virtual",
        "Simulate a shot on the rig `mixed`, ingest its four files, identify its mass, and compare with the truth.",
        "recoil-daq demo --out demo",
    ),
    "init": Command(
        "files",
        "Draft a rig file from recorded files: what they tell is filled in, what only a person knows is asked for.",
        "recoil-daq init 0001_daq.csv 0001_can.blf 0001_camera.csv --database rig.dbc --sensors "
        "sensors.csv, or with a draft, or another stand's rig file: recoil-daq init 0001_* --from "
        "rig.toml --out new.toml",
    ),
    "check": Command(
        "files",
        "Report every fault of a rig file, of calibrations, of recorded files against it, and of devices.",
        "recoil-daq check rig.toml daq.csv camera.csv, or recoil-daq check rig.toml --devices",
    ),
    "formats": Command(
        "files",
        "List the formats of files that are read, and what each needs.",
        "recoil-daq formats",
    ),
    "show": Command(
        "files",
        "Print what is in a shot file, or in a file of any instrument; exit code 1 if that one was cut off.",
        "recoil-daq show shots/0001.h5, or of a bus and its database: recoil-daq show bus.blf bus.dbc",
    ),
    "export": Command(
        "exports",
        "Write a shot's channels in another format, verified, and say what is exact and what is lost.",
        "recoil-daq export shots/0001.h5 --format mdf4 --out exports",
    ),
}
"""The commands, in the order in which help lists them."""
HOW: dict[str, Any] = {"pretty_exceptions_enable": False, "rich_markup_mode": None}


class CommandsOnUse(TyperGroup):
    """The commands, each loaded when it is asked for: the list of them needs none."""

    def list_commands(self, _ctx: Any) -> list[str]:
        """Return the names of the commands."""
        return [*COMMANDS]

    def get_command(self, _ctx: Any, cmd_name: str) -> Any:
        """Return a command; None where there is none of that name."""
        if cmd_name not in COMMANDS:
            return None
        if cmd_name not in self.commands:
            known = COMMANDS[cmd_name]
            function = getattr(import_module(f"recoil_daq.commands.{known.module}"), cmd_name)
            alone = typer.Typer(add_completion=False, **HOW)
            alone.command(cmd_name, epilog=f"Example: {known.example}")(function)
            self.commands[cmd_name] = typer.main.get_command(alone)
        return self.commands[cmd_name]

    def format_commands(self, _ctx: Any, formatter: Any) -> None:
        """Write each command and what it does."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, known.does) for name, known in COMMANDS.items()])


app = typer.Typer(
    cls=CommandsOnUse,
    name="recoil-daq",
    help="From a test-fired recoiling mechanism's recordings to its recoiling mass, with its uncertainty.",
    epilog="Start with: recoil-daq demo",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    **HOW,
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
