"""Output of the commands that make shot files: a shot's verdict, a folder's shots, a row of the shot log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import visible
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.usability import Usability
from recoil_acquisition.store.shot_log_row import ShotLogRow
from recoil_daq.terminal.console import output_console
from recoil_daq.terminal.overview import print_shots
from recoil_daq.terminal.tables import print_assumptions, print_table, say
from recoil_daq.terminal.verdict_line import VerdictLine

if TYPE_CHECKING:
    from rich.console import Console

RANK = ("ok", "warn", "fail")
WORDS: Mapping[Usability, str] = MappingProxyType(
    {Usability.USABLE: "USABLE", Usability.RECORD_ONLY: "FOR THE RECORD ONLY", Usability.NOT_USABLE: "NOT USABLE"}
)
"""State -> words of the screens for it."""
STYLES_OF_STATES: Mapping[Usability, str] = MappingProxyType(
    {Usability.USABLE: "bold green", Usability.RECORD_ONLY: "bold yellow", Usability.NOT_USABLE: "bold red"}
)


def print_ingested_folder(document: Mapping[str, Any]) -> None:
    """Print a row a shot, the files that were left alone, and at the end every shot that failed, and why.

    Parameters
    ----------
    document
        Document of ``ingest --batch --json``.
    """
    shots = document["shots"]
    rows = [
        {
            "shot": one["shot"], "files": str(len(one["files"])), "check": one["verdict"], "state": one["state"],
            "warnings": str(len(one["warnings"])),
            "reason": next(iter((*one["reasons"], *one["warnings"])), "") or one["file"] or "",
        }
        for one in shots
    ]  # fmt: skip
    print_shots(f"Shots on rig {document['rig']}", rows, "first reason, or file")
    alone: dict[tuple[str, str], list[str]] = {}
    for one in document["left_alone"]:
        alone.setdefault((Path(one["file"]).name, one["why"]), []).append(one["file"])
    for (name, why), paths in alone.items():
        say(f"left alone: {paths[0] if len(paths) == 1 else f'{name}, {len(paths)} times'}: {why}")
    if (log := document["shot_log"]) is not None and (said := "; ".join(_taken_rows(log))):
        say(f"shot log: {said}")
    for fault in dict.fromkeys(f"shot log: {one['log_fault']}" for one in shots if one["log_fault"]):
        say(fault)
    for one in shots:
        if one["error"] is not None:
            say(f"FAILED {one['shot']}: {one['error']}")


def _taken_rows(log: Mapping[str, Any]) -> Iterator[str]:
    """Say which rows of a log beside recorded files were taken, and which stayed as they are."""
    if log["taken"]:
        rows = f"row {log['taken'][0]} is" if len(log["taken"]) == 1 else f"rows {', '.join(log['taken'])} are"
        yield f"{rows} taken from {log['file']}"
    for shot, cells in log["kept"].items():
        other = ", ".join(f"{name} {value}" for name, value in cells.items())
        yield f"the row of {shot} stays as it is, {log['file']} has {other}"


def print_verdict(document: Mapping[str, Any], console: Console | None = None) -> None:
    """Print a row per channel and clock with its worst finding, and the verdict: the first reason, then the others.

    Parameters
    ----------
    document
        Document of ``ingest --json``.
    console
        Console to print on; that of stdout if left out.
    """
    console = console or output_console()
    quality = document["quality"]
    known = {channel["name"] for channel in document["channels"]}
    rows = []
    for c in document["channels"]:
        rate = "" if c["rate_hz"] is None else f"{c['rate_hz']:.0f}"
        rows.append((c["name"], c["clock"], rate, str(c["samples"]), *_worst(quality, c["name"])))
    others = dict.fromkeys(check["channel"] for check in quality if check["channel"] not in known)
    rows += [(name, "", "", "", *_worst(quality, name)) for name in others]
    print_table(
        f"Shot {document['shot']} on rig {document['rig']}",
        ("channel or clock", "clock", "rate, Hz", "samples", "verdict", "finding"),
        rows,
        numeric=(2, 3),
        console=console,
    )
    print_assumptions(document, console)
    print_state(document, console)


def print_state(document: Mapping[str, Any], console: Console | None = None) -> None:
    """Print what a shot is good for, why not, and where its file is."""
    from rich.text import Text

    verdict = VerdictLine.of(document)
    first, *further = verdict.reasons or ("",)
    # one line in one piece: a live region would swallow what does not end a line
    line = Text(WORDS[verdict.state] + verdict.without.upper(), style=STYLES_OF_STATES[verdict.state])
    line.append(verdict.counted, style="default not bold")
    line.append(f": {visible(first)}" if first else "", style="default not bold")
    for reason in further:
        line.append(f"\nand: {visible(reason)}", style="default not bold")
    if verdict.warned and not first:
        line.append(f", the first: {visible(verdict.first)}", style="default not bold")
    line.append("\n" if verdict.first else " ")
    line.append(f"-> {visible(document['file'])}", style="default not bold")
    console = console or output_console()
    console.print(line, soft_wrap=True)
    if document.get("log_fault"):
        said = Text("shot log", style="bold yellow")
        said.append(f": {visible(document['log_fault'])}", style="default not bold")
        console.print(said, soft_wrap=True)


def _worst(quality: Sequence[Mapping[str, str]], channel: str) -> tuple[str, str]:
    """Worst verdict of a channel, with its first fault and how many more, or how many checks it passed.

    A check that failed is a reason of the shot's verdict, is printed with that, and only named here.
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
    text = f"{first['check']}, see below" if verdict == "fail" else f"{first['check']}: {first['detail']}"
    return verdict, text + (f"; and {len(more)} more: {', '.join(c['check'] for c in more)}" if more else "")


