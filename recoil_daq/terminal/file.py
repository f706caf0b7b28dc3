"""Tables of files: a shot file, an instrument's, those that an export or the virtual rig wrote, and the formats."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import quoted
from recoil_acquisition.readers.can.frames import DATE_FAULT
from recoil_daq.terminal.console import output_console
from recoil_daq.terminal.tables import fixed, print_table, say
from recoil_daq.terminal.verdict_line import VerdictLine

MOST_IDENTIFIERS = 40
"""Number of a CAN log's identifiers that are listed; the document has them all."""


def print_formats(document: Mapping[str, Any]) -> None:
    """Print which formats are read, and what each needs."""
    rows = [
        (
            str(row["format"]),
            str(row["kind"]),
            " ".join(row["suffixes"]),
            str(row["recognised"]),
            _needs(row),
        )
        for row in document["formats"]
    ]
    print_table("Files that are read", ("format", "kind of source", "usual endings", "recognised", "needs"), rows)


def _needs(row: Mapping[str, Any]) -> str:
    if row["extra"] is None:
        return ""
    return f"extra {row['extra']}: {'installed' if row['installed'] else row['remedy']}"


def print_database(document: Mapping[str, Any]) -> None:
    """Print a row per signal of a CAN database, as a rig file names it."""
    rows = [
        (s["name"], s["unit"], m["identifier"], str(m["bytes"]))
        for m in document["messages"]
        for s in m["signals"] or [{"name": f"{m['name']} (no signals)", "unit": ""}]
    ]
    number = len(document["messages"])
    messages = f"{number} message{'' if number == 1 else 's'}"
    title = f"{document['file']}: CAN database, {messages}, {document['bytes']:,} bytes"
    print_table(title, ("signal", "unit", "identifier", "bytes"), rows, numeric=(3,))
    for note in document["notes"]:
        say(f"note: {note}")
    say(
        'a rig names it in a source: kind = "can", database = '
        f'"{Path(document["file"]).name}", match = "*.blf" or what its logs are called'
    )


def print_file(document: Mapping[str, Any]) -> None:
    """Print what is in an instrument's file."""
    rows = [
        (
            str(s["name"]),
            str(s["unit"]),
            str(s["samples"]),
            "-" if s["rate_hz"] is None else f"{s['rate_hz']:.6g}",
            str(s["spacing"]),
            _seconds(s["start_s"]),
            _seconds(s["end_s"]),
        )
        for s in document["signals"]
    ]
    title = f"{document['file']}: {document['format']}, {document['bytes']:,} bytes"
    if rows:
        columns = ("signal", "unit", "samples", "rate, Hz", "spacing", "from, s", "to, s")
        print_table(title, columns, rows, numeric=(2, 3, 5, 6))
    else:
        say(f"{title}: no signals")
    if document.get("left_out"):
        listed = list(document["left_out"].items())
        print_table("What the file holds, and why it is no signal", ("name", "what it is"), listed)
    identifiers = document["metadata"].get("unknown_identifiers") if document["kind"] == "can" else None
    if identifiers:
        shown = list(identifiers.items())[:MOST_IDENTIFIERS]
        listed = [(str(identifier), str(frames)) for identifier, frames in shown]
        print_table("Identifiers that no database explains", ("identifier", "frames"), listed, numeric=(1,))
        if len(identifiers) > len(shown):
            say(f"and {len(identifiers) - len(shown)} more: see --json")
        name, database = Path(document["file"]), document.get("database")
        if not rows and database is not None:
            say(
                f"{Path(database).name} knows none of them: it is another bus's database, or another bus's log; "
                f"`recoil-daq show {quoted(database)}` lists its messages"
            )
        elif not rows:
            say(
                f"their signals have names by a database: `recoil-daq show {quoted(name)} <file>.dbc` "
                f'(.kcd, .sym, .arxml); in a rig, a source with kind = "can", match = "*{name.suffix}" '
                'and database = "<file>.dbc"'
            )
    buses = document["metadata"].get("buses", {}) if document["kind"] == "can" else {}
    if len(buses) > 1:
        counted = ", ".join(f"{bus} ({frames} frames)" for bus, frames in buses.items())
        say(f"buses: {counted}; `bus` of a source in the rig file takes one")
    if document["tracks"]:
        say(f"tracks: {', '.join(document['tracks'])}")
    start = document["absolute_start"]
    if start is None and document["metadata"].get(DATE_FAULT):
        say("time zero: what the file says of it is not understood")
    elif start is None:
        say("time zero: the file does not say when it was")
    else:
        zone = "zone unknown" if start["zone"] == "unknown" else start["zone"]
        say(f"time zero: {start['text']}, {zone} ({start['origin']})")
    if document["incomplete"]:
        output_console().print(f"cut off: {document['incomplete']}", markup=False, style="bold red", soft_wrap=True)
    for note in document["notes"]:
        say(f"note: {note}")


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.6f}"


