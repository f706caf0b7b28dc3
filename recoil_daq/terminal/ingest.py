"""Output of the commands that make shot files: a shot's verdict, a folder's shots, a row of the shot log."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import visible
from recoil_acquisition.shot import Check, shot_findings
from recoil_acquisition.usability import Usability
from recoil_daq.terminal.console import output_console
from recoil_daq.terminal.tables import print_assumptions, print_table, say
from recoil_daq.terminal.verdict_line import VerdictLine

if TYPE_CHECKING:
    from rich.console import Console

    from recoil_daq.recording.ingest import Ingested
    from recoil_daq.recording.ingest_folder import IngestedFolder
    from recoil_daq.recording.shot_log_rows import Logged, LoggedShots


RANK = ("ok", "warn", "fail")
WORDS: Mapping[Usability, str] = MappingProxyType(
    {Usability.USABLE: "USABLE", Usability.RECORD_ONLY: "FOR THE RECORD ONLY", Usability.NOT_USABLE: "NOT USABLE"}
)
"""State -> what the screens say of it."""
STYLES_OF_STATES: Mapping[Usability, str] = MappingProxyType(
    {Usability.USABLE: "bold green", Usability.RECORD_ONLY: "bold yellow", Usability.NOT_USABLE: "bold red"}
)


def verdict_document(done: Ingested) -> dict[str, Any]:
    """Build the document of ``ingest --json``."""
    from recoil_rigs.assumptions import assumptions_of

    shot = done.shot
    return {
        "schema": "recoil-daq/ingest/1",
        "shot": shot.name,
        "rig": shot.rig_name,
        "file": str(done.path),
        "log_fault": done.log_fault or None,
        "usable": shot.usable,
        "state": shot.state.value,
        "reasons": list(shot.reasons),
        "findings": shot_findings(shot.quality, shot.against_mass),
        "against_mass": [reason.to_json() for reason in shot.against_mass],
        "assumptions": assumptions_of(done.rig),
        "channels": [
            {
                "name": c.name,
                "role": c.role,
                "clock": c.time_base.clock,
                "quantity": c.quantity,
                "unit": c.unit,
                "samples": c.time_base.count,
                "lost": int(c.lost.sum()),
                "rate_hz": _number(c.time_base.rate_hz),
            }
            for c in shot.channels.values()
        ],
        "alignment": [a.to_json() for a in shot.alignments],
        "quality": [c.to_json() for c in shot.quality],
    }


def print_ingested_folder(done: IngestedFolder) -> None:
    """Print a row a shot, the files that were left alone, and at the end every shot that failed, and why."""
    rows = [
        (one.shot, str(len(one.files)), one.worst, one.state, str(len(one.warned)), one.first or str(one.path or ""))
        for one in done.shots
    ]
    columns = ("shot", "files", "verdict", "state", "warnings", "first reason, or file")
    print_table(f"Shots on rig {done.rig.name}", columns, rows, numeric=(1, 4))
    alone: dict[tuple[str, str], list[Path]] = {}
    for path, why in done.left_alone.items():
        alone.setdefault((path.name, why), []).append(path)
    for (name, why), paths in alone.items():
        say(f"left alone: {paths[0] if len(paths) == 1 else f'{name}, {len(paths)} times'}: {why}")
    if done.rows is not None and (said := str(done.rows)):
        say(f"shot log: {said}")
    for fault in dict.fromkeys(f"shot log: {one.log_fault}" for one in done.shots if one.log_fault):
        say(fault)
    for one in done.failed:
        say(f"FAILED {one.shot}: {one.error}")


def print_verdict(document: Mapping[str, Any], console: Console | None = None) -> None:
    """Print a row per channel and clock with its worst finding, and the verdict: the first reason, then the others.

    Parameters
    ----------
    document
        Of `verdict_document`.
    console
        That of stdout if left out.
    """
    console = console or output_console()
    quality = document["quality"]
    known = {channel["name"] for channel in document["channels"]}
    rows = []
    for c in document["channels"]:
        rate = "" if c["rate_hz"] is None else f"{c['rate_hz']:.0f}"
        rows.append((c["name"], c["clock"], rate, str(c["samples"]), *_worst(quality, c["name"], document["reasons"])))
    others = dict.fromkeys(check["channel"] for check in quality if check["channel"] not in known)
    rows += [(name, "", "", "", *_worst(quality, name, document["reasons"])) for name in others]
    print_table(
        f"Shot {document['shot']} on rig {document['rig']}",
        ("channel or clock", "clock", "rate, Hz", "samples", "verdict", "finding"),
        rows,
        numeric=(2, 3),
        console=console,
    )
    print_assumptions(document, console)
    from rich.text import Text

    verdict = VerdictLine.of(document)
    first, *further = verdict.reasons or ("",)
    # one line in one piece: a live region would swallow what does not end a line
    line = Text(WORDS[verdict.state], style=STYLES_OF_STATES[verdict.state])
    line.append(verdict.counted, style="default not bold")
    line.append(f": {visible(first)}" if first else "", style="default not bold")
    for reason in further:
        line.append(f"\nand: {visible(reason)}", style="default not bold")
    if verdict.warned and not first:
        line.append(f", the first: {visible(verdict.first)}", style="default not bold")
    line.append("\n" if verdict.first else " ")
    line.append(f"-> {visible(document['file'])}", style="default not bold")
    console.print(line, soft_wrap=True)
    if document.get("log_fault"):
        said = Text("shot log", style="bold yellow")
        said.append(f": {visible(document['log_fault'])}", style="default not bold")
        console.print(said, soft_wrap=True)


def _worst(quality: Sequence[Mapping[str, str]], channel: str, reasons: Sequence[str]) -> tuple[str, str]:
    """Worst verdict of a channel, with its first fault and how many more, or how many checks it passed.

    What is a reason of the shot's verdict is printed with that, and only named here.
    """
    checks = [c for c in quality if c["channel"] == channel]
    if not checks:
        return "ok", ""
    verdict = max((c["verdict"] for c in checks), key=RANK.index)
    found = [c for c in checks if c["verdict"] == verdict]
    if verdict == "ok":
        clock = next((c for c in checks if c["check"] == Check.ALIGNMENT), None)
        passed = "1 check" if len(checks) == 1 else f"{len(checks)} checks"
        return verdict, clock["detail"] if clock else f"{passed} passed"
    first, *more = found
    is_a_reason = any(first["detail"] in reason for reason in reasons)
    text = f"{first['check']}, see below" if is_a_reason else f"{first['check']}: {first['detail']}"
    return verdict, text + (f"; and {len(more)} more: {', '.join(c['check'] for c in more)}" if more else "")


def print_logged(done: Logged) -> None:
    """Print a shot's row of the shot log, a line for each column."""
    title = f"Shot {done.shot} in {done.path}"
    if done.row is None:
        say(f"{title}: no row; KEY=VALUE adds it")
        return
    rows = [(name, done.cells.get(name, "")) for name in done.columns if name != "shot"]
    if done.before:
        was = {name: text or "(empty)" for name, text in done.before.items()}
        print_table(title, ("column", "cell", "before"), [(*row, was.get(row[0], "")) for row in rows], fold=True)
    else:
        print_table(title, ("column", "cell"), rows, fold=True)
    for doubt in done.row.doubts:
        say(f"doubtful: {doubt}")
    if done.row.added_mass_is_exact:
        say(f"taken as exact: added mass, {done.row.added_mass_kg:g} kg: no u_added_mass_kg is stated")
    if done.row.exclude:
        say(f"excluded where shots are combined: {done.row.exclude}")


def print_log(done: LoggedShots) -> None:
    """Print a row a shot of the shot log, of the columns that are filled."""
    title = f"Shot log {done.path}"
    if not done.rows:
        say(f"{title}: no row; `recoil-daq log SHOT KEY=VALUE` adds one")
    else:
        filled = [name for name in done.columns if name != "shot" and any(name in cells for cells in done.cells)]
        rows = [
            (row.shot, *(cells.get(name, "") for name in filled))
            for row, cells in zip(done.rows, done.cells, strict=True)
        ]
        print_table(title, ("shot", *filled), rows, fold=True)
    if done.without_row:
        say(f"no row: {', '.join(done.without_row)}")
    for row in done.rows:
        for doubt in row.doubts:
            say(f"doubtful, {row.shot}: {doubt}")


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
