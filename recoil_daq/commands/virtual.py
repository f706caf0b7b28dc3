"""Commands of the virtual rig: what to expect, shots that were never fired, the demonstrations."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from recoil_rigs.twin import CampaignPlan

from recoil_daq.commands.options import (
    DebugOption,
    JsonOption,
    OverwriteOption,
    RigArgument,
    VerboseOption,
    cells_of,
    number,
)
from recoil_daq.terminal.session import INTERRUPTED, NOT_VALID, OK, Session


def _uncertainties(words: list[str]) -> dict[str, float]:
    """Read KEY=U words."""
    if not words:  # what reads them loads numpy, and too little memory is to be told first
        return {}
    from recoil_acquisition.quantities.typed_quantity import TypedError, typed_quantity
    from recoil_rigs.shots.stated_uncertainty import unit_of_uncertainty

    stated: dict[str, float] = {}
    for key, text in cells_of(words).items():
        try:
            stated[key] = typed_quantity(text, unit_of_uncertainty(key), difference=True)
        except TypedError as error:
            raise typer.BadParameter(f"--with takes KEY=NUMBER, not {key}={text}: it {error}") from None
    return stated


def predict(
    rig: RigArgument,
    from_shot: Annotated[
        Path | None,
        typer.Option(
            "--from", help="A shot file of this rig: shots to come move as it did.", show_default="the rig's [twin]"
        ),
    ] = None,
    shots: Annotated[int, typer.Option(min=1, max=1000, help="How many shots.")] = 8,
    added_mass: Annotated[float | None, number("kg", "KG", "Every second shot carries so much more.", "none")] = None,
    u_added_mass: Annotated[float | None, number("kg", "KG", "Its standard uncertainty.", "0.05")] = None,
    charges: Annotated[
        str | None,
        typer.Option(metavar="FACTOR,...", help="Of the drive, shot by shot, and over again.", show_default="1"),
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
        float | None, number("", "REL", "Relative standard deviation of the friction from shot to shot.", "0.015")
    ] = None,
    repeatability: Annotated[
        float | None, number("", "REL", "Relative standard deviation of gains from shot to shot.", "0.00015")
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
        from recoil_daq.arguments import refuse_no_rig
        from recoil_daq.campaigns.prediction import check_expected
        from recoil_daq.campaigns.prediction import predict as foretell
        from recoil_rigs.rig import load_rig

        refuse_no_rig(rig, "recoil-daq predict RIG [--from SHOT]")
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


def simulate(
    rig: RigArgument,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0, help="Of the first shot: same seed, same bytes.", show_default="1, of a campaign one of its own"
        ),
    ] = None,
    shots: Annotated[int, typer.Option(min=1, max=9999, help="How many shots.")] = 1,
    campaign_seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Of the sensors' errors, which the shots then share, and of the noise of each unless --seed is given; "
            "the shot log is written, too. "
            "What follows down to --outlier needs it.",
            show_default="each its own",
        ),
    ] = None,
    added_mass: Annotated[
        float | None,
        number(
            "kg",
            "KG",
            "Every second shot carries so much more: the first is bare, the second has it, and so on.",
            "none",
        ),
    ] = None,
    u_added_mass: Annotated[
        float | None, number("kg", "KG", "Its standard uncertainty: it is truly off by one draw.", "0.05")
    ] = None,
    charges: Annotated[
        str | None,
        typer.Option(
            metavar="FACTOR,...",
            help="Of the drive (a gun's peak breech pressure, a line's push), shot by shot, and over again. Name each "
            "twice in a row if every second "
            "shot carries more: else each charge is fired either with it or without.",
            show_default="1",
        ),
    ] = None,
    friction_scatter: Annotated[
        float | None, number("", "REL", "Relative standard deviation of the friction from shot to shot.", "0")
    ] = None,
    repeatability: Annotated[
        float | None,
        number(
            "",
            "REL",
            "Relative standard deviation from shot to shot of the gains of force gauges and recoil accelerometer.",
            "0",
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
    given: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="KEY=VALUE",
            help="Another value of a key of the rig's [twin], such as unread.packing_share=0.02: what is not in the "
            "copied rig file, and in truth.json; may be repeated.",
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
    from recoil_acquisition.files.bounded_toml import typed_value

    settings = {key: typed_value(text) for key, text in cells_of(given or []).items()}
    plan = _campaign_plan({key: value for key, value in options.items() if value not in (None, [])}, shots)
    if plan is not None and campaign_seed is None:
        raise typer.BadParameter("a campaign needs --campaign-seed: its shots share their sensors")
    with Session(json, debug) as session:
        from recoil_daq.arguments import refuse_no_rig
        from recoil_daq.recording.simulate import simulate as fire
        from recoil_rigs.rig import load_rig

        refuse_no_rig(rig, "recoil-daq simulate RIG")
        with session.steps("simulate") as progress:
            done = fire(
                load_rig(rig), out, seed=seed, shots=shots, campaign_seed=campaign_seed, plan=plan, settings=settings,
                progress=progress,
            )  # fmt: skip
        session.finish(done.to_json(), done.show, OK)


def _campaign_plan(given: Mapping[str, Any], shots: int) -> "CampaignPlan | None":
    """Return the plan of a campaign, or None if nothing is planned."""
    if not given:
        return None
    from recoil_daq.campaigns.plan import plan_of_options

    try:
        return plan_of_options(given, shots)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


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
    verbose: VerboseOption = False,
    json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Simulate a shot on the rig `mixed`, ingest its four files, identify its mass, and compare with the truth."""
    if live and campaign:
        raise typer.BadParameter("give either --live or --campaign")
    if campaign:
        with Session(json, debug) as session:
            from recoil_daq.demo import run_campaign_demo

            with session.steps("demo") as progress:
                combined = run_campaign_demo(out, seed=seed, overwrite=overwrite, progress=progress)
            code = OK if combined.combined.valid else NOT_VALID
            session.finish(combined.to_json(), combined.show, code)
    if live:
        _demo_live(out, seed, no_screen, overwrite, json, debug)
        return
    with Session(json, debug) as session:
        from recoil_daq.demo import run_demo

        with session.steps("demo") as progress:
            done = run_demo(out, seed=seed, overwrite=overwrite, progress=progress)
        session.finish(done.to_json(), lambda: done.show(whole=verbose), OK if done.report.valid else NOT_VALID)


def _demo_live(out: Path, seed: int, no_screen: bool, overwrite: bool, json: bool, debug: bool) -> None:
    with Session(json, debug) as session:
        from recoil_daq.demo import run_live_demo
        from recoil_daq.live.tables import live_display

        with live_display(plain=no_screen, as_json=json) as display:
            done = run_live_demo(out, display, seed=seed, overwrite=overwrite)
        if done.outcome.error is not None:
            raise done.outcome.error
        code = INTERRUPTED if done.outcome.interrupted else OK if done.valid else NOT_VALID
        session.finish(done.to_json(), done.show, code)
