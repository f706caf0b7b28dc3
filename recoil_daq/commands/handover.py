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


def certificate(
    of: Annotated[
        Path,
        typer.Argument(
            metavar="CAMPAIGN|SHOT",
            help="A campaign.json or report.json, its folder, or the name of a shot whose report is in reports.",
            show_default=False,
        ),
    ],
    header: Annotated[
        Path,
        typer.Option(
            metavar="FILE",
            help="A file with the identity of the certificate: number, issue, date, approval, item, place, operator, "
            "tolerance_kg, decision_rule and the other keys of a rig's [report].",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder of the certificate.")] = Path("certificate"),
    sign: Annotated[
        Path | None,
        typer.Option(
            metavar="PEM",
            help="A private key with its X.509 certificate, in one file: detached CMS signatures are written beside. "
            "Needs the extra `sign`.",
            show_default=False,
        ),
    ] = None,
    sign_with: Annotated[
        str,
        typer.Option(
            metavar="COMMAND",
            help="Your own program that signs, such as 'gpg --detach-sign --output {signature} {file}'.",
            show_default=False,
        ),
    ] = "",
    dcc: Annotated[
        bool,
        typer.Option(
            "--dcc",
            help="Write certificate.xml, too: a digital calibration certificate (PTB, schema 3.3.0), for the programs "
            "of the customer. The header states the `country` of the laboratory.",
        ),
    ] = False,
    overwrite: OverwriteOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Write the certificate of a shot or a campaign: identity, results, decision rule, calibrations, signature."""
    if sign is not None and sign_with:
        raise typer.BadParameter("give either --sign or --sign-with")
    with Session(json, debug) as session:
        from recoil_acquisition.errors import ErrorCode, IdentificationError
        from recoil_daq.certificates.certificate import certificate as make

        try:
            with session.steps("certificate") as progress:
                done = make(
                    of, header, out=out, sign=sign, sign_with=sign_with, dcc=dcc, overwrite=overwrite, progress=progress
                )
        except IdentificationError as error:
            if error.code != ErrorCode.NOT_VALID:
                raise
            session.refuse(error, NOT_VALID)
        session.finish(done.to_json(), done.show, OK if done.document["valid"] else NOT_VALID)


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