def print_logged(document: Mapping[str, Any]) -> None:
    """Print a shot's row of the shot log, a line for each column.

    Parameters
    ----------
    document
        Document of ``log SHOT --json``.
    """
    title = f"Shot {document['shot']} in {document['file']}"
    if document["row"] is None:
        say(f"{title}: no row; KEY=VALUE adds it")
        return
    cells, row = document["cells"], ShotLogRow.of_json(document["row"])
    rows = [(name, cells.get(name, "")) for name in document["columns"] if name != "shot"]
    if document["before"]:
        was = {name: text or "(empty)" for name, text in document["before"].items()}
        print_table(title, ("column", "cell", "before"), [(*one, was.get(one[0], "")) for one in rows], fold=True)
    else:
        print_table(title, ("column", "cell"), rows, fold=True)
    for doubt in document["doubts"]:
        say(f"doubtful: {doubt}")
    if row.added_mass_is_exact:
        say(f"taken as exact: added mass, {row.added_mass_kg:g} kg: no u_added_mass_kg is stated")
    if row.exclude:
        say(f"excluded where shots are combined: {row.exclude}")


def print_log(document: Mapping[str, Any]) -> None:
    """Print a row a shot of the shot log, of the columns that are filled.

    Parameters
    ----------
    document
        Document of ``log --json`` without a shot.
    """
    title, rows = f"Shot log {document['file']}", document["rows"]
    if not rows:
        say(f"{title}: no row; `recoil-daq log SHOT KEY=VALUE` adds one")
    else:
        texts = document["cells"]
        filled = [name for name in document["columns"] if name != "shot" and any(name in cells for cells in texts)]
        lines = [
            (row["shot"], *(cells.get(name, "") for name in filled)) for row, cells in zip(rows, texts, strict=True)
        ]
        print_table(title, ("shot", *filled), lines, fold=True)
    if document["without_row"]:
        say(f"no row: {', '.join(document['without_row'])}")
    for row in rows:
        for doubt in ShotLogRow.of_json(row).doubts:
            say(f"doubtful, {row['shot']}: {doubt}")
