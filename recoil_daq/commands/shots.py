"""Commands that make shot files and keep their log."""

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from recoil_daq.commands.completion import complete_shot
from recoil_daq.commands.options import (
    DebugOption,
    JsonOption,
    OverwriteOption,
    RigArgument,
    WorkersOption,
    cells_of,
    number,
)
from recoil_daq.terminal.session import FAULT, INTERRUPTED, NOT_VALID, OK, Session

_ORDER = "recoil-daq ingest RIG FILES..."


def ingest(
    rig: RigArgument,
    files: Annotated[
        list[Path] | None, typer.Argument(help="One shot's recorded files, in any order.", show_default=False)
    ] = None,
    shot: Annotated[
        str | None,
        typer.Option(
            help="Identifier of the shot; with --live the number of the first.",
            show_default="the number in all files' names, else the reference file's name; live the next number",
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
        typer.Option(
            help="With --live: folder into which other instruments drop their files; made if it is missing.",
            show_default="none; of a virtual rig OUT/incoming",
        ),
    ] = None,
    spare: Annotated[
        Path | None,
        typer.Option(
            help="With --live: folder on another disk, where the journal goes on if the first one fails.",
            show_default=False,
        ),
    ] = None,
    files_within_s: Annotated[
        float, number("s", "S", "With --live: wait so long for those files after a shot, seconds.", least=0.0)
    ] = 120.0,
    no_screen: Annotated[bool, typer.Option("--no-screen", help="With --live: print plain lines, for a log.")] = False,
    serve: Annotated[
        bool, typer.Option("--serve", help="With --live: serve the page of OUT at this computer too, as `serve` does.")
    ] = False,
    no_identify: Annotated[
        bool, typer.Option("--no-identify", help="With --live: give each shot a verdict, and no mass.")
    ] = False,
    overwrite: OverwriteOption = False,
    accept_incomplete: Annotated[
        bool, typer.Option("--accept-incomplete", help="Take what is there of a file that was cut off.")
    ] = False,
    at: Annotated[
        float | None,
        number(
            "s",
            "S",
            "The shot is a part of the recorder's file: seconds at which it was triggered, on its clock.",
            "the rig's trigger finds it in a long file",
        ),
    ] = None,
    batch: Annotated[
        bool,
        typer.Option(
            "--batch",
            help="FILES is one folder of many shots' files, whose numbers are in their names, or with a folder a shot.",
        ),
    ] = False,
    without: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Source that did not fire, or is not to be taken; may be given more than once.",
            show_default=False,
        ),
    ] = None,
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
        left = tuple(without or ())
        _live(
            rig, out, first, shots, watch, spare, files_within_s, no_screen, not no_identify, serve, left, json, debug
        )
        return
    if not files:
        raise typer.BadParameter("give one shot's FILES, or --live")
    if shots is not None or watch is not None or spare is not None or no_screen or no_identify or serve:
        raise typer.BadParameter("--shots, --watch, --spare, --no-screen, --serve and --no-identify go with --live")
    if batch:
        if len(files) != 1 or shot is not None or at is not None:
            raise typer.BadParameter("--batch takes one folder, and neither --shot nor --at")
        _batch(rig, files[0], out, overwrite, accept_incomplete, without or (), workers, json, debug)
        return
    if workers is not None:
        raise typer.BadParameter("--workers goes with --batch")
    with Session(json, debug) as session:
        from recoil_daq.arguments import refuse_no_recordings, refuse_no_rig
        from recoil_daq.recording.ingest import ingest_files
        from recoil_rigs.rig import load_rig

        refuse_no_rig(rig, _ORDER)
        refuse_no_recordings(files, _ORDER)
        with session.steps("ingest") as progress:
            done = ingest_files(
                load_rig(rig), files, shot=shot, out=out, overwrite=overwrite,
                accept_incomplete=accept_incomplete, at_s=at, replaces=replaces, without=without or (),
                progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, OK if done.shot.usable else NOT_VALID)


def _batch(
    rig: str, folder: Path, out: Path, overwrite: bool, accept_incomplete: bool, without: Sequence[str],
    workers: int | None, json: bool, debug: bool,
) -> None:  # fmt: skip
    with Session(json, debug) as session:
        from recoil_daq.arguments import refuse_no_rig
        from recoil_daq.recording.ingest_folder import ingest_folder
        from recoil_rigs.rig import load_rig

        refuse_no_rig(rig, "recoil-daq ingest RIG FOLDER --batch")
        with session.steps("ingest") as progress:
            done = ingest_folder(
                load_rig(rig), folder, out=out, overwrite=overwrite, accept_incomplete=accept_incomplete,
                without=without, workers=workers, progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, FAULT if done.failed else OK if done.usable else NOT_VALID)