def print_summary(summary: Mapping[str, Any]) -> None:
    """Print what is in a shot file."""
    rows = [
        (
            str(c["name"]), str(c["clock"]), str(c["unit"]), fixed(c["rate_hz"], 0), str(c["count"]),
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
                str(a["clock"]), fixed(a["offset_s"], 4, scale=1e3), fixed(a["u_offset_s"], 1, scale=1e6),
                fixed(a["drift"], 1, scale=1e6), str(a["status"]), str(a["method"]),
            )
            for a in summary["alignments"]
        ],
        numeric=(1, 2, 3),
    )  # fmt: skip
    files = [(str(f["file"]), str(f["source"]), str(f["reader"]), str(f["sha256"])[:16]) for f in summary["inputs"]]
    print_table("Files", ("file", "source", "reader", "sha256"), files)
    verdict = VerdictLine.of(summary)
    say(str(verdict))
    for reason in verdict.reasons[1:]:
        say(f"and: {reason}")


def print_exported(document: Mapping[str, Any]) -> None:
    """Print a row per exported file, what each lost, and what concerns all of them.

    Parameters
    ----------
    document
        Document of ``export --json``.
    """
    files = document["files"]
    rows = [
        (
            Path(file["file"]).name, ", ".join(file["clocks"]), str(len(file["channels"])), str(file["samples"]),
            size_text(file["bytes"]), _numbers(file),
        )
        for file in files
    ]  # fmt: skip
    print_table(
        f"Shot {document['shot']} on rig {document['rig']} as {document['format']}",
        ("file", "clock", "channels", "samples", "size", "numbers"),
        rows,
        numeric=(2, 3, 4),
    )
    everywhere = [loss for loss in files[0]["losses"] if all(loss in file["losses"] for file in files)]
    for file in files:
        for loss in file["losses"]:
            if loss not in everywhere:
                say(f"lost in {Path(file['file']).name}: {loss}")
    for loss in everywhere:
        say(f"lost: {loss}")
    for note in document["notes"]:
        say(f"note: {note}")
    say(f"-> {Path(files[0]['file']).parent}")


def _numbers(file: Mapping[str, Any]) -> str:
    if file["left_out"]:
        return f"{len(file['left_out'])} channels left out"
    return "exact" if file["exact"] else "rounded"


def size_text(size: int) -> str:
    """Write bytes as people read them."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size} B"


def print_simulated(document: Mapping[str, Any]) -> None:
    """Print where each shot's files are, and its true mass.

    Parameters
    ----------
    document
        Document of ``simulate --json``.
    """
    rows = [
        (
            Path(s["folder"]).name, f"{s['truth']['m3']:g}", " ".join(Path(file).name for file in s["files"]),
            s["folder"],
        )
        for s in document["shots"]
    ]  # fmt: skip
    print_table("Simulated shots", ("shot", "true mass, kg", "files", "folder"), rows, numeric=(1,))
    if "shot_log" in document:
        say(f"shot log: {document['shot_log']}")
    elif len(rows) > 1:
        say("each shot has sensors of its own; with --campaign-seed N they share them, as a campaign needs")
