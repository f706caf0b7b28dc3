"""Tables of a campaign's answer in a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import visible
from recoil_daq.terminal.console import output_console
from recoil_daq.terminal.report import print_conformity, print_results
from recoil_daq.terminal.tables import print_table, say
from recoil_identification.campaign.signal_kind import SignalKind
from recoil_identification.report.content.campaign_tables import (
    IN_U,
    agreement,
    charted,
    constancy,
    coverage_factor_of,
    looks_asked_for,
    unchanged,
    unread_force,
)
from recoil_identification.report.content.sentences import by_groups, specified
from recoil_identification.report.content.tables import expanded_kg
from recoil_identification.report.results.history import HISTORY
from recoil_rigs.tables.calibration_day import calibrations_in_words
from recoil_rigs.tables.specification import mass_decimals

MOST_STEPS = 3
"""Number of next steps that are printed."""


def print_campaign(document: Mapping[str, Any], folder: Path | None) -> None:
    """Print the mass, what changed, what was learnt of the sensors, and the shots.

    Parameters
    ----------
    document
        Contents of ``campaign.json``.
    folder
        Folder that holds the campaign's page; None where there is none.
    """
    from rich.text import Text

    d = document
    print_table(
        f"Campaign on rig {d['rig']}",
        ("shot", "configuration", "added, kg", "mass, kg", "u, kg", "own u, kg", "w", "by itself", "set aside"),
        [_shot(shot) for shot in d["shots"]],
        numeric=(2, 3, 4, 5, 6),
    )
    print_table(
        "What the shots share",
        ("influence", "known to", "found", "u now", "w"),
        [_common(one) for one in d["common"]],
        numeric=(1, 2, 3, 4),
    )
    print_table(
        "Dynamic scale of each gauge: by how much it reads its force too large in these shots",
        ("gauge", "known to, %", "found, %", "u now, %", "with", "the gauge alone, %", "its u, %"),
        [_gauge(one) for one in d["gauges"]],
        numeric=(1, 2, 3, 5, 6),
    )
    gain, friction = d["repeatability"]["gain_rel"], d["repeatability"]["friction_rel"]
    say(
        f"from shot to shot gains scatter by {100 * gain['value']:.3f} % (95 %: {100 * gain['U95'][0]:.3f} to "
        f"{100 * gain['U95'][1]:.3f} %), friction by {100 * friction['value']:.1f} %"
    )
    for label, text in unread_force(d):
        say(f"{label}: {text}")
    if (cutoff_hz := d["provenance"]["parameters"]["cutoff_hz"]) is not None:
        say(f"low-pass of the mass, one for all shots: {cutoff_hz:.4g} Hz; the shots' masses over time have their own")
    for signal in d["signals"]:
        if signal["kind"] != SignalKind.CHART:
            say(f"changed: {signal['detail']}")
    for said in filter(None, (unchanged(d), agreement(d), constancy(d))):
        say(said)
    if looks := charted(d):
        say(f"{looks_asked_for(len(looks))}:")
    for look in looks:
        say(f"chart: {look}")
    for one in d["next"][:MOST_STEPS]:
        say(f"next: {one['change']}: u {one['u_kg']:.{mass_decimals(one['u_kg'])}f} kg")
    for note in d["notes"]:
        say(f"note: {note}")
    if len(d["configurations"]) > 1:
        for one in d["configurations"]:
            apart, beside = one["difference"], ""
            if apart is not None:
                places = mass_decimals(apart["u"])
                beside = f", {apart['value']:+.{places}f} kg (u {apart['u']:.{places}f} kg) from the first"
            places = mass_decimals(one["mass"]["u"])
            own = f"{one['mass']['value']:.{places}f} kg, u {one['mass']['u']:.{places}f} kg"
            say(f"configuration {one['name']}: {own}{beside}")
    for shot in d["shots"]:
        if shot["use"]:
            say(f"shot {shot['shot']} is not valid by itself ({'; '.join(shot['reasons'])}); {shot['use']}")
    if "history" in d:
        print_results("Earlier campaigns", HISTORY, d, d["history"]["detail"])
    mass = d["mass"]
    low, high = mass["U95"]
    used, places = sum(shot["excluded"] is None for shot in d["shots"]), mass_decimals(mass["u"])
    page = "" if folder is None else f" -> {visible(str(folder / 'campaign.html'))}"
    line = Text("VALID" if d["valid"] else "NOT VALID", style="bold green" if d["valid"] else "bold red")
    line.append(
        f" mass {mass['value']:.{places}f} kg, u {mass['u']:.{places}f} kg, U {expanded_kg(mass):.{places}f} kg "
        f"(k = {coverage_factor_of(d):.2f}), 95 %: {low:.{places}f} to {high:.{places}f} kg, from {used} of "
        f"{len(d['shots'])} shots{page}",
        style="default not bold",
    )
    console = output_console()
    console.print(line, soft_wrap=True)
    for reason in d["reasons"]:
        say(f"  {reason}")
    if dated := calibrations_in_words(d):
        say(f"  {'but' if d['valid'] else 'and'} {dated}")
    print_conformity(d)
    say(f"it is {d['measurand']}")
    if parts := by_groups(d):
        say(parts)
    if mass["E_n"] is not None:
        of = specified(d)
        consists = f", {of}" if of is not None and " + " in of else ""
        say(
            f"specification {mass['specification']:g} kg{consists}, nothing added: deviation "
            f"{mass['deviation_kg']:+.{places}f} kg, {mass['deviation_percent']:+.2f} %, E_n {mass['E_n']:+.2f} with "
            "k = 2"
        )


def print_campaign_demo(document: Mapping[str, Any]) -> None:
    """Print a demonstrated campaign beside the truth.

    Parameters
    ----------
    document
        Document of ``demo --campaign --json``.
    """
    combined, truth = document["campaign"], document["truth"]
    print_campaign(combined, Path(document["folder"]))
    u_percent = 100 * combined["mass"]["u"] / combined["mass"]["value"]
    error_percent = truth["error_percent"]
    mass = f"{truth['mass_kg']:.{mass_decimals(combined['mass']['u'])}f} kg"
    say(f"true mass {mass}: the campaign is {error_percent:+.3f} % off, u {u_percent:.3f} %")


def _shot(shot: Mapping[str, Any]) -> tuple[str, ...]:
    added = f"{shot['added_mass_kg']:g}" if shot["added_mass_kg"] else ""
    own, w, places = shot["own_u_kg"], shot["normalised_residual"], mass_decimals(shot["mass"]["u"])
    return (
        shot["shot"],
        shot["configuration"],
        added,
        f"{shot['mass']['value']:.{places}f}",
        f"{shot['mass']['u']:.{places}f}",
        "" if own is None else f"{own:.{places}f}",
        "" if w is None else f"{w:+.1f}",
        "valid" if shot["valid"] else "not valid",
        shot["excluded"] or "",
    )


def _gauge(one: Mapping[str, Any]) -> tuple[str, ...]:
    own = one["gauge"]
    found = (f"{100 * share:{places}f}" for share, places in (
        (one["known_u"], ".2"), (one["value"], "+.2"), (one["u"], ".2"), (own["value"], "+.2"), (own["u"], ".2")
    ))  # fmt: skip
    known, value, u, of_gauge, u_gauge = found
    return f"{one['force']}, sensor {one['sensors']}", known, value, u, ", ".join(one["beside"]), of_gauge, u_gauge


def _common(one: Mapping[str, Any]) -> tuple[str, ...]:
    shares = one["unit"] == "1" and one["prior_u"] < 1.0
    scale, places, unit = (
        (100.0, ".3f", " %") if shares else (1.0, ".3g", f" {IN_U if one['unit'] == '1' else one['unit']}")
    )
    return (
        one["influence"],
        f"{scale * one['prior_u']:{places}}{unit}",
        # of a force of unknown shape only its size is told
        "" if one["value"] is None else f"{scale * one['value']:+{places}}{unit}",
        f"{scale * one['u']:{places}}{unit}",
        "" if one["normalised_residual"] is None else f"{one['normalised_residual']:+.1f}",
    )
