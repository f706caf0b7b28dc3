"""Commands that hand a day at the range over."""

from pathlib import Path
from typing import Annotated

import typer

from recoil_daq.commands.options import DebugOption, JsonOption, OverwriteOption
from recoil_daq.terminal.session import NOT_VALID, OK, Session

DayArgument = Annotated[
    Path, typer.Argument(metavar="DIR", help="Folder of the day's shot files: the --out of ingest.", show_default=False)
]


def day(
    folder: DayArgument, overwrite: OverwriteOption = False, json: JsonOption = False, debug: DebugOption = False
) -> None:
    """Write the page of a day: its shots, their campaign, the shot log, what was lost, and what to copy."""
    with Session(json, debug) as session:
        from recoil_daq.handover.day import make_day
        from recoil_daq.handover.day_files import refuse_armed

        refuse_armed(folder)
        with session.steps("day") as progress:
            done = make_day(folder, overwrite=overwrite, progress=progress)
        session.finish(done.to_json(), done.show, OK if done.valid else NOT_VALID)


def pack(
    folder: DayArgument,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The archive.", show_default="DIR.zip, beside the folder")
    ] = None,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Pack a day into one archive with the digest of each file, which `explain` compares."""
    with Session(json, debug) as session:
        from recoil_daq.handover.archive import pack as pack_day
        from recoil_daq.handover.day_files import refuse_armed

        refuse_armed(folder)
        with session.steps("pack") as progress:
            done = pack_day(folder, out, progress=progress)
        session.finish(done.to_json(), done.show, OK)
