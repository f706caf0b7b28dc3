"""Commands that show pages of a day at the range."""

import sys
from json import dumps
from pathlib import Path
from typing import Annotated

import typer

from recoil_daq.commands.options import DebugOption, JsonOption
from recoil_daq.terminal.session import Session


def serve(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a day at the range.", show_default=False)],
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen at; 0 for any that is free.")] = 8750,
    listen: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address to listen at; 0.0.0.0 for a phone in the same network, which is given a token.",
        ),
    ] = "127.0.0.1",
    while_asked: Annotated[bool, typer.Option("--while-asked", hidden=True)] = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Show the pages of a day at the range, read-only, to another screen or a phone; prints its address first."""
    with Session(json, debug):
        from recoil_acquisition.errors import visible
        from recoil_daq.serving.missing_pages import write_beside
        from recoil_daq.serving.page_server import serve_folder

        def told(address: str) -> None:
            typer.echo(dumps({"schema": "recoil-daq/serve/1", "address": address}) if json else address)
            sys.stdout.flush()
            if not while_asked:  # a session writes its own
                write_beside(folder, lambda line: typer.echo(visible(line), err=True))

        serve_folder(folder, listen, port, told, while_asked=while_asked)