def _live(
    rig: str, out: Path, first: int | None, shots: int | None, watch: Path | None, spare: Path | None,
    files_within_s: float, no_screen: bool, identify: bool, serve: bool, without: tuple[str, ...], json: bool,
    debug: bool,
) -> None:  # fmt: skip
    with Session(json, debug) as session:
        from recoil_daq.arguments import refuse_no_rig
        from recoil_daq.live.acquisition import run_live
        from recoil_daq.live.added_mass import weight_of
        from recoil_daq.live.shot import LiveOptions
        from recoil_daq.live.tables import live_display, print_session
        from recoil_daq.serving.page_server import require_server, served_beside
        from recoil_rigs.rig import load_rig
        from recoil_rigs.twin.range_day import is_virtual_rig

        refuse_no_rig(rig, "recoil-daq ingest RIG --live")
        loaded = load_rig(rig)
        nobody = json or is_virtual_rig(loaded)
        weight = None if nobody else weight_of(loaded.knowledge)
        options = LiveOptions(
            out,
            shots,
            first,
            watch,
            files_within_s,
            spare,
            identify=identify,
            asks_mass=not nobody and weight is None,
            weight=weight,
            without=without,
        )
        if serve:
            require_server()
            out.mkdir(parents=True, exist_ok=True)
        with (
            live_display(plain=no_screen, as_json=json) as display,
            served_beside(out, display.notice) if serve else nullcontext(),
        ):
            done = run_live(loaded, options, display)
        document = done.to_json()
        if done.error is not None and not json:
            print_session(document)
        if done.error is not None:
            raise done.error
        code = INTERRUPTED if done.interrupted else OK if done.usable else NOT_VALID
        session.finish(document, lambda: print_session(document), code)


def recover(
    folder: Annotated[
        Path, typer.Argument(help="A journal that was left over, or a folder of shots.", show_default=False)
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder that gets what is recovered.", show_default="where the session wrote")
    ] = None,
    keep: Annotated[bool, typer.Option("--keep", help="Keep the journal when all of it is recovered.")] = False,
    at: Annotated[
        list[float] | None, number("s", "S", "Cut a shot at this instant, s from the journal's first record.", False)
    ] = None,
    discard: Annotated[
        bool, typer.Option("--discard", help="Remove the journal with what is nowhere else, after listing it.")
    ] = False,
    rig: Annotated[
        str | None,
        typer.Option(help="Rig of a journal in which what it says of its session is damaged.", show_default=False),
    ] = None,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Recover what a live acquisition recorded before it crashed or lost its power."""
    with Session(json, debug) as session:
        from recoil_daq.live.recover import recover_folder
        from recoil_daq.live.recovered import recovered_document
        from recoil_daq.live.tables import print_recovered

        with session.steps("recover") as progress:
            done, failed = recover_folder(
                folder, out, keep=keep, discard=discard, at_s=at or (), rig=rig, progress=progress
            )
        document = recovered_document(done)
        if failed and done and not json:
            print_recovered(folder, document)
        if failed:
            raise failed[0]
        code = OK if all(one.elsewhere or one.removed for one in done) else NOT_VALID
        session.finish(document, lambda: print_recovered(folder, document), code)


def log(
    shot: Annotated[
        str | None,
        typer.Argument(
            help="A shot file, or the name of a shot in the folder of --dir.",
            show_default="list all rows",
            autocompletion=complete_shot,
        ),
    ] = None,
    cells: Annotated[
        list[str] | None,
        typer.Argument(help="Cells to set; KEY= empties one.", metavar="KEY=VALUE", show_default="show the row"),
    ] = None,
    folder: Annotated[Path, typer.Option("--dir", help="Folder of the shot files.")] = Path("shots"),
    new_column: Annotated[
        bool, typer.Option("--new-column", help="Add the columns that the shot log does not have.")
    ] = False,
    accept: Annotated[
        bool, typer.Option("--accept", help="Take the log as it is: rows or columns that are missing were taken out.")
    ] = False,
    restore: Annotated[
        bool, typer.Option("--restore", help="Put back what was there when a command last looked and is missing.")
    ] = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Show a shot's row of the shot log, or set cells of it: configuration, added mass, charge, why it is excluded."""
    given = cells_of(cells or [])
    if accept and restore:
        raise typer.BadParameter("takes the log as it is, or puts back what is missing", param_hint="--accept")
    with Session(json, debug) as session:
        from recoil_daq.recording.shot_log_rows import accept_log, log_row, log_rows, restore_log

        if restore:
            restore_log(folder)
        elif accept:
            accept_log(folder)
        if shot is None:
            listed = log_rows(folder)
            session.finish(listed.to_json(), listed.show, OK)
        done = log_row(shot, given, folder=folder, new_column=new_column, sure=session.sure)
        session.finish(done.to_json(), done.show, OK)
