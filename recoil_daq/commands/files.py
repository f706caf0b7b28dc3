"""Commands that look at rigs and files, and draft rigs."""

from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from recoil_daq.commands.options import DebugOption, JsonOption, OverwriteOption, RigArgument
from recoil_daq.terminal.session import INTERRUPTED, NOT_VALID, OK, Session

if TYPE_CHECKING:
    from recoil_daq.drafting.init import DraftedRig


def check(
    rig: RigArgument,
    files: Annotated[
        list[Path] | None,
        typer.Argument(help="Recorded files, one for each source, to check the rig against.", show_default=False),
    ] = None,
    devices: Annotated[
        bool, typer.Option("--devices", help="Open each device, listen, and judge each channel.")
    ] = False,
    keep: Annotated[
        Path | None,
        typer.Option(
            help="Write all that the recorder says and is told in 30 s to a file, with --devices.", show_default=False
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Draw the mechanism, with what the rig states of each symbol."),
    ] = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Report every fault of a rig file, of calibrations, of recorded files against it, and of devices."""
    if files and devices:
        raise typer.BadParameter("give either FILES or --devices")
    if keep is not None and not devices:
        raise typer.BadParameter("--keep goes with --devices")
    with Session(json, debug) as session:
        from recoil_daq.arguments import refuse_no_recordings, refuse_no_rig
        from recoil_daq.recording.check import check_rig

        refuse_no_rig(rig, "recoil-daq check RIG [FILES...]")
        refuse_no_recordings(files or (), "recoil-daq check RIG [FILES...]")
        drawn: dict[str, Any] = {}
        if explain:
            from recoil_daq.recording.mechanism_summary import mechanism_document
            from recoil_daq.terminal.mechanism import print_mechanism

            # a rig of which much is still to be stated is the one whose symbols are looked up
            drawn = {"mechanism": mechanism_document(rig)}
            if not json:
                print_mechanism(drawn["mechanism"])
        with session.steps("check") as progress:
            checked = check_rig(rig, files or (), progress=progress)
        if devices:
            from recoil_daq.live.device_check import check_devices, device_document
            from recoil_daq.live.first_contact import FirstContact
            from recoil_daq.live.tables import print_devices

            kept = nullcontext() if keep is None else FirstContact(keep, overwrite=overwrite)
            with kept as contact, session.steps("listen") as progress:
                heard = check_devices(checked.rig, keep=contact, progress=progress)
            sound = all(one.verdict != "fail" for one in heard)
            document = device_document(checked.rig, heard) | drawn
            session.finish(document, lambda: print_devices(document), OK if sound else NOT_VALID)
        session.finish(checked.to_json() | drawn, checked.show, OK)


def init(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Recorded files of one shot, one for each recorder, bus, port or camera.", show_default=False
        ),
    ],
    other: Annotated[
        Path | None,
        typer.Option("--from", help="A rig file, finished or not, whose values are taken over.", show_default=False),
    ] = None,
    database: Annotated[
        list[Path] | None, typer.Option(help="A CAN database; may be repeated.", show_default=False)
    ] = None,
    sensors: Annotated[
        list[Path] | None,
        typer.Option(
            help="A table of the sensors' certificates (CSV), or digital ones (DCC, XML); may be repeated, and more of "
            "these may stand among the files.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="The rig file.")] = Path("rig.toml"),
    overwrite: OverwriteOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Draft a rig file from recorded files: what they tell is filled in, what only a person knows is asked for.

    In a terminal each open value is asked for, and Enter leaves it open, or takes what is proposed; else they stand in
    the file as texts that begin with TODO, which `recoil-daq check` counts.
    """
    with Session(json, debug) as session:
        if any(one.suffix == ".h5" for one in files):
            from recoil_acquisition.processes.reader_process import READER

            READER.start()
        from recoil_daq.drafting.init import check_free, draft_rig
        from recoil_daq.drafting.interview import Interview

        check_free(out, overwrite=overwrite)

        def look(answered: Mapping[str, Any]) -> "DraftedRig":
            with session.steps("init") as progress:
                return draft_rig(
                    files, databases=database or (), sensors=sensors or (), other=other, answered=answered, out=out,
                    progress=progress,
                )  # fmt: skip

        interview = Interview(look)
        ended = False
        if session.asks:
            from recoil_daq.drafting.asking import ask, print_how_to_answer
            from recoil_daq.terminal.init import print_interrupted

            print_how_to_answer()
            try:
                interview.hold(ask)
            except KeyboardInterrupt:
                if not interview.answers:
                    raise
                ended = True
        drafted = interview.drafted
        drafted.write(overwrite=overwrite)
        if ended:
            drafted.show()
            print_interrupted(out, len(interview.answers))
            raise typer.Exit(INTERRUPTED)
        session.finish(drafted.to_json(), drafted.show, NOT_VALID if drafted.lacks else OK)


def formats(json: JsonOption = False, debug: DebugOption = False) -> None:
    """List the formats of files that are read, and what each needs."""
    with Session(json, debug) as session:
        from recoil_daq.recording.file_summary import formats_document
        from recoil_daq.terminal.file import print_formats

        document = formats_document()
        session.finish(document, lambda: print_formats(document), OK)


def show(
    file: Annotated[
        Path, typer.Argument(help="A shot file, a file of any instrument, or a CAN database.", show_default=False)
    ],
    database: Annotated[
        Path | None,
        typer.Argument(help="A CAN database that explains the frames of FILE, without a rig.", show_default=False),
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option(help="Rig that declares what an instrument's file does not carry.", show_default=False),
    ] = None,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Print what is in a shot file, or in a file of any instrument; exit code 1 if that one was cut off."""
    if rig is not None and database is not None:
        raise typer.BadParameter("give either a database or --rig, which names its own")
    with Session(json, debug) as session:
        if file.suffix == ".h5":
            from recoil_acquisition.processes.reader_process import READER

            READER.start()
        from recoil_acquisition.store import is_shot_file, shot_summary
        from recoil_daq.live.tables import print_acquisition
        from recoil_daq.terminal.file import print_summary

        if not file.exists():
            from recoil_daq.arguments import named_shot

            file = named_shot(file)
        if database is not None or not is_shot_file(file):
            from recoil_daq.arguments import refuse_no_recordings
            from recoil_daq.recording.file_summary import (
                is_database,
                log_and_database,
                summarise_database,
                summarise_file,
            )
            from recoil_daq.terminal.file import print_database, print_file
            from recoil_rigs.rig import load_rig

            refuse_no_recordings([file], "recoil-daq show FILE --rig RIG")
            if database is not None:
                file, database = log_and_database(file, database)
            elif is_database(file):
                content = summarise_database(file)
                session.finish(content, lambda: print_database(content), OK)
            document = summarise_file(file, None if rig is None else load_rig(rig), database)
            session.finish(document, lambda: print_file(document), NOT_VALID if document["incomplete"] else OK)
        summary = shot_summary(file)

        def print_all() -> None:
            print_summary(summary)
            print_acquisition(summary)

        session.finish(summary, print_all, OK)
