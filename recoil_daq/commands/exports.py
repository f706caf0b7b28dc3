"""The command that writes shots, and reports, in other formats."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from recoil_daq.commands.options import DebugOption, JsonOption, OverwriteOption, quantity
from recoil_daq.terminal.session import NOT_VALID, OK, Session


def export(
    shot: Annotated[Path, typer.Argument(help="A shot file; of `gtc` a report, or its folder.", show_default=False)],
    format_name: Annotated[
        str,
        typer.Option(
            "--format",
            help="Or what another package adds; csv and parquet are read again by `ingest`; gtc, of a report, is its "
            "mass with its influences for the GUM Tree Calculator.",
            metavar="mdf4|mat|uff58|tdms|parquet|csv|dewesoft-text|gtc",
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
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate",
            parser=quantity("Hz", positive=True),
            help="Put all channels on one grid of so many samples a second, aligned; what it loses is said.",
            metavar="HZ",
            show_default="each channel's own instants",
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Write a shot's channels in another format, verified, and say what is exact and what is lost."""
    from recoil_acquisition.exporters.table import exporter_names

    if format_name == "gtc":
        if channel or aligned or class_filter is not None or rate is not None:
            raise typer.BadParameter("a report has no channels: gtc takes --out and --overwrite alone")
        with Session(json, debug) as session:
            from recoil_daq.reports.gtc_export import export_report

            exported = export_report(shot, out=out, overwrite=overwrite)
            session.finish(exported.to_json(), exported.show, OK)
    if format_name not in (names := exporter_names()):
        raise typer.BadParameter(f"{format_name!r} is none of {', '.join((*names, 'gtc'))}")
    with Session(json, debug) as session:
        from recoil_acquisition.processes.reader_process import READER

        READER.start()
        from recoil_daq.arguments import named_shot
        from recoil_daq.recording.export import export as write_export

        shot = named_shot(shot)
        with session.steps(f"export {shot.name}") as progress:
            done = write_export(
                shot, format_name, out=out, channels=channel or (), aligned=aligned, overwrite=overwrite,
                frequency_class=None if class_filter is None else int(class_filter.removeprefix("cfc-")),
                rate_hz=rate, progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, OK if done.complete else NOT_VALID)
