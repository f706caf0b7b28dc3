"""Output of the commands: aligned tables for people, one document for programs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.visible_text import visible
from recoil_daq.console import output_console

if TYPE_CHECKING:
    from rich.console import Console

    from recoil_daq.check import Checked
    from recoil_daq.demo import Demonstration
    from recoil_daq.identify import Reported
    from recoil_daq.ingest import Ingested
    from recoil_daq.logged import Logged
    from recoil_daq.shot_folder import IngestedFolder
    from recoil_daq.targets import TargetReported

STYLES = {"ok": "green", "warn": "yellow", "fail": "bold red"}
RANK = ("ok", "warn", "fail")


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    numeric: Sequence[int] = (),
    console: Console | None = None,
    fold: bool = False,
) -> None:
    """Print a table on stdout; cells that are a verdict are coloured, columns of numbers stand to the right.

    On a terminal too narrow for it, cells but the last column's end in an ellipsis; with `fold`, those but the first
    column's go on below.
    """
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for i, column in enumerate(columns):
        table.add_column(
            column, justify="right" if i in numeric else "left", no_wrap=i == 0 if fold else i < len(columns) - 1,
            overflow="fold" if fold else "ellipsis",
        )  # fmt: skip
    for row in rows:
        cells = [escape(visible(cell)) for cell in row]
        table.add_row(*(f"[{STYLES[c]}]{c}[/]" if c in STYLES else c for c in cells))
    console = console or output_console()
    console.print(title, style="italic", markup=False, soft_wrap=True)
    console.print(table)


def say(text: str) -> None:
    """Print one line on stdout as it is."""
    output_console().print(text, markup=False, soft_wrap=True)


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
        "reasons": list(shot.reasons),
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
        (one.shot, str(len(one.files)), "fail" if one.error else "warn" if one.reasons else "ok", one.state,
         "; ".join(one.reasons) if one.path is None or one.reasons else str(one.path))
        for one in done.shots
    ]  # fmt: skip
    print_table(
        f"Shots on rig {done.rig.name}", ("shot", "files", "verdict", "state", "reasons, or file"), rows, numeric=(1,)
    )
    alone: dict[tuple[str, str], list[Path]] = {}
    for path, why in done.left_alone.items():
        alone.setdefault((path.name, why), []).append(path)
    for (name, why), paths in alone.items():
        say(f"left alone: {paths[0] if len(paths) == 1 else f'{name}, {len(paths)} times'}: {why}")
    for fault in dict.fromkeys(f"shot log: {one.log_fault}" for one in done.shots if one.log_fault):
        say(fault)
    for one in done.failed:
        say(f"FAILED {one.shot}: {one.error}")


def print_verdict(document: Mapping[str, Any], console: Console | None = None) -> None:
    """Print a row per channel and clock with its worst finding, and one line that says usable or not.

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
    _print_assumptions(document, console)
    from rich.text import Text

    # one line in one piece: a live region would swallow what does not end a line
    if document["usable"]:
        warned = sum(check["verdict"] == "warn" for check in quality)
        line = Text("USABLE", style="bold green")
        line.append(f", {warned} warning{'' if warned == 1 else 's'}" if warned else "", style="default not bold")
    else:
        line = Text("NOT USABLE", style="bold red")
        line.append(f": {visible('; '.join(document['reasons']))}\n", style="default not bold")
    line.append(f"{' ' if document['usable'] else ''}-> {visible(document['file'])}", style="default not bold")
    console.print(line, soft_wrap=True)
    if document.get("log_fault"):
        said = Text("shot log", style="bold yellow")
        said.append(f": {visible(document['log_fault'])}", style="default not bold")
        console.print(said, soft_wrap=True)


def _print_assumptions(document: Mapping[str, Any], console: Console) -> None:
    """Print what is taken for granted, a line for each kind of it."""
    from recoil_rigs.assumptions import assumption_lines

    for line in assumption_lines(document.get("assumptions", ())):
        console.print(line, markup=False, soft_wrap=True)


