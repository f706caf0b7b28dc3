"""Output of the commands of live acquisition: the session's display, and tables of the documents that programs get."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from recoil_acquisition.devices.tick_clock import TICK_ANCHORS
from recoil_acquisition.errors import quoted
from recoil_acquisition.shot.quality_check import Check
from recoil_daq.live.display import Display
from recoil_daq.live.interruption import as_ctrl_c
from recoil_daq.live.trigger_at_rest import times
from recoil_daq.terminal.overview import print_shots
from recoil_daq.terminal.tables import print_table, say
from recoil_daq.terminal.verdict_line import VerdictLine
from recoil_rigs.tables.specification import mass_decimals


@contextmanager
def live_display(*, plain: bool, as_json: bool) -> Iterator[Display]:
    """Show a live session on the armed screen where there is a terminal that draws, else as plain lines.

    With ``as_json`` stdout is kept for the document, and the lines go to stderr.
    """
    if plain or as_json or not _draws():
        from recoil_daq.live.screen.plain_log import PlainLog

        with as_ctrl_c(), PlainLog(sys.stderr if as_json else sys.stdout) as log:
            yield log
        return
    from recoil_daq.live.screen.armed_screen import ArmedScreen

    with as_ctrl_c(), ArmedScreen() as screen:
        yield screen


def _draws() -> bool:
    """Return whether stdout is a terminal that puts text anywhere: one that says it is dumb would show no state."""
    if not sys.stdout.isatty():
        return False
    from recoil_daq.terminal.console import VisibleConsole

    console = VisibleConsole()
    return console.is_terminal and not console.is_dumb_terminal


def print_session(document: Mapping[str, Any]) -> None:
    """Print a row per shot of a live session, and what of it is in no shot file.

    Parameters
    ----------
    document
        Document of ``ingest --live --json``.
    """
    shots = document["shots"]
    print_shots(f"Live session on rig {document['rig']}: {len(shots)} shots", [_live_shot(shot) for shot in shots])
    for shot in shots:
        if losses := _losses(shot):
            say(f"lost in shot {shot['shot']}: {losses}")
        if shot["capture"] is not None and Path(shot["capture"]).is_file():
            say(f"shot {shot['shot']} is captured in {shot['capture']}")
    if (journal := document["journal"]) is not None:
        say(f"the journal is kept, since not all of it is in a shot file: `recoil-daq recover {quoted(journal)}`")


def _live_shot(shot: Mapping[str, Any]) -> dict[str, str]:
    acquisition, document = shot["acquisition"], shot["ingest"]
    fired = "" if acquisition is None else f"{acquisition['trigger_utc'][:23].replace('T', ' ')} UTC"
    row = {"shot": shot["shot"], "fired": fired, "state": shot["state"], "reason": shot["problem"]}
    if document is None:
        return row
    verdict = VerdictLine.of(document)
    return {**row, "warnings": str(len(verdict.warned)), "reason": shot["problem"] or verdict.first}


def _losses(shot: Mapping[str, Any]) -> str:
    """Return what the quality checks say of frames that are missing, source by source."""
    quality = () if shot["ingest"] is None else shot["ingest"]["quality"]
    checks = [q for q in quality if q["check"] == Check.MISSING_FRAMES and q["verdict"] != "ok"]
    return "; ".join(f"{q['channel']}: {q['detail']}" for q in checks)


def print_acquisition(summary: Mapping[str, Any]) -> None:
    """Print how a shot file's shot was acquired: its trigger's decisions, devices and clocks; nothing if from files."""
    fits = {name: fit for name, fit in summary["clock_fits"].items() if TICK_ANCHORS not in fit}
    if fits:
        rows = [
            (
                name,
                f"{1e6 * fit['drift']:+.1f}",
                "-" if fit["u_drift"] is None else f"{1e6 * fit['u_drift']:.1f}",
                f"{1e6 * fit['u_offset_s']:.1f}",
                ", ".join(f"{step['step_s']:+.6f}" for step in fit["steps"]) or "none",
                f"{1e3 * fit['typical_delay_s']:.2f}",
                f"{1e3 * fit['largest_delay_s']:.2f}",
            )
            for name, fit in fits.items()
        ]
        columns = ("clock", "drift, ppm", "u, ppm", "u offset, us", "steps, s", "host late, ms", "at most, ms")
        print_table("Devices' clocks against the host's", columns, rows, numeric=(1, 2, 3, 5, 6))
    acquisition = summary["acquisition"]
    if acquisition is None:
        return
    decisions = [
        (
            f"{1e3 * d['time_s']:+.2f}",
            d["outcome"],
            d["channel"] or "by hand",
            "" if d["value"] is None else f"{d['value']:.5g}",
            d["reason"],
        )
        for d in acquisition["decisions"]
    ]
    utc, pre_s = acquisition["trigger_utc"].replace("T", " "), acquisition["pre_actual_s"]
    title = f"Triggered {utc} UTC, with {pre_s:.3f} s before it"
    print_table(title, ("time, ms", "decision", "channel", "value", "why not"), decisions, numeric=(0, 3))
    events = [
        (s["name"], f"{1e3 * event['time_s']:+.1f}", event["name"], event["detail"])
        for s in acquisition["sources"]
        for event in s["events"]
    ]
    if events:
        print_table("What happened to the devices", ("source", "time, ms", "event", "detail"), events, numeric=(1,))


def print_recovered(folder: Path, document: Mapping[str, Any]) -> None:
    """Print what was in each journal, and what is to be done with it.

    Parameters
    ----------
    folder
        Folder that was searched for journals.
    document
        Document of ``recover --json``.
    """
    journals = document["journals"]
    if not journals:
        say(f"no journal was left over in {folder}")
    for one in journals:
        rows = [
            (
                s["shot"],
                "there already" if s["was_there"] else "recovered",
                s["shot_file"] or "",
                ", ".join(s["missing"]),
                s["capture"],
            )
            for s in one["shots"]
        ]
        print_table(
            f"Journal {Path(one['journal']).name} of rig {one['rig']}: {one['records']} records read",
            ("shot", "capture", "shot file", "files missing", "path"),
            rows,
        )
        if one["session_by"]:
            say(one["session_by"])
        if one["everything"] is not None:
            say(f"everything that was recorded is in {one['everything']}")
        for s in one["shots"]:
            if s["shot_file"] is None and s["missing"]:
                rig, capture, out = (
                    quoted(place) for place in (one["rig_file"], s["capture"], Path(s["capture"]).parent.parent)
                )
                say(f"finish shot {s['shot']} with `recoil-daq ingest {rig} {capture} FILES --out {out}`")
            if s["problem"]:
                say(f"no shot file of shot {s['shot']} can be made of its capture: {s['problem']}")
            if s["log_fault"]:
                say(f"shot log: {s['log_fault']}")
        if one["outside"]:
            stretches = [
                (f"{o['at_s']:.3f}", o["utc"].replace("T", " "), f"{o['lasting_s']:.3f}", o["why"])
                for o in one["outside"]
            ]
            columns = ("at, s", "UTC", "lasting, s", "what")
            print_table("Outside of every shot", columns, stretches, numeric=(0, 2))
        for line in _state_of(one):
            say(line)


def _state_of(one: Mapping[str, Any]) -> Iterator[str]:
    """Say what became of a journal, what is not in captures, and what is to be done."""
    journal, records, everything = one["journal"], one["records"], one["everything"]
    end = (
        "" if one["in_order"] else "; the session did not end in order, so what is missing at its very end is not known"
    )
    if one["damaged"]:
        yield (
            f"damaged: {records} records were read, {one['lost_records']} are missing, {one['damaged_bytes']} bytes in "
            f"damaged places could not be read{end}"
        )
    else:
        yield f"undamaged: {records} records, none missing between them{end}"
    for loss in one["losses"]:
        yield f"missing of {loss}"
    if one["released_records"]:
        yield f"{one['released_records']} records were released while armed: watched, and nothing happened in them"
    for shot in one["shots"]:
        if not shot["whole"]:
            yield f"the capture of shot {shot['shot']} was there before, and differs from what the journal has of it"
    if not one["everything_whole"]:
        yield f"{everything} was there before, and differs from what the journal has"
    if one["removed"] and one["elsewhere"] and everything is not None:
        yield "the journal is removed: all of it is in these captures, read back and compared"
    elif one["removed"] and one["elsewhere"]:
        yield (
            "the journal is removed: its shots are in captures, read back and compared, and outside of them nothing "
            "happened while it was watched"
        )
    elif one["removed"]:
        yield "the journal is removed, as was asked for"
    elif one["removal_fault"]:
        yield f"all of the journal is in these captures; it cannot be removed: {one['removal_fault']}"
    else:
        yield f"the journal is kept: {journal}"
    if not one["removed"] and one["outside"]:
        yield f"cut a shot out of it with `recoil-daq recover {quoted(journal)} --at SECONDS`"
    if not one["removed"] and not one["elsewhere"]:
        yield f"remove it, with what is nowhere else, with `recoil-daq recover {quoted(journal)} --discard`"


def print_devices(document: Mapping[str, Any]) -> None:
    """Print a row per channel: rate, where it stands, noise; below, what is to be done, the trigger, the stamps.

    Parameters
    ----------
    document
        Document of ``check --devices --json``.
    """
    heard = document["channels"]
    rows = [
        (
            one["channel"] or "(device)", one["source"], f"{one['rate_hz']:.0f}", one["value"] or "-",
            one["noise_shown"] or "-",
            "-" if one["noise_of_range"] is None else f"{100 * one['noise_of_range']:.2g}", one["verdict"],
        )
        for one in heard
    ]  # fmt: skip
    columns = ("channel", "source", "rate, Hz", "is at", "noise", "share, %", "verdict")
    virtual = ", VIRTUAL: played by this program" if document["virtual"] else ""
    title = f"Devices of rig {document['rig']}{virtual}; noise is one standard deviation, and its share of the range"
    print_table(title, columns, rows, numeric=(2, 3, 4, 5))
    conditions = [
        (
            c["channel"], c["level"], c["value"],
            f"{times(c['crossed'])} in {c['listened_s']:g} s" if c["crossed"] else "never",
        )
        for one in heard
        for c in one["triggers"]
    ]  # fmt: skip
    if conditions:
        print_table("Trigger, at rest", ("channel", "level", "is at", "crossed"), conditions, numeric=(1, 2))
    stamps = {one["source"]: one["stamped_by"] for one in heard if one["stamped_by"]}
    if stamps:
        say("stamped by: " + ", ".join(f"{source} by the {stamped}" for source, stamped in stamps.items()))
    for one in heard:
        if one["verdict"] != "ok":
            say(f"{one['verdict']}: {one['channel'] or one['source']}: {one['finding']}")
    failed = sum(one["verdict"] == "fail" for one in heard)
    say(f"{failed} of {len(heard)} rows fail" if failed else f"devices sound: {len(heard)} rows, none fails")


def print_live_demo(document: Mapping[str, Any]) -> None:
    """Print the session, and each shot's mass beside the truth.

    Parameters
    ----------
    document
        Document of ``demo --live --json``.
    """
    print_session(document["session"])
    rows = []
    for d in document["reports"]:
        truth = d["truth"]
        (low, high), places = d["mass"]["U95"], mass_decimals(d["mass"]["u"])
        rows.append(
            (
                d["shot"],
                f"{d['mass']['value']:.{places}f}",
                f"[{low:.{places}f}, {high:.{places}f}]",
                f"{truth['mass_kg']:.{places}f}",
                f"{truth['error_percent']:+.2f}",
                f"{d['rpe_percent']['value']:.2f}",
                "VALID" if d["valid"] else "NOT VALID",
                str(Path(d["folder"]) / "report.html"),
            )
        )
    columns = ("shot", "mass, kg", "95 % interval, kg", "truth, kg", "off by, %", "RPE, %", "", "report")
    print_table("Identified masses", columns, rows, numeric=(1, 2, 3, 4, 5))