def _worst(quality: Sequence[Mapping[str, str]], channel: str) -> tuple[str, str]:
    """Worst verdict of a channel, with its first fault and how many more, or how many checks it passed."""
    checks = [c for c in quality if c["channel"] == channel]
    if not checks:
        return "ok", ""
    verdict = max((c["verdict"] for c in checks), key=RANK.index)
    found = [c for c in checks if c["verdict"] == verdict]
    if verdict == "ok":
        clock = next((c for c in checks if c["check"] == "alignment"), None)
        passed = "1 check" if len(checks) == 1 else f"{len(checks)} checks"
        return verdict, clock["detail"] if clock else f"{passed} passed"
    first, *more = found
    text = f"{first['check']}: {first['detail']}"
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
    if done.row.added_mass_is_exact:
        say(f"taken as exact: added mass, {done.row.added_mass_kg:g} kg: no u_added_mass_kg is stated")
    if done.row.exclude:
        say(f"excluded where shots are combined: {done.row.exclude}")


def reports_document(
    reports: Sequence[Reported],
    targets: Sequence[TargetReported] = (),
    repeats: Mapping[str, tuple[str, str]] | None = None,
) -> dict[str, Any]:
    """Build the document of ``identify --json``; `repeats` is the verdict on the repeatability by rig."""
    return {
        "schema": "recoil-daq/identify/1",
        "reports": [{"folder": str(r.folder), **r.document} for r in reports],
        "targets": [{"folder": str(t.folder), **t.document} for t in targets],
        "repeatability": [
            {"rig": rig, "verdict": verdict, "detail": detail} for rig, (verdict, detail) in (repeats or {}).items()
        ],
    }


def print_repeatability(repeats: Mapping[str, tuple[str, str]]) -> None:
    """Print whether the shots of each rig repeat; nothing where there was one shot only."""
    for rig, (verdict, detail) in repeats.items():
        say(f"repeatability on rig {rig}: {verdict}, {detail}")


def print_report(report: Reported, logged: Sequence[tuple[str, str]] = ()) -> None:
    """Print one shot's mass, its methods, and what speaks against it.

    Parameters
    ----------
    logged
        Label and text of what the shot log says of it.
    """
    d = report.document
    print_table(
        f"Shot {d['shot']} on rig {d['rig']}: specification {d['mass']['specification']:g} kg",
        ("method", "mass, kg", "u, kg", "deviation, %", "RPE, %", "identified, %", "how"),
        [
            (
                f"{m['name']} *" if m["name"] == d["mass"]["method"] else m["name"],
                _fixed(m["mass_kg"], 2),
                _fixed(m["u_kg"], 2),
                _fixed(m["deviation_percent"], 2, sign=True),
                _fixed(m["rpe_percent"], 2),
                _fixed(None if m["identified_share"] is None else 100 * m["identified_share"], 0),
                m["note"],
            )
            for m in d["methods"]
        ],
        numeric=(1, 2, 3, 4, 5),
    )
    console = output_console()
    if logged:
        console.print("; ".join(f"{label}: {text}" for label, text in logged), markup=False, soft_wrap=True)
    low, high = d["mass"]["U95"]
    rpe = d["rpe_percent"]
    console.print(
        f"mass {_fixed(d['mass']['value'], 2)} kg, 95 % interval [{_fixed(low, 2)}, {_fixed(high, 2)}] kg, "
        f"E_n {_fixed(d['E_n'], 2, sign=True)}"
        + (
            ", no RPE: there is no mass over time by this method"
            if rpe["value"] is None
            else f", RPE {_fixed(rpe['value'], 2)} % [{_fixed(rpe['U95'][0], 2)}, {_fixed(rpe['U95'][1], 2)}]"
        ),
        markup=False,
        soft_wrap=True,
    )
    if rpe["value"] is not None:
        console.print(rpe["meaning"], markup=False, soft_wrap=True)
    said = d["filter"]
    basis = {"given": "as asked for", "shot": "by this shot's spectra", "campaign": "by the spectra of all shots"}
    console.print(
        f"low-pass at {said['cutoff_hz']:.4g} Hz, {basis.get(said['basis'], said['reason'])}",
        markup=False,
        soft_wrap=True,
    )
    for note in d["notes"]:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    _print_assumptions(d, console)
    if d["valid"] and d["deviation"]:
        console.print("[bold yellow]VALID[/],", end=" ")
        console.print(d["deviation"], markup=False, soft_wrap=True)
    elif d["valid"]:
        console.print("[bold green]VALID[/]", end=" ")
    else:
        console.print("[bold red]NOT VALID[/]:", end=" ")
        console.print("; ".join(d["reasons"]), markup=False, soft_wrap=True)
    console.print(f"-> {report.folder / 'report.html'}", markup=False, soft_wrap=True)


def demo_document(done: Demonstration) -> dict[str, Any]:
    """Build the document of ``demo --json``."""
    return {
        "schema": "recoil-daq/demo/1",
        "usable": done.ingested.shot.usable,
        "shot_file": str(done.ingested.path),
        "truth": dict(done.simulated.truth),
        "folder": str(done.report.folder),
        "report": done.report.document,
    }


def print_demo(done: Demonstration) -> None:
    """Print the verdict on the shot, the methods, and the mass beside the truth."""
    done.ingested.show()
    done.report.show()
    truth = done.report.document["truth"]
    paper = next(m for m in done.report.document["methods"] if m["name"] == "paper")
    against = 100 * (paper["mass_kg"] / truth["mass_kg"] - 1)
    output_console().print(
        f"truth {truth['mass_kg']:.2f} kg: this report is off by {truth['error_percent']:+.2f} %, "
        f"the published method by {against:+.2f} %",
        markup=False,
    )


def rig_document(checked: Checked) -> dict[str, Any]:
    """Build the document of ``check --json``."""
    from recoil_rigs.assumptions import assumptions_of

    rig = checked.rig
    return {
        "schema": "recoil-daq/check/1",
        "rig": rig.name,
        "file": str(rig.path),
        "faults": [],
        "warnings": [{"key": one.key, "problem": one.problem} for one in rig.warnings],
        "assumptions": assumptions_of(rig),
        "sources": [{"name": s.name, "kind": s.kind} for s in rig.sources],
        "channels": [{"name": c.name, "source": c.source, "role": c.role} for c in rig.channels],
        "files": list(checked.files),
    }


def print_rig(checked: Checked, document: Mapping[str, Any]) -> None:
    """Print a sound rig's channels, as recorded files have them where some were given, and what is unusual.

    Parameters
    ----------
    document
        Its `rig_document`.
    """
    rig = checked.rig
    rows = [
        (
            c.name, c.source, c.signal, c.unit or "as in the file", c.role,
            f"{100 * c.sensor.u_scale_rel:g}" if c.sensor.states_u_rel else "-",
            "" if c.sensor.due is None else str(c.sensor.due),
        )
        for c in rig.channels
    ]  # fmt: skip
    print_table(
        f"Rig {rig.name}: no fault",
        ("channel", "source", "signal", "unit", "role", "u, %", "due"),
        rows,
        numeric=(5,),
        fold=True,
    )
    found = [
        (c["name"], f["file"], f["reader"], c["unit"] or "", str(c["samples"]), _fixed(c["rate_hz"], 0))
        for f in checked.files
        for c in f["channels"]
    ]
    if found:
        print_table(
            "Recorded files", ("channel", "file", "format", "unit", "samples", "rate, Hz"), found, numeric=(4, 5)
        )
    for one in rig.warnings:
        say(f"warning: {one}")
    _print_assumptions(document, output_console())


def print_summary(summary: Mapping[str, Any]) -> None:
    """Print what is in a shot file."""
    rows = [
        (
            str(c["name"]), str(c["clock"]), str(c["unit"]), _fixed(c["rate_hz"], 0), str(c["count"]),
            str(c["lost"]), str(c["role"]),
        )
        for c in summary["channels"]
    ]  # fmt: skip
    print_table(
        f"Shot {summary['shot']} on rig {summary['rig']}",
        ("channel", "clock", "unit", "rate, Hz", "samples", "lost", "role"),
        rows,
        numeric=(3, 4, 5),
    )
    if summary["started"]:
        say(f"started {summary['started']} ({summary['started_source'] or 'by an unknown clock'})")
    else:
        say("started: no file says when")
    print_table(
        "Clocks",
        ("clock", "offset, ms", "u, us", "drift, ppm", "status", "method"),
        [
            (
                str(a["clock"]), _fixed(_scaled(a["offset_s"], 1e3), 4), _fixed(_scaled(a["u_offset_s"], 1e6), 1),
                _fixed(_scaled(a["drift"], 1e6), 1), str(a["status"]), str(a["method"]),
            )
            for a in summary["alignments"]
        ],
        numeric=(1, 2, 3),
    )  # fmt: skip
    files = [(str(f["file"]), str(f["source"]), str(f["reader"]), str(f["sha256"])[:16]) for f in summary["inputs"]]
    print_table("Files", ("file", "source", "reader", "sha256"), files)
    word = "usable" if summary["usable"] else "not usable"
    output_console().print(word, markup=False)


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value


def _fixed(value: float | None, decimals: int, *, sign: bool = False) -> str:
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:+.{decimals}f}" if sign else f"{value:.{decimals}f}"


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
